"""Interior-point iteration on the homogeneous embedding of a cone program.

    min c'x  subject to  E x = f,  G x + s = h,  s in K

Nesterov-Todd scaling; Mehrotra's predictor and corrector (E. D. Andersen, C. Roos, T. Terlaky, On
implementing a primal-dual interior-point method for conic quadratic optimization, 2003); further
correctors after J. Gondzio, Multiple centrality corrections, 1996: at scale they save a third of
the factorisations.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.errors import SolverError
from cvxlimit.solvers.blockwise.cones import Cones, Scaling
from cvxlimit.solvers.blockwise.elimination import NewtonSystem, inner, largest

FloatArray = NDArray[np.float64]

SOLVED, ALMOST, STALLED = "solved", "almost solved", "stalled"
INFEASIBLE, UNBOUNDED = "infeasible", "unbounded"

_REACH = 0.99
"""Share of the way to the boundary."""

_CORRECTORS, _WIDEN, _BAND, _GAIN = 4, 0.3, 0.03, 0.1
"""Gondzio's correctors: most of them, longer step aimed at, band for the products around the
target, share of the aim that makes another one worth it."""

_LONG_STEP = 0.9
"""Beyond it no corrector is worth its solve."""

_SHORTEST_STEP = 1e-6

_PATIENCE, _CONVERGED = 4, 1e-10
"""Iterations without a gain of a factor 2 before the iteration stops, once an iterate was called
solved or complementarity is below this: only rounding is left then. Not earlier: on scenes close to
another, stronger one iterates may seem to settle there, and leave again after 15 iterations."""

_SOLVED, _ALMOST = 1e-8, 1e-4
"""Worst complementarity and residual called solved, and almost solved."""

_NO_ANSWER = 1e-9
"""Residual of a proof that there is no optimum; the certificate decides in the end."""


@dataclass(frozen=True, eq=False)
class Point:
    """An iterate of the embedding; x / tau and so on solve the program when kappa is 0."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    s: FloatArray
    tau: float
    kappa: float

    def moved(self, step: float, d: Point) -> Point:
        """The point a step further along ``d``."""
        return Point(
            self.x + step * d.x,
            self.y + step * d.y,
            self.z + step * d.z,
            self.s + step * d.s,
            self.tau + step * d.tau,
            self.kappa + step * d.kappa,
        )

    def over(self, number: float) -> Point:
        """Everything divided by a number."""
        x, y, z, s = (part / number for part in (self.x, self.y, self.z, self.s))
        return Point(x, y, z, s, self.tau / number, self.kappa / number)

    @property
    def is_finite(self) -> bool:
        """True without inf and NaN."""
        return all(np.isfinite(part).all() for part in (self.x, self.y, self.z, self.s))


@dataclass(frozen=True, eq=False)
class Result:
    """Status; x (n,), duals of equations y (p,) and cones z (m,), slacks s (m,); what it took."""

    status: str
    x: FloatArray
    y: FloatArray
    z: FloatArray
    s: FloatArray
    objective: float
    iterations: int
    seconds: float


@dataclass(frozen=True, eq=False)
class _Residuals:
    """What is missing at a point, and how good the point is."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    tau: float
    mu: float
    complementarity: float
    infeasibility: float
    score: float

    @property
    def worst(self) -> float:
        return max(self.complementarity, self.infeasibility)


class _Program:
    """The data of one cone program, and its embedding's residuals."""

    def __init__(
        self,
        c: FloatArray,
        A: sp.csr_array,
        b: FloatArray,
        zero: int,
        cones: Cones,
        backend: str,
    ) -> None:
        self.c, self.f, self.h, self.cones = c, b[:zero], b[zero:], cones
        self.system = NewtonSystem(A[:zero], A[zero:], cones, backend)

    def start(self) -> Point:
        """Least-squares solutions, moved inside the cones (Vandenberghe, section 7.3)."""
        e = self.cones.identity
        try:
            self.system.factorise(Scaling(self.cones, e, e))
        except (np.linalg.LinAlgError, RuntimeError, ArithmeticError) as error:
            raise SolverError(
                "blockwise: some variables are neither in a cone nor in independent equations; "
                "use another solver"
            ) from error
        x, _, z = self.system.solve(np.zeros_like(self.c), self.f, self.h)
        s = self._inside(-z)
        _, y, z = self.system.solve(-self.c, np.zeros_like(self.f), np.zeros_like(self.h))
        return Point(x, y, self._inside(z), s, 1.0, 1.0)

    def _inside(self, v: FloatArray) -> FloatArray:
        margin = self.cones.margin(v)
        return v if margin > 1e-8 else v + max(0.0, 1.0 - margin) * self.cones.identity

    def residuals(self, at: Point) -> _Residuals:
        system, tau = self.system, at.tau
        rx = system.Et @ at.y + system.Gt @ at.z + self.c * tau
        ry = system.E @ at.x - self.f * tau
        rz = system.G @ at.x + at.s - self.h * tau
        primal, dual = self.objectives(at)
        gap = inner(at.s, at.z)
        complementarity = gap / tau / max(abs(primal), 1e-6 * tau)
        primal_size = max(1.0, largest(at.x) / tau)
        dual_size = max(1.0, largest(at.z) / tau, largest(at.y) / tau)
        missing = largest(rx) / tau / dual_size
        infeasibility = max(max(largest(ry), largest(rz)) / tau / primal_size, missing)
        missing = max(missing, self._lost_power(rx / tau, primal / tau))
        score = complementarity + missing + self._violation(at, ry)
        mu = (gap + tau * at.kappa) / (self.cones.degree + 1)
        rt = at.kappa + primal - dual
        return _Residuals(rx, ry, rz, rt, mu, complementarity, infeasibility, score)

    def _lost_power(self, rx: FloatArray, objective: float) -> float:
        """What the certificate may lose above, relative to the objective.

        It has to open contacts where rates break the flow rule, and the loads f do work on that.
        """
        loads = float(np.abs(self.f).sum()) or 1.0
        return largest(rx) * loads / max(abs(objective), 1e-6)

    def _violation(self, at: Point, ry: FloatArray) -> float:
        """What x itself violates, in mean entries of f.

        Equations count that much because the certificate has to put forces into equilibrium
        again, block by block; s does not count because the certificate does not see it.
        """
        entries = np.abs(self.f[self.f != 0.0])
        unit = float(entries.mean()) if len(entries) else 1.0
        outside = -self.cones.margin(self.h * at.tau - self.system.G @ at.x)
        return (largest(ry) + max(outside, 0.0)) / at.tau / unit

    def objectives(self, at: Point) -> tuple[float, float]:
        """c'x and -f'y - h'z."""
        return inner(self.c, at.x), -inner(self.f, at.y) - inner(self.h, at.z)

    def no_answer(self, at: Point) -> tuple[str, Point] | None:
        """A proof that there is no optimum: a certificate of infeasibility or a ray."""
        if not at.tau < 1e-3 * at.kappa:
            return None
        primal, dual = self.objectives(at)
        system = self.system
        if dual > 0.0 and largest(system.Et @ at.y + system.Gt @ at.z) < _NO_ANSWER * dual:
            return INFEASIBLE, at.over(dual)
        moves = max(largest(system.E @ at.x), largest(system.G @ at.x + at.s))
        if primal < 0.0 and moves < -_NO_ANSWER * primal:
            return UNBOUNDED, at.over(-primal)
        return None


class _Newton:
    """Search directions from one iterate."""

    def __init__(self, program: _Program, at: Point, residuals: _Residuals) -> None:
        self.program, self.at, self.residuals = program, at, residuals
        self.cones = program.cones
        self.scaling = Scaling(program.cones, at.s, at.z)
        program.system.factorise(self.scaling)
        self.lam = self.scaling.lam
        self.fixed = program.system.solve(-program.c, program.f, program.h)
        x, y, z = self.fixed
        self.bottom = -at.kappa / at.tau + self._along(x, y, z)

    def direction(self, share: float, ds: FloatArray, dk: float) -> Point:
        """Removes a share of the residuals and aims at lam o (W dz + W^-1 ds) = ds."""
        at, p, r, times = self.at, self.program, self.residuals, self.scaling.times
        own = times(self.cones.quotient(ds, self.lam))
        x, y, z = p.system.solve(-share * r.x, -share * r.y, -share * r.z - own)
        aim = -share * r.tau - dk / at.tau - self._along(x, y, z)
        tau = float(aim / self.bottom)
        dz = z + tau * self.fixed[2]
        return Point(
            x + tau * self.fixed[0],
            y + tau * self.fixed[1],
            dz,
            own - self.scaling.squared(dz),
            tau,
            (dk - at.kappa * tau) / at.tau,
        )

    def _along(self, x: FloatArray, y: FloatArray, z: FloatArray) -> float:
        p = self.program
        return inner(p.c, x) + inner(p.f, y) + inner(p.h, z)

    def length(self, d: Point) -> float:
        """Step that goes most of the way to the boundary, at most 1."""
        at = self.at
        room = [self.cones.step(at.z, d.z), self.cones.step(at.s, d.s), 1.0 / _REACH]
        room += [-v / dv for v, dv in ((at.tau, d.tau), (at.kappa, d.kappa)) if dv < 0.0]
        return _REACH * min(room)

    def best(self) -> tuple[Point, float]:
        """Predictor, corrector and as many further correctors as pay."""
        at, cones, e = self.at, self.cones, self.cones.identity
        squares, corner = cones.product(self.lam, self.lam), at.kappa * at.tau
        d = self.direction(1.0, -squares, -corner)
        sigma = (1.0 - self.length(d)) ** 3
        goal = sigma * self.residuals.mu
        ds = goal * e - squares - self._product(d.s, d.z)
        dk = goal - corner - d.tau * d.kappa
        d = self.direction(1.0 - sigma, ds, dk)
        step = self.length(d)
        for _ in range(_CORRECTORS):
            if step > _LONG_STEP:
                break
            ahead = at.moved(min(1.0, step + _WIDEN), d)
            ds = ds + self._pull(self._product(ahead.s, ahead.z), goal)
            vk = ahead.tau * ahead.kappa
            dk += max(float(np.clip(vk, _BAND * goal, goal / _BAND)) - vk, -goal / _BAND)
            new = self.direction(1.0 - sigma, ds, dk)
            longer = self.length(new)
            pays = longer >= step + _GAIN * _WIDEN
            if longer > step:
                d, step = new, longer
            if not pays:
                break
        return d, step

    def _product(self, s: FloatArray, z: FloatArray) -> FloatArray:
        return self.cones.product(self.scaling.over(s), self.scaling.times(z))

    def _pull(self, products: FloatArray, goal: float) -> FloatArray:
        """Change that brings outlying complementarity products back into a band."""
        inside = self.cones.clipped(products, _BAND * goal, goal / _BAND)
        result: FloatArray = np.maximum(inside - products, -goal / _BAND)
        return result


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def minimise(
    c: FloatArray,
    A: sp.csr_array,
    b: FloatArray,
    zero: int,
    nonneg: int,
    soc: Sequence[int],
    *,
    tolerance: float,
    max_iter: int,
    backend: str,
) -> Result:
    """Solve min c'x subject to b - A x in {0}^zero x R+^nonneg x SOC x ...

    Iterates until complementarity, relative to the objective, is below the tolerance, or until
    rounding allows no more; the best iterate is returned. "solved" needs complementarity and
    residuals below 1e-8.

    Raises
    ------
    SolverError
        If the cone rows do not fall apart into small blocks.
    """
    start = time.perf_counter()
    program = _Program(c, sp.csr_array(A), b, zero, Cones(nonneg, soc), backend)
    at = program.start()
    best, scores, worst = at, [np.inf], np.inf
    rank = (True, np.inf)  # of the best iterate: is it not solved, and its score
    outcome: tuple[str, Point] | None = None
    for _ in range(max_iter + 1):
        residuals = program.residuals(at)
        if (own := (not residuals.worst < _SOLVED, residuals.score)) < rank:
            best, rank = at.over(at.tau), own
        scores.append(min(scores[-1], residuals.score))
        worst = min(worst, residuals.worst)
        outcome = program.no_answer(at)
        if outcome is not None or _is_done(at, residuals, tolerance, scores, worst < _SOLVED):
            break
        moved = _step(program, at, residuals)
        if moved is None:
            break
        at = moved
    reached = SOLVED if not rank[0] else ALMOST if worst < _ALMOST else STALLED
    status, point = outcome or (reached, best)
    objective = {INFEASIBLE: np.inf, UNBOUNDED: -np.inf}.get(status, float(c @ point.x))
    seconds = time.perf_counter() - start
    return Result(status, point.x, point.y, point.z, point.s, objective, len(scores) - 2, seconds)


def _is_done(
    at: Point, residuals: _Residuals, tolerance: float, scores: list[float], is_solved: bool
) -> bool:
    """As good as asked, or no better for a while and not on the way to a proof of no optimum."""
    if residuals.worst < _SOLVED and residuals.complementarity < tolerance:
        return True
    is_late = is_solved or (residuals.complementarity < _CONVERGED and at.tau > at.kappa)
    return is_late and len(scores) > _PATIENCE and scores[-1] > 0.5 * scores[-1 - _PATIENCE]


def _step(program: _Program, at: Point, residuals: _Residuals) -> Point | None:
    """The next iterate, or None where rounding ends the iteration."""
    try:
        direction, step = _Newton(program, at, residuals).best()
    except (np.linalg.LinAlgError, RuntimeError, ArithmeticError):
        return None
    if not direction.is_finite:
        return None
    cones = program.cones
    while step > _SHORTEST_STEP:
        moved = at.moved(step, direction)
        if min(cones.margin(moved.s), cones.margin(moved.z), moved.tau, moved.kappa) > 0.0:
            return moved
        step *= 0.8
    return None
