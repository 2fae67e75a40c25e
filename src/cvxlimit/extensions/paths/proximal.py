"""Explicit steps of a path: one convex problem that always has an answer, one step after the other.

From a pose with gaps g, without memory of slips, blocks go by the d that brings the live load Delta
farther for the least of the dead load's rise and of what moving costs,

    priced    min  rho/2 d'Md - f_dead . d
              s.t. g_i + mu_i s_i + (A'd)_n,i >= mu_i |(A'd)_t,i|,   f_live . d = Delta
    held      min  rho/2 d'Md - f_dead . d + sum mu_i n_i |(A'd)_t,i|
              s.t. g_i + (A'd)_n,i >= 0,                             f_live . d = Delta

Multipliers of the priced problem are compressions n, friction and the load factor. Friction is
within its cone exactly, and equilibrium lacks rho M d, which is known: the residual. With s = 0
joints open by friction times slip; without dilatancy s are the slips of the held problem, and n
those of the priced one.

What gives way at a largest force F is a point without friction whose gap may be overrun by o >= 0,
at the price of F o.

With rho > 0 the displacement is the only one, however many mechanisms compete, and nothing has to
come to rest: a path goes on here where iterates do not settle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.paths.configuration import Points
from cvxlimit.extensions.paths.following import FINEST, LEVEL_FOR, MOST, Walk
from cvxlimit.extensions.paths.increment import Ahead, Increment
from cvxlimit.extensions.paths.jumps import JUMP
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.extensions.paths.path import Ending
from cvxlimit.extensions.paths.resting import FARTHEST, REACH, At
from cvxlimit.model.sinks import Form, Rows
from cvxlimit.model.statics import DOF
from cvxlimit.solvers import ladder_for

RHO = 1e-3
"""What moving costs: this share of the weight for each contact size, in every block's own share. It
is the residual of a step, over how far the step goes."""

LACKS = RHO * FARTHEST
"""Residual up to which a pose is near equilibrium: that of one block which goes so far."""

_CLOSING = 0.2
"""Share of an overlap, which linearisation leaves, that closes in the next step."""

_PAIRS = 2
"""Pairs of the two problems without dilatancy; one leaves d0 of a dome a third too low."""


class Proximal:
    """The problems of one pose, scaled by the weight and the contact size; ``radius`` (free
    blocks,) is how far corners are from centroids."""

    def __init__(self, given: Increment, radius: FloatArray) -> None:
        self.points, self.statics = given.points, given.assemblage.statics
        self.in_plane = given.in_plane
        self.scaling = given.assemblage.scaling
        scaled = self.scaling.apply(self.statics)
        size, k = self.scaling.length, len(self.points)
        self.dead, self.live = scaled.dead, sp.csr_array(scaled.live[None])
        rates = scaled.matrix.T.tocsr()
        self.normal, *self.along = (rates[DOF * np.arange(k) + column] for column in (2, 0, 1))
        weight = np.linalg.norm(scaled.dead.reshape(-1, DOF)[:, :3], axis=1)
        arms = np.concatenate([np.ones((len(radius), 3)), np.tile(radius[:, None], 3) / size], 1)
        self.mass = RHO * (weight[:, None] * arms**2).ravel()
        # What gives way at a largest force may be overrun by o, at that price.
        yields = np.isfinite(self.points.most)
        self.bears = (self.points.most - self.points.least)[yields] / self.scaling.force
        self.overrun = sp.csr_array(sp.eye_array(k))[:, yields]
        gap = self.points.gap / size
        self.gaps = [np.where((gap < 0.0) & ~yields, x * gap, gap) for x in (_CLOSING, 0.0)]
        self.gap = self.gaps[0]

    def solve(self, push: float, slides: FloatArray | None) -> Ahead | None:
        """Returns the step by ``push``, a work of the live load; None where no solver has one.
        Without dilatancy joints slide by ``slides`` (k,) at first."""
        found = self._solve(push, slides)
        if found is None:  # overlaps at one corner may not all close at once: none closes
            self.gap = self.gaps[1]
            found = self._solve(push, slides)
        return found

    def _solve(self, push: float, slides: FloatArray | None) -> Ahead | None:
        if slides is None:
            return self._priced(push, np.zeros(len(self.points)))
        found = None
        for _ in range(_PAIRS):
            found = self._priced(push, slides)
            d = None if found is None else self._held(push, found.forces[:, 0])
            if found is None or d is None:
                return None
            found, slides = replace(found, d=d), self.slides(d)
        return found

    def slides(self, d: FloatArray) -> FloatArray:
        """Returns how far points slide (k,) where blocks go by ``d``."""
        slip = self.statics.relative_rates(d)[:, :2]
        return np.asarray(np.linalg.norm(slip, axis=1))

    def _priced(self, push: float, slides: FloatArray) -> Ahead | None:
        k, h, mu = len(self.points), len(self.bears), self.points.friction
        into, d, over, goal = self._begun(push)
        far = self.gap + mu * slides / self.scaling.length
        opening = self.normal @ d + self.overrun @ over + far
        into.cone(opening, [mu * (along @ d) for along in self.along])
        answer = self._solved(into, goal)
        if answer is None:
            return None
        x, duals = answer
        # Multipliers: the live load's of its way, contact forces of the cones.
        each = duals[1 + h :].reshape(k, 3) * np.stack([np.ones(k), mu, mu], axis=1)
        forces, factor = each * self.scaling.force, self.scaling.load_factor(-duals[0])
        contact = np.zeros((k, DOF))
        contact[:, [2, 0, 1]] = forces
        left = self.statics.residual(contact, factor) / self.scaling.force
        left[:, 3:] /= self.scaling.length
        forces[:, 0] += self.points.least
        return Ahead(factor, forces, self._displacement(x), float(np.abs(left).max()))

    def _held(self, push: float, n: FloatArray) -> FloatArray | None:
        """Returns displacements with friction held at compressions ``n`` (k,)."""
        into, d, over, goal = self._begun(push)
        slip = into.new(len(self.points))
        into.nonneg(self.normal @ d + self.overrun @ over + self.gap)
        into.cone(slip, [along @ d for along in self.along])
        held = self.points.friction * np.maximum(n, 0.0) / self.scaling.force
        answer = self._solved(into, goal - held[None] @ slip)
        return None if answer is None else self._displacement(answer[0])

    def _begun(self, push: float) -> tuple[Rows, Form, Form, Form]:
        """Returns a sink in which blocks go by d and overrun o >= 0, so that the live load does the
        work ``push``; d and o; and what is maximised but for the cost of moving."""
        into = Rows()
        d, over = into.new(len(self.dead)), into.new(len(self.bears), nonneg=True)
        into.zero(self.live @ d - push / (self.scaling.live * self.scaling.length))
        return into, d, over, self.dead[None] @ d - self.bears[None] @ over

    def _solved(self, into: Rows, goal: Form) -> tuple[FloatArray, FloatArray] | None:
        """Returns the unknowns and all multipliers of what was stated; None without an answer."""
        costs = np.append(self.mass, np.zeros(into.width - len(self.mass)))
        quadratic = sp.csc_array(sp.diags_array(costs))
        program = replace(into.written(goal).program, quadratic=quadratic)
        (settings,) = ladder_for("explicit steps")
        _, x, duals = program.solve(settings, all_duals=True)
        return None if x is None or duals is None else (x, duals)

    def _displacement(self, x: FloatArray) -> FloatArray:
        """Returns d (free blocks, 6), the first of the unknowns."""
        each = x[: len(self.dead)].reshape(-1, DOF) * self.scaling.length
        each[:, 3:] /= self.scaling.length
        return self.in_plane(each)


def go_on(walk: Walk, until: float, is_level: Callable[[], bool]) -> tuple[Ending, str] | None:
    """Goes on by explicit steps from the end of a path until it ends, ``is_level`` or otherwise,
    and returns how and why; None where rest is found again, which is sought after one, two, four
    steps, and so on."""
    size, steps, here = walk.size, 0, walk.found[-1]
    before = walk.found[-2] if walk.found[1:] else here
    way = here.shown.w - before.shown.w or walk.step
    pose, begin = here.pose, walk.start(here)
    ahead = _ahead(walk, begin.points(pose), pose, way, before.pose)
    while len(walk.found) <= MOST and not walk.is_far:
        # Towards the next configuration near equilibrium: what falls gets near none.
        for _ in range(round(REACH / FARTHEST)):
            if ahead is None:
                return "not-converged", "no explicit step has an answer"
            moved = walk.moved(ahead.d)
            share = min(1.0, FARTHEST * size / float(moved.max()))
            pose = walk.loads.moved(pose, share * ahead.d)
            w, points = walk.loads.work(pose)[1] / walk.loads.size, begin.points(pose)
            way = max(1.5 * (w - here.shown.w), FINEST * walk.step)
            way = min(way, (1.0 - FARTHEST) * walk.step, max(walk.most - w, FINEST * walk.step))
            ahead = _ahead(walk, points, pose, way, here.pose)
            if w > here.shown.w and ahead and ahead.residual <= LACKS:
                break
        else:
            return "falls", walk.why("falls", moved)
        # Ties that came apart on the way do not hold there, so that the way is gone without them.
        left = here.bonds and here.bonds.holding(pose)
        if here.bonds and left and here.bonds.lost(left):
            here = replace(here, bonds=left)
            pose, begin = here.pose, walk.start(here)
            ahead = _ahead(walk, begin.points(pose), pose, way, pose)
            continue
        there = walk.followed(pose, points, ahead, w, here.shown.w)
        there = replace(there, bonds=left and left.after(pose))
        walk.keep(there)
        if there.shown.load_factor <= until:
            return "zero", f"the load factor is no more than {until:g} where blocks are followed"
        if is_level():
            return "slides", LEVEL_FOR
        steps += 1
        if not steps & (steps - 1):
            rest = walk.settle(there, 2.0 * w - here.shown.w)
            if isinstance(rest, At) and _goes_on(walk, here, there, rest):
                walk.keep(rest)
                return None
        here, begin = there, walk.start(there)
    return walk.used_up(until)


def _goes_on(walk: Walk, here: At, there: At, rest: At) -> bool:
    """Returns whether rest is on the curve that was followed: blocks and load factor go on as they
    went, neither back nor much farther."""
    fall = here.shown.load_factor - there.shown.load_factor
    more = there.shown.load_factor - rest.shown.load_factor
    is_near = walk.distance(there, rest) <= JUMP * walk.distance(here, there)
    return is_near and 0.0 <= more <= JUMP * fall


def _ahead(walk: Walk, points: Points, pose: Pose, way: float, before: Pose) -> Ahead | None:
    """Returns the explicit step from a pose by ``way`` of w. Without dilatancy joints first slide
    as they did since ``before``, or all as far as the live load goes."""
    step, slides = Proximal(walk.increment(points, pose), walk.radius), None
    if not walk.has_dilatancy:
        is_first = pose is before
        d = pose.since(before, walk.scene.free)
        slides = np.full(len(points), way * walk.loads.pace) if is_first else step.slides(d)
    return step.solve(way * walk.loads.size, slides)
