"""The limit problem written straight as matrices, where its structure is known.

CVXPY's modelling and compiling take 25 to 50 ms however small a scene is, where solvers need 1 to
15. Conditions with numbers for coefficients, and norms bounded by circles or facets, become the
same rows here; everything else is left to CVXPY.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.model.assemblage import Assemblage, Reduction, kept_rows, mechanism_of
from cvxlimit.model.formulations import ForceModel, corner_compressions, model_of
from cvxlimit.model.problem import LargestFactor, LimitProblem
from cvxlimit.model.statics import DOF
from cvxlimit.solvers import LimitState, Outcome, Shape, SolverSettings, limit_ladder
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.base import Coefficient, Condition, LinearForm, YieldSurface, number
from cvxlimit.surfaces.cones import Cone, Conic, Facets
from cvxlimit.surfaces.coulomb import needed_surfaces, strength_key

_WANT_MATRICES = ("CLARABEL", "BLOCKWISE", "RESCALED", "QOCO")
"""Solvers whose interfaces need these matrices and nothing else of a problem."""


class DirectProblem:
    """:class:`LimitProblem` for the largest load factor, without CVXPY where it can do without.

    Solvers that want more than matrices, and conditions of other kinds, go the way through CVXPY.
    ``repeats`` is what problems of scenes like this one share
    (:class:`~cvxlimit.reductions.repeated.Repeats`), if there are any.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES
    >>> assemblage = Assemblage.of(builtin_scene("single-block"))
    >>> problem = DirectProblem(assemblage, DEFAULT_SURFACES, Reduction.none(assemblage.statics))
    >>> round(problem.solve(problem.ladder()[0]).load_factor, 6)
    0.4
    """

    def __init__(
        self,
        assemblage: Assemblage,
        surfaces: Sequence[YieldSurface],
        reduction: Reduction,
        most: float | None = None,
        repeats: Any = None,
    ) -> None:
        self.assemblage, self.reduction, self.most = assemblage, reduction, most
        self.repeats = repeats
        self.surfaces = needed_surfaces(surfaces)
        self.model = model_of(reduction.formulation, reduction.contacts)
        self._unit = np.where(self.model.is_moment, assemblage.scaling.length, 1.0)

    @cached_property
    def modelled(self) -> LimitProblem:
        """The same in CVXPY."""
        goal, reduction = LargestFactor(self.most), self.reduction
        return LimitProblem(self.assemblage, self.surfaces, objective=goal, reduction=reduction)

    def ladder(self, tolerance: float = 1e-5) -> tuple[SolverSettings, ...]:
        """Solvers in the order in which to try them for a bracket within ``tolerance``."""
        return limit_ladder(self.shape, tolerance, self.repeats is not None)

    @cached_property
    def shape(self) -> Shape:
        """Counts, which decide about solvers."""
        program = self.program
        if program is None:
            return self.modelled.shape
        variables, cones = program.matrix.shape[1], len(program.cones)
        return Shape(variables, program.zero, cones, program.nonneg)

    @cached_property
    def _kept(self) -> dict[str, Any] | None:
        is_shared = self.repeats is not None and self.program is not None
        return self.repeats.structure(self.program) if is_shared else None

    def solve(self, settings: SolverSettings) -> LimitState:
        """One run of one solver; never raises for what the solver does.

        Where rounding decides, Clarabel's last rungs see the rows in CVXPY's order.
        """
        is_last = settings.name == "CLARABEL" and settings.label != ""
        if self.program is None or settings.name not in _WANT_MATRICES or is_last:
            return self.modelled.solve(settings)
        return self.state(*self.program.solve(settings, self._kept, is_warm=False))

    def state(self, outcome: Outcome, x: FloatArray | None, y: FloatArray | None) -> LimitState:
        """What a solution of the program says, with duals y of its equations."""
        if x is None or y is None:
            return LimitState(outcome, None, None, None)
        scaling, reduction = self.assemblage.scaling, self.reduction
        internal = scaling.force * self._unit * x[: len(self._unit)]
        forces = self.model.forces(internal)
        if reduction.forces is not None:
            forces = np.asarray(reduction.forces @ forces.ravel()).reshape(-1, DOF)
        return LimitState(
            outcome,
            scaling.load_factor(float(x[-1])),
            forces if reduction.still is None else forces + reduction.still,
            mechanism_of(y, self.assemblage, self._equilibrium[3], reduction.rates),
            internal,
        )

    @cached_property
    def program(self) -> ConeProgram | None:
        """Unknown are internal forces, bounds of norms, and the load factor, which is the last."""
        _, dead, live, _ = self._equilibrium
        about = strength_key(self.surfaces, self.model.contacts)
        is_full = self._is_whole and len(live) == self._loads.shape[1]
        if self.repeats is None or about is None or not is_full or self.most is not None:
            return self._written()
        what = "program", about, self.assemblage.scaling.force
        found: ConeProgram | None = self.repeats.shared(what, self.model.contacts, self._written)
        return None if found is None else found.under(dead, live)

    @cached_property
    def _is_whole(self) -> bool:
        """True if unknown are the corner compressions of all contacts: equilibrium is then the same
        for all scenes of one geometry."""
        is_plain = self.reduction.formulation is corner_compressions and not self.model.conditions
        return is_plain and not self.reduction.names

    def _written(self) -> ConeProgram | None:
        stated = self.model.strength(self.surfaces)
        if not all(_is_known(condition, cone) for _, condition, cone in stated):
            return None
        matrix, dead, live, _ = self._equilibrium
        rows = _Rows(self.model, self._unit, self.assemblage.scaling.force)
        for _, condition, cone in stated:
            rows.add(condition, cone)
        if self.most is not None:
            most = np.array([self.most / self.assemblage.scaling.load_factor(1.0)])
            rows.linear.append(_Form(np.array([0]), np.array([rows.width]), -np.ones(1), most))
        every, nothing = np.arange(len(live)), np.zeros(len(live))
        at, column = (np.asarray(index, np.int64) for index in matrix.tocoo().coords)
        balance = _Form(at, column, -matrix.data, -dead).plus(
            -1.0, _Form(every, np.full_like(every, rows.width), live, nothing)
        )
        blocks = [[balance], *([form] for form in rows.linear), *rows.cones]
        right = [np.stack([form.constant for form in block], axis=1) for block in blocks]
        starts = np.cumsum([0, *(part.size for part in right)])
        entries = [
            (start + i + len(block) * form.row, form.column, -form.value)
            for block, start in zip(blocks, starts, strict=False)
            for i, form in enumerate(block)
        ]
        row, column, value = map(np.concatenate, zip(*entries, strict=True))
        shape = int(starts[-1]), rows.width + 1
        whole = sp.csc_array((value, (row, column)), shape=shape)
        whole.eliminate_zeros()
        return ConeProgram(
            np.append(np.zeros(rows.width), -1.0),
            whole,
            np.concatenate([part.ravel() for part in right]),
            len(live),
            sum(len(form.constant) for form in rows.linear),
            tuple(len(cone) for cone in rows.cones for _ in cone[0].constant),
        )

    def dead_alone(self) -> DirectProblem:
        """Which share, at most all, of the dead load alone is carried: these rows, another load."""
        assemblage, whole = self.assemblage, self.program
        alone = assemblage.alone(assemblage.statics.dead)
        result = DirectProblem(alone, self.surfaces, self.reduction, most=1.0)
        if whole is None or alone.scaling.force != assemblage.scaling.force:
            return result
        matrix, dead, _, rows = self._equilibrium
        before = whole.under(np.zeros_like(dead), dead)
        at, given = before.zero + before.nonneg, before.matrix
        entries = (
            np.append(given.data, 1.0),
            np.append(given.indices + (given.indices >= at), at),
            np.append(given.indptr[:-1], given.nnz + 1),
        )
        shape = given.shape[0] + 1, given.shape[1]
        right = np.insert(before.right, at, 1.0)
        result.__dict__["_equilibrium"] = matrix, np.zeros_like(dead), dead, rows
        result.__dict__["program"] = replace(
            before, matrix=sp.csc_array(entries, shape), right=right, nonneg=before.nonneg + 1
        )
        return result

    @cached_property
    def _down(self) -> FloatArray:
        """Units of equilibrium's rows: moments are over the length."""
        units = np.repeat([1.0, 1.0 / self.assemblage.scaling.length], 3)
        return np.tile(units, len(self.assemblage.statics.dead) // DOF)

    @cached_property
    def _loads(self) -> FloatArray:
        """Scaled dead and live load (2, 6 free blocks)."""
        statics, scaling = self.assemblage.statics, self.assemblage.scaling
        loads = statics.dead / scaling.force, statics.live / scaling.live
        return self._down * np.stack(loads)

    @cached_property
    def _matrix(self) -> sp.csr_array:
        """Of equilibrium along all six ways of all free blocks, scaled."""
        if self.repeats is None or not self._is_whole:
            return self._scaled()
        result: sp.csr_array = self.repeats.shared("matrix", self.model.contacts, self._scaled)
        return result

    def _scaled(self) -> sp.csr_array:
        lift, meaning = self.reduction.forces, self.model.meaning
        forces = meaning if lift is None else lift @ meaning
        matrix = (self.assemblage.statics.matrix @ forces).tocsr()
        matrix.data *= np.repeat(self._down, np.diff(matrix.indptr)) * self._unit[matrix.indices]
        matrix.eliminate_zeros()
        return matrix

    @cached_property
    def _equilibrium(self) -> tuple[sp.csr_array, FloatArray, FloatArray, IntArray]:
        """Scaled, of the internal forces; dead and live load; and which rows say anything."""
        matrix, rates = self._matrix, self.reduction.rates
        loads = self._loads
        size = np.abs(loads).sum(axis=0)
        if rates is not None:
            matrix, loads, size = (rates @ matrix).tocsr(), loads @ rates.T, abs(rates) @ size
            matrix.eliminate_zeros()
        rows = kept_rows(matrix, size)
        if len(rows) < len(size):
            matrix, loads = matrix[rows], loads[:, rows]
        return matrix, *loads, rows


class _Form(NamedTuple):
    """Affine forms of the unknowns: entries of their matrix, and their constants (k,)."""

    row: IntArray
    column: IntArray
    value: FloatArray
    constant: FloatArray

    def plus(self, weight: float | FloatArray, other: _Form) -> _Form:
        """With ``weight``, one or one per form, times others."""
        each = np.broadcast_to(np.asarray(weight, dtype=float), self.constant.shape)
        value = np.concatenate([self.value, each[other.row] * other.value])
        row = np.concatenate([self.row, other.row])
        column = np.concatenate([self.column, other.column])
        return _Form(row, column, value, self.constant + each * other.constant)


class _Rows:
    """What conditions ask for: ``linear`` forms that are not negative, and second-order ``cones``,
    bound first; ``width`` counts the unknowns."""

    def __init__(self, model: ForceModel, unit: FloatArray, force: float) -> None:
        self.model, self.unit, self.force, self.width = model, unit, force, len(unit)
        at = np.flatnonzero(model.nonneg)
        signs = _Form(np.arange(len(at)), at, np.ones(len(at)), np.zeros(len(at)))
        self.linear, self.cones = [signs], list[list[_Form]]()

    def add(self, condition: Condition, cone: Cone) -> None:
        """As :func:`~cvxlimit.surfaces.base.admissible` writes it."""
        rest = self._form(condition.resistance, condition.contact)
        norms = sorted(condition.norms, key=lambda norm: (norm.is_plain, len(norm.rows)))
        last = norms.pop() if norms and norms[-1].is_plain else None
        for norm in norms:
            at = np.arange(len(rest.constant))
            bound = _Form(at, self.width + at, np.ones(len(at)), np.zeros(len(at)))
            self.width += len(at)
            self._bound(bound, [self._form(row, condition.contact) for row in norm.rows], cone)
            rest = rest.plus(-np.asarray(number(norm.weight)), bound)
        if last is None:
            self.linear.append(rest)
        else:
            self._bound(rest, [self._form(row, condition.contact) for row in last.rows], cone)

    def _bound(self, bound: _Form, rows: list[_Form], cone: Cone) -> None:
        if len(rows) == 1:
            self.linear += [bound.plus(-1.0, rows[0]), bound.plus(1.0, rows[0])]
        elif isinstance(cone, Facets):
            for first, second in cone.normals:
                self.linear.append(bound.plus(-first, rows[0]).plus(-second, rows[1]))
        else:
            self.cones.append([bound, *rows])

    def _form(self, form: LinearForm, contact: IntArray | None) -> _Form:
        row, column, value, constant = self.model.entries(form, contact)
        return _Form(row, column, self.unit[column] * value, constant / self.force)


def _is_known(condition: Condition, cone: Cone) -> bool:
    given: list[Coefficient] = [norm.weight for norm in condition.norms]
    given += [k for form in condition.forms() for k in form.values()]
    is_plain = all(len(norm.rows) == 1 for norm in condition.norms)
    is_known = type(cone) is Conic or (
        type(cone) is Facets and all(len(norm.rows) <= 2 for norm in condition.norms)
    )
    return (is_plain or is_known) and not any(isinstance(k, cp.Expression) for k in given)
