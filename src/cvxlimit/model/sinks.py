"""Where a problem is stated: as CVXPY constraints, or as the rows of a cone program.

Surfaces, formulations and methods state a problem once, to a *sink*
(:class:`~cvxlimit.surfaces.cones.Sink`), in forms: affine expressions of its unknowns x. In
:class:`Constraints` forms are CVXPY expressions. In :class:`Rows` they are :class:`Form`, sums of
entries

    value * theta[slot] * x[column]   in a row,   or   value * theta[slot]   in a constant's column,

where theta is 1 and the values of coefficients that are CVXPY expressions of Parameters
(:class:`Theta`). Rows become the numbers A, b and c of a cone program, min c . x subject to
b - A x in K, in two steps: :meth:`Rows.written` finds once where each entry belongs among them, and
:meth:`Written.at` sums the entries at a theta. So other values of the Parameters cost one sum.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, chain
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.solvers.program import ConeProgram

CONSTANT_COLUMN = -1
"""Column of entries that are constants: x may be extended by a 1 at its end."""


class Constraints:
    """Labelled CVXPY constraints; ``named`` has them by label, ``stated`` in the order in which
    they came, and ``unknowns`` the variables."""

    def __init__(self) -> None:
        self.label = ""
        self.named: dict[str, list[cp.Constraint]] = {}
        self.stated: list[cp.Constraint] = []
        self.unknowns: list[cp.Variable] = []

    def new(self, size: int | None = None, name: str | None = None, nonneg: bool = False) -> Any:
        """A variable (size,), or one number; without a name it is called after the label."""
        unknown = cp.Variable(() if size is None else size, name=name or f"{self.label} bound")
        self.unknowns.append(unknown)
        if nonneg:  # a constraint of its own: it has a label, and CVXPY keeps the variable
            self.nonneg(unknown)
        return unknown

    def nonneg(self, form: Any) -> Any:
        """form >= 0, entry by entry."""
        return self.keep(form >= 0)

    def zero(self, form: Any) -> None:
        """form = 0, entry by entry."""
        self.keep(form == 0)

    def cone(self, bound: Any, rows: Sequence[Any]) -> Any:
        """Second-order cones: the Euclidean norm of the i-th entries of all rows is at most the
        i-th entry of the bound."""
        return self.keep(cp.SOC(bound, cp.vstack(list(rows)), axis=0))

    def keep(self, constraint: Any) -> Any:
        """A constraint of CVXPY's own, under the present label."""
        if isinstance(constraint, cp.Constraint):  # a bare truth value says nothing of unknowns
            same = self.named.setdefault(self.label, [])
            same.append(constraint)
            self.stated.append(constraint)
            if hasattr(constraint, "set_label"):  # since CVXPY 1.9
                constraint.set_label(self.label if len(same) == 1 else f"{self.label} {len(same)}")
        return constraint

    def duals(self, gain: float = 1.0) -> dict[Any, FloatArray]:
        """Duals over ``gain`` of each inequality (1, k) and each cone (its rows, k), by what
        :meth:`nonneg` and :meth:`cone` returned."""
        result = dict[Any, FloatArray]()
        for constraint in self.stated:
            if (dual := constraint.dual_value) is not None and not isinstance(constraint, cp.Zero):
                parts = dual if isinstance(constraint, cp.SOC) else [dual]
                result[constraint] = np.vstack([np.asarray(part) for part in parts]) / gain
        return result

    @property
    def all(self) -> list[cp.Constraint]:
        """The constraints, those of one label together."""
        return [constraint for named in self.named.values() for constraint in named]


class Theta:
    """1, and the values of coefficients: slots of an expression that came before are the same.

    A source of values is a CVXPY expression of Parameters, or anything with its ``size``, ``value``
    and ``parameters()``.
    """

    def __init__(self) -> None:
        self.size = 1
        self._sources: dict[int, tuple[Any, IntArray]] = {}
        self._parts: list[Any] = []  # sources, and pairs of slots whose values are multiplied

    def slots(self, source: Any) -> IntArray:
        """Returns where the values (k,) of an expression stand, in column order."""
        if id(source) not in self._sources:
            self._sources[id(source)] = source, self._take(source, source.size)
        return self._sources[id(source)][1]

    def products(self, one: IntArray, other: IntArray) -> IntArray:
        """Slots (k,) of products of the values in slots (k,)."""
        if not one.any():
            return other
        return self._take((one, other), len(other))

    def _take(self, part: Any, size: int) -> IntArray:
        self._parts.append(part)
        self.size += size
        return np.arange(self.size - size, self.size)

    def values(self) -> FloatArray:
        """Returns the entries at the Parameters' present values.

        Raises
        ------
        ModelError
            For a Parameter without a value.
        """
        result, end = np.ones(self.size), 1
        for part in self._parts:
            if isinstance(part, tuple):
                values = result[part[0]] * result[part[1]]
            else:
                check_values(part.parameters())
                values = np.asarray(part.value, dtype=float).ravel(order="F")
            result[end : end + len(values)] = values
            end += len(values)
        return result

    def parameters(self) -> list[cp.Parameter]:
        """Those that any coefficient depends on, in the order in which they came."""
        sources = [part for part in self._parts if not isinstance(part, tuple)]
        return list(dict.fromkeys(p for source in sources for p in source.parameters()))


def check_values(parameters: Iterable[cp.Parameter]) -> None:
    for parameter in parameters:
        if parameter.value is None:
            shape = "a number" if parameter.ndim == 0 else f"an array of shape {parameter.shape}"
            raise ModelError(
                f"Parameter {parameter.name()!r} has no value: set its .value to {shape} first"
            )


@dataclass(frozen=True, eq=False, slots=True)
class Form:
    """Affine forms of the unknowns of :class:`Rows`, as many as ``size``: ``row``, ``column``,
    ``value`` and ``slot`` of their entries.

    Sums, multiples by numbers (k,), rows by index and products with matrices from the left are
    forms, as with CVXPY's expressions; :meth:`times` takes coefficients in Parameters as well.
    """

    theta: Theta
    size: int
    row: IntArray
    column: IntArray
    value: FloatArray
    slot: IntArray

    __array_ufunc__ = None  # NumPy's arrays leave arithmetic to forms

    @classmethod
    def of(cls, theta: Theta, column: IntArray) -> Form:
        """Unknowns themselves, by column."""
        size = len(column)
        return cls(theta, size, np.arange(size), column, np.ones(size), np.zeros(size, np.int64))

    def times(self, coefficient: Any) -> Form:
        """Times a number, one per form, or a CVXPY expression of Parameters of such a shape."""
        own, value, slot = self._spread(np.size(coefficient)), self.value, self.slot
        if isinstance(coefficient, cp.Expression):
            slots = np.broadcast_to(self.theta.slots(coefficient), (own.size,))
            value, slot = own.value, self.theta.products(own.slot, slots[own.row])
        elif isinstance(coefficient, float):
            value = coefficient * value
        else:
            each = np.broadcast_to(np.asarray(coefficient, dtype=float), (own.size,))
            value, slot = each[own.row] * own.value, own.slot
        return Form(self.theta, own.size, own.row, own.column, value, slot)

    def values(self, x: FloatArray) -> FloatArray:
        """Returns the values at unknowns x, and the Parameters' present values."""
        value = self.value * self.theta.values()[self.slot] if self.slot.any() else self.value
        each = np.append(x, 1.0)[self.column]  # the last stands for constants
        return np.asarray(np.bincount(self.row, value * each, self.size), dtype=float)

    def numbers(self, width: int, kind: Any = sp.csr_array) -> tuple[Any, FloatArray]:
        """Returns the matrix and the constants of forms without Parameters."""
        on = self.column != CONSTANT_COLUMN
        matrix = kind((self.value[on], (self.row[on], self.column[on])), shape=(self.size, width))
        return matrix, np.bincount(self.row[~on], self.value[~on], self.size).astype(float)

    def __getitem__(self, index: Any) -> Form:
        rows = np.arange(self.size)[index]
        order = np.argsort(self.row, kind="stable")
        start = np.searchsorted(self.row[order], np.arange(self.size + 1))
        at, each = _expanded(start, rows)
        return self._picked(order[at], each, len(rows))

    def __rmatmul__(self, matrix: Any) -> Form:
        if not sp.issparse(matrix):
            matrix = np.atleast_2d(matrix)
        if np.array_equal(self.row, np.arange(self.size)):  # one entry each, as unknowns have
            own = sp.coo_array(matrix)
            row, at = (np.asarray(index, np.int64) for index in own.coords)
            return self._picked(at, row, matrix.shape[0], own.data)
        columns = sp.csc_array(matrix)
        at, each = _expanded(columns.indptr, self.row)
        row = np.asarray(columns.indices[at], np.int64)
        return self._picked(each, row, columns.shape[0], columns.data[at])

    def __add__(self, other: Any) -> Form:
        if not isinstance(other, Form):  # numbers, or an expression of Parameters
            other = Form.of(self.theta, np.array([CONSTANT_COLUMN])).times(other)
        size = max(self.size, other.size)
        both = self._spread(size), other._spread(size)
        return _joined(both, [form.row for form in both], size)

    def __sub__(self, other: Any) -> Form:
        return self + -other

    def __rsub__(self, other: Any) -> Form:
        return -self + other

    def __neg__(self) -> Form:
        return self.times(-1.0)

    def __truediv__(self, divisor: Any) -> Form:
        return self.times(1.0 / np.asarray(divisor, dtype=float))

    __mul__ = __rmul__ = times
    __radd__ = __add__

    def _spread(self, size: int) -> Form:
        """One form as many that are the same."""
        return self if self.size == size or self.size != 1 else self[np.zeros(size, np.int64)]

    def _picked(
        self, entries: IntArray, rows: IntArray, size: int, times: FloatArray | float = 1.0
    ) -> Form:
        """Some entries (m,), times numbers, moved to ``rows`` (m,) of ``size``."""
        column, value = self.column[entries], times * self.value[entries]
        return Form(self.theta, size, rows, column, value, self.slot[entries])


def _expanded(start: NDArray[Any], rows: IntArray) -> tuple[IntArray, IntArray]:
    """Members of rows whose members stand one after the other from ``start`` on, and the place in
    ``rows`` that each belongs to."""
    count = (start[1:] - start[:-1])[rows]
    each, end = np.repeat(np.arange(len(rows)), count), np.cumsum(count)
    at = np.arange(len(each)) + np.repeat(start[rows] - end + count, count)
    return np.asarray(at, np.int64), each


def gathered(form: Any, at: IntArray, size: int, weight: Any = 1.0) -> Any:
    """Sums (size,) of weighted forms of either sink: the i-th is added to number ``at[i]``."""
    if isinstance(form, Form):
        is_plain = np.ndim(weight) == 0 and float(weight) == 1.0
        own = form if is_plain else form.times(weight)
        return Form(own.theta, size, at[own.row], own.column, own.value, own.slot)
    every, weights = np.arange(len(at)), np.broadcast_to(weight, at.shape)
    if size == len(at) > 0 and np.array_equal(at, every) and np.ptp(weights) == 0.0:
        return form if weights[0] == 1.0 else float(weights[0]) * form  # less for CVXPY to do
    return sp.csr_array((weights, (at, every)), shape=(size, len(at))) @ form


def stacked(forms: Sequence[Any]) -> Any:
    """Forms of either sink one below the other."""
    if not isinstance(forms[0], Form):
        return cp.hstack(list(forms))
    if len(forms) == 1:
        return forms[0]
    *starts, size = accumulate((form.size for form in forms), initial=0)
    return _joined(forms, [s + form.row for s, form in zip(starts, forms, strict=True)], size)


def _joined(forms: Sequence[Form], rows: Sequence[IntArray], size: int) -> Form:
    """All entries of forms in ``rows`` of ``size`` forms."""
    parts = ([getattr(form, name) for form in forms] for name in ("column", "value", "slot"))
    return Form(forms[0].theta, size, *map(np.concatenate, (rows, *parts)))


@dataclass
class Rows:
    """Rows of a cone program: ``equations``, forms that are not negative, and second-order
    ``cones``, bound first; ``width`` counts the unknowns."""

    theta: Theta = field(default_factory=Theta)
    label: str = ""
    width: int = 0
    equations: list[Form] = field(default_factory=list)
    linear: list[Form] = field(default_factory=list)
    cones: list[list[Form]] = field(default_factory=list)
    unknowns: list[Form] = field(default_factory=list)

    def new(self, size: int | None = None, name: str | None = None, nonneg: bool = False) -> Form:
        """The next columns as a form (size,), one without a size; rows need no name."""
        count = 1 if size is None else size
        form = Form.of(self.theta, np.arange(self.width, self.width + count))
        self.width += count
        self.unknowns.append(form)
        if nonneg:
            self.linear.append(form)
        return form

    def nonneg(self, form: Form) -> tuple[str, int]:
        """form >= 0, row by row."""
        self.linear.append(form)
        return "linear", len(self.linear) - 1

    def zero(self, form: Form) -> None:
        """form = 0, row by row."""
        self.equations.append(form)

    def cone(self, bound: Form, rows: Sequence[Form]) -> tuple[str, int]:
        """As many second-order cones as the bound has rows, each of one row of every form."""
        self.cones.append([bound, *rows])
        return "cone", len(self.cones) - 1

    def duals(self, y: FloatArray) -> dict[Any, FloatArray]:
        """Duals (rows,) of all rows as those of each form (1, k) and each cone (its rows, k), by
        what :meth:`nonneg` and :meth:`cone` returned."""
        result, start = dict[Any, FloatArray](), sum(form.size for form in self.equations)
        blocks = {"linear": [[form] for form in self.linear], "cone": self.cones}
        for kind, forms in blocks.items():
            for i, block in enumerate(forms):
                end = start + len(block) * block[0].size
                result[kind, i] = y[start:end].reshape(-1, len(block)).T
                start = end
        return result

    def entries(self) -> Form:
        """A and b, where b - A x is zero, not negative or in a cone, as forms A x - b: equations
        first, then inequalities, then cones, whose rows stand together."""
        blocks = [[form] for form in (*self.equations, *self.linear)] + self.cones
        rows, size = list[IntArray](), 0
        for block in blocks:
            rows += [size + i + len(block) * form.row for i, form in enumerate(block)]
            size += len(block) * block[0].size
        whole = _joined(list(chain(*blocks)), rows, size)
        sign = np.where(whole.row < sum(form.size for form in self.equations), 1.0, -1.0)
        return replace(whole, value=sign * whole.value)

    def written(self, goal: Form) -> Written:
        """The program that maximises ``goal``."""
        whole, cost = self.entries(), np.zeros(self.width)
        of_cost = goal.column != CONSTANT_COLUMN
        equations, linear = (sum(f.size for f in forms) for forms in (self.equations, self.linear))
        cones = tuple(chain(*([len(cone)] * cone[0].size for cone in self.cones)))
        sizes = equations, linear, cones
        # without Parameters these are the program
        if self.theta.size == 1:
            matrix, constant = whole.numbers(self.width, sp.csc_array)
            matrix.eliminate_zeros()
            np.add.at(cost, goal.column[of_cost], -goal.value[of_cost])
            return Written(ConeProgram(cost, matrix, -constant, *sizes), self.theta)
        # with them, where each entry belongs among the numbers of A, b and c
        row, column, shape = whole.row, whole.column, (whole.size, self.width)
        is_constant = column == CONSTANT_COLUMN
        is_entry = ~is_constant & (whole.value != 0.0)
        places = row[is_entry], column[is_entry]
        matrix = sp.csc_array((np.ones(len(places[0])), places), shape=shape)
        columns = np.repeat(np.arange(shape[1]), np.diff(matrix.indptr))
        keys = columns * shape[0] + matrix.indices
        at = np.searchsorted(keys, places[1] * shape[0] + places[0])
        place = [at, matrix.nnz + row[is_constant], matrix.nnz + shape[0] + goal.column[of_cost]]
        values = [whole.value[is_entry], -whole.value[is_constant], -goal.value[of_cost]]
        every = [whole.slot[is_entry], whole.slot[is_constant], goal.slot[of_cost]]
        program = ConeProgram(cost, matrix, np.zeros(shape[0]), *sizes)
        return Written(program, self.theta, *map(np.concatenate, (place, values, every)))


@dataclass(frozen=True, eq=False)
class Written:
    """A cone program whose numbers are sums of ``value * theta[slot]`` over entries, each at a
    ``place`` among the numbers of matrix, right-hand side and cost; ``place`` is None where nothing
    depends on Parameters."""

    program: ConeProgram
    theta: Theta
    place: IntArray | None = None
    value: FloatArray | None = None
    slot: IntArray | None = None

    def at(self, values: FloatArray) -> ConeProgram:
        """The program where theta has these ``values``."""
        if self.place is None or self.value is None:
            return self.program
        matrix, right, cost = self.program.matrix, self.program.right, self.program.cost
        count = matrix.nnz + len(right) + len(cost)
        filled = np.bincount(self.place, self.value * values[self.slot], count).astype(float)
        data, b, c = np.split(filled, np.cumsum([matrix.nnz, len(right)]))
        own = sp.csc_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)
        return replace(self.program, matrix=own, right=b, cost=c)
