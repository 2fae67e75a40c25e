"""The path of a structure in finite displacements: steps of the live load's mean displacement w.

A step seeks the blocks' next equilibrium at a given w: one convex problem after the other on exact
geometry (:mod:`.increment`), until it moves nothing any more. The load factor is its multiplier.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.paths.bonds import Bonds
from cvxlimit.extensions.paths.configuration import CLOSED, Configuration, Flow, Points
from cvxlimit.extensions.paths.increment import Ahead, Found, Increment, Loads, Near
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.extensions.paths.path import SLIDING, ZERO, Ending, Path, Work
from cvxlimit.extensions.paths.points import SETTLED, Start
from cvxlimit.extensions.paths.proof import bracket_of
from cvxlimit.scene import Scene
from cvxlimit.solvers import Outcome

REACH = 0.2
"""Facets within this share of the contact size of each other may meet in a step; blocks that were
farther off and are in each other after it make the step too long."""

_STILL = 1e-9
"""Movement over the contact size that an iterate may still ask for: a tenth of what blocks may be
in each other, and ten times what solvers leave."""

_SURE, _FEW, _MANY = 6, 12, 24
"""Iterates: rocking takes 3 to 6, and sliding where slips keep their direction; what has not
settled in 24 has not settled in 60. After twelve ``SETTLED`` is enough: digits end where
mechanisms compete."""

_FAR = 1e-3
"""Movement over the contact size from which two iterates lead to the end, each from the answer
before; still farther off after twelve, mechanisms compete, and half the step takes less time."""

_LOST = 1e-2
"""Share of a step's work that friction without dilatancy may lack: no load factor between two
equilibria is told to less where joints slide. Iterates end at once below ``SLIDING``."""

FARTHEST, LEFT = 0.05, 0.05**2
"""Largest movement of an explicit step over the contact size, and what its linearisation leaves of
gaps; what would go farther goes on in several steps."""

_TURN = 0.5
"""Largest rotation of an iterate, in radians: a tangent says nothing beyond."""

FINEST, _STEPS, MOST = 1e-3, 8, 400
"""Share of the first step without an equilibrium nearer than which the structure falls; steps to
the load factor asked for, as the last slope has it; configurations of a path."""

_AHEAD, JUMP = 1.5, 4.0
"""Blocks that move so many times as far as at the pace before may have jumped, and where joints
slide, which change their pace as they like."""


@dataclass(frozen=True, eq=False)
class At:
    """A configuration (``shown``), its pose, the gap that its slips have opened (``loose``,
    length), whether any joint slid, and the cohesion, ties and reactions from there on."""

    pose: Pose
    shown: Configuration
    loose: float
    slides: bool
    bonds: Bonds | None = None


@dataclass(frozen=True, eq=False)
class Failed:
    """An equilibrium that was not found at ``w``: how the path ends there, and how far each free
    block ``moved`` in the last iterate (free blocks,)."""

    w: float
    kind: Ending
    moved: FloatArray


class Walk:
    """A path under way: the configurations so far, and the steps that lead on."""

    def __init__(
        self, scene: Scene, certify: str, reach: float, tell: Callable[[str], None], flow: Flow,
        stretch: float = 0.0,
    ) -> None:  # fmt: skip
        self.scene, self.certify, self.tell, self.flow = scene, certify, tell, flow
        self.has_dilatancy = flow == "associated"
        self.size = scene.contacts.typical_size
        self.loads = Loads(scene)
        self.radius = np.array([
            np.linalg.norm(b.vertices - b.centroid, axis=1).max()
            for b in (scene.blocks[i] for i in scene.free)
        ])  # fmt: skip
        bonds = Bonds.first(scene, stretch)
        self.begin = replace(Start.first(scene, reach), bonds=bonds)
        self.facets = self.begin.facets
        self.found: list[At] = []
        self.snaps: list[float] = []
        self.step = 0.0

    def first(self) -> At | Failed:
        """Returns the configuration of the scene as given, at the largest load factor."""
        pose = self.begin.pose
        points = self.begin.points(pose)
        points = points.take(points.gap <= CLOSED * self.size)
        increment, loss = Increment(self.scene, points, pose, self.loads), 0.0
        answer = increment.solve(None)
        if isinstance(answer, Found) and not self.has_dilatancy:
            push = self.size * self.loads.size
            answer, loss = increment.rates_without_dilatancy(push, SLIDING)
        if not isinstance(answer, Found):
            return Failed(0.0, "not-converged", np.zeros(len(self.scene.free)))
        shown = self._shown(pose, points, answer, 0.0, 0.0, 1, loss)
        return replace(shown, bonds=self.begin.bonds)

    def settle(self, start: At, w: float) -> At | Failed:
        """Returns the equilibrium at ``w`` to which the iterates from ``start`` lead. The cohesion
        and the ties that come apart on the way do not hold there, so that it is sought again
        without them."""
        while True:
            found = self._settle(start, w)
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
        return self._without_dilatancy(start, w)

    def _work(self, start: At, w: float) -> float:
        """Returns the live load's work from ``start`` on at the first load factor, over which
        losses count."""
        return abs(self.found[0].shown.load_factor) * (w - start.shown.w) * self.loads.size

    def start(self, at: At) -> Start:
        if at.pose is self.begin.pose:
            return self.begin if at.bonds is None else replace(self.begin, bonds=at.bonds)
        return Start.at(self.facets, at.pose, at.loose, at.bonds)

    def moved(self, d: FloatArray) -> FloatArray:
        """Returns how far each free block moves (length) by ``d`` (free blocks, 6)."""
        return np.linalg.norm(d[:, :3], axis=1) + np.linalg.norm(d[:, 3:], axis=1) * self.radius

    def _moved(self, answer: Found) -> tuple[FloatArray, float]:
        """Returns how far an increment moves each free block (length), and the largest share of it
        for which its linearisation holds."""
        turned = np.linalg.norm(answer.d[:, 3:], axis=1)
        return self.moved(answer.d), _TURN / max(float(turned.max()), 1e-300)

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
            answer = Increment(self.scene, points, pose, self.loads).solve(push, near)
            if not isinstance(answer, Found):
                return self._no_answer(answer, w, moved)
            moved, most = self._moved(answer)
            size = float(moved.max()) / self.size
            if size <= (_STILL if iterate < _FEW else SETTLED):
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
            if iterate >= _FEW and size > _FAR:
                break
            step = min(share if iterate > 4 else 1.0, most)
            pose = pose.moved(self.scene.free, step * answer.d)
            last = (answer, step, number) if size < _FAR else None
        return Failed(w, "not-converged" if size < 0.1 else "falls", moved)

    def _without_dilatancy(self, start: At, w: float) -> At | Failed:
        """Returns the equilibrium at ``w`` without dilatancy. Every iterate solves two problems on
        exact geometry: friction for the slips so far, then displacements with friction of these
        forces. Where slips keep changing direction the iterate with the least loss counts."""
        begin, pose, size = self.start(start), start.pose, np.inf
        moved, best = np.zeros(len(self.scene.free)), None
        work = self._work(start, w)
        for iterate in range(1, _MANY + 1):
            points = begin.points(pose)
            push = self.loads.push(w, start.pose, pose)
            increment = Increment(self.scene, points, pose, self.loads)
            slides = np.linalg.norm(points.slip, axis=1)
            if iterate == 1:  # as if every point slid as far as the live load goes
                slides = np.full(len(points), push / self.loads.size)
            forces = increment.priced(push, slides)
            if not isinstance(forces, Found):
                return best or self._no_answer(forces, w, moved)
            answer = increment.held(push, forces.forces[:, 0])
            if not isinstance(answer, Found):
                return best or self._no_answer(answer, w, moved)
            moved, most = self._moved(answer)
            size = float(moved.max()) / self.size
            is_still = size <= _STILL
            overrun = points.depth > 10.0 * _STILL * self.size
            if not overrun and (is_still or (iterate > _SURE and size <= _FAR)):
                loss = points.lost(forces.forces) / work
                is_closed = points.bearing_gap(forces.forces) <= _FAR * self.size
                if is_closed and loss <= (best.shown.loss if best else _LOST):
                    left = w * self.loads.size - self.loads.work(pose)[1]
                    at = w - left / self.loads.size
                    best = self._shown(pose, points, forces, at, size, iterate, loss)
                if is_still or (best is not None and best.shown.loss <= SLIDING):
                    break
            pose = pose.moved(self.scene.free, min(1.0, most) * answer.d)
        return best or Failed(w, "not-converged" if size < 0.1 else "falls", moved)

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
        """Returns a configuration that an explicit step led to, from one at w ``before``."""
        work = abs(self.found[0].shown.load_factor) * (w - before) * self.loads.size
        loss = points.lost(ahead.forces, self.flow) / work
        at = self._shown(pose, points, ahead, w, ahead.residual, 1, loss)
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

    def resume(self, path: Path) -> None:
        """Take over the configurations of a path, to go on from its end."""
        self.snaps, self.step = [*path.snaps], path.step
        before = 0.0
        for shown in path:
            pose = shown.pose
            bonds = self.found[-1].bonds if self.found else self.begin.bonds
            if bonds is not None:
                lost = [what for at, what in path.failures if self.found and at == before]
                bonds = bonds.without(lost).after(pose)
            before = shown.w
            self.found.append(At(pose, shown, *self._slid(shown), bonds))

    def proved(self, found: At) -> At:
        """Returns a configuration with its bracket. One that is followed has none where forces bear
        across wider gaps than linearised steps leave, nor where both ends are not proved."""
        shown = found.shown
        least = shown.bearing_gap(self.flow)
        if shown.is_followed and least > LEFT * self.size:
            return found
        bracket, widest = bracket_of(
            self.scene, shown.points, found.pose, self.loads, self.flow, least
        )
        if shown.is_followed and not bracket.is_proved:
            return found
        return replace(found, shown=replace(shown, bracket=bracket, widest_gap=widest))

    def keep(self, found: At) -> None:
        """Add a configuration to the path, with its bracket if all are to have one."""
        found = self.proved(found) if self.certify == "all" else found
        self.found.append(found)
        self.tell(f"w = {found.shown.w:.6g}: load factor {found.shown.load_factor:.6g}")

    def distance(self, one: At, other: At) -> float:
        """Returns how far any block has moved between two configurations (length)."""
        free = self.scene.free
        shift = np.linalg.norm(one.pose.shift[free] - other.pose.shift[free], axis=1)
        turn = np.linalg.norm(one.pose.turn[free] - other.pose.turn[free], axis=(1, 2))
        return float((shift + turn * self.radius).max())

    def walk(
        self, step: float | None, until: float, marks: FloatArray | None = None
    ) -> tuple[Ending, str]:
        """Go on until the load factor is ``until`` or the path ends otherwise, and return how and
        why. Steps lead from one of the ``marks`` (w) to the next, and are ``step`` beyond them."""
        if not self.found:
            first = self.first()
            if isinstance(first, Failed):
                return "not-converged", "the first configuration has no solution"
            self.keep(first)
        if self.found[-1].shown.load_factor <= until:
            return "zero", f"the load factor is no more than {until:g} from the start"
        h = self.step = step or self.size / 40.0
        h = h if marks is None else self._to_next(marks)
        before = self.found[-2:-1]
        if before and before[0].shown.is_followed:  # as far as explicit steps went
            h = min(h, self.found[-1].shown.w - before[0].shown.w)
        pace = np.inf
        while len(self.found) <= MOST:
            # One step, halved where no equilibrium is found.
            here = self.found[-1]
            there = self.settle(here, here.shown.w + h)
            if isinstance(there, Failed):
                h *= 0.5
                if h < FINEST * self.step:
                    return there.kind, self.why(there.kind, there.moved)
                continue
            # A jump on the way is enclosed, and both its ends belong to the path.
            may_have = self.lost(here, there) or self._may_have_jumped(here, there, pace)
            jump = self._jump(here, there) if may_have else None
            if jump is not None:
                *_, low, high = jump
                for each in jump[:-1]:
                    if each is not here:
                        self.keep(each)
                way, whole = (y.shown.w - x.shown.w for x, y in ((low, high), (here, there)))
                if self.distance(low, high) / way > JUMP * self.distance(here, there) / whole:
                    self.snaps.append(low.shown.w)  # else a contact closed, and the curve goes up
                self.keep(high)
                if high.shown.load_factor <= until:
                    return "zero", f"the load factor drops below {until:g} in a snap"
                pace = np.inf
                continue
            # The end is placed where the load factor is the one asked for.
            pace = self.distance(here, there) / h
            if there.shown.load_factor <= until + self.enough(there):
                end = self._end(here, there, until)
                self.keep(end)
                if end.shown.load_factor >= until - self.enough(end):
                    return "zero", f"the load factor has come down to {until:g}"
                if end.shown.w - here.shown.w <= FINEST * self.step:
                    self.snaps.append(here.shown.w)
                    return "zero", f"the load factor drops below {until:g} in a snap"
                parts = (f"{x.shown.load_factor:.4g}" for x in (here, end))
                between = "iterates between do not settle"
                return "zero", f"the load factor falls from {' to '.join(parts)}: {between}"
            self.keep(there)
            h = 2.0 * h if step is None else min(step, 2.0 * h)
            if marks is not None:
                h = self._to_next(marks)
            elif step is None:
                fall = here.shown.load_factor - there.shown.load_factor
                fall /= there.shown.w - here.shown.w
                left = (there.shown.load_factor - until) / max(fall, 1e-300)
                h = min(h, (there.shown.w + left) / _STEPS, self.size / _STEPS)
                self.step = max(h, self.step)
        return "steps", f"{MOST} configurations did not bring the load factor down to {until:g}"

    def lost(self, one: At, other: At) -> tuple[str, ...]:
        """Returns what has come apart from one configuration to the other: cohesion and ties."""
        return one.bonds.lost(other.bonds) if one.bonds and other.bonds else ()

    def bonds_at(self, i: int) -> Bonds | None:
        """Returns the cohesion, the ties and the reactions that hold at configuration ``i``, these
        with the seats that they had before."""
        at, before = self.found[i].bonds, self.found[max(i - 1, 0)].bonds
        if at is None or before is None or i == 0:
            return self.begin.bonds
        return replace(before, is_whole=at.is_whole,
                       seat=np.where(np.isnan(at.seat), np.nan, before.seat))  # fmt: skip

    def failures(self) -> tuple[tuple[float, str], ...]:
        """Returns where what has come apart, by w before it has."""
        return tuple((x.shown.w, name) for x, y in pairwise(self.found) for name in self.lost(x, y))

    def _beside_work(self, one: At, other: At) -> tuple[float, float]:
        """Returns the energy that is taken up between two configurations besides the dead load's
        work along its first directions, and what the live load does besides its own: loads that
        turn, and ties and reactions that give way."""
        dead, live = self.loads.of_turning(one.pose, other.pose)
        yields = one.bonds.yielded(other.bonds) if one.bonds and other.bonds else 0.0
        return yields - dead, live

    def _to_next(self, marks: FloatArray) -> float:
        """Returns the distance from here to the next mark that is farther off than a jump."""
        ahead = marks - self.found[-1].shown.w
        ahead = ahead[ahead > FINEST * self.step]
        return float(ahead[0]) if len(ahead) else self.step

    def _may_have_jumped(self, here: At, there: At, pace: float) -> bool:
        """Returns whether blocks moved much farther than at the ``pace`` so far, or the dead load's
        rise differs from the work that the load factors at both ends stand for."""
        ahead = JUMP if there.slides else _AHEAD
        if self.distance(here, there) > ahead * pace * (there.shown.w - here.shown.w):
            return True
        if there.slides:  # what slides changes direction without a jump
            return False
        more, farther = self._beside_work(here, there)
        rise = self.loads.work(here.pose)[0] - self.loads.work(there.pose)[0] + more
        way = self.loads.size * (there.shown.w - here.shown.w) + farther
        area = 0.5 * way * (here.shown.load_factor + there.shown.load_factor)
        return abs(rise - area) > 0.01 * way * abs(self.found[0].shown.load_factor)

    def _jump(self, here: At, there: At) -> list[At] | None:
        """Returns the last configuration before a jump and the first after it, if there is one, and
        before them what has led there, if it tells: the half in which more happens is halved again.
        Smooth changes spread over all sixteenths."""

        def happens(one: At, other: At) -> FloatArray:
            fall = abs(one.shown.load_factor - other.shown.load_factor)
            return np.array([fall, self.distance(one, other)])

        low, high, passed = here, there, list[At]()
        whole, halvings = np.maximum(happens(low, high), 1e-300), 0
        while high.shown.w - low.shown.w > FINEST * self.step or halvings < 4:
            middle = self.settle(low, 0.5 * (low.shown.w + high.shown.w))
            if isinstance(middle, Failed):
                return None
            halves = happens(low, middle) / whole, happens(middle, high) / whole
            low, high = (low, middle) if halves[0].sum() > halves[1].sum() else (middle, high)
            passed += [middle] * (low is middle)
            halvings += 1
            if halvings >= 4 and (happens(low, high) / whole).max() < 0.25:
                return None
        # Slips and seats count from configurations that the path keeps: it keeps all that led there
        # where these two do not say by themselves what has happened on the way.
        slides = any(each.slides for each in (there, *passed))
        if low is here or not (slides or self._seats_are_lost(here, low, high)):
            return [low, high]
        last = self.settle(low, high.shown.w)
        return None if isinstance(last, Failed) else [*passed, last]

    def _seats_are_lost(self, *each: At) -> bool:
        """Returns whether seats have moved farther between configurations than these show."""
        return any(
            (abs(x.bonds.after(y.pose).seat - y.bonds.seat) > CLOSED * self.size).any()
            for x, y in pairwise(each)
            if x.bonds and y.bonds
        )

    def enough(self, found: At) -> float:
        """Returns how near to its end a path has to come, as a difference of load factors."""
        share = SLIDING if found.slides else 0.1 * ZERO
        return share * abs(self.found[0].shown.load_factor)

    def _end(self, here: At, there: At, until: float) -> At:
        """Returns the configuration between two whose load factor is ``until``, or the nearest of
        those that carry less."""
        if there.shown.load_factor >= until - self.enough(there):
            return there
        found = {x.shown.w: x for x in (here, there)}

        def left(w: float) -> float:
            if w not in found:
                at = self.settle(here, w)
                if isinstance(at, Failed):
                    raise ArithmeticError
                found[w] = at
            rest = found[w].shown.load_factor - until
            return rest if abs(rest) > self.enough(found[w]) else 0.0

        with suppress(ArithmeticError):
            brentq(left, here.shown.w, there.shown.w, xtol=1e-14 * self.size)
        del found[here.shown.w]
        ends = [x for x in found.values() if x.shown.load_factor - until <= self.enough(x)]
        return min(ends, key=lambda x: abs(x.shown.load_factor - until))

    def why(self, kind: Ending, moved: FloatArray) -> str:
        """Returns a sentence about a failure, with the blocks that move most."""
        ids = [self.scene.blocks[i].id for i in self.scene.free]
        order = np.argsort(-moved, kind="stable")[:3]
        named = [ids[i] for i in order.tolist() if moved[i] > 0.3 * moved.max()]
        who = f"; blocks that move most: {', '.join(named)}" if named and moved.any() else ""
        what = {
            "falls": "no equilibrium follows",
            "blocked": "no load factor moves the blocks any farther",
        }.get(kind, "the iterates do not settle")
        return f"{what} beyond w = {self.found[-1].shown.w:.6g}{who}"

    def work(self) -> Work:
        """Returns the area under the curve and the potential, over the stretches between jumps; the
        two ends of a jump are nearer to each other than the finest step."""
        area = potential = 0.0
        w = np.array([x.shown.w for x in self.found])
        alpha = np.array([x.shown.load_factor for x in self.found])
        energy = np.array([-self.loads.work(x.pose)[0] for x in self.found])
        each = [self._beside_work(x, y) for x, y in pairwise(self.found)]
        more = np.cumsum([(0.0, 0.0), *each], axis=0)
        energy, way = energy + more[:, 0], w + more[:, 1] / self.loads.size
        near = np.flatnonzero(np.diff(w) <= FINEST * self.step) + 1
        jumps = np.union1d(near, np.searchsorted(w, self.snaps, side="right")).astype(int)
        for begin, end in pairwise([0, *jumps.tolist(), len(w)]):
            if end - begin > 1:
                curve = CubicSpline(way[begin:end], alpha[begin:end])
                area += self.loads.size * float(curve.integrate(way[begin], way[end - 1]))
                potential += float(energy[end - 1] - energy[begin])
        return Work(area, potential)


def configuration_at(path: Path, displacement: float) -> Configuration:
    """Returns the configuration where ``path.displacement`` first reaches ``displacement``, solved
    for between two of the path. After a snap, and where iterates between do not settle, as may
    happen where joints slide, it is the second of these, which carries less."""
    after = int(np.flatnonzero(path.displacement >= displacement)[0])
    there = path[after]
    same = path.displacement[after] - displacement <= _STILL * path.scene.contacts.typical_size
    if same or any(after == start for start, _ in path.pieces):
        return there
    size = path.scene.contacts.typical_size
    walk = Walk(path.scene, "all", REACH * size, lambda line: None, path.flow, path.stretch)
    walk.resume(path)
    here, found = walk.found[after - 1], dict[float, At]()

    def beyond(w: float) -> float:
        settled = walk.settle(here, w)
        if isinstance(settled, Failed):
            raise ArithmeticError
        found[w] = settled
        return float(replace(path, configurations=(settled.shown,)).displacement[0] - displacement)

    w = displacement
    with suppress(ArithmeticError):
        if path.control is not None:
            w = float(brentq(beyond, here.shown.w, there.w, xtol=_STILL * size))
        if w not in found:
            beyond(w)
    return walk.proved(found[w]).shown if w in found else there
