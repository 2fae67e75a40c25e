"""Limited compressive strength: joints that crush under a plastic field of pressures 0 <= p <= f.

The field is a larger set than uniform stress on the effective rectangle (Eq. 26), N <= f (l1 - 2
abs(M2) / N) (l2 - 2 abs(M1) / N), which is convex and made of rotated cones. Pressures constant on
cells are inside it, pressures lumped at the cells' corners outside.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.formulations import (
    DIVISIONS,
    ForceModel,
    Formulation,
    is_weak,
    model_of,
    with_field,
)
from cvxlimit.model.points import Placing, at_centroids


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
