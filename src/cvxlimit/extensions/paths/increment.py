"""The one convex problem of an iterate: forces at points, with gaps and slips in the objective.

    max  alpha Delta - sum (g_i n_i + tau_i . v_i)   s.t.   A(q) x + f_dead + alpha f_live = 0,
                                                           |v_i| <= mu_i n_i

Its dual moves the blocks by d so that the live load moves on by Delta, no point is overrun, and the
dead load rises as little as it can: g_i + (A'd)_n >= mu_i |tau_i + (A'd)_t|.

Without dilatancy forces are those of the same problem with gaps wider by mu_i times the whole slip,
which a joint that slides on without opening then closes; and d is the dual of the one with friction
held at their compressions, |v_i| <= mu_i n_i': g_i + (A'd)_n >= 0. The loss

    sum g_i n_i + mu_i n_i |tau_i| + tau_i . v_i

is never negative, and zero where every point that bears is closed, and slides against its friction.

======== ====================== ==================================================================
letter   name                   meaning
======== ====================== ==================================================================
alpha    ``Found.load_factor``  load factor, the multiplier of the live load's movement
Delta    ``push``               how far the live load has yet to move, times the load (work)
x        ``Found.forces``       (k, 3): compression n >= 0 and friction v1, v2 at each point (force)
d        ``Found.d``            (free blocks, 6): displacement and rotation vector of each block
g        ``points.gap``         (k,): distance along the normal, negative where blocks overlap
tau      ``points.slip``        (k, 2): slip along t1 and t2 since the step's start (length)
mu       ``points.friction``    (k,): Coulomb coefficient
A(q)                            equilibrium at the pose q; A'd are relative displacements at points
======== ====================== ==================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray, IntArray
from cvxlimit.extensions.paths.configuration import Points
from cvxlimit.extensions.paths.loads import Loads
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.formulations import ForceModel, Part, times
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.sinks import gathered
from cvxlimit.model.statement import LARGEST_FACTOR, Goal, Stated
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.proof.checks import RESIDUAL
from cvxlimit.scene import Scene
from cvxlimit.solvers import Outcome, ladder_for
from cvxlimit.solvers.matrices import Point
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.base import CONSTANT, Condition, Norm, product

FINE = 1e-12
"""Tolerance of a problem without gaps."""

_GAP = 1e-11
"""Relative gap of an iterate, for each of its points: 1e-17 of weight times contact size, since
solvers measure it by objectives of 1e-6 at least. A point that should carry nothing carries that
over its gap at most, which is what keeps the load factor of a hinge from being exact."""


_GOES_ON = 1e-3
"""Share of its push by which a mechanism goes on where forces are to carry all of a load factor: a
thousandth of the live load's work then weighs against what they lose, which is 1e-9 of it."""


def shear_scale(friction: FloatArray, cohesion: FloatArray) -> FloatArray:
    """Returns what one unit of v is (k,): friction, and 1 where cohesion acts without it."""
    return np.where((friction == 0.0) & (cohesion > 0.0), 1.0, friction)


def point_forces(
    contacts: Contacts, is_stated: bool = False, held: FloatArray | None = None
) -> ForceModel:
    """Returns the model of forces at points: compression n and friction mu v within |v| <= n.

    With v scaled by mu the cone implies n >= 0 however small the friction is. ``is_stated`` says
    that the cone is a row of the problem, so that n >= 0 needs none; certificates have it besides.
    If ``held`` (k,) is given, friction is limited by |v| <= held instead. Cohesion, a force c per
    point, adds c / mu to that bound.
    """
    each, scale = np.arange(len(contacts)), shear_scale(contacts.friction, contacts.cohesion)
    parts = [Part("n", {"N": 1}, each, nonneg=not is_stated), Part("v1", {"V1": scale}, each),
             Part("v2", {"V2": scale}, each)]  # fmt: skip
    most: dict[str, Any] = {"n": 1.0} if held is None else {CONSTANT: held}
    glued = contacts.cohesion > 0.0
    if glued.any():
        # Of cohesion without friction v is a force, which does not grow with n.
        share = np.where(contacts.friction > 0.0, 1.0, ~glued)
        own = np.where(glued, contacts.cohesion * contacts.area / np.where(glued, scale, 1.0), 0.0)
        most = {"n": share, CONSTANT: own} if held is None else {CONSTANT: held * share + own}
    return ForceModel(contacts, parts, [Condition([Norm({"v1": 1}, {"v2": 1})], most, each)])


@dataclass(frozen=True, eq=False)
class Found:
    """The answer of an increment.

    ``forces`` (k, 3) are n, v1, v2 at the points and ``d`` (free blocks, 6) is the displacement to
    the next iterate, which the program's ``duals`` (equations,) are in its own units; ``way`` has
    the solver's iterates, those closest to the solution first.
    """

    outcome: Outcome
    load_factor: float
    forces: FloatArray
    d: FloatArray
    way: tuple[Point, ...]
    duals: FloatArray


@dataclass(frozen=True, eq=False)
class Ahead:
    """The answer of an explicit step: ``load_factor``, ``forces`` (k, 3) as n, v1, v2 at points,
    the next displacement ``d`` (free blocks, 6), and what equilibrium lacks, over the weight."""

    load_factor: float
    forces: FloatArray
    d: FloatArray
    residual: float


class Near(NamedTuple):
    """Where an iterate starts from: the answer before (``found``), the ``share`` of its d by which
    blocks have moved, and ascending numbers of the points ``before`` and ``now``."""

    found: Found
    share: float
    before: IntArray
    now: IntArray

    def starts(self, program: ConeProgram) -> list[Point]:
        """Returns starting points for the solver: the iterates of the answer before, adapted.

        Openings of points follow from the new gaps and the part of d that is left. They are raised
        to be as far inside their cones as they were; forces of new points are chosen on the central
        path. There are none where an equation has come or gone, as of a moment that no point bears.
        """
        if len(self.found.duals) != program.zero:
            return []
        place = np.searchsorted(self.before, self.now).clip(max=len(self.before) - 1)
        k, is_new = len(place), self.before[place] != self.now
        of_forces, result = program.matrix[: program.zero, : 3 * k].T, []
        for at in self.found.way:
            force, before = (v.reshape(-1, 3) for v in (at.s, at.z))
            mean = float((force * before).sum()) / len(force)
            duals = at.y - self.share * self.found.duals
            opening = (program.cost[: 3 * k] + of_forces @ duals).reshape(3, k).T
            inside = np.where(is_new, np.sqrt(mean), _inside(before)[place])
            opening[:, 0] += np.maximum(inside - _inside(opening), 0.0)
            square = opening[:, 0] ** 2 - (opening[:, 1:] ** 2).sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):  # what is no use is not used
                central = opening * [1.0, -1.0, -1.0] * (mean / square)[:, None]
            force = np.where(is_new[:, None], central, force[place])
            x = np.append(force.T.ravel(), at.x[-1])
            result.append(Point(x, duals, opening.ravel(), force.ravel()))
        return result


def _inside(cones: FloatArray) -> FloatArray:
    """Returns how far inside their cones vectors (k, 3) are: first entry less norm of the
    others."""
    return np.asarray(cones[:, 0] - np.linalg.norm(cones[:, 1:], axis=1))


class Increment:
    """The convex problems of one iterate, for blocks at a pose with points and loads.

    ``push`` is by how much the live load has yet to move, times the load (work); in :meth:`goal` it
    may be a CVXPY Parameter, as gaps and slips may. Blocks of a planar scene move in its plane,
    whose normal is ``across`` (3,): with a displacement its mirror image is one, and so is the mean
    of both.
    """

    def __init__(
        self, scene: Scene, points: Points, pose: Pose, loads: Loads,
        across: FloatArray | None = None,
    ) -> None:  # fmt: skip
        self.points, self.across, n = points, across, len(points)
        self._scale = shear_scale(points.friction, points.cohesion)
        self._tolerance = max(_GAP * n, FINE)
        # Every point is a contact of one corner.
        size = scene.contacts.typical_size
        contacts = Contacts(
            names=tuple(f"point {i}" for i in range(n)), block_ids=scene.contacts.block_ids,
            a=points.a, b=points.b, origin=points.at, axes=points.axes,
            corner_start=np.arange(n + 1), corner_xy=np.zeros((n, 2)),
            sides=np.full((n, 2), np.nan), area=np.full(n, size**2), friction=points.friction,
            cohesion=points.cohesion / size**2, most=points.most - points.least,
        )  # fmt: skip
        # Contacts compute it from their polygon, which a point has not.
        contacts.__dict__["torsion_arm"] = np.full(n, size)
        number = np.full(len(scene.blocks), -1)
        number[scene.free] = np.arange(len(scene.free))
        statics = loads.guided(Statics(contacts, pose.middle, number, *loads.at(pose)), pose)
        dead, live = (load.reshape(-1, DOF) for load in (statics.dead, statics.live))
        scaling = Scaling.under(size, dead, live)
        self.assemblage = Assemblage(
            scene._with_contacts(contacts), statics, scaling, Balance.of(statics)
        )

    def problem(self, goal: Goal = LARGEST_FACTOR, held: FloatArray | None = None) -> LimitProgram:
        """Returns the problem with a ``goal``, and with friction limited by ``held`` (k,) if
        given."""
        is_stated = held is None and not self.points.is_bound
        formulation = partial(point_forces, is_stated=is_stated, held=held)
        return LimitProgram(self.assemblage, [Rocking()], formulation=formulation, goal=goal)

    def goal(
        self, push: Any, gap: Any, slip: tuple[Any, Any] | None = None
    ) -> Callable[[Stated], Any]:
        """Returns the function that states the objective of the module's text, in units of the
        scaling. ``slip`` are both components (k,) each, those of the points unless given."""
        scaling, mu, unit = self.assemblage.scaling, self._scale, self.assemblage.scaling.length
        along = (self.points.slip[:, 0], self.points.slip[:, 1]) if slip is None else slip

        def stated(found: Stated) -> Any:
            factor = scaling.load_factor(1.0) / (scaling.force * unit)
            goal = times(factor * push, found.factor)
            at = np.zeros(len(mu), np.int64)
            terms: Any = zip(("n", "v1", "v2"), (gap, *along), (1.0, mu, mu), strict=True)
            for name, lack, weight in terms:
                own = found.forces[name]
                goal = goal - gathered(times(product(weight / unit, lack), own), at, 1)
            return goal

        return stated

    def largest(self) -> Found | Outcome:
        """Returns the largest load factor, with a mechanism of live power 1 for ``d``; or the last
        solver's outcome if none has an answer, as the following do."""
        return self._run(self.problem(), FINE)

    def solve(
        self, push: float, gap: FloatArray | None = None, near: Near | None = None
    ) -> Found | Outcome:
        """Returns the answer for a ``push``, with gaps (k,) in place of those of the points if
        given, from starting points ``near`` by.

        Blocks that clamp each other may press without bound, so much that equilibrium is lost in
        rounding. Then all gaps are wider by rounding: what bears across that little does not.
        """
        gap = self.points.gap if gap is None else gap
        found = self._run(self.problem(self.goal(push, gap)), self._tolerance, near)
        if isinstance(found, Found) and not self._is_balanced(found):
            gap = gap + ROUNDING * self.assemblage.scaling.length
            found = self._run(self.problem(self.goal(push, gap)), self._tolerance)
        return found

    def priced(self, push: float, slides: FloatArray, least: float = 0.0) -> Found | Outcome:
        """Returns forces without dilatancy, for slips of the sizes ``slides`` (k,), and ``least``
        (length) by which all gaps are wider besides."""
        return self.solve(push, self.points.gap + self.points.friction * slides + least)

    def held(self, push: float, n: FloatArray) -> Found | Outcome:
        """Returns displacements without dilatancy, with friction limited by compressions ``n``
        (k,)."""
        goal = self.goal(push, self.points.gap)
        return self._run(self.problem(goal, np.maximum(n, 0.0)), self._tolerance)

    def rates_without_dilatancy(
        self, push: float, enough: float, rest: tuple[float, FloatArray] | None = None,
        most: int = 20,
    ) -> tuple[Found | Outcome, float]:  # fmt: skip
        """Returns forces and rates at rest without dilatancy, and their loss over the live load's
        work.

        The pair of problems is repeated, up to ``most`` times, until the loss is at most
        ``enough``; the answer with the least loss counts. It begins with the load factor and the
        rates (free blocks, 6) of ``rest`` where these are known.
        """
        best: tuple[Found | Outcome, float] = Outcome("no answer", 0.0, 0.0), np.inf
        slides = np.full(len(self.points), push)
        answer = None if rest is None else self._carrying(push, *rest)
        for _ in range(most):
            # Forces for the slips so far, then displacements with friction of these forces.
            if not isinstance(answer, Found):
                answer = self.priced(push, slides)
            moved = self.held(push, answer.forces[:, 0]) if isinstance(answer, Found) else answer
            if not isinstance(answer, Found) or not isinstance(moved, Found):
                return (moved, np.inf) if best[1] == np.inf else best
            # The loss of these forces on these displacements, and the slips for the next pair.
            moves = self.assemblage.statics.relative_rates(moved.d)[:, :3]
            slides = np.linalg.norm(moves[:, :2], axis=1)
            lost = replace(self.points, gap=moves[:, 2], slip=moves[:, :2]).lost(answer.forces)
            loss = lost / max(abs(answer.load_factor * push), 1e-300)
            if loss < best[1]:
                best = replace(answer, d=moved.d), loss
            if loss <= enough:
                break
            answer = None
        return best

    def _carrying(self, push: float, alpha: float, rates: FloatArray) -> Found | Outcome:
        """Returns forces that carry the load factor ``alpha``, and lose as little as they can on
        ``rates`` (free blocks, 6), of whatever size."""
        statics = self.assemblage.statics
        d = rates * (push / float(statics.live @ rates.ravel()))
        moves = statics.relative_rates(d)[:, :3]
        slides = np.linalg.norm(moves[:, :2], axis=1)
        gap = moves[:, 2] + self.points.friction * slides
        # its own push makes any load factor as good as another: with a little more the most counts
        goal = self.goal((1.0 + _GOES_ON) * push, gap, (moves[:, 0], moves[:, 1]))
        most = alpha / self.assemblage.scaling.load_factor(1.0)

        def capped(found: Stated) -> Any:
            found.into.nonneg(-1.0 * (found.factor - most))
            return goal(found)

        return self._run(self.problem(capped), self._tolerance)

    def in_plane(self, d: FloatArray) -> FloatArray:
        """Returns displacements (free blocks, 6) without what leaves the plane of a planar
        scene, and what guides allow of them."""
        guide = self.assemblage.statics.guide
        if guide is not None:
            d = np.asarray(guide @ d.ravel()).reshape(-1, DOF)
        if self.across is None:
            return d
        shift, turn = d[:, :3], d[:, 3:]
        out = np.outer(shift @ self.across, self.across)
        about = np.outer(turn @ self.across, self.across)
        return np.concatenate([shift - out, about], axis=1)

    def _is_balanced(self, found: Found) -> bool:
        """Returns whether forces balance the loads as well as a proof asks for."""
        n, *v = (found.forces - np.outer(self.points.least, [1.0, 0.0, 0.0])).T
        forces = np.zeros((len(n), DOF))
        forces[:, :3] = np.stack([*v, n], axis=1)
        left = self.assemblage.statics.residual(forces, found.load_factor)
        left[:, 3:] /= self.assemblage.scaling.length
        return float(np.abs(left).max()) <= RESIDUAL * self.assemblage.scaling.force

    def _run(
        self, problem: LimitProgram, tolerance: float, near: Near | None = None
    ) -> Found | Outcome:
        scaling, scale, program = self.assemblage.scaling, self._scale, problem.program
        is_near = near is not None and not self.points.is_bound
        memory: dict[str, Any] = {"starts": near.starts(program) if near and is_near else []}
        for settings in ladder_for("paths", tolerance):
            outcome, x, y = program.solve(settings, memory, is_warm=False)
            state = problem.state(outcome, x, y)
            if y is not None and state.mechanism is not None and state.internal is not None:
                n, v1, v2 = state.internal.reshape(3, -1)
                forces = np.stack([n + self.points.least, scale * v1, scale * v2], axis=1)
                d = self.in_plane(state.mechanism * (scaling.live * scaling.length))
                way = tuple(at for _, at in sorted(memory.get("way", {}).items()))
                return Found(outcome, float(state.load_factor or 0.0), forces, d, way, y)
            if outcome.claims_no_optimum:
                break
        return outcome
