"""Soil that resists: passive pressure as reactions, on the faces that it reaches."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, fan
from cvxlimit.scene.bare_faces import bare, chosen, faces_of, upwards
from cvxlimit.scene.pressures import pressed
from cvxlimit.scene.reactions import Reaction
from cvxlimit.scene.scene import Scene
from cvxlimit.scene.surroundings import horizontal

BESIDE = 1e-3
"""Distance from a face, as a share of a block's thickness, at which soil beside it begins."""

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
    axis, only = horizontal(along, up), set(chosen(scene, blocks))
    pieces = [fan(block.vertices, block.faces)[0] for block in scene.blocks]
    triangles, owner = (
        np.concatenate(pieces),
        np.repeat(np.arange(len(pieces)), [*map(len, pieces)]),
    )
    found = []
    for i in scene.free.tolist():
        block = scene.blocks[i]
        for face in faces_of(block, up, OVERHANGING) if block.id in only else ():
            side = float(face.normal @ axis)
            if abs(side) <= 1e-9:
                continue
            for part in bare(scene, i, face):
                around = [range(len(part.corners))]
                points, areas = pressed(fan(part.corners, around)[0], level * up, -up)
                sizes = gamma * (level - points @ up) * np.abs(areas @ axis)
                most = float(sizes.sum())
                if most > 0.0:
                    at = (sizes @ points / most).tolist()
                    out, place = np.sign(side) * axis, np.array(at)
                    beside = place + BESIDE * block.thickness * out
                    if _faced(beside, up, triangles, owner, i) is not None:
                        continue  # under an arch: no soil reaches up from here to its level
                    other = _faced(place, out, triangles, owner, i)
                    if other is None or scene.blocks[other].id in scene.supports:
                        found.append(Reaction(block.id, tuple(at), tuple(-out + 0.0), most))
                    elif side > 0.0:  # once for both
                        on = scene.blocks[other].id
                        found.append(Reaction(block.id, tuple(at), tuple(-out + 0.0), most, on=on))
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
