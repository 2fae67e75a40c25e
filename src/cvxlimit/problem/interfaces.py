"""What one contact contributes to a problem: its rows of constraints that are stated for all.

But for equilibrium each contact stands alone: rows that hang together, by unknowns that they share,
are of one contact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import Equality
from scipy.sparse.csgraph import connected_components

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COMPONENTS


@dataclass(frozen=True, eq=False)
class Part:
    """A constraint on what contacts bear, in CVXPY: the ``contact`` (k,) of each of its rows, or
    cones, and which of these are a resistance, and not only the bound of a norm in another."""

    label: str
    constraint: Any
    contact: IntArray
    is_resistance: BoolArray

    @property
    def duals(self) -> FloatArray | None:
        """Of each row, and of the bound of each cone, in the user's units."""
        value = self.constraint.dual_variables[0].value
        return None if value is None else np.ravel(value)

    def of(self, at: IntArray, unit: float) -> cp.Constraint:
        """Some rows, or cones, in the user's units, of which the constraint's are multiples."""
        whole = self.constraint
        if isinstance(whole, cp.SOC):
            bound, rows = whole.args
            part = cp.SOC(unit * bound[at], unit * rows[:, at], axis=0)
            places: list[Any] = [at, (slice(None), at)]
        else:
            is_equation = isinstance(whole, Equality)
            form = unit * whole.args[0 if is_equation else 1][at]  # as sinks keep it, beside 0
            part, places = form == 0 if is_equation else form >= 0, [at]
        pairs = zip(whole.dual_variables, places, strict=True)
        part.dual_variables = [_PartOfDual(dual, where) for dual, where in pairs]
        return part


def parts_of(
    placed: Sequence[tuple[str, Any, slice]], pattern: sp.csr_array, matrix: sp.csr_array,
    contact: IntArray, is_bound: BoolArray,
) -> list[Part]:  # fmt: skip
    """What contacts bear: of constraints ``placed`` by label among the rows of a cone program
    whose ``matrix`` (rows, w) has entries in the ``pattern``. Unknown i is a force of contact
    number ``contact[i]`` (w,), or of none if that is -1, and bounds a norm if ``is_bound[i]``."""
    width, count, linked = matrix.shape[1], 0, []
    for _, constraint, at in placed:  # rows and cones are nodes beside the unknowns
        size = constraint.args[1].shape[0] + 1 if isinstance(constraint, cp.SOC) else 1
        row, column = pattern[at].nonzero()
        linked.append((width + count + row // size, column, size))
        count += (at.stop - at.start) // size
    ends = [np.concatenate([link[i] for link in linked]) for i in range(2)]
    graph = sp.coo_array((np.ones(len(ends[0])), ends), (width + count, width + count))
    _, component = connected_components(graph, directed=False)
    of_component = np.full(component.max() + 1, -1)
    of_component[component[:width][contact >= 0]] = contact[contact >= 0]
    found, start = [], width
    for (label, constraint, at), (_, _, size) in zip(placed, linked, strict=True):
        first = matrix[at][::size].tocoo()
        row, column = first.coords
        defines = is_bound[column] & (first.data < 0.0)  # rows are b - A x
        k = (at.stop - at.start) // size
        resists = np.bincount(row, defines, k) == 0
        found.append(Part(label, constraint, of_component[component[start : start + k]], resists))
        start += k
    return found


def gains_by_contact(parts: Sequence[Part], count: int) -> dict[str, FloatArray]:
    """What the objective gains per unit of force by which each of ``count`` contacts resists more,
    by label: the sum of its duals of rows that are a resistance. NaN before a solve."""
    gains = dict[str, FloatArray]()
    for part in parts:
        mine = part.is_resistance & (part.contact >= 0)
        weights = np.full(len(mine), np.nan) if part.duals is None else part.duals
        gain = np.bincount(part.contact[mine], weights[mine], count)
        gains[part.label] = np.asarray(gains.get(part.label, 0.0) + gain)
    return gains


class _PartOfDual(cp.Variable):
    """Rows of a dual variable; of a problem of its own, once that has told them."""

    def __init__(self, whole: cp.Variable, at: Any) -> None:
        self._whole, self._at = whole, at
        super().__init__(np.empty(whole.shape)[at].shape)

    @property
    def value(self) -> Any:
        own, whole = super().value, self._whole.value
        return (
            own if own is not None or whole is None else whole.reshape(self._whole.shape)[self._at]
        )


class Interface:
    """One contact of a :class:`~cvxlimit.LimitProblem`: its forces, its constraints, their duals.

    All is in the user's units. A dual is what the load factor, or the aim, gains per unit by which
    its row is loosened: per unit of force, or of moment where a surface compares moments.

    Attributes
    ----------
    name : str
    between : (str, str)
        The block out of which the normal points, and that into which it points and on which the
        forces act.
    V1, V2, N, M1, M2, MT : CVXPY expression
        Its forces; their ``value`` after a solve.
    forces : CVXPY expression (6,)
        All of them, in this order.
    constraints : dict of str to list of CVXPY constraints
        Its rows of the problem, by label, on the problem's variables: another
        :class:`cvxpy.Problem` may take them. ``dual_value`` of each, after a solve.
    slacks : dict of str to (k,) array, or None
        How far each row, or cone, is from its limit, after a solve.
    duals : dict of str to (k,) array, or None
        Of each row; of a cone, that of its bound. None before a solve.

    Example
    -------
    >>> from cvxlimit import LimitProblem, builtin_scene
    >>> problem = LimitProblem(builtin_scene("single-block"))
    >>> base = problem.interface(("ground", "b1"))
    >>> {name: sum(c.size for c in limits) for name, limits in base.constraints.items()}
    {'rocking': 4, 'torsion-shear': 5}
    >>> found = problem.solve()
    >>> base.between, round(float(base.N.value), 6), base.duals["rocking"].round(4).tolist()
    (('ground', 'b1'), 3.2, [0.25, 0.0, 0.0, 0.25])
    """

    def __init__(
        self, name: str, between: tuple[str, str], forces: Mapping[str, Any],
        constraints: dict[str, list[cp.Constraint]],
    ) -> None:  # fmt: skip
        self.name, self.between, self.constraints = name, between, constraints
        each = [forces[component][name] for component in COMPONENTS]
        self.V1, self.V2, self.N, self.M1, self.M2, self.MT = each
        self.forces = cp.hstack(each)

    @classmethod
    def of(
        cls, number: int, name: str, between: tuple[str, str], forces: Mapping[str, Any],
        parts: Sequence[Part], unit: float,
    ) -> Interface:  # fmt: skip
        """That of a contact with its ``parts``, which are stated in a ``unit`` of force."""
        constraints: dict[str, list[cp.Constraint]] = {}
        for part in parts:
            at = np.flatnonzero(part.contact == number)
            if len(at):
                constraints.setdefault(part.label, []).append(part.of(at, unit))
        return cls(name, between, forces, constraints)

    def __repr__(self) -> str:
        sizes = [f"{k} {sum(c.size for c in limits)}" for k, limits in self.constraints.items()]
        return f"Interface({self.name!r}, limits: {', '.join(sizes)})"

    @property
    def slacks(self) -> dict[str, FloatArray] | None:
        """How far each row, or cone, is from its limit, by label; None before a solve."""
        if self.N.value is None:
            return None
        return {
            label: np.concatenate([_slack(limit) for limit in limits])
            for label, limits in self.constraints.items()
        }

    @property
    def duals(self) -> dict[str, FloatArray] | None:
        """Of each row, and of the bound of each cone, by label; None before a solve."""
        every = [limit for limits in self.constraints.values() for limit in limits]
        if any(limit.dual_variables[0].value is None for limit in every):
            return None
        return {
            label: np.concatenate([np.ravel(c.dual_variables[0].value) for c in limits])
            for label, limits in self.constraints.items()
        }


def _slack(limit: Any) -> FloatArray:
    if isinstance(limit, cp.SOC):
        return np.asarray(limit.args[0].value - np.linalg.norm(limit.args[1].value, axis=0))
    if isinstance(limit, Equality):
        return -np.abs(np.ravel(limit.expr.value))
    return np.ravel(-limit.expr.value)  # -expr >= 0, as CVXPY keeps it
