"""The path of a structure in finite displacements, followed by the live load's mean displacement w.

At each w blocks are in equilibrium near where they were before (:mod:`.resting`), at the load
factor that is its multiplier. From one configuration to the next

1. w goes on by a step, which is halved where no equilibrium is found, down to ``FINEST`` of the
   longest: there the path ends, since the structure falls or cannot move on;
2. a jump on the way is noticed where something came apart, where blocks moved much farther than at
   the pace before, or where the dead load has not gained the work that the load factors stand for;
   it is enclosed by halvings of w (:mod:`.jumps`), and both its ends belong to the path;
3. where the load factor falls below the one that is asked for, the end is placed between the two;
4. otherwise the configuration is kept, with its bracket, and the next step is up to twice as long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from time import perf_counter

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.paths.bonds import Bonds
from cvxlimit.extensions.paths.configuration import Configuration, Flow, Points
from cvxlimit.extensions.paths.increment import Ahead
from cvxlimit.extensions.paths.jumps import JUMP, jump_between, may_have_jumped, work_beside
from cvxlimit.extensions.paths.pairs import CLOSED, Pose
from cvxlimit.extensions.paths.path import SLIDING, ZERO, Ending, Path, Work
from cvxlimit.extensions.paths.proof import bracket_of
from cvxlimit.extensions.paths.resting import LEFT, At, Failed, Rest
from cvxlimit.extensions.paths.supports import SupportLoads, falling
from cvxlimit.scene import Scene
from cvxlimit.scene.settling import SupportMotion
from cvxlimit.solution.bracket import Bracket

FINEST = 1e-3
"""Share of the longest step so far without an equilibrium nearer than which the structure falls."""

MOST = 400
"""Configurations after the first that a path may have."""

LEVEL_FOR = "joints slide at a level load factor for as far as contacts reach"

_FIRST = 40
"""Steps over the contact size, where no step is given, with which a path begins."""

_STEPS = 8
"""Steps to the load factor asked for, as the last slope has it; none is longer than this part of
the contact size."""

_PAST = 1.5
"""How far beyond the zero that the slope foresees a step is shortened, over the way to it."""

BEYOND = 1e-4
"""Gap over the contact size up to which points count as closed where nothing is carried: more
points carry more, and blocks that go on straight from their last step open joints by a little."""


class Walk(Rest):
    """A path under way: the configurations so far, and the steps that lead on."""

    def __init__(
        self, scene: Scene, certify: str, reach: float, tell: Callable[[str], None], flow: Flow,
        stretch: float = 0.0, motions: Sequence[SupportMotion] = (), far: float = 0.0,
    ) -> None:  # fmt: skip
        super().__init__(scene, reach, flow, stretch, motions)
        # How far supports are to move: as far as they can, unless that is given.
        self.most = min(self.loads.most, far if motions and far > 0.0 else np.inf)
        self.certify, self.tell, self.began = certify, tell, perf_counter()
        self.snaps: list[float] = []
        self.step = 0.0

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
            at = At(pose, shown, *self._slid(shown), bonds)
            self.found.append(replace(at, pace=self.pace(self.found[-1:], at)))

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
        shown = replace(shown, bracket=bracket, widest_gap=widest)
        if self.motions:
            largest = self.largest_of(shown.points, found.pose, least)
            shown = replace(shown, largest=largest)
        return replace(found, shown=shown)

    def largest_of(self, points: Points, pose: Pose, least: float) -> Bracket:
        """Returns the largest reaction of supports that move: with their push turned round."""
        back = SupportLoads(self.scene, self.motions, -1.0)
        return bracket_of(self.scene, points, pose, back, self.flow, least)[0]

    @property
    def finest(self) -> float:
        """Step without an equilibrium nearer than which the structure falls. How far supports may
        move is what their path is made for: a digit more."""
        return (0.1 if self.motions else 1.0) * FINEST * self.step

    def keep(self, found: At) -> None:
        """Add a configuration to the path, with its bracket if all are to have one."""
        found = self.proved(found) if self.certify == "all" else found
        self.found.append(found)
        seconds = perf_counter() - self.began
        at, factor = found.shown.w, found.shown.load_factor
        self.tell(f"w = {at:.6g}: load factor {factor:.6g}, after {seconds:.0f} s")

    def walk(
        self, step: float | None, until: float, is_level: Callable[[], bool],
        marks: FloatArray | None = None,
    ) -> tuple[Ending, str]:  # fmt: skip
        """Go on until the load factor is ``until``, the path ``is_level`` or ends otherwise, and
        return how and why. Steps lead from one of the ``marks`` (w) to the next, and are ``step``
        beyond them."""
        if not self.found:
            first = self.first()
            if isinstance(first, Failed):
                return "not-converged", "the first configuration has no solution"
            self.keep(first)
        if self.found[-1].shown.load_factor <= until:
            since = "from the start" if len(self.found) == 1 else "where blocks are followed"
            return "zero", f"the load factor is no more than {until:g} {since}"
        h, pace = self._first_step(step, marks), np.inf
        while len(self.found) <= MOST and not self.is_far:
            # One step, halved where no equilibrium is found.
            here = self.found[-1]
            h = min(h, self.most - here.shown.w)
            there = self.settle(here, here.shown.w + h)
            if isinstance(there, Failed):
                h *= 0.5
                if h < self.finest:
                    return there.kind, self.why(there.kind, there.moved)
                continue
            # No step leads over a zero that the slope so far has on its way.
            if self._may_have_passed(here, there, until) and h > FINEST * self.step:
                h = min(0.5 * h, _PAST * self._way_left(here, until))
                continue
            # A jump on the way is enclosed, and both its ends belong to the path.
            jump = self._jump(here, there, pace)
            if jump is not None:
                before, after = jump
                for each in before:
                    if each.shown.load_factor <= until + self.enough(each):
                        return "zero", self._brought_down(self.found[-1], each, until)
                    self.keep(each)
                self._keep_jump(after, self.distance(here, there) / (there.shown.w - here.shown.w))
                if self.found[-1].shown.load_factor <= until:
                    return "zero", f"the load factor drops below {until:g} in a snap"
                pace = np.inf
                continue
            # The end is placed where the load factor is the one asked for.
            pace = self.distance(here, there) / h
            if there.shown.load_factor <= until + self.enough(there):
                return "zero", self._brought_down(here, there, until)
            self.keep(there)
            if is_level():
                return "slides", LEVEL_FOR
            # The next step: to the next mark, or up to twice as long.
            if marks is not None:
                h = self._to_next(marks)
            else:
                h = min(step, 2.0 * h) if step else self._longer(h, here, there, until)
        return self.used_up(until)

    def has_come(self, until: float) -> bool:
        """Returns whether the last configuration is where the path was to end: at a load factor, or
        where supports have moved as far as they should."""
        here = self.found[-1]
        return self.is_far if self.motions else here.shown.load_factor - until <= self.enough(here)

    @property
    def lasts(self) -> bool:
        """Whether explicit steps know all that holds from the last configuration on."""
        bonds = self.found[-1].bonds
        return bonds is None or bonds.lasts

    @property
    def is_far(self) -> bool:
        """Whether supports have moved as far as they should."""
        return self.found[-1].shown.w >= self.most - CLOSED * self.step

    def used_up(self, until: float) -> tuple[Ending, str]:
        """Returns the end of a path that had its number of configurations, or whose supports have
        moved as far as they should, and in words why."""
        if self.is_far and self.most < self.loads.most:
            return "zero", f"supports have moved by {self.most:g}, as was asked for"
        if self.is_far:
            return "steps", "supports have made a quarter turn, as far as they are followed"
        if self.motions:
            return "steps", f"{MOST} steps, and the dead load is still carried"
        return "steps", f"{MOST} steps did not bring the load factor down to {until:g}"

    def _first_step(self, step: float | None, marks: FloatArray | None) -> float:
        """Returns the step to begin with: the one given, up to the next mark, and after explicit
        steps as far as these went."""
        h = self.step = step or self.size / (_FIRST * self.loads.pace)
        if marks is not None:
            h = self._to_next(marks)
        if len(self.found) > 1 and self.found[-2].shown.is_followed:
            h = min(h, self.found[-1].shown.w - self.found[-2].shown.w)
        return h

    def _way_left(self, here: At, until: float) -> float:
        """Returns how far w is from where the load factor is ``until``, as the slope up to here has
        it; infinite at first and where it does not fall."""
        if len(self.found) < 2:
            return np.inf
        before = self.found[-2].shown
        fall, way = before.load_factor - here.shown.load_factor, here.shown.w - before.w
        return (here.shown.load_factor - until) * way / fall if fall > 0.0 else np.inf

    def _may_have_passed(self, here: At, there: At, until: float) -> bool:
        """Returns whether the load factor, which was falling, is higher again at the end of a step
        on whose way it should have come down to ``until``."""
        is_up = there.shown.load_factor > max(here.shown.load_factor, until + self.enough(there))
        return is_up and self._way_left(here, until) < there.shown.w - here.shown.w

    def _jump(self, here: At, there: At, pace: float) -> tuple[list[At], At] | None:
        """Returns what leads to a jump between two configurations, and what is behind it; None
        where there is none."""
        if not (here.lost(there) or may_have_jumped(self, here, there, pace)):
            return None
        return jump_between(self, here, there, FINEST * self.step)

    def _keep_jump(self, after: At, pace: float) -> None:
        """Keeps what is behind a jump from the last configuration. It is a snap if blocks move
        ``JUMP`` times as fast in it as on the whole way, at ``pace``: else a contact closed, and
        the curve goes up."""
        low = self.found[-1]
        if self.distance(low, after) / (after.shown.w - low.shown.w) > JUMP * pace:
            self.snaps.append(low.shown.w)
        self.keep(after)

    def _brought_down(self, here: At, there: At, until: float) -> str:
        """Keeps the last configuration of the path, between two of which the second carries no more
        than ``until``, and returns in words how it got there."""
        end = self._end(here, there, until)
        self.keep(end)
        if end.shown.load_factor >= until - self.enough(end):
            return f"the load factor has come down to {until:g}"
        if end.shown.w - here.shown.w <= FINEST * self.step:
            self.snaps.append(here.shown.w)
            return f"the load factor drops below {until:g} in a snap"
        fall = f"{here.shown.load_factor:.4g} to {end.shown.load_factor:.4g}"
        return f"the load factor falls from {fall}: iterates between do not settle"

    def _longer(self, h: float, here: At, there: At, until: float) -> float:
        """Returns a step after one of ``h``, where none is given: twice as long, at most a share of
        the contact size, and of what the last slope takes to ``until``."""
        fall = here.shown.load_factor - there.shown.load_factor
        fall /= there.shown.w - here.shown.w
        left = (there.shown.load_factor - until) / max(fall, 1e-300)
        h = min(2.0 * h, (there.shown.w + left) / _STEPS, self.size / (_STEPS * self.loads.pace))
        self.step = max(h, self.step)
        return h

    def fallen(self) -> Configuration | None:
        """Returns a configuration behind the last one at which no forces carry the dead load: the
        blocks have gone on as they went before, by a step of the finest and by shorter ones."""
        if len(self.found) < 2:
            return None
        before, here = self.found[-2:]
        free, way = self.scene.free, here.shown.w - before.shown.w
        d = here.pose.since(before.pose, free)
        for share in (1.0, 2.0, 4.0, 8.0):
            w = here.shown.w + share * self.finest
            pose = self.loads.moved(here.pose, d * ((w - here.shown.w) / way))
            points = self.start(here).points(pose)
            points = points.closed(self.flow, BEYOND * self.size)
            if falling(self.increment(points, pose)) is not None:
                none = Ahead(0.0, np.zeros((len(points), 3)), d, 0.0)
                return self._shown(pose, points, none, w, 0.0, 0).shown
        return None

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
        return tuple((x.shown.w, name) for x, y in pairwise(self.found) for name in x.lost(y))

    def _to_next(self, marks: FloatArray) -> float:
        """Returns the distance from here to the next mark that is farther off than a jump."""
        ahead = marks - self.found[-1].shown.w
        ahead = ahead[ahead > FINEST * self.step]
        return float(ahead[0]) if len(ahead) else self.step

    def enough(self, found: At) -> float:
        """Returns how near to its end a path has to come, as a difference of load factors."""
        share = SLIDING if found.slides else 0.1 * ZERO
        return share * self.unit

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

        with suppress(ArithmeticError):  # where iterates do not settle on the way
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
        each = [work_beside(self, x, y) for x, y in pairwise(self.found)]
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
