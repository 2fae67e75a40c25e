"""``cvxlimit export``: a scene for other programs; ``export-problem``: its convex problem."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cvxlimit.base.versions import __version__
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import (
    argument,
    command_of,
    either,
    model_option,
    option,
    output_option,
    surface_option,
)
from cvxlimit.cli.report import ExitCode, check_outputs, counted, facts, scene_file, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.io.exporting import EXPORTS, export
from cvxlimit.methods.solving import solve
from cvxlimit.methods.table import check_choice
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.reductions.choice import ModelName, Reductions
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import known
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.solvers.writing import FORMATS, write_program
from cvxlimit.surfaces.coulomb import SurfaceName, surfaces_of


@dataclass(frozen=True, kw_only=True)
class Export:
    """What ``cvxlimit export-problem`` is to write."""

    scene: str = argument()
    format: str = option(
        "NAME", f"{either(FORMATS)}: CBF has cones, MPS needs facets, npz has arrays.", ...
    )
    surface: str = surface_option()
    model: str = model_option()
    output: Path | None = output_option(
        "OUT", "File; the scene's name in this folder unless given."
    )


@command_of(Export)
def export_command(asked: Export) -> ExitCode:
    """Write the convex problem that the solver gets, with its proved optimum in a comment."""
    form = asked.format.lower()
    check_choice("--format", form, FORMATS)

    def exported(tell: Tell) -> tuple[Scene, ConeProgram, Path]:
        scene = scene_named(asked.scene)
        path = asked.output or Path(f"{Path(scene.name).name}.{form}")
        check_outputs({"--output": path}, scene_file(asked.scene))
        tell("solving for the proved optimum")
        program, remarks = problem_of(scene, asked.surface, asked.model)  # type: ignore[arg-type]
        write_program(program, path, form, scene.name.replace(" ", "-"), remarks)
        return scene, program, path

    scene, program, path = interruptible(exported)
    rows, columns = program.matrix.shape
    sizes = (columns, "variable"), (rows, "row"), (len(program.cones), "cone")
    size = ", ".join(counted(number, what) for number, what in sizes)
    show(facts([("scene", scene.name), ("size", size), ("written", str(path))]))
    return ExitCode.SOLVED


@dataclass(frozen=True, kw_only=True)
class SceneExport:
    """What ``cvxlimit export`` is to write."""

    scene: str = argument()
    format: str = option(
        "NAME", f"{either(kind[1:] for kind in EXPORTS)}: blocks for other programs, contacts as a "
        "table, a model for MuJoCo.", ...
    )  # fmt: skip
    output: Path | None = output_option(
        "OUT", "File; the scene's name in this folder unless given."
    )


@command_of(SceneExport)
def export_scene_command(asked: SceneExport) -> ExitCode:
    """Write the blocks of a scene for another program."""
    form = asked.format.lower()
    check_choice("--format", form, [kind[1:] for kind in EXPORTS])
    scene = scene_named(asked.scene)
    path = asked.output or Path(f"{Path(scene.name).name}.{form}")
    check_outputs({"--output": path}, scene_file(asked.scene), output=(f".{form}",))
    written = export(scene, path)
    show(facts([("scene", scene.name), *(("written", str(file)) for file in written)]))
    return ExitCode.SOLVED


def problem_of(
    scene: Scene, surface: SurfaceName = "conic", model: ModelName = "auto"
) -> tuple[ConeProgram, tuple[str, str]]:
    """The problem of all parts of a scene; what it is, and what is proved of its optimum."""
    surfaces = surfaces_of(surface)[0]
    found = Reductions.of(Assemblage.of(scene), surfaces, model=model)
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
