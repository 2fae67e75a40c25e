"""Equilibria at a given mean displacement w of the live load, from a configuration near by.

One convex problem follows the other on exact geometry (:mod:`.increment`). Its dual moves the
blocks by d, so that the live load goes as far as w, no point is overrun, and the dead load rises as
little as it can; they are moved by exact rotations, and the problem is built anew. Where d vanishes
blocks are at rest, and its multiplier is the load factor.

With dilatancy an iterate is one problem, and a step shorter than d where mechanisms compete.
Without it an iterate is two: friction for the slips so far, then displacements with friction held;
what counts is the loss, by how much friction does not oppose the whole slip. Several states may
have none: a path begins where the way from rest ends (:mod:`.starting`), goes on as blocks moved
before, and presses joints no more than it must. Cohesion and ties that
come apart on the way do not hold where blocks come to rest, so that rest is sought again without
them.

One step on elastic joints at the present pose, whose forces are unique, was tried in place of all
this, with joints as stiff as rounding allows, and with softer ones whose shortening is renewed
until nothing is left of it. Single blocks and arches came out as exact, at many times the cost.
Piles and walls did not: joints that remember need points that stay, and corners of flush blocks
come and go with the least slip; beyond a snap there is no state near the pose for Newton's method
to find; and where friction slides it lost its way already in the first steps of walls. Nor would
the largest load factor at rest leave, as no elastic joint has it at rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import ROUNDING, SMALL, FloatArray
from cvxlimit.extensions.paths.bonds import Bonds
from cvxlimit.extensions.paths.configuration import Configuration, Flow, Points
from cvxlimit.extensions.paths.increment import Ahead, Found, Increment, Near
from cvxlimit.extensions.paths.pairs import CLOSED, Pose
from cvxlimit.extensions.paths.path import SLIDING, Ending
from cvxlimit.extensions.paths.points import SETTLED, Start
from cvxlimit.extensions.paths.starting import from_rest
from cvxlimit.extensions.paths.supports import loads_of
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.reductions.choice import Reductions
from cvxlimit.scene import Scene
from cvxlimit.scene.settling import SupportMotion
from cvxlimit.solvers import Outcome
from cvxlimit.surfaces.coulomb import needed_surfaces, surfaces_of

REACH = 0.2
"""Facets within this share of the contact size of each other may meet in a step; blocks that were
farther off and are in each other after it make the step too long."""

_FEW, _MANY = 12, 24
"""Iterates: rocking takes 3 to 6, and sliding where slips keep their direction; what has not
settled in 24 has not settled in 60. After twelve ``SETTLED`` is enough: digits end where
mechanisms compete. Without dilatancy an iterate is two problems, and half as many are few."""

FAR = 1e-3
"""Movement over the contact size from which two iterates lead to the end, each from the answer
before; still farther off after twelve, mechanisms compete, and half the step takes less time."""

_SLIVERS = 3
"""Joints left out as slivers of which each has its own load factor: one problem each."""

LEAST = 1e-5
"""Gap over the contact size that joints are given beside their own where forces are sought without
dilatancy: of all states without a loss it is that with the least compressions, as from rest, where
nothing has been pressed together. Ten times less is lost in the solvers' tolerance, ten times more
adds a thousandth to losses."""

FARTHEST, LEFT = 0.05, 0.05**2
"""Largest movement of an explicit step over the contact size, and what its linearisation leaves of
gaps; what would go farther goes on in several steps."""


@dataclass(frozen=True, eq=False)
class At:
    """A configuration (``shown``), its pose, the gap that its slips have opened (``loose``,
    length), whether any joint slid, the cohesion, ties and reactions from there on, and how blocks
    have moved, or begin to, for each w (free blocks, 6)."""

    pose: Pose
    shown: Configuration
    loose: float
    slides: bool
    bonds: Bonds | None = None
    pace: FloatArray | None = None

    def lost(self, later: At) -> tuple[str, ...]:
        """Returns what has come apart from here to a later configuration: cohesion and ties."""
        return self.bonds.lost(later.bonds) if self.bonds and later.bonds else ()


@dataclass(frozen=True, eq=False)
class Failed:
    """An equilibrium that was not found at ``w``: how the path ends there, and how far each free
    block ``moved`` in the last iterate (free blocks,)."""

    w: float
    kind: Ending
    moved: FloatArray


class Rest:
    """Where the blocks of a scene come to rest on a path, from one configuration to the next.

    ``found`` are the configurations so far: losses are shares of the first one's work.
    """

    def __init__(
        self, scene: Scene, reach: float, flow: Flow, stretch: float = 0.0,
        motions: Sequence[SupportMotion] = (),
    ) -> None:  # fmt: skip
        self.scene, self.flow = scene, flow
        self.has_dilatancy = flow == "associated"
        self.size = scene.contacts.typical_size
        self.motions, self.loads = tuple(motions), loads_of(scene, motions)
        self.radius = np.array([
            np.linalg.norm(b.vertices - b.centroid, axis=1).max()
            for b in (scene.blocks[i] for i in scene.free)
        ])  # fmt: skip
        bonds = Bonds.first(scene, stretch)
        moving = [name for motion in motions for name in motion.supports]
        self.begin = replace(Start.first(scene, reach, moving), bonds=bonds)
        self.facets = self.begin.facets
        self.found: list[At] = []
        # As solve may take it: whatever model it chooses.
        surfaces, self.across, self.mirror = needed_surfaces(surfaces_of("conic")[0]), None, None
        if len(scene.contacts):
            least = Reductions.of(Assemblage.of(scene), surfaces, model="least")
            self.across = None if least.plane is None else least.plane.normal
            self.mirror = least.mirror

    def first(self) -> At | Failed:
        """Returns the configuration of the scene as given, at the largest load factor."""
        points, answer, loss = self._begun()
        if not isinstance(answer, Found):
            return Failed(0.0, "not-converged", np.zeros(len(self.scene.free)))
        shown = self._shown(self.begin.pose, points, answer, 0.0, 0.0, 1, loss)
        return replace(shown, bonds=self.begin.bonds, pace=self._pace(answer.d))

    def _pace(self, d: FloatArray | None) -> FloatArray | None:
        """Returns a mechanism for each w, if the live load moves on in it."""
        if d is None or self.has_dilatancy or self.motions:
            return None
        power = float(self.loads.at(self.begin.pose)[1] @ d.ravel())
        return d * (self.loads.size / power) if power > 0.0 else None

    def pace(self, before: Sequence[At], at: At) -> FloatArray | None:
        """Returns how blocks came to a configuration from the one before, or begin to move if there
        is none; without dilatancy alone, with which no iterate asks for it."""
        if self.has_dilatancy:
            return None
        if not before:
            return self._pace(self.first_rates())
        way, length = at.pose.since(before[0].pose, self.scene.free), at.shown.w - before[0].shown.w
        return way / length if length > 0.0 else None

    def first_rates(self) -> FloatArray | None:
        """Returns the mechanism (free blocks, 6) by which blocks begin to move, if one is found."""
        _, answer, _ = self._begun()
        return answer.d if isinstance(answer, Found) else None

    def left_out(self) -> Iterator[tuple[tuple[str, ...], float]]:
        """Yields the blocks (2,) whose joints are left out at rest because they are slivers, and
        the first load factor with them; for "slivers" that with all of them, where there are
        several, and without blocks that with the edges and corners that touch beside contacts."""
        names, pose = [block.id for block in self.scene.blocks], self.begin.pose
        pairs = [(names[a], names[b]) for a, b in zip(*self.facets.sliver_blocks(), strict=True)]
        each = [*dict.fromkeys(pairs)]

        def with_points(points: Points) -> float:
            answer = self.increment(points, pose).largest()
            return answer.load_factor if isinstance(answer, Found) else np.inf

        for which in [[one] for one in each[:_SLIVERS]] + [each] * (len(each) > 1):
            facets = copy(self.facets)
            facets.slivers = facets.slivers[[pair not in which for pair in pairs]]
            points = Start.at(facets, pose, 0.0, self.begin.bonds).at_rest()
            yield which[0] if len(which) == 1 else ("slivers",), with_points(points)
        every = self._closed(self.begin.points(pose))
        if len(every) > len(self.first_points):
            yield (), with_points(every)

    def _closed(self, points: Points) -> Points:
        return points.take(points.gap <= CLOSED * self.size)

    @cached_property
    def first_points(self) -> Points:
        """The points at which the scene as given bears: those of its contacts; where these have no
        equilibrium, as blocks start on edges and corners, all that are closed."""
        points = self.begin.at_rest()
        if len(points) and isinstance(self.increment(points, self.begin.pose).largest(), Found):
            return points
        return self._closed(self.begin.points(self.begin.pose))

    def first_increment(self) -> Increment:
        """Returns the problems of the scene as given, on the points at which it bears."""
        return self.increment(self.first_points, self.begin.pose)

    def increment(self, points: Points, pose: Pose) -> Increment:
        """Returns the problems of a pose on some points."""
        return Increment(self.scene, points, pose, self.loads, self.across)

    def _begun(self) -> tuple[Points, Found | Outcome, float]:
        """Returns the points at which the scene as given is closed, the largest load factor there
        with the rates of its mechanism, and their loss."""
        increment = self.first_increment()
        answer, loss = increment.largest(), 0.0
        if isinstance(answer, Found) and not self.has_dilatancy:
            push = self.size * self.loads.size / self.loads.pace
            rest = None if self.motions else from_rest(self.scene)
            known = None if isinstance(rest, str) else rest
            answer, loss = increment.rates_without_dilatancy(push, SLIDING, known)
        return increment.points, answer, loss

    def settle(self, start: At, w: float) -> At | Failed:
        """Returns the equilibrium at ``w`` to which the iterates from ``start`` lead. The cohesion
        and the ties that come apart on the way do not hold there, so that it is sought again
        without them."""
        while True:
            found = self._settle(start, w)
            if isinstance(found, At):
                found = replace(found, pace=self.pace([start], found))
            if start.bonds is None or isinstance(found, Failed):
                return found
            left = start.bonds.holding(found.pose)
            if not start.bonds.lost(left):
                return replace(found, bonds=left.after(found.pose))
            start = replace(start, bonds=left)

    def _settle(self, start: At, w: float) -> At | Failed:
        """Returns the equilibrium with all that holds at the start. Where nothing slides the
        associated one is also one without dilatancy, in half the time."""
        if self.has_dilatancy or not start.slides:
            found = self._associated(start, w)
            if self.has_dilatancy:
                return found
            if isinstance(found, At) and not found.slides:
                loss = found.shown.points.lost(found.shown.forces) / self._work(start, w)
                return replace(found, shown=replace(found.shown, loss=loss))
        found = self._without_dilatancy(start, w)
        if isinstance(found, Failed) and start.pace is not None:  # after a snap it leads far off
            found = self._without_dilatancy(replace(start, pace=None), w)
        return found

    @property
    def unit(self) -> float:
        """What load factors are compared with: the first one; reactions of supports that move with
        the weight."""
        if self.motions:
            return self.scene.total_weight * self.loads.pace
        return abs(self.found[0].shown.load_factor)

    def _work(self, start: At, w: float) -> float:
        """Returns the live load's work from ``start`` on at the first load factor, over which
        losses count."""
        return self.unit * (w - start.shown.w) * self.loads.size

    def start(self, at: At) -> Start:
        if at.pose is self.begin.pose:
            return self.begin if at.bonds is None else replace(self.begin, bonds=at.bonds)
        return Start.at(self.facets, at.pose, at.loose, at.bonds)

    def out_of_symmetry(self, at: At) -> float:
        """Returns how far blocks are from the mirror images of their partners (length) in a scene
        that is symmetric; 0 in others."""
        if self.mirror is None:
            return 0.0
        image = self.mirror.reflection
        d = at.pose.since(self.begin.pose, self.scene.free)
        return float(self.moved(d - d[self.mirror.blocks] @ image.T).max())

    def moved(self, d: FloatArray) -> FloatArray:
        """Returns how far each free block moves (length) by ``d`` (free blocks, 6)."""
        return np.linalg.norm(d[:, :3], axis=1) + np.linalg.norm(d[:, 3:], axis=1) * self.radius

    def distance(self, one: At, other: At) -> float:
        """Returns how far any block has moved between two configurations (length)."""
        free = self.scene.free
        shift = np.linalg.norm(one.pose.shift[free] - other.pose.shift[free], axis=1)
        turn = np.linalg.norm(one.pose.turn[free] - other.pose.turn[free], axis=(1, 2))
        return float((shift + turn * self.radius).max())

    def off(self, pose: Pose, w: float) -> float:
        """Returns how far supports are from where their motion has them at ``w`` (length)."""
        return float(self.moved(pose.since(self.loads.placed(pose, w), self.scene.free)).max())

    def _no_answer(self, answer: Outcome, w: float, moved: FloatArray) -> Failed:
        is_blocked = answer.claims_no_optimum and "unbounded" in answer.status
        return Failed(w, "blocked" if is_blocked else "falls", moved)

    def _associated(self, start: At, w: float) -> At | Failed:
        """Returns the equilibrium at ``w`` with dilatancy, where an increment moves nothing."""
        begin, pose, before, step, last = self.start(start), start.pose, np.inf, 1.0, None
        moved = np.zeros(len(self.scene.free))
        for iterate in range(1, _MANY + 1):
            points, number = begin.numbered(pose)
            push = self.loads.push(w, start.pose, pose)
            near = Near(*last, number) if last else None
            answer = self.increment(points, pose).solve(push, near=near)
            if not isinstance(answer, Found):
                return self._no_answer(answer, w, moved)
            moved = self.moved(answer.d)
            size = float(moved.max()) / self.size
            if size <= (ROUNDING if iterate < _FEW else SETTLED):
                found = self._shown(pose, points, answer, w, size, iterate)
                apart = Start.at(self.facets, pose, found.loose).points(pose)
                if apart.gap.min(initial=0.0) < -CLOSED * self.size:
                    return Failed(w, "not-converged", moved)
                return found
            # Where mechanisms compete, whole iterates go to and fro between them: the next one is
            # twice as long where at least half of what this one should have brought came of it.
            is_falling = size < (1.0 - 0.5 * step) * before
            share = min(1.0, 2.0 * step) if is_falling else max(0.5 * step, 0.125)
            before = size
            if iterate >= _FEW and size > FAR:
                break
            step = share if iterate > 4 else 1.0
            pose = self.loads.moved(pose, step * answer.d)
            last = (answer, step, number) if size < FAR else None
        return Failed(w, "not-converged", moved)

    def _without_dilatancy(self, start: At, w: float) -> At | Failed:
        """Returns the equilibrium at ``w`` without dilatancy. Every iterate solves two problems on
        exact geometry: friction for the slips so far, then displacements with friction of these
        forces. Where slips keep changing direction the iterate with the least loss counts."""
        begin, pose, size = self.start(start), start.pose, np.inf
        moved, best = np.zeros(len(self.scene.free)), None
        work = self._work(start, w)
        if start.pace is not None:  # on as they came here, or begin to move
            pose = self.loads.moved(pose, start.pace * (w - start.shown.w))
        for iterate in range(1, _MANY + 1):
            points = begin.points(pose)
            push = self.loads.push(w, start.pose, pose)
            increment = self.increment(points, pose)
            slides = np.linalg.norm(points.slip, axis=1)
            if iterate == 1 and start.pace is None:  # as if points slid as far as the live load
                slides = np.full(len(points), push / self.loads.size * self.loads.pace)
            forces = increment.priced(push, slides, LEAST * self.size)
            if not isinstance(forces, Found):
                return best or self._no_answer(forces, w, moved)
            answer = increment.held(push, forces.forces[:, 0])
            if not isinstance(answer, Found):
                return best or self._no_answer(answer, w, moved)
            moved = self.moved(answer.d)
            size = float(moved.max()) / self.size
            is_still = size <= ROUNDING
            overrun = points.depth > 10.0 * ROUNDING * self.size
            if not overrun and (is_still or (2 * iterate > _FEW and size <= FAR)):
                loss = points.lost(forces.forces) / work
                is_closed = points.bearing_gap(forces.forces) <= FAR * self.size
                if is_closed and loss <= (best.shown.loss if best else SMALL):
                    left = w * self.loads.size - self.loads.work(pose)[1]
                    at = w - left / self.loads.size
                    best = self._shown(pose, points, forces, at, size, iterate, loss)
                if is_still or (best is not None and best.shown.loss <= SLIDING):
                    break
            pose = self.loads.moved(pose, answer.d)
        return best or Failed(w, "not-converged", moved)

    def _shown(
        self, pose: Pose, points: Points, answer: Found | Ahead, w: float, residual: float,
        iterates: int, loss: float = 0.0,
    ) -> At:  # fmt: skip
        free = self.scene.free
        turn = Rotation.from_matrix(pose.turn[free]).as_rotvec()
        each = np.concatenate([pose.shift[free], turn], axis=1)
        shown = Configuration(
            self.scene, w, answer.load_factor,
            {self.scene.blocks[i].id: d for i, d in zip(free.tolist(), each, strict=True)},
            points, answer.forces, None, 0.0, residual, iterates, loss,
        )  # fmt: skip
        return At(pose, shown, *self._slid(shown))

    def followed(
        self, pose: Pose, points: Points, ahead: Ahead, w: float, before: float
    ) -> At:  # fmt: skip
        """Returns a configuration that an explicit step led to, from one at w ``before``. Forces
        that lack equilibrium may hold more than any that are in it: then the configuration has the
        step's forces without what moving costs, at the points that its own have closed."""
        push = (w - before) * self.loads.size
        least = CLOSED * self.size + points.bearing_gap(ahead.forces, self.flow)
        closed = points.closed(self.flow, least)
        balanced = self.increment(closed, pose).solve(push)
        found: tuple[Points, Found | Ahead] = (points, ahead)
        if isinstance(balanced, Found) and balanced.load_factor < ahead.load_factor:
            found = closed, balanced
        loss = found[0].lost(found[1].forces, self.flow) / (self.unit * push)
        at = self._shown(pose, *found, w, ahead.residual, 1, loss)
        shown = replace(at.shown, is_followed=True)
        return At(pose, shown, *self._slid(shown))

    def _slid(self, shown: Configuration) -> tuple[float, bool]:
        """Returns the widest gap opened by slips at points that bear, and whether any slid."""
        points, n = shown.points, shown.points.chosen(shown.forces)
        bears = n > CLOSED * n.max(initial=0.0)
        is_opened = bears & (points.distance <= CLOSED * self.size) & self.has_dilatancy
        opened = points.gap[bears if shown.is_followed else is_opened]
        slip = points.friction[bears] * np.linalg.norm(points.slip[bears], axis=1)
        return float(opened.max(initial=0.0)), bool((slip > CLOSED * self.size).any())
