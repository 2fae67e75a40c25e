"""Descent to an equilibrium state without dilatancy: two convex problems, solved in turn.

Forces x, in equilibrium at a load factor alpha and within the yield surfaces, and a mechanism u of
live power 1 that penetrates nowhere are a solution if they are complementary: friction opposes slip
in full, and what is pressed neither opens nor dilates. What they lack of it is the residual

    Phi(x, u)  =  what friction and cohesion dissipate on u  -  power of the loads on u  >=  0.

Phi is bilinear in compressions and slips, and for either one alone it is a convex problem:

    u, x given   friction held at the compressions of x (Tresca's law, :mod:`.tresca`); its load
                 factor less alpha is the least residual
    x, u given   the largest alpha - sum of p N over compressions N, where p (n,) is the dilation of
                 u: the opening that associated friction would add to it at each contact

Solved in turn they lower Phi. Where that stalls, and friction is a cone, come fixed-point iterates
of De Saxce: p follows the mechanism that the second problem has itself, relaxed. Where Phi is
within the tolerance, the solution is checked in NumPy (:mod:`.members`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.dilatancy.members import Verifier
from cvxlimit.extensions.dilatancy.pair import Pair, pressed
from cvxlimit.methods.convex import ConvexSearch
from cvxlimit.methods.driver import Run
from cvxlimit.solution import Member
from cvxlimit.solvers import LimitState

ITERATES, RELAXED = 12, (0.6, 0.9, 1.6)
"""Iterates of De Saxce in a row, and the weights of new dilations in them, in turn. Some errors
keep their sign from one iterate to the next, others change it: hence weights about 1, as
Chebyshev's for eigenvalues from -1 to 0.6. Where friction is linear there are finitely many
mechanisms, and the two problems end in a few steps by themselves."""

ROUGH, EXACT, FINEST = 1e-4, 0.01, 1e-11
"""Tolerance of the problems: at most this; over the residual that is to be lowered; where rounding
begins."""

STALLS, AT_FIRST = 0.8, 3
"""The descent stalls where both problems leave more than this share of the residual, from this time
on: those that end at a solution take two to seven, others hardly change from the third on."""

SETTLED = 1e-10
"""Residual below which a solution is as good as exact."""

AMPLIFIED = 10.0
"""How many times the angle of friction to slip the load factor may be off, where a solution is
settled: 2 on a wedge in a groove of 60 degrees, one over the sine of half of it on others."""

HIGHER = 1.003
"""Factor on a mechanism's dilations at which forces on it are its lowest."""


class Found(NamedTuple):
    """A solution as it is reported, and the solver's forces and mechanism that it was made of."""

    member: Member
    state: LimitState


class Descent:
    """Descents of one run, and the ``solutions`` that they have found; ``smallest`` is the least
    residual of any, over the load factor.

    At most ``until`` problems are solved in all, counted by ``pair.solved``.
    """

    def __init__(self, run: Run, associated: ConvexSearch, tolerance: float) -> None:
        self.run, self.tolerance = run, tolerance
        self.pair = Pair(run, associated)
        with run.clock.phase("certify"):
            self.verifier = Verifier(run, associated.certifier, self.pair.slip, self.pair.has_cones)
        self.solutions: list[Found] = []
        self.smallest, self.begun, self.until = np.inf, 0, 0

    def begin(self, budget: int) -> None:
        """Counts problems from here on, up to a ``budget``."""
        self.begun, self.until = self.pair.solved, self.pair.solved + budget

    @property
    def solves(self) -> int:
        """Problems that were solved since :meth:`begin`."""
        return self.pair.solved - self.begun

    @property
    def left(self) -> int:
        """Problems that may still be solved."""
        return self.until - self.pair.solved

    def forces(self, dilation: FloatArray, limit: float, tolerance: float) -> LimitState | None:
        """Solves for forces at a dilation (n,), with a load factor up to a ``limit``; None if that
        fails."""
        state = self.pair.priced(dilation, tolerance, limit)
        return None if state.forces is None or state.load_factor is None else state

    def mechanism(
        self, state: LimitState | None, tolerance: float, less: FloatArray | float = 0.0
    ) -> LimitState | None:
        """Solves for a mechanism with friction held at a state's compressions, ``less`` that share
        of them; None without a state, or if that fails."""
        if state is None:
            return None
        held = self.pair.held((1.0 - less) * pressed(state), tolerance)
        return None if held.mechanism is None or held.load_factor is None else held

    def dilation(self, state: LimitState) -> FloatArray:
        """Returns the opening (n,) that associated friction would add to a state's mechanism."""
        assert state.mechanism is not None
        return self.pair.dilatancy(state.mechanism)

    def residual(self, state: LimitState, held: LimitState) -> float:
        """Returns the residual of forces and of the mechanism of friction held at them, over the
        load factor; below zero it is what both solves lack."""
        factor = state.load_factor or 0.0
        return abs((held.load_factor or 0.0) - factor) / self.run.scaling.unit(factor)

    def aim(self, gain: float) -> float:
        """Returns the residual of a solution that is to be lower than another by ``gain``, over the
        load factor. Slip that friction opposes at an angle leaves the square of the angle, and
        changes the load factor by the angle itself: with more, what is found is no solution."""
        return min(self.tolerance, 0.01 * gain**2) if self.pair.has_cones else self.tolerance

    def solution(
        self, label: str, state: LimitState | None, limit: float, aim: float, iterates: int = 0
    ) -> Found | None:
        """Solves both problems in turn from a state's forces, below a ``limit`` of the load factor,
        until the residual is within ``aim``, and returns the solution. Where they stall come so
        many ``iterates`` of De Saxce; None where they stall without any, if a solve fails, or when
        the budget is spent."""
        finest, residual, before, pairs = max(EXACT * aim, FINEST), 1.0, np.inf, 0
        while state is not None and self.left > 0:
            # A mechanism for the forces, with friction held, and the residual of both.
            exact = min(max(EXACT * residual, finest), ROUGH)
            held = self.mechanism(state, exact)
            if held is None:
                return None
            residual, pairs = self.residual(state, held), pairs + 1
            # Within the tolerance it is checked; if the checker refuses it, solves become finer.
            if residual <= aim:
                found = self.checked(replace(state, mechanism=held.mechanism), label)
                if found is not None:
                    return found
                finest = max(0.1 * finest, FINEST)
            self.smallest = min(self.smallest, residual)
            stalls = residual > STALLS * before
            if stalls and not iterates and pairs >= AT_FIRST:
                return None
            before = np.inf if stalls and iterates else residual
            # Forces for the mechanism, at its dilation.
            dilation, exact = self.dilation(held), min(max(EXACT * residual, finest), ROUGH)
            state = self.forces(dilation, limit, exact)
            if stalls and iterates:
                state = self.fixed_point(state, dilation, limit, exact)
        return None

    def fixed_point(
        self, state: LimitState | None, dilation: FloatArray, limit: float, tolerance: float
    ) -> LimitState | None:
        """Takes iterates of De Saxce from a state, whose dilations (n,) follow the mechanism of its
        own problem; none where friction is linear. Returns the last state; None if a solve
        fails."""
        for k in range(ITERATES if self.pair.has_cones else 0):
            if state is None or state.mechanism is None:
                return None
            w = RELAXED[k % len(RELAXED)]
            dilation = np.maximum((1.0 - w) * dilation + w * self.dilation(state), 0.0)
            state = self.forces(dilation, limit, tolerance)
        return state

    def settled(self, found: Found, limit: float, iterates: int = 0) -> Found:
        """Returns the solution next to one found below a ``limit`` whose friction opposes slip to
        next to nothing, in place of that one, or the same where no descent leads to it. The load
        factor may rise with it: by the angle, or by more, at first up to the limit; but that may
        be all that holds friction at an angle, so that it is then left out."""
        factor, residual = found.member.load_factor, found.member.complementarity
        if found.member.is_settled or not self.pair.has_cones:
            return found
        angle = np.sqrt(2.0 * residual) * self.run.scaling.unit(factor)
        near, above = factor + angle, factor + AMPLIFIED * angle
        for most in dict.fromkeys((min(limit, near), min(limit, above), above)):
            forces = self.forces(self.dilation(found.state), most, EXACT * SETTLED)
            finer = self.solution(found.member.start, forces, most, SETTLED, iterates)
            if finer is not None:
                self.solutions.remove(found)
                return finer
        return found

    def lowered(self, found: Found, least: float) -> Found:
        """Returns the lowest forces on a solution's mechanism, then those on a mechanism of these
        forces, and so on, as long as they are solutions that gain more than ``least`` of the load
        factor."""
        exact = EXACT * self.tolerance
        while self.left > 0:
            (member, state), unit = found, self.run.scaling.unit(found.member.load_factor)
            forces = self.forces(HIGHER * self.dilation(state), member.load_factor, exact)
            held = self.mechanism(forces, exact)
            if forces is None or held is None:
                break
            gain = (member.load_factor - (forces.load_factor or 0.0)) / unit
            if gain <= self.tolerance or self.residual(forces, held) > self.aim(gain):
                break
            lower = self.checked(replace(forces, mechanism=held.mechanism), member.start)
            if lower is None:
                break
            found = lower
            if gain < least:
                break
        return found

    def checked(self, state: LimitState, label: str) -> Found | None:
        """Checks a state's forces and mechanism, and keeps them if they are a solution within the
        tolerance; otherwise returns None."""
        with self.run.clock.phase("certify"):
            member = self.verifier.member(state, label, self.solves)
        if member is None or member.residual > self.tolerance:
            return None
        self.solutions.append(Found(member, state))
        return self.solutions[-1]
