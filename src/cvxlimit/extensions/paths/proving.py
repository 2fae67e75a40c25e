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
from dataclasses import replace
from itertools import chain, pairwise
from typing import Any

import numpy as np

from cvxlimit.base.arrays import BoolArray
from cvxlimit.extensions.paths.configuration import Points
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.following import BEYOND, FINEST, MOST, Walk
from cvxlimit.extensions.paths.increment import Increment
from cvxlimit.extensions.paths.jumps import JUMP
from cvxlimit.extensions.paths.pairs import CLOSED
from cvxlimit.extensions.paths.path import SLIDING, Path
from cvxlimit.extensions.paths.points import Start
from cvxlimit.extensions.paths.proof import bracket_of
from cvxlimit.extensions.paths.proximal import LACKS
from cvxlimit.extensions.paths.refusing import stands
from cvxlimit.extensions.paths.resting import LEFT, REACH, At
from cvxlimit.extensions.paths.starting import for_path
from cvxlimit.extensions.paths.supports import falling, guided
from cvxlimit.io.scenes import scene_digest
from cvxlimit.methods.solving import solve
from cvxlimit.model.statics import DOF
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, compared, follows, proved, unseen
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.proving.solutions import solution_checks
from cvxlimit.solution.bracket import Bracket

_CLAIMED = (
    "initial", "configurations", "status", "flow", "step", "snaps", "work", "slides", "control",
    "halved", "other_flow", "until", "failures", "stretch", "motions", "fallen", "given",
)  # fmt: skip
"""What was asked, what proves the rest, and what has a claim of its own."""

Claims = Iterator[tuple[str, bool, str]]
"""What a configuration says, whether it holds, and what was found."""


def prove_path(what: Any, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """A path, or what a file of one holds; see :func:`cvxlimit.prove`."""
    path = what if isinstance(what, Path) else PATH.from_dict(what)
    digest = scene_digest(path.scene)
    if scene is not None:
        scene_of(path.scene.name, digest, scene, BOTH_CASES)
    checks, held = [*path_checks(path)], path.initial and path.initial.scene_digest
    if held and held != digest:
        checks.append(Check("initial: scene_digest", False, "it is of another scene"))
    return Proof(f"path of scene {path.scene.name!r}", tuple(checks))


def path_checks(path: Path) -> Iterator[Check]:
    """Every claim of a path, checked."""
    if path.motions:
        yield _pushed(path)
    elif path.initial is None:
        is_met = for_path(path.scene)[1] is not None or not stands(solve(path.scene))
        yield follows("a scene that starts displaced", is_met, "its dead load stands alone")
    else:
        for check in solution_checks(path.initial, path.scene):
            is_proof = check.kind == "proved" or not check.is_met
            which = "at rest, friction over whole joints" if is_proof else "initial"
            yield replace(check, claim=f"{which}: {check.claim}")
    half, other = path.halved, path.other_flow
    runs = (path, ""), (half, " with half the step"), (other, " by the other flow")
    for run, which in runs:
        yield from RunAgain(run, which).checks() if run is not None else ()
    if half is not None:
        is_half = half.step <= 0.5 * path.step * (1.0 + FINEST)
        yield follows("half the step", is_half, f"it is {half.step:.6g}")
    elif path.slides:
        yield unseen("what half the step changes", "there is no run with it")
    if other is not None:
        yield follows("the other flow", other.flow != path.flow, f"it is {other.flow}")
    elif path.followed:
        yield unseen("what the other flow changes", "there is no run with it")
    yield from compared(path, {}, _CLAIMED)
    yield unseen("residual and iterates of configurations")


def _pushed(path: Path) -> Check:
    """What was followed is the scene with its supports pushed along their motion."""
    again = for_path(guided(path.scene, path.motions))[0]
    is_met = scene_digest(again) == scene_digest(path.start)
    return follows("push of the supports that move", is_met, "the scene that was followed differs")


class RunAgain:
    """One run of a path, called ``which``, and the walk that would have made it. Lengths are
    compared with the size of contacts, forces with the dead load."""

    def __init__(self, path: Path, which: str) -> None:
        self.path, self.which, self.size = path, which, path.start.contacts.typical_size
        self.walk = Walk(
            path.start, "none", REACH * self.size, lambda line: None, path.flow, path.stretch,
            path.motions, path.until,
        )  # fmt: skip
        self.walk.resume(path)

    def checks(self) -> Iterator[Check]:
        """All claims of the run: its configurations, what follows from them, and its ends."""
        path, good = self.path, [*self.path]
        for i, here in enumerate(path):
            claims = chain(self._places(i), self._forces(i), self._loss(i), self._bracket(i))
            missing = [(claim, found) for claim, is_met, found in claims if not is_met]
            good = [c for c in good if not (missing and c is here)]
            for claim, found in missing:
                yield Check(f"{claim} of configuration {i}{self.which}", False, found)
        if good:
            said = f"{len(good)} configurations{self.which} in equilibrium, "
            said += f"{sum(c.bracket is not None for c in good)} of them with brackets"
            if lacks := [c.residual for c in good if c.is_followed]:
                said += f"; {len(lacks)} are followed and lack up to {max(lacks):.0e} of it"
            yield Check(said, True)
        for check in chain(self._course(), self._jumps(), [self._ending()], self._fallen()):
            yield replace(check, claim=f"{check.claim}{self.which}")

    # A configuration

    def _points(self, i: int) -> Points:
        """The points at which the displaced blocks touch; at rest those of the scene's contacts."""
        return self.walk.first_points if i == 0 else self._from(i - 1, i)

    def _from(self, before: int, i: int) -> Points:
        """The points of configuration ``i``, where slips and gaps count from another one."""
        at = self.walk.found[before]
        start = Start.at(self.walk.facets, at.pose, at.loose)
        return replace(start, bonds=self.walk.bonds_at(i)).points(self.walk.found[i].pose)

    def _places(self, i: int) -> Claims:
        """Displacements move the live load by w, and no block into another or a prop, but for what
        linearised steps leave; forces act at points where the displaced blocks touch."""
        here, walk, size = self.path[i], self.walk, self.size
        w = walk.loads.work(walk.found[i].pose)[1] / walk.loads.size
        yield "w", abs(w - here.w) <= SLACK * size, f"the displacements have {w:.9g}"
        off = walk.off(walk.found[i].pose, here.w)
        yield "motion", off <= SLACK * size, f"supports are {off:.3g} away from where it has them"
        depth = self._from(i, i).depth / size
        is_met = depth <= (LEFT if here.is_followed else CLOSED)
        yield "displacements", is_met, f"blocks are {depth:.1e} of the contact size in each other"
        n = here.forces[:, 0]
        is_strange = ~_are_among(here.points, self._points(i), size, walk.loads.size)
        is_met = not (n[is_strange] > CLOSED * n.max(initial=0.0)).any()
        yield "points", is_met, "some that bear are none of the blocks as they are displaced"

    def _forces(self, i: int) -> Claims:
        """Forces balance the loads on every free block, but for what a followed configuration is
        said to lack; they pull nowhere, and friction is within its cone."""
        here, walk, p = self.path[i], self.walk, self.path[i].points
        statics = Increment(self.path.start, p, walk.found[i].pose, walk.loads).assemblage.statics
        # Forces (n, v1, v2) are compression and friction along t1 and t2, and statics has V1, V2
        # and N in this order; what bars push at least is in the dead load.
        forces = np.zeros((len(p), DOF))
        forces[:, :2], forces[:, 2] = here.forces[:, 1:], p.chosen(here.forces)
        residual = np.abs(statics.residual(forces, here.load_factor))
        residual[:, 3:] /= self.size  # moments
        dead_load = np.abs(statics.dead.reshape(-1, DOF)[:, :3]).sum() or walk.loads.size
        left = residual.max() / dead_load
        lacks = here.residual * (1.0 + SLACK) if here.is_followed else 0.0
        is_met = lacks <= LACKS and left <= max(lacks, RESIDUAL)
        yield "equilibrium", is_met, f"forces miss it by {left:.1e} of the dead load"
        n, friction = here.forces[:, 0], np.linalg.norm(here.forces[:, 1:], axis=1)
        cone = p.friction * n + p.cohesion
        excess = np.max([p.least - n, friction - cone, n - p.most], initial=0.0) / dead_load
        yield "friction", excess <= RESIDUAL, f"forces exceed it by {excess:.1e} of the dead load"

    def _loss(self, i: int) -> Claims:
        """Without dilatancy friction opposes the slip of the last step, but for the loss that is
        told: a share of the live load's work on that step at the first load factor."""
        here, path = self.path[i], self.path
        if path.flow == "associated" and not here.is_followed:
            yield f"loss {here.loss:.1e}", here.loss <= SLIDING, "there is none"
        elif i > 0:
            way = here.w - path[i - 1].w
            loss = here.points.lost(here.forces, path.flow)
            loss /= way * self.walk.loads.size * self.walk.unit
            rounding = RESIDUAL * max(1.0, path.step / way)  # both ends of a jump are close
            is_met = loss <= max(here.loss, rounding) * (1.0 + SLACK)
            yield f"loss {here.loss:.1e}", is_met, f"friction lacks {loss:.1e} of the step's work"

    def _bracket(self, i: int) -> Claims:
        """Both ends of the bracket are those found again, and proved where these are. Solvers that
        stop elsewhere on another processor move them by less than :data:`RESIDUAL`."""
        here, walk, path = self.path[i], self.walk, self.path
        if here.bracket is None:
            is_met = not here.widest_gap and here.largest is None
            yield f"widest gap {here.widest_gap:.3g}", is_met, "there is no bracket that it is of"
            return
        bears = here.bearing_gap(walk.flow)
        is_met = not here.is_followed or bears <= LEFT * self.size
        yield "bracket", is_met, f"forces bear across a gap of {bears:.3g}, and there is none"
        pose, points = walk.found[i].pose, self._points(i)
        found, widest = bracket_of(path.start, points, pose, walk.loads, walk.flow, bears)
        is_met = abs(widest - here.widest_gap) <= CLOSED * self.size
        yield f"widest gap {here.widest_gap:.3g}", is_met, f"it is {widest:.3g}"
        yield from self._ends("", here.bracket, found, here.load_factor)
        if here.largest is not None:
            found = walk.largest_of(points, pose, bears)
            yield from self._ends("largest reaction, ", here.largest, found, here.load_factor)

    def _ends(self, what: str, own: Bracket, found: Bracket, factor: float) -> Claims:
        for end in ("lower", "upper"):
            claimed, at = getattr(own, end), getattr(found, end)
            near = RESIDUAL * max(self.walk.unit, abs(factor))
            is_met = claimed == at or abs(claimed - at) <= near
            is_met &= getattr(own, f"{end}_is_proved") == getattr(found, f"{end}_is_proved")
            yield f"{what}{end} bound {claimed:.9g}", bool(is_met), f"{at:.9g} is shown"

    # The run

    def _course(self) -> Iterator[Check]:
        """What follows from the configurations together: where they begin, their steps, whether
        joints slide or come apart, the area under the curve and the potential."""
        path, walk, steps = self.path, self.walk, np.diff(self.path.w)
        first = np.array([*path[0].displacements.values()])
        rest = max(abs(path[0].w), float(np.abs(first).max()))
        yield follows("start at rest", rest <= SLACK * self.size, f"moved by {rest:.3g}")
        longest = float(steps.max(initial=0.0))
        is_met = bool((steps > 0.0).all()) and longest <= path.step * (1.0 + FINEST)
        yield follows(f"step {path.step:.4g}", is_met, f"one of {longest:.6g}")
        slides = any(found.slides for found in walk.found)
        claims = ("no joint slides", "joints slide")
        yield follows(claims[path.slides], path.slides == slides, claims[slides])
        if walk.begin.bonds is not None or path.failures:
            found = "; ".join(self._wrongly_apart())
            yield follows(f"{len(path.failures)} joints and ties that came apart", not found, found)
        held, again = path.work or (np.nan, np.nan), walk.work()
        off = max(abs(np.subtract(again, held))) / max(map(abs, (*again, 1e-300)))
        yield proved("area and potential", bool(off <= SLACK), f"they are {again}")
        if path[0].loss > SLIDING:
            yield unseen("loss at rest", f"{path[0].loss:.1e}")

    def _wrongly_apart(self) -> Iterator[str]:
        """What has moved and is said to hold, and ties that are gone and were not stretched by more
        than they bear."""
        if (lost := self.walk.failures()) != self.path.failures:
            yield f"there are {len(lost)}"
        for before, at in pairwise(self.walk.found):
            if before.bonds is None or at.bonds is None:
                continue
            still = at.bonds.lost(at.bonds.holding(at.pose))
            yield from (f"{name} has moved as well" for name in still)
            torn = before.bonds.lost(before.bonds.holding(at.pose))
            gone = [x for x in before.bonds.lost(at.bonds) if x[:3] == "tie" and x not in torn]
            yield from (f"{name} still holds at w = {at.shown.w:.6g}" for name in gone)

    def _jumps(self) -> Iterator[Check]:
        """Jumps are enclosed: between their ends blocks move more per step than elsewhere. How much
        more depends on iterates that no path keeps: short steps that might be jumps are named."""
        path, walk, ways = self.path, self.walk, np.diff(self.path.w)
        moved = np.array([walk.distance(x, y) for x, y in pairwise(walk.found)])
        is_short = ways <= FINEST * path.step * (1.0 + FINEST)
        pace = moved / np.maximum(ways, 1e-300)
        usual = float(np.median(pace[~is_short])) if (~is_short).any() else 0.0
        # Explicit steps go as far as they may, however little w grows: what they jump is not looked
        # at.
        is_short &= ~np.array([c.is_followed for c in path])[1:]
        told = np.isin(path.w[:-1], path.snaps)
        wrong = path.w[:-1][told & ~(is_short & (pace > usual))]
        but = f"no jump follows w = {wrong}"
        yield follows(f"{len(path.snaps)} jumps", not len(wrong), but)
        open_at = path.w[:-1][~told & is_short & (pace > JUMP * usual)]
        if len(open_at):
            yield unseen("snaps", f"whether a jump follows w = {open_at[0]:.6g}")

    def _ending(self) -> Check:
        """How a run ends follows from its last load factor, or from what is found beyond it."""
        path, walk, last, status = self.path, self.walk, self.walk.found[-1], self.path.status
        claim, has_come = f"status {status!r}", walk.has_come(path.until)
        told = f"load factor {last.shown.load_factor:.6g}, {path.until:g} asked for"
        if path.motions:
            told = f"w = {last.shown.w:.6g}, {max(path.until, 0.0) or 'no end'} asked for"
        if status == "not-decided":  # which is of both runs
            is_met = path.halved is not None and not path.ends_like(path.halved)
            return follows(claim, is_met, "the run with half the step ends alike")
        if has_come or status in ("zero", "steps"):
            is_turned = walk.most == walk.loads.most < np.inf  # as far as supports are followed
            is_out = is_turned if has_come else len(path) > MOST
            is_met = has_come and not is_turned if status == "zero" else is_out
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

    def _fallen(self) -> Iterator[Check]:
        """No forces carry the dead load at a configuration behind the last one."""
        walk, here = self.walk, self.path.fallen
        if here is None:
            return
        w = walk.loads.work(here.pose)[1] / walk.loads.size
        points = walk.start(walk.found[-1]).points(here.pose)
        points = points.closed(walk.flow, BEYOND * self.size)
        is_met = here.w > self.path.w[-1] and abs(w - here.w) <= SLACK * self.size
        is_met = is_met and walk.off(here.pose, here.w) <= SLACK * self.size
        is_met = is_met and falling(walk.increment(points, here.pose)) is not None
        yield proved(f"no forces carry the dead load at w = {here.w:.6g}", is_met, "not shown")


def _are_among(held: Points, found: Points, size: float, force: float) -> BoolArray:
    """Returns which of the points held (k,) are among those found: of the same blocks, at the same
    place, with the same normal, gap, friction, cohesion, strength and, in size, slip."""
    features = []
    for p in (held, found):
        # a bar that gives way has its seat farther on, by as much as the step has it
        gap = np.where(np.isfinite(p.most), np.maximum(p.gap, 0.0), p.gap)
        lengths = np.column_stack([p.at, gap, np.linalg.norm(p.slip, axis=1)]) / size
        forces = np.column_stack([p.cohesion / force, force / p.most, p.least / force])
        others = p.axes[:, 2], p.friction, p.a, p.b, p.is_bar
        features.append(np.column_stack([lengths, forces, *others]))
    own, every = features
    return np.array([(np.abs(every - row).max(axis=1) <= CLOSED).any() for row in own], dtype=bool)
