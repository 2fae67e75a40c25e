"""Soil that resists: passive pressure as reactions, on the faces that it reaches.

Of every bare face that looks sideways and not down, the part below the soil's level; unless a ray
straight up from beside it meets a block. A ray along the axis says what the soil leans on there.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, fan
from cvxlimit.scene.reactions import Reaction
from cvxlimit.scene.scene import Scene
from cvxlimit.surroundings.bare_faces import bare, chosen, free_faces, horizontal, upwards

OVERHANGING = np.cos(np.radians(100.0))
"""Faces that look down by more than 10 degrees, as those of an intrados, have no soil on them."""


def passive(
    scene: Scene,
    level: float,
    unit_weight: float,
    coefficient: float,
    along: ArrayLike = (1.0, 0.0, 0.0),
    blocks: Collection[str] | None = None,
) -> tuple[Reaction, ...]:
    """Soil that pushes back: on every face that it covers at most K x unit weight x depth, level.

    It covers faces over which nothing hangs, so not the piers below an arch. It pushes along the
    horizontal axis ``along``, against the outward side of each face, with any force from nothing up
    to K gamma z dh w, on a face of projected height dh and width w at the depth z: where
    equilibrium needs it. The force acts at the centre of that pressure. Soil that resists needs
    movement, so that K is the passive coefficient times the share of it that is mobilised: 0.5 of
    3.0, for 30 degrees, is 1.5. Its weight is :func:`cvxlimit.fill`.

    Where another free block faces the first across the soil, as the next span does over a pier, it
    pushes on both, by no more than on the face that looks along the axis; else the ground takes it.

    Parameters
    ----------
    scene : Scene
        Its dead load's gravity says where down is.
    level : float
        Height of the soil's level surface.
    unit_weight, coefficient : float
    along : (3,)
        Horizontal axis along which soil resists, both ways: that of a bridge's span.
    blocks : collection of str, optional
        The only blocks that it reaches; unless given, all free ones.

    Returns
    -------
    tuple of Reaction
        One for each face: ``replace(scene, reactions=...)``.

    Raises
    ------
    InputError
        If a number or a block is wrong, or the soil reaches no face.

    Example
    -------
    A wall of 2 m by 1 m with soil up to its top on both sides: 1.5 x 18 x 2^2 / 2 x 1 each

    >>> from cvxlimit.masonry import stack
    >>> wall = stack(1, size=(0.8, 1.0, 2.0))
    >>> [(r.direction[0], r.most) for r in passive(wall, 2.0, 18.0, 1.5)]
    [(1.0, 54.0), (-1.0, 54.0)]
    """
    gamma = positive(unit_weight, "unit_weight") * positive(coefficient, "coefficient")
    up = upwards(scene)
    axis, only = horizontal(along, up), chosen(scene, blocks)
    pieces = [fan(block.vertices, block.faces)[0] for block in scene.blocks]
    owner = np.repeat(np.arange(len(pieces)), [*map(len, pieces)])
    triangles = np.concatenate(pieces)
    sideways = (x for x in free_faces(scene, up, OVERHANGING, only) if abs(x.normal @ axis) > 1e-9)
    found = []
    for part in (part for face in sideways for part in bare(scene, face)):
        points, areas, depth = part.below(level, up)
        sizes = gamma * depth * np.abs(areas @ axis)
        most = float(sizes.sum())
        if not most > 0.0:
            continue
        side = float(part.normal @ axis)
        at, out = sizes @ points / most, np.sign(side) * axis
        beside = at + part.block.joint_tolerance * out  # where soil beside the face begins
        if _faced(beside, up, triangles, owner, part.number) is not None:
            continue  # under an arch: no soil reaches up from here to its level
        other = _faced(at, out, triangles, owner, part.number)
        on = None if other is None else scene.blocks[other].id
        on = None if on in scene.supports else on
        if on is None or side > 0.0:  # once for both blocks
            place, way = tuple(at.tolist()), tuple((-out + 0.0).tolist())
            found.append(Reaction(part.block.id, place, way, most, on=on))
    if not found:
        raise InputError(
            f"soil up to level {level:g} reaches no bare face that looks along the axis "
            f"{np.round(axis, 6).tolist()}: give a higher level, or turn the axis"
        )
    return tuple(found)


def _faced(
    at: FloatArray, way: FloatArray, triangles: FloatArray, owner: IntArray, own: int
) -> int | None:
    """The block that a ray meets first, but for the one that it begins on; None if it meets none.
    ``triangles`` (t, 3, 3) are those of blocks ``owner`` (t,)."""
    others = owner != own
    first, one, two = np.moveaxis(triangles[others], 1, 0)
    u, v = one - first, two - first
    across = np.cross(way, v)
    size = np.einsum("ij,ij->i", u, across)
    size = np.where(size == 0.0, np.inf, size)  # along the ray: met at no distance
    off = at - first
    turned = np.cross(off, u)
    a, b = np.einsum("ij,ij->i", off, across) / size, turned @ way / size
    distance = np.einsum("ij,ij->i", v, turned) / size
    hits = (a >= 0.0) & (b >= 0.0) & (a + b <= 1.0)
    hits &= distance > RELATIVE_TOLERANCE * float(np.ptp(triangles[~others]))
    if not hits.any():
        return None
    return int(owner[others][hits][distance[hits].argmin()])
