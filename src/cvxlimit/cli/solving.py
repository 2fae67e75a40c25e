"""Commands that take one scene: ``solve``, ``settle``, ``explain`` and ``show``."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

import os
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import typer
from rich.text import Text

from cvxlimit.base.checks import meant
from cvxlimit.base.doors import Door
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import (
    EFFORT,
    OUTPUT,
    argument,
    command_of,
    either,
    model_option,
    option,
    result_option,
    surface_option,
    vector,
)
from cvxlimit.cli.report import (
    PICTURES,
    SCENE_PICTURES,
    VOICE,
    ExitCode,
    check_outputs,
    complain,
    counted,
    details,
    facts,
    files_asked,
    refuse,
    scene_file,
    show,
    summary,
    verdict,
    warn_of_geometry,
)
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io import export, read_scene, write_result
from cvxlimit.io.exporting import EXPORTS
from cvxlimit.io.fields import encoded, one_line
from cvxlimit.io.results import result_to_dict
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.methods.settlement import settlement
from cvxlimit.methods.solving import TABLE, solve
from cvxlimit.plotting import PICTURES as PICTURES_OF
from cvxlimit.plotting import picture_of, plot, plot_scene, refused
from cvxlimit.plotting.look import IMAGES
from cvxlimit.readings.named import MOMENTS
from cvxlimit.reductions.explaining import BUDGET, explain
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


def plot_option() -> Any:
    return option(
        "[KIND:]FILE",
        f"Draw the mechanism, or what KIND says: {either(PICTURES_OF)}. Repeatable.",
        group=OUTPUT,
    )


def report_option() -> Any:
    return option("FILE.html", "Page to print and to sign.", group=OUTPUT)


def scene_named(name: str) -> Scene:
    """The scene of a built-in name, which wins, or of a file."""
    if name in BUILTIN:
        return builtin_scene(name)
    looks_like_file = Path(name).suffix or Path(name).name != name
    if looks_like_file or os.path.exists(name):
        geometry = {*Door("cvxlimit.readers")} - {".json"}
        if Path(name).suffix.lower() in geometry and os.path.isfile(name):
            raise InputError(f"{name}: this is geometry: cvxlimit import makes a scene of it")
        return read_scene(name)
    cure = meant(name, BUILTIN, "cvxlimit scenes lists the built-in ones")
    raise InputError(f"there is no built-in scene and no file {name!r}; {cure}")


_SUFFIXES = {"mechanism": PICTURES, "page": (".html",), "animation": (".gif", ".mp4")}
"""What kinds of pictures are written as; all others are figures."""


@dataclass(frozen=True)
class Files:
    """Where a solution is to be written; None where it is not. ``plot`` has ``KIND:FILE`` too."""

    json: Path | None
    plot: Sequence[str] | None = None
    export: Path | None = None
    report: Path | None = None
    without_dilatancy: bool = False

    def check(self, scene: str) -> None:
        outputs = {"--json": None if self.is_piped else self.json, "--export": self.export}
        outputs["--report"] = self.report
        kinds: dict[str, Collection[str]] = {"export": EXPORTS, "report": (".html",)}
        for number, (kind, path) in enumerate(self.pictures):
            name = "plot" if kind == "mechanism" else f"plot {kind}:"
            name += "" if f"--{name}" not in outputs else f" ({number + 1})"
            outputs[f"--{name}"] = path
            kinds[name] = _SUFFIXES.get(kind, IMAGES)
        check_outputs(outputs, scene_file(scene), **kinds)

    @property
    def is_piped(self) -> bool:
        return self.json == Path("-")

    @property
    def pictures(self) -> list[tuple[str, Path]]:
        found = []
        for text in self.plot or ():
            kind, colon, name = text.partition(":")
            if not (colon and kind.isidentifier() and len(kind) > 1):  # C:wall.png is a file
                found.append(("mechanism", Path(text)))
                continue
            if kind in PICTURES_OF:
                found.append((kind, Path(name)))
                continue
            hint = meant(kind, PICTURES_OF, f"there are {', '.join(PICTURES_OF)}")
            raise InputError(f"--plot {text}: there is no picture {kind!r}; {hint}")
        return found

    def without(self, scene: Scene, solution: Solution) -> Solution | None:
        """What leads the report, where it is asked for and not the solution itself."""
        if self.report is None or not self.without_dilatancy or solution.flow != "associated":
            return None
        return solve(scene, solution.surfaces, method="zero-dilatancy")

    def write(self, scene: Scene, solution: Solution) -> Iterator[Path]:
        """Writes all but the report."""
        if self.is_piped:
            typer.echo(encoded(result_to_dict(solution)), nl=False)
        elif self.json is not None:
            write_result(solution, self.json)
            yield self.json
        for kind, path in self.pictures:
            try:
                yield from _drawn(kind, scene, solution, path)
            except InputError as error:  # without an answer there is nothing of some kinds
                if solution.status.has_answer:
                    raise
                complain(f"{path} is not drawn: {error}")
        if self.export is not None:
            yield from export(scene, self.export, solution)


def _drawn(kind: str, scene: Scene, solution: Solution, path: Path) -> Sequence[Path]:
    if kind == "mechanism":
        return plot(scene, solution, path)
    return [picture_of(solution.of(scene), kind, path)]


def deliver(
    scene: Scene, name: str, solution: Solution, files: Files, tolerance: float | None = None
) -> ExitCode:
    written, other = list[str](), None
    try:
        written.extend(str(path) for path in files.write(scene, solution))
        other = files.without(scene, solution)  # a search, after all else is there
        if files.report is not None:
            page = solution.of(scene).report(files.report, without_dilatancy=other)
            written.append(str(page))
    finally:  # hours of work are shown even if the disk is full by now
        origin = "built-in" if name in BUILTIN else name
        with redirect_stdout(sys.stderr) if files.is_piped else nullcontext():
            show(summary(solution, written, other))
            if VOICE.get() > 0:
                show(Text(), details(solution, origin, tolerance))
    warn_of_geometry(scene)
    status = solution.status
    if solution.is_answered:
        return ExitCode.SOLVED
    code = ExitCode.NOT_GOOD_ENOUGH if status.has_answer else ExitCode.NO_ANSWER
    return refuse(code, verdict(solution))


@dataclass(frozen=True, kw_only=True)
class Order:
    """What ``cvxlimit solve`` was asked to do."""

    scene: str = argument("Built-in name, or scene file: ./NAME if both.")
    surface: str = option(
        "NAME",
        "Yield surface: conic, the exact cone (default); parabolic, nearer exact torsion; octagon "
        "(the paper's), 16-gon ..., on the unsafe side; octagon-inscribed ..., on the safe side.",
        "conic",
    )
    method: str | None = option(
        "NAME",
        f"{either(TABLE).replace('convex', 'convex (default)')}; see cvxlimit explain SCENE.",
    )
    moments: str | None = option(
        "NAME",
        f"How interaction with bending adds moments: {either(MOMENTS)}; unless given, independent, "
        "the safe reading.",
    )
    solver: str | None = option(
        "NAME",
        "The one solver to use: any that CVXPY has installed.",
    )
    model: str = option(
        "NAME",
        "auto (default), reduced where that saves time; full; or least, the smallest that is "
        "valid. Bounds hold for the full scene.",
        "auto",
    )
    json: Path | None = result_option()
    plot: list[str] | None = plot_option()
    export: Path | None = option(
        "FILE", "Contacts with their forces (.csv), or the blocks (.obj, .glb).", group=OUTPUT
    )
    report: Path | None = report_option()
    without_dilatancy: bool = option(
        "",
        "Its number leads the report.",
        False,
        "--no-dilatancy",
        group=OUTPUT,
    )
    sensitivity: bool = option(
        "",
        "What friction and stones change.",
        False,
        "--sensitivity",
        group=OUTPUT,
    )
    tolerance: float | None = option(
        "WIDTH",
        "Width of the bracket, or last change: 1e-5; fixed point 1e-4; exact 1e-3; certified 1 % "
        "as time allows.",
        group=EFFORT,
    )
    branching_seconds: float | None = option(
        "S",
        "Of branch and bound; unless given, 60 with a tolerance or up to 6 contacts, else 10.",
        group=EFFORT,
    )
    workers: int = option("N", "Processes of branch and bound.", 1, group=EFFORT)
    searches: int | None = option(
        "N",
        "Without dilatancy, each from a new seed.",
        group=EFFORT,
    )
    budget: int | None = option("N", f"Of each search; unless given, {BUDGET}.", group=EFFORT)
    seed: int | None = option("N", "Seed of the first search; unless given, 0.", group=EFFORT)

    def settings(self) -> dict[str, Any]:
        names = ("method", "moments", "tolerance", "model", "solver")
        given = {name: getattr(self, name) for name in names}
        efforts = {name: getattr(self, name) for name in ("searches", "budget", "seed")}
        if chosen := {name: value for name, value in efforts.items() if value is not None}:
            if self.method != "zero-dilatancy":
                named = " and ".join(f"--{name}" for name in chosen)
                raise ModelError(f"{named} goes with --method zero-dilatancy")
            return {**given, "method": TABLE[self.method](**chosen)}
        if self.branching_seconds is None and self.workers == 1:
            return given
        if self.method != "certified":
            raise ModelError("--branching-seconds and --workers go with --method certified")
        if self.workers > 1 and self.branching_seconds == 0.0:
            raise ModelError(
                f"--workers {self.workers} does nothing without branch and bound: give "
                "--branching-seconds S above 0, or leave that out"
            )
        own: Any = {"branching_seconds": self.branching_seconds, "workers": self.workers}
        return {**given, "method": TABLE[self.method](**own)}


@command_of(
    Order,
    "Exit code: 0 solved; 2 bad input; 3 no answer exists; 4 not converged or not certified.",
)
def solve_command(order: Order) -> ExitCode:
    """Find the collapse load factor of a scene, with a bracket recomputed outside the solver."""
    files = Files(order.json, order.plot, order.export, order.report, order.without_dilatancy)
    files.check(order.scene)
    settings = order.settings()
    if order.without_dilatancy and order.report is None:
        raise InputError("--no-dilatancy goes with --report, on whose page its number is")
    if order.sensitivity and order.method not in (None, "convex"):
        raise InputError(
            f"--sensitivity goes with method convex, got {order.method!r}: the answer of no other "
            "is the optimum of one convex problem, which has derivatives"
        )

    def solved(tell: Tell) -> tuple[Scene, Solution]:
        scene = scene_named(order.scene)
        return scene, solve(scene, order.surface, progress=tell, **settings)  # type: ignore[arg-type]

    with _prints_on_stderr() if files.is_piped else nullcontext():
        scene, solution = interruptible(solved)
    code = deliver(scene, order.scene, solution, files, order.tolerance)
    if order.sensitivity and solution.status.has_answer:
        with redirect_stdout(sys.stderr) if files.is_piped else nullcontext():
            show(Text(), facts(solution.sensitivity().rows))
    return code


@contextmanager
def _prints_on_stderr() -> Iterator[None]:
    """Native code prints on stderr for a while: HiGHS introduces itself on stdout, which is a
    result's alone where one is asked for there."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


@dataclass(frozen=True, kw_only=True)
class Movement:
    """What ``cvxlimit settle`` is asked."""

    scene: str = argument()
    support: list[str] | None = option(
        "ID",
        "The support that moves; several, each after a --support, move as one body. Unless given, "
        "those in the scene's settling.",
    )
    direction: str | None = option(
        "X,Y,Z", "Where to, as in --direction=0,0,-1; its length does not matter."
    )
    rotation: str | None = option(
        "X,Y,Z", "Axis about which they turn, right-handed; its length in proportion to direction."
    )
    about: str | None = option("X,Y,Z", "A point of that axis.")
    which: str = option(
        "NAME",
        "least (default) or largest: the reaction that remains while the support gives way, or the "
        "one that pushes it back.",
        "least",
    )
    surface: str = surface_option()
    json: Path | None = result_option()
    plot: list[str] | None = plot_option()
    report: Path | None = report_option()


@command_of(Movement)
def settle_command(asked: Movement) -> ExitCode:
    """Find the least or largest reaction of supports that move, under the dead load alone."""
    files = Files(asked.json, asked.plot, report=asked.report)
    files.check(asked.scene)
    along, axis, about = (
        None if text is None else vector(name, text, "0,0,-1")
        for name, text in (
            ("--direction", asked.direction),
            ("--rotation", asked.rotation),
            ("--about", asked.about),
        )
    )

    def settled(tell: Tell) -> tuple[Scene, Solution]:
        scene = scene_named(asked.scene)
        surface: Any = asked.surface
        return scene, settlement(
            scene, asked.support or None, along, asked.which, surface, progress=tell,
            rotation=axis or (0.0, 0.0, 0.0), about=about,
        ).solution  # fmt: skip

    scene, solution = interruptible(settled)
    return deliver(scene, asked.scene, solution, files)


@dataclass(frozen=True, kw_only=True)
class Question:
    """What ``cvxlimit explain`` is asked."""

    scene: str = argument()
    surface: str = surface_option()
    model: str = model_option()


@command_of(Question)
def explain_command(asked: Question) -> ExitCode:
    """Report the size of the model, the solver and the expected time of every method, without
    solving."""
    given: Any = {"surface": asked.surface, "model": asked.model}
    found = interruptible(lambda tell: explain(scene_named(asked.scene), **given))
    title, *lines = str(found).splitlines()
    answers = [f"{name}: {method.answers}" for name, method in TABLE.items()]
    show(Text("\n".join([one_line(title), *lines, "", *answers])))
    return ExitCode.SOLVED


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What ``cvxlimit show`` is to draw, and where."""

    scene: str = argument()
    plot: Path | None = option(
        "OUT.png|.html",
        "Picture, or page to turn and point at. Unless given, a page in a temporary folder.",
        group=OUTPUT,
    )


@command_of(Drawing)
def show_command(asked: Drawing) -> ExitCode:
    """Draw a scene before it is solved: blocks, supports, joints, loads, near misses.

    A scene whose geometry is refused is drawn with the blocks to blame in red.
    """
    files_asked(asked, plot=SCENE_PICTURES)

    def checked(tell: Tell) -> tuple[Scene, InputError | None]:
        scene = scene_named(asked.scene)
        tell("finding contacts")
        return scene, refused(scene)

    scene, refusal = interruptible(checked)
    plot = asked.plot or Path(mkdtemp(prefix="cvxlimit-")) / f"{Path(asked.scene).stem}.html"
    written = [("written", str(path)) for path in plot_scene(scene, plot, refusal)]
    blocks = f"{counted(len(scene.free), 'free block')}, {counted(len(scene.supports), 'support')}"
    contacts = "" if refusal else f" x {counted(len(scene.contacts), 'contact')}"
    weight = f"{scene.total_weight:.6g} {scene.units.force}"
    rows = [("scene", scene.name), ("size", blocks + contacts), ("weight", weight)]
    for case in ("dead", "live"):
        load, resultant = getattr(scene, case), getattr(scene, f"{case}_forces")[:, :3].sum(axis=0)
        small = abs(resultant) <= 1e-9 * abs(resultant).max()
        x, y, z = (0.0 if zero else value for value, zero in zip(resultant, small, strict=True))
        text = f"{x:.6g}, {y:.6g}, {z:.6g} {scene.units.force} in all"
        pressures = f", {counted(len(load.pressures), 'pressure')}" if load.pressures else ""
        rows.append((f"{case} load", text + pressures))
    rows += written
    if asked.plot is None:
        rows.append(("to see it", "open that file in a browser"))
    show(facts(rows))
    if refusal is not None:
        raise refusal
    warn_of_geometry(scene)
    return ExitCode.SOLVED
