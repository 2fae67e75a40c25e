"""``cvxlimit import``: geometry files in, a scene file out, and what was found and repaired."""

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
from cvxlimit.cli.options import Command, numbers, vector
from cvxlimit.cli.report import SCENE_PICTURES, check_outputs, counted, facts, warn_of_geometry
from cvxlimit.cli.shell import ExitCode, show
from cvxlimit.errors import GeometryError, InputError, ModelError
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.extensions.importing.files import bodies_in
from cvxlimit.extensions.importing.reading import unstated
from cvxlimit.extensions.importing.supports import LOWEST
from cvxlimit.geometry.blocks import Block
from cvxlimit.io import Imported, import_geometry, write_scene
from cvxlimit.plotting import plot_scene
from cvxlimit.scene import Load, Pressure, Scene
from cvxlimit.surroundings.reached import earth_pressure, fill, hydrostatic
from cvxlimit.surroundings.resisting import passive

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


def _spelt(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _as_options(text: str) -> str:
    """A message of :func:`cvxlimit.io.import_geometry` with options in place of its arguments.

    >>> _as_options('check length_unit, or give supports="lowest" or supports=["ID", ...]')
    'check --length-unit, or give --supports lowest or --supports ID,...'
    """

    def with_value(found: re.Match[str]) -> str:
        plain = re.sub(r'[][" ]', "", found[2])
        return f"{_spelt(found[1])} {plain}"

    names = [each.name for each in fields(ImportCommand)]
    value = r"""\[[^]]*\]|"[^"]*"|[\w.-]+"""  # a list, a word in quotes, a number or a word
    text = re.sub(rf"(?<!')\b({'|'.join(names)})=({value})", with_value, text)
    several_words = "|".join(name for name in names if "_" in name)
    return re.sub(rf"\b({several_words})\b", lambda found: _spelt(found[0]), text)


@dataclass(frozen=True, kw_only=True)
class ImportCommand(Command):
    """Make a scene from geometry files, and report contacts found and repairs made.

    Needed are --output, --length-unit, --up, --friction and --live; --density and --supports where
    the files have none.

    Arguments
    ---------
    geometry : GEOMETRY...
        Files or folders: .obj, .stl, .ply, .glb, .gltf, .off, .dxf, COMPAS .json, 3DEC .dat, or
        .csv with a box per row (id, xmin, ymin, zmin, xmax ...).

    Output
    ------
    output, -o : SCENE.json
        Scene file to write.
    plot : OUT.png|.html
        Draw the scene, or what is wrong with it if it is refused.

    Model
    -----
    length_unit : UNIT
        Unit of the coordinates: m, mm ...
    to_unit : UNIT
        Convert the coordinates to this unit first; density, tolerance and forces are in it then.
    up : AXIS
        Axis that points up, x, y or z; nothing is turned.
    density : G
        Weight per volume of all blocks, in place of the files'.
    density_factor : F
        Turns the files' densities into weight per volume; kg/m3 to kN/m3: 0.00981.
    friction : MU
        Coulomb coefficient of all contacts.
    supports : IDS
        Fixed blocks, in place of those that the files mark: lowest (those within 1 % of the
        height), or ids with commas between them.
    live : X,Y,Z
        Live load: multiples of every block's weight, along the axes; or pressures, those of earth
        and water, which are dead else.
    joint_tolerance : L
        Gaps, overlaps and warps up to this length are joints; relative to block size unless given.
    force_unit : UNIT
        Unit of forces: kN (default), N ...
    name : NAME
        Of the scene; the file's unless given.

    Around
    ------
    earth : Z,G,K,SIDE
        Earth: level, unit weight, coefficient, and X,Y,Z towards it.
    water : Z,G,SIDE
        Water: level, unit weight, and X,Y,Z towards it.
    fill : Z,G
        Fill on top: level, unit weight.
    soil : Z,G,K,AXIS
        Soil that resists: level, unit weight, K, axis X,Y,Z.
    """

    geometry: list[str]
    output: Path | None = None
    length_unit: str | None = None
    to_unit: str | None = None
    up: str | None = None
    density: float | None = None
    density_factor: float | None = None
    friction: float | None = None
    supports: str | None = None
    live: str | None = None
    earth: list[str] | None = None
    water: list[str] | None = None
    fill: str | None = None
    soil: list[str] | None = None
    joint_tolerance: float | None = None
    force_unit: str = "kN"
    name: str | None = None
    plot: Path | None = None

    def run(self) -> ExitCode:
        missing = [name for name in [*_NEEDED][:-2] if getattr(self, name) is None]
        if missing:
            with suppress(InputError, ModelError):  # of the files, which come next
                missing += unstated(bodies_in(self.geometry), self.density, self.supports)
            given = ", and ".join(f"{_spelt(name)} {_NEEDED[name]}" for name in missing)
            why = "" if missing == ["output"] else "; files do not say and none is guessed"
            raise InputError(f"give {given}{why}")
        output, plot = self.output or Path(), self.plot
        if self.live != PRESSURES:
            _live(self.live)
        inputs = dict.fromkeys(self.geometry, "the geometry")
        written = ("--output", output, [".json"]), ("--plot", plot, SCENE_PICTURES)
        check_outputs(written, inputs)
        started = time.perf_counter()
        found, contacts = self._drawn_if_refused()
        seconds = time.perf_counter() - started
        write_scene(found.scene, output)
        pictures = [] if plot is None else plot_scene(found.scene, plot)
        files = [("written", str(path)) for path in (output, *pictures)]
        show(facts([*_found(found, contacts, seconds), *files]))
        warn_of_geometry(found.scene)
        return ExitCode.SOLVED

    def _drawn_if_refused(self) -> tuple[Imported, int]:
        """What is imported, and its number of contacts; with a picture of what is refused."""
        scene: Scene | None = None
        notes: tuple[str, ...] = ()

        def imported(tell: Tell) -> tuple[Imported, int]:
            nonlocal scene, notes
            found = self._imported()
            scene, notes = found.scene, found.notes
            tell("finding contacts")
            return found, len(scene.contacts)

        try:
            return interruptible(imported)
        except InputError as error:
            error.args = (_as_options("; ".join((str(error), *notes))),)
            culprit = scene if scene or not isinstance(error, GeometryError) else _sketch(error)
            if self.plot is not None and culprit is not None:
                plot_scene(culprit, self.plot, error)
            raise

    def _imported(self) -> Imported:
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
            level, weight, coefficient, *side = numbers("--earth", each, 6, "2,18,0.3,-1,0,0")
            pressures += earth_pressure(scene, level, weight, coefficient, side)
        for each in self.water or ():
            level, weight, *side = numbers("--water", each, 5, "2,9.81,-1,0,0")
            pressures += hydrostatic(scene, level, weight, side)
        if self.live == PRESSURES and not pressures:
            raise InputError("--live pressures: give --earth or --water, which press")
        reactions = list(scene.reactions)
        for each in self.soil or ():
            level, weight, coefficient, *axis = numbers("--soil", each, 6, "0.5,18,1.5,1,0,0")
            reactions += passive(scene, level, weight, coefficient, axis)
        if self.fill is not None:
            level, weight = numbers("--fill", self.fill, 2, "3,20")
            dead = replace(dead, points=(*dead.points, *fill(scene, level, weight)))
        if self.live == PRESSURES:
            scene = scene.with_live(Load(pressures=pressures))
        else:
            dead = replace(dead, pressures=(*dead.pressures, *pressures)) if pressures else dead
        scene = scene if dead is scene.dead else scene.with_dead(dead)
        return scene if not reactions else replace(scene, reactions=tuple(reactions))


def _sketch(error: GeometryError) -> Scene | None:
    """The body that ``error`` refuses, as an unchecked scene to draw; None if there is none."""
    body = error.body
    if not isinstance(body, Body) or not (
        faces := tuple(tuple(face) for face in body.faces if len(set(face)) > 2)
    ):
        return None
    middle = body.vertices.mean(axis=0)
    block = Block(body.name, body.vertices, faces, density=0.0, volume=1.0, centroid=middle)
    turning = Load(forces={body.name: (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)})  # a scene needs some load
    below = replace(block, id=f"{body.name} below")  # and a support, neither of which is drawn
    scene = Scene((block, below), (below.id,), turning, name=body.name)
    return scene._copy(blocks=(block,), supports=())


def _found(found: Imported, contacts: int, seconds: float) -> list[tuple[str, str]]:
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
        *(("note", _as_options(note)) for note in found.notes),
        ("near misses", f"{len(scene.near_misses)}"),
        ("lumped faces", "0" if scene.lumped is None else f"{scene.lumped.faces}"),
        ("time in s", f"{seconds:.3f}"),
    ]


def _repairs(scene: Scene) -> str:
    times, blocks = Counter[str](), Counter[str]()
    for block in scene.blocks:
        for repair in block.repairs:
            times[repair.kind] += repair.count
        blocks.update({repair.kind for repair in block.repairs})
    kinds = (f"{times[kind]} {kind} (in {counted(blocks[kind], 'block')})" for kind in times)
    return ", ".join(kinds) or "none"
