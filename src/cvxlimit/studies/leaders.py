"""A few variations of a large grid, between which the solver starts for all others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import is_number

_LEAST = 40
"""Variations from which leaders pay, each of a few processes solving them at less than a row's
cost."""

_EACH = 25
"""Variations to a leader, beyond the first four. On 200 of a panel of 888 contacts, iterations went
from 13.7 to 8.7, 8.0, 7.9 and 7.8 with 9, 12, 16 and 20 of them, which cost six to eight each."""


@dataclass(frozen=True, eq=False)
class Leaders:
    """Variations ``rows`` far from each other, at ``places`` (k, parameters) in a unit cube with
    ``origin`` and ``widths``. They follow from the set of all variations, not from their order, so
    that no row depends on who solves which others.
    """

    rows: tuple[Mapping[str, Any], ...]
    places: FloatArray
    origin: FloatArray
    widths: FloatArray

    @classmethod
    def of(cls, variations: Sequence[Mapping[str, Any]]) -> Leaders | None:
        """None but for large grids of numbers: of random draws there may be more tomorrow. Draws of
        one parameter are a grid like any other.
        """
        values = [value for row in variations for value in row.values()]
        if len(variations) < _LEAST or not all(is_number(v) and abs(v) < 1e300 for v in values):
            return None
        given = np.array(values, dtype=float).reshape(len(variations), -1)
        points, first = np.unique(given, axis=0, return_index=True)
        if len(points) != np.prod([float(len(np.unique(column))) for column in given.T]):
            return None
        origin, widths = points.min(axis=0), np.ptp(points, axis=0)
        widths = np.where(widths > 0.0, widths, 1.0)
        places = (points - origin) / widths
        chosen = [int(((places - places.mean(axis=0)) ** 2).sum(axis=1).argmin())]
        nearest = np.full(len(places), np.inf)
        while len(chosen) < min(4 + len(places) // _EACH, 20, len(places)):
            nearest = np.minimum(nearest, ((places - places[chosen[-1]]) ** 2).sum(axis=1))
            chosen.append(int(nearest.argmax()))
        rows = tuple(variations[first[i]] for i in chosen)
        return cls(rows, places[chosen], origin, widths)

    def place(self, variation: Mapping[str, Any]) -> FloatArray:
        """Where in the cube a variation is."""
        given = np.array(list(variation.values()), dtype=float)
        return np.asarray((given - self.origin) / self.widths)
