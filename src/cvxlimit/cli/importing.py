"""``cvxlimit import``: geometry files in, a scene file out, and what was found and repaired."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cvxlimit.cli.outputs import SCENE_PICTURES, ExitCode, check_outputs, check_picture
from cvxlimit.cli.report import facts, show, warn_of_near_misses
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.io import Imported, import_geometry, write_scene
from cvxlimit.io.geometry import AXES, LOWEST
from cvxlimit.plotting import plot_scene

Job = Callable[[], int]

_DEFAULT_FORCE = "kN"


def import_command(
    geometry: Annotated[
        list[str],
        typer.Argument(
            metavar="GEOMETRY...",
            help="Files or folders: .obj, .stl, .ply, .glb, .gltf, COMPAS .json, or .csv with a "
            "box per row (id, xmin, ymin, zmin, xmax, ymax, zmax; density, support).",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="SCENE.json", help="Scene file to write."),
    ] = None,
    length_unit: Annotated[
        str | None,
        typer.Option(metavar="m|mm|...", help="Unit of the coordinates; nothing is converted."),
    ] = None,
    up: Annotated[
        str | None, typer.Option(metavar="x|y|z", help="Axis that points up; nothing is turned.")
    ] = None,
    density: Annotated[
        float | None,
        typer.Option(metavar="G", help="Weight per volume of all blocks, in place of the files'."),
    ] = None,
    density_factor: Annotated[
        float | None,
        typer.Option(
            metavar="F",
            help="Turns the files' densities into weight per volume: 0.00980665 for kg/m3 to kN/m3.",
        ),
    ] = None,
    friction: Annotated[
        float | None, typer.Option(metavar="MU", help="Coulomb coefficient of all contacts.")
    ] = None,
    supports: Annotated[
        str | None,
        typer.Option(
            metavar="lowest|ID,ID",
            help="Fixed blocks, in place of those that the files mark: the lowest ones (within 1 % "
            "of the height), or ids with commas between them.",
        ),
    ] = None,
    live: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z", help="Live load: multiples of every block's weight, along the axes."
        ),
    ] = None,
    joint_tolerance: Annotated[
        float | None,
        typer.Option(
            metavar="L",
            help="Gaps, overlaps and warps up to this length are joints; relative to block size "
            "unless given.",
        ),
    ] = None,
    force_unit: Annotated[
        str, typer.Option(metavar="kN|N|...", help="Unit of forces, for labels.")
    ] = _DEFAULT_FORCE,
    name: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of the scene; the file's unless given.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.png|.html",
            help="Draw the scene, or what is wrong with it if it is refused.",
        ),
    ] = None,
) -> Job:
    """Make a scene from geometry files, and say what was found and repaired."""
    asked = {
        "--output": (output, "SCENE.json, the scene file to write"),
        "--length-unit": (length_unit, "m, mm ...: what the coordinates are in"),
        "--up": (up, "x, y or z: the axis that points up"),
        "--friction": (friction, "the Coulomb coefficient of the joints"),
        "--live": (live, "X,Y,Z: the live load in multiples of every block's weight"),
    }
    for option, (value, meaning) in asked.items():
        if value is None:
            raise typer.BadParameter(f"give {option} {meaning}; files do not say and none is guessed")
    assert output is not None and plot != output
    return partial(
        _import_job, geometry, output, plot,
        partial(
            import_geometry,
            geometry,
            length_unit=length_unit, up=up, density=density, density_factor=density_factor,
            friction=friction, supports=_supports(supports), live=_vector(live or ""),
            force_unit=force_unit, joint_tolerance=joint_tolerance, name=name,
        ),
    )  # fmt: skip
