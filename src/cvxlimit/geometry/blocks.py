"""Rigid blocks: closed polyhedra, convex or not, with exact volume and centroid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError

import cvxlimit.geometry.polyhedra as polyhedra
from cvxlimit.base.arrays import FloatArray, IntArray, ReadOnlyArrays
from cvxlimit.base.checks import finite_vector, not_negative
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.facets import Facets, facets
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, Faces, area_vectors, surface, unit
from cvxlimit.geometry.polyhedra import Body

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
    """A repair of a mesh before it became a block: its ``kind`` (see :func:`~.solids.solid`), the
    ``count`` of places, and a ``detail`` in words."""

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
        """Returns an axis-aligned box between corners ``low`` and ``high`` (3,), ``low`` <
        ``high``.

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
        """Returns a polyhedron with given vertices and faces.

        ``vertices`` has shape (k, 3); each face lists at least three vertex indices in order
        around it. The direction of travel is free: the surface is closed, so the outside is known.
        Faces may be warped by ``joint_tolerance`` (length; None: one hundredth of the mean
        thickness).

        Raises
        ------
        GeometryError
            If the surface is open, cuts itself, encloses nothing or several bodies, or has a face
            that is not flat.
        InputError
            If vertices or indices are not valid numbers.
        """
        points = polyhedra.vertices_of(id, vertices)
        loops = polyhedra.checked_faces(id, faces, len(points))
        body = polyhedra.convex_body(points, loops) or polyhedra.closed_body(
            id, points, loops, joint_tolerance
        )
        return cls.of_body(id, points, body, density)

    @classmethod
    def of_body(
        cls,
        id: str,
        vertices: FloatArray,
        body: Body,
        density: float | None,
        repairs: tuple[Repair, ...] = (),
    ) -> Block:
        """Returns the block of a checked body; ``vertices`` (k, 3) become read-only."""
        return cls(
            id=_checked_id(id),
            vertices=_frozen(vertices),
            faces=body.faces,
            density=_checked_density(id, density),
            volume=body.volume,
            centroid=_frozen(body.centroid),
            is_convex=body.is_convex,
            repairs=repairs,
        )

    @classmethod
    def hull(
        cls,
        id: str,
        points: ArrayLike,
        density: float | None = None,
        inner: Literal["refuse", "drop"] = "refuse",
    ) -> Block:
        """Returns the convex hull of ``points`` (k, 3); coplanar triangles are merged into one
        face.

        Points that are no corner of the hull may be the bottom of a notch, which a hull would
        fill: they are refused unless ``inner="drop"`` says that the hull is what is meant. Points
        on the hull's edges bound no notch and are dropped.
        """
        cloud = polyhedra.vertices_of(id, points)
        try:
            hull = ConvexHull(cloud)
        except QhullError as error:
            raise GeometryError(
                f"block {id!r} is degenerate: its {len(cloud)} points span no volume",
                points=cloud,
                blocks=(id,),
            ) from error
        # Triangles of the same plane are one face: that of the first with this normal, to the
        # tolerance and 1e-5 of each component. On a convex hull one normal is one plane.
        normals = hull.equations[:, :3]
        alike = [
            np.isclose(normals, n, atol=RELATIVE_TOLERANCE).all(axis=1).argmax() for n in normals
        ]
        first, plane = np.unique(alike, return_inverse=True)
        # Points that the planes leave inside may be the bottom of a notch.
        if inner == "refuse":
            _check_no_notch(id, cloud, hull, hull.equations[first])
        # Each face is the corners of its triangles, in order about its normal.
        corners, own = cloud[hull.vertices], np.searchsorted(hull.vertices, hull.simplices)
        faces = [
            _ordered_around(corners, np.unique(own[plane == k]), normals[i])
            for k, i in enumerate(first)
        ]
        return cls.polyhedron(id, corners, faces, density)

    @property
    def weight(self) -> float:
        """Density times volume, in the scene's unit of force; 0 for a block without density."""
        return (self.density or 0.0) * self.volume

    @cached_property
    def surface(self) -> float:
        """Area of all faces, in the scene's length unit squared."""
        return surface(self.vertices, self.faces)

    @cached_property
    def normals(self) -> FloatArray:
        """Outward unit normals (f, 3) of all faces."""
        return unit(area_vectors(self.vertices, self.faces))

    @property
    def thickness(self) -> float:
        """Mean thickness 2 volume / surface (length): the thickness of a thin plate, a third of a
        cube's side."""
        return 2.0 * self.volume / self.surface

    @property
    def joint_tolerance(self) -> float:
        """Default joint tolerance of this block (length): one hundredth of its mean thickness."""
        return polyhedra.default_tolerance(self.volume, self.surface)

    def facets(self, tolerance: float) -> Facets:
        """Returns the faces grouped into planar facets within ``tolerance`` (length); the answer is
        cached for each tolerance."""
        cache: dict[float, Facets] = self.__dict__.setdefault("_facets", {})
        if tolerance not in cache:
            polyhedra.check_flat(self.id, self.vertices, self.faces, tolerance)
            cache[tolerance] = facets(self.vertices, self.faces, tolerance)
        return cache[tolerance]

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, in the scene's length unit."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def moved(self, rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> Block:
        """Returns the block moved by x -> rotation @ x + translation; ``rotation`` is (3, 3).

        Raises
        ------
        InputError
            If ``rotation`` is not orthogonal, or mirrors.
        """
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
        """Returns the block with lengths and density multiplied by factors: a change of units.

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
    """Returns the id, or raises InputError if it is no text."""
    if not isinstance(id, str) or not id:
        raise InputError(f"a block id must be a non-empty text, got {id!r}")
    return id


def _checked_density(id: str, density: float | None) -> float | None:
    """Returns the density, None if there is none; raises InputError if it is negative."""
    return None if density is None else not_negative(density, f"density of block {id!r}")


def _frozen(array: FloatArray) -> FloatArray:
    """Returns the array itself, read-only from now on."""
    array.flags.writeable = False
    return array


def _check_no_notch(id: str, cloud: FloatArray, hull: ConvexHull, planes: FloatArray) -> None:
    """Raise GeometryError for points that are neither corners of the hull nor on an edge of it.

    ``planes`` (m, 4) are normals and offsets of the hull's faces; a point on an edge lies on two.
    """
    tolerance = RELATIVE_TOLERANCE * float(np.linalg.norm(np.ptp(cloud, axis=0)))
    planes_at = (cloud @ planes[:, :3].T + planes[:, 3] >= -tolerance).sum(axis=1)
    planes_at[hull.vertices] = 2
    inner = np.flatnonzero(planes_at < 2)
    if len(inner):
        raise GeometryError(
            f"{len(inner)} of {len(cloud)} points of block {id!r} are no corners of its hull, the "
            f"first at {cloud[inner[0]].tolist()}: if they bound a notch the hull would fill it, "
            "give the faces with Block.polyhedron; if the hull is meant, inner='drop' says so",
            points=cloud[inner],
            blocks=(id,),
        )


def _ordered_around(points: FloatArray, members: IntArray, normal: FloatArray) -> list[int]:
    """Returns the ``members`` among points (k, 3) counter-clockwise about ``normal`` (3,)."""
    spokes = points[members] - points[members].mean(axis=0)
    first = spokes[0] / np.linalg.norm(spokes[0])
    second = np.cross(normal, first)
    order = np.argsort(np.arctan2(spokes @ second, spokes @ first))
    return [int(i) for i in members[order]]
