"""Limited compressive strength: joints that crush.

Two models. Uniform stress f on the effective rectangle (Eq. 26), centred on the pressure centre,

    N <= f (l1 - 2 abs(M2) / N) (l2 - 2 abs(M1) / N),

is convex, and made of rotated cones. A plastic field of pressures 0 <= p <= f, for any polygon, is
a larger set. Pressures constant on cells are inside it, pressures lumped at the cells' corners
outside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.formulations import ForceModel, Formulation, Part
from cvxlimit.model.points import Placing, at_centroids
from cvxlimit.surfaces.base import CONSTANT, Condition, Norm

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_DIVISIONS = 8
"""Cells across a polygon that is no rectangle, unless asked for otherwise: at eccentricities of
l/5 both ways a square then bears 1 % less than its plastic field."""

_COMPRESSIONS = "n"
"""Name of the compressions at corners, which a pressure field replaces."""


def limited(formulation: Formulation) -> Formulation:
    """The formulation, with the compressive strength of contacts that have one.

    Rectangles crush on their effective rectangle, other polygons under a plastic field on cells.
    Formulations that see to compressive strength themselves, as :class:`PlasticField` does, and
    contacts without strength, stay as they are.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.model.formulations import corner_compressions
    >>> contacts = builtin_scene("single-block").with_strength(compressive=50.0).contacts
    >>> list(limited(corner_compressions)(contacts).start)
    ['n', 'V1', 'V2', 'MT', 'z', 's']
    """
    return (
        formulation if isinstance(formulation, (PlasticField, _Limited)) else _Limited(formulation)
    )


@dataclass(frozen=True, eq=False)
class _Limited:
    formulation: Formulation
    is_done: bool = False

    def __call__(self, contacts: Contacts) -> ForceModel:
        model = self.formulation(contacts)
        is_weak = np.isfinite(contacts.compressive_strength)
        if self.is_done or not is_weak.any():
            return model
        rectangles = np.flatnonzero(is_weak & contacts.is_rectangle)
        others = np.flatnonzero(is_weak & ~contacts.is_rectangle)
        if len(rectangles):
            model = _with_effective_rectangles(model, rectangles)
        if len(others):
            divisions = np.full(len(contacts), _DIVISIONS)
            model = _with_field(model, others, at_centroids, divisions)
        return model


@dataclass(frozen=True, eq=False)
class PlasticField:
    """Formulation whose weak contacts carry a field of pressures between 0 and f.

    Parameters
    ----------
    formulation : callable
        What describes everything else; its compressions at corners are replaced.
    placing : callable
        :func:`~cvxlimit.model.points.at_centroids` (pressures constant on cells: safe side) or
        :func:`~cvxlimit.model.points.at_corners` (lumped at the cells' corners: unsafe side).
    divisions : int
        Cells across a contact.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.model.formulations import corner_compressions
    >>> scene = builtin_scene("single-block").with_strength(compressive=50.0)
    >>> field = PlasticField(corner_compressions, divisions=6)
    >>> bool(solve(scene, formulation=field).load_factor <= 0.4)
    True
    """

    formulation: Formulation
    placing: Placing = at_centroids
    divisions: int = _DIVISIONS

    def __call__(self, contacts: Contacts) -> ForceModel:
        weak = np.flatnonzero(np.isfinite(contacts.compressive_strength))
        model = self.formulation(contacts)
        if not len(weak):
            return model
        return _with_field(model, weak, self.placing, np.full(len(contacts), self.divisions))


def recession_of(formulation: Formulation) -> Formulation:
    """The formulation with its conditions' constants dropped: in which directions forces may grow.

    Contacts with a compressive strength cannot be pressed any further in them.
    """

    def recession(contacts: Contacts) -> ForceModel:
        model = formulation(contacts)
        return replace(model, conditions=[c.recession() for c in model.conditions])

    return _Limited(recession, is_done=True)


def _with_effective_rectangles(model: ForceModel, weak: IntArray) -> ForceModel:
    """With z^2 <= a b, N^2 <= z s, s^2 <= f A N for a = N - 2 abs(M2)/l1, b = N - 2 abs(M1)/l2.

    The first holds for either sign of M1 and M2: four cones, but no variables for a and b, which
    the flow rule could not tell from one another.
    """
    contacts = model.contacts
    l1, l2 = contacts.sides[weak].T
    most = (contacts.compressive_strength * contacts.area)[weak]
    effective = [
        _product({"z": 1}, {"N": 1, "M2": i * 2.0 / l1}, {"N": 1, "M1": k * 2.0 / l2}, weak)
        for i in (-1, 1)
        for k in (-1, 1)
    ]
    conditions = [
        *effective,
        _product({"N": 1}, {"z": 1}, {"s": 1}, weak),
        _product({"s": 1}, {"N": 1}, {CONSTANT: most}, weak),
    ]
    parts = [Part(name, {}, weak) for name in ("z", "s")]
    return _extended(model, [*model.parts, *parts], conditions)


def _product(
    root: Mapping[str, float],
    first: Mapping[str, float | FloatArray],
    second: Mapping[str, float | FloatArray],
    contact: IntArray,
) -> Condition:
    """root^2 <= first times second, both of them not negative."""
    ((name, k),) = root.items()
    names = {**first, **second}
    total, difference = (
        {key: first.get(key, 0.0) + sign * second.get(key, 0.0) for key in names}
        for sign in (1.0, -1.0)
    )
    return Condition([Norm({name: 2.0 * k}, difference)], total, contact)


def _with_field(
    model: ForceModel, weak: IntArray, placing: Placing, divisions: IntArray
) -> ForceModel:
    """With pressures at points of weak contacts in place of compressions at their corners."""
    contacts = model.contacts
    names = [part.name for part in model.parts]
    if _COMPRESSIONS not in names or any(
        _COMPRESSIONS in form for c in model.conditions for form in c.forms()
    ):
        raise ModelError(
            "this formulation has no compressions at corners that a field of pressures could "
            "replace: limited compressive strength goes with corner_compressions"
        )
    points = placing(contacts.take(weak), divisions[weak])
    j, (x, y) = weak[points.contact], points.xy.T
    most = points.share * (contacts.compressive_strength * contacts.area)[j]
    corner = model.parts[names.index(_COMPRESSIONS)]
    kept = ~np.isin(corner.contact, weak)
    gives = {c: v if np.ndim(v) == 0 else np.asarray(v)[kept] for c, v in corner.gives.items()}
    parts = [part for part in model.parts if part is not corner]
    if kept.any():
        parts.append(replace(corner, gives=gives, contact=corner.contact[kept]))
    parts.append(Part("p", {"N": 1, "M1": y, "M2": -x}, j, nonneg=True))
    return _extended(model, parts, [Condition([], {"p": -1, CONSTANT: most}, j)])


def _extended(
    model: ForceModel, parts: Sequence[Part], conditions: Sequence[Condition]
) -> ForceModel:
    return replace(model, parts=parts, conditions=[*model.conditions, *conditions])
