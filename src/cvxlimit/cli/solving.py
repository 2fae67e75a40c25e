"""``cvxlimit solve`` and ``settle``: solve, write what is asked for, show what was found."""

from __future__ import annotations

import os
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import typer
from rich.text import Text

from cvxlimit.base.checks import meant
from cvxlimit.base.doors import Door
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import Command, either, vector
from cvxlimit.cli.report import (
    PICTURES,
    check_outputs,
    details,
    facts,
    scene_file,
    summary,
    verdict,
    warn_of_geometry,
)
from cvxlimit.cli.shell import VOICE, ExitCode, complain, refuse, show
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io import export, read_scene, write_result
from cvxlimit.io.exporting import EXPORTS
from cvxlimit.io.fields import encoded
from cvxlimit.io.results import result_to_dict
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.methods.settlement import settlement
from cvxlimit.methods.solving import TABLE, solve
from cvxlimit.plotting import PICTURES as PICTURES_OF
from cvxlimit.plotting import picture_of, plot
from cvxlimit.plotting.look import IMAGES
from cvxlimit.readings.named import MOMENTS
from cvxlimit.reductions.explaining import BUDGET
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


def scene_named(name: str) -> Scene:
    """The scene of a built-in name, which wins, or of a file."""
    if name in BUILTIN:
        return builtin_scene(name)
    looks_like_file = Path(name).suffix or Path(name).name != name
    if looks_like_file or os.path.exists(name):
        readers, suffix = Door("cvxlimit.readers"), Path(name).suffix.lower()
        if suffix != ".json" and os.path.isfile(name):
            readers.check(suffix, f"{name}: geometry in {suffix} files")
            if suffix in readers:
                raise InputError(f"{name}: this is geometry: cvxlimit import makes a scene of it")
        return read_scene(name)
    cure = meant(name, BUILTIN, "cvxlimit scenes lists the built-in ones")
    raise InputError(f"there is no built-in scene and no file {name!r}; {cure}")


_SUFFIXES = {"mechanism": PICTURES, "page": (".html",), "animation": (".gif", ".mp4")}
"""What kinds of pictures are written as; all others are figures."""


@dataclass(frozen=True)
class Files:
    """Where a solution is to be written; None where it is not. ``plot`` has ``KIND:FILE`` too, and
    ``without_dilatancy`` puts the number without dilatancy first in the report."""

    json: Path | None
    plot: Sequence[str] | None = None
    export: Path | None = None
    report: Path | None = None
    without_dilatancy: bool = False

    def check(self, scene: str) -> None:
        outputs: list[tuple[str, Path | None, Collection[str]]] = [
            ("--json", None if self.is_piped else self.json, ()),
            ("--export", self.export, EXPORTS),
            ("--report", self.report, (".html",)),
        ]
        for kind, path in self.pictures:
            option = "--plot" if kind == "mechanism" else f"--plot {kind}:"
            outputs.append((option, path, _SUFFIXES.get(kind, IMAGES)))
        check_outputs(outputs, scene_file(scene))

    @property
    def is_piped(self) -> bool:
        return self.json == Path("-")

    @property
    def pictures(self) -> list[tuple[str, Path]]:
        found = []
        for text in self.plot or ():
            kind, colon, name = text.partition(":")
            if not (colon and kind.isidentifier() and len(kind) > 1):  # C:wall.png is a file
                kind, name = "mechanism", text
            elif kind not in PICTURES_OF:
                Door("cvxlimit.pictures").check(kind)  # of an extension that is not here
                hint = meant(kind, PICTURES_OF, f"there are {', '.join(PICTURES_OF)}")
                raise InputError(f"--plot {text}: there is no picture {kind!r}; {hint}")
            found.append((kind, Path(name)))
        return found

    def led_by(self, scene: Scene, solution: Solution) -> Solution | None:
        """The answer without dilatancy, solved for where ``--no-dilatancy`` asks that its number
        lead the report; None where there is no report, or ``solution`` is one itself."""
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
    """Writes what is asked for, shows what was found, and says how it ended.

    ``name`` is how the scene was asked for, and ``tolerance`` the width of bracket that was, which
    details show. The summary is shown even if a file cannot be written, on stderr where the
    solution itself goes to stdout. An answer that is not good enough, or none, is complained of and
    gives the exit code.
    """
    written, other = list[str](), None
    try:
        written.extend(str(path) for path in files.write(scene, solution))
        other = files.led_by(scene, solution)  # a search, after all else is there
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
class SolveCommand(Command):
    """Find the collapse load factor of a scene, with a bracket recomputed outside the solver.

    Arguments
    ---------
    scene : SCENE
        Built-in, or a file: ./NAME if both.

    Model
    -----
    surface : NAME
        Yield surface: conic, the exact cone (default); parabolic, nearer exact torsion; octagon
        (the paper's), 16-gon ..., on the unsafe side; octagon-inscribed ..., on the safe side.
    method : NAME
        {methods}; see cvxlimit explain SCENE.
    moments : NAME
        How interaction with bending adds moments: {readings}; unless given, independent, the safe
        reading.
    solver : NAME
        The one solver to use: any that CVXPY has installed.
    model : NAME
        auto (default), reduced where that pays; full; or least. Bounds hold for the full scene.

    Output
    ------
    export : FILE
        Forces (.csv), or blocks (.obj, .glb).
    no_dilatancy
        Its number leads the report.
    sensitivity
        What friction and stones change.

    Effort
    ------
    tolerance : WIDTH
        Of the bracket, or of the last change.
    branching_seconds : S
        Of branch and bound; 10 to 60 by default.
    workers : N
        Processes of branching, or of draws.
    searches : N
        Without dilatancy, each from a new seed.
    budget : N
        Of each search; unless given, {budget}.
    seed : N
        Of the first search, or draw of beds; 0.
    ratio : R
        From rest: shear by normal stiffness; 0.4.
    steps : N
        From rest: most steps; unless given, 150.
    bedding : GAP
        From rest: in elastic shortenings.
    draws : N
        From rest: of beds; unless given, 20.

    Exit code
    ---------
    0 solved; 2 bad input; 3 no answer exists; 4 not converged or not certified.
    """

    names: ClassVar = {
        "methods": either(TABLE).replace("convex", "convex (default)"),
        "readings": either(MOMENTS),
        "pictures": either(PICTURES_OF),
        "budget": BUDGET,
    }

    scene: str
    surface: str = "conic"
    method: str | None = None
    moments: str | None = None
    solver: str | None = None
    model: str = "auto"
    json: Path | None = None
    plot: list[str] | None = None
    export: Path | None = None
    report: Path | None = None
    no_dilatancy: bool = False
    sensitivity: bool = False
    tolerance: float | None = None
    branching_seconds: float | None = None
    workers: int = 1
    searches: int | None = None
    budget: int | None = None
    seed: int | None = None
    ratio: float | None = None
    steps: int | None = None
    bedding: float | None = None
    draws: int | None = None

    def run(self) -> ExitCode:
        files = Files(self.json, self.plot, self.export, self.report, self.no_dilatancy)
        files.check(self.scene)
        settings: Any = {"surface": self.surface, **self._settings()}
        if self.no_dilatancy:
            if self.report is None:
                raise InputError("--no-dilatancy goes with --report, on whose page its number is")
            Door("cvxlimit.methods").check("zero-dilatancy", "what --no-dilatancy asks for")
        if self.sensitivity and self.method not in (None, "convex"):
            raise InputError(
                f"--sensitivity goes with method convex, got {self.method!r}: the answer of no "
                "other is the optimum of one convex problem, which has derivatives"
            )

        def solved(tell: Tell) -> tuple[Scene, Solution]:
            scene = scene_named(self.scene)
            return scene, solve(scene, progress=tell, **settings)

        with _prints_on_stderr() if files.is_piped else nullcontext():
            scene, solution = interruptible(solved)
        code = deliver(scene, self.scene, solution, files, self.tolerance)
        if self.sensitivity and solution.status.has_answer:
            with redirect_stdout(sys.stderr) if files.is_piped else nullcontext():
                show(Text(), facts(solution.sensitivity().rows))
        return code

    def _settings(self) -> dict[str, Any]:
        """Of :func:`cvxlimit.solve`; the options of one method go into it."""
        names = ("method", "moments", "tolerance", "model", "solver")
        given: dict[str, Any] = {name: getattr(self, name) for name in names}
        own = ("searches", "budget", "seed", "ratio", "bedding", "draws")
        efforts: dict[str, Any] = {name: getattr(self, name) for name in own} | {
            "max_steps": self.steps
        }
        chosen = {name: value for name, value in efforts.items() if value is not None}
        is_drawn = self.workers > 1 and self.bedding is not None
        if is_drawn and self.branching_seconds is None:
            chosen["workers"] = self.workers
        if chosen:
            given["method"] = TABLE[self._taking(chosen)](**chosen)
        if self.branching_seconds is None and (self.workers == 1 or is_drawn):
            return given
        if self.method != "certified":
            raise ModelError("--branching-seconds and --workers go with --method certified")
        if self.workers > 1 and self.branching_seconds == 0.0:
            raise ModelError(
                f"--workers {self.workers} does nothing without branch and bound: give "
                "--branching-seconds S above 0, or leave that out"
            )
        branching = {"branching_seconds": self.branching_seconds, "workers": self.workers}
        return {**given, "method": TABLE[self.method](**branching)}

    def _taking(self, chosen: Collection[str]) -> str:
        """The method asked for, which must have all settings that were chosen."""
        Door("cvxlimit.methods").check(str(self.method))  # of an extension that is not here
        fit = [x for x in TABLE if all(hasattr(TABLE[x], name) for name in chosen)]
        if self.method in fit:
            return str(self.method)
        options = [f"--{name.removeprefix('max_')}" for name in chosen]
        verb = "goes" if len(options) == 1 else "go"
        if not fit:
            one = "it" if len(options) == 1 else "one of them"
            raise ModelError(f"no method here takes {' and '.join(options)}: leave {one} out")
        raise ModelError(f"{' and '.join(options)} {verb} with --method {' or '.join(fit)}")


@contextmanager
def _prints_on_stderr() -> Iterator[None]:
    """Native code prints on stderr for a while, as solvers of other packages may: stdout is a
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
class SettleCommand(Command):
    """Find the least or largest reaction of supports that move, under the dead load alone.

    Model
    -----
    support : ID
        The support that moves; several, each after a --support, move as one body. Unless given,
        those in the scene's settling.
    direction : X,Y,Z
        Where to, as in --direction=0,0,-1; its length does not matter.
    rotation : X,Y,Z
        Axis about which they turn, right-handed; its length in proportion to direction.
    about : X,Y,Z
        A point of that axis.
    which : NAME
        least (default) or largest: the reaction that remains while the support gives way, or the
        one that pushes it back.
    """

    names: ClassVar = {"pictures": either(PICTURES_OF)}

    scene: str
    support: list[str] | None = None
    direction: str | None = None
    rotation: str | None = None
    about: str | None = None
    which: str = "least"
    surface: str = "conic"
    json: Path | None = None
    plot: list[str] | None = None
    report: Path | None = None

    def run(self) -> ExitCode:
        files = Files(self.json, self.plot, report=self.report)
        files.check(self.scene)
        along, axis, about = (
            None if (text := getattr(self, name)) is None else vector(f"--{name}", text, "0,0,-1")
            for name in ("direction", "rotation", "about")
        )
        given: Any = {"which": self.which, "surface": self.surface, "about": about}
        if axis is not None:
            given["rotation"] = axis

        def settled(tell: Tell) -> tuple[Scene, Solution]:
            scene = scene_named(self.scene)
            found = settlement(scene, self.support or None, along, progress=tell, **given)
            return scene, found.solution

        with _prints_on_stderr() if files.is_piped else nullcontext():
            scene, solution = interruptible(settled)
        return deliver(scene, self.scene, solution, files)
