"""Where a problem is stated: as CVXPY constraints, or as the rows of a cone program.

Surfaces, formulations and methods state a problem once, to a *sink*
(:class:`~cvxlimit.surfaces.cones.Sink`), in forms: affine expressions of its unknowns x. In
:class:`Constraints` forms are CVXPY expressions. In :class:`Rows` they are :class:`Form`, sums of
entries

    value * theta[slot] * x[column]   in a row,   and a constant per row,

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
"""Column of entries that are constants with a slot of theta."""


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

    def nonneg(self, form: Any) -> None:
        """form >= 0, entry by entry."""
        self.keep(form >= 0)

    def zero(self, form: Any) -> None:
        """form = 0, entry by entry."""
        self.keep(form == 0)

    def cone(self, bound: Any, rows: Sequence[Any]) -> None:
        """Second-order cones: the Euclidean norm of the i-th entries of all rows is at most the
        i-th entry of the bound."""
        self.keep(cp.SOC(bound, cp.vstack(list(rows)), axis=0))

    def keep(self, constraint: Any) -> None:
        """A constraint of CVXPY's own, under the present label."""
        if isinstance(constraint, cp.Constraint):  # a bare truth value says nothing of unknowns
            same = self.named.setdefault(self.label, [])
            same.append(constraint)
            self.stated.append(constraint)
            if hasattr(constraint, "set_label"):  # since CVXPY 1.9
                constraint.set_label(self.label if len(same) == 1 else f"{self.label} {len(same)}")

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
    """k affine forms of the unknowns of :class:`Rows`: ``row``, ``column``, ``value`` and ``slot``
    of their entries, and their constants (k,). ``first`` is set where they are unknowns themselves,
    one after the other from this column on.

    Sums, multiples by numbers (k,), rows by index and products with matrices from the left are
    forms, as with CVXPY's expressions; :meth:`times` takes coefficients in Parameters as well.
    """

    theta: Theta
    row: IntArray
    column: IntArray
    value: FloatArray
    slot: IntArray
    constant: FloatArray
    first: int | None = None

    __array_ufunc__ = None  # NumPy's arrays leave arithmetic to forms

    @classmethod
    def of(
        cls, theta: Theta, row: IntArray, column: IntArray, value: FloatArray, constant: FloatArray
    ) -> Form:
        """Forms whose entries do not depend on Parameters."""
        return cls(theta, row, column, value, np.zeros(len(row), np.int64), constant)

    @property
    def size(self) -> int:
        return len(self.constant)

    def times(self, coefficient: Any) -> Form:
        """Times a number, one per form, or a CVXPY expression of Parameters of such a shape."""
        if isinstance(coefficient, float):
            value, constant = coefficient * self.value, coefficient * self.constant
            return Form(self.theta, self.row, self.column, value, self.slot, constant)
        if not isinstance(coefficient, cp.Expression):
            k = np.asarray(coefficient, dtype=float)
            if k.ndim == 0:
                return self.times(float(k))
            own = self._spread(k.size)
            value, constant = k[own.row] * own.value, k * own.constant
            return Form(own.theta, own.row, own.column, value, own.slot, constant)
        own = self._spread(coefficient.size)._with_constant_entries()
        slots = np.broadcast_to(self.theta.slots(coefficient), (own.size,))
        return replace(own, slot=self.theta.products(own.slot, slots[own.row]), first=None)

    def values(self, x: FloatArray) -> FloatArray:
        """Returns the values at unknowns x, and the Parameters' present values."""
        if self.first is not None:
            return np.asarray(x[self.first : self.first + self.size])
        value = self.value * self.theta.values()[self.slot] if self.slot.any() else self.value
        each = np.append(x, 1.0)[self.column]  # the last stands for constants
        return np.asarray(np.bincount(self.row, value * each, self.size) + self.constant)

    def matrix(self, width: int) -> sp.csr_array:
        """Returns the matrix of forms without Parameters, constants left out."""
        entries = self.value, (self.row, self.column)
        return sp.csr_array(entries, shape=(self.size, width))

    def __getitem__(self, index: Any) -> Form:
        rows = np.arange(self.size)[index]
        if self.first is not None:
            every, ones = np.arange(len(rows)), np.ones(len(rows))
            return Form.of(self.theta, every, self.first + rows, ones, np.zeros(len(rows)))
        order = np.argsort(self.row, kind="stable")
        start = np.searchsorted(self.row[order], np.arange(self.size + 1))
        at, each = _expanded(start, rows)
        return replace(self._picked(order[at], each), constant=self.constant[rows])

    def __rmatmul__(self, matrix: Any) -> Form:
        if not sp.issparse(matrix):
            matrix = np.atleast_2d(matrix)
        if self.first is not None:
            entries = sp.coo_array(matrix)
            row, column = (np.asarray(index, np.int64) for index in entries.coords)
            value = np.asarray(entries.data, dtype=float)
            return Form.of(self.theta, row, self.first + column, value, np.zeros(matrix.shape[0]))
        columns = sp.csc_array(matrix)
        at, each = _expanded(columns.indptr, self.row)
        product = self._picked(each, np.asarray(columns.indices[at], np.int64))
        return replace(
            product,
            value=product.value * columns.data[at],
            constant=np.asarray(matrix @ self.constant),
        )

    def __add__(self, other: Any) -> Form:
        return self._plus(other, 1.0)

    def __sub__(self, other: Any) -> Form:
        return self._plus(other, -1.0)

    def __rsub__(self, other: Any) -> Form:
        return (-self)._plus(other, 1.0)

    def __neg__(self) -> Form:
        return self.times(-1.0)

    def __truediv__(self, divisor: Any) -> Form:
        return self.times(1.0 / np.asarray(divisor, dtype=float))

    __mul__ = __rmul__ = times
    __radd__ = __add__

    def _plus(self, other: Any, weight: float) -> Form:
        if isinstance(other, cp.Expression):
            none = np.zeros(0, np.int64)
            ones = Form.of(self.theta, none, none, np.zeros(0), np.ones(other.size))
            other = ones.times(other)
        if not isinstance(other, Form):
            number = weight * np.asarray(other, dtype=float)
            own = self._spread(number.size)
            first = own.first if not number.any() else None
            constant = own.constant + number
            return Form(own.theta, own.row, own.column, own.value, own.slot, constant, first)
        size = max(self.size, other.size)
        one, two = self._spread(size), other._spread(size)
        return Form(
            self.theta,
            np.concatenate([one.row, two.row]),
            np.concatenate([one.column, two.column]),
            np.concatenate([one.value, two.value if weight == 1.0 else weight * two.value]),
            np.concatenate([one.slot, two.slot]),
            one.constant + weight * two.constant,
        )

    def _spread(self, size: int) -> Form:
        """One form as many that are the same."""
        if self.size == size or self.size != 1:
            return self
        each = np.tile(np.arange(len(self.row)), size)
        copies = self._picked(each, np.repeat(np.arange(size), len(self.row)))
        return replace(copies, constant=np.repeat(self.constant, size))

    def _with_constant_entries(self) -> Form:
        """The same with constants as entries of :data:`CONSTANT_COLUMN`, which can have a slot."""
        at = np.flatnonzero(self.constant)
        if not len(at):
            return self
        return Form(
            self.theta,
            np.append(self.row, at),
            np.append(self.column, np.full(len(at), CONSTANT_COLUMN)),
            np.append(self.value, self.constant[at]),
            np.append(self.slot, np.zeros(len(at), np.int64)),
            np.zeros(self.size),
        )

    def _picked(self, entries: IntArray, rows: IntArray) -> Form:
        """Some entries (m,) moved to ``rows`` (m,). The constants are still those of this form, of
        its size: the caller replaces them by those of the new rows."""
        column, value = self.column[entries], self.value[entries]
        return Form(self.theta, rows, column, value, self.slot[entries], self.constant)


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
        if size == own.size and np.array_equal(at, np.arange(size)):
            return own
        constant = np.asarray(np.bincount(at, own.constant, size), dtype=float)
        return Form(own.theta, at[own.row], own.column, own.value, own.slot, constant)
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
    ends = list(accumulate(form.size for form in forms))
    starts = [0, *ends[:-1]]
    firsts = {None if f.first is None else f.first - s for s, f in zip(starts, forms, strict=True)}
    return Form(
        forms[0].theta,
        np.concatenate([s + form.row for s, form in zip(starts, forms, strict=True)]),
        np.concatenate([form.column for form in forms]),
        np.concatenate([form.value for form in forms]),
        np.concatenate([form.slot for form in forms]),
        np.concatenate([form.constant for form in forms]),
        firsts.pop() if len(firsts) == 1 else None,
    )


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
        every, first = np.arange(count), self.width
        form = Form.of(self.theta, every, first + every, np.ones(count), np.zeros(count))
        form = replace(form, first=first)
        self.width += count
        self.unknowns.append(form)
        if nonneg:
            self.linear.append(form)
        return form

    def nonneg(self, form: Form) -> None:
        """form >= 0, row by row."""
        self.linear.append(form)

    def zero(self, form: Form) -> None:
        """form = 0, row by row."""
        self.equations.append(form)

    def cone(self, bound: Form, rows: Sequence[Form]) -> None:
        """As many second-order cones as the bound has rows, each of one row of every form."""
        self.cones.append([bound, *rows])

    def entries(self) -> tuple[_Entries, FloatArray]:
        """Rows, columns, values and slots of A, and b, where b - A x is zero, not negative or in a
        cone: equations first, then inequalities, then cones, whose rows stand together."""
        blocks = [(1.0, [form]) for form in self.equations]
        blocks += [(-1.0, [form]) for form in self.linear] + [(-1.0, cone) for cone in self.cones]
        entries, rights, start = _Entries(), list[FloatArray](), 0
        for sign, block in blocks:
            right = np.empty(len(block) * block[0].size)
            for i, form in enumerate(block):
                rows = start + i + len(block) * form.row
                entries.append((rows, form.column, sign * form.value, form.slot))
                right[i :: len(block)] = -sign * form.constant
            rights.append(right)
            start += len(right)
        return entries, np.concatenate(rights)

    def written(self, goal: Form) -> Written:
        """The program that maximises ``goal``."""
        entries, right = self.entries()
        cost = np.zeros(self.width)
        row, column, value = (np.concatenate([part[i] for part in entries]) for i in range(3))
        equations, linear = (sum(f.size for f in forms) for forms in (self.equations, self.linear))
        cones = tuple(chain(*([len(cone)] * cone[0].size for cone in self.cones)))
        sizes, shape = (equations, linear, cones), (len(right), self.width)
        # without Parameters these are the program
        if self.theta.size == 1:
            matrix = sp.csc_array((value, (row, column)), shape=shape)
            matrix.eliminate_zeros()
            np.add.at(cost, goal.column, -goal.value)
            return Written(ConeProgram(cost, matrix, right, *sizes), self.theta)
        # with them, where each entry belongs among the numbers of A, b and c
        slot = np.concatenate([part[3] for part in entries])
        is_entry = (column != CONSTANT_COLUMN) & (value != 0.0)
        places = row[is_entry], column[is_entry]
        matrix = sp.csc_array((np.ones(len(places[0])), places), shape=shape)
        columns = np.repeat(np.arange(shape[1]), np.diff(matrix.indptr))
        keys = columns * shape[0] + matrix.indices
        at = np.searchsorted(keys, places[1] * shape[0] + places[0])
        # constants with a slot: of equations and inequalities alike b is minus what A has
        is_constant = column == CONSTANT_COLUMN
        of_cost = goal.column != CONSTANT_COLUMN
        place = [at, matrix.nnz + row[is_constant], matrix.nnz + shape[0] + goal.column[of_cost]]
        values = [value[is_entry], -value[is_constant], -goal.value[of_cost]]
        every = [slot[is_entry], slot[is_constant], goal.slot[of_cost]]
        fixed = np.concatenate([np.zeros(matrix.nnz), right, cost])
        program = ConeProgram(cost, matrix, right, *sizes)
        return Written(program, self.theta, fixed, *map(np.concatenate, (place, values, every)))


_Entries = list[tuple[IntArray, IntArray, FloatArray, IntArray]]


@dataclass(frozen=True, eq=False)
class Written:
    """A cone program whose numbers are sums of ``value * theta[slot]`` over entries, each at a
    ``place`` among the numbers of matrix, right-hand side and cost, on top of ``fixed``; ``place``
    is None where nothing depends on Parameters."""

    program: ConeProgram
    theta: Theta
    fixed: FloatArray | None = None
    place: IntArray | None = None
    value: FloatArray | None = None
    slot: IntArray | None = None

    def at(self, values: FloatArray) -> ConeProgram:
        """The program where theta has these ``values``."""
        if self.place is None or self.value is None or self.fixed is None:
            return self.program
        numbers = self.value * values[self.slot]
        filled = self.fixed + np.bincount(self.place, numbers, len(self.fixed))
        matrix, right = self.program.matrix, self.program.right
        data, b, cost = np.split(filled, np.cumsum([matrix.nnz, len(right)]))
        own = sp.csc_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)
        return replace(self.program, matrix=own, right=b, cost=cost)
