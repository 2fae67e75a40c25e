"""From geometry files to a scene: every file read, every body a block, nothing guessed.

:func:`import_geometry` takes four steps, and their helpers follow it in this order:

1. Each file is read by the reader of its suffix (:mod:`.files`), into bodies (:class:`Body`:
   corners, faces and what else the file says), and bodies get names that differ.
2. They are brought into the unit asked for, and densities into weights per volume.
3. Supports are chosen, planes of no thickness become slabs, and bodies become blocks, which are
   checked.
4. Blocks and loads become a scene. Where faces are warped, as in surveys, joints may gape by as
   much.

Messages name the arguments of :func:`import_geometry`; where an argument is a plain word they write
``density=G`` or ``supports="lowest"``. ``cvxlimit import`` spells both as its options.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.extensions.importing.compas import bodies_of, is_object
from cvxlimit.extensions.importing.digits import WORTH_A_WORD, is_single, too_few_digits, with_noise
from cvxlimit.extensions.importing.files import files_in, read, unique
from cvxlimit.extensions.importing.sheets import is_sheet, with_slabs
from cvxlimit.extensions.importing.supports import LOWEST, refuse_all_lowest, supports_of
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.solids import solid
from cvxlimit.io.fields import LARGEST_NUMBER, file_prefix, refusals, shown
from cvxlimit.scene import METRES, Load, Scene, Units
from cvxlimit.scene.doubts import unit_in_doubt
from cvxlimit.scene.units import KILONEWTONS, G

AXES = ("x", "y", "z")

STONE = (5.0, 40.0)
"""Weights per volume in kN/m³ between which all stones and bricks lie: pumice has 6, basalt 31."""

SIZES = (0.01, 5.0)
"""Metres between which the sizes of stones lie: few masons lift more, or lay less."""


@dataclass(frozen=True, eq=False)
class Imported:
    """A scene made from geometry files, and what was noticed on the way.

    Attributes
    ----------
    scene : Scene
    files : tuple of str
        The files read, in order.
    notes : tuple of str
        Decisions taken on the way: bodies separated, values of the files overruled.
    """

    scene: Scene
    files: tuple[str, ...]
    notes: tuple[str, ...]


def import_geometry(
    paths: Any, *, length_unit: str, up: str, friction: float, live: ArrayLike | Load,
    density: float | None = None, density_factor: float | None = None,
    supports: str | Sequence[str] | None = None, force_unit: str = "kN",
    joint_tolerance: float | None = None, name: str | None = None, to_unit: str | None = None,
) -> Imported:  # fmt: skip
    """A scene from OBJ, STL, PLY, glTF, OFF, DXF, COMPAS, 3DEC or CSV files.

    Every object of an OBJ file is a block (every group where there is one object), every node of a
    COMPAS assembly and every one with a mesh of a glTF file, every row of a table, every block of a
    data file of 3DEC, every closed shell of an STL, PLY or OFF mesh, and every solid, mesh, closed
    polyline with a thickness or shell of 3D faces of a DXF drawing.
    Geometry files do not state units, supports and friction: these are arguments.

    Parameters
    ----------
    paths
        A file, a folder of files, or several of either; or an object of COMPAS in their place: see
        :meth:`~cvxlimit.scene.Scene.from_compas`.
    length_unit : str
        Unit of the files' coordinates, for example "m".
    up : "x", "y" or "z"
        Axis that points up: the dead load is self-weight, downwards. Nothing is turned.
    friction : float
        Coulomb coefficient of all contacts.
    live : (3,) or Load
        Multiples of each block's weight in the files' axes, or any load.
    density : float or None
        Weight per volume of all blocks, in force per length unit cubed; None takes what the files
        state.
    density_factor : float or None
        Turns the files' densities into weights per volume; must be given where a COMPAS file's
        densities are used (kg/m3 to kN/m3: 0.00981).
    supports : "lowest", ids, or None
        Fixed blocks: the lowest ones (within 1 % of the height), those named, or, with None, those
        that the files mark. Ground may be a plane of no thickness: one face or several in one
        plane. It can only be a support. With None it is one if no file marks any; with "lowest" if
        it is lowest, and then the stones on it are not.
    force_unit : str
    joint_tolerance : float or None
        See :class:`~cvxlimit.scene.Scene`.
    name : str or None
        Of the scene; the file's name unless given.
    to_unit : str or None
        Coordinates are converted to this unit first, from mm to m for example; densities, loads and
        the tolerance are in it. None converts nothing.

    Raises
    ------
    InputError
        If a file cannot be read, a body is no block, or something that was asked for is missing:
        one line naming the file and the block.
    ModelError
        If a format needs trimesh or ezdxf and it is not installed.

    Example
    -------
    >>> import pathlib, tempfile
    >>> table = pathlib.Path(tempfile.mkdtemp(), "tower.csv")
    >>> _ = table.write_text('''id,xmin,ymin,zmin,xmax,ymax,zmax
    ... ground,-1,-1,-1,2,2,0
    ... tower,0,0,0,1,1,4
    ... ''')
    >>> found = import_geometry(
    ...     table, length_unit="m", up="z", density=20, friction=0.7, supports=["ground"],
    ...     live=(1, 0, 0),
    ... )
    >>> found.scene.contacts.names
    ('ground-tower',)
    """
    with refusals():
        notes, axis = list[str](), _axis(up)
        if joint_tolerance is not None:
            positive(joint_tolerance, "joint_tolerance")
        # 1. What files or objects hold, under names of their own.
        files = [] if is_object(paths) else files_in(paths)
        bodies = unique(read(files, notes) if files else bodies_of(paths), notes)
        _check_coordinates(bodies)
        blurred, coarse = too_few_digits(bodies), too_few_digits(bodies, WORTH_A_WORD)
        if blurred and is_single(bodies):  # round numbers in a text may just be round
            raise InputError(blurred)
        if blurred or coarse:
            notes.append(blurred or coarse)
        # 2. In the unit asked for, with weights per volume.
        bodies = _converted(bodies, length_unit, to_unit, notes)
        # COMPAS, whose files are JSON, has mass per volume; all other formats have weight.
        is_mass = not files or any(file.suffix.lower() == ".json" for file in files)
        bodies = _with_densities(bodies, density, density_factor, is_mass, supports, notes)
        # 3. Which are fixed; all as blocks, with the tolerance that is asked for or any other.
        with _blamed_on(blurred):
            fixed = supports_of(bodies, supports, axis, notes)
            bodies = with_slabs(bodies, fixed, notes)
            made = partial(_blocks, bodies, fixed)
            with refusals(file_prefix(files[0]) if len(files) == 1 else ""):
                blocks = made(joint_tolerance)
            if supports == LOWEST:
                refuse_all_lowest(bodies, fixed, axis)
        # 4. The scene, with joints as wide as the files are rough.
        scene = Scene(
            blocks=blocks,
            supports=tuple(body.name for body in bodies if body.name in fixed),
            live=live if isinstance(live, Load) else Load(acceleration=live),  # type: ignore[arg-type]
            dead=Load(gravity=tuple((-axis + 0.0).tolist())),
            friction=friction,
            units=Units(to_unit or length_unit, force_unit),
            name=name or (files[0].stem if files else str(getattr(paths, "name", "compas"))),
            joint_tolerance=joint_tolerance,
        )
        scene = with_noise(scene, bodies, made, notes)
        notes += [*_strange_density(scene), *_strange_stones(scene)]
        return Imported(scene, tuple(map(str, files)), tuple(notes))


def of_compas(model: Any, live: ArrayLike | Load | None, **given: Any) -> Scene:
    """See :meth:`cvxlimit.scene.Scene.from_compas`."""
    if not is_object(model):
        raise InputError(
            f"model must be an object of COMPAS, got {model!r:.60}: of files, "
            "cvxlimit.io.import_geometry makes a scene"
        )
    length = METRES.get(given.get("to_unit") or given["length_unit"])
    force = KILONEWTONS.get(given.get("force_unit", "kN"))
    if length is not None and force is not None:  # kg/m3 as weight per volume
        given.setdefault("density_factor", 1e-3 * G / force * length**3)
    return import_geometry(model, live=(1.0, 0.0, 0.0) if live is None else live, **given).scene


def _axis(up: str) -> FloatArray:
    if up not in AXES:
        raise InputError(f"up must be x, y or z, got {up!r}")
    return np.eye(3)[AXES.index(up)]


def _check_coordinates(bodies: Sequence[Body]) -> None:
    for body in bodies:
        fine = (np.abs(body.vertices) <= LARGEST_NUMBER).all(axis=1)
        if not fine.all():
            worst = int(np.flatnonzero(~fine)[0])
            raise InputError(
                f"vertex {worst} of block {shown(body.name)} must be finite and at most "
                f"{LARGEST_NUMBER:g}, got {body.vertices[worst].tolist()}"
            )


# 2. The unit asked for, and weights per volume.


def _converted(bodies: list[Body], given: str, asked: str | None, notes: list[str]) -> list[Body]:
    """The bodies in the unit asked for; a note for each unit that a file states and that is not the
    one given."""
    units = Counter(body.unit for body in bodies if body.unit not in (None, given))
    for unit, number in sorted(units.items()):
        blocks = "1 block" if number == 1 else f"{number} blocks"
        notes.append(
            f"the unit of {blocks} is {unit} in the file, and {given} is what was asked for: "
            "check length_unit"
        )
    if asked is None:
        return bodies
    times = _metres(given) / _metres(asked)
    return [replace(body, vertices=times * body.vertices) for body in bodies]


def _metres(unit: str) -> float:
    if unit not in METRES:
        raise InputError(
            f"there is no conversion of length unit {unit!r}: it must be one of {', '.join(METRES)}"
        )
    return METRES[unit]


def _with_densities(
    bodies: Sequence[Body], density: float | None, factor: float | None, is_mass: bool,
    supports: str | Sequence[str] | None, notes: list[str],
) -> list[Body]:  # fmt: skip
    """The bodies with weights per volume: ``density``, or else what files state times ``factor``.

    With ``is_mass`` a file may state mass, and the factor has to be given. Where the files leave
    out densities and supports, one refusal names both.
    """
    stated = [body for body in bodies if body.density is not None]
    if density is not None:
        if stated:
            notes.append(f"densities of {len(stated)} blocks in the files give way to {density:g}")
        return [replace(body, density=density) for body in bodies]
    if stated and factor is None and is_mass:
        raise InputError(
            f"block {stated[0].name!r} has density {stated[0].density:g} in the file, as a rule "
            "kg/m3 there: say what turns it into weight per volume (density_factor=0.00981 "
            "for kg/m3 to kN/m3), or give density=G, the weight per volume of all blocks"
        )
    if len(unstated(bodies, density, supports)) > 1:
        raise InputError(
            "no file marks supports or states densities: say which blocks are fixed "
            '(supports="lowest" or supports=["ID", ...]), and give density=G, the weight per volume'
        )
    times = 1.0 if factor is None else factor
    return [
        body if body.density is None else replace(body, density=times * body.density)
        for body in bodies
    ]


def unstated(
    bodies: Sequence[Body], density: float | None, supports: str | Sequence[str] | None
) -> list[str]:
    """Which of "supports" and "density" neither the files nor the arguments say: some body marked,
    or drawn as a plane, says the former; a density for every other body the latter."""
    loose = [body for body in bodies if not (body.is_support or is_sheet(body))]
    result = list[str]()
    if supports is None and len(loose) == len(bodies):
        result.append("supports")
    if density is None and any(body.density is None for body in loose):
        result.append("density")
    return result


# 3. Blocks.


@contextmanager
def _blamed_on(blurred: str) -> Iterator[None]:
    """Begin a refusal with what is wrong with the numbers of the files, if anything is."""
    try:
        yield
    except InputError as error:
        if blurred:
            error.args = (f"{blurred} ({error})",)
        raise


def _blocks(bodies: Sequence[Body], fixed: set[str], tolerance: float | None) -> tuple[Block, ...]:
    """The bodies as blocks, which are checked; ``fixed`` ones need no density."""
    blocks = list[Block]()
    for body in bodies:
        if body.density is None and body.name not in fixed:
            raise InputError(
                f"block {shown(body.name)} has no density in the file: give density=G, the weight "
                "per volume"
            )
        if body.is_box:
            low, high = body.vertices
            blocks.append(Block.box(body.name, low, high, body.density))
            continue
        try:
            blocks.append(solid(body.name, body.vertices, body.faces, body.density, tolerance))
        except GeometryError as error:
            error.body = body
            raise
    return tuple(blocks)


# 4. What is strange about the scene.


def _strange_density(scene: Scene) -> list[str]:
    """A word where blocks are far lighter or heavier than stone, as a rule by another unit."""
    units, blocks = scene.units, [scene.blocks[i] for i in scene.free]
    if units.length not in METRES or units.force not in KILONEWTONS or not blocks:
        return []
    given = scene.total_weight / sum(block.volume for block in blocks)
    mean = given * KILONEWTONS[units.force] / METRES[units.length] ** 3
    low, high = STONE
    if low <= mean <= high:
        return []
    return [
        f"the mean density is {mean:.3g} kN/m³, which no stone has ({low:g} to {high:g}): check "
        "it and length_unit, or convert coordinates with to_unit"
    ]


def _strange_stones(scene: Scene) -> list[str]:
    """A question each if the largest or smallest free block has a size that few stones have; sizes
    that no stone has are told by the scene itself."""
    free = [scene.blocks[i] for i in scene.free]
    metres = METRES.get(scene.units.length)
    if metres is None or any("are coordinates in" in said for said in scene.doubts):
        return []
    sizes = [metres * float(np.ptp(block.vertices, axis=0).max()) for block in free]
    strange = list[tuple[str, float]]()
    if max(sizes) > SIZES[1]:
        strange.append(("largest", max(sizes)))
    if min(sizes) < SIZES[0]:
        strange.append(("smallest", min(sizes)))
    return [
        f"the {which} stone is {size:.3g} m across: {unit_in_doubt(scene.units.length, 'it', size)}"
        for which, size in strange
    ]
