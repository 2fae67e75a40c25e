"""A path proved again, from the displacements, points and forces that it holds and nothing else."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cvxlimit.base.arrays import BoolArray
from cvxlimit.methods.checks import RESIDUAL, SLACK, Check
from cvxlimit.methods.proving import solution_checks
from cvxlimit.model.statics import DOF
from cvxlimit.paths.following import REACH, Walk
from cvxlimit.paths.increment import Increment
from cvxlimit.paths.path import CLOSED, Path, Points
from cvxlimit.paths.points import Start
from cvxlimit.paths.proof import bracket_of


def path_checks(path: Path) -> Iterator[Check]:
    """Every claim of a path, checked: what is met once for all configurations, what is not one by
    one. How the path ends, and that it gets from one configuration to the next, nobody proves."""
    for check in solution_checks(path.initial, path.scene):
        yield Check(
            f"at rest, friction over whole joints: {check.claim}", check.is_met, check.found
        )
    yield from _of_configurations(path, "")
    if path.halved is not None:
        yield from _of_configurations(path.halved, " with half the step")


def _of_configurations(path: Path, which: str) -> Iterator[Check]:
    size = path.scene.contacts.typical_size
    walk = Walk(path.scene, "none", REACH * size, lambda line: None, path.flow)
    missing = set[int]()
    walk.resume(path)
    for i in range(len(path)):
        for claim, found in _wrong(walk, path, i):
            missing.add(i)
            yield Check(f"{claim} of configuration {i}{which}", False, found)
    proved = sum(each.bracket is not None for i, each in enumerate(path) if i not in missing)
    if good := len(path) - len(missing):
        said = f"{good} configurations{which} in equilibrium, {proved} of them with brackets"
        yield Check(said, True)
    if path.work is not None:
        again = walk.work()
        off = max(abs(np.subtract(again, path.work))) / max(map(abs, (*again, 1e-300)))
        yield Check(
            f"area and potential{which}", off <= SLACK, "" if off <= SLACK else f"they are {again}"
        )


def _wrong(walk: Walk, path: Path, i: int) -> Iterator[tuple[str, str]]:
    """Claims of a configuration that do not hold, and why."""
    here, size, scene = walk.found[i], walk.size, walk.scene
    shown, pose = here.shown, here.pose
    w = walk.loads.work(pose)[1] / walk.loads.size
    if not abs(w - shown.w) <= SLACK * size:
        yield "w", f"the displacements have {w:.9g}"
    begin = Start.at(walk.facets, pose, here.loose)
    if (deep := -begin.points(pose).gap.min(initial=0.0)) > CLOSED * size:
        yield "displacements", f"blocks are {deep / size:.1e} of the contact size in each other"
    if i > 0:
        before = walk.found[i - 1]
        begin = Start.at(walk.facets, before.pose, before.loose)
    points = begin.points(pose)

    n, slid = shown.forces[:, 0], np.linalg.norm(shown.forces[:, 1:], axis=1)
    strange = ~_are_among(shown.points, points, size)
    if (n[strange] > SLACK * n.max(initial=0.0)).any():
        yield "points", "some that bear are none of the blocks as they are displaced"
    given = Increment(scene, shown.points, pose, walk.loads).assemblage.statics
    forces = np.zeros((len(n), DOF))
    forces[:, [2, 0, 1]] = shown.forces
    left = np.abs(given.residual(forces, shown.load_factor))
    left[:, 3:] /= size
    load = np.abs(given.dead.reshape(-1, DOF)[:, :3]).sum()
    if not left.max() <= RESIDUAL * load:
        yield "equilibrium", f"forces miss it by {left.max() / load:.1e} of the dead load"
    beyond = np.maximum(-n, slid - shown.points.friction * n).max(initial=0.0)
    if not beyond <= RESIDUAL * load:
        yield "friction", f"forces exceed it by {beyond / load:.1e} of the dead load"
    if path.flow != "associated" and i > 0:
        step = (shown.w - path[i - 1].w) * walk.loads.size * abs(path[0].load_factor)
        lost = shown.points.lost(shown.forces) / step
        if not lost <= max(shown.loss, SLACK) * (1.0 + SLACK):
            yield f"loss {shown.loss:.1e}", f"friction lacks {lost:.1e} of the step's work"
    if shown.bracket is None:
        return
    least = 0.0 if walk.has_dilatancy else shown.points.bearing_gap(shown.forces)
    found = bracket_of(scene, points, pose, walk.loads, walk.flow, least)[0]
    unit = max(abs(walk.found[0].shown.load_factor), abs(shown.load_factor))
    for end, is_safe in (("lower", 1.0), ("upper", -1.0)):
        held, again = getattr(shown.bracket, end), getattr(found, end)
        claims = getattr(shown.bracket, f"{end}_is_proved")
        is_worse = is_safe * (held - again) > SLACK * unit
        if is_worse or (claims and not getattr(found, f"{end}_is_proved")):
            yield f"{end} bound {held:.9g}", f"{again:.9g} is shown"


def _are_among(held: Points, found: Points, size: float) -> BoolArray:
    """Which of the points held are among those found: of the same blocks, at the same place, with
    the same normal, gap, friction and, in size, slip."""
    what = [
        (
            p.at / size, p.axes[:, 2], p.gap[:, None] / size, p.friction[:, None],
            np.linalg.norm(p.slip, axis=1)[:, None] / size, p.a[:, None], p.b[:, None],
        )
        for p in (held, found)
    ]  # fmt: skip
    one, other = (np.concatenate(parts, axis=1) for parts in what)
    return np.array([(np.abs(other - row).max(axis=1) <= CLOSED).any() for row in one], dtype=bool)
