"""Zero dilatancy as equations: one system whose roots are its solutions, and Newton's way there.

Every contact, in forces and rates of like size, is at a root of

    n = max(n - opening, 0)                      at every corner,
    t = projection of (t - slip) on the forces that sliding allows,

with t = (V1, V2, MT / c_T), slip = (slip_1, slip_2, c_T twist), and the t of Eq. 24 as what sliding
allows (Alart and Curnier's equations): pressed corners do not open, and friction opposes slip.
With equilibrium and live power 1 that is as many equations as unknowns, piecewise smooth, and often
singular, for forces are statically indeterminate: hence Levenberg and Marquardt's damping. Near a
solution it squares the residual in every step; far away it gets stuck.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.statics import DOF
from cvxlimit.solvers import LimitState
from cvxlimit.solvers.sparse import factorised
from cvxlimit.surfaces import Conic, YieldSurface
from cvxlimit.surfaces.coulomb import Rocking, TorsionShear

_SLIDING = ("V1", "V2", "MT")


@dataclass(frozen=True)
class _Numbers:
    """What each number is for, and where it was measured."""

    steps: int = 25
    """Most steps of one polish; where it converges, 5 to 20 are enough."""
    tries: int = 6
    """Dampings tried for a step that must make residuals smaller, each 8 times the last."""
    damping: float = 0.001
    least_damping: float = 1e-10
    factor: float = 8.0
    rounding: float = 1e-13
    """Least damping over the largest diagonal entry: with less, rounding made matrices indefinite,
    and SuperLU's symmetric mode, which does not pivot, did not return."""
    slow: float = 0.7
    patience: int = 3
    """Steps that leave more than this share of the squared residual are slow; so many end the
    polish: on the tuff wall and the panel S12 they did not recover."""
    exact: float = 1e-24
    """Sum of squared residuals, in typical forces and rates, where rounding begins."""


_N = _Numbers()


def has_equations(surfaces: Sequence[YieldSurface]) -> bool:
    """True for the surfaces whose sliding this module states: rocking, and the cone of Eq. 24."""
    return {type(surface) for surface in surfaces} == {Rocking, TorsionShear} and all(
        isinstance(surface.cone, Conic) for surface in surfaces
    )


@dataclass(frozen=True, eq=False)
class Point:
    """Internal forces (p,), torsion over its arm, block rates (6 free,) and load factor."""

    forces: FloatArray
    motion: FloatArray
    load_factor: float

    def moved(self, step: FloatArray) -> Point:
        """After a step (p + 6 free + 1,)."""
        p, m = len(self.forces), len(self.motion)
        return Point(
            self.forces + step[:p],
            self.motion + step[p : p + m],
            self.load_factor + float(step[p + m]),
        )


@dataclass(frozen=True, eq=False)
class Projected:
    """Nearest allowed t (n, 3), and its derivatives by t (n, 3, 3) and by the limit (n, 3)."""

    value: FloatArray
    by_force: FloatArray
    by_limit: FloatArray


def projected(force: FloatArray, limit: FloatArray) -> Projected:
    """Of (n, 3) on abs(V) + abs(m) <= limit: of the point (abs(V), abs(m)) on a triangle.

    >>> projected(np.array([[3.0, 4.0, 0.0]]), np.array([1.0])).value.tolist()
    [[0.6, 0.8, 0.0]]
    """
    shear, sign = np.hypot(force[:, 0], force[:, 1]), np.sign(force[:, 2])
    twist, most = np.abs(force[:, 2]), np.maximum(limit, 0.0)
    along = force[:, :2] / np.where(shear > 0.0, shear, 1.0)[:, None]
    over = 0.5 * (shear + twist - most)
    inside = over <= 0.0
    turns = ~inside & (over >= shear)
    slides = ~inside & ~turns & (over >= twist)
    both = ~(inside | turns | slides)
    cases = [inside, turns, slides]
    new_shear = np.select(cases, [shear, np.zeros_like(most), most], shear - over)
    new_twist = np.select(cases, [twist, most, np.zeros_like(most)], twist - over)
    half, grows = 0.5 * both, (limit > 0.0).astype(float)
    radial, cross = inside + half, -half
    ratio = np.where(shear > 0.0, new_shear / np.where(shear > 0.0, shear, 1.0), inside)
    outer = along[:, :, None] * along[:, None, :]
    by_force = np.zeros((len(force), 3, 3))
    by_force[:, :2, :2] = radial[:, None, None] * outer
    by_force[:, :2, :2] += ratio[:, None, None] * (np.eye(2) - outer)
    by_force[:, :2, 2] = by_force[:, 2, :2] = (cross * sign)[:, None] * along
    by_force[:, 2, 2] = inside + half
    by_limit = np.column_stack(
        [(grows * (slides + half))[:, None] * along, grows * (turns + half) * sign]
    )
    value = np.column_stack([new_shear[:, None] * along, new_twist * sign])
    return Projected(value, by_force, by_limit)


class FrictionSystem:
    """The equations of one assemblage, and their polish.

    Parameters
    ----------
    assemblage : Assemblage
        Its contacts with corner compressions, torsion-shear on the line of Eq. 24.
    """

    def __init__(self, assemblage: Assemblage) -> None:
        self.assemblage = assemblage
        scaled = assemblage.scaled
        self.model = corner_compressions(scaled.contacts)
        start = self.model.start
        n, corners = len(scaled.contacts), len(scaled.contacts.corner_contact)
        self.arm = np.ones(self.model.meaning.shape[1])
        self.arm[start["MT"]] = scaled.contacts.torsion_arm
        self.matrix = (scaled.matrix @ self.model.meaning @ sp.diags_array(self.arm)).tocsr()
        p = self.matrix.shape[1]
        pressed = np.arange(start["n"].start, start["n"].stop)
        self.corner = _selection(pressed, p)
        slid = np.stack([np.arange(start[k].start, start[k].stop) for k in _SLIDING], axis=1)
        self.slid = _selection(slid.ravel(), p)
        at = scaled.contacts.corner_contact
        normal = sp.csr_array((np.ones(corners), (at, np.arange(corners))), shape=(n, corners))
        self.limit = (sp.diags_array(scaled.contacts.friction) @ normal @ self.corner).tocsr()
        units = assemblage.scaling
        self.cohesion = assemblage.contacts.cohesion * assemblage.contacts.area / units.force

    def polished(self, state: LimitState) -> LimitState:
        """The root near a state with forces and mechanism, or as near to one as Newton gets.

        Only :class:`~cvxlimit.methods.zero_dilatancy.Verifier` tells which it is.
        """
        equations = _Equations(self, self.point(state))
        return self.state(equations.solved(), state)

    def scaled_forces(self, state: LimitState) -> FloatArray:
        """Internal forces (p,) in the units of the scaling, torsion over its arm."""
        units = self.assemblage.scaling
        size = np.where(self.model.is_moment, units.length, 1.0) * units.force
        return np.asarray(state.internal) / size / self.arm

    def point(self, state: LimitState) -> Point:
        """A state with forces and mechanism, in the units of the scaling."""
        if state.mechanism is None or state.load_factor is None:
            raise ValueError("a state without mechanism cannot be polished")
        units = self.assemblage.scaling
        rows = np.tile([1.0, 1.0, 1.0] + [units.length] * 3, len(state.mechanism))
        motion = state.mechanism.ravel() * units.live * rows
        power = float(self.assemblage.scaled.live @ motion)
        return Point(
            self.scaled_forces(state),
            motion / power,
            state.load_factor * units.live / units.force,
        )

    def state(self, point: Point, state: LimitState) -> LimitState:
        """A point as a state, with all else from ``state``."""
        units = self.assemblage.scaling
        inner = point.forces * self.arm
        size = np.where(self.model.is_moment, units.length, 1.0) * units.force
        return replace(
            state,
            load_factor=units.load_factor(point.load_factor),
            forces=units.forces((self.model.meaning @ inner).reshape(-1, len(COLUMN))),
            mechanism=units.mechanism(point.motion.reshape(-1, DOF)),
            internal=inner * size,
        )


class _Equations:
    """Of a :class:`FrictionSystem`, in units of the typical force and rate of a first point."""

    def __init__(self, system: FrictionSystem, first: Point) -> None:
        self.system, self.first = system, first
        scaled = system.assemblage.scaled
        self.dead, self.live = scaled.dead, scaled.live
        self.force = typical(first.forces)
        self.rate = typical(system.matrix.T @ first.motion)
        self.ratio = self.force / self.rate
        columns = (
            np.full(len(first.forces), self.force),
            np.full(len(first.motion), float(np.abs(first.motion).mean()) or 1.0),
            [max(abs(first.load_factor), self.force)],
        )
        self.columns = np.concatenate(columns)
        self._order: IntArray | None = None
        self._rates = system.matrix.T.tocsr()
        self._opening = (system.corner @ self._rates).tocsr()
        self._slip = (system.slid @ self._rates).tocsr()

    def solved(self) -> Point:
        at, damping, slow = self.first, _N.damping, 0
        rest = self.residual(at)
        for _ in range(_N.steps):
            size = float(rest @ rest)
            if size <= _N.exact or slow >= _N.patience:
                break
            jacobian = self._jacobian(at)
            square, down = (jacobian.T @ jacobian).tocsc(), jacobian.T @ rest
            for _ in range(_N.tries):
                weight = damping * min(1.0, float(np.sqrt(size / len(rest))))
                step = self._damped(square, weight, down)
                if step is None:
                    return at
                trial = at.moved(-self.columns * step)
                new = self.residual(trial)
                if float(new @ new) < size:
                    break
                damping *= _N.factor
            else:
                break
            slow = slow + 1 if float(new @ new) > _N.slow * size else 0
            at, rest, damping = trial, new, max(damping / _N.factor, _N.least_damping)
        return at

    def _damped(self, square: sp.csc_array, weight: float, down: FloatArray) -> FloatArray | None:
        """The step with (square + weight) step = down; None where rounding makes that singular."""
        largest = float(square.diagonal().max())
        if not np.isfinite(largest):
            return None
        each = sp.eye_array(len(down))
        if self._order is None:
            self._order = elimination_order((square + largest * each).tocsc())
        matrix = (square + max(weight, _N.rounding * largest) * each).tocsc()
        ordered = matrix[self._order][:, self._order].tocsc()
        step = np.empty_like(down)
        try:
            step[self._order] = factorised(ordered)(down[self._order])
        except RuntimeError:
            return None
        return step

    def residual(self, at: Point) -> FloatArray:
        balance = self.system.matrix @ at.forces + self.dead + at.load_factor * self.live
        power = (float(self.live @ at.motion) - 1.0) * self.force
        pressed = self.system.corner @ at.forces
        opening = self.ratio * (self._opening @ at.motion)
        corner = pressed - np.maximum(pressed - opening, 0.0)
        friction, limit, trial = self._sliding(at)
        slid = friction - projected(trial, limit).value
        return np.concatenate([balance, [power], corner, slid.ravel()]) / self.force

    def _sliding(self, at: Point) -> tuple[FloatArray, FloatArray, FloatArray]:
        friction = (self.system.slid @ at.forces).reshape(-1, 3)
        slip = (self._slip @ at.motion).reshape(-1, 3)
        limit = self.system.limit @ at.forces + self.system.cohesion
        return friction, limit, friction - self.ratio * slip

    def _jacobian(self, at: Point) -> sp.csr_array:
        system, live = self.system, self.live
        pressed = system.corner @ at.forces - self.ratio * (self._opening @ at.motion) > 0.0
        _, limit, trial = self._sliding(at)
        found = projected(trial, limit)
        by_trial = in_blocks(found.by_force)
        by_limit = by_columns(found.by_limit)
        sliding = system.slid - by_trial @ system.slid - by_limit @ system.limit
        rows = [
            [system.matrix, None, sp.csr_array(live[:, None])],
            [None, sp.csr_array(self.force * live[None, :]), None],
            [_rows(~pressed) @ system.corner, self.ratio * (_rows(pressed) @ self._opening), None],
            [sliding, self.ratio * (by_trial @ self._slip), None],
        ]
        matrix = sp.block_array(rows, format="csr")
        return (matrix @ sp.diags_array(self.columns / self.force)).tocsr()


def elimination_order(matrix: sp.csc_array) -> IntArray:
    """Of minimum degree, as SuperLU finds it; the pattern is that of all steps."""
    symmetric = {"SymmetricMode": True}
    factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    return np.argsort(factor.perm_c)


def typical(values: FloatArray) -> float:
    """Root of the mean square; 1 where all are zero."""
    return float(np.sqrt(np.mean(values**2))) or 1.0


def _selection(chosen: IntArray, width: int) -> sp.csr_array:
    k = len(chosen)
    return sp.csr_array((np.ones(k), (np.arange(k), chosen)), shape=(k, width))


def _rows(kept: NDArray[np.bool_]) -> sp.dia_array:
    return sp.diags_array(kept.astype(float))


def in_blocks(blocks: FloatArray) -> sp.csr_array:
    """Block diagonal (3 n, 3 n) of (n, 3, 3)."""
    n = len(blocks)
    return sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()


def by_columns(blocks: FloatArray) -> sp.csr_array:
    """(3 n, n) of (n, 3)."""
    n = len(blocks)
    index = (np.arange(3 * n), np.repeat(np.arange(n), 3))
    return sp.csr_array((blocks.ravel(), index), shape=(3 * n, n))
