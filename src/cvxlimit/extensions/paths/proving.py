"""A path in finite displacements, proved again from what it holds and nothing else.

A path is a sequence of configurations q (displacements of the free blocks), each with the points at
which blocks touch, forces x at these, and the load factor alpha in equilibrium with them. What a
path claims of every configuration is checked from the scene and the displacements alone:

    w = work of the live load on q / size of the live load,     no block is in another,
    A(q) x + f_dead(q) + alpha f_live(q) = 0,     abs(v) <= mu n at every point,

forces act at points of the displaced blocks, friction without dilatancy lacks no more of opposing
its slip than is said, and the bracket is found again. From the configurations follows what the path
says of itself: that it begins at rest and goes on by no more than its step, whether joints slide,
where it jumps, and how it ends. That the structure gets from one configuration to the next, nobody
proves.

:func:`path_checks` lists the claims: of the scene at rest, and of each run, the path itself, the
one with half the step and the one by the other flow (:class:`RunAgain`). What holds of
configurations is said once for all of them, what does not, one by one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise
from typing import Any

import numpy as np

from cvxlimit.base.arrays import BoolArray
from cvxlimit.extensions.paths.configuration import CLOSED, Configuration, Points
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.following import FINEST, JUMP, MOST, Walk
from cvxlimit.extensions.paths.increment import Increment
from cvxlimit.extensions.paths.path import SLIDING, Path
from cvxlimit.extensions.paths.points import Start
from cvxlimit.extensions.paths.proof import bracket_of
from cvxlimit.extensions.paths.proximal import LACKS
from cvxlimit.extensions.paths.refusing import stands
from cvxlimit.extensions.paths.resting import LEFT, REACH, At
from cvxlimit.extensions.paths.starting import begun
from cvxlimit.io.scenes import scene_digest
from cvxlimit.methods.solving import solve
from cvxlimit.model.statics import DOF
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, follows, proved, unseen, unseen_fields
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.proving.solutions import solution_checks

_LOOKED_AT = (
    "initial", "configurations", "status", "flow", "step", "snaps", "work", "slides", "control",
    "halved", "other_flow", "until", "failures", "stretch",
)  # fmt: skip

Failures = Iterator[tuple[str, str]]
"""Claims of a configuration that do not hold, each with what was found instead."""


def prove_path(what: Any, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """A path, or what a file of one holds; see :func:`cvxlimit.prove`."""
    path = what if isinstance(what, Path) else PATH.from_dict(what)
    if scene is not None:
        scene_of(path.scene.name, scene_digest(path.scene), scene, BOTH_CASES)
    checks, held = [*path_checks(path)], path.initial and path.initial.scene_digest
    if held and held != scene_digest(path.scene):
        checks.append(Check("initial: scene_digest", False, "it is of another scene"))
    return Proof(f"path of scene {path.scene.name!r}", tuple(checks))


def path_checks(path: Path) -> Iterator[Check]:
    """Every claim of a path, checked."""
    if path.initial is None:
        is_met = begun(path.scene)[1] is not None or not stands(solve(path.scene))
        yield follows("a scene that starts displaced", is_met, "its dead load stands alone")
    else:
        for check in solution_checks(path.initial, path.scene):
            is_proof = check.kind == "proved" or not check.is_met
            which = "at rest, friction over whole joints" if is_proof else "initial"
            yield replace(check, claim=f"{which}: {check.claim}")
    yield from RunAgain(path, "").checks()
    half, other = path.halved, path.other_flow
    if half is not None:
        yield from RunAgain(half, " with half the step").checks()
        is_half = half.step <= 0.5 * path.step * (1.0 + FINEST)
        yield follows("half the step", is_half, f"it is {half.step:.6g}")
    elif path.slides:
        yield unseen("what half the step changes", "there is no run with it")
    if other is not None:
        yield from RunAgain(other, " by the other flow").checks()
        yield follows("the other flow", other.flow != path.flow, f"it is {other.flow}")
    elif path.followed:
        yield unseen("what the other flow changes", "there is no run with it")
    yield from unseen_fields(path, _LOOKED_AT)
    yield unseen("residual and iterates of configurations")


class RunAgain:
    """One run of a path, called ``which``, and the walk that would have made it."""

    def __init__(self, path: Path, which: str) -> None:
        size = path.scene.contacts.typical_size
        walk = Walk(path.scene, "none", REACH * size, lambda line: None, path.flow, path.stretch)
        walk.resume(path)
        self.path, self.which, self.walk, self.size = path, which, walk, size

    def checks(self) -> Iterator[Check]:
        """All claims of the run: its configurations, what follows from them, and its ends."""
        path, which, wrong = self.path, self.which, set[int]()
        for i in range(len(path)):
            again = ConfigurationAgain(self.walk, path, i)
            for claim, found in again.failures():
                wrong.add(i)
                yield Check(f"{claim} of configuration {i}{which}", False, found)
        if good := [c for i, c in enumerate(path) if i not in wrong]:
            bracketed = sum(c.bracket is not None for c in good)
            said = f"{len(good)} configurations{which} in equilibrium, {bracketed} of them with "
            said += "brackets"
            if lacks := [c.residual for c in good if c.is_followed]:
                said += f"; {len(lacks)} are followed and lack up to {max(lacks):.0e} of it"
            yield Check(said, True)
        for check in (*self._course(), self._work()):
            yield replace(check, claim=f"{check.claim}{which}")

    def _course(self) -> Iterator[Check]:
        """What follows from the configurations together."""
        path, walk, steps = self.path, self.walk, np.diff(self.path.w)
        first = np.array([*path[0].displacements.values()])
        rest = max(abs(path[0].w), float(np.abs(first).max()))
        yield follows("start at rest", rest <= SLACK * self.size, f"moved by {rest:.3g}")
        longest, is_on = float(steps.max(initial=0.0)), bool((steps > 0.0).all())
        is_met = is_on and longest <= path.step * (1.0 + FINEST)
        yield follows(f"step {path.step:.4g}", is_met, f"one of {longest:.6g}")
        slides = any(found.slides for found in walk.found)
        claims = ("no joint slides", "joints slide")
        yield follows(claims[path.slides], path.slides == slides, claims[slides])
        if walk.begin.bonds is not None or path.failures:
            yield self._apart()
        yield self._jumps()
        yield self._ending()
        if path[0].loss > SLIDING:
            yield unseen("loss at rest", f"{path[0].loss:.1e}")

    def _apart(self) -> Check:
        """What has moved holds no longer, and a tie that is gone was stretched by more than it
        bears."""
        path, found, lost = self.path, "", self.walk.failures()
        if lost != path.failures:
            found = f"there are {len(lost)}"
        for before, at in pairwise(self.walk.found):
            if before.bonds is None or at.bonds is None:
                continue
            if still := at.bonds.lost(at.bonds.holding(at.pose)):
                found = f"{still[0]} has moved as well"
            torn = before.bonds.lost(before.bonds.holding(at.pose))
            gone = [x for x in before.bonds.lost(at.bonds) if x[:3] == "tie" and x not in torn]
            if gone:
                found = f"{gone[0]} still holds at w = {at.shown.w:.6g}"
        return follows(f"{len(path.failures)} joints and ties that came apart", not found, found)

    def _jumps(self) -> Check:
        """Jumps are enclosed: between their ends blocks move far more per step than elsewhere."""
        path, walk, ways = self.path, self.walk, np.diff(self.path.w)
        moved = np.array([walk.distance(x, y) for x, y in pairwise(walk.found)])
        is_short = ways <= FINEST * path.step * (1.0 + FINEST)
        pace = moved / np.maximum(ways, 1e-300)
        usual = float(np.median(pace[~is_short])) if (~is_short).any() else np.inf
        # Explicit steps go as far as they may, however little w grows: what they jump is not looked
        # at.
        is_short &= ~np.array([c.is_followed for c in path])[1:]
        told = np.isin(path.w[:-1], path.snaps)
        untold = ~told & is_short & (pace > JUMP**2 * usual)
        wrong, but = np.flatnonzero(untold | (told & ~(is_short & (pace > usual)))), ""
        if len(wrong):
            but = f"{'no' if told[wrong[0]] else 'a'} jump follows w = {path.w[wrong[0]]:.6g}"
        return follows(f"{len(path.snaps)} jumps", not but, but)

    def _ending(self) -> Check:
        """How a run ends follows from its last load factor, or from what is found beyond it."""
        path, walk, last, status = self.path, self.walk, self.walk.found[-1], self.path.status
        claim, left = f"status {status!r}", last.shown.load_factor - path.until
        told = f"load factor {last.shown.load_factor:.6g}, {path.until:g} asked for"
        has_come = left <= walk.enough(last)
        if has_come or status in ("zero", "steps"):
            is_met = has_come if status == "zero" else not has_come and len(path) > MOST
            return follows(claim, is_met, told, told)
        if status == "slides":
            return follows(claim, path.slides_away, told, told)
        if status == "interrupted" or path.followed:
            return unseen(claim, told)
        walk.step, ends = path.step, list[str]()
        for share in (2.0, 1.0):  # the last step tried is one or the other, or between them
            there = walk.settle(last, last.shown.w + share * FINEST * path.step)
            ends.append("goes on" if isinstance(there, At) else there.kind)
        if status == "falls" and "not-converged" in ends:  # by explicit steps, which nothing holds
            return unseen(claim, told)
        return follows(claim, status in ends, f"beyond it {' or '.join(ends)}", "found again")

    def _work(self) -> Check:
        """The area under the curve and the potential, integrated anew."""
        held, again = self.path.work, self.walk.work()
        if held is None:
            return Check("area and potential", False, "there are none")
        off = max(abs(np.subtract(again, held))) / max(map(abs, (*again, 1e-300)))
        return proved("area and potential", off <= SLACK, f"they are {again}")


@dataclass(frozen=True, eq=False)
class ConfigurationAgain:
    """Configuration ``i`` of a run: its claims, of which :meth:`failures` yields what fails.

    Lengths are compared with the size of contacts, forces with the dead load.
    """

    walk: Walk
    path: Path
    i: int

    @property
    def here(self) -> Configuration:
        return self.path[self.i]

    @cached_property
    def start(self) -> Start:
        """From where slips and gaps count: the configuration before, if there is one."""
        before = self.walk.found[max(self.i - 1, 0)]
        start = Start.at(self.walk.facets, before.pose, before.loose)
        return replace(start, bonds=self.walk.bonds_at(self.i))

    @cached_property
    def points(self) -> Points:
        """The points at which the displaced blocks touch."""
        return self.start.points(self.walk.found[self.i].pose)

    def failures(self) -> Failures:
        """All claims that do not hold: of places, of forces, and of the bracket."""
        return chain(self._places(), self._forces(), self._loss(), self._bracket())

    def _places(self) -> Failures:
        """Displacements move the live load by w, and no block into another or a prop, but for what
        linearised steps leave; forces act at points where the displaced blocks touch."""
        here, walk, size = self.here, self.walk, self.walk.size
        at = walk.found[self.i]
        w = walk.loads.work(at.pose)[1] / walk.loads.size
        if not abs(w - here.w) <= SLACK * size:
            yield "w", f"the displacements have {w:.9g}"
        own = replace(Start.at(walk.facets, at.pose, at.loose), bonds=walk.bonds_at(self.i))
        most = LEFT if here.is_followed else CLOSED
        if (depth := own.points(at.pose).depth) > most * size:
            deep = f"{depth / size:.1e} of the contact size"
            yield "displacements", f"blocks are {deep} in each other"
        n = here.forces[:, 0]
        is_strange = ~_are_among(here.points, self.points, size, walk.loads.size)
        if (n[is_strange] > CLOSED * n.max(initial=0.0)).any():
            yield "points", "some that bear are none of the blocks as they are displaced"

    def _forces(self) -> Failures:
        """Forces balance the loads on every free block, but for what a followed configuration is
        said to lack; they pull nowhere, and friction is within its cone."""
        here, walk = self.here, self.walk
        pose, p = walk.found[self.i].pose, here.points
        statics = Increment(self.path.scene, p, pose, walk.loads).assemblage.statics
        # Forces (n, v1, v2) are compression and friction along t1 and t2, and statics has V1, V2
        # and N in this order; what bars push at least is in the dead load.
        forces = np.zeros((len(p), DOF))
        forces[:, :2], forces[:, 2] = here.forces[:, 1:], p.chosen(here.forces)
        residual = np.abs(statics.residual(forces, here.load_factor))
        residual[:, 3:] /= walk.size  # moments
        dead_load = np.abs(statics.dead.reshape(-1, DOF)[:, :3]).sum() or walk.loads.size
        left = residual.max() / dead_load
        lacks = here.residual * (1.0 + SLACK) if here.is_followed else 0.0
        if not (lacks <= LACKS and left <= max(lacks, RESIDUAL)):
            yield "equilibrium", f"forces miss it by {left:.1e} of the dead load"
        n, friction = here.forces[:, 0], np.linalg.norm(here.forces[:, 1:], axis=1)
        cone = p.friction * n + p.cohesion
        excess = np.max([p.least - n, friction - cone, n - p.most], initial=0.0) / dead_load
        if not excess <= RESIDUAL:
            yield "friction", f"forces exceed it by {excess:.1e} of the dead load"

    def _loss(self) -> Failures:
        """Without dilatancy friction opposes the slip of the last step, but for the loss that is
        told: a share of the live load's work on that step at the first load factor."""
        here, path = self.here, self.path
        has_loss = path.flow != "associated" or here.is_followed
        if not has_loss and here.loss > SLIDING:
            yield f"loss {here.loss:.1e}", "there is none"
        if has_loss and self.i > 0:
            way = here.w - path[self.i - 1].w
            work = way * self.walk.loads.size * abs(path[0].load_factor)
            loss = here.points.lost(here.forces, path.flow) / work
            rounding = RESIDUAL * max(1.0, path.step / way)  # both ends of a jump are close
            if not loss <= max(here.loss, rounding) * (1.0 + SLACK):
                yield f"loss {here.loss:.1e}", f"friction lacks {loss:.1e} of the step's work"

    def _bracket(self) -> Failures:
        """No end of the bracket is better, or called proved, where the one found again is not."""
        here, walk, path = self.here, self.walk, self.path
        if here.bracket is None:
            if here.widest_gap:
                yield f"widest gap {here.widest_gap:.3g}", "there is no bracket that it is of"
            return
        bears = here.bearing_gap(walk.flow)
        if here.is_followed and bears > LEFT * walk.size:
            yield "bracket", f"forces bear across a gap of {bears:.3g}, and there is none"
        pose = walk.found[self.i].pose
        again, widest = bracket_of(path.scene, self.points, pose, walk.loads, walk.flow, bears)
        if not abs(widest - here.widest_gap) <= CLOSED * walk.size:
            yield f"widest gap {here.widest_gap:.3g}", f"it is {widest:.3g}"
        unit = max(abs(path[0].load_factor), abs(here.load_factor))
        for end, sign in (("lower", 1.0), ("upper", -1.0)):
            claimed, found = getattr(here.bracket, end), getattr(again, end)
            is_called_proved = getattr(here.bracket, f"{end}_is_proved")
            is_better = sign * (claimed - found) > SLACK * unit
            if is_better or (is_called_proved and not getattr(again, f"{end}_is_proved")):
                yield f"{end} bound {claimed:.9g}", f"{found:.9g} is shown"


def _are_among(held: Points, found: Points, size: float, force: float) -> BoolArray:
    """Returns which of the points held (k,) are among those found: of the same blocks, at the same
    place, with the same normal, gap, friction, cohesion, strength and, in size, slip."""
    features = [
        (
            p.at / size, p.axes[:, 2], gap[:, None] / size, p.friction[:, None],
            np.linalg.norm(p.slip, axis=1)[:, None] / size, p.a[:, None], p.b[:, None],
            p.cohesion[:, None] / force, (force / p.most)[:, None], p.least[:, None] / force,
            p.is_bar[:, None],
        )
        for p in (held, found)
        # a bar that gives way has its seat farther on, by as much as the step has it
        for gap in (np.where(np.isfinite(p.most), np.maximum(p.gap, 0.0), p.gap),)
    ]  # fmt: skip
    own, others = (np.concatenate(parts, axis=1) for parts in features)
    return np.array([(np.abs(others - row).max(axis=1) <= CLOSED).any() for row in own], dtype=bool)
