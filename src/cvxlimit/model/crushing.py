"""Limited compressive strength: rectangles that crush on their effective part, or pressure fields.

Uniform stress on the effective rectangle (Eq. 26) is the convex set
N <= f (l1 - 2 abs(M2) / N) (l2 - 2 abs(M1) / N). Problems state it by rotated cones
(:mod:`cvxlimit.model.formulations`); proofs use closed forms, :class:`EffectiveRectangles`. A
plastic field of pressures 0 <= p <= f is a larger set: pressures constant on cells are inside it,
pressures lumped at the cells' corners outside.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.model.formulations import (
    DIVISIONS,
    ForceModel,
    Formulation,
    is_weak,
    model_of,
    with_field,
)
from cvxlimit.model.points import Placing, at_centroids
from cvxlimit.surfaces.base import number


@dataclass(frozen=True, eq=False)
class EffectiveRectangles:
    """Yield function and dissipation of rectangles that crush.

    Attributes
    ----------
    rows : (k,)
        The contacts that these are, among all.
    sides : (k, 2), strength : (k,)
        Their sides l1, l2, and the stone's strength f.

    Example
    -------
    Pressed in its middle a unit square bears f, and at a quarter of its side half of that:

    >>> squares = EffectiveRectangles(np.array([0]), np.ones((1, 2)), np.array([2.0]))
    >>> force = np.array([[0.0, 0.0, 1.0, 0.0, -0.25, 0.0]])
    >>> abs(float(squares.excess(force)[0])) < 1e-12
    True

    Turned about its edge, it is crushed by a triangle of closings up to 1, on half its width:

    >>> float(squares.dissipation(np.array([-0.5]), np.array([[1.0, 0.0]]))[0])
    1.0
    """

    rows: IntArray
    sides: FloatArray
    strength: FloatArray

    @classmethod
    def of(cls, contacts: Contacts) -> EffectiveRectangles | None:
        """Returns those of contacts; None if none crushes, or one that is no rectangle."""
        rows = np.flatnonzero(is_weak(contacts))
        if not len(rows) or not contacts.is_rectangle[rows].all():
            return None
        return cls(
            rows, contacts.sides[rows], np.asarray(number(contacts.compressive_strength))[rows]
        )

    def excess(self, forces: FloatArray) -> FloatArray:
        """Returns N - (f a b)^(1/3) (k,), a = l1 N - 2 abs(M2) and b = l2 N - 2 abs(M1), for forces
        (n, 6): a convex function where the pressure centre is inside the contact, and at most 0
        where the stone bears the forces. Elsewhere rocking is exceeded, and this says nothing: a
        negative number next to 0."""
        n, m1, m2 = (forces[self.rows, COLUMN[c]] for c in ("N", "M1", "M2"))
        a = self.sides[:, 0] * n - 2.0 * np.abs(m2)
        b = self.sides[:, 1] * n - 2.0 * np.abs(m1)
        is_inside = (a >= 0.0) & (b >= 0.0)
        bears = np.cbrt(self.strength * np.maximum(a, 0.0) * np.maximum(b, 0.0))
        return np.where(is_inside, n - bears, -1e-300)

    def stated(self, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns z and s (k,), by which problems state that N^2 <= z s, for forces (n, 6): z^2 is
        the product (a / l1) (b / l2), and s^2 is N f l1 l2."""
        n, m1, m2 = (forces[self.rows, COLUMN[c]] for c in ("N", "M1", "M2"))
        l1, l2 = self.sides.T
        a, b = n - 2.0 * np.abs(m2) / l1, n - 2.0 * np.abs(m1) / l2
        s = np.sqrt(np.maximum(n, 0.0) * self.strength * l1 * l2)
        return np.sqrt(np.maximum(a, 0.0) * np.maximum(b, 0.0)), s

    def dissipation(self, opening: FloatArray, slope: FloatArray) -> FloatArray:
        """Returns the power (k,) that crushing takes up at most, for the ``opening`` (k,) in the
        middle, less what friction asks for, and its ``slope`` (k, 2) along both sides.

        It is f X Y Z at its largest, X and Y the sides of the effective rectangle and Z the closing
        at its centre, linear in both. The logarithm is concave, so that the largest is where the
        three shares of the closing are equal, or on one of two edges of what X and Y may be.
        """
        l1, l2 = self.sides.T
        by_x, by_y = 0.5 * np.abs(slope).T
        most = by_x * l1 + by_y * l2 - opening  # the closing at the corner that closes most
        result = np.zeros(len(self.rows))
        with np.errstate(divide="ignore", invalid="ignore"):
            inner = most / (3.0 * by_x), most / (3.0 * by_y)
            edges = (most - by_x * l1) / (2.0 * by_y), (most - by_y * l2) / (2.0 * by_x)
        for x, y in (inner, (l1, edges[0]), (edges[1], l2), (l1, l2)):
            x = np.clip(np.nan_to_num(x, nan=np.inf), 0.0, l1)
            y = np.clip(np.nan_to_num(y, nan=np.inf), 0.0, l2)
            closing = np.maximum(most - by_x * x - by_y * y, 0.0)
            result = np.maximum(result, self.strength * x * y * closing)
        return result


@dataclass(frozen=True, eq=False)
class PlasticField:
    """Formulation whose weak contacts carry a field of pressures between 0 and f.

    ``formulation`` describes everything else; its compressions at corners are replaced. ``placing``
    is :func:`~cvxlimit.model.points.at_centroids` (safe side) or
    :func:`~cvxlimit.model.points.at_corners` (unsafe side); ``divisions`` are cells across a
    contact.

    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.model.formulations import corner_compressions
    >>> scene = builtin_scene("single-block").with_strength(compressive=50.0)
    >>> field = PlasticField(corner_compressions, divisions=6)
    >>> bool(solve(scene, formulation=field).load_factor <= 0.4)
    True
    """

    formulation: Formulation
    placing: Placing = at_centroids
    divisions: int = DIVISIONS

    sees_to_strength: ClassVar[bool] = True

    def __call__(self, contacts: Contacts) -> ForceModel:
        weak = np.flatnonzero(is_weak(contacts))
        model = self.formulation(contacts)
        if not len(weak):
            return model
        return with_field(model, weak, self.placing, np.full(len(contacts), self.divisions))


def recession_of(formulation: Formulation) -> Formulation:
    """Returns the formulation without the constants of its conditions: in which directions forces
    may grow."""

    def recession(contacts: Contacts) -> ForceModel:
        model = model_of(formulation, contacts)
        return replace(model, conditions=[c.recession() for c in model.conditions])

    recession.sees_to_strength = True  # type: ignore[attr-defined]
    return recession
