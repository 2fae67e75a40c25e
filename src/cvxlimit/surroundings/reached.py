"""What surrounds a structure as loads: water and soil beside it, water in its joints, fill and
wheels on top of it; found on the faces that they reach, whatever their number.

All take the same way: the bare faces that look there (``bare_faces.py``), the part of each that is
reached, and the pressure on it: as a :class:`~cvxlimit.Pressure`, or, where it acts straight down,
as one force at its centre.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import finite_vector, not_negative, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.mesh import cut_off
from cvxlimit.scene.loads import PointForce
from cvxlimit.scene.pressures import FACING, Pressure, pressed
from cvxlimit.scene.scene import Scene
from cvxlimit.surroundings.bare_faces import (
    SAME_FACE,
    Face,
    chosen,
    down,
    horizontal,
    looking,
    seen_from_above,
    upwards,
    written,
)

FLAT = np.cos(np.radians(45.0))
"""Joints less than 45 degrees off level are bed joints, in which water lifts."""


def hydrostatic(
    scene: Scene,
    level: float,
    unit_weight: float,
    direction: ArrayLike,
    blocks: Collection[str] | None = None,
) -> tuple[Pressure, ...]:
    """Water beside a structure: pressure that grows with depth, on all faces that it reaches.

    Wet are the faces of free blocks that look along ``direction`` (within 80 degrees), where no
    other block covers them, below the level; a face half under water is cut there. It presses at
    right angles on each, whichever way that looks. Tops and treads need a call of their own, with
    the direction upwards. Supports do not move: what presses on them does not count.

    Parameters
    ----------
    scene : Scene
        Its loads do not matter but for the dead load's gravity, which says where down is (-z
        without any).
    level : float
        Height of the water's surface, along the direction against gravity, from the origin.
    unit_weight : float
        Force per volume, 9.81 kN/m3 for water.
    direction : (3,)
        From the structure towards the water; the faces that look there are wet.
    blocks : collection of str, optional
        The only blocks that it reaches; unless given, all free ones, also those behind others.

    Returns
    -------
    tuple of Pressure
        To be given to a :class:`Load`, dead or live.

    Raises
    ------
    InputError
        If a number or a block is wrong, or the water reaches no face.

    Example
    -------
    A wall of 0.8 m by 2 m and 22 kN/m3, water up to its top, per metre: it turns over its toe at
    W 0.4 / (9.81 2^3 / 6)

    >>> from cvxlimit import Load, solve
    >>> from cvxlimit.masonry import stack
    >>> wall = stack(4, size=(0.8, 1.0, 0.5), density=22.0, friction=0.8)
    >>> water = hydrostatic(wall, 2.0, 9.81, direction=(-1, 0, 0))
    >>> round(solve(wall.with_live(Load(pressures=water))).load_factor, 4)
    1.0765
    """
    return earth_pressure(scene, level, unit_weight, 1.0, direction, 0.0, blocks)


def earth_pressure(
    scene: Scene,
    level: float,
    unit_weight: float,
    coefficient: float,
    direction: ArrayLike,
    surcharge: float = 0.0,
    blocks: Collection[str] | None = None,
    *,
    water: float | None = None,
    submerged: float | None = None,
) -> tuple[Pressure, ...]:
    """Soil behind a structure: coefficient x (unit weight x depth + surcharge), at right angles.

    The faces, and all arguments not named here, are those of :func:`hydrostatic`. No friction
    between soil and wall is assumed, which lies on the safe side for a wall pushed by it;
    :func:`~cvxlimit.coulomb_pressure` has it.

    Parameters
    ----------
    level : float
        Height of the soil's level surface.
    coefficient : float
        Of earth pressure: active, at rest or passive, as the case may be: Rankine's active one is
        tan(45 degrees - phi / 2)^2.
    surcharge : float, optional
        Force per area on the soil's surface.
    water, submerged : float, optional
        Level of ground water, and the soil's unit weight below it: less by that of water. What the
        water presses itself is :func:`hydrostatic` with the same level.

    Raises
    ------
    InputError
        If a number or a block is wrong, or the soil reaches no face.

    Example
    -------
    >>> from cvxlimit import Load
    >>> from cvxlimit.masonry import stack
    >>> wall = stack(4, size=(0.8, 1.0, 0.5))
    >>> soil = Load(pressures=earth_pressure(wall, 2.0, 18.0, 0.3, (-1, 0, 0), surcharge=5.0))
    >>> soil.on(wall.blocks)[:, 0].sum().round(6).item()  # 0.3 (18 2^2 / 2 + 5 2) 1
    13.8
    """
    share = positive(coefficient, "coefficient")
    layers = layers_of(level, unit_weight, surcharge, water, submerged)
    up, faces = upwards(scene), looking(scene, direction, blocks)
    check_level(level, faces, up, f"along {written(direction)}")
    return tuple(pressure for face in faces for pressure in on_face(face, layers, share, up))


def check_level(level: float, faces: Sequence[Face], up: FloatArray, where: str) -> None:
    """Refuse a level that reaches none of the faces, which look ``where``."""
    finite_vector([level], 1, "level")
    heights = np.concatenate([face.corners for face in faces]) @ up
    if not level > heights.min():
        raise InputError(
            f"level {level:g} is below all faces that look {where}, which lie between the heights "
            f"{heights.min():g} and {heights.max():g}: give a level above the lowest"
        )


Layers = Sequence[tuple[float, float, float]]
"""Of soil: its surface, unit weight, and vertical pressure there, from the top down."""


def layers_of(
    level: float, unit_weight: float, surcharge: float, water: float | None,
    submerged: float | None,
) -> Layers:  # fmt: skip
    """Soil, and below ground water soil that weighs less."""
    whole = positive(unit_weight, "unit_weight"), not_negative(surcharge, "surcharge")
    if (water is None) != (submerged is None):
        raise InputError("water and submerged go together: give both, or neither")
    if water is None or submerged is None:
        return [(level, *whole)]
    finite_vector([water], 1, "water")
    below = not_negative(submerged, "submerged")
    if water > level or below > unit_weight:
        raise InputError(
            f"water {water:g} must not be above level {level:g}, nor submerged {below:g} above "
            f"unit_weight {unit_weight:g}: a flood in front of or over soil is hydrostatic's"
        )
    return [(level, *whole), (water, below, whole[1] + whole[0] * (level - water))]


def layered(
    face: Face, layers: Layers, up: FloatArray
) -> Iterator[tuple[Face, float, float, float]]:
    """Yields the layers that reach a face, each behind its part of it; what lies above the first
    one's surface is left in."""
    corners = face.corners
    for k, layer in enumerate(layers):
        bottom = layers[k + 1][0] if k + 1 < len(layers) else -np.inf
        heights = corners @ up
        if max(heights.min(), bottom) < layer[0] and heights.max() > bottom:
            part = corners if heights.min() >= bottom else _above(corners, heights - bottom)
            yield replace(face, corners=part), *layer


def _above(corners: FloatArray, heights: FloatArray) -> FloatArray:
    """The part of a polygon (k, 3) whose ``heights`` are above zero."""
    kept = list[FloatArray]()
    ends = zip(corners, heights, np.roll(corners, -1, 0), np.roll(heights, -1), strict=True)
    for start, at_start, end, at_end in ends:
        if at_start >= 0.0:
            kept.append(start)
        if at_start * at_end < 0.0:
            kept.append(start + at_start / (at_start - at_end) * (end - start))
    return np.array(kept)


def on_face(face: Face, layers: Layers, share: float, up: FloatArray) -> list[Pressure]:
    """What layers press on a face with so much of their weight."""
    return [
        Pressure(
            face.block.id,
            face.normal.tolist(),
            share * first,
            (-(share * weight) * up + 0.0).tolist(),
            at=(surface * up + 0.0).tolist(),
            within=(-up + 0.0).tolist(),
            corners=part.corners.tolist(),
        )
        for part, surface, weight, first in layered(face, layers, up)
    ]


def uplift(
    scene: Scene,
    level: float,
    unit_weight: float,
    direction: ArrayLike,
    tail: float | None = None,
    blocks: Collection[str] | None = None,
) -> tuple[Pressure, ...]:
    """Water in bed joints: equal and opposite pressures on the two blocks of each.

    In every joint less than 45 degrees off level that the water's level is above, the pressure is
    the water's at the wet edge, and falls linearly to that of the tail water, or to nothing, at the
    dry edge. Edges are those of all joints in the same plane. What contacts then carry is what the
    stones press on each other with besides, and friction is in proportion to that. A support
    is pressed as much as the block on it; as it does not move, nothing is written for it.

    Steeper joints are left out. Water in them presses stones apart along the wall, and lifts none.

    Parameters
    ----------
    scene, level, unit_weight, direction
        As for :func:`hydrostatic`; contacts are found.
    tail : float, optional
        Level of the water on the dry side; unless given, there is none.
    blocks : collection of str, optional
        Only joints of these blocks; unless given, all.

    Raises
    ------
    InputError
        If a number or a block is wrong, or no bed joint lies below the level.

    Example
    -------
    >>> from cvxlimit import Load
    >>> from cvxlimit.masonry import stack
    >>> dam = stack(1, size=(0.8, 1.0, 0.5))
    >>> water = uplift(dam, 0.5, 9.81, direction=(-1, 0, 0))
    >>> dam = dam.with_dead(Load(gravity=(0, 0, -1), pressures=water))
    >>> round(float(dam.dead_forces[0, 2] + dam.total_weight), 6)  # 9.81 x 0.5 / 2 x 0.8
    1.962
    """
    gamma, up = positive(unit_weight, "unit_weight"), upwards(scene)
    towards, only = horizontal(direction, up), chosen(scene, blocks)
    if tail is not None and not tail <= level:
        raise InputError(
            f"tail {tail:g} is above level {level:g}: turn the direction, towards the higher water"
        )
    contacts = scene.contacts
    places, heights = contacts.corner_points @ towards, contacts.corner_points @ up
    result: list[Pressure] = []
    for j, corners in _bed_joints(scene, up):
        # Linear from the wet edge of the whole bed to its dry one, as the same on both blocks.
        wet, dry = corners[places[corners].argmax()], corners[places[corners].argmin()]
        at_wet = gamma * max(level - heights[wet], 0.0)
        at_dry = 0.0 if tail is None else gamma * max(tail - heights[dry], 0.0)
        if not at_wet > 0.0:
            continue
        slope = (at_wet - at_dry) / (places[wet] - places[dry])
        for i, sign in ((contacts.a[j], 1.0), (contacts.b[j], -1.0)):
            if (block := scene.blocks[i].id) in only:
                normal = (sign * contacts.axes[j, 2] + 0.0).tolist()
                gradient, at = ((x * towards + 0.0).tolist() for x in (slope, places[wet]))
                result += [
                    Pressure(block, normal, at_wet, gradient, at, corners=piece.tolist())
                    for piece in contacts.piece_points(j)
                ]
    if not result:
        raise InputError(
            f"no bed joint lies below level {level:g}, so that water lifts nothing (joints steeper "
            "than 45 degrees are left out): give a level above the lowest bed joint"
        )
    return tuple(result)


def _bed_joints(scene: Scene, up: FloatArray) -> Iterator[tuple[int, IntArray]]:
    """Yields each contact that is less than 45 degrees off level, and the corners of all contacts
    in its plane."""
    contacts = scene.contacts
    normals = contacts.axes[contacts.faces, 2]
    flat = np.flatnonzero(np.abs(normals @ up) >= FLAT)
    thickness = np.array([block.thickness for block in scene.blocks])
    for j in flat.tolist():
        off = np.abs((contacts.origin[flat] - contacts.origin[j]) @ normals[j])
        least = min(thickness[contacts.a[j]], thickness[contacts.b[j]])
        alike = np.abs(normals[flat] @ normals[j]) >= FACING
        same = flat[alike & (off <= SAME_FACE * least)]
        yield j, np.flatnonzero(np.isin(contacts.corner_contact, same))


def fill(
    scene: Scene, level: float, unit_weight: float, blocks: Collection[str] | None = None
) -> tuple[PointForce, ...]:
    """Fill on top of an arch or vault: unit weight x depth below its level surface, straight down.

    It rests on the faces that look up (within 80 degrees), where nothing lies on or over them: a
    column of fill rests on the highest stone. Each face, or part of one, gets one force, at its
    centre of pressure. Passive pressure is left out.

    Parameters
    ----------
    scene, level, unit_weight
        As for :func:`hydrostatic`.
    blocks : collection of str, optional
        The only blocks that it reaches, also where they lie under others, as sills do under
        lintels; unless given, all free ones from above.

    Raises
    ------
    InputError
        If a number or a block is wrong, or the level is below all faces that look up.

    Example
    -------
    >>> from cvxlimit.masonry import stack
    >>> post = stack(1, size=(0.8, 1.0, 0.5))
    >>> [load.force for load in fill(post, 1.5, 20.0)]  # 20 x 0.8 x 1.0 x 1.0
    [(0.0, 0.0, -16.0)]
    """
    gamma = positive(unit_weight, "unit_weight")
    up, faces = upwards(scene), seen_from_above(scene, blocks)
    check_level(level, faces, up, "up")
    found = list[PointForce]()
    for face in faces:
        points, areas, depth = face.below(level, up)
        found += down(face.block.id, points, gamma * depth * (areas @ up), up)
    return tuple(found)


def wheel(
    scene: Scene,
    at: ArrayLike,
    sides: ArrayLike,
    force: float,
    along: ArrayLike = (1.0, 0.0, 0.0),
    blocks: Collection[str] | None = None,
) -> tuple[PointForce, ...]:
    """A force spread evenly over a rectangle in plan, on the faces that look up there.

    Give the rectangle that the load has reached where it meets the stones: through fill it grows
    with depth, as codes say. Each face gets its share of the area as one vertical force.

    Parameters
    ----------
    scene, blocks
        As for :func:`fill`.
    at : (3,)
        Centre of the rectangle; its height does not matter.
    sides : (2,)
        Along ``along`` and across it.
    force : float
        The whole of it, downwards.

    Raises
    ------
    InputError
        If a number or a block is wrong, or a part of the rectangle lies over no face.

    Example
    -------
    >>> from cvxlimit.masonry import arch
    >>> loads = wheel(arch(), at=(0.2, 0.15, 0), sides=(0.4, 0.2), force=100.0)
    >>> round(sum(load.force[2] for load in loads), 6)
    -100.0
    """
    up, faces = upwards(scene), seen_from_above(scene, blocks)
    total = positive(force, "force of a wheel")
    middle, axis = finite_vector(at, 3, "at of a wheel"), horizontal(along, up)
    length, width = (
        positive(x, "side of a wheel") for x in finite_vector(sides, 2, "sides of a wheel").tolist()
    )
    pairs = ((axis, length), (-axis, length), *((s * np.cross(up, axis), width) for s in (1, -1)))
    found = list[PointForce]()
    for face in faces:
        triangles = face.triangles
        for way, side in pairs:
            triangles = cut_off(triangles, 0.5 * side - (triangles - middle) @ way)
        points, areas = pressed(triangles)
        found += down(face.block.id, points, total / (length * width) * (areas @ up), up)
    carried = -sum(float(np.dot(load.force, up)) for load in found)
    if abs(carried - total) > 1e-6 * total:
        raise InputError(
            f"a wheel of {length:g} x {width:g} at {written(middle)} stands on "
            f"{100.0 * carried / total:.4g} % of its area: move it onto faces that look up, or "
            "name the blocks that it reaches"
        )
    return tuple(found)
