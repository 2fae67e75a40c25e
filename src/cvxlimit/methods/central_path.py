"""A path to zero-dilatancy solutions from anywhere: interior points, followed around their folds.

The conditions of a solution (:mod:`~cvxlimit.methods.complementarity`) are relaxed by one number
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

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cvxlimit.arrays import FloatArray
from cvxlimit.methods.complementarity import (
    FrictionSystem,
    Point,
    by_columns,
    elimination_order,
    in_blocks,
    typical,
)
from cvxlimit.solvers import LimitState


@dataclass(frozen=True)
class _Numbers:
    """What each number is for, and where it was measured."""

    spread: float = 0.7
    """Standard deviation of the weights' logarithms. With equal weights the paths of symmetrical
    scenes (dome) meet branches and stop there."""
    ends: float = 1e-06
    """Share of the load factor, and of typical forces and rates, that may be left at the end; the
    polish goes on from there. Below 1e-8 rounding keeps correctors from their aim."""
    near: float = 0.1
    clamp: float = 0.5
    """Relative error of products at which the path is left for the next predictor, and the largest
    relative change by a corrector: with 0.7 and no limit correctors left the path at folds (dome,
    house corner: 4 of 8 paths ended, 7 of 8 so)."""
    longest: float = 2.0
    first: float = 0.5
    shortest: float = 0.0001
    """Largest, first and least change of any product's factor by a predictor, over its size."""
    rests: float = 0.01
    """Largest rest of linear equations, in typical forces and rates, for a predictor."""
    correctors: int = 7
    """Correctors before a predictor is tried again, a quarter as long."""
    air: float = 0.9
    down: float = 0.97
    """Share of the way to the boundary, and of tau, that one step may take."""
    damping: float = 1e-12
    """Added to the diagonal of the stiffness, over typical force by rate: blocks may be loose."""


_N = _Numbers()


@dataclass(frozen=True, eq=False)
class _Weights:
    """r of corners, of shear and of torsion."""

    corner: FloatArray
    shear: FloatArray
    torsion: FloatArray

    @classmethod
    def drawn(cls, random: np.random.Generator, corners: int, contacts: int) -> _Weights:
        sizes = (corners, contacts, contacts)
        return cls(*(np.exp(_N.spread * random.normal(size=size)) for size in sizes))

    @property
    def each(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self.corner, self.shear, self.torsion

    @property
    def total(self) -> float:
        return float(self.corner.sum() + self.shear.sum() + self.torsion.sum())


class CentralPath:
    """Paths of one system.

    Parameters
    ----------
    system : FrictionSystem
    """

    def __init__(self, system: FrictionSystem) -> None:
        self.system = system
        scaled = system.assemblage.scaled
        self.dead, self.live = scaled.dead, scaled.live
        self.rates = system.matrix.T.tocsr()
        self.opening = (system.corner @ self.rates).tocsr()
        self.slip = (system.slid @ self.rates).tocsr()
        self.limit = (system.limit @ system.corner.T).tocsr()
        self.contacts, self.corners = len(scaled.contacts), system.corner.shape[0]
        square = (self.opening.T @ self.opening + self.slip.T @ self.slip).tocsc()
        largest = float(square.diagonal().max())
        self.order = elimination_order((square + largest * sp.eye_array(len(self.dead))).tocsc())
        k, n, m = self.corners, self.contacts, len(self.dead)
        names = ("n", "w", "V1", "V2", "m", "a", "b", "lambda", "u", "alpha", "tau")
        ends = np.cumsum([0, k, k, n, n, n, n, n, n, m, 1, 1])
        self.at = {name: slice(ends[i], ends[i + 1]) for i, name in enumerate(names)}

    def followed(
        self, state: LimitState, width: float, random: np.random.Generator, most: int
    ) -> LimitState:
        """Where a path ends that begins near a state with forces and mechanism.

        Parameters
        ----------
        state : LimitState
        width : float
            How far from it, in typical forces and rates: 1 forgets the state, 0.1 does not.
        random : numpy.random.Generator
            Of the weights.
        most : int
            Steps.
        """
        weights = _Weights.drawn(random, self.corners, self.contacts)
        follower = _Follower(self, self.system.point(state), width, weights)
        return self.system.state(follower.end(most), state)


class _Follower:
    """One path: points are vectors of all unknowns, in the order of :attr:`CentralPath.at`."""

    def __init__(self, path: CentralPath, first: Point, width: float, weights: _Weights) -> None:
        self.path, self.weights = path, weights
        self.force = typical(first.forces)
        self.rate = typical(path.rates @ first.motion)
        self.first = self._inside(first, width)

    def _inside(self, first: Point, width: float) -> FloatArray:
        path, system = self.path, self.path.system
        force, rate = width * self.force, width * self.rate
        pressed = np.maximum(system.corner @ first.forces, 0.0) + force
        friction = (system.slid @ first.forces).reshape(-1, 3)
        slip = (path.slip @ first.motion).reshape(-1, 3)
        shear, twist = np.hypot(friction[:, 0], friction[:, 1]), np.abs(friction[:, 2])
        spare = np.maximum(path.limit @ pressed + system.cohesion - shear - twist, force)
        sliding = np.maximum(np.hypot(slip[:, 0], slip[:, 1]), np.abs(slip[:, 2])) + rate
        opening = np.maximum(path.opening @ first.motion, 0.0) + rate
        parts = (pressed, opening, *friction.T, shear + 0.5 * spare, twist + 0.5 * spare, sliding)
        point = np.concatenate([*parts, first.motion, [first.load_factor, 1.0]])
        point[-1] = sum(float(c.sum()) for c in self._products(point)) / self.weights.total
        return point

    def end(self, most: int) -> Point:
        at, best, least = self.first, self.first, np.inf
        tangent: FloatArray | None = None
        safe, length, tries = at, _N.first, 0
        for _ in range(most):
            error, rest = self._error(at), self._rest(at)
            worth = max(rest, self._gap(at))
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
                    length = min(_N.longest, length * _grown(tries))
                tangent, safe, tries = self._tangent(at, along, tangent), at, 0
                corrector = self._normal(at, corrector, along, tangent)
                at = self._moved(at, self._ahead(at, corrector, tangent, length))
            else:
                at = self._moved(at, self._corrected(at, corrector, along, tangent))
                tries += 1
        return self._point(best)

    # where a point is

    def _part(self, at: FloatArray, name: str) -> FloatArray:
        return at[self.path.at[name]]

    def _slips(self, at: FloatArray) -> FloatArray:
        return np.asarray(self.path.slip @ self._part(at, "u")).reshape(-1, 3)

    def _friction(self, at: FloatArray) -> FloatArray:
        return np.column_stack([self._part(at, name) for name in ("V1", "V2", "m")])

    def _products(self, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        most = self._part(at, "lambda")
        work = self._friction(at) * self._slips(at)
        return (
            self._part(at, "n") * self._part(at, "w"),
            self._part(at, "a") * most + work[:, 0] + work[:, 1],
            self._part(at, "b") * most + work[:, 2],
        )

    def _gap(self, at: FloatArray) -> float:
        return float(sum(c.sum() for c in self._products(at)) / max(abs(at[-2]), self.force))

    def _error(self, at: FloatArray) -> float:
        aims = [at[-1] * r for r in self.weights.each]
        off = [c / aim - 1.0 for c, aim in zip(self._products(at), aims, strict=True)]
        slip, friction = self._slips(at), self._friction(at)
        held = np.column_stack([self._part(at, name) for name in ("a", "a", "b")])
        crossed = held * slip + self._part(at, "lambda")[:, None] * friction
        off += [crossed[:, :2] / aims[1][:, None], crossed[:, 2] / aims[2]]
        return max(float(np.abs(part).max()) for part in off)

    def _linear(self, at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        path, motion = self.path, self._part(at, "u")
        carried = self._part(at, "n") @ path.opening + self._friction(at).ravel() @ path.slip
        limit = path.limit @ self._part(at, "n") + path.system.cohesion
        return (
            carried + path.dead + at[-2] * path.live,
            path.opening @ motion - self._part(at, "w"),
            self._part(at, "a") + self._part(at, "b") - limit,
            float(path.live @ motion) - 1.0,
        )

    def _rest(self, at: FloatArray) -> float:
        balance, opening, limit, power = self._linear(at)
        most = (np.abs(part).max(initial=0.0) for part in (balance, limit, opening))
        units = (self.force, self.force, self.rate)
        return max(abs(power), *(float(m) / u for m, u in zip(most, units, strict=True)))

    def _sizes(self, at: FloatArray) -> FloatArray:
        size = at.copy()
        for name, of in (("V1", "a"), ("V2", "a"), ("m", "b")):
            size[self.path.at[name]] = self._part(at, of)
        size[self.path.at["u"]] = size[self.path.at["alpha"]] = np.inf
        return size

    # ways to go

    def _directions(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        path = self.path
        balance, opening, limit, power = self._linear(at)
        pressed, open_by = self._part(at, "n"), self._part(at, "w")
        share = pressed / open_by
        aim = at[-1] * self.weights.corner - pressed * open_by
        fixed = np.column_stack([aim / open_by - share * opening, self.weights.corner / open_by])
        local = self._local(at, limit)
        pushed = sp.diags_array(share) @ path.opening
        turned = in_blocks(local[:, :3, 2:5]) @ path.slip
        limited = by_columns(local[:, :3, 5]) @ (path.limit @ pushed)
        square = (path.opening.T @ pushed - path.slip.T @ (turned - limited)).tocsc()
        raised = path.limit @ fixed
        own = local[:, :3, :2] + local[:, :3, 5, None] * raised[:, None, :]
        right = path.opening.T @ fixed + path.slip.T @ own.reshape(-1, 2)
        right[:, 0] += balance
        found = self._solved(square, np.column_stack([right, path.live]))
        result = []
        for k, (lacking, rest) in enumerate(((-power, opening), (0.0, 0.0 * opening))):
            factor = (lacking - path.live @ found[:, k]) / (path.live @ found[:, 2])
            motion = found[:, k] + factor * found[:, 2]
            pressing = fixed[:, k] - pushed @ motion
            by = np.zeros((path.contacts, 6))
            by[:, k] = 1.0
            by[:, 2:5] = (path.slip @ motion).reshape(-1, 3)
            by[:, 5] = path.limit @ pressing
            inner = np.einsum("nij,nj->in", local, by)
            parts = (pressing, rest + path.opening @ motion, *inner, motion, [factor, float(k)])
            result.append(np.concatenate(parts))
        return result[0], result[1]

    def _local(self, at: FloatArray, limit: FloatArray) -> FloatArray:
        a, b, most = (self._part(at, name) for name in ("a", "b", "lambda"))
        friction, slip = self._friction(at), self._slips(at)
        matrix, right = np.zeros((2, self.path.contacts, 6, 6))
        _, shear, torsion = self._products(at)
        matrix[:, 0, :2], matrix[:, 0, 3], matrix[:, 0, 5] = slip[:, :2], most, a
        right[:, 0, 0], right[:, 0, 1] = at[-1] * self.weights.shear - shear, self.weights.shear
        right[:, 0, 2:4] = -friction[:, :2]
        for k in (0, 1):
            matrix[:, 1 + k, k] = most
            matrix[:, 1 + k, 3], matrix[:, 1 + k, 5] = slip[:, k], friction[:, k]
            right[:, 1 + k, 0] = -(a * slip[:, k] + most * friction[:, k])
            right[:, 1 + k, 2 + k] = -a
        matrix[:, 3, 2], matrix[:, 3, 4], matrix[:, 3, 5] = slip[:, 2], most, b
        right[:, 3, 0] = at[-1] * self.weights.torsion - torsion
        right[:, 3, 1], right[:, 3, 4] = self.weights.torsion, -friction[:, 2]
        matrix[:, 4, 2], matrix[:, 4, 4], matrix[:, 4, 5] = most, slip[:, 2], friction[:, 2]
        right[:, 4, 0] = -(b * slip[:, 2] + most * friction[:, 2])
        right[:, 4, 4] = -b
        matrix[:, 5, 3] = matrix[:, 5, 4] = right[:, 5, 5] = 1.0
        right[:, 5, 0] = -limit
        return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)

    def _solved(self, square: sp.csc_array, right: FloatArray) -> FloatArray:
        order, path = self.path.order, self.path
        damping = _N.damping * self.force / self.rate
        square = (square + damping * sp.eye_array(len(path.dead))).tocsc()
        factor = splu(
            square[order][:, order].tocsc(),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )

        def solved(part: FloatArray) -> FloatArray:
            result = np.empty_like(part)
            result[order] = factor.solve(part[order])
            return result

        found = solved(right)
        for _ in range(2):
            found = found + solved(right - square @ found)
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
        inside = [(self._part(at, name), self._part(step, name)) for name in ("n", "w")]
        inside += self._spare(at, step)
        for held, of in (("b", 2), ("lambda", None)):
            value = self._part(at, "m") if of else self._slips(at)[:, 2]
            change = self._part(step, "m") if of else self._slips(step)[:, 2]
            room, more = self._part(at, held), self._part(step, held)
            inside += [(room - value, more - change), (room + value, more + change)]
        shrinking = max(float(np.max(-change / value)) for value, change in inside)
        return 1.0 / max(shrinking, 1e-9) if np.isfinite(shrinking) else 0.0

    def _spare(self, at: FloatArray, step: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
        result = []
        for held, vectors, changes in (
            ("a", self._friction(at)[:, :2], self._friction(step)[:, :2]),
            ("lambda", self._slips(at)[:, :2], self._slips(step)[:, :2]),
        ):
            size = np.hypot(*vectors.T)
            growth = (vectors * changes).sum(axis=1) / np.where(size > 0.0, size, 1.0)
            result.append((self._part(at, held) - size, self._part(step, held) - growth))
        return result

    def _moved(self, at: FloatArray, step: FloatArray) -> FloatArray:
        result = at + step
        vectors = (self._friction(result)[:, :2], self._slips(result)[:, :2])
        kept = self._spare(at, step)
        for name, vector, (spare, change) in zip(("a", "lambda"), vectors, kept, strict=True):
            size, value = np.hypot(*vector.T), self._part(result, name)
            distance = spare + change
            near = value - size < 0.5 * distance
            result[self.path.at[name]] = np.where(near, size + distance, value)
        return result

    def _point(self, at: FloatArray) -> Point:
        system = self.path.system
        friction = self._friction(at).ravel()
        forces = system.corner.T @ self._part(at, "n") + system.slid.T @ friction
        return Point(np.asarray(forces), self._part(at, "u"), float(at[-2]))


def _grown(correctors: int) -> float:
    return 1.7 if correctors <= 1 else 1.0 if correctors <= 3 else 0.5
