"""Commands that take one scene: ``solve``, ``settle``, ``explain`` and ``show``."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

import difflib
import os
import sys
from collections.abc import Iterator
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp

import typer
from rich.text import Text

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import (
    SCENE,
    argument,
    option,
    result_option,
    surface_option,
    taking,
    vector,
)
from cvxlimit.cli.report import (
    PICTURES,
    SCENE_PICTURES,
    ExitCode,
    check_outputs,
    counted,
    facts,
    history,
    is_eventful,
    refuse,
    show,
    summary,
    verdict,
    warn_of_near_misses,
)
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io import export, read_scene, write_result
from cvxlimit.io.fields import encoded, one_line
from cvxlimit.io.geometry.export import EXPORTS
from cvxlimit.io.results import result_to_dict
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.interaction.readings.named import MOMENTS
from cvxlimit.methods.settlement import settlement
from cvxlimit.methods.solving import solve
from cvxlimit.methods.table import TABLE, words
from cvxlimit.plotting import plot, plot_scene, refused
from cvxlimit.reductions.choice import MODELS, explain
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


def scene_named(name: str) -> Scene:
    """The scene of a built-in name, which wins, or of a file."""
    if name in BUILTIN:
        return builtin_scene(name)
    looks_like_file = Path(name).suffix or Path(name).name != name
    if looks_like_file or os.path.exists(name):
        return read_scene(name)
    close = difflib.get_close_matches(name, BUILTIN, n=1)
    cure = f"did you mean {close[0]!r}?" if close else "cvxlimit scenes lists the built-in ones"
    raise InputError(f"there is no built-in scene and no file {name!r}; {cure}")


@dataclass(frozen=True)
class Files:
    """Where a solution is to be written; None where it is not."""

    json: Path | None
    plot: Path | None
    export: Path | None = None

    def check(self, scene: str) -> None:
        inputs = {} if scene in BUILTIN else {scene: "the scene"}
        json = None if self.is_piped else self.json
        outputs = {"--json": json, "--plot": self.plot, "--export": self.export}
        check_outputs(outputs, inputs, export=EXPORTS, plot=PICTURES)

    @property
    def is_piped(self) -> bool:
        return self.json == Path("-")

    def write(self, scene: Scene, solution: Solution) -> Iterator[Path]:
        if self.is_piped:
            typer.echo(encoded(result_to_dict(solution)), nl=False)
        elif self.json is not None:
            write_result(solution, self.json)
            yield self.json
        if self.plot is not None:
            yield from plot(scene, solution, self.plot)
        if self.export is not None:
            yield from export(scene, self.export, solution)


def deliver(
    scene: Scene, name: str, solution: Solution, files: Files, tolerance: float | None = None
) -> ExitCode:
    written: list[str] = []
    try:
        written.extend(str(path) for path in files.write(scene, solution))
    finally:  # hours of work are shown even if the disk is full by now
        origin = "built-in" if name in BUILTIN else name
        with redirect_stdout(sys.stderr) if files.is_piped else nullcontext():
            show(summary(solution, origin, tolerance, written))
            if is_eventful(solution):
                show(Text(), history(solution.history))
    warn_of_near_misses(scene)
    status = solution.status
    if status.is_good:
        return ExitCode.SOLVED
    code = ExitCode.NOT_GOOD_ENOUGH if status.has_answer else ExitCode.NO_ANSWER
    return refuse(code, verdict(solution))


@dataclass(frozen=True, kw_only=True)
class Order:
    """What ``cvxlimit solve`` was asked to do."""

    scene: str = argument(
        f"{SCENE} A built-in name wins over a file of that name: write ./NAME for the file."
    )
    surface: str = option(
        "conic|parabolic|octagon|K-gon",
        "Yield surface: the exact cone; torsion and shear on a parabola nearer the exact limit, at "
        "the same price; the paper's 8 facets, or any K, as in 16-gon. Facets are on the unsafe "
        "side; octagon-inscribed or 16-gon-inscribed on the safe one.",
        "conic",
    )
    method: str | None = option(
        "|".join(TABLE),
        "; ".join(f"{name}: {row.method.answers}" for name, row in TABLE.items())
        + ". Unless given: convex.",
    )
    interaction: str | None = option(
        "|".join(words("interaction")),
        "Older spelling of --method fixed-point and --method certified.",
    )
    moments: str | None = option(
        "|".join(MOMENTS),
        "How the interaction adds moments: every sign on its own, the safe reading; static torsion "
        "about the pressure centre, without or with the paper's Eq. 27; or the paper's own "
        "reading, which depends on the contacts' axes. For methods with interaction only; unless "
        "given: independent.",
    )
    torsion_shear: str | None = option(
        "|".join(words("torsion_shear")),
        "Older spelling of --surface parabolic and --method exact.",
    )
    flow: str | None = option(
        "|".join(words("flow")), "Older spelling of --method zero-dilatancy and --method gilbert."
    )
    json: Path | None = result_option()
    plot: Path | None = option(
        "OUT.png|.html|.vtu",
        "Draw the mechanism: a picture, an interactive page, or files for ParaView.",
    )
    export: Path | None = option(
        "OUT.csv|.obj|.glb",
        "Write the contacts with their forces (CSV), or the blocks, for other programs.",
    )
    tolerance: float | None = option(
        "WIDTH",
        "Asked width of the bracket, relative to its larger bound; the fixed point stops at a "
        "change of this size. Unless given: 1e-5 without interaction, 1e-4 for the fixed point, "
        "1e-3 for exact torsion-shear; the certified method goes as far as it can, and 0.05 counts "
        "as good.",
    )
    model: str = option(
        "|".join(MODELS),
        "How much model: no more than the scene needs, all of it, or the least that is valid "
        "whether it pays or not. The bounds are those of the full scene in any case; cvxlimit "
        "explain SCENE says what is left out.",
        "auto",
    )
    branching_seconds: float | None = option(
        "S",
        "Time for branch and bound, which narrows the certified interaction's bracket. Unless "
        "given: 60 where a tolerance is asked for, or a scene has few contacts; else what is left "
        "of ten seconds, or of thirty solves without interaction.",
    )
    workers: int = option("N", "Processes that branch and bound uses.", 1)

    def settings(self) -> dict[str, str | float | Certified | None]:
        names = ("method", "moments", "interaction", "torsion_shear", "flow", "tolerance", "model")
        given = {name: getattr(self, name) for name in names}
        if self.branching_seconds is None and self.workers == 1:
            return given
        if Certified.name not in (self.method, self.interaction):
            raise ModelError("--branching-seconds and --workers go with --method certified")
        if self.workers > 1 and self.branching_seconds == 0.0:
            raise ModelError(
                f"--workers {self.workers} does nothing without branch and bound: give "
                "--branching-seconds S above 0, or leave that out"
            )
        asked = Certified(branching_seconds=self.branching_seconds, workers=self.workers)
        return {**given, "method": asked, "interaction": None}


@taking(Order)
def solve_command(order: Order) -> ExitCode:
    """Find the collapse load factor of a scene, with a bracket recomputed outside the solver."""
    files = Files(order.json, order.plot, order.export)
    files.check(order.scene)
    settings = order.settings()

    def solved(tell: Tell) -> tuple[Scene, Solution]:
        scene = scene_named(order.scene)
        return scene, solve(scene, order.surface, progress=tell, **settings)  # type: ignore[arg-type]

    scene, solution = interruptible(solved)
    return deliver(scene, order.scene, solution, files, order.tolerance)


@dataclass(frozen=True, kw_only=True)
class Movement:
    """What ``cvxlimit settle`` is asked."""

    scene: str = argument()
    support: str = option("ID", "The support that moves.", ...)
    direction: str = option(
        "X,Y,Z", "Where to, as in --direction=0,0,-1; its length does not matter.", ...
    )
    which: str = option(
        "least|largest",
        "The reaction that remains while the support gives way, or the one that pushes it back.",
        "least",
    )
    surface: str = surface_option()
    json: Path | None = result_option()
    plot: Path | None = option("OUT.png|.html|.vtu", "Draw the mechanism.")


@taking(Movement)
def settle_command(asked: Movement) -> ExitCode:
    """Find the least or largest reaction of a support that moves, under the dead load alone."""
    files = Files(asked.json, asked.plot)
    files.check(asked.scene)
    along = vector("--direction", asked.direction, "0,0,-1")

    def settled(tell: Tell) -> tuple[Scene, Solution]:
        scene = scene_named(asked.scene)
        found = settlement(scene, asked.support, along, asked.which, asked.surface, progress=tell)
        return scene, found.solution

    scene, solution = interruptible(settled)
    return deliver(scene, asked.scene, solution, files)


@dataclass(frozen=True, kw_only=True)
class Question:
    """What ``cvxlimit explain`` is asked."""

    scene: str = argument()
    surface: str = surface_option()
    model: str = option("|".join(MODELS), "How much model, as for solve.", "auto")


@taking(Question)
def explain_command(asked: Question) -> ExitCode:
    """Say how much model a scene gets, which solver, and how long it will take; solve nothing."""
    found = interruptible(
        lambda tell: explain(scene_named(asked.scene), asked.surface, model=asked.model)
    )
    title, *lines = str(found).splitlines()
    show(Text("\n".join([one_line(title), *lines])))
    return ExitCode.SOLVED


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What ``cvxlimit show`` is to draw, and where."""

    scene: str = argument()
    plot: Path | None = option(
        "OUT.png|.html",
        "Picture, or page to turn and point at. Unless given, a page is opened in the browser.",
    )


@taking(Drawing)
def show_command(asked: Drawing) -> ExitCode:
    """Draw a scene before it is solved: blocks, supports, joints, loads, near misses.

    A scene whose geometry is refused is drawn with the blocks to blame in red.
    """
    name = asked.scene
    inputs = {} if name in BUILTIN else {name: "the scene"}
    check_outputs({"--plot": asked.plot}, inputs, plot=SCENE_PICTURES)

    def checked(tell: Tell) -> tuple[Scene, InputError | None]:
        scene = scene_named(name)
        tell("finding contacts")
        return scene, refused(scene)

    scene, refusal = interruptible(checked)
    plot = asked.plot or Path(mkdtemp(prefix="cvxlimit-")) / f"{Path(name).stem}.html"
    written = [("written", str(path)) for path in plot_scene(scene, plot, refusal)]
    if asked.plot is None:
        typer.launch(plot.as_uri())
    blocks = f"{counted(len(scene.free), 'free block')}, {counted(len(scene.supports), 'support')}"
    contacts = "" if refusal else f" x {counted(len(scene.contacts), 'contact')}"
    show(facts([("scene", scene.name), ("size", blocks + contacts), *written]))
    if refusal is not None:
        raise refusal
    warn_of_near_misses(scene)
    return ExitCode.SOLVED
