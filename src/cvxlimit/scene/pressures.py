"""Pressures on faces of blocks: uniform, or linear in space like those of water and soil."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import area_vectors, cut_off, fan, polygon_vectors

Vector = tuple[float, ...]

FACING = np.cos(np.radians(10.0))
"""A pressure acts on the faces whose normal lies within 10 degrees of the one given.

Sides of bricks, voussoirs and vault stones are 60 degrees and more apart; the triangles and warped
quads that stand for one curved or rounded face differ by a few."""

REACH = 1.01
"""A point load acts no farther from its block's centroid than the farthest corner times this.

Coordinates rounded to a hundredth of the block still pass; a point in other units does not. The
bound is a sphere, so that a scene which passes also passes after any rotation."""


@dataclass(frozen=True)
class Pressure:
    """A pressure on the faces of a block that look in one direction; uniform, or linear in space.

    Attributes
    ----------
    block : str
        Id of the block.
    normal : (3,)
        Where the loaded faces look, out of the block; any length but zero. All faces whose outward
        normal lies within 10 degrees of it are loaded, wholly unless ``within`` or ``corners``
        says otherwise.
    pressure : float
        Force per area; positive presses on the block (against ``normal``), negative pulls. With a
        ``gradient`` it is the pressure at the point ``at``.
    gradient : (3,)
        How the pressure grows per length along x, y and z; zero for a uniform one.
    at : (3,) or None
        Where the pressure is ``pressure``; needed with ``gradient`` or ``within``.
    within : (3,) or None
        Only what lies from ``at`` in this direction is loaded: downwards for water or soil, whose
        surface goes through ``at``. Faces are cut there exactly.
    corners : sequence of (3,) or None
        Corners of the plane polygon on the block's surface that is loaded in place of whole faces,
        either way round, convex or not.

    Raises
    ------
    InputError
        If a direction is zero, a number is not finite, ``at`` is missing, or corners are no polygon
        that ``normal`` looks out of.

    Example
    -------
    Wind of 0.8 kN/m2 on the side of a block that looks towards -y:

    >>> Pressure("b1", normal=(0, -1, 0), pressure=0.8).normal
    (0.0, -1.0, 0.0)

    Water of 10 kN/m3 that stands 2 m high before a block of 3 m: 20 kN, at a third of the height:

    >>> block = Block.box("b1", (0, 0, 0), (1, 1, 3), density=20.0)
    >>> water = Pressure("b1", (-1, 0, 0), 0.0, (0, 0, -10), at=(0, 0, 2), within=(0, 0, -1))
    >>> at, force, _ = water.resultant(block)
    >>> at.round(6).tolist(), force.round(6).tolist()
    ([0.0, 0.5, 0.666667], [20.0, 0.0, 0.0])
    """

    block: str
    normal: Vector
    pressure: float
    gradient: Vector = (0.0, 0.0, 0.0)
    at: Vector | None = None
    within: Vector | None = None
    corners: tuple[Vector, ...] | None = None

    def __post_init__(self) -> None:
        what = f"of the pressure on block {self.block!r}"
        set_field(self, "normal", _direction(self.normal, f"normal {what}"))
        set_field(self, "pressure", vector([self.pressure], f"value {what}", 1)[0])
        set_field(self, "gradient", vector(self.gradient, f"gradient {what}"))
        if self.within is not None:
            set_field(self, "within", _direction(self.within, f"within {what}"))
        if self.at is not None:
            set_field(self, "at", vector(self.at, f"at {what}"))
        elif any(self.gradient) or self.within is not None:
            raise InputError(
                f"at {what} is missing: give the point where the pressure is {self.pressure:g}, "
                "on the surface of water or soil for example"
            )
        if self.corners is not None:
            rows = tuple(vector(x, f"corner {what}") for x in self.corners)
            area = polygon_vectors(np.array(rows)) if len(rows) > 2 else np.zeros(3)
            along = float(area @ self.normal)
            if abs(along) < FACING * np.linalg.norm(area) or along == 0.0:
                raise InputError(
                    f"corners {what} must be a polygon that looks along its normal "
                    f"{list(self.normal)}, got {len(rows)} corners with the area vector "
                    f"{np.round(area, 6).tolist()}"
                )
            set_field(self, "corners", rows if along > 0.0 else rows[::-1])

    def resultant(self, block: Block) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns the pressure's point of application, force and moment about that point, (3,)
        each.

        They are exact. On faces of one plane the point is the centre of pressure, and the moment 0.

        Raises
        ------
        InputError
            If the block has no face that looks along the normal, or the corners are off the block.
        """
        points, areas = pressed(self._triangles(block), self.at, self.within)
        pressures = self.pressure + (points - (self.at or np.zeros(3))) @ np.array(self.gradient)
        forces = -pressures[:, None] * areas
        share = areas @ np.array(self.normal)
        if np.any(pressures):
            share = share * np.abs(pressures)
        total = float(share.sum())
        centre = share @ points / total if total else block.centroid
        return centre, forces.sum(axis=0), np.cross(points - centre, forces).sum(axis=0)

    def extent(self, block: Block) -> tuple[float, float]:
        """Returns the least and the largest pressure on the loaded surface, which occur at its
        corners."""
        at, corners = np.asarray(self.at or np.zeros(3)), self._triangles(block)
        if self.at is not None and self.within is not None:
            corners = cut_off(corners, (corners - at) @ np.asarray(self.within))
        values = self.pressure + (corners - at) @ np.array(self.gradient)
        return float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))

    def _triangles(self, block: Block) -> FloatArray:
        """Returns triangles (t, 3, 3) of the faces or the polygon under pressure, before any
        cut."""
        if self.corners is not None:
            middle = np.mean(self.corners, axis=0)
            far = float(np.linalg.norm(block.vertices - block.centroid, axis=1).max())
            if float(np.linalg.norm(middle - block.centroid)) > REACH * far:
                raise InputError(
                    f"the polygon of a pressure on block {self.block!r} lies around "
                    f"{np.round(middle, 6).tolist()}, which is off the block: give corners on its "
                    "surface"
                )
            return fan(np.array(self.corners), [range(len(self.corners))])[0]
        corners, owner = fan(block.vertices, block.faces)
        normals = area_vectors(block.vertices, block.faces)
        towards = normals @ np.array(self.normal) / np.linalg.norm(normals, axis=1)
        if towards.max() < FACING:
            nearest = normals[int(towards.argmax())]
            nearest = nearest / np.linalg.norm(nearest) + 0.0
            raise InputError(
                f"block {block.id!r} has no face that looks along "
                f"{np.round(self.normal, 4).tolist()}, where its pressure should act; the nearest "
                f"one looks along {np.round(nearest, 4).tolist()}"
            )
        return corners[(towards >= FACING)[owner]]

    def times(self, factor: float) -> Pressure:
        """Returns the pressure multiplied by ``factor`` everywhere."""
        gradient = tuple((factor * np.array(self.gradient)).tolist())
        return replace(self, pressure=factor * self.pressure, gradient=gradient)

    def moved(self, turn: FloatArray, shift: FloatArray) -> Pressure:
        """Returns the pressure moved with the scene by x -> turn @ x + shift."""
        changes: dict[str, Any] = {
            name: turn @ value
            for name in ("normal", "gradient", "within")
            if (value := getattr(self, name)) is not None
        }
        if self.at is not None:
            changes["at"] = turn @ self.at + shift
        if self.corners is not None:
            changes["corners"] = [turn @ x + shift for x in self.corners]
        return replace(self, **changes)

    def scaled(self, length: float, force: float) -> Pressure:
        """Returns the pressure in other units: lengths times ``length``, forces times ``force``."""
        changes: dict[str, Any] = {
            name: np.array(value) * (length if name != "gradient" else force / length**3)
            for name in ("gradient", "at", "corners")
            if (value := getattr(self, name)) is not None
        }
        return replace(self, pressure=self.pressure * force / length**2, **changes)


def pressed(
    triangles: FloatArray, at: ArrayLike | None = None, within: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Returns points and area vectors (k, 3) that integrate quadratic functions over triangles.

    The points are the middles of the sides, with a third of the area each. ``triangles`` (t, 3, 3)
    are cut where they leave the half-space that begins at ``at`` in direction ``within``.
    """
    if at is not None and within is not None:
        triangles = cut_off(triangles, (triangles - np.asarray(at)) @ np.asarray(within))
    middles = 0.5 * (triangles + np.roll(triangles, -1, axis=1))
    areas = np.repeat(polygon_vectors(triangles) / 3.0, 3, axis=0)
    return middles.reshape(-1, 3), areas


def set_field(target: object, name: str, value: object) -> None:
    """Sets a field of a frozen dataclass, which only its own checks do."""
    object.__setattr__(target, name, value)


def vector(value: object, what: str, length: int = 3) -> Vector:
    """Returns ``length`` finite numbers as a tuple, or raises InputError."""
    return tuple(finite_vector(value, length, what).tolist())


def _direction(value: object, what: str) -> Vector:
    """Returns a unit vector (3,) as a tuple, or raises InputError."""
    given = finite_vector(value, 3, what)
    length = float(np.linalg.norm(given))
    if not 0.0 < length < np.inf:
        raise InputError(f"{what} must be a direction, got {given.tolist()}")
    return tuple((given / length).tolist())
