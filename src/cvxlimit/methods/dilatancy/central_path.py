"""A path to zero-dilatancy solutions from anywhere: interior points, followed around their folds.

The conditions of a solution, in :mod:`~cvxlimit.methods.dilatancy.complementarity`, are relaxed by
tau: every corner presses and opens with n w = r tau, and every contact slides and turns with

    (a, V) o (lambda, slip) = (r tau, 0),    (b, m) o (lambda, c_T twist) = (r tau, 0),
    a + b = c A + mu N,

o the product of the second-order cone: for tau = 0 friction opposes slip at its limit. With random
weights r, of size 1, there is one path of such points from large tau on; it ends at a solution or
leaves for infinity. As nothing is convex without dilatancy, tau must grow again now and then, so
the path is followed by its arc length: tau is an unknown, and corrections are normal to the path.
Where a slip turns, its cone leaves room for small steps only; norms are therefore carried along.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.methods.dilatancy.complementarity import FrictionSystem, Point, in_blocks, typical
from cvxlimit.solvers import LimitState
from cvxlimit.solvers.sparse import symmetric_lu


@dataclass(frozen=True)
class _Numbers:
    """Of one path, in typical forces and rates."""

    steps: int = 400  # at most; of paths that arrive most need 80 to 360
    # standard deviation of the weights' logarithms: with equal ones the paths of symmetrical scenes
    # meet branches and stop there
    spread: float = 0.7
    # what may be left at the end, where the polish goes on: below 1e-8 rounding keeps correctors
    # from their aim
    ends: float = 1e-06
    # error of products at which the next predictor leaves, and the largest change by a corrector:
    # with more, correctors leave the path at folds
    near: float = 0.1
    clamp: float = 0.5
    longest: float = 2.0  # change of any product's factor by a predictor, over its size,
    first: float = 0.5
    shortest: float = 0.0001
    rests: float = 0.01  # largest rest of linear equations for a predictor
    correctors: int = 7  # before a predictor is tried again, a quarter as long
    air: float = 0.9  # share of the way to the boundary that one step may take,
    down: float = 0.97  # and of tau
    damping: float = 1e-12  # of the stiffness: blocks may be loose


_N = _Numbers()

_GROUPS = ((0, 3, (0, 1)), (3, 4, (2,)))
"""Shear and torsion among a contact's six unknowns V1, V2, m, a, b, lambda: the first row of their
equations, the unknown that holds them, and their own."""


def followed(
    system: FrictionSystem, state: LimitState, width: float, random: np.random.Generator
) -> LimitState:
    """Where a path ends that begins near a state with forces and mechanism.

    ``width`` is how far from it, in typical forces and rates: 1 forgets the state, 0.1 does not.
    ``random`` draws the weights.
    """
    size = system.opening.shape[0] + 2 * len(system.cohesion)
    weights = np.exp(_N.spread * random.normal(size=size))
    return system.state(_Follower(system, system.point(state), width, weights).end(), state)


class _At(NamedTuple):
    """What a vector of all unknowns holds, in its order: n, w (k,); V1, V2, m, a, b, lambda (n, 6);
    rates (6 free,); load factor and tau. And the slips (n, 3) of these rates."""

    pressed: FloatArray
    open: FloatArray
    local: FloatArray
    motion: FloatArray
    load_factor: float
    tau: float
    slip: FloatArray


class _Follower:
    def __init__(
        self, system: FrictionSystem, first: Point, width: float, weights: FloatArray
    ) -> None:
        self.system, self.weights = system, weights
        n, k = len(first.friction), len(first.pressed)
        self.ends = np.cumsum([k, k, 6 * n, len(first.motion), 1])
        self.kinds = np.cumsum([k, n])
        """Ends of corners and shear among products and their weights; torsion follows."""
        motion = first.motion
        self.force = typical(np.append(first.pressed, first.friction))
        self.rate = typical(np.append(system.opening @ motion, system.slip @ motion))
        self.first = self._inside(first, width * self.force, width * self.rate)

    def _inside(self, first: Point, force: float, rate: float) -> FloatArray:
        system, friction = self.system, first.friction
        pressed = np.maximum(first.pressed, 0.0) + force
        slip = (system.slip @ first.motion).reshape(-1, 3)
        shear, twist = np.hypot(friction[:, 0], friction[:, 1]), np.abs(friction[:, 2])
        spare = np.maximum(system.limit @ pressed + system.cohesion - shear - twist, force)
        sliding = np.maximum(np.hypot(slip[:, 0], slip[:, 1]), np.abs(slip[:, 2])) + rate
        opening = np.maximum(system.opening @ first.motion, 0.0) + rate
        held = (shear + 0.5 * spare, twist + 0.5 * spare, sliding)
        local = np.column_stack([friction, *held])
        parts = (pressed, opening, local.ravel(), first.motion, [first.load_factor, 1.0])
        point = np.concatenate(parts)
        point[-1] = float(self._products(point).sum()) / float(self.weights.sum())
        return point

    def end(self) -> Point:
        at, best, least = self.first, self.first, np.inf
        tangent: FloatArray | None = None
        safe, length, tries = at, _N.first, 0
        for _ in range(_N.steps):
            error, rest = self._error(at), self._rest(at)
            gap = float(self._products(at).sum()) / max(abs(self._read(at).load_factor), self.force)
            worth = max(rest, gap)
            if worth < least:
                best, least = at, worth
            if worth < _N.ends or length < _N.shortest:
                break
            if tangent is not None and tries > _N.correctors:
                at, length, tries = safe, 0.25 * length, 0
                at = self._moved(at, self._ahead(at, np.zeros(len(at)), tangent, length))
                continue
            try:
                corrector, along = self._directions(at)
            except (RuntimeError, np.linalg.LinAlgError):  # rounding made a matrix singular
                break
            if error < _N.near and rest < _N.rests:
                if tangent is not None:
                    grown = 1.7 if tries <= 1 else 1.0 if tries <= 3 else 0.5
                    length = min(_N.longest, length * grown)
                tangent, safe, tries = self._tangent(at, along, tangent), at, 0
                corrector = self._normal(at, corrector, along, tangent)
                at = self._moved(at, self._ahead(at, corrector, tangent, length))
            else:
                at = self._moved(at, self._corrected(at, corrector, along, tangent))
                tries += 1
        end = self._read(best)
        return Point(end.pressed, end.local[:, :3], end.motion, end.load_factor)

    # where a point is

    def _read(self, at: FloatArray) -> _At:
        pressed, opening, local, motion, factor, tau = np.split(at, self.ends)
        slip, local = (self.system.slip @ motion).reshape(-1, 3), local.reshape(-1, 6)
        return _At(pressed, opening, local, motion, float(factor[0]), float(tau[0]), slip)

    def _products(self, at: FloatArray) -> FloatArray:
        pressed, opening, local, *_, slip = self._read(at)
        work = local[:, :3] * slip
        shear, torsion = (local[:, 3:5] * local[:, 5:]).T
        parts = (pressed * opening, shear + work[:, 0] + work[:, 1], torsion + work[:, 2])
        return np.concatenate(parts)

    def _error(self, at: FloatArray) -> float:
        now = self._read(at)
        aim = now.tau * self.weights
        _, shear, torsion = np.split(aim, self.kinds)
        crossed = now.local[:, [3, 3, 4]] * now.slip + now.local[:, 5:] * now.local[:, :3]
        crossed = crossed / np.column_stack([shear, shear, torsion])
        return max(
            float(np.abs(self._products(at) / aim - 1.0).max()), float(np.abs(crossed).max())
        )

    def _linear(self, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        system, (pressed, opening, local, motion, factor, *_) = self.system, self._read(at)
        carried = pressed @ system.opening + local[:, :3].ravel() @ system.slip
        return (
            carried + system.dead + factor * system.live,
            system.opening @ motion - opening,
            local[:, 3] + local[:, 4] - (system.limit @ pressed + system.cohesion),
            float(system.live @ motion) - 1.0,
        )

    def _rest(self, at: FloatArray) -> float:
        balance, opening, limit, power = self._linear(at)
        most = (np.abs(part).max(initial=0.0) for part in (balance, limit, opening))
        units = (self.force, self.force, self.rate)
        return max(abs(power), *(float(m) / u for m, u in zip(most, units, strict=True)))

    def _sizes(self, at: FloatArray) -> FloatArray:
        _, begin, end, last, _ = self.ends
        size, local = at.copy(), self._read(at).local.copy()
        local[:, :3] = local[:, [3, 3, 4]]
        size[begin:end], size[end : last + 1] = local.ravel(), np.inf
        return size

    # ways to go

    def _directions(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        system, (pressed, open_by, *_, tau, _) = self.system, self._read(at)
        balance, opening, limit, power = self._linear(at)
        weights = self.weights[: len(pressed)]
        share = pressed / open_by
        aim = tau * weights - pressed * open_by
        fixed = np.column_stack([aim / open_by - share * opening, weights / open_by])
        local = self._local(at, limit)
        pushed = sp.diags_array(share) @ system.opening
        turned = in_blocks(local[:, :3, 2:5]) @ system.slip
        limited = in_blocks(local[:, :3, 5:]) @ (system.limit @ pushed)
        square = (system.opening.T @ pushed - system.slip.T @ (turned - limited)).tocsc()
        raised = np.asarray(system.limit @ fixed)
        own = local[:, :3, :2] + local[:, :3, 5, None] * raised[:, None, :]
        right = np.asarray(system.opening.T @ fixed + system.slip.T @ own.reshape(-1, 2))
        right[:, 0] += balance
        found = self._solved(square, np.column_stack([right, system.live]))
        result: list[FloatArray] = []
        for k, (lacking, rest) in enumerate(((-power, opening), (0.0, 0.0 * opening))):
            factor = float((lacking - system.live @ found[:, k]) / (system.live @ found[:, 2]))
            motion = found[:, k] + factor * found[:, 2]
            pressing = fixed[:, k] - pushed @ motion
            by = np.zeros((len(local), 6))
            by[:, k] = 1.0
            by[:, 2:5] = (system.slip @ motion).reshape(-1, 3)
            by[:, 5] = system.limit @ pressing
            inner = np.einsum("nij,nj->ni", local, by).ravel()
            ends = np.array([factor, float(k)])
            parts = (pressing, rest + system.opening @ motion, inner, motion, ends)
            result.append(np.concatenate(parts))
        return result[0], result[1]

    def _local(self, at: FloatArray, limit: FloatArray) -> FloatArray:
        """What contacts' unknowns (n, 6) are, as (n, 6, 6) on: 1, tau, slips and the limit."""
        now = self._read(at)
        most, slip = now.local[:, 5], now.slip
        matrix, right = np.zeros((2, len(slip), 6, 6))
        products, weights = (
            np.split(x, self.kinds)[1:] for x in (self._products(at), self.weights)
        )
        for (row, held, own), product, weight in zip(_GROUPS, products, weights, strict=True):
            by = now.local[:, held]
            matrix[:, row, held], matrix[:, row, 5] = most, by
            right[:, row, 0], right[:, row, 1] = now.tau * weight - product, weight
            for i, k in enumerate(own, row + 1):
                force, slid = now.local[:, k], slip[:, k]
                matrix[:, row, k], right[:, row, 2 + k] = slid, -force
                matrix[:, i, k], matrix[:, i, held], matrix[:, i, 5] = most, slid, force
                right[:, i, 0], right[:, i, 2 + k] = -(by * slid + most * force), -by
        matrix[:, 5, 3] = matrix[:, 5, 4] = right[:, 5, 5] = 1.0
        right[:, 5, 0] = -limit
        return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)

    def _solved(self, square: sp.csc_array, right: FloatArray) -> FloatArray:
        damping = _N.damping * self.force / self.rate
        square = (square + damping * sp.eye_array(len(right))).tocsc()
        solve, found = symmetric_lu(square, "MMD_AT_PLUS_A"), np.zeros_like(right)
        for _ in range(3):
            found += solve(right - square @ found)
        return found

    def _tangent(self, at: FloatArray, along: FloatArray, last: FloatArray | None) -> FloatArray:
        size = self._sizes(at)
        ahead = -1.0 if last is None else float(np.sign((along / size) @ (last / size)) or -1.0)
        return ahead * along / float(np.linalg.norm(along / size))

    def _normal(
        self, at: FloatArray, corrector: FloatArray, along: FloatArray, tangent: FloatArray
    ) -> FloatArray:
        by = tangent / self._sizes(at) ** 2
        return corrector - (by @ corrector) / (by @ along) * along

    def _corrected(
        self, at: FloatArray, corrector: FloatArray, along: FloatArray, tangent: FloatArray | None
    ) -> FloatArray:
        if tangent is None:
            return min(1.0, _N.air * self._reach(at, corrector)) * corrector
        step = self._normal(at, corrector, along, tangent)
        change = float(np.abs(step[:-1] / self._sizes(at)[:-1]).max())
        share = min(1.0, _N.air * self._reach(at, step), _N.clamp / max(change, _N.clamp))
        return share * step

    def _ahead(
        self, at: FloatArray, corrector: FloatArray, tangent: FloatArray, length: float
    ) -> FloatArray:
        change = (tangent / self._sizes(at))[:-1]
        most = float(np.abs(change).max() if length < _N.air else change.max())
        h = length / max(most, 1e-9)
        if corrector[-1] + h * tangent[-1] < -_N.down * at[-1]:
            h = max(0.0, (-_N.down * at[-1] - corrector[-1]) / tangent[-1])
        while h > 0.0 and self._reach(at, corrector + h * tangent) < 1.0 / _N.down:
            h = 0.6 * h if h > 1e-9 else 0.0
        return corrector + h * tangent

    def _reach(self, at: FloatArray, step: FloatArray) -> float:
        now, change = self._read(at), self._read(step)
        inside = [(now.pressed, change.pressed), (now.open, change.open), *_spare(now, change)]
        twists = ((now.local, change.local), (now.slip, change.slip))
        for held, (value, more) in zip((4, 5), twists, strict=True):
            room, grows = now.local[:, held], change.local[:, held]
            inside += [(room + sign * value[:, 2], grows + sign * more[:, 2]) for sign in (-1, 1)]
        with np.errstate(all="ignore"):  # on the boundary, to rounding, there is no room at all
            shares = [-more / value for value, more in inside]
        shrinking = max(float(np.nanmax(share, initial=0.0)) for share in shares)
        return 1.0 / max(shrinking, 1e-9) if np.isfinite(shrinking) else 0.0

    def _moved(self, at: FloatArray, step: FloatArray) -> FloatArray:
        """After a step; where shear or slip turned, a and lambda keep what room the step meant."""
        result = at + step
        _, _, local, *_, slip = self._read(result)  # local is a view: writes go into the result
        kept = _spare(self._read(at), self._read(step))
        for held, vector, (spare, change) in zip((3, 5), (local, slip), kept, strict=True):
            size, distance = np.hypot(*vector[:, :2].T), spare + change
            near = local[:, held] - size < 0.5 * distance
            local[near, held] = (size + distance)[near]
        return result


def _spare(now: _At, change: _At) -> list[tuple[FloatArray, FloatArray]]:
    """Room of shear below a and of slip below lambda, and by how much a step changes it."""
    result = []
    for held, vector, more in ((3, now.local, change.local), (5, now.slip, change.slip)):
        size = np.hypot(*vector[:, :2].T)
        growth = (vector[:, :2] * more[:, :2]).sum(axis=1) / np.where(size > 0.0, size, 1.0)
        result.append((now.local[:, held] - size, change.local[:, held] - growth))
    return result
