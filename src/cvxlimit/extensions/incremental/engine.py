"""One state after another: Newton's method, and convex problems with friction held.

Unknown are displacements d of the blocks and the load factor alpha; given is the displacement w of
the live load. What joints do to the blocks is F(d):

    F(d) + dead + alpha live = 0,    live . d = w

Newton's method with the unsymmetric tangent of Coulomb friction is fast, and fails at times. With
friction held at radii r the problem is the least of a convex function without constraints, of
squares in compressions and Huber's function of slips. From its state on blocks are dragged, D (d -
before) against their motion, until that takes no force: there may be no state near the last one,
where friction gives way faster than joints unload.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.incremental.joints import FLOATING, Joints, Memory, State

BALANCED = 1e-9
"""Largest force that a block may lack, over the largest load of one, or of joints on one."""

ROUGH, FARTHER = 1e-5, (2.0, 8.0, 32.0)
"""The same where an estimate is asked for; and how many times as far, beyond the last state, the
live load then moves."""

STUCK = 1e12
"""Shear that joints bear which cannot slide, in forces of a mean block's weight."""

LINES, SHORT = (1.0, 0.5, 0.25, 0.1, 0.03), (0.01, 0.003, 0.001)
"""Shares of a step of Newton's method that are tried, the longest first; and those besides where it
has failed, which show what of many points begins to slide first."""

LIGHT, HEAVY, LIGHTER, DRAGGED = 1e-4, 10.0, 10.0, 600
"""Drag of blocks, over the stiffness of a joint of mean area, that is tried first and at most; how
many times lighter the next one is if a state is found with it, heavier if not; most iterations."""

WORSE = 1.5
"""How many times larger what is out of balance may get in a step: states change from one piece of a
piecewise linear law to another, and a step that must always gain is a short one."""

FEW, HELD = 20, 60
"""Most iterations of Newton's method, and of a convex problem."""


@dataclass(frozen=True, eq=False)
class Place:
    """A state in equilibrium, and the memory that joints came to it with."""

    d: FloatArray
    alpha: float
    state: State
    memory: Memory


class Engine:
    """Finds states of joints in equilibrium; ``gaps`` (C,) are those of beds that are not true.

    ``effort`` counts factorisations, each of which stands for an iteration, and ``drags`` how
    often blocks were dragged on.
    """

    def __init__(self, joints: Joints, gaps: FloatArray | None = None) -> None:
        self.joints, self.live = joints, joints.live
        self.gaps = np.zeros(joints.number) if gaps is None else gaps
        self.effort = self.drags = 0

    def _solver(
        self, state: State, is_held: bool, drag: float = 0.0
    ) -> Callable[[FloatArray], FloatArray]:
        self.effort += 1
        return self.joints.factorised(state, is_held, drag)

    def compliance(self) -> float:
        """Displacement of the live load under its unit if all joints stuck: a length by which
        displacements are measured."""
        joints = self.joints
        nothing, sticking = np.zeros(joints.pattern.size), np.full_like(joints.kn, STUCK)
        state = joints.state(nothing, 0.0 * self.gaps, joints.untouched(), sticking)
        return float(self.live @ self._solver(state, True)(self.live))

    def is_balanced(
        self, rest: FloatArray, borne: FloatArray, alpha: float, near: float = BALANCED
    ) -> bool:
        """Whether so little is out of balance, beside loads and what joints do."""
        size = max(np.abs(self.joints.dead).max(), np.abs(alpha * self.live).max())
        return bool(np.abs(rest).max() <= near * max(size, np.abs(borne).max()))

    def newton(
        self, d: FloatArray, alpha: float, w: float | None, memory: Memory, share: float = 1.0,
    ) -> Place | None:  # fmt: skip
        """The state at w, or under a ``share`` of the dead load alone where w is None; from
        displacements d, which need not be one. None if it is not found."""
        start = self.joints.state(d, self.gaps, memory)
        return self._newton(d, alpha, w, memory, start, share, 0.0, LINES)

    def dragged(self, last: Place, w: float, memory: Memory) -> Place | None:
        """The state at w where Newton's method has failed: from that with friction held as in the
        ``last`` one blocks are dragged on, as through something viscous that gives way."""
        r = self.joints.limit(last.state.N, last.memory)
        place, drag = self.held(last.d, last.alpha, w, r, memory), LIGHT
        self.drags += 1
        most = self.effort + DRAGGED
        while place is not None and drag <= HEAVY and self.effort < most:
            # what slides or yields begins with doing so: rounding decides at the verge
            start = self.joints.state(place.d, self.gaps, memory)
            start = replace(start, slides=place.state.slides, yields=place.state.yields)
            lines = LINES + SHORT
            found = self._newton(place.d, place.alpha, w, memory, start, 1.0, drag, lines)
            if found is None:
                drag *= LIGHTER
                continue
            borne = self.joints.load(found.state)
            rest = borne + self.joints.dead + found.alpha * self.live
            if self.is_balanced(rest, borne, found.alpha):
                return found
            place, drag = found, drag / LIGHTER
        return None

    def _newton(
        self, d: FloatArray, alpha: float, w: float | None, memory: Memory, state: State,
        share: float, drag: float, lines: tuple[float, ...],
    ) -> Place | None:  # fmt: skip
        joints, live, dead, before = self.joints, self.live, share * self.joints.dead, d
        borne = joints.load(state)
        rest = borne + dead + alpha * live
        size = float(rest @ rest)
        for _ in range(FEW):
            missing = 0.0 if w is None else float(live @ d) - w
            if self.is_balanced(rest, borne, alpha) and self._is_there(missing, w):
                return Place(d, alpha, state, memory)
            solve = self._solver(state, False, drag)
            move, more = solve(rest), 0.0
            if w is not None:
                along = solve(live)
                more = float(-(missing + live @ move) / (live @ along))
                move = move + more * along
            if not np.isfinite(move).all():
                return None
            # the longest step that is not much worse, or the best
            tries = []
            for t in lines:
                ahead = d + t * move
                state = joints.state(ahead, self.gaps, memory)
                borne = joints.load(state)
                rest = borne + dead + (alpha + t * more) * live - drag * (ahead - before)
                tries.append((float(rest @ rest), t, state, borne, rest))
                if tries[-1][0] <= WORSE**2 * size:
                    break
            size, t, state, borne, rest = min(tries, key=lambda each: each[0])
            d, alpha = d + t * move, alpha + t * more
        return None

    @staticmethod
    def _is_there(missing: float, w: float | None) -> bool:
        return w is None or abs(missing) <= 1e-12 * abs(w) + 1e-14  # rounding of a sum

    def held(
        self, d: FloatArray, alpha: float, w: float | None, r: FloatArray, memory: Memory,
        near: float = BALANCED,
    ) -> Place | None:  # fmt: skip
        """The state with friction held at radii r (C, P): a convex function at its least."""
        joints, live, dead = self.joints, self.live, self.joints.dead
        for _ in range(HELD):
            state = joints.state(d, self.gaps, memory, r)
            borne = joints.load(state)
            rest, missing = borne + dead, 0.0
            solve = self._solver(state, True)
            move = solve(rest)
            if w is not None:
                along, missing = solve(live), float(live @ d) - w
                alpha = float(-(missing + live @ move) / (live @ along))
                move, rest = move + alpha * along, rest + alpha * live
            if self.is_balanced(rest, borne, alpha, near) and self._is_there(missing, w):
                return Place(d, alpha, state, memory)
            start, t, fall = self._energy(state, d, alpha), 1.0, abs(float(rest @ move))
            for _ in range(25):  # to 3e-8 of the step
                ahead = d + t * move
                now = self._energy(joints.state(ahead, self.gaps, memory, r), ahead, alpha)
                if now <= start - 1e-4 * t * fall + 1e-14 * abs(start):
                    break
                t /= 2.0
            d = d + t * move
        return None

    def _energy(self, state: State, d: FloatArray, alpha: float) -> float:
        """Energy of joints less work of the loads: it is least at equilibrium."""
        return self.joints.energy(state) - float((self.joints.dead + alpha * self.live) @ d)

    def at_rest(self) -> Place | None:
        """The state under the dead load alone: at once, in ten steps, or from sticking."""
        joints, nothing = self.joints, np.zeros(self.joints.pattern.size)
        memory = joints.untouched()
        sticking = np.where((joints.mu > 0.0) & (joints.kn > 0.0), STUCK, 0.0)
        stuck = self.held(nothing, 0.0, None, sticking, memory)
        found = self.newton(nothing if stuck is None else stuck.d, 0.0, None, memory)
        if found is None:
            d, kept = nothing, memory
            for share in np.linspace(0.1, 1.0, 10):
                found = self.newton(d, 0.0, None, kept, float(share))
                if found is None:
                    break
                d, kept = found.d, joints.after(found.state, kept)
        return found or self.settled()

    def settled(self) -> Place | None:
        """The state under the dead load whose forces are those of joints that open as they slide,
        which is the least of a convex function: it exists wherever the dead load stands."""
        joints, dead = self.joints, self.joints.dead
        d = np.zeros(joints.pattern.size)
        for _ in range(HELD):
            state, tangent = joints.opening(d, self.gaps)
            borne = joints.load(state)
            rest = borne + dead
            if self.is_balanced(rest, borne, 0.0):
                return self.newton(d, 0.0, None, joints.settled(state))
            self.effort += 1
            move = joints.pattern.factorised(tangent, FLOATING, True)(rest)
            start, t = joints.opened_energy(state) - float(dead @ d), 1.0
            for _ in range(25):  # to 3e-8 of the step
                ahead = d + t * move
                now = joints.opened_energy(joints.opening(ahead, self.gaps)[0]) - dead @ ahead
                if now <= start - 1e-4 * t * abs(float(rest @ move)) + 1e-14 * abs(start):
                    break
                t /= 2.0
            d = d + t * move
        return None

    def to_come(self, place: Place, w: float) -> float | None:
        """The load factor to which it would rise if compressions stayed as they are: friction is
        held, and the live load moves on, ten times as far again and again."""
        joints = self.joints
        r = joints.limit(place.state.N, place.memory)
        start = float(self.live @ place.d) - w
        found, factors = place, [place.alpha]
        for far in FARTHER:
            w_far = start + (1.0 + far) * w
            moved = self.held(found.d, found.alpha, w_far, r, place.memory, ROUGH)
            if moved is None:
                return None
            found = moved
            factors.append(found.alpha)
        # what is missing at w falls as 1/w, once all that moves has yielded
        times = FARTHER[-1] / FARTHER[-2]
        return factors[-1] + (factors[-1] - factors[-2]) / (times - 1.0)
