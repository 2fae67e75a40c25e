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
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.formulations import ForceModel, Part
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.sinks import gathered
from cvxlimit.model.statement import LARGEST_FACTOR, Goal, Stated
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.paths.pairs import Pose
from cvxlimit.paths.path import Points
from cvxlimit.scene import Scene
from cvxlimit.solvers import Outcome, SolverSettings, blockwise, settings_for
from cvxlimit.solvers.interior import Point
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.base import CONSTANT, Condition, Norm, product, times

LADDER = (*blockwise(1e-12), settings_for("CLARABEL", 1e-12))

_GAP = 1e-11
"""Relative gap of an iterate, for each of its points: 1e-17 of weight times contact size, since
solvers measure it by objectives of 1e-6 at least. A point that should carry nothing carries that
over its gap at most, which is what keeps the load factor of a hinge from being exact."""


def point_forces(
    contacts: Contacts, is_stated: bool = False, held: FloatArray | None = None
) -> ForceModel:
    """Compression n and friction mu v at every point, each within its own cone, |v| <= n: with
    friction of 1e-9, |v| <= mu n would lose n >= 0. Where it ``is_stated``, that says n >= 0
    already; certificates are told besides. In a cylinder |v| <= held (k,) if given."""
    each, mu = np.arange(len(contacts)), contacts.friction
    parts = [Part("n", {"N": 1}, each, nonneg=not is_stated), Part("v1", {"V1": mu}, each),
             Part("v2", {"V2": mu}, each)]  # fmt: skip
    most = {"n": 1.0} if held is None else {CONSTANT: held}
    return ForceModel(contacts, parts, [Condition([Norm({"v1": 1}, {"v2": 1})], most, each)])


@dataclass(frozen=True, eq=False)
class Loads:
    """Dead and live load of a scene on displaced blocks; points of action move with the blocks."""

    scene: Scene

    @cached_property
    def _actions(self) -> list[Any]:
        free = [self.scene.blocks[i] for i in self.scene.free]
        return [load.actions(free) for load in (self.scene.dead, self.scene.live)]

    def at(self, pose: Pose) -> tuple[FloatArray, FloatArray]:
        """(6 free blocks,) of the dead and of the live load, about the moved centroids."""
        found = []
        for what in self._actions:
            block = self.scene.free[what.block]
            arm = pose.placed(block, what.at) - pose.middle[block]
            turning = what.moment + np.cross(arm, what.force)
            load = np.zeros((len(self.scene.free), DOF))
            np.add.at(load, what.block, np.concatenate([what.force, turning], axis=1))
            found.append(load.ravel())
        return found[0], found[1]

    def work(self, pose: Pose) -> tuple[float, float]:
        """Of the dead and of the live load on the way from the blocks' first places; of moments,
        which do not turn with the blocks, on the rotation vectors."""
        found = []
        for what in self._actions:
            block = self.scene.free[what.block]
            way = pose.placed(block, what.at) - what.at
            work = float((what.force * way).sum())
            if what.moment.any():
                turn = Rotation.from_matrix(pose.turn[block]).as_rotvec()
                work += float((what.moment * turn).sum())
            found.append(work)
        return found[0], found[1]

    @cached_property
    def size(self) -> float:
        """Sum of the live load's forces: its work over this is w. Of moments alone, over the
        contact size."""
        live = self._actions[1]
        force = float(np.linalg.norm(live.force, axis=1).sum())
        moment = float(np.linalg.norm(live.moment, axis=1).sum())
        return force or moment / self.scene.contacts.typical_size


@dataclass(frozen=True, eq=False)
class Found:
    """Answer of an increment: the load factor, forces (k, 3) at the points, and the displacement d
    (free blocks, 6) to the next iterate. ``way`` are points on the solver's way to it, nearest
    first, ``duals`` (equations,) what d is made of."""

    outcome: Outcome
    load_factor: float
    forces: FloatArray
    d: FloatArray
    way: tuple[Point, ...]
    duals: FloatArray


class Near(NamedTuple):
    """Where an iterate begins: the answer before, by which share of its d blocks have moved, and
    numbers of its points and of those now, which ascend."""

    found: Found
    share: float
    before: IntArray
    now: IntArray

    def starts(self, program: ConeProgram) -> list[Point]:
        """Its way, moved along: openings are nearly what they were, now of gaps and of the rates
        that are left. They are computed anew and lifted to as far inside as they were."""
        place = np.searchsorted(self.before, self.now).clip(max=len(self.before) - 1)
        k, is_new = len(place), self.before[place] != self.now
        of_forces, result = program.matrix[: program.zero, : 3 * k].T, []
        for at in self.found.way:
            force, before = (v.reshape(-1, 3) for v in (at.s, at.z))
            product = float((force * before).sum()) / len(force)
            duals = at.y - self.share * self.found.duals
            opening = (program.cost[: 3 * k] + of_forces @ duals).reshape(3, k).T
            inside = np.where(is_new, np.sqrt(product), _inside(before)[place])
            opening[:, 0] += np.maximum(inside - _inside(opening), 0.0)
            square = opening[:, 0] ** 2 - (opening[:, 1:] ** 2).sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):  # what is no use is not used
                central = opening * [1.0, -1.0, -1.0] * (product / square)[:, None]
            force = np.where(is_new[:, None], central, force[place])
            x = np.append(force.T.ravel(), at.x[-1])
            result.append(Point(x, duals, opening.ravel(), force.ravel()))
        return result


def _inside(cones: FloatArray) -> FloatArray:
    """How far inside their cones points (k, 3) are."""
    return np.asarray(cones[:, 0] - np.linalg.norm(cones[:, 1:], axis=1))


class Increment:
    """Mechanics of one iterate: blocks at a pose, points, loads.

    ``push`` is by how much the live load has yet to move, times the load: a number, or a CVXPY
    Parameter, as ``gap`` (k,) and ``slip`` (k, 2) in ``goal`` may be.
    """

    def __init__(self, scene: Scene, points: Points, pose: Pose, loads: Loads) -> None:
        self.points, n = points, len(points)
        size = scene.contacts.typical_size
        contacts = Contacts(
            names=tuple(f"point {i}" for i in range(n)),
            block_ids=scene.contacts.block_ids,
            a=points.a,
            b=points.b,
            origin=points.at,
            axes=points.axes,
            corner_start=np.arange(n + 1),
            corner_xy=np.zeros((n, 2)),
            sides=np.full((n, 2), np.nan),
            area=np.full(n, size**2),
            friction=points.friction,
        )
        contacts.__dict__["torsion_arm"] = np.full(n, size)
        number = np.full(len(scene.blocks), -1)
        number[scene.free] = np.arange(len(scene.free))
        statics = Statics(contacts, pose.middle, number, *loads.at(pose))
        dead, live = (load.reshape(-1, DOF) for load in (statics.dead, statics.live))
        scaling = Scaling.under(size, dead, live)
        self.assemblage = Assemblage(
            scene._with_contacts(contacts), statics, scaling, Balance.of(statics)
        )

    def problem(self, goal: Goal = LARGEST_FACTOR, held: FloatArray | None = None) -> LimitProblem:
        formulation = partial(point_forces, is_stated=held is None, held=held)
        return LimitProblem(self.assemblage, [Rocking()], formulation=formulation, goal=goal)

    def goal(self, push: Any, gap: Any, slip: tuple[Any, Any]) -> Callable[[Stated], Any]:
        """What is maximised, over units of force and length, to either sink."""
        scaling, mu = self.assemblage.scaling, self.points.friction
        unit = scaling.length

        def stated(found: Stated) -> Any:
            factor = scaling.load_factor(1.0) / (scaling.force * unit)
            goal = times(factor * push, found.factor)
            at = np.zeros(len(mu), np.int64)
            given: Any = zip(("n", "v1", "v2"), (gap, *slip), (1.0, mu, mu), strict=True)
            for name, lack, weight in given:
                own = found.forces[name]
                goal = goal - gathered(times(product(weight / unit, lack), own), at, 1)
            return goal

        return stated

    def solve(self, push: float | None, near: Near | None = None) -> Found | Outcome:
        """The answer, or what the last solver said where none has one; with nothing to ``push``
        towards, the largest load factor, whose d is a rate."""
        if push is None:
            return self._run(self.problem(), LADDER)
        return self._run(self.problem(self._given(push, self.points.gap)), self._ladder, near)

    def priced(self, push: float, slides: FloatArray) -> Found | Outcome:
        """Forces without dilatancy, for slips of the sizes ``slides`` (k,)."""
        gap = self.points.gap + self.points.friction * slides
        return self._run(self.problem(self._given(push, gap)), self._ladder)

    def held(self, push: float, n: FloatArray) -> Found | Outcome:
        """Displacements without dilatancy, with friction held at compressions n (k,)."""
        goal = self._given(push, self.points.gap)
        return self._run(self.problem(goal, np.maximum(n, 0.0)), self._ladder)

    def rates_without_dilatancy(
        self, push: float, enough: float, most: int = 20
    ) -> tuple[Found | Outcome, float]:
        """At rest, where all points are closed and nothing has slid: the pairs of problems again
        and again until the loss, here over the live load's work, is no more than ``enough``, and
        that loss."""
        best: tuple[Found | Outcome, float] = Outcome("no answer", 0.0, 0.0), np.inf
        slides = np.full(len(self.points), push)
        for _ in range(most):
            answer = moved = self.priced(push, slides)
            if isinstance(answer, Found):
                moved = self.held(push, answer.forces[:, 0])
            if not isinstance(answer, Found) or not isinstance(moved, Found):
                return (moved, np.inf) if best[1] == np.inf else best
            moves = self.assemblage.statics.relative_rates(moved.d)[:, :3]
            slides = np.linalg.norm(moves[:, :2], axis=1)
            lost = replace(self.points, gap=moves[:, 2], slip=moves[:, :2]).lost(answer.forces)
            loss = lost / max(abs(answer.load_factor * push), 1e-300)
            if loss < best[1]:
                best = replace(answer, d=moved.d), loss
            if loss <= enough:
                break
        return best

    def _given(self, push: float, gap: FloatArray) -> Callable[[Stated], Any]:
        slip = self.points.slip
        return self.goal(push, gap, (slip[:, 0], slip[:, 1]))

    @property
    def _ladder(self) -> tuple[SolverSettings, ...]:
        return (*blockwise(max(_GAP * len(self.points), 1e-12)), LADDER[-1])

    def _run(
        self, problem: LimitProblem, ladder: Sequence[SolverSettings], near: Near | None = None
    ) -> Found | Outcome:
        scaling, mu, program = self.assemblage.scaling, self.points.friction, problem.program
        kept: dict[str, Any] = {"starts": [] if near is None else near.starts(program)}
        for settings in ladder:
            outcome, x, y = program.solve(settings, kept, is_warm=False)
            state = problem.state(outcome, x, y)
            if y is not None and state.mechanism is not None and state.internal is not None:
                n, v1, v2 = state.internal.reshape(3, -1)
                forces = np.stack([n, mu * v1, mu * v2], axis=1)
                d = state.mechanism * (scaling.live * scaling.length)
                way = tuple(at for _, at in sorted(kept.get("way", {}).items()))
                return Found(outcome, float(state.load_factor or 0.0), forces, d, way, y)
            if outcome.claims_no_optimum:
                break
        return outcome
