"""Rigid blocks: convex polyhedra with exact volume and centroid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from cvxlimit.checks import finite_vector, not_negative
from cvxlimit.errors import InputError
from cvxlimit.geometry.readonly import ReadOnlyArrays

FloatArray = NDArray[np.float64]
Faces = tuple[tuple[int, ...], ...]

RELATIVE_TOLERANCE = 1e-6
"""Planarity, convexity and coincidence are judged at this fraction of a block's size.

Scene files carry coordinates with six or more digits; anything finer would refuse them,
anything coarser would accept visible gaps."""

BOX_FACES: Faces = (
    (0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 4, 7, 3), (1, 2, 6, 5),
)  # fmt: skip
"""Outward faces of a box with corners 0-3 around the bottom and 4-7 above them."""

_BOX_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    dtype=float,
)


@dataclass(frozen=True, eq=False)
class Block(ReadOnlyArrays):
    """A rigid convex polyhedron. Build it with :meth:`box`, :meth:`polyhedron` or :meth:`hull`.

    Attributes
    ----------
    id : str
        Name, unique in a scene.
    vertices : (k, 3) array
        Corner points in the scene's length unit; read-only.
    faces : tuple of tuples of int
        Vertex indices of each face, counter-clockwise seen from outside.
    density : float or None
        Weight per volume (kN/m3 with the default units); None only for fixed blocks.
    volume, centroid
        Exact for a polyhedron with these faces; length unit cubed and (3,) array.
    bounds : (2, 3) array or None
        Minimum and maximum corner if the block was given as an axis-aligned box.

    Example
    -------
    >>> brick = Block.box("b1", (0, 0, 0), (0.08, 0.04, 0.03), density=27.3)
    >>> round(brick.weight, 6)
    0.002621
    """

    id: str
    vertices: FloatArray
    faces: Faces
    density: float | None
    volume: float
    centroid: FloatArray
    bounds: FloatArray | None = field(default=None, repr=False)

    @classmethod
    def box(cls, id: str, low: ArrayLike, high: ArrayLike, density: float | None = None) -> Block:
        """An axis-aligned box between two opposite corners, ``low`` < ``high`` in x, y and z.

        Raises
        ------
        InputError
            If a corner is not three finite numbers, or an edge has no positive length.
        """
        bounds = np.stack(
            [
                finite_vector(x, 3, f"box {end} of block {id!r}")
                for end, x in (("min", low), ("max", high))
            ]
        )
        with np.errstate(over="ignore"):
            edges = bounds[1] - bounds[0]
            size, volume = float(np.linalg.norm(edges)), float(edges.prod())
        if not edges.min() > RELATIVE_TOLERANCE * size:
            axis = "xyz"[int(edges.argmin())]
            raise InputError(
                f"block {id!r} is degenerate: its box has length {edges.min():g} along {axis} for "
                f"a size of {size:g}; give max greater than min, or a thicker box"
            )
        if not 0.0 < volume < np.inf:
            raise InputError(
                f"block {id!r} has a volume of {volume:g}, beyond what numbers hold: "
                "choose another unit of length"
            )
        return cls(
            id=_checked_id(id),
            vertices=_frozen(bounds[0] + _BOX_CORNERS * edges),
            faces=BOX_FACES,
            density=_checked_density(id, density),
            volume=volume,
            centroid=_frozen(bounds.mean(axis=0)),
            bounds=_frozen(bounds),
        )

    @classmethod
    def polyhedron(
        cls,
        id: str,
        vertices: ArrayLike,
        faces: Sequence[Sequence[int]],
        density: float | None = None,
    ) -> Block:
        """A convex polyhedron from its vertices and faces.

        ``vertices`` has shape (k, 3); each face lists at least three vertex indices in order
        around it. The direction of travel is free: for a convex body the outside is known.

        Raises
        ------
        InputError
            If the body is not closed, not convex, degenerate, or has a face that is not flat.
        """
        points = _points(id, vertices)
        oriented = _oriented_faces(id, points, faces)
        volume, centroid = _volume_and_centroid(points, oriented)
        _check_solid(id, points, oriented, volume)
        return cls(
            id=_checked_id(id),
            vertices=_frozen(points),
            faces=oriented,
            density=_checked_density(id, density),
            volume=volume,
            centroid=_frozen(centroid),
        )

    @classmethod
    def hull(cls, id: str, points: ArrayLike, density: float | None = None) -> Block:
        """The convex hull of ``points`` (k, 3); coplanar triangles are merged into one face."""
        cloud = _points(id, points)
        try:
            hull = ConvexHull(cloud)
        except QhullError as error:
            raise InputError(
                f"block {id!r} is degenerate: its {len(cloud)} points span no volume"
            ) from error
        index = {int(v): i for i, v in enumerate(hull.vertices)}
        planes: dict[tuple[float, ...], set[int]] = {}
        for simplex, equation in zip(hull.simplices, hull.equations, strict=True):
            key = next(
                (k for k in planes if np.allclose(k[:3], equation[:3], atol=RELATIVE_TOLERANCE)),
                tuple(equation),
            )
            planes.setdefault(key, set()).update(index[int(v)] for v in simplex)
        kept = cloud[hull.vertices]
        faces = [_ordered_around(kept, members, np.array(k[:3])) for k, members in planes.items()]
        return cls.polyhedron(id, kept, faces, density)

    @property
    def weight(self) -> float:
        """Density times volume, in the scene's force unit; 0 for a block without density."""
        return (self.density or 0.0) * self.volume

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, in the scene's length unit."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def moved(self, rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> Block:
        """The same block after x -> rotation @ x + translation; ``rotation`` is (3, 3)."""
        turn = np.asarray(rotation, dtype=float)
        if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-9):
            raise InputError("rotation must be an orthogonal 3 x 3 matrix")
        if np.linalg.det(turn) < 0.0:
            raise InputError("rotation must not mirror: its determinant is -1")
        shift = finite_vector(translation, 3, "translation")
        return replace(
            self,
            vertices=_frozen(self.vertices @ turn.T + shift),
            centroid=_frozen(turn @ self.centroid + shift),
            bounds=None,
        )

    def scaled(self, length: float, density: float = 1.0) -> Block:
        """The same block with lengths and density multiplied: a change of units.

        From m and kN to mm and N: ``block.scaled(1e3, 1e-6)``.
        """
        if not (0.0 < length < np.inf and 0.0 < density < np.inf):
            raise InputError(f"scales must be positive, got {length:g} and {density:g}")
        return replace(
            self,
            vertices=_frozen(self.vertices * length),
            density=None if self.density is None else self.density * density,
            volume=self.volume * length**3,
            centroid=_frozen(self.centroid * length),
            bounds=None if self.bounds is None else _frozen(self.bounds * length),
        )


def _checked_id(id: str) -> str:
    if not isinstance(id, str) or not id:
        raise InputError(f"a block id must be a non-empty text, got {id!r}")
    return id


def _checked_density(id: str, density: float | None) -> float | None:
    return None if density is None else not_negative(density, f"density of block {id!r}")


def _frozen(array: FloatArray) -> FloatArray:
    array.flags.writeable = False
    return array


def _points(id: str, value: ArrayLike) -> FloatArray:
    try:
        points = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"vertices of block {id!r} must be a list of [x, y, z] numbers") from error
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < 4:
        raise InputError(
            f"block {id!r} needs at least four vertices [x, y, z], got shape {points.shape}"
        )
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InputError(f"vertex {bad} of block {id!r} must be finite, got {points[bad].tolist()}")
    return points


def _oriented_faces(id: str, points: FloatArray, faces: Sequence[Sequence[int]]) -> Faces:
    """Faces turned so that their normals point away from the vertices' mean."""
    if len(faces) < 4:
        raise InputError(f"block {id!r} needs at least four faces, got {len(faces)}")
    middle = points.mean(axis=0)
    oriented = []
    for number, face in enumerate(faces):
        indices = _face_indices(id, number, face, len(points))
        corners = points[list(indices)]
        outward = float(_area_vector(corners) @ (corners.mean(axis=0) - middle)) > 0.0
        oriented.append(indices if outward else indices[::-1])
    return tuple(oriented)


def _face_indices(id: str, number: int, face: Sequence[int], count: int) -> tuple[int, ...]:
    if not isinstance(face, Sequence | np.ndarray):
        raise InputError(f"face {number} of block {id!r} must list vertices, got {face!r}")
    wrong = [
        i for i in face if isinstance(i, bool) or not isinstance(i, (int, np.integer))
        or not 0 <= i < count
    ]  # fmt: skip
    if wrong:
        raise InputError(
            f"face {number} of block {id!r} names vertex {wrong[0]!r}; "
            f"there are {count} vertices, numbered from 0"
        )
    indices = tuple(int(i) for i in face)
    if len(indices) < 3 or len(set(indices)) < len(indices):
        raise InputError(
            f"face {number} of block {id!r} needs at least three different vertices, "
            f"got {list(indices)}"
        )
    return indices


def _area_vector(corners: FloatArray) -> FloatArray:
    """Half the sum of cross products around a closed polygon: area times unit normal."""
    spokes = corners[1:] - corners[0]
    m = spokes[:-1].T @ spokes[1:]  # np.cross takes longer than all else a block needs
    return 0.5 * np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])


def _volume_and_centroid(points: FloatArray, faces: Faces) -> tuple[float, FloatArray]:
    """Divergence theorem over the tetrahedra between a reference point and face triangles."""
    origin = points.mean(axis=0)
    triangles = np.array(
        [[f[0], f[i], f[i + 1]] for f in faces for i in range(1, len(f) - 1)], dtype=int
    )
    corners = points[triangles] - origin
    volumes = np.linalg.det(corners) / 6.0
    volume = float(volumes.sum())
    if volume <= 0.0:
        return volume, origin
    return volume, origin + (volumes[:, None] * corners.sum(axis=1)).sum(axis=0) / (4.0 * volume)


def _check_solid(id: str, points: FloatArray, faces: Faces, volume: float) -> None:
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    tolerance = RELATIVE_TOLERANCE * size
    if not volume > RELATIVE_TOLERANCE**2 * size**3:
        raise InputError(
            f"block {id!r} is degenerate: its volume is {volume:g} for a size of {size:g}"
        )
    for number, face in enumerate(faces):
        _check_face(id, number, points, face, tolerance)
    edges = Counter((f[i - 1], f[i]) for f in faces for i in range(len(f)))
    open_edges = [e for e, n in edges.items() if n != 1 or edges[e[::-1]] != 1]
    if open_edges:
        raise InputError(
            f"block {id!r} is not closed: the edge between vertices {open_edges[0][0]} and "
            f"{open_edges[0][1]} does not belong to exactly two faces"
        )
    unused = set(range(len(points))) - {i for f in faces for i in f}
    if unused:
        raise InputError(f"vertex {min(unused)} of block {id!r} belongs to no face; remove it")


def _check_face(
    id: str, number: int, points: FloatArray, face: tuple[int, ...], tolerance: float
) -> None:
    corners = points[list(face)]
    area = _area_vector(corners)
    norm = float(np.linalg.norm(area))
    if not norm > tolerance**2:
        raise InputError(f"face {number} of block {id!r} is degenerate: its area is {norm:g}")
    normal = area / norm
    heights = (points - corners.mean(axis=0)) @ normal
    if np.abs(heights[list(face)]).max() > tolerance:
        raise InputError(
            f"face {number} of block {id!r} is not flat: a vertex lies "
            f"{np.abs(heights[list(face)]).max():g} off its plane"
        )
    if heights.max() > tolerance:
        raise InputError(
            f"block {id!r} is not convex: vertex {int(heights.argmax())} lies "
            f"{heights.max():g} outside face {number}; split it into convex blocks"
        )
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(edges, np.roll(edges, -1, axis=0)) @ normal
    lengths = np.linalg.norm(edges, axis=1)
    if lengths.min() <= tolerance or (turns < -tolerance * lengths).any():
        raise InputError(
            f"face {number} of block {id!r} is not a convex polygon; "
            "list its vertices in order around it, without repeats"
        )


def _ordered_around(points: FloatArray, members: set[int], normal: FloatArray) -> list[int]:
    indices = np.array(sorted(members))
    spokes = points[indices] - points[indices].mean(axis=0)
    first = spokes[0] / np.linalg.norm(spokes[0])
    second = np.cross(normal, first)
    order = np.argsort(np.arctan2(spokes @ second, spokes @ first))
    return [int(i) for i in indices[order]]
