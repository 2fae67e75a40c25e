"""Faces of free blocks that what surrounds a structure reaches: bare ones that look its way."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector, meant
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, fan, plane_axes, polygon_vectors, unit
from cvxlimit.geometry.overlays import difference, intersections, without_holes
from cvxlimit.scene.loads import PointForce
from cvxlimit.scene.pressures import FACING, pressed
from cvxlimit.scene.scene import Scene, check_scene

LOOKS = np.cos(np.radians(80.0))
"""A face looks somewhere if its normal is within 80 degrees of it: any batter of a wall or dam is,
and tops and beds of roughly dressed stones, some degrees out of square, are not."""

SAME_FACE = 0.1
"""A joint lies on a face if it is no farther from its plane than this share of the block's mean
thickness: more than faces are warped or joints wide, less than a notch is deep."""

THINNEST = 1e-9
"""Over a block's size, the grid on which faces are intersected and cut, and the width (area over
perimeter) of a part that rounding makes of edges in common: far above the rounding of coordinates,
far below any joint."""


@dataclass(frozen=True)
class Face:
    """A part of a face of a block with a ``number`` in its scene: outward normal, and corners
    (k, 3), counter-clockwise about it."""

    block: Block
    number: int
    normal: FloatArray
    corners: FloatArray

    @property
    def triangles(self) -> FloatArray:
        """Triangles (t, 3, 3) that make it up."""
        return fan(self.corners, [range(len(self.corners))])[0]

    def below(self, level: float, up: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What lies below a level: points and area vectors (k, 3) as of :func:`.pressed`, and how
        deep (k,) these points are."""
        points, areas = pressed(self.triangles, level * up, -up)
        return points, areas, level - points @ up

    def height(self, place: FloatArray, plan: FloatArray) -> float:
        """Height of the face's plane at a place (2,) in plan; ``plan`` (3, 3) has the axes of the
        plan and the one that points up."""
        arm = self.corners.mean(axis=0) - place @ plan[:2]
        return float(arm @ self.normal / (plan[2] @ self.normal))


def upwards(scene: Scene) -> FloatArray:
    """Where up is: against the dead load's gravity, z without any."""
    check_scene(scene)
    down = scene.dead.gravity
    return np.array([0.0, 0.0, 1.0]) if down is None else -np.array(down) + 0.0


def written(vector: ArrayLike) -> str:
    """A vector as it is written in messages."""
    return str((np.round(np.asarray(vector, dtype=float), 6) + 0.0).tolist())


def horizontal(direction: ArrayLike, up: FloatArray) -> FloatArray:
    """The level part of a direction as a unit vector; raises InputError if there is none."""
    vector = finite_vector(direction, 3, "direction")
    level = vector - (vector @ up) * up
    if not np.linalg.norm(level) > 1e-6 * np.linalg.norm(vector):
        raise InputError(f"direction must be horizontal, got {vector.tolist()}")
    return unit(level)


def down(block: str, points: FloatArray, sizes: FloatArray, up: FloatArray) -> list[PointForce]:
    """The one force that downward forces of some ``sizes`` (k,) at ``points`` (k, 3) amount to."""
    whole = float(sizes.sum())
    if not whole > 0.0:
        return []
    return [PointForce(block, (sizes @ points / whole).tolist(), (-whole * up + 0.0).tolist())]


def chosen(scene: Scene, blocks: Collection[str] | None) -> list[str]:
    """The ids given, or those of all free blocks; raises InputError if one is of no free block."""
    free = [scene.blocks[i].id for i in scene.free]
    if blocks is None:
        return free
    for name in [blocks] if isinstance(blocks, str) else blocks:
        if name not in free:
            cure = meant(name, free, "name free blocks of the scene")
            what = "is a support, which cannot move" if name in scene.supports else "is no block"
            raise InputError(f"{name!r} {what} of scene {scene.name!r}: {cure}")
    return [blocks] if isinstance(blocks, str) else list(blocks)


def looking(scene: Scene, direction: ArrayLike, blocks: Collection[str] | None) -> list[Face]:
    """The parts of faces that look along a direction and are not covered by other blocks.

    Raises
    ------
    InputError
        If the direction is zero, a block is wrong, or there is no such face.
    """
    towards = finite_vector(direction, 3, "direction")
    if not np.any(towards):
        raise InputError("direction must not be zero")
    towards, only = unit(towards), chosen(scene, blocks)
    faces = list(free_faces(scene, towards, LOOKS, only))
    result = [part for face in faces for part in bare(scene, face)]
    if not result:
        who = "no free block has" if blocks is None else f"none of {sorted(only)} has"
        covered = (
            f"all {len(faces)} faces that look along {written(towards)} are in contact with other "
            "blocks: water in joints is uplift's, other pressures need faces that are bare"
        )
        missing = f"{who} a face that looks along {written(towards)}: turn the direction"
        raise InputError(covered if faces else missing)
    return result


def seen_from_above(scene: Scene, blocks: Collection[str] | None) -> list[Face]:
    """The parts of faces that look up and are not covered by other blocks; unless ``blocks`` are
    named, also without what lies under other stones."""
    up = upwards(scene)
    faces = looking(scene, up, blocks)
    if blocks is not None:
        return faces
    # Where faces that look up at all share a place in plan with those that are bare.
    plan = np.concatenate([plane_axes(up), up[None]])
    tops = list(faces_of(scene, range(len(scene.blocks)), up, RELATIVE_TOLERANCE))
    ours, others = (
        shapely.make_valid(np.array([shapely.Polygon(x.corners @ plan[:2].T) for x in some]))
        for some in (faces, tops)
    )
    below, above = shapely.STRtree(others).query(ours, "intersects")
    size = max(block.size for block in scene.blocks)
    shared = intersections(ours[below], others[above], THINNEST * size)
    # The parts of each face that others hide. Stones do not cross each other: which of two faces
    # lies higher is the same all over each part that they share in plan. What rounding makes of
    # common edges is no part.
    hiding: dict[int, list[shapely.Geometry]] = {}
    for j, k, both in zip(below.tolist(), above.tolist(), shared, strict=True):
        for part in shapely.get_parts(both):
            if part.area > THINNEST * size * part.length:
                place = shapely.get_coordinates(shapely.point_on_surface(part))[0]
                over = tops[k].height(place, plan) - faces[j].height(place, plan)
                if over > RELATIVE_TOLERANCE * size:
                    hiding.setdefault(j, []).append(part)
    # What nothing hides, lifted from the plan back into the plane of its face.
    result = list[Face]()
    for j, face in enumerate(faces):
        if j not in hiding:
            result.append(face)
            continue
        for part in _rest(scene, face.block, ours[j], hiding[j]):
            heights = np.array([face.height(place, plan) for place in part])
            result.append(replace(face, corners=part @ plan[:2] + heights[:, None] * up))
    if not result:
        raise InputError(
            f"all {len(faces)} faces that look up lie under other blocks: name the blocks that "
            "are reached"
        )
    return result


def free_faces(
    scene: Scene, towards: FloatArray, limit: float, only: Collection[str]
) -> Iterator[Face]:
    """Faces of the free blocks named in ``only``, as of :func:`faces_of`."""
    named = set(only)
    return faces_of(scene, [i for i in scene.free if scene.blocks[i].id in named], towards, limit)


def faces_of(
    scene: Scene, numbers: Iterable[int], towards: FloatArray, limit: float
) -> Iterator[Face]:
    """Faces of blocks whose normal has more than ``limit`` along a unit vector."""
    for i in numbers:
        block = scene.blocks[i]
        for indices in block.faces:
            corners = block.vertices[list(indices)]
            normal = unit(polygon_vectors(corners))
            if float(normal @ towards) > limit:
                yield Face(block, i, normal, corners)


def bare(scene: Scene, face: Face) -> Iterator[Face]:
    """The parts of a face that no contact covers."""
    contacts, normal, origin = scene.contacts, face.normal, face.corners.mean(axis=0)
    is_a, is_b = contacts.a == face.number, contacts.b == face.number
    outward = contacts.axes[:, 2] * np.where(is_a, 1.0, -1.0)[:, None]
    on = (is_a | is_b) & ~contacts.is_point & (outward @ normal >= FACING)
    on &= np.abs((contacts.origin - origin) @ normal) <= SAME_FACE * face.block.thickness
    axes = plane_axes(normal)
    whole = shapely.make_valid(shapely.Polygon((face.corners - origin) @ axes.T))
    pieces = [
        shapely.Polygon((piece - origin) @ axes.T)
        for j in np.flatnonzero(on).tolist()
        for piece in contacts.piece_points(j)
    ]
    cover = [piece for piece in pieces if piece.is_valid and piece.intersects(whole)]
    if not cover:
        yield face
        return
    for part in _rest(scene, face.block, whole, cover):
        yield replace(face, corners=origin + part @ axes)


def _rest(
    scene: Scene, block: Block, whole: shapely.Geometry, cover: Sequence[shapely.Geometry]
) -> Iterator[FloatArray]:
    """Polygons (k, 2) that a cover leaves of a block's face, counter-clockwise; strips narrower
    than a joint are none."""
    slit = scene.joint_tolerance or block.joint_tolerance
    for part in without_holes(difference(whole, cover, THINNEST * block.size)):
        if part.area > 0.5 * slit * part.length:
            yield np.array(part.exterior.coords)[:-1]
