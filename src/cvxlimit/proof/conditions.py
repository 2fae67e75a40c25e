"""Conditions of surfaces, and of a model itself, as rows on its internal forces.

Every condition of a model bounds norms by a resistance: sum of gauge(B s + b) <= R s + c, with
internal forces s (p,). The table of letters is that of :mod:`cvxlimit.proof.flow`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.formulations import ForceModel, express
from cvxlimit.model.sinks import Rows, stacked
from cvxlimit.surfaces.base import LinearForm, YieldSurface
from cvxlimit.surfaces.cones import Cone, refuse_false_polar


class _Forms:
    """Linear forms as rows on the internal forces: matrix @ internal + constant.

    ``forces`` are the components of ``contacts`` contacts as forms of ``width`` unknowns, the
    internal forces; ``forms`` come with the contact of each of their rows, None for one per
    contact. They stand one below the other: ``slices`` says which rows are those of each form, and
    ``contact`` has the contact of every row.
    """

    def __init__(
        self, forces: Mapping[str, Any], contacts: int, width: int,
        forms: list[tuple[LinearForm, IntArray | None]],
    ) -> None:  # fmt: skip
        every = np.arange(contacts)
        rows = [express(form, forces, at) for form, at in forms]
        ends = list(accumulate((form.size for form in rows), initial=0))
        self.slices, self.size = list(map(slice, ends, ends[1:])), ends[-1]
        whole = stacked(rows or [forces["N"][every[:0]]])  # without forms, no rows
        self.matrix, self.constant = whole.numbers(width)
        at_rows = [every if at is None else at for _, at in forms]
        self.contact = np.concatenate([every[:0], *at_rows])
        self.transposed: sp.csc_array = self.matrix.T


class ConditionRows:
    """Conditions of several surfaces, and of a model itself, as rows on its internal forces.

    Attributes
    ----------
    resistance, norms : rows R, c and B, b of all conditions
        Each has ``matrix``, its transpose ``transposed``, ``constant`` and ``contact``, the contact
        of every row.
    conditions : list of (cone, slice, list of int arrays)
        Of every condition the cone, its rows of ``resistance``, and for each of its norms those of
        ``norms``, (components, rows).
    names : list of str
        Of every condition the surface that states it.
    """

    def __init__(self, surfaces: Sequence[YieldSurface], model: ForceModel) -> None:
        self.model, stated = model, model.all_conditions(surfaces)
        self.names = [name for name, _, _ in stated]
        resistances: list[tuple[LinearForm, IntArray | None]] = []
        components: list[tuple[LinearForm, IntArray | None]] = []
        for _, condition, _ in stated:
            resistance, rows = condition.at_present()
            resistances.append((resistance, condition.contact))
            components += [(row, condition.contact) for row in rows]
        unknowns = Rows()
        forces, _ = model.unknowns(unknowns)
        self.resistance = _Forms(forces, model.count, unknowns.width, resistances)
        self.norms = _Forms(forces, model.count, unknowns.width, components)
        # Forms were collected condition by condition, so their slices come in that order.
        self.conditions: list[tuple[Cone, slice, list[IntArray]]] = []
        slices = iter(self.norms.slices)
        for (_, condition, cone), at in zip(stated, self.resistance.slices, strict=True):
            by_norm = list[IntArray]()
            for norm in condition.norms:
                refuse_false_polar(cone, len(norm.rows))
                own = [next(slices) for _ in norm.rows]
                by_norm.append(np.stack([np.arange(each.start, each.stop) for each in own]))
            self.conditions.append((cone, at, by_norm))

    def excess(self, state: FloatArray) -> FloatArray:
        """Yield functions (k,) of a state, internal forces (p,), row by row of the resistances;
        those of an admissible state are at most 0."""
        resistance, norms = self.resistance, self.norms
        value = np.asarray(-(resistance.matrix @ state + resistance.constant))
        components = norms.matrix @ state + norms.constant
        for cone, at, by_norm in self.conditions:
            for norm in by_norm:
                value[at] += cone.gauge(components[norm])
        return value
