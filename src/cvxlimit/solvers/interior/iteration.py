"""Infeasible-start interior point for  min c'x  subject to  E x = f,  G x + s = h,  s in K.

Nesterov-Todd scaling; Mehrotra's predictor and corrector; further correctors after J. Gondzio,
Multiple centrality corrections, 1996. After the first full step every iterate satisfies its
equations to far less than its gap and is strictly inside the cones, so that its bounds lose nothing
but the gap.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import SolverError
from cvxlimit.solvers.interior.blocks import LIMITS
from cvxlimit.solvers.interior.compiled import newton_system
from cvxlimit.solvers.interior.elimination import largest

SOLVED, ALMOST, STALLED = "Solved", "AlmostSolved", "InsufficientProgress"
INFEASIBLE, UNBOUNDED = "PrimalInfeasible", "DualInfeasible"
"""How it ended, in Clarabel's words."""


@dataclass(frozen=True)
class Numbers:
    """The numbers of the iteration.

    ``reach`` is the share of the way to the boundary. Of Gondzio's correctors there are at most so
    many ``correctors``; ``widen`` is the longer step aimed at, ``band`` that for the products
    around the target, ``gain`` the share of the aim that makes another one worth it, beyond a
    ``long_step`` none is; the target is the share ``nearest`` of the mean product at least. Where
    rounding leaves a point outside, steps are shortened by the factor ``retreat``, down to the
    ``shortest``. The iteration stops, near the end (gaps below ``late``, which are relative to
    objectives of the ``least_value`` or more), after ``patience`` iterations without a gain of a
    factor 2. ``solved`` and ``almost`` are
    the worst gap and residual called so (where a wide gap is asked for, residuals may be the share
    ``balance`` of it); ``no_answer`` is the residual of a proof that there is no
    optimum. ``middle`` is the relative gap of the first point from which the next problem may
    start; a start is moved inside by that share of its mean entries which it misses of the problem,
    ``shift`` at most, a cold one has eigenvalues no less than ``floor`` times the mean of the other
    unknowns of its side. Directions are refined
    until what they leave costs the bounds the share ``light`` of the gap that the next point may
    have at best, ``ahead`` of this one's or the one asked for. The best point is chosen at ``thin``
    times these costs of equilibrium: they are those of typical loads, and where corners are about
    to open 16 to 140 times as much was lost.
    """

    reach: float = 0.99
    correctors: int = 2
    widen: float = 0.3
    band: float = 0.03
    gain: float = 0.1
    long_step: float = 0.9
    patience: int = 5
    nearest: float = 1e-8
    shortest: float = 1e-6
    retreat: float = 0.8
    late: float = 1e-10
    least_value: float = 1e-6
    solved: float = 1e-8
    almost: float = 1e-4
    balance: float = 1e-5
    no_answer: float = 1e-9
    middle: float = 1e-2
    floor: float = 0.1
    light: float = 1e-3
    ahead: float = 0.1
    thin: float = 50.0
    shift: float = 0.1


NUMBERS = Numbers()


@dataclass(frozen=True, eq=False)
class Point:
    """An iterate: x (n,), duals of equations y (p,) and cones z (m,), slacks s (m,)."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    s: FloatArray

    def moved(self, primal: float, dual: float, d: Point) -> Point:
        """The point further along ``d``, by a step for (x, s) and one for (y, z)."""
        x, y = self.x + primal * d.x, self.y + dual * d.y
        return Point(x, y, self.z + dual * d.z, self.s + primal * d.s)

    @property
    def is_finite(self) -> bool:
        return all(np.isfinite(part).all() for part in (self.x, self.y, self.z, self.s))


@dataclass(frozen=True, eq=False)
class Result:
    """Status; the answer; points on the way to it, from which others may start, by the power of ten
    of their gaps and residuals; all in the order of the program."""

    status: str
    point: Point
    objective: float
    iterations: int
    seconds: float
    way: Mapping[int, Point]

    @property
    def middle(self) -> Point | None:
        """The first point on the way."""
        return self.way[max(self.way)] if self.way else None


@dataclass(frozen=True, eq=False)
class _Measure:
    """The residuals (n + p + m,) at a point, what one of 1 costs the bounds, relatively, and how
    good the point is."""

    missing: FloatArray
    costs: tuple[float, float]
    mu: float
    gap: float
    infeasibility: float
    score: float

    def is_within(self, tolerance: float, residual: float | None) -> bool:
        enough = residual or max(NUMBERS.solved, NUMBERS.balance * tolerance)
        return self.gap < tolerance and self.infeasibility < enough

    def allowed(self, tolerance: float) -> tuple[float, float, float]:
        """What the next point may lack in rates, equilibrium and slacks."""
        share = NUMBERS.light * max(NUMBERS.ahead * min(self.gap, 1.0), tolerance)
        return share / self.costs[0], share / self.costs[1], 0.0


class InteriorPoint:
    """One cone program, min c'x with b - A x in {0}^zero x R+^orthant x second-order cones.

    ``soc`` are the sizes of the second-order cones, ``backend`` one of
    :data:`~cvxlimit.solvers.sparse.BACKENDS`. Raises SolverError if the cone rows do not fall apart
    into small blocks.
    """

    def __init__(
        self,
        c: FloatArray,
        A: sp.csr_array,
        b: FloatArray,
        zero: int,
        orthant: int,
        soc: list[int],
        backend: str,
    ) -> None:
        self.system = newton_system(sp.csr_array(A), zero, orthant, soc, backend)
        self.cones = self.system.cones
        self._state(c, b)

    def renew(self, c: FloatArray, data: FloatArray, b: FloatArray) -> None:
        """Another program of the same pattern, whose entries of A are ``data``."""
        self.system.renew(data)
        self._state(c, b)

    def _state(self, c: FloatArray, b: FloatArray) -> None:
        zero = self.system.equations
        self.c, self.f, self.h = c[self.system.columns], b[:zero], b[zero:][self.system.rows]
        self._empty = np.flatnonzero((self.system.lengths[:zero] == 0) & (self.f != 0.0))
        entries = np.abs(self.f[self.f != 0.0])
        self._unit = float(entries.mean()) if len(entries) else 1.0
        self._loads = float(entries.sum()) or 1.0

    @np.errstate(divide="ignore", invalid="ignore", over="ignore")
    def minimise(
        self,
        tolerance: float,
        max_iter: int,
        starts: Sequence[Point] = (),
        residual: float | None = None,
    ) -> Result:
        """The best iterate, when the relative gap is below the tolerance and residuals are below
        theirs, or rounding allows no more. ``starts`` are points on the way to another answer,
        nearest to it first; those that are no use, of another size or with NaN, are not used."""
        began = time.perf_counter()
        self.system.target = min(max(LIMITS.target, 300.0 * tolerance), LIMITS.loosest)
        at = self._warm(starts) or self._cold()
        best, scores, worst, count = at, [np.inf], np.inf, 0
        rank, enough = (True, np.inf), max(NUMBERS.solved, tolerance)
        way = dict[int, Point]()
        outcome: tuple[str, Point] | None = None
        while True:
            found = self._measured(at)
            if (own := (not found.is_within(enough, residual), found.score)) < rank:
                best, rank = at, own
            scores.append(min(scores[-1], found.score))
            worst = min(worst, max(found.gap, found.infeasibility))
            if count and worst < NUMBERS.middle:
                way.setdefault(int(np.floor(np.log10(max(worst, 1e-300)))), at)
            outcome = self._no_answer(at, found)
            if outcome is not None or found.is_within(tolerance, residual):
                break
            if self._is_stuck(found, scores, worst):
                break
            moved = self._moved(at, found, tolerance) if count < max_iter else None
            if moved is None:
                break
            at, count = moved, count + 1
        reached = SOLVED if not rank[0] else ALMOST if worst < NUMBERS.almost else STALLED
        status, point = outcome or (reached, best)
        objective = {INFEASIBLE: np.inf, UNBOUNDED: -np.inf}.get(status, float(self.c @ point.x))
        given = {power: self._given(each) for power, each in way.items()}
        seconds = time.perf_counter() - began
        return Result(status, self._given(point), objective, count, seconds, given)

    def _given(self, at: Point) -> Point:
        """A point in the order of the program given."""
        x, z, s = np.empty_like(at.x), np.empty_like(at.z), np.empty_like(at.s)
        x[self.system.columns] = at.x
        z[self.system.rows], s[self.system.rows] = at.z, at.s
        return Point(x, at.y, z, s)

    def _cold(self) -> Point:
        """Least-squares solutions, moved inside the cones (Vandenberghe, section 7.3)."""
        e, nothing = self.cones.identity, np.zeros_like
        try:
            self.system.factorise(self.cones.scaling(e, e))
        except (np.linalg.LinAlgError, RuntimeError, ArithmeticError) as error:
            raise SolverError(
                "blockwise: some variables are neither in a cone nor in independent equations; "
                "use another solver"
            ) from error
        x, _, z = self._split(nothing(self.c), self.f, self.h)
        s = self._inside(-z, x)
        _, y, z = self._split(-self.c, nothing(self.f), nothing(self.h))
        return Point(x, y, self._inside(z, y), s)

    def _split(self, *right: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self.system.parts(self.system.solve(np.concatenate(right)))

    def _inside(self, v: FloatArray, beside: FloatArray) -> FloatArray:
        """Moved so far that the least eigenvalue is of the order of the mean entry."""
        margin = self.cones.margin(v)
        size = max(float(np.abs(v).mean()), NUMBERS.floor * float(np.abs(beside).mean())) or 1.0
        return v if margin > size else v + max(-2.0 * margin, size) * self.cones.identity

    def _warm(self, starts: Sequence[Point]) -> Point | None:
        """From the first of some points that misses no more of this problem than its gap, for the
        way from others goes along the boundary; or from the one that misses least for its gap."""
        sizes = tuple(v.shape for v in (self.c, self.f, self.h, self.h))
        columns, rows = self.system.columns, self.system.rows
        usable = [
            Point(at.x[columns], at.y, at.z[rows], at.s[rows])
            for at in starts
            if at.is_finite and tuple(v.shape for v in (at.x, at.y, at.z, at.s)) == sizes
        ]
        least, best = np.inf, None
        for at in usable:
            found = self._measured(at)
            missed = self._missed(at, found)
            if missed < least * found.gap:
                least, best = missed / found.gap, (at, min(NUMBERS.shift, missed))
            if least <= 1.0:
                break
        if best is None:
            return None
        (at, share), e = best, self.cones.identity
        z, s = (v + share * float(np.abs(v).mean()) * e for v in (at.z, at.s))
        is_inside = min(self.cones.margin(v) for v in (z, s)) > 0.0
        return Point(at.x, at.y, z, s) if is_inside else None

    def _missed(self, at: Point, found: _Measure) -> float:
        """Residuals over what stands in their rows: rates by multipliers, loads, and slacks."""
        beside = (at.z, self.f, at.s)
        parts = zip(self.system.parts(found.missing), beside, strict=True)
        sizes = [float(np.abs(r).sum() / np.abs(v).sum()) for r, v in parts if v.any()]
        return max(sizes, default=0.0)

    def _measured(self, at: Point) -> _Measure:
        system = self.system
        p = system.equations
        own = system.A @ at.x
        rx = -(system.At @ np.concatenate([at.y, at.z]) + self.c)
        ry, slack = self.f - own[:p], self.h - own[p:]
        rz = slack - at.s
        product = float(at.s @ at.z)
        primal = float(self.c @ at.x)
        gap = product / max(abs(primal), NUMBERS.least_value)
        dual_size = max(1.0, largest(at.z), largest(at.y))
        primal_size = max(1.0, largest(at.x))
        missing = largest(rx) / dual_size
        infeasibility = max(max(largest(ry), largest(rz)) / primal_size, missing)
        # What the certificate may lose: above, it has to open contacts where rates break the flow
        # rule, and loads do work on that; below, forces have to be put into equilibrium again.
        costs = self._loads / max(abs(primal), NUMBERS.least_value), 1.0 / self._unit
        missing = max(missing, largest(rx) * costs[0])
        outside = -self.cones.margin(slack)
        violation = (largest(ry) + max(outside, 0.0)) * costs[1]
        mu = product / self.cones.degree
        right = np.concatenate([rx, ry, rz])
        score = gap + missing + NUMBERS.thin * violation
        return _Measure(right, costs, mu, gap, infeasibility, score)

    def _no_answer(self, at: Point, found: _Measure) -> tuple[str, Point] | None:
        """A proof that there is no optimum: a certificate of infeasibility or a ray."""
        system = self.system
        if len(empty := self._empty):  # equations without variables that ask for something
            y = np.zeros_like(at.y)
            y[empty[0]] = -1.0 / self.f[empty[0]]
            return INFEASIBLE, Point(at.x, y, np.zeros_like(at.z), at.s)
        dual = -float(self.f @ at.y) - float(self.h @ at.z)
        if dual > 0.0 and largest(system.Et @ at.y + system.Gt @ at.z) < NUMBERS.no_answer * dual:
            return INFEASIBLE, Point(at.x, at.y / dual, at.z / dual, at.s)
        primal = float(self.c @ at.x)
        if primal < 0.0:
            _, ry, rz = system.parts(found.missing)
            moves = max(largest(self.f - ry), largest(self.h - rz))
            if moves < -NUMBERS.no_answer * primal:
                return UNBOUNDED, Point(at.x / -primal, at.y, at.z, at.s / -primal)
        return None

    @staticmethod
    def _is_stuck(found: _Measure, scores: list[float], worst: float) -> bool:
        is_late = worst < NUMBERS.solved or found.gap < NUMBERS.late
        p = NUMBERS.patience
        return is_late and len(scores) > p and scores[-1] > 0.5 * scores[-1 - p]

    def _moved(self, at: Point, found: _Measure, tolerance: float) -> Point | None:
        """The next iterate, or None where rounding ends the iteration."""
        try:
            newton = _Newton(self, at, found)
            best, change = newton.refined(newton.best(), found.allowed(tolerance))
        except (np.linalg.LinAlgError, RuntimeError, ArithmeticError):
            return None
        if not change.is_finite:
            return None
        primal, dual = best.primal, best.dual
        while max(primal, dual) > NUMBERS.shortest:
            moved = at.moved(primal, dual, change)
            if self.cones.margin(moved.s) > 0.0 and self.cones.margin(moved.z) > 0.0:
                return moved
            primal, dual = NUMBERS.retreat * primal, NUMBERS.retreat * dual
        return None


@dataclass(frozen=True, eq=False)
class _Direction:
    """Changes of x and y, the scaled W^-1 ds and W dz, which add up to ``own``, and how far to go
    of both sides."""

    own: FloatArray
    x: FloatArray
    y: FloatArray
    ds: FloatArray
    dz: FloatArray
    primal: float
    dual: float

    @property
    def step(self) -> float:
        return min(self.primal, self.dual)


class _Newton:
    """Search directions from one iterate."""

    def __init__(self, program: InteriorPoint, at: Point, found: _Measure) -> None:
        self.system, self.found, self.cones = program.system, found, program.cones
        self.scaling = program.cones.scaling(at.s, at.z)
        self.system.factorise(self.scaling)
        self.lam = self.scaling.lam
        rx, self._ry, self._rz = self.system.parts(found.missing)
        self._rx = rx + self.system.Gt @ self.scaling.squared(self._rz, -1.0)

    def direction(self, aim: FloatArray) -> _Direction:
        """Removes the residuals, as far as elimination does, and aims at
        lam o (W dz + W^-1 ds) = aim."""
        system, times = self.system, self.scaling.times
        own = self.cones.quotient(aim, self.lam)
        x, y = system.halved(self._rx - system.Gt @ times(own, -1.0), self._ry)
        return self._along(own, x, y, own - times(self._rz - system.G @ x, -1.0))

    def _along(self, own: FloatArray, x: FloatArray, y: FloatArray, dz: FloatArray) -> _Direction:
        ds = own - dz
        lengths = [min(1.0, NUMBERS.reach * t) for t in self.cones.steps(self.lam, ds, dz)]
        return _Direction(own, x, y, ds, dz, *lengths)

    def refined(self, d: _Direction, allowed: Sequence[float]) -> tuple[_Direction, Point]:
        """The direction with all the residuals removed but for what is ``allowed``, and the change
        of the point."""
        system, times = self.system, self.scaling.times
        right = self.found.missing.copy()
        system.parts(right)[2][:] -= times(d.own)
        given = np.concatenate([d.x, d.y, times(d.dz, -1.0)])
        solution = system.refined(right, given, allowed)
        x, y, z = system.parts(solution)
        if solution is not given:
            d = self._along(d.own, x, y, times(z))
        return d, Point(x, y, z, times(d.ds))

    def best(self) -> _Direction:
        cones, lam, mu = self.cones, self.lam, self.found.mu
        squares = cones.product(lam, lam)
        best = self.direction(-squares)
        ahead = float((lam + best.primal * best.ds) @ (lam + best.dual * best.dz)) / cones.degree
        goal = max(min(1.0, max(ahead / mu, 0.0)) ** 3, NUMBERS.nearest) * mu
        aim = goal * cones.identity - squares - cones.product(best.ds, best.dz)
        best = self.direction(aim)
        for _ in range(NUMBERS.correctors):
            if best.step > NUMBERS.long_step:
                break
            wider = min(1.0, best.step + NUMBERS.widen)
            products = cones.product(lam + wider * best.ds, lam + wider * best.dz)
            inside = cones.clipped(products, NUMBERS.band * goal, goal / NUMBERS.band)
            aim = aim + np.maximum(inside - products, -goal / NUMBERS.band)
            new = self.direction(aim)
            pays = new.step >= best.step + NUMBERS.gain * NUMBERS.widen
            best = new if new.step > best.step else best
            if not pays:
                break
        return best
