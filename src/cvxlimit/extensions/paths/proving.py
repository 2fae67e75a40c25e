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
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from cvxlimit.base.arrays import BoolArray
from cvxlimit.extensions.paths.configuration import CLOSED, Points
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.following import FINEST, JUMP, LEFT, MOST, REACH, At, Walk
from cvxlimit.extensions.paths.increment import Increment
from cvxlimit.extensions.paths.path import SLIDING, Path
from cvxlimit.extensions.paths.points import Start
from cvxlimit.extensions.paths.proof import bracket_of
from cvxlimit.extensions.paths.proximal import LACKS
from cvxlimit.extensions.paths.refusing import stands
from cvxlimit.extensions.paths.starting import begun
from cvxlimit.io.scenes import scene_digest
from cvxlimit.methods.solving import solve
from cvxlimit.model.statics import DOF
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, follows, unseen, unseen_fields
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.proving.solutions import solution_checks

_LOOKED_AT = (
    "initial", "configurations", "status", "flow", "step", "snaps", "work", "slides", "control",
    "halved", "other_flow", "until", "failures", "stretch",
)  # fmt: skip


def path_checks(path: Path) -> Iterator[Check]:
    """Checks every claim of a path: the solution of the scene at rest, the configurations, and
    those of the run with half the step, if there is one. What holds of configurations is said once
    for all of them; what does not, one by one."""
    if path.initial is None:
        is_met = begun(path.scene)[1] is not None or not stands(solve(path.scene))
        found = "" if is_met else "its dead load stands alone"
        yield follows("a scene that starts displaced", is_met, found)
    else:
        for check in solution_checks(path.initial, path.scene):
            is_proof = check.kind == "proved" or not check.is_met
            which = "at rest, friction over whole joints" if is_proof else "initial"
            yield replace(check, claim=f"{which}: {check.claim}")
    yield from _configuration_checks(path, "")
    half = path.halved
    if half is not None:
        yield from _configuration_checks(half, " with half the step")
        is_half = half.step <= 0.5 * path.step * (1.0 + FINEST)
        yield follows("half the step", is_half, "" if is_half else f"it is {half.step:.6g}")
    elif path.slides:
        yield unseen("what half the step changes", "there is no run with it")
    if (other := path.other_flow) is not None:
        yield from _configuration_checks(other, " by the other flow")
        is_met = other.flow != path.flow
        yield follows("the other flow", is_met, "" if is_met else f"it is {other.flow}")
    elif path.followed:
        yield unseen("what the other flow changes", "there is no run with it")
    yield from unseen_fields(path, _LOOKED_AT)
    yield unseen("residual and iterates of configurations")


def _configuration_checks(path: Path, which: str) -> Iterator[Check]:
    """Checks the configurations of one run, which is called ``which``, and its area and
    potential."""
    size = path.scene.contacts.typical_size
    walk = Walk(path.scene, "none", REACH * size, lambda line: None, path.flow, path.stretch)
    walk.resume(path)
    wrong = set[int]()
    for i in range(len(path)):
        for claim, found in _failures(walk, path, i):
            wrong.add(i)
            yield Check(f"{claim} of configuration {i}{which}", False, found)
    with_bracket = sum(c.bracket is not None for i, c in enumerate(path) if i not in wrong)
    if good := len(path) - len(wrong):
        said = f"{good} configurations{which} in equilibrium, {with_bracket} of them with brackets"
        followed = [c for i, c in enumerate(path) if i not in wrong and c.is_followed]
        if followed:
            lacks = max(c.residual for c in followed)
            said += f"; {len(followed)} are followed and lack up to {lacks:.0e} of it"
        yield Check(said, True)
    yield from _course_checks(walk, path, which)
    if path[0].loss > SLIDING:
        yield unseen(f"loss at rest{which}", f"{path[0].loss:.1e}")
    if path.work is None:
        yield Check(f"area and potential{which}", False, "there are none")
    else:
        again = walk.work()
        off = max(abs(np.subtract(again, path.work))) / max(map(abs, (*again, 1e-300)))
        yield Check(
            f"area and potential{which}", off <= SLACK, "" if off <= SLACK else f"they are {again}"
        )


def _course_checks(walk: Walk, path: Path, which: str) -> Iterator[Check]:
    """What follows from the configurations of one run together."""
    size, steps = walk.size, np.diff(path.w)
    first = np.array([*path[0].displacements.values()])
    rest = max(abs(path[0].w), float(np.abs(first).max()))
    is_met = rest <= SLACK * size
    yield follows(f"start at rest{which}", is_met, "" if is_met else f"moved by {rest:.3g}")
    is_met = bool((steps > 0.0).all() and (steps <= path.step * (1.0 + FINEST)).all())
    longest = float(steps.max(initial=0.0))
    yield follows(f"step {path.step:.4g}{which}", is_met, "" if is_met else f"one of {longest:.6g}")
    slides = any(found.slides for found in walk.found)
    claims, is_met = ("no joint slides", "joints slide"), path.slides == slides
    yield follows(f"{claims[path.slides]}{which}", is_met, "" if is_met else claims[slides])
    if walk.begin.bonds is not None or path.failures:
        yield _apart(walk, path, which)
    yield _jumps(walk, path, which)
    yield _ending(walk, path, which)


def _apart(walk: Walk, path: Path, which: str) -> Check:
    """What has moved holds no longer, and a tie that is gone was stretched by more than it
    bears."""
    found, lost = "", walk.failures()
    if lost != path.failures:
        found = f"there are {len(lost)}"
    for before, at in pairwise(walk.found):
        if before.bonds is None or at.bonds is None:
            continue
        if still := at.bonds.lost(at.bonds.holding(at.pose)):
            found = f"{still[0]} has moved as well"
        torn = before.bonds.lost(before.bonds.holding(at.pose))
        if whole := [x for x in before.bonds.lost(at.bonds) if x[:3] == "tie" and x not in torn]:
            found = f"{whole[0]} still holds at w = {at.shown.w:.6g}"
    return follows(f"{len(path.failures)} joints and ties that came apart{which}", not found, found)


def _jumps(walk: Walk, path: Path, which: str) -> Check:
    """Jumps are enclosed: between their ends blocks move far more per step than elsewhere."""
    ways = np.diff(path.w)
    moved = np.array([walk.distance(x, y) for x, y in pairwise(walk.found)])
    is_short = ways <= FINEST * path.step * (1.0 + FINEST)
    pace = moved / np.maximum(ways, 1e-300)
    usual = float(np.median(pace[~is_short])) if (~is_short).any() else np.inf
    told = np.isin(path.w[:-1], path.snaps)
    # Explicit steps go as far as they may, however little w grows: what they jump is not looked at.
    is_short &= ~np.array([c.is_followed for c in path])[1:]
    wrong = np.flatnonzero(
        (told & ~(is_short & (pace > usual))) | (~told & is_short & (pace > JUMP**2 * usual))
    )
    found = "" if not len(wrong) else (
        f"{'no' if told[wrong[0]] else 'a'} jump follows w = {path.w[wrong[0]]:.6g}"
    )  # fmt: skip
    return follows(f"{len(path.snaps)} jumps{which}", not len(wrong), found)


def _ending(walk: Walk, path: Path, which: str) -> Check:
    """How a run ends follows from its last load factor, or from what is found beyond it."""
    last, status = walk.found[-1], path.status
    claim, left = f"status {status!r}{which}", last.shown.load_factor - path.until
    told = f"load factor {last.shown.load_factor:.6g}, {path.until:g} asked for"
    has_come = left <= walk.enough(last)
    if has_come or status in ("zero", "steps"):
        is_met = has_come if status == "zero" else not has_come and len(path) > MOST
        return follows(claim, is_met, told)
    if status == "interrupted" or path.followed:
        return unseen(claim, told)
    walk.step, ends = path.step, list[str]()
    for share in (2.0, 1.0):  # the last step that was tried is one or the other, or between them
        there = walk.settle(last, last.shown.w + share * FINEST * path.step)
        ends.append("goes on" if isinstance(there, At) else there.kind)
    is_met = status in ends
    return follows(claim, is_met, "found again" if is_met else f"beyond it {' or '.join(ends)}")


def _failures(walk: Walk, path: Path, i: int) -> Iterator[tuple[str, str]]:
    """Yields the claims of configuration i that do not hold, each with what was found instead.

    Lengths are compared with the size of contacts, forces with the dead load.
    """
    size, scene, loads = walk.size, walk.scene, walk.loads
    here, pose = walk.found[i].shown, walk.found[i].pose

    # The mean displacement of the live load follows from the displacements.
    w = loads.work(pose)[1] / loads.size
    if not abs(w - here.w) <= SLACK * size:
        yield "w", f"the displacements have {w:.9g}"

    # No block is in another one, nor in a prop, but for what linearised steps leave.
    start = replace(Start.at(walk.facets, pose, walk.found[i].loose), bonds=walk.bonds_at(i))
    most = LEFT if here.is_followed else CLOSED
    if (depth := start.points(pose).depth) > most * size:
        yield "displacements", f"blocks are {depth / size:.1e} of the contact size in each other"

    # Forces act at points where the displaced blocks touch. Slip counts from the configuration
    # before, if there is one.
    if i > 0:
        before = walk.found[i - 1]
        start = Start.at(walk.facets, before.pose, before.loose)
    points = replace(start, bonds=walk.bonds_at(i)).points(pose)
    n, friction = here.forces[:, 0], np.linalg.norm(here.forces[:, 1:], axis=1)
    is_strange = ~_are_among(here.points, points, size, loads.size)
    if (n[is_strange] > CLOSED * n.max(initial=0.0)).any():
        yield "points", "some that bear are none of the blocks as they are displaced"

    # Equilibrium of every free block. Forces (n, v1, v2) are compression and friction along t1 and
    # t2, and statics has V1, V2 and N in this order.
    statics = Increment(scene, here.points, pose, loads).assemblage.statics
    forces = np.zeros((len(n), DOF))
    forces[:, [2, 0, 1]] = here.forces
    forces[:, 2] = here.points.chosen(here.forces)  # the others are in the dead load
    residual = np.abs(statics.residual(forces, here.load_factor))
    residual[:, 3:] /= size  # moments
    dead_load = np.abs(statics.dead.reshape(-1, DOF)[:, :3]).sum() or loads.size
    lacks = here.residual * (1.0 + SLACK) if here.is_followed else 0.0
    if not (lacks <= LACKS and residual.max() <= max(lacks, RESIDUAL) * dead_load):
        yield "equilibrium", f"forces miss it by {residual.max() / dead_load:.1e} of the dead load"

    # No tension, and friction within its cone.
    cone = here.points.friction * n + here.points.cohesion
    excess = np.max([here.points.least - n, friction - cone, n - here.points.most], initial=0.0)
    if not excess <= RESIDUAL * dead_load:
        yield "friction", f"forces exceed it by {excess / dead_load:.1e} of the dead load"

    has_loss = path.flow != "associated" or here.is_followed
    if not has_loss and here.loss > SLIDING:
        yield f"loss {here.loss:.1e}", "there is none"

    # Without dilatancy friction opposes the slip of the last step, but for the loss that is told: a
    # share of the live load's work on that step at the first load factor.
    if has_loss and i > 0:
        way = here.w - path[i - 1].w
        loss = here.points.lost(here.forces, path.flow) / (
            way * loads.size * abs(path[0].load_factor)
        )
        rounding = RESIDUAL * max(1.0, path.step / way)  # both ends of a jump are near each other
        if not loss <= max(here.loss, rounding) * (1.0 + SLACK):
            yield f"loss {here.loss:.1e}", f"friction lacks {loss:.1e} of the step's work"

    # The bracket: no end of it is better, or called proved, where the one found again is not.
    if here.bracket is None:
        if here.widest_gap:
            yield f"widest gap {here.widest_gap:.3g}", "there is no bracket that it is of"
        return
    bears = here.bearing_gap(walk.flow)
    if here.is_followed and bears > LEFT * size:
        yield "bracket", f"forces bear across a gap of {bears:.3g}, and there is none"
    again, widest = bracket_of(scene, points, pose, loads, walk.flow, bears)
    if not abs(widest - here.widest_gap) <= CLOSED * size:
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


def prove_path(what: Any, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """A path, or what a file of one holds; see :func:`cvxlimit.prove`."""
    path = what if isinstance(what, Path) else PATH.from_dict(what)
    if scene is not None:
        scene_of(path.scene.name, scene_digest(path.scene), scene, BOTH_CASES)
    checks, held = [*path_checks(path)], path.initial and path.initial.scene_digest
    if held and held != scene_digest(path.scene):
        checks.append(Check("initial: scene_digest", False, "it is of another scene"))
    return Proof(f"path of scene {path.scene.name!r}", tuple(checks))
