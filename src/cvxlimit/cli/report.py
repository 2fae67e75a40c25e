"""What commands show and refuse: tables of text, verdicts, files that cannot be written."""

from __future__ import annotations

import importlib.util
import os
import tempfile
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from cvxlimit.base.doors import Door
from cvxlimit.base.files import write_file
from cvxlimit.base.lines import one_line
from cvxlimit.cli.shell import complain
from cvxlimit.errors import InputError, ModelError
from cvxlimit.masonry import BUILTIN
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.reductions.choice import PLANAR_FROM, Reductions
from cvxlimit.reductions.explaining import duration, expected_seconds
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, Solution, Status
from cvxlimit.solution.bracket import Bracket
from cvxlimit.solution.said import basis_of, said
from cvxlimit.surfaces.coulomb import needed_surfaces

if TYPE_CHECKING:
    from pandas import DataFrame

PICTURES = (".png", ".html", ".vtu", ".svg", ".pdf", ".gif", ".mp4")
"""What a solution can be drawn as."""

LIBRARIES = dict.fromkeys({*PICTURES} - {".html"}, ("pictures", "Matplotlib", "plot"))
LIBRARIES[".vtu"] = ("files for ParaView", "PyVista", "pyvista")
"""What files by suffix are, the library that they need, and the extra that brings it."""

SCENE_PICTURES = (".png", ".html", ".svg", ".pdf")
"""What a scene without a solution can be drawn as."""


def check_outputs(
    outputs: Iterable[tuple[str, Path | None, Collection[str]]], inputs: Mapping[str, str]
) -> None:
    """Refuse output files that cannot be written, are taken, or end wrongly.

    ``outputs`` are an option, its file and the suffixes that are possible, none if all are;
    ``inputs`` names what each file that is read is, by path.
    """
    seen = {os.path.realpath(path): name for path, name in inputs.items()}
    for option, path, suffixes in outputs:
        if path is None:
            continue
        typed = f"{option}{path}" if option.endswith(":") else f"{option} {path}"
        if reason := _obstacle(path):
            raise InputError(f"{typed}: {reason}")
        if (place := os.path.realpath(path)) in seen:
            taken = seen[place].removesuffix(":")
            raise InputError(f"{typed}: this is the file of {taken}; choose another name")
        seen[place], suffix = option, path.suffix.lower()
        if isinstance(suffixes, Door):
            suffixes.check(suffix, f"{typed}: {suffix}")
        if suffixes and suffix not in suffixes:
            raise InputError(f"{typed}: the name must end in {', '.join(suffixes)}")
        if not suffixes or suffix not in LIBRARIES:
            continue
        what, library, extra = LIBRARIES[suffix]
        if importlib.util.find_spec(library.lower()) is None:
            without = " (.html works without it)" if ".html" in suffixes else ""
            raise ModelError(
                f"{typed}: {what} need {library}: pip install 'cvxlimit[{extra}]'{without}"
            )


def files_asked(
    asked: Any, *names: str, reads: Mapping[str, str] | None = None, **kinds: Collection[str]
) -> list[tuple[str, str]]:
    """Check the files that a command on one scene writes, by the names of its options, and return
    the rows that say where they are."""
    suffixes = dict.fromkeys(names, ()) | kinds
    files = [(f"--{name}", getattr(asked, name), ends) for name, ends in suffixes.items()]
    check_outputs(files, {**scene_file(asked.scene), **(reads or {})})
    return [("written", str(file)) for _, file, _ in files if file is not None]


def scene_file(name: str) -> dict[str, str]:
    """What is read for a scene of that name."""
    return {} if name in BUILTIN else {name: "the scene"}


def write_rows(path: Path | None, table: DataFrame) -> None:
    """Write a table to the CSV file that is asked for, if one is."""
    if path is not None:
        write_file(path, table.to_csv(index=False).encode("utf-8"))


def _obstacle(path: Path) -> str:
    if os.path.isdir(path):
        return "this is a folder; name a file in it"
    if not os.path.isdir(path.parent):
        return f"there is no folder {str(path.parent)!r}; create it first"
    try:
        if os.path.exists(path) and not os.path.isfile(path):  # a device or a pipe
            return "" if os.access(path, os.W_OK) else "it cannot be written to; choose another"
        with suppress(FileNotFoundError):
            os.stat(path)
        with tempfile.TemporaryFile(dir=path.parent):
            return ""
    except OSError as error:
        return f"no file can be written there ({error.strerror}); choose another place"


def summary(solution: Solution, files: Sequence[str], other: Solution | None = None) -> Table:
    """The verdict, in short rows for somebody who reads three lines; ``other`` is without
    dilatancy."""
    told = said(solution)
    verdict = Text(told.value, style="bold").append(f"   {told.standing}", _style(solution))
    rows: list[tuple[str, str | Text]] = [(solution.quantity, verdict)]
    if solution.surface_name != "conic" or solution.interaction != "none":
        rows.append(("model", _model(solution)))
    rows += [(name, Text(row, style="yellow")) for name, row in told.rows]
    if solution.lumped is not None and solution.lumped.is_worth_a_word:
        rows.append(("geometry", Text(solution.lumped.row, style="yellow")))
    if other is not None:
        rows.append(("without", f"{said(other).value} if sliding opens no joint: {other.standing}"))
    elif told.option and solution.quantity == LOAD_FACTOR:
        rows.append(("report", f"{told.report}: {told.option}{_time(solution, told.method)}"))
    return facts([*rows, *(("written", file) for file in files)])


def _model(solution: Solution) -> str:
    bending = f"; bending: {solution.interaction}, {solution.moments} moments"
    return f"{solution.surface_name} surface" + (bending if solution.interaction != "none" else "")


def _time(solution: Solution, method: str) -> str:
    is_plane, scene = "planar" in solution.model, solution.solved_scene
    if method and scene is not None and solution.contacts < PLANAR_FROM:
        # other methods take its plane at any size
        found = Reductions.of(Assemblage.of(scene), needed_surfaces(solution.surfaces))
        is_plane = found.plane is not None
    seconds = expected_seconds(solution.contacts, is_plane)
    return f" ({duration(seconds[method])})" if method in seconds else ""


def details(solution: Solution, origin: str, tolerance: float | None) -> Table:
    """What the verdict rests on: size, model, basis, names, shares, solvers and times."""
    asked = "" if tolerance is None else f" (asked: {tolerance:g})"
    blocks = counted(solution.blocks, "free block")
    bracket, end = solution.bracket, solution.lower_end
    solvers = Counter(one_line(iterate.solver) for iterate in solution.history)
    return facts(
        [
            ("scene", f"{solution.scene_name} ({origin})"),
            ("size", f"{blocks} x {counted(solution.contacts, 'contact')}"),
            ("friction", _friction(solution.solved_scene)),
            ("surface", solution.surface_name),
            ("flow", solution.flow),
            ("reduced", ", ".join(solution.model)),
            ("bracket", f"{bracket}, {_width(bracket)}{asked}" if bracket.has_any else ""),
            ("lower end", "" if end is None else f"{end.bracket}, {_width(end.bracket)}"),
            ("basis", basis_of(solution)),
            ("dilatancy", str(solution.dilatancy or "")),
            ("lumped", str(solution.lumped or "")),
            ("solver", ", ".join(f"{name} ({counted(n, 'solve')})" for name, n in solvers.items())),
            ("time in s", ", ".join(f"{name} {t:.3f}" for name, t in solution.seconds.items())),
        ]
    )


def _width(bracket: Bracket) -> str:
    return f"relative width {bracket.width:.1e}" if bracket.has_both else "one bound"


def _friction(scene: Scene | None) -> str:
    """Told, for a scene of one's own or a generator may have left it at its default."""
    if scene is None:
        return ""
    others = sorted(set(scene.contact_friction.values()) - {scene.friction})
    return f"{scene.friction:g}" + (
        f", elsewhere {others[0]:g} to {others[-1]:g}" if others else ""
    )


def facts(rows: Sequence[tuple[str, str | Text]]) -> Table:
    table = _columns()
    for name, fact in rows:
        if fact:
            table.add_row(one_line(name), one_line(fact) if isinstance(fact, str) else fact)
    return table


def warn_of_geometry(scene: Scene) -> None:
    """What detection leaves out or simplifies."""
    for remark in scene.told:
        complain(remark)


def advice(solution: Solution) -> str:
    general = solution.advice
    return solution.note if general in solution.note else general


def verdict(solution: Solution) -> str:
    """Why there is no good answer, in one sentence, and what to do.

    A reaction that has no limit is the answer to another question than the load factor's, whose
    words do not fit.
    """
    if solution.status is Status.UNBOUNDED and solution.quantity != LOAD_FACTOR:
        return (
            f"the {solution.quantity} has no limit: blocks wedged between supports hold any, and "
            "forces that do were found and checked: ask for another direction, or for the other "
            "reaction"
        )
    if solution.dilatancy is not None and solution.dilatancy.is_all:
        return f"{solution.standing}: {solution.note}"
    return f"{solution.status}: {advice(solution)}"


def listing(scenes: Mapping[str, tuple[Scene, str]]) -> Table:
    table = _columns(header=True)
    table.add_column("name", no_wrap=True)
    table.add_column("blocks", justify="right", no_wrap=True)
    table.add_column("contacts", justify="right", no_wrap=True)
    table.add_column("description")
    for name, (scene, description) in scenes.items():
        table.add_row(name, str(len(scene.free)), str(len(scene.contacts)), description)
    return table


def _columns(header: bool = False) -> Table:
    return Table(box=None, show_header=header, pad_edge=False, padding=(0, 2, 0, 0))


def _style(solution: Solution) -> str:
    if solution.is_answered:
        return "green"
    return "yellow" if solution.status.has_answer else "red"


def counted(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"
