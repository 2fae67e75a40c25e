"""``cvxlimit export``: a scene for other programs; ``export-problem``: its convex problem."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from cvxlimit.base.checks import check_choice
from cvxlimit.base.versions import __version__
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import Command, either
from cvxlimit.cli.report import check_outputs, counted, facts, scene_file
from cvxlimit.cli.shell import ExitCode, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.io.exporting import EXPORTS, export
from cvxlimit.methods.solving import solve
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.reductions.choice import PLANAR_FROM, ModelName, Reductions
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import known
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.solvers.writing import FORMATS, write_program
from cvxlimit.surfaces.coulomb import SurfaceName, surfaces_of


@dataclass(frozen=True, kw_only=True)
class ExportCommand(Command):
    """Write the blocks of a scene for another program.

    Model
    -----
    format : NAME
        {formats}: blocks for other programs, contacts as a table, a model for MuJoCo.

    Output
    ------
    output, -o : OUT
        File; the scene's name in this folder unless given.
    """

    names: ClassVar = {"formats": either(kind[1:] for kind in EXPORTS)}

    scene: str
    format: str
    output: Path | None = None

    def run(self) -> ExitCode:
        form = self.format.lower()
        EXPORTS.check(f".{form}")
        check_choice("--format", form, [kind[1:] for kind in EXPORTS.names])
        scene = scene_named(self.scene)
        path = self.output or Path(f"{Path(scene.name).name}.{form}")
        check_outputs([("--output", path, (f".{form}",))], scene_file(self.scene))
        written = export(scene, path)
        show(facts([("scene", scene.name), *(("written", str(file)) for file in written)]))
        return ExitCode.SOLVED


@dataclass(frozen=True, kw_only=True)
class ExportProblemCommand(Command):
    """Write the convex problem that the solver gets, with its proved optimum in a comment.

    Model
    -----
    format : NAME
        {formats}: CBF has cones, MPS needs facets, npz has arrays.

    Output
    ------
    output, -o : OUT
        File; the scene's name in this folder unless given.
    """

    names: ClassVar = {"formats": either(FORMATS)}

    scene: str
    format: str
    surface: str = "conic"
    model: str = "auto"
    output: Path | None = None

    def run(self) -> ExitCode:
        form = self.format.lower()
        check_choice("--format", form, FORMATS)

        def exported(tell: Tell) -> tuple[Scene, ConeProgram, Path]:
            scene = scene_named(self.scene)
            path = self.output or Path(f"{Path(scene.name).name}.{form}")
            check_outputs([("--output", path, ())], scene_file(self.scene))
            tell("solving for the proved optimum")
            program, remarks = problem_of(scene, self.surface, self.model)  # type: ignore[arg-type]
            write_program(program, path, form, scene.name.replace(" ", "-"), remarks)
            return scene, program, path

        scene, program, path = interruptible(exported)
        rows, columns = program.matrix.shape
        sizes = (columns, "variable"), (rows, "row"), (len(program.cones), "cone")
        size = ", ".join(counted(number, what) for number, what in sizes)
        show(facts([("scene", scene.name), ("size", size), ("written", str(path))]))
        return ExitCode.SOLVED


def problem_of(
    scene: Scene, surface: SurfaceName = "conic", model: ModelName = "auto"
) -> tuple[ConeProgram, tuple[str, str]]:
    """The problem of all parts of a scene; what it is, and what is proved of its optimum."""
    surfaces = surfaces_of(surface)[0]
    about = Assemblage.of(scene), surfaces
    found = Reductions.of(*about, model=model, planar_from=PLANAR_FROM)
    limit = LimitProgram(found.assemblage, surfaces, reduction=found.best())
    unit = limit.scaling.load_factor(1.0)
    solution = solve(scene, surface, model=model)
    lower, upper = known(solution.lower), known(solution.upper)
    if lower is None or upper is None:
        proved = f"no optimum: {solution.status}"
    else:
        proved = f"optimum proved between {-upper / unit:.12g} and {-lower / unit:.12g}"
    remarks = (
        f"cvxlimit {__version__}: collapse load of {scene.name!r}, {surface}, "
        f"{counted(len(scene.contacts), 'contact')}",
        f"{proved}; load factor = {-unit:.12g} x objective ({solution.status})",
    )
    return limit.program, remarks
