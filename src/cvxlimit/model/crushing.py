"""Limited compressive strength: rectangles that crush on their effective part, or pressure fields.

Uniform stress on the effective rectangle (Eq. 26) is the convex set
N <= f (l1 - 2 abs(M2) / N) (l2 - 2 abs(M1) / N). Problems state it by rotated cones, where
:func:`model_of` makes the model of all contacts; proofs use closed forms,
:class:`EffectiveRectangles`. A plastic field of pressures 0 <= p <= f is a larger set: pressures
constant on cells are inside it, pressures lumped at the cells' corners outside.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.model.formulations import (
    ForceModel,
    Formulation,
    Part,
    compressions_at,
    corner_compressions,
    rotated,
)
from cvxlimit.model.points import Placing, at_centroids
from cvxlimit.surfaces.base import CONSTANT, Condition, number, product

_COMPRESSIONS = "n"
"""Name of the compressions at corners, which a pressure field replaces."""

DIVISIONS = 8
"""Cells across a polygon that is no rectangle, unless asked for otherwise: at eccentricities of
l/5 both ways a square then bears 1 % less than its plastic field."""


def is_weak(contacts: Contacts) -> NDArray[np.bool_]:
    """Which contacts may crush, (n,).

    Those of limited compressive strength. Where that is a Parameter all may, as its value may
    change, unless contacts know which have a limit (``crushes``, set by ``problem/given.py``).
    Points never do.
    """
    strength, faces = contacts.compressive_strength, ~contacts.is_point
    if isinstance(strength, cp.Expression):
        return np.asarray(faces & getattr(contacts, "crushes", faces))
    return np.asarray(faces & np.isfinite(strength))


def model_of(
    formulation: Formulation, contacts: Contacts, corners: ForceModel | None = None
) -> ForceModel:
    """The force model of contacts under a formulation, with compressive strength where given.

    Rectangles crush on their effective rectangle, other polygons under a plastic field on cells.
    Formulations with an attribute ``sees_to_strength`` state that themselves. ``corners`` are
    corner compressions that are known already, perhaps of contacts in the same places.

    Raises
    ------
    ModelError
        If that is no :class:`ForceModel`.
    """
    model: Any = formulation
    is_plain = formulation is corner_compressions
    if is_plain and corners is not None and corners.contacts.is_in_place_of(contacts):
        # The same parts, frozen, of contacts whose strengths may be others.
        model = copy(corners)
        object.__setattr__(model, "contacts", contacts)
    elif callable(formulation):
        model = formulation(contacts)
    if not isinstance(model, ForceModel):
        returned = "" if model is formulation else f", which returns {model!r:.80}"
        raise ModelError(
            "formulation must be a function from contacts to a ForceModel, like "
            f"cvxlimit.model.formulations.resultants; got {formulation!r}{returned}"
        )
    weak = is_weak(contacts)
    if not weak.any() or getattr(formulation, "sees_to_strength", False):
        return model
    rectangles = np.flatnonzero(weak & contacts.is_rectangle)
    others = np.flatnonzero(weak & ~contacts.is_rectangle)
    if len(rectangles):
        model = _with_effective_rectangles(model, rectangles)
    if len(others):
        model = with_field(model, others, at_centroids, np.full(len(contacts), DIVISIONS))
    return model


def about_cells(formulation: Formulation, contacts: Contacts) -> str:
    """What is to be said of cells, where polygons crush on them; else empty."""
    is_field = is_weak(contacts) & ~contacts.is_rectangle
    if not is_field.any() or getattr(formulation, "sees_to_strength", False):
        return ""
    return (
        "contacts that are not rectangles crush under pressures constant on cells, "
        f"{DIVISIONS} across: the bracket is that of this model, which is on the safe side"
    )


def _with_effective_rectangles(model: ForceModel, weak: IntArray) -> ForceModel:
    """The model with the strength f of ``weak`` contacts, rectangles of sides l1 and l2.

    The pressure centre lies e1 = abs(M2) / N and e2 = abs(M1) / N off the middle. A uniform stress
    f on the rectangle about it bears (docs/physics.md)

        N <= f (l1 - 2 e1) (l2 - 2 e2) = f A (1 - 2 e1 / l1) (1 - 2 e2 / l2).

    With two more variables per contact this is written as rotated cones, the first one for each
    choice of signs:

        z^2 <= (N +- 2 M2 / l1) (N +- 2 M1 / l2),   N^2 <= z s,   s^2 <= N f A.

    The first says z <= N ((1 - 2 e1 / l1) (1 - 2 e2 / l2))^(1/2), the last s <= (N f A)^(1/2), and
    the second joins them: N^4 <= z^2 s^2, divided by N^3, is the strength above. Where that
    holds, z and s can be as large as these bounds, so that nothing is lost either.
    """
    contacts = model.contacts
    l1, l2 = contacts.sides[weak].T
    most = product(contacts.compressive_strength, contacts.area)[weak]
    effective = [
        rotated("z", {"N": 1, "M2": i * 2.0 / l1}, {"N": 1, "M1": k * 2.0 / l2}, weak)
        for i in (-1, 1)
        for k in (-1, 1)
    ]
    conditions = [
        *model.conditions,
        *effective,
        rotated("N", {"z": 1}, {"s": 1}, weak),
        rotated("s", {"N": 1}, {CONSTANT: most}, weak),
    ]
    parts = [*model.parts, Part("z", {}, weak), Part("s", {}, weak)]
    return replace(model, parts=parts, conditions=conditions)


def with_field(
    model: ForceModel, weak: IntArray, placing: Placing, divisions: IntArray
) -> ForceModel:
    """Returns the model with pressures at points of weak contacts in place of compressions at their
    corners."""
    contacts = model.contacts
    names = [part.name for part in model.parts]
    bounds_them = any(_COMPRESSIONS in form for c in model.conditions for form in c.forms())
    if _COMPRESSIONS not in names or bounds_them:
        raise ModelError(
            "this formulation has no compressions at corners that a field of pressures could "
            "replace: limited compressive strength goes with corner_compressions"
        )
    points = placing(contacts.take(weak), divisions[weak])
    j = weak[points.contact]
    most = product(points.share, product(contacts.compressive_strength, contacts.area)[j])
    corner = model.parts[names.index(_COMPRESSIONS)]
    kept = ~np.isin(corner.contact, weak)
    components = {
        c: v if np.ndim(v) == 0 else np.asarray(v)[kept] for c, v in corner.components.items()
    }
    parts = [part for part in model.parts if part is not corner]
    if kept.any():
        parts.append(replace(corner, components=components, contact=corner.contact[kept]))
    parts.append(compressions_at(contacts, j, points.xy, "p"))
    limit = Condition([], {"p": -1, CONSTANT: most}, j)
    return replace(model, parts=parts, conditions=[*model.conditions, limit])


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


def formulation_of(formulation: Formulation, contacts: IntArray) -> Formulation:
    """Returns the formulation of these ``contacts`` (k,) only: one that holds a figure for each
    contact has a method ``of`` that says it; others state any contacts."""
    of = getattr(formulation, "of", None)
    return formulation if of is None else of(contacts)


def recession_of(formulation: Formulation) -> Formulation:
    """Returns the formulation without the constants of its conditions: in which directions forces
    may grow."""

    def recession(contacts: Contacts) -> ForceModel:
        model = model_of(formulation, contacts)
        return replace(model, conditions=[c.recession() for c in model.conditions])

    recession.sees_to_strength = True  # type: ignore[attr-defined]
    recession.of = lambda rows: recession_of(formulation_of(formulation, rows))  # type: ignore[attr-defined]
    return recession
