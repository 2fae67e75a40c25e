"""Zero dilatancy as equations: one system whose roots are its solutions, and Newton's way there.

Every contact, in forces and rates of like size, is at a root of

    n = max(n - opening, 0)                      at every corner,
    t = projection of (t - slip) on the forces that sliding allows,

with t = (V1, V2, MT / c_T), slip = (slip_1, slip_2, c_T twist), and the t of Eq. 24 as what sliding
allows (Alart and Curnier's equations). With equilibrium and live power 1 that is as many equations
as unknowns, often singular, for forces are statically indeterminate: hence Levenberg and
Marquardt's damping. Near a solution it squares the residual in every step; far away it gets stuck.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.statics import DOF
from cvxlimit.solvers import LimitState
from cvxlimit.solvers.sparse import symmetric_lu
from cvxlimit.surfaces import Conic, YieldSurface
from cvxlimit.surfaces.coulomb import Rocking, TorsionShear


@dataclass(frozen=True)
class _Numbers:
    """Of one polish, in typical forces and rates."""

    steps: int = 25  # at most; where it converges, 5 to 20 are enough
    tries: int = 6  # dampings tried for a step that must make residuals smaller,
    factor: float = 8.0  # each so many times the last
    damping: float = 0.001  # at first
    least_damping: float = 1e-10
    # least damping over the largest diagonal entry: with less, rounding makes matrices indefinite,
    # and SuperLU, which does not pivot, may not return
    rounding: float = 1e-13
    slow: float = 0.7  # share of the squared residual that a slow step leaves at least;
    patience: int = 3  # so many of them end it
    exact: float = 1e-24  # sum of squared residuals where rounding begins


_N = _Numbers()


def has_equations(surfaces: Sequence[YieldSurface]) -> bool:
    """True for the surfaces whose sliding this module states: rocking, and the cone of Eq. 24."""
    return {type(surface) for surface in surfaces} == {Rocking, TorsionShear} and all(
        isinstance(surface.cone, Conic) for surface in surfaces
    )


class Point(NamedTuple):
    """Corner compressions (k,), friction (n, 3), block rates (6 free,) and load factor, scaled."""

    pressed: FloatArray
    friction: FloatArray
    motion: FloatArray
    load_factor: float


class FrictionSystem:
    """Contacts with corner compressions and friction on the line of Eq. 24, scaled, torsion over
    its arm. ``opening`` (k, 6 free) and ``slip`` (3 n, 6 free) give rates at corners and contacts,
    transposed what forces do to blocks; ``limit`` (n, k) is the friction that compressions allow
    besides ``cohesion`` (n,).
    """

    def __init__(self, assemblage: Assemblage) -> None:
        self.assemblage, contacts, units = assemblage, assemblage.contacts, assemblage.scaling
        self.dead, self.live = assemblage.scaled.dead, assemblage.scaled.live
        self.model = corner_compressions(contacts)
        start, number = self.model.start, np.arange(self.model.meaning.shape[1])
        self._corners = number[start["n"]]
        self._friction = np.stack([number[start[c]] for c in ("V1", "V2", "MT")], axis=1)
        arm = np.ones(len(number))
        arm[start["MT"]] = contacts.torsion_arm
        self._unit = units.force * arm
        self._lengths = np.tile([1.0] * 3 + [units.length] * 3, len(self.live) // DOF)
        works = assemblage.statics.matrix @ self.model.meaning @ sp.diags_array(arm)
        rates = (sp.diags_array(1.0 / self._lengths) @ works).T.tocsr()
        self.opening, self.slip = rates[self._corners], rates[self._friction.ravel()]
        at = contacts.corner_contact
        self.limit = sp.csr_array((contacts.friction[at], (at, np.arange(len(at)))))
        self.cohesion = contacts.cohesion * contacts.area / units.force

    def point(self, state: LimitState) -> Point:
        """A state with forces and mechanism, the latter scaled to live power 1."""
        if state.mechanism is None or state.load_factor is None or state.internal is None:
            raise ValueError("a state without mechanism cannot be polished")
        units, forces = self.assemblage.scaling, state.internal / self._unit
        motion = state.mechanism.ravel() * self._lengths
        motion = motion / float(self.live @ motion)
        factor = state.load_factor * units.live / units.force
        return Point(forces[self._corners], forces[self._friction], motion, factor)

    def state(self, point: Point, state: LimitState) -> LimitState:
        units, internal = self.assemblage.scaling, np.empty(len(self._unit))
        internal[self._corners], internal[self._friction] = point.pressed, point.friction
        internal *= self._unit
        return replace(
            state,
            load_factor=units.load_factor(point.load_factor),
            forces=self.model.forces(internal),
            mechanism=units.mechanism(point.motion.reshape(-1, DOF)),
            internal=internal,
        )

    def polished(self, state: LimitState) -> LimitState:
        """The root near a state with forces and mechanism, or as near to one as Newton gets."""
        return self.state(_Newton(self, self.point(state)).solved(), state)


class _Newton:
    """Vectors are compressions, friction, rates and load factor, one after the other."""

    def __init__(self, system: FrictionSystem, first: Point) -> None:
        self.system = system
        self.force = typical(np.append(first.pressed, first.friction))
        self.ratio = self.force / typical(
            np.append(system.opening @ first.motion, system.slip @ first.motion)
        )
        self.first = np.concatenate([part.ravel() for part in first[:3]] + [[first.load_factor]])
        self.ends = np.cumsum([len(first.pressed), first.friction.size, len(first.motion)])
        self.columns = np.full(len(self.first), self.force)
        self.columns[self.ends[1] : self.ends[2]] = float(np.abs(first.motion).mean()) or 1.0
        self.columns[-1] = max(abs(first.load_factor), self.force)

    def solved(self) -> Point:
        at, damping, slow = self.first, _N.damping, 0
        rest = self._residual(at)
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
                    return self._point(at)
                trial = at - self.columns * step
                new = self._residual(trial)
                if float(new @ new) < size:
                    break
                damping *= _N.factor
            else:
                break
            slow = slow + 1 if float(new @ new) > _N.slow * size else 0
            at, rest, damping = trial, new, max(damping / _N.factor, _N.least_damping)
        return self._point(at)

    def _damped(self, square: sp.csc_array, weight: float, down: FloatArray) -> FloatArray | None:
        """The step with (square + weight) step = down; None where rounding makes that singular."""
        largest = float(square.diagonal().max())
        if not np.isfinite(largest):
            return None
        damping = max(weight, _N.rounding * largest) * sp.eye_array(len(down))
        try:
            return symmetric_lu((square + damping).tocsc(), "MMD_AT_PLUS_A")(down)
        except RuntimeError:
            return None

    def _point(self, at: FloatArray) -> Point:
        pressed, friction, motion, factor = np.split(at, self.ends)
        return Point(pressed, friction.reshape(-1, 3), motion, float(factor[0]))

    def _residual(self, at: FloatArray) -> FloatArray:
        system, (pressed, friction, motion, factor) = self.system, self._point(at)
        balance = pressed @ system.opening + friction.ravel() @ system.slip
        balance = balance + system.dead + factor * system.live
        power = (float(system.live @ motion) - 1.0) * self.force
        corner = pressed - np.maximum(pressed - self.ratio * (system.opening @ motion), 0.0)
        slid = friction - self._nearest(at).value
        return np.concatenate([balance, [power], corner, slid.ravel()]) / self.force

    def _nearest(self, at: FloatArray) -> Projected:
        system, (pressed, friction, motion, _) = self.system, self._point(at)
        slip = self.ratio * (system.slip @ motion).reshape(-1, 3)
        return projected(friction - slip, system.limit @ pressed + system.cohesion)

    def _jacobian(self, at: FloatArray) -> sp.csr_array:
        system, (pressed, _, motion, _) = self.system, self._point(at)
        presses = (pressed - self.ratio * (system.opening @ motion) > 0.0).astype(float)
        released = sp.diags_array(1.0 - presses)
        opened = self.ratio * (sp.diags_array(presses) @ system.opening)
        found, live = self._nearest(at), sp.csr_array(system.live[None, :])
        by_force = in_blocks(found.by_force)
        limited = in_blocks(found.by_limit[:, :, None]) @ system.limit
        held = sp.eye_array(by_force.shape[0]) - by_force
        rows = [
            [system.opening.T, system.slip.T, None, live.T],
            [None, None, self.force * live, None],
            [released, None, opened, None],
            [-limited, held, self.ratio * (by_force @ system.slip), None],
        ]
        matrix = sp.block_array(rows, format="csr")
        return (matrix @ sp.diags_array(self.columns / self.force)).tocsr()


class Projected(NamedTuple):
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
    some = np.where(shear > 0.0, shear, 1.0)
    along = force[:, :2] / some[:, None]
    over = 0.5 * (shear + twist - most)
    inside = over <= 0.0
    turns = ~inside & (over >= shear)
    slides = ~inside & ~turns & (over >= twist)
    new_shear, new_twist = (
        np.clip(size - np.maximum(over, 0.0), 0.0, most) for size in (shear, twist)
    )
    half, grows = 0.5 * ~(inside | turns | slides), (limit > 0.0).astype(float)
    ratio = np.where(shear > 0.0, new_shear / some, inside)
    outer = along[:, :, None] * along[:, None, :]
    by_force = np.zeros((len(force), 3, 3))
    by_force[:, :2, :2] = (inside + half)[:, None, None] * outer
    by_force[:, :2, :2] += ratio[:, None, None] * (np.eye(2) - outer)
    by_force[:, :2, 2] = by_force[:, 2, :2] = (-half * sign)[:, None] * along
    by_force[:, 2, 2] = inside + half
    by_limit = [(grows * (slides + half))[:, None] * along, grows * (turns + half) * sign]
    value = np.column_stack([new_shear[:, None] * along, new_twist * sign])
    return Projected(value, by_force, np.column_stack(by_limit))


def typical(values: FloatArray) -> float:
    """Root of the mean square; 1 where all are zero."""
    return float(np.sqrt(np.mean(values**2))) or 1.0


def in_blocks(blocks: FloatArray) -> sp.csr_array:
    n, i, j = blocks.shape
    return sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(i * n, j * n)).tocsr()
