"""Contacts between blocks: one array per property for code, one record per contact for people."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray, ReadOnlyArrays, read_only
from cvxlimit.base.checks import meant
from cvxlimit.base.markup import html_table
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE
from cvxlimit.geometry.polygons import mean_distance_over, members_of, torsion_arm
from cvxlimit.geometry.strengths import PROPERTIES, JointValues, Pair

COMPONENTS = ("V1", "V2", "N", "M1", "M2", "MT")
"""Contact force components (Eq. 1), in the column order of every force array."""

COLUMN = {name: column for column, name in enumerate(COMPONENTS)}
"""The column of each component in a force array."""

CARRIES = 1e-6
"""Resistances below this share of the largest contact force count as none: solvers leave 1e-9 to
1e-8 of it in joints that carry nothing, and a moment divided by so little means nothing."""

_ONE_FOR_ALL = (*PROPERTIES, "lumped", "turned", "least", "most", "sense")
"""Arrays (n,) for which a single number may be given."""

_PER_CONTACT = ("a", "b", "origin", "axes", "sides", "area", *_ONE_FOR_ALL)
"""Arrays with a row for each contact."""

_OF_GEOMETRY = (
    "corner_contact", "corner_points", "is_rectangle", "is_point", "faces", "torsion_arm", "edges",
)  # fmt: skip
"""Properties that do not depend on strengths."""


@dataclass(frozen=True, eq=False)
class Contact:
    """One contact, for people to read; made by indexing :class:`Contacts`.

    ``corners`` (k, 3) are the polygon's corners, counter-clockwise about ``normal``, which
    points from block ``a`` into block ``b``. ``t1`` and ``t2`` are unit vectors in its plane, and
    ``origin`` is its centre. ``sides`` are (l1, l2) of a rectangle along t1 and t2, or None.
    Lengths in the scene's unit.
    """

    name: str
    a: str
    b: str
    origin: FloatArray
    t1: FloatArray
    t2: FloatArray
    normal: FloatArray
    corners: FloatArray
    sides: tuple[float, float] | None
    area: float
    friction: float


@dataclass(frozen=True, eq=False)
class Contacts(JointValues[FloatArray], ReadOnlyArrays):
    """All contacts of a scene, n of them with m corners in all, as read-only arrays.

    ``contacts[3]`` and ``contacts["b1-b2"]`` are one of them, as a :class:`Contact`.

    Attributes
    ----------
    names : tuple of str
        ``"a-b"``, with ``#2``, ``#3`` ... where a pair of blocks has several contacts.
    block_ids : tuple of str
        Names of all blocks; ``a`` and ``b`` (n,) index it. Forces act on b, opposites on a.
    origin : (n, 3), axes : (n, 3, 3)
        Contact frame: centre (centroid of the polygon) and rows t1, t2, n (right-handed).
    corner_start : (n + 1,), corner_xy : (m, 2)
        Corners of contact j are rows ``corner_start[j]:corner_start[j + 1]``, counter-clockwise
        in the plane (t1, t2) about the origin. A contact that is not convex rocks about its hull:
        these are the hull's corners, everything else belongs to the contact itself.
    sides : (n, 2)
        l1, l2 of rectangles, along t1 and t2; NaN for other polygons, so that a formula in them
        gives NaN there (CVXPY then says "Problem data contains NaN or Inf"): ask ``is_rectangle``
        first, or take ``area``, ``corner_xy`` and ``torsion_arm``, which all contacts have.
    area : (n,)
        Of points, which have none, the square of a length of the scene's, by which twists count
        beside slips.
    friction, cohesion, compressive_strength, tensile_strength : (n,)
        See :class:`~cvxlimit.geometry.strengths.JointValues`; a number is that of all contacts.
    pieces : mapping of int to tuple of (k, 2) arrays
        For contacts that are not convex, have holes or several parts: convex polygons that tile
        them, counter-clockwise, in the plane (t1, t2) about the origin; see :meth:`pieces_of`.
    lumped : (n,) integers, turned : (n,)
        How many of the blocks' faces do not lie in the contact's plane and are taken as if they
        did, and the largest angle (radians) by which they are turned from it; 0 for exact ones.
    least, most : (n,), sense : (n,)
        Of contacts that are points (``is_point``: reactions and ties), which bear nothing else:
        ``least <= sense * N <= most``; sense is -1.0 for ties, which pull, else 1.0.
    """

    names: tuple[str, ...]
    block_ids: tuple[str, ...]
    a: IntArray
    b: IntArray
    origin: FloatArray
    axes: FloatArray
    corner_start: IntArray
    corner_xy: FloatArray
    sides: FloatArray
    area: FloatArray
    pieces: Mapping[int, tuple[FloatArray, ...]] = field(default_factory=dict)
    lumped: IntArray = 0  # type: ignore[assignment]  # as for friction, that of all contacts
    turned: FloatArray = 0.0  # type: ignore[assignment]
    least: FloatArray = 0.0  # type: ignore[assignment]
    most: FloatArray = float("inf")  # type: ignore[assignment]
    sense: FloatArray = 1.0  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name in _ONE_FOR_ALL and np.ndim(value) == 0:
                value = np.full(len(self.names), value, float if each.name != "lumped" else int)
            object.__setattr__(self, each.name, read_only(value))
        if self.pieces:
            self._check_hulls()

    def __repr__(self) -> str:
        return f"Contacts({len(self)}: {reprlib.repr([*self.names])[1:-1]})"

    def _repr_html_(self) -> str:
        rows = (
            (x.name, _point(x.origin), _point(x.normal), f"{x.area:.4g}", f"{x.friction:g}")
            for x in self
        )
        head = ("contact", "centre", "normal", "area", "friction")
        return html_table(f"{len(self)} contacts", head, rows)

    def _check_hulls(self) -> None:
        """Refuse a contact whose hull leaves out a corner of its pieces: no bracket would see it,
        as every proof starts from the hull."""
        # All corners of pieces, each with its contact, and each beside every edge of that hull.
        every = self.pieces.values()
        points = np.concatenate([polygon for polygons in every for polygon in polygons])
        owner = np.repeat(list(self.pieces), [sum(map(len, polygons)) for polygons in every])
        place, edge = members_of(self.corner_start[:-1], len(self.corner_xy), owner)
        # How deep within its edge each corner lies, up to rounding.
        _, inward, offset = self.edges
        depth = np.einsum("ek,ek->e", inward[edge], points[place]) + offset[edge]
        size = np.abs(points).max(axis=1)[place]
        if not (depth >= -RELATIVE_TOLERANCE * size).all():
            worst = int(np.argmin(depth))
            j = int(owner[place[worst]])
            raise GeometryError(
                f"contact {self.names[j]!r}: faces as rough as these leave it no outline that "
                f"holds all of it (a corner lies {-depth[worst]:.3g} outside), so that no answer "
                "would be right: give a larger joint_tolerance, or faces that are plane",
                blocks=(self.block_ids[self.a[j]], self.block_ids[self.b[j]]),
            )

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self) -> Iterator[Contact]:
        return (self[j] for j in range(len(self)))

    def __getitem__(self, j: int | str) -> Contact:
        if isinstance(j, str):
            j = self._index(j)
        if not isinstance(j, (int, np.integer)):
            raise InputError(f"a contact is named by its number or its name, got {j!r}")
        if not -len(self) <= j < len(self):
            raise IndexError(f"contact {j} of {len(self)}")
        j %= len(self)
        t1, t2, normal = self.axes[j]
        xy = self.corners_of(j)
        l1, l2 = self.sides[j]
        return Contact(
            name=self.names[j],
            a=self.block_ids[self.a[j]],
            b=self.block_ids[self.b[j]],
            origin=self.origin[j],
            t1=t1,
            t2=t2,
            normal=normal,
            corners=self.origin[j] + xy @ self.axes[j, :2],
            sides=(float(l1), float(l2)) if self.is_rectangle[j] else None,
            area=float(self.area[j]),
            friction=float(self.friction[j]),
        )

    def _index(self, name: str) -> int:
        """The number of the contact with this name; InputError if there is none."""
        if name in self.names:
            return self.names.index(name)
        # Its blocks may be named in the other order.
        ids = zip(self.a, self.b, strict=True)
        turned = [f"{self.block_ids[b]}-{self.block_ids[a]}" for a, b in ids]
        likely = self.names[turned.index(name)] if name in turned else name
        hint = meant(likely, self.names, "contacts.names lists them")
        raise InputError(f"there is no contact {name!r}; {hint}")

    def corners_of(self, j: int) -> FloatArray:
        """Corners (k, 2) of contact j in its plane (t1, t2)."""
        return self.corner_xy[self.corner_start[j] : self.corner_start[j + 1]]

    def pieces_of(self, j: int) -> tuple[FloatArray, ...]:
        """Convex polygons (k, 2) that tile contact j in its plane; its corners if it is convex."""
        return self.pieces.get(j % len(self), (self.corners_of(j),))

    def piece_points(self, j: int) -> tuple[FloatArray, ...]:
        """The same polygons in space, (k, 3) each: what to fill in pictures."""
        return tuple(self.origin[j] + piece @ self.axes[j, :2] for piece in self.pieces_of(j))

    @cached_property
    def pairs(self) -> list[Pair]:
        """The ids of both blocks of every contact, in alphabetical order."""
        ids = self.block_ids
        both = [sorted((ids[a], ids[b])) for a, b in zip(self.a, self.b, strict=True)]
        return [(first, second) for first, second in both]

    @cached_property
    def corner_contact(self) -> IntArray:
        """Contact index of every corner, (m,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.corner_start))

    @cached_property
    def corner_points(self) -> FloatArray:
        """Corners in space, (m, 3)."""
        j = self.corner_contact
        from_centre = np.einsum("mi,mik->mk", self.corner_xy, self.axes[j, :2])
        return np.asarray(self.origin[j] + from_centre)

    @cached_property
    def typical_size(self) -> float:
        """Median root of the areas: the unit of length of all that is measured against contacts."""
        return float(np.median(np.sqrt(self.area[self.faces] if len(self.faces) else self.area)))

    @property
    def pulls(self) -> bool:
        """True if some contact bears tension, or has a least force that is not 0."""
        return bool(np.any(self.tensile_strength) or np.any(self.least))

    def first_of(self, *names: str) -> str:
        """The first contact that has one of these strengths, or a ``least`` force, and its value,
        in words; empty where none has.

        >>> from cvxlimit import builtin_scene
        >>> builtin_scene("single-block").with_cohesion(2.0).contacts.first_of("cohesion")
        'cohesion, 2 at contact ground-b1'
        """
        for name in names:
            values = getattr(self, name)
            none = np.inf if name == "compressive_strength" else 0.0
            for j in np.flatnonzero(values != none):
                return f"{name.replace('_', ' ')}, {values[j]:g} at contact {self.names[j]}"
        return ""

    @property
    def extent(self) -> float:
        """Largest side of the box about all corners, at least :attr:`typical_size`."""
        return max(float(np.ptp(self.corner_points, axis=0).max()), self.typical_size)

    @cached_property
    def is_point(self) -> NDArray[np.bool_]:
        """True for reactions and ties, (n,): one corner, which bears a normal force alone."""
        return np.asarray(np.diff(self.corner_start) == 1)

    @cached_property
    def faces(self) -> IntArray:
        """Numbers (k,) of the contacts that are no points."""
        return np.flatnonzero(~self.is_point)

    @cached_property
    def is_rectangle(self) -> NDArray[np.bool_]:
        """True for rectangles, (n,), which have finite ``sides``."""
        return np.asarray(np.isfinite(self.sides).all(axis=1))

    @cached_property
    def torsion_arm(self) -> FloatArray:
        """c_T (n,) of Eq. 16: mean distance of the contact's points from its centre.

        Over the contact itself, not over its hull; of points the root of their area.
        """
        arm = torsion_arm(self.sides[:, 0], self.sides[:, 1])
        arm[self.is_point] = np.sqrt(self.area[self.is_point])
        for j in np.flatnonzero(~(self.is_rectangle | self.is_point)).tolist():
            arm[j] = mean_distance_over(self.pieces_of(j), (0.0, 0.0))
        return arm

    @cached_property
    def edges(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Inner sides of all polygon edges: contact (m,), unit inward normal (m, 2), offset (m,).

        A point e of contact j is inside when ``normal @ e + offset >= 0`` for its edges. Contacts
        that are points have none.
        """
        following = np.arange(1, len(self.corner_xy) + 1)
        following[self.corner_start[1:] - 1] = self.corner_start[:-1]
        along = self.corner_xy[following] - self.corner_xy
        inward = np.stack([-along[:, 1], along[:, 0]], axis=1)
        has_edges = ~self.is_point[self.corner_contact]
        contact, corner = self.corner_contact[has_edges], self.corner_xy[has_edges]
        inward = inward[has_edges]
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        return contact, inward, -(inward * corner).sum(axis=1)

    def take(self, rows: IntArray) -> Contacts:
        """Some of the contacts, in the order of ``rows`` (k,)."""
        place, corner = members_of(self.corner_start[:-1], len(self.corner_xy), rows)
        result = replace(
            self,
            names=tuple(self.names[j] for j in rows.tolist()),
            corner_start=np.searchsorted(place, np.arange(len(rows) + 1)),
            corner_xy=self.corner_xy[corner],
            pieces={k: self.pieces[j] for k, j in enumerate(rows.tolist()) if j in self.pieces},
            **{name: getattr(self, name)[rows] for name in _PER_CONTACT},
        )
        if "torsion_arm" in self.__dict__:  # kept, as integrals over polygons take long
            result.__dict__["torsion_arm"] = self.torsion_arm[rows]
        return result

    @classmethod
    def joined(cls, parts: Sequence[Contacts]) -> Contacts:
        """The contacts of all parts, one part after the other, between the same blocks."""
        parts = [part for part in parts if len(part)] or parts[:1]
        if len(parts) == 1:
            return parts[0]
        # How many contacts and corners stand before each part, by which its numbers are shifted.
        contacts, corners = 0, 0
        pieces, starts = dict[int, tuple[FloatArray, ...]](), list[IntArray]()
        for part in parts:
            pieces |= {contacts + j: polygons for j, polygons in part.pieces.items()}
            starts.append(corners + part.corner_start[:-1])
            contacts, corners = contacts + len(part), corners + len(part.corner_xy)
        rows = (*_PER_CONTACT, "corner_xy")
        return cls(
            names=tuple(name for part in parts for name in part.names),
            block_ids=parts[0].block_ids,
            corner_start=np.append(np.concatenate(starts), corners).astype(np.int64),
            pieces=pieces,
            **{name: np.concatenate([getattr(part, name) for part in parts]) for name in rows},
        )

    def with_values(self, **values: FloatArray | float) -> Contacts:
        """The same contacts with other friction, cohesion or strengths, (n,) or one for all.

        >>> from cvxlimit import builtin_scene
        >>> builtin_scene("single-block").contacts.with_values(friction=0.3).friction.tolist()
        [0.3]
        """
        result = replace(self, **values)  # type: ignore[arg-type]
        for name in _OF_GEOMETRY:
            if name in self.__dict__:  # what follows from the geometry is kept
                result.__dict__[name] = self.__dict__[name]
        return result

    def is_in_place_of(self, other: Contacts) -> bool:
        """True if these are copies of the same contacts, perhaps with other strengths."""
        own = (each.name for each in fields(self) if each.name not in PROPERTIES)
        return all(getattr(self, name) is getattr(other, name) for name in own)

    def corner_minimum(self, values: FloatArray) -> FloatArray:
        """The least of the values (m,) at each contact's corners, (n,)."""
        return np.asarray(np.minimum.reduceat(values, self.corner_start[:-1]))

    def scaled(self, length: float) -> Contacts:
        """The same contacts with all lengths multiplied: a change of units."""
        return replace(
            self,
            origin=self.origin * length,
            corner_xy=self.corner_xy * length,
            sides=self.sides * length,
            area=self.area * length**2,
            pieces={j: tuple(length * p for p in parts) for j, parts in self.pieces.items()},
        )


def _point(at: FloatArray) -> str:
    """A point (3,) in four digits, without rounding errors about 0 and without -0."""
    return ", ".join(f"{x:.4g}" for x in np.round(at, 9) + 0.0)


def least_carried(forces: FloatArray) -> float:
    """The resistance below which a contact counts as carrying nothing, for forces (n, 6) in the
    column order of :data:`COMPONENTS`."""
    return CARRIES * float(np.abs(forces[:, :3]).max(initial=0.0))


def pressure_centres(contacts: Contacts, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the pressure centres of forces (n, 6), whose columns are :data:`COMPONENTS`: in the
    contact's plane, (e1, e2) = (-M2, M1) / N (n, 2), and in space (n, 3). They are NaN where a
    contact carries nothing."""
    normal = forces[:, COLUMN["N"]]
    safe = np.where(normal > least_carried(forces), normal, np.nan)
    centre = np.stack([-forces[:, COLUMN["M2"]], forces[:, COLUMN["M1"]]], axis=1) / safe[:, None]
    return centre, contacts.origin + np.einsum("nk,nkx->nx", centre, contacts.axes[:, :2])
