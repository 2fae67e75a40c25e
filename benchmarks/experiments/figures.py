"""Which of the chosen figures in the source matter.

A chosen figure is a number that somebody wrote into a constant of a module or into the default of
a field of a class. For each of them that thirty small scenes read (ten built-in ones, ten random
walls, ten with interaction, nine more with brackets that stay open), a round value and the value
of its neighbour are tried: the scenes that read it are solved again with the source changed in that
place alone. A row says whether an end of any bracket moved by more than a tenth of the bracket's
width, and whether the processor time of all these scenes changed by more than 5 %. Brackets
narrower than the tolerance asked for count as that wide: nobody asked for more. Scenes are solved
in processes of their own, which import the package anew; times are those of the least of several
runs beside runs with the figure as it is, and a time that seems to have changed is measured again
before it counts.

A figure that moves nothing is one that may go, or become its neighbour. One that no scene reads
belongs to something else (domains, pictures, solvers of others), and is not listed.
"""

from __future__ import annotations

import ast
import dis
import json
import math
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

from benchmarks.experiment import Head, Lines, Title, experiment

ROOM = Path(__file__).parents[2] / "src" / "cvxlimit"

LEFT_OUT = (
    "extensions/dilatancy", "extensions/importing", "plotting", "cli", "io",
    "masonry",
)  # fmt: skip
"""Folders whose figures are another matter: drawing, sizes of built-in scenes, other methods."""

MOVED = 0.1
"""Share of a bracket's width by which an end must move to count."""

SLOWER = 0.05
"""Change of time that counts."""

ASKED = 1e-5
"""The default tolerance, which a bracket need not be narrower than."""

REPEATS = 5
"""Pairs of runs by which a change of time is settled."""


@dataclass(frozen=True)
class Figure:
    """A chosen figure: where it stands, under which name, and its text there."""

    path: str
    owner: str
    name: str
    line: int
    span: tuple[int, int]  # in the file's UTF-8 bytes
    value: float

    @property
    def label(self) -> str:
        return f"{self.path}:{self.line} {self.owner}{self.name}"


def chosen() -> Iterator[Figure]:
    """All of them, but for those in folders that are left out."""
    for path in sorted(ROOM.rglob("*.py")):
        inside = path.relative_to(ROOM).as_posix()
        if inside.startswith(LEFT_OUT):
            continue
        data = path.read_bytes()
        tree = ast.parse(data)
        starts = [0]
        for line in data.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        owners = [("", tree.body)] + [
            (f"{node.name}.", node.body)
            for node in ast.walk(tree)
            if isinstance(node, ast.ClassDef)
        ]
        for owner, body in owners:
            for item in body:
                if not isinstance(item, ast.Assign | ast.AnnAssign) or item.value is None:
                    continue
                target = item.targets[0] if isinstance(item, ast.Assign) else item.target
                value = number(item.value)
                if not isinstance(target, ast.Name) or value is None:
                    continue
                at, end = item.value, item.value.end_col_offset or 0
                span = starts[at.lineno - 1] + at.col_offset, starts[at.lineno - 1] + end
                yield Figure(inside, owner, target.id, at.lineno, span, value)


def number(value: ast.expr) -> float | None:
    """A plain number other than 0 and 1, which are seldom chosen; None for anything else."""
    try:
        found = ast.literal_eval(value)
    except ValueError:
        return None
    is_number = isinstance(found, int | float) and not isinstance(found, bool)
    return found if is_number and math.isfinite(found) and found not in (0, 1) else None


def others(figure: Figure, among: list[Figure], has_neighbour: bool) -> list[float]:
    """A round value, and the neighbour's: values to try in place of a figure."""
    value, kind = figure.value, type(figure.value)
    exponent = math.floor(math.log10(abs(value)) + 0.5)
    powers = (10.0 ** (exponent + i) for i in (0, 1, -1))
    if kind is int:
        nearest = min(
            (5, 2, 10, 20, 50, 100, 1000, 10_000), key=lambda v: abs(math.log(v / abs(value)))
        )
        tried: list[float] = [nearest if nearest != value else 2 * value]
    else:
        tried = [math.copysign(next(p for p in powers if not math.isclose(p, abs(value))), value)]
    near = [
        f.value for f in among
        if f.path == figure.path and type(f.value) is kind and f.value != value
        and f.value * value > 0.0
    ]  # fmt: skip
    if near and has_neighbour:
        tried.append(min(near, key=lambda v: abs(math.log(v / value))))
    return tried


def scenes_of(kind: str) -> dict[str, tuple[Any, dict[str, Any]]]:
    """By name: a scene, and how it is solved."""
    from cvxlimit import builtin_scene
    from cvxlimit.masonry import random_wall

    if kind == "plain":
        names = (
            "single-block", "stack", "ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3",
            "arch", "tuff-wall", "arch-on-piers", "flying-buttress", "barrel-vault",
        )  # fmt: skip
        found: dict[str, Any] = {name: (builtin_scene(name), {}) for name in names}
        return found | {f"wall {seed}": (random_wall(seed), {}) for seed in range(10)}
    if kind == "hard":  # brackets that stay open without branching, and some that need it
        from cvxlimit import Certified

        large = {seed: random_wall(seed, sizes=((3, 5), (4, 4))) for seed in (3, 40, 41)}
        climbs = [Certified(moments=m, branching_seconds=0.0) for m in ("independent", "paper")]
        found = {
            f"wall {seed}, {climb.moments}": (wall, {"method": climb})
            for seed, wall in large.items()
            for climb in climbs
        }
        closed = {"method": Certified(tolerance=2e-3, branching_seconds=60.0)}
        sizes = ((2, 2), (2, 3), (3, 2))
        return found | {
            f"wall {seed}, closed": (random_wall(seed, sizes=sizes), closed)
            for seed in (20, 21, 22)
        }
    plain: dict[str, Any] = {}
    paper, tight = {"moments": "paper"}, {"tolerance": 1e-2}
    how = (plain, plain, plain, {"moments": "signed"}, paper, paper, tight, tight, tight, tight)
    sizes = ((2, 2), (2, 3), (3, 2))
    walls = {f"wall {s} with interaction": random_wall(s, sizes=sizes) for s in range(20, 30)}
    asked = ({"method": "certified"} | options for options in how)
    return {
        name: (wall, options) for (name, wall), options in zip(walls.items(), asked, strict=True)
    }


Found = dict[str, tuple[float, float, float]]
"""By scene: lower and upper bound, and processor time."""


def solved(kind: str, names: set[str], runs: int) -> Found:
    """Bounds, and the least time of so many runs; the first of all warms the process up."""
    from cvxlimit import builtin_scene, solve

    solve(builtin_scene("single-block"))
    found: Found = {}
    for name, (scene, options) in scenes_of(kind).items():
        if name not in names:
            continue
        len(scene.contacts)
        spent = []
        for _ in range(runs):
            start = time.process_time()
            try:
                bracket = solve(scene, **options).bracket
                ends = bracket.lower, bracket.upper
            except Exception:  # a value that is refused moves everything
                ends = math.nan, math.nan
            spent.append(time.process_time() - start)
        found[name] = (*ends, min(spent))
    return found


def names_read(kind: str, most: int) -> dict[str, list[str]]:
    """By scene: names that are loaded by functions which it runs, or when modules are imported."""
    codes: set[CodeType] = set()

    def seen(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and "cvxlimit" in frame.f_code.co_filename:
            codes.add(frame.f_code)

    from cvxlimit import solve

    found: dict[str, list[str]] = {}
    for name, (scene, options) in list(scenes_of(kind).items())[:most]:
        codes.clear()
        sys.setprofile(seen)
        solve(scene, **options)
        sys.setprofile(None)
        found[name] = sorted({read for code in codes for read in _loaded(code)})
    return found


def _loaded(code: CodeType) -> Iterator[str]:
    for step in dis.get_instructions(code):
        is_name = step.opname.startswith("LOAD_") and step.opname != "LOAD_CONST"
        if is_name and isinstance(step.argval, str):
            yield step.argval


def at_import() -> set[str]:
    """Names that modules themselves read when they are imported: defaults, and what follows."""
    found: set[str] = set()
    for path in ROOM.rglob("*.py"):
        code = compile(path.read_bytes(), str(path), "exec")
        found |= set(_loaded(code))
        for part in code.co_consts:  # bodies of classes
            if isinstance(part, CodeType) and not part.co_flags & 0x2:
                found |= set(_loaded(part))
    return found


def changed_source(figure: Figure, value: float) -> None:
    """From here on this process imports the figure's module with another value."""
    spec = find_spec("cvxlimit")
    assert spec is not None
    assert spec.origin is not None
    target = Path(spec.origin).parent / figure.path
    data = target.read_bytes()
    start, end = figure.span
    edited = data[:start] + repr(value).encode() + data[end:]
    plain = SourceFileLoader.get_code

    def get_code(self: SourceFileLoader, fullname: str) -> CodeType | None:
        if Path(self.path) == target:
            return compile(edited, self.path, "exec", dont_inherit=True)
        return plain(self, fullname)

    SourceFileLoader.get_code = get_code  # type: ignore[method-assign, assignment]


def forgotten() -> None:
    """What this process has loaded of the package, other experiments' imports among them, is loaded
    again when it is asked for."""
    for name in [name for name in sys.modules if name.split(".")[0] == "cvxlimit"]:
        del sys.modules[name]


def in_a_child(what: Any) -> Any:
    """What the function returns in a process of its own; None where that does not live."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        try:
            text = json.dumps(what())
        except BaseException as error:
            sys.stderr.write(f"    {error!r}\n")
            text = "null"
        with os.fdopen(writer, "w") as file:
            file.write(text)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as file:
        text = file.read()
    os.waitpid(child, 0)
    return json.loads(text or "null")


def trial(kind: str, names: set[str], changed: tuple[Figure, float] | None, runs: int) -> Any:
    def run() -> Found:
        forgotten()
        if changed is not None:
            changed_source(*changed)
        return solved(kind, names, runs)

    return in_a_child(run)


def moved(base: Found, found: Found) -> dict[str, float]:
    """By scene whose bracket moved: by which share of its width."""
    shares = {}
    for name, (lower, upper, _) in found.items():
        low, high, _ = base[name]
        width = max(high - low, ASKED * max(abs(low), abs(high)))
        share = max(abs(lower - low), abs(upper - high)) / width
        if not share <= MOVED:
            shares[name] = share
    return shares


def spent(found: Found) -> float:
    return sum(seconds for _, _, seconds in found.values())


def verdict(
    kind: str, names: set[str], figure: Figure, value: float, base: Found,
    is_timed: bool,
) -> str:  # fmt: skip
    """What another value of a figure does: to brackets, to time; "" for nothing."""
    found = trial(kind, names, (figure, value), 3 if is_timed else 1)
    if found is None:
        return "refused"
    shares = moved(base, found)
    if (
        shares
    ):  # a busy machine moves brackets that end by the clock: what moves as it is says nothing
        as_it_is = moved(base, trial(kind, set(shares), None, 1))
        shares = {name: share for name, share in shares.items() if name not in as_it_is}
    if shares or not is_timed:
        worst = max(shares, key=shares.__getitem__, default="")
        return f"{shares[worst]:.2f} widths, {worst}" if worst else ""
    ratio = spent(found) / spent({name: base[name] for name in found})
    if abs(ratio - 1.0) <= SLOWER:
        return ""
    ratios = []
    for _ in range(REPEATS):  # side by side, since a busy machine changes from minute to minute
        before = trial(kind, names, None, 3)
        after = trial(kind, names, (figure, value), 3)
        ratios.append(spent(after) / spent(before))
    ratio = sorted(ratios)[REPEATS // 2]
    return f"{100.0 * (ratio - 1.0):+8.0f} % of time" if abs(ratio - 1.0) > SLOWER else ""


@experiment()
def figures(
    only: str = "", kinds: Sequence[str] = ("plain", "interaction"), scenes: int = 10,
    timed: bool = False, neighbours: bool = False, listed: bool = False,
) -> Lines:  # fmt: skip
    """Which chosen figures matter: those whose place and name hold a text, on so many scenes.

    Of brackets unless ``timed``, which takes three times as long, with round values, and those of
    ``neighbours``; figures are merely ``listed`` where asked.
    """
    known = list(chosen())
    wanted = [figure for figure in known if only in figure.label]
    if listed:
        yield Head("figure", "value")
        yield from ((figure.label, figure.value) for figure in wanted)
        return
    import cvxpy  # noqa: F401  what children share
    import scipy.optimize  # noqa: F401

    always = at_import()
    for kind in kinds:
        read = in_a_child(lambda kind=kind: names_read(kind, scenes))
        base = trial(kind, set(read), None, 3)
        again = trial(kind, set(read), None, 3)
        steady = {name for name in read if not moved({name: base[name]}, {name: again[name]})}
        yield Title(kind)
        yield f"{len(steady)} scenes, {spent(base):.1f} s"
        yield from (f"not the same twice: {name}" for name in sorted(set(read) - steady))
        yield Head("figure", "is", "tried", "scenes", "what moved")
        for figure in wanted:
            names = {name for name in steady if figure.name in read[name] or figure.name in always}
            for value in others(figure, known, neighbours) if names else ():
                said = verdict(kind, names, figure, value, base, timed) or "nothing"
                yield figure.label, figure.value, value, len(names), said
