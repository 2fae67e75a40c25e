"""Rigid blocks: closed polyhedra, convex or not, with exact volume and centroid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from cvxlimit.checks import finite_vector, not_negative
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.crossings import check_faces, check_no_crossing
from cvxlimit.geometry.facets import Facets, facets
from cvxlimit.geometry.mesh import (
    Faces,
    area_vectors,
    cross,
    outward,
    surface,
    volume_and_centroid,
)
from cvxlimit.geometry.readonly import ReadOnlyArrays

FloatArray = NDArray[np.float64]

RELATIVE_TOLERANCE = 1e-6
"""Exact shapes are told from inexact ones at this fraction of a block's size.

A body that is flat-faced and convex to six digits is taken as such; vertices nearer to each other
than this are one."""

JOINT_TOLERANCE = 0.01
"""Default joint tolerance over a block's mean thickness, 2 volume / surface."""

BOX_FACES: Faces = (
    (0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 4, 7, 3), (1, 2, 6, 5),
)  # fmt: skip
"""Outward faces of a box with corners 0-3 around the bottom and 4-7 above them."""

_BOX_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    dtype=float,
)


@dataclass(frozen=True)
class Repair:
    """What was mended in a mesh before it became a block: what kind, how often, in words."""

    kind: str
    count: int
    detail: str


@dataclass(frozen=True, eq=False)
class Block(ReadOnlyArrays):
    """A rigid polyhedron. Build it with :meth:`box`, :meth:`polyhedron` or :meth:`hull`.

    It is closed, and may have notches, holes through it and cavities in it. Meshes as programs
    write them go through :func:`cvxlimit.geometry.solids.solid`, which repairs.

    Attributes
    ----------
    id : str
        Name, unique in a scene.
    vertices : (k, 3) array
        Corner points in the scene's length unit; read-only.
    faces : tuple of tuples of int
        Vertex indices of each face, counter-clockwise seen from outside.
    is_convex : bool
        True if every vertex lies behind every face, within the joint tolerance.
    repairs : tuple of Repair
        What was mended in the mesh it came from; empty for exact input.
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
    is_convex: bool = field(default=True, repr=False)
    repairs: tuple[Repair, ...] = ()

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
        joint_tolerance: float | None = None,
    ) -> Block:
        """A polyhedron from its vertices and faces.

        ``vertices`` has shape (k, 3); each face lists at least three vertex indices in order
        around it. The direction of travel is free: the surface is closed, so the outside is known.
        Faces may be warped by ``joint_tolerance`` (length; None: :data:`JOINT_TOLERANCE` of the
        mean thickness).

        Raises
        ------
        GeometryError
            If the surface is open, cuts itself, encloses nothing or several bodies, or has a face
            that is not flat.
        InputError
            If numbers or indices are none.
        """
        points = _points(id, vertices)
        loops = checked_faces(id, faces, len(points))
        exact = _convex_volume(points, loops)
        return assembled(id, points, loops, density, joint_tolerance) if exact is None else cls(
            id=_checked_id(id),
            vertices=_frozen(points),
            faces=exact[0],
            density=_checked_density(id, density),
            volume=exact[1],
            centroid=_frozen(exact[2]),
        )  # fmt: skip

    @classmethod
    def hull(
        cls,
        id: str,
        points: ArrayLike,
        density: float | None = None,
        inner: Literal["refuse", "drop"] = "refuse",
    ) -> Block:
        """The convex hull of ``points`` (k, 3); coplanar triangles are merged into one face.

        Points that are no corner of the hull may be the bottom of a notch, which a hull would
        fill: they are refused unless ``inner="drop"`` says that the hull is what is meant. Points
        on the hull's edges bound no notch and are dropped.
        """
        cloud = _points(id, points)
        try:
            hull = ConvexHull(cloud)
        except QhullError as error:
            raise GeometryError(
                f"block {id!r} is degenerate: its {len(cloud)} points span no volume",
                points=cloud,
                blocks=(id,),
            ) from error
        index = {int(v): i for i, v in enumerate(hull.vertices)}
        planes: dict[tuple[float, ...], set[int]] = {}
        for simplex, equation in zip(hull.simplices, hull.equations, strict=True):
            key = next(
                (k for k in planes if np.allclose(k[:3], equation[:3], atol=RELATIVE_TOLERANCE)),
                tuple(equation),
            )
            planes.setdefault(key, set()).update(index[int(v)] for v in simplex)
        if inner == "refuse":
            _check_no_notch(id, cloud, hull, np.array(list(planes)))
        kept = cloud[hull.vertices]
        faces = [_ordered_around(kept, members, np.array(k[:3])) for k, members in planes.items()]
        return cls.polyhedron(id, kept, faces, density)

    @property
    def weight(self) -> float:
        """Density times volume, in the scene's force unit; 0 for a block without density."""
        return (self.density or 0.0) * self.volume

    @cached_property
    def surface(self) -> float:
        """Area of all faces, in the scene's length unit squared."""
        return surface(self.vertices, self.faces)

    @property
    def thickness(self) -> float:
        """Mean thickness 2 volume / surface: that of a thin plate, a third of a cube's side."""
        return 2.0 * self.volume / self.surface

    @property
    def joint_tolerance(self) -> float:
        """Default joint tolerance of this block, :data:`JOINT_TOLERANCE` of its thickness."""
        return default_tolerance(self.volume, self.surface)

    def facets(self, tolerance: float) -> Facets:
        """Faces grouped into planar facets within ``tolerance`` (length), kept once found."""
        found: dict[float, Facets] = self.__dict__.setdefault("_facets", {})
        if tolerance not in found:
            _check_flat(self.id, self.vertices, self.faces, tolerance)
            found[tolerance] = facets(self.vertices, self.faces, tolerance)
        return found[tolerance]

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


def checked_faces(id: str, faces: Sequence[Sequence[int]], count: int) -> Faces:
    """The faces as tuples of indices below ``count``; refused by name if they are none."""
    if len(faces) < 4:
        raise GeometryError(
            f"block {id!r} needs at least four faces, got {len(faces)}", blocks=(id,)
        )
    return tuple(_face_indices(id, number, face, count) for number, face in enumerate(faces))


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


def _convex_volume(points: FloatArray, faces: Faces) -> tuple[Faces, float, FloatArray] | None:
    """Outward faces, volume and centroid of an exact convex body; None if it is not one.

    Most blocks are, and this way they take a tenth of the time of :func:`assembled`.
    """
    tolerance = RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(points, axis=0)))
    middle = points.mean(axis=0)
    oriented = []
    for face in faces:
        corners = points[list(face)]
        area = _area_vector(corners)
        norm = float(np.linalg.norm(area))
        if not norm > tolerance**2:
            return None
        if area @ (corners.mean(axis=0) - middle) <= 0.0:
            face, corners, area = face[::-1], corners[::-1], -area
        if not _bounds_convex_body(points, corners, area / norm, tolerance):
            return None
        oriented.append(face)
    edges = Counter((f[i - 1], f[i]) for f in oriented for i in range(len(f)))
    if any(n != 1 or edges[e[::-1]] != 1 for e, n in edges.items()):
        return None
    if len({i for f in faces for i in f}) < len(points):
        return None
    volume, centroid = volume_and_centroid(points, oriented)
    return (tuple(oriented), volume, centroid) if volume > tolerance**2 * tolerance else None


def _area_vector(corners: FloatArray) -> FloatArray:
    """Half the sum of cross products around a closed polygon: area times unit normal."""
    spokes = corners[1:] - corners[0]
    m = spokes[:-1].T @ spokes[1:]  # np.cross takes longer than all else a block needs
    return 0.5 * np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])


def _bounds_convex_body(
    points: FloatArray, corners: FloatArray, normal: FloatArray, tolerance: float
) -> bool:
    """True if a face is a flat convex polygon and has all points behind it."""
    heights = (points - corners.mean(axis=0)) @ normal
    if heights.max() > tolerance or ((corners - corners[0]) @ normal).min() < -tolerance:
        return False
    edges = np.roll(corners, -1, axis=0) - corners
    turns = cross(edges, np.roll(edges, -1, axis=0)) @ normal
    lengths = np.linalg.norm(edges, axis=1)
    return bool(lengths.min() > tolerance and (turns >= -tolerance * lengths).all())


def assembled(
    id: str,
    points: FloatArray,
    faces: Faces,
    density: float | None,
    joint_tolerance: float | None = None,
) -> Block:
    """A block of any shape from vertices and faces that are numbers and indices; nothing mended.

    Raises
    ------
    GeometryError
        If they enclose no body; see :meth:`Block.polyhedron`.
    """
    check_faces(id, points, faces, RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(points, 0))))
    unused = set(range(len(points))) - {i for f in faces for i in f}
    if unused:
        raise GeometryError(
            f"vertex {min(unused)} of block {id!r} belongs to no face; remove it",
            points=points[min(unused)],
            blocks=(id,),
        )
    return enclosed(id, points, outward(id, points, faces)[0], density, joint_tolerance)


def enclosed(
    id: str,
    points: FloatArray,
    oriented: Faces,
    density: float | None,
    joint_tolerance: float | None,
    repairs: tuple[Repair, ...] = (),
) -> Block:
    """The block inside a closed surface whose normals point out.

    Raises
    ------
    GeometryError
        If it has no volume, cuts itself, or has a face that is not flat.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    exact = RELATIVE_TOLERANCE * size
    volume, centroid = volume_and_centroid(points, oriented)
    if not volume > exact**2 * size:
        raise GeometryError(
            f"block {id!r} is degenerate: its volume is {volume:g} for a size of {size:g}",
            points=points,
            blocks=(id,),
        )
    vectors = area_vectors(points, oriented)
    areas = np.linalg.norm(vectors, axis=1)
    allowed = joint_tolerance or default_tolerance(volume, float(areas.sum()))
    normals = vectors / areas[:, None]
    _check_flat(id, points, oriented, allowed)
    convex = _all_behind(points, oriented, normals, allowed)
    if not convex:
        check_no_crossing(id, points, oriented, allowed)
    return Block(
        id=_checked_id(id),
        vertices=_frozen(points),
        faces=oriented,
        density=_checked_density(id, density),
        volume=volume,
        centroid=_frozen(centroid),
        is_convex=convex,
        repairs=repairs,
    )


def default_tolerance(volume: float, surface: float) -> float:
    """:data:`JOINT_TOLERANCE` of the mean thickness."""
    return JOINT_TOLERANCE * 2.0 * volume / surface


def _check_flat(id: str, points: FloatArray, faces: Faces, tolerance: float) -> None:
    off = warps(points, faces)
    number = int(off.argmax())
    if off[number] > (1.0 + RELATIVE_TOLERANCE) * tolerance:  # sums in another order may differ
        raise GeometryError(
            f"face {number} of block {id!r} is not flat: a vertex lies {off[number]:g} off its "
            f"plane, more than the joint tolerance {tolerance:.3g}; raise joint_tolerance or cut "
            "the face into triangles",
            points=points[list(faces[number])],
            blocks=(id,),
        )


def warps(points: FloatArray, faces: Faces) -> FloatArray:
    """How far each face's corners are off its mean plane at most, (f,)."""
    normals = area_vectors(points, faces)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    result = np.zeros(len(faces))
    for number in (i for i, face in enumerate(faces) if len(face) > 3):
        corners = points[list(faces[number])]
        result[number] = np.abs((corners - corners.mean(axis=0)) @ normals[number]).max()
    return result


def _all_behind(points: FloatArray, faces: Faces, normals: FloatArray, tolerance: float) -> bool:
    """True if no vertex is in front of a face's plane; most shapes end in the first part."""
    base = np.array([points[list(face)].mean(axis=0) for face in faces])
    level = np.einsum("fk,fk->f", base, normals)
    step = max(1, 1_000_000 // len(points))
    return all(
        ((normals[i : i + step] @ points.T).max(axis=1) <= level[i : i + step] + tolerance).all()
        for i in range(0, len(faces), step)
    )


def _check_no_notch(id: str, cloud: FloatArray, hull: ConvexHull, planes: FloatArray) -> None:
    """Refuse points that are neither corners of the hull nor on an edge, where two planes meet."""
    tolerance = RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(cloud, axis=0)))
    on = (cloud @ planes[:, :3].T + planes[:, 3] >= -tolerance).sum(axis=1)
    on[hull.vertices] = 2
    inner = np.flatnonzero(on < 2)
    if len(inner):
        raise GeometryError(
            f"{len(inner)} of {len(cloud)} points of block {id!r} are no corners of its hull, the "
            f"first at {cloud[inner[0]].tolist()}: if they bound a notch the hull would fill it, "
            "give the faces with Block.polyhedron; if the hull is meant, inner='drop' says so",
            points=cloud[inner],
            blocks=(id,),
        )


def _ordered_around(points: FloatArray, members: set[int], normal: FloatArray) -> list[int]:
    indices = np.array(sorted(members))
    spokes = points[indices] - points[indices].mean(axis=0)
    first = spokes[0] / np.linalg.norm(spokes[0])
    second = np.cross(normal, first)
    order = np.argsort(np.arctan2(spokes @ second, spokes @ first))
    return [int(i) for i in indices[order]]
