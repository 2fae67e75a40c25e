"""What a yield surface is: conditions "sum of norms <= resistance", stated once per surface.

A surface states physics only. From its conditions this module derives the CVXPY constraints of
the static problem, the flow rule of the kinematic problem, and the yield excess in NumPy.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.surfaces.cones import Cone, Conic

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Coefficient: TypeAlias = "float | FloatArray | cp.Expression"
LinearForm = Mapping[str, Coefficient]
"""Force component -> coefficient: one number, one per contact (n,), or an expression (n,) in
Parameters."""


class Norm:
    """Weighted size of a vector of linear forms: ``Norm({"V1": 1}, {"V2": 1}, weight=2.0)``.

    A weight in Parameters keeps them out of the cone's rows: only one row then depends on them.
    """

    def __init__(self, *rows: LinearForm, weight: Coefficient = 1.0) -> None:
        self.rows = rows
        self.weight = weight

    @property
    def weighted_rows(self) -> list[LinearForm]:
        """The rows times the weight: the same norm without one."""
        return [{c: product(self.weight, k) for c, k in row.items()} for row in self.rows]

    @property
    def is_plain(self) -> bool:
        """True if the weight is one."""
        return isinstance(self.weight, (int, float)) and self.weight == 1


@dataclass(frozen=True, eq=False)
class Condition:
    """Sum of norms <= resistance, at every contact or at those in ``contact``.

    Attributes
    ----------
    norms : sequence of Norm
        May be empty: then the resistance itself must not be negative.
    resistance : LinearForm
        For Coulomb friction ``{"N": contacts.friction}``.
    contact : (k,) int array or None
        Contact of each row, for conditions without norms only (a polygon's edges, say);
        None means one row per contact. Coefficients have that length.
    """

    norms: Sequence[Norm]
    resistance: LinearForm
    contact: IntArray | None = None

    def __post_init__(self) -> None:
        if self.norms and self.contact is not None:
            raise ModelError("a condition with norms has one row per contact: leave contact out")


class YieldSurface(ABC):
    """A convex cone of admissible forces for every contact.

    To add a surface, subclass and state its conditions; nothing else needs to change:

    >>> class Ellipse(YieldSurface):
    ...     '''sqrt(V^2 + (MT / c_T)^2) <= mu N.'''
    ...     name = "ellipse"
    ...     def conditions(self, contacts):
    ...         size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / contacts.torsion_arm})
    ...         return [Condition([size], {"N": contacts.friction})]
    >>> Ellipse().name
    'ellipse'

    Attributes
    ----------
    name : str
        Field's term for the surface.
    implies : frozenset of str
        Names of surfaces that hold wherever this one does; their rows are not written.
    cone : Cone
        How norms of two components are bounded: :class:`Conic` or :class:`Facets`.
    """

    name: ClassVar[str]
    implies: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, cone: Cone | None = None) -> None:
        self.cone = Conic() if cone is None else cone

    @abstractmethod
    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        """The surface's conditions; lengths in the unit of ``contacts``."""

    def constraints(
        self, forces: Mapping[str, cp.Expression], contacts: Contacts
    ) -> list[cp.Constraint]:
        """CVXPY constraints on vectorised force components, each an expression (n,)."""
        result: list[cp.Constraint] = []
        for condition in self.conditions(contacts):
            result += list(_admissible(condition, forces, self.cone))
        return result

    def excess(self, forces: FloatArray, contacts: Contacts) -> list[FloatArray]:
        """Yield function y of forces (n, 6), one array per condition; <= 0 is admissible."""
        result = []
        for condition in self.conditions(contacts):
            rows = forces if condition.contact is None else forces[condition.contact]
            y = -evaluate(condition.resistance, rows)
            for norm in condition.norms:
                size = self.cone.gauge([evaluate(form, rows) for form in norm.rows])
                y = y + number(norm.weight) * size
            result.append(y)
        return result


def evaluate(form: LinearForm, forces: FloatArray) -> FloatArray:
    """Value (n,) of a linear form for forces (n, 6)."""
    result = np.zeros(len(forces))
    for component, coefficient in form.items():
        result = result + number(coefficient) * forces[:, COLUMN[component]]
    return result


def number(coefficient: Coefficient) -> float | FloatArray:
    """The coefficient's present value."""
    if isinstance(coefficient, cp.Expression):
        return np.asarray(coefficient.value, dtype=float)
    return coefficient


def product(first: Coefficient, second: Coefficient) -> Coefficient:
    """Product of two coefficients, entry by entry."""
    if isinstance(first, cp.Expression) or isinstance(second, cp.Expression):
        return cp.multiply(first, second)
    return first * second


def express(form: LinearForm, forces: Mapping[str, cp.Expression]) -> cp.Expression:
    """A linear form as a CVXPY expression (n,)."""
    terms = [times(k, forces[component]) for component, k in form.items()]
    return sum(terms[1:], start=terms[0])


def times(coefficient: Coefficient, component: cp.Expression) -> cp.Expression:
    """Coefficient times a CVXPY expression (n,)."""
    if isinstance(coefficient, (int, float)):
        return component if coefficient == 1 else coefficient * component
    return cp.multiply(coefficient, component)


def _admissible(
    condition: Condition, forces: Mapping[str, cp.Expression], cone: Cone
) -> Iterator[cp.Constraint]:
    """Norms get an auxiliary bound each, except a plain last one, which takes what remains."""
    if condition.contact is not None:
        forces = {name: forces[name][condition.contact] for name in forces}
    remaining = express(condition.resistance, forces)
    if not condition.norms:
        yield remaining >= 0
        return
    norms = sorted(condition.norms, key=lambda norm: (norm.is_plain, len(norm.rows)))
    last = norms.pop() if norms[-1].is_plain else None
    for norm in norms:
        bound = cp.Variable(remaining.shape)
        yield from cone.epigraph(bound, [express(form, forces) for form in norm.rows])
        remaining = remaining - times(norm.weight, bound)
    if last is None:
        yield remaining >= 0
    else:
        yield from cone.epigraph(remaining, [express(form, forces) for form in last.rows])
