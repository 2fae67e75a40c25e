"""Blocks of any outline on one another, their contacts by shapely, and scenes moved as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from scipy.spatial.transform import Rotation

from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.detection import detect
from cvxlimit.geometry.polygons import mean_distance

OUTLINES = {
    "L": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    "T": [(0, 1), (0, 0), (3, 0), (3, 1), (2, 1), (2, 2), (1, 2), (1, 1)],
    "U": [(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)],
    "plus": [
        (0, 1), (1, 1), (1, 0), (2, 0), (2, 1), (3, 1),
        (3, 2), (2, 2), (2, 3), (1, 3), (1, 2), (0, 2),
    ],
    "ring": [(0, 0), (3, 0), (3, 3), (0, 3)],
}  # fmt: skip
"""Plans of blocks on a grid of 1."""

HOLE = [(1, 1), (2, 1), (2, 2), (1, 2)]


def plan(name: str) -> shapely.Polygon:
    """An outline as shapely has it."""
    return shapely.Polygon(OUTLINES[name], [HOLE] if name == "ring" else [])


def prism(
    id: str, outline: Sequence[tuple[float, float]], low: float, high: float,
    hole: Sequence[tuple[float, float]] = (),
) -> Block:  # fmt: skip
    """A block over an outline; a ``hole`` has as many corners, and goes round the same way."""
    n = len(outline)
    loops = [outline, hole] if hole else [outline]
    vertices = [(x, y, z) for loop in loops for z in (low, high) for x, y in loop]
    sides = [(i, (i + 1) % n) for i in range(n)]
    faces = [(i, k, n + k, n + i) for i, k in sides]
    if hole:
        faces += [(2 * n + k, 2 * n + i, 3 * n + i, 3 * n + k) for i, k in sides]
        faces += [(2 * n + i, 2 * n + k, k, i) for i, k in sides]
        faces += [(n + i, n + k, 3 * n + k, 3 * n + i) for i, k in sides]
    else:
        faces += [tuple(range(n))[::-1], tuple(range(n, 2 * n))]
    return Block.polyhedron(id, vertices, faces, 20.0)


def shaped(name: str, id: str = "below") -> Block:
    """A block of one of the outlines, its upper face at height 0."""
    return prism(id, OUTLINES[name], -1.0, 0.0, HOLE if name == "ring" else ())


def common_parts(first: shapely.Polygon, second: shapely.Polygon) -> shapely.MultiPolygon:
    """What two plans share, without the lines and points where they only touch."""
    parts = shapely.get_parts(shapely.intersection(first, second))
    return shapely.MultiPolygon([p for p in parts if p.geom_type == "Polygon"])


def mean_distance_of(region: shapely.MultiPolygon) -> float:
    """Mean distance of a region's points from its centroid: rings with their signs."""
    middle = shapely.get_coordinates(region.centroid)[0]
    total = 0.0
    for part in region.geoms:
        for ring, sign in [(part.exterior, 1.0), *((hole, -1.0) for hole in part.interiors)]:
            corners = shapely.get_coordinates(ring.normalize())[:-1]
            if not shapely.is_ccw(ring.normalize()):
                corners = corners[::-1]
            total += sign * shapely.Polygon(corners).area * mean_distance(corners, middle)
    return total / region.area


def detect_contacts(blocks: Sequence[Block], *given: Any, **options: Any) -> Contacts:
    return detect(blocks, *given, **options).contacts


MOTIONS = (
    (np.zeros(3), (1.0, 1.0, 0.0), 1.0),
    (np.zeros(3), (1e3, -1e3, 1e3), 1.0),
    (np.array([0.3, -0.8, 1.1]), (0.0, 0.0, 0.0), 1.0),
    (np.array([-1.2, 0.4, 2.0]), (300.0, -700.0, 500.0), 1e-3),
    (np.array([0.0, 0.0, np.pi / 4]), (-20.0, 1.0, 3.0), 1e3),
)
"""Rotations, shifts (over the scene's size) and scales."""


def moved_scenes(blocks: Sequence[Block]) -> list[tuple[list[Block], float]]:
    """The same blocks shifted, turned and scaled as a whole, with the scales."""
    points = np.concatenate([b.vertices for b in blocks])
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    return [
        (
            [
                b.moved(Rotation.from_rotvec(turn).as_matrix(), size * np.array(shift)).scaled(k)
                for b in blocks
            ],
            k,
        )
        for turn, shift, k in MOTIONS
    ]


def assert_same_contacts(
    blocks: Sequence[Block], fixed: Sequence[str] = (), tolerance: float | None = None
) -> Contacts:
    """Detect a scene where it is and wherever it is moved: the same contacts, or a failure."""
    here = detect_contacts(blocks, fixed, joint_tolerance=tolerance)
    before = measures(here, 1.0)
    for moved, scale in moved_scenes(blocks):
        there = detect_contacts(
            moved, fixed, joint_tolerance=None if tolerance is None else tolerance * scale
        )
        assert sorted(there.names) == sorted(here.names)
        np.testing.assert_allclose(measures(there, scale), before, rtol=1e-6, atol=1e-9)
    return here


def measures(contacts: Contacts, scale: float) -> np.ndarray:
    """Of every contact, sorted by the blocks' numbers: its hull's area, perimeter and arm and its
    own friction arm, over powers of its size; and that size over the scale."""
    rows = []
    for j in range(len(contacts)):
        xy = contacts.corners_of(j)
        sides = np.linalg.norm(np.roll(xy, -1, axis=0) - xy, axis=1)
        size = np.sqrt(contacts.area[j])
        rows.append([
            contacts.a[j], contacts.b[j], shapely.Polygon(xy).area / size**2, sides.sum() / size,
            mean_distance(xy, (0.0, 0.0)) / size, contacts.torsion_arm[j] / size, size / scale,
        ])  # fmt: skip
    table = np.array(rows, dtype=float).reshape(-1, 7)
    return table[np.lexsort(np.round(table[:, [4, 2, 6, 1, 0]], 6).T)]


def penetration(first: Block, second: Block) -> float:
    """Smallest overlap of two convex blocks over all directions that could separate them: normals
    of faces, and of planes spanned by pairs of edges. Not positive when they are apart."""
    normals, edges = [], []
    for block in (first, second):
        loops = [block.vertices[list(face)] for face in block.faces]
        normals += [np.cross(c[1] - c[0], c[2] - c[1]) for c in loops]
        edges.append(np.concatenate([np.roll(c, -1, axis=0) - c for c in loops]))
    crosses = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
    directions = np.concatenate([normals, crosses])
    lengths = np.linalg.norm(directions, axis=1)
    directions = directions[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    one, other = (block.vertices @ directions.T for block in (first, second))
    return float(min((one.max(0) - other.min(0)).min(), (other.max(0) - one.min(0)).min()))
