"""A path in finite displacements, proved again from what it holds and nothing else.

A path is a sequence of configurations q (displacements of the free blocks), each with the points at
which blocks touch, forces x at these, and the load factor alpha in equilibrium with them. What a
path claims of every configuration is checked from the scene and the displacements alone:

    w = work of the live load on q / size of the live load,     no block is in another,
    A(q) x + f_dead(q) + alpha f_live(q) = 0,     abs(v) <= mu n at every point,

forces act at points of the displaced blocks, friction without dilatancy lacks no more of opposing
its slip than is said, and the bracket is found again. How a path ends, and that the structure gets
from one configuration to the next, nobody proves.
"""

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
    """Checks every claim of a path: the solution of the scene at rest, the configurations, and
    those of the run with half the step, if there is one. What holds of configurations is said once
    for all of them; what does not, one by one."""
    for check in solution_checks(path.initial, path.scene):
        yield Check(
            f"at rest, friction over whole joints: {check.claim}", check.is_met, check.found
        )
    yield from _configuration_checks(path, "")
    if path.halved is not None:
        yield from _configuration_checks(path.halved, " with half the step")


def _configuration_checks(path: Path, which: str) -> Iterator[Check]:
    """Checks the configurations of one run, which is called ``which``, and its area and
    potential."""
    size = path.scene.contacts.typical_size
    walk = Walk(path.scene, "none", REACH * size, lambda line: None, path.flow)
    walk.resume(path)
    wrong = set[int]()
    for i in range(len(path)):
        for claim, found in _failures(walk, path, i):
            wrong.add(i)
            yield Check(f"{claim} of configuration {i}{which}", False, found)
    with_bracket = sum(c.bracket is not None for i, c in enumerate(path) if i not in wrong)
    if good := len(path) - len(wrong):
        said = f"{good} configurations{which} in equilibrium, {with_bracket} of them with brackets"
        yield Check(said, True)
    if path.work is not None:
        again = walk.work()
        off = max(abs(np.subtract(again, path.work))) / max(map(abs, (*again, 1e-300)))
        yield Check(
            f"area and potential{which}", off <= SLACK, "" if off <= SLACK else f"they are {again}"
        )


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

    # No block is in another one.
    start = Start.at(walk.facets, pose, walk.found[i].loose)
    if (depth := -start.points(pose).gap.min(initial=0.0)) > CLOSED * size:
        yield "displacements", f"blocks are {depth / size:.1e} of the contact size in each other"

    # Forces act at points where the displaced blocks touch. Slip counts from the configuration
    # before, if there is one.
    if i > 0:
        before = walk.found[i - 1]
        start = Start.at(walk.facets, before.pose, before.loose)
    points = start.points(pose)
    n, friction = here.forces[:, 0], np.linalg.norm(here.forces[:, 1:], axis=1)
    is_strange = ~_are_among(here.points, points, size)
    if (n[is_strange] > SLACK * n.max(initial=0.0)).any():
        yield "points", "some that bear are none of the blocks as they are displaced"

    # Equilibrium of every free block. Forces (n, v1, v2) are compression and friction along t1 and
    # t2, and statics has V1, V2 and N in this order.
    statics = Increment(scene, here.points, pose, loads).assemblage.statics
    forces = np.zeros((len(n), DOF))
    forces[:, [2, 0, 1]] = here.forces
    residual = np.abs(statics.residual(forces, here.load_factor))
    residual[:, 3:] /= size  # moments
    dead_load = np.abs(statics.dead.reshape(-1, DOF)[:, :3]).sum()
    if not residual.max() <= RESIDUAL * dead_load:
        yield "equilibrium", f"forces miss it by {residual.max() / dead_load:.1e} of the dead load"

    # No tension, and friction within its cone.
    excess = np.maximum(-n, friction - here.points.friction * n).max(initial=0.0)
    if not excess <= RESIDUAL * dead_load:
        yield "friction", f"forces exceed it by {excess / dead_load:.1e} of the dead load"

    # Without dilatancy friction opposes the slip of the last step, but for the loss that is told: a
    # share of the live load's work on that step at the first load factor.
    if path.flow != "associated" and i > 0:
        work = (here.w - path[i - 1].w) * loads.size * abs(path[0].load_factor)
        loss = here.points.lost(here.forces) / work
        if not loss <= max(here.loss, SLACK) * (1.0 + SLACK):
            yield f"loss {here.loss:.1e}", f"friction lacks {loss:.1e} of the step's work"

    # The bracket: no end of it is better, or called proved, where the one found again is not.
    if here.bracket is None:
        return
    least_gap = 0.0 if walk.has_dilatancy else here.points.bearing_gap(here.forces)
    again = bracket_of(scene, points, pose, loads, walk.flow, least_gap)[0]
    unit = max(abs(path[0].load_factor), abs(here.load_factor))
    for end, sign in (("lower", 1.0), ("upper", -1.0)):
        claimed, found = getattr(here.bracket, end), getattr(again, end)
        is_called_proved = getattr(here.bracket, f"{end}_is_proved")
        is_better = sign * (claimed - found) > SLACK * unit
        if is_better or (is_called_proved and not getattr(again, f"{end}_is_proved")):
            yield f"{end} bound {claimed:.9g}", f"{found:.9g} is shown"


def _are_among(held: Points, found: Points, size: float) -> BoolArray:
    """Returns which of the points held (k,) are among those found: of the same blocks, at the same
    place, with the same normal, gap, friction and, in size, slip."""
    features = [
        (
            p.at / size, p.axes[:, 2], p.gap[:, None] / size, p.friction[:, None],
            np.linalg.norm(p.slip, axis=1)[:, None] / size, p.a[:, None], p.b[:, None],
        )
        for p in (held, found)
    ]  # fmt: skip
    own, others = (np.concatenate(parts, axis=1) for parts in features)
    return np.array([(np.abs(others - row).max(axis=1) <= CLOSED).any() for row in own], dtype=bool)
