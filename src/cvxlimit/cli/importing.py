"""``cvxlimit import``: geometry files in, a scene file out, and what was found and repaired."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from cvxlimit.cli.outputs import SCENE_PICTURES, ExitCode, check_outputs, check_picture
from cvxlimit.cli.report import count, facts, show, warn_of_near_misses
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.io import Imported, import_geometry, write_scene
from cvxlimit.io.fields import one_line
from cvxlimit.io.geometry import LOWEST, sketch
from cvxlimit.plotting import plot_scene
from cvxlimit.scene import Scene

Job = Callable[[], int]

_DEFAULT_FORCE = "kN"

_NAMED = 8
"""Supports named in the summary; the scene file has all."""


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
            help="Turns the files' densities into weight per volume; kg/m3 to kN/m3: 0.00980665.",
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
            raise typer.BadParameter(
                f"give {option} {meaning}; files do not say and none is guessed"
            )
    make = partial(
        import_geometry, geometry,
        length_unit=length_unit or "", up=up or "", friction=friction or 0.0,
        density=density, density_factor=density_factor, supports=_supports(supports),
        live=_vector(live or ""), force_unit=force_unit, joint_tolerance=joint_tolerance, name=name,
    )  # fmt: skip
    return partial(_import_job, geometry, output or Path(), plot, make)


def _import_job(
    geometry: list[str], output: Path, plot: Path | None, make: Callable[[], Imported]
) -> ExitCode:
    inputs = dict.fromkeys(geometry, "the geometry")
    check_outputs({"--output": output, "--plot": plot}, inputs)
    if plot is not None:
        check_picture(plot, SCENE_PICTURES)
    started = time.perf_counter()
    try:
        found = make()
    except GeometryError as error:
        if plot is not None and (culprit := sketch(error)) is not None:
            plot_scene(culprit, plot, error)
        raise
    scene = found.scene
    try:
        contacts = len(scene.contacts)
    except InputError as error:
        if plot is not None:
            plot_scene(scene, plot, error)
        raise
    seconds = time.perf_counter() - started
    written = [str(output)]
    write_scene(scene, output)
    if plot is not None:
        written += [str(path) for path in plot_scene(scene, plot)]
    show(facts(_found(found, contacts, seconds, written)))
    warn_of_near_misses(scene)
    return ExitCode.SOLVED


def _found(
    found: Imported, contacts: int, seconds: float, written: list[str]
) -> list[tuple[str, str]]:
    """What was found and repaired, in rows of a name and a fact."""
    scene = found.scene
    blocks = scene.blocks
    low = np.min([b.vertices.min(axis=0) for b in blocks], axis=0)
    high = np.max([b.vertices.max(axis=0) for b in blocks], axis=0)
    size = " x ".join(f"{x:.5g}" for x in high - low)
    unit = scene.units.length
    notched = sum(not block.is_convex for block in blocks)
    supports = ", ".join(scene.supports[:_NAMED])
    more = f" and {len(scene.supports) - _NAMED} more" if len(scene.supports) > _NAMED else ""
    rows = [
        ("scene", f"{scene.name} ({count(len(found.files), 'file')})"),
        ("size", f"{size} {unit}, weight {scene.total_weight:.6g} {scene.units.force}"),
        ("blocks", f"{len(blocks)}, {notched} of them not convex" if notched else f"{len(blocks)}"),
        ("supports", f"{len(scene.supports)}: {supports}{more}"),
        ("faces", f"{sum(len(block.faces) for block in blocks)}"),
        ("contacts", f"{contacts}"),
        ("repairs", _repairs(scene)),
        *(("note", note) for note in found.notes),
        ("near misses", f"{len(scene.near_misses)}"),
        ("time in s", f"{seconds:.3f}"),
        *(("written", file) for file in written),
    ]
    return [(name, one_line(fact)) for name, fact in rows]


def _repairs(scene: Scene) -> str:
    """Repairs by kind, with how many blocks each concerned."""
    times, blocks = Counter[str](), Counter[str]()
    for block in scene.blocks:
        for repair in block.repairs:
            times[repair.kind] += repair.count
        blocks.update({repair.kind for repair in block.repairs})
    if not times:
        return "none"
    return ", ".join(f"{times[kind]} {kind} (in {count(blocks[kind], 'block')})" for kind in times)


def _supports(text: str | None) -> str | list[str] | None:
    if text is None or text == LOWEST:
        return text
    return [name.strip() for name in text.split(",")]


def _vector(text: str) -> tuple[float, ...]:
    try:
        vector = tuple(float(part) for part in text.split(","))
    except ValueError:
        vector = ()
    if len(vector) != 3:
        raise typer.BadParameter(f"--live must be three numbers X,Y,Z, got {text!r}")
    return vector
