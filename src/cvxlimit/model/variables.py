"""Contact forces as CVXPY variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.model.formulations import FORCES, ForceModel
from cvxlimit.surfaces.base import CONSTANT, LinearForm, express, times


@dataclass(frozen=True, eq=False)
class ForceVariables:
    """CVXPY variables for all contact forces, scaled, and the maps to contact forces.

    Attributes
    ----------
    maps : list of (expression (k,) or (k, 2), sparse (6 n, size))
        The force vector of Eq. 7 is the sum of ``matrix @ vec(variable)`` (column order).
    components : mapping of component or part to expression
        Forces and moments over the force unit, and :data:`CONSTANT`, the user's unit over it.
    constraints : list
        Further constraints on the variables.
    """

    maps: list[tuple[cp.Expression, sp.csr_array]]
    components: Mapping[str, cp.Expression]
    constraints: list[cp.Constraint]

    @classmethod
    def of(
        cls,
        model: ForceModel,
        force: float,
        length: float,
        gives: Mapping[str, LinearForm] | None = None,
    ) -> ForceVariables:
        """Variables of a model's parts in units of ``force`` and ``length``; for parts that other
        unknowns give, forms in these and in parts before, whose variables are made here."""
        units = np.where(np.arange(len(COMPONENTS)) < len(FORCES), 1.0, length)
        down = sp.diags_array(np.tile(1.0 / units, len(model.contacts)))
        maps: list[tuple[cp.Expression, sp.csr_array]] = []
        components: dict[str, Any] = {CONSTANT: 1.0 / force}
        for part in model.parts:
            unit = length if part.is_moment else 1.0
            form = {} if gives is None else gives.get(part.name, {})
            for name in [name for name in form if name not in components]:
                components[name] = cp.Variable(len(part.contact), name=name)
            if form:
                variable = express(form, components) / unit
            else:
                variable = cp.Variable(len(part.contact), name=part.name, nonneg=part.nonneg)
            meaning = (unit * down @ part.meaning(len(model.contacts))).tocsr()
            maps.append((variable, meaning))
            components[part.name] = times(unit, variable)
        for column, name in enumerate(COMPONENTS):
            components[name] = _component(maps, column, float(units[column]))
        return cls(maps, components, [])

    def lifted(self, lift: sp.csr_array) -> ForceVariables:
        """The same variables, of which ``lift`` (6 m, 6 n) makes the forces of m contacts."""
        return replace(self, maps=[(v, (lift @ meaning).tocsr()) for v, meaning in self.maps])

    def values(self) -> FloatArray:
        """Forces (n, 6) of the present solution, scaled."""
        total = np.zeros(self.maps[0][1].shape[0])
        for v, matrix in self.maps:
            total += matrix @ np.asarray(v.value).ravel(order="F")
        return total.reshape(-1, len(COMPONENTS))


def _component(
    maps: list[tuple[cp.Expression, sp.csr_array]], column: int, unit: float
) -> cp.Expression:
    terms = []
    for variable, meaning in maps:
        rows = meaning[column :: len(COMPONENTS)]
        if not rows.nnz:
            continue
        rows = (unit * rows).tocsr()
        n = rows.shape[0]
        is_whole = n == rows.shape[1] == rows.nnz and (rows.indices == np.arange(n)).all()
        if is_whole and (rows.data == rows.data[0]).all():  # less for CVXPY to do
            terms.append(times(float(rows.data[0]), variable))
        else:
            terms.append(rows @ variable)
    if not terms:
        return cp.Constant(np.zeros(maps[0][1].shape[0] // len(COMPONENTS)))
    return sum(terms[1:], start=terms[0])
