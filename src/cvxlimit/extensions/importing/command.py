"""``cvxlimit import``: geometry files in, a scene file out, and what was found and repaired."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

import re
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import (
    OUTPUT,
    argument,
    command_of,
    numbers,
    option,
    output_option,
    vector,
)
from cvxlimit.cli.report import (
    SCENE_PICTURES,
    ExitCode,
    check_outputs,
    counted,
    facts,
    show,
    warn_of_geometry,
)
from cvxlimit.errors import GeometryError, InputError, ModelError
from cvxlimit.extensions.importing.reading import bodies_in, sketch, unstated
from cvxlimit.extensions.importing.supports import LOWEST
from cvxlimit.io import Imported, import_geometry, write_scene
from cvxlimit.plotting import plot_scene
from cvxlimit.scene import Load, Pressure, Scene
from cvxlimit.scene.resisting import passive
from cvxlimit.scene.surroundings import earth_pressure, fill, hydrostatic

AROUND = "Around"
"""Group of options: what surrounds a structure."""


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """What ``cvxlimit import`` is to make a scene of, and with what."""

    geometry: list[str] = argument(
        "Files or folders: .obj, .stl, .ply, .glb, .gltf, .off, .dxf, COMPAS .json, or .csv with a "
        "box per row (id, xmin, ymin, zmin, xmax, ymax, zmax; density, support).",
        "GEOMETRY...",
    )
    output: Path | None = output_option("SCENE.json", "Scene file to write.")
    length_unit: str | None = option("UNIT", "Unit of the coordinates: m, mm ...")
    to_unit: str | None = option(
        "UNIT",
        "Convert the coordinates to this unit first; density, tolerance and forces are in it then.",
    )
    up: str | None = option("AXIS", "Axis that points up, x, y or z; nothing is turned.")
    density: float | None = option("G", "Weight per volume of all blocks, in place of the files'.")
    density_factor: float | None = option(
        "F", "Turns the files' densities into weight per volume; kg/m3 to kN/m3: 0.00981."
    )
    friction: float | None = option("MU", "Coulomb coefficient of all contacts.")
    supports: str | None = option(
        "IDS",
        "Fixed blocks, in place of those that the files mark: lowest (those within 1 % of "
        "the height), or ids with commas between them.",
    )
    live: str | None = option(
        "X,Y,Z",
        "Live load: multiples of every block's weight, along the axes; or pressures, those of "
        "earth and water, which are dead else.",
    )
    earth: list[str] | None = option(
        "Z,G,K,SIDE", "Earth: level, unit weight, coefficient, and X,Y,Z towards it.", group=AROUND
    )
    water: list[str] | None = option(
        "Z,G,SIDE", "Water: level, unit weight, and X,Y,Z towards it.", group=AROUND
    )
    fill: str | None = option("Z,G", "Fill on top: level, unit weight.", group=AROUND)
    soil: list[str] | None = option(
        "Z,G,K,AXIS", "Soil that resists: level, unit weight, K, axis X,Y,Z.", group=AROUND
    )
    joint_tolerance: float | None = option(
        "L",
        "Gaps, overlaps and warps up to this length are joints; relative to block size unless "
        "given.",
    )
    force_unit: str = option("UNIT", "Unit of forces: kN (default), N ...", "kN")
    name: str | None = option("NAME", "Of the scene; the file's unless given.")
    plot: Path | None = option(
        "OUT.png|.html",
        "Draw the scene, or what is wrong with it if it is refused.",
        group=OUTPUT,
    )

    def imported(self) -> Imported:
        supports: Any = self.supports
        if self.supports not in (None, LOWEST):
            supports = [name.strip() for name in supports.split(",")]
        names = ("density", "density_factor", "friction", "joint_tolerance", "length_unit",
                 "to_unit", "up", "force_unit", "name")  # fmt: skip
        given: dict[str, Any] = {name: getattr(self, name) for name in names}
        live = (1.0, 0.0, 0.0) if self.live == PRESSURES else _live(self.live)
        found = import_geometry(self.geometry, supports=supports, live=live, **given)
        return replace(found, scene=self._surrounded(found.scene))

    def _surrounded(self, scene: Scene) -> Scene:
        """The scene with what surrounds it."""
        pressures, dead = list[Pressure](), scene.dead
        for each in self.earth or ():
            level, weight, coefficient, *side = numbers("--earth", each, "2,18,0.3,-1,0,0")
            pressures += earth_pressure(scene, level, weight, coefficient, side)
        for each in self.water or ():
            level, weight, *side = numbers("--water", each, "2,9.81,-1,0,0")
            pressures += hydrostatic(scene, level, weight, side)
        if self.live == PRESSURES and not pressures:
            raise InputError("--live pressures: give --earth or --water, which press")
        reactions = list(scene.reactions)
        for each in self.soil or ():
            level, weight, coefficient, *axis = numbers("--soil", each, "0.5,18,1.5,1,0,0")
            reactions += passive(scene, level, weight, coefficient, axis)
        if self.fill is not None:
            level, weight = numbers("--fill", self.fill, "3,20")
            dead = replace(dead, points=(*dead.points, *fill(scene, level, weight)))
        if self.live == PRESSURES:
            scene = scene.with_live(Load(pressures=pressures))
        else:
            dead = replace(dead, pressures=(*dead.pressures, *pressures)) if pressures else dead
        scene = scene if dead is scene.dead else scene.with_dead(dead)
        return scene if not reactions else replace(scene, reactions=tuple(reactions))


PRESSURES = "pressures"
"""Of --live: earth and water."""


def _live(text: str | None) -> tuple[float, ...]:
    return vector("--live", text or "", "0,1,0")


_NEEDED = {
    "output": "SCENE.json, the scene file to write",
    "length_unit": "m, mm ...: what the coordinates are in",
    "up": "x, y or z: the axis that points up",
    "friction": "the Coulomb coefficient of the joints",
    "live": "X,Y,Z: the live load in multiples of every block's weight (or pressures)",
    "supports": "lowest, or ids with commas between them: the blocks that are fixed",
    "density": "G: the weight per volume",
}
"""Where the scene goes, and what files do not say; the last two some do."""


_OPTIONS = re.compile(
    rf"\b({'|'.join(each.name for each in fields(Geometry) if '_' in each.name)})\b"
)
"""Names of arguments in refusals, which are options here."""


def _spelt(name: str) -> str:
    return f"--{name.replace('_', '-')}"


@command_of(Geometry)
def import_command(asked: Geometry) -> ExitCode:
    """Make a scene from geometry files, and report contacts found and repairs made.

    Needed are --output, --length-unit, --up, --friction and --live; --density and --supports where
    the files have none.
    """
    missing = [name for name in [*_NEEDED][:-2] if getattr(asked, name) is None]
    if missing:
        with suppress(InputError, ModelError):  # of the files, which come next
            missing += unstated(bodies_in(asked.geometry), asked.density, asked.supports)
        given = ", and ".join(f"{_spelt(name)} {_NEEDED[name]}" for name in missing)
        why = "" if missing == ["output"] else "; files do not say and none is guessed"
        raise InputError(f"give {given}{why}")
    output, plot = asked.output or Path(), asked.plot
    if asked.live != PRESSURES:
        _live(asked.live)
    inputs = dict.fromkeys(asked.geometry, "the geometry")
    check_outputs(
        {"--output": output, "--plot": plot}, inputs, plot=SCENE_PICTURES, output=[".json"]
    )
    started = time.perf_counter()
    found, contacts = _drawn_if_refused(asked, plot)
    seconds = time.perf_counter() - started
    written = [str(output)]
    write_scene(found.scene, output)
    if plot is not None:
        written += [str(path) for path in plot_scene(found.scene, plot)]
    show(facts(_found(found, contacts, seconds, written)))
    warn_of_geometry(found.scene)
    return ExitCode.SOLVED


def _drawn_if_refused(asked: Geometry, plot: Path | None) -> tuple[Imported, int]:
    scene: Scene | None = None
    notes: tuple[str, ...] = ()

    def imported(tell: Tell) -> tuple[Imported, int]:
        nonlocal scene, notes
        found = asked.imported()
        scene, notes = found.scene, found.notes
        tell("finding contacts")
        return found, len(scene.contacts)

    try:
        return interruptible(imported)
    except InputError as error:
        told = "; ".join((_OPTIONS.sub(lambda name: _spelt(name[0]), str(error)), *notes))
        error.args = (told,)
        culprit = scene if scene or not isinstance(error, GeometryError) else sketch(error)
        if plot is not None and culprit is not None:
            plot_scene(culprit, plot, error)
        raise


def _found(
    found: Imported, contacts: int, seconds: float, written: list[str]
) -> list[tuple[str, str]]:
    scene = found.scene
    blocks = scene.blocks
    low = np.min([b.vertices.min(axis=0) for b in blocks], axis=0)
    high = np.max([b.vertices.max(axis=0) for b in blocks], axis=0)
    size = " x ".join(f"{x:.5g}" for x in high - low)
    unit = scene.units.length
    notched = sum(not block.is_convex for block in blocks)
    supports, others = ", ".join(scene.supports[:8]), len(scene.supports) - 8
    more = f" and {others} more" if others > 0 else ""
    return [
        ("scene", f"{scene.name} ({counted(len(found.files), 'file')})"),
        ("size", f"{size} {unit}, weight {scene.total_weight:.6g} {scene.units.force}"),
        ("blocks", f"{len(blocks)}, {notched} of them not convex" if notched else f"{len(blocks)}"),
        ("supports", f"{len(scene.supports)}: {supports}{more}"),
        ("faces", f"{sum(len(block.faces) for block in blocks)}"),
        ("contacts", f"{contacts}"),
        ("repairs", _repairs(scene)),
        *(("note", note) for note in found.notes),
        ("near misses", f"{len(scene.near_misses)}"),
        ("lumped faces", "0" if scene.lumped is None else f"{scene.lumped.faces}"),
        ("time in s", f"{seconds:.3f}"),
        *(("written", file) for file in written),
    ]


def _repairs(scene: Scene) -> str:
    times, blocks = Counter[str](), Counter[str]()
    for block in scene.blocks:
        for repair in block.repairs:
            times[repair.kind] += repair.count
        blocks.update({repair.kind for repair in block.repairs})
    if not times:
        return "none"
    return ", ".join(
        f"{times[kind]} {kind} (in {counted(blocks[kind], 'block')})" for kind in times
    )
