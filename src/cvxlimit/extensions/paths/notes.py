"""What the notes of a path say: what it leaves out or assumes, and what half the step changes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cvxlimit.extensions.paths.following import Walk
from cvxlimit.extensions.paths.path import SLIDING, Path
from cvxlimit.extensions.paths.resting import FAR, At, Rest
from cvxlimit.extensions.paths.starting import from_rest
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import TOLERANCE

SLIDES = {
    "associated": "joints slide on the way, so that the curve depends on the step, on the unsafe "
    "side",
    "zero-dilatancy": "joints slide on the way, without dilatancy: friction then allows several "
    "answers, of which the path has one, and the step may decide which",
}

DISPLACED = (
    "it starts displaced: the dead load does not stand alone, and the push holds it from the "
    "start; there is no load factor at rest"
)

MOVED = (
    "supports move under the dead load alone: the load factor is what has to push them, and the "
    "reaction along the motion has its sign turned"
)

TURN, KEEP = (
    f"pressures stay on their faces as large as they were, and {what}"
    for what in ("turn with them", "keep their direction: point loads at their centres")
)

PUSHES = (
    "reactions have no stiffness: they push with their most as soon as blocks move against them, "
    "however little"
)

FROM_REST = "the path begins where the way from rest ends (method 'incremental')"
NOT_FROM_REST = (
    "the path begins in one of the states that friction without dilatancy allows, and not where a "
    "way from rest ends: {why}"
)

GIVEN, LEVEL_ON = (
    f"what half the step changes was not looked at: {why}"
    for why in ("the step was given", "the load factor is level from the start")
)

SYMMETRIC = (
    "the scene is symmetric, and from w = {w:.4g} on its path is not: what weakens as it moves "
    "falls on one side first, and its mirror image is another path"
)

BETWEEN = (
    "0 lies between the solutions: without dilatancy one load factor at rest is {low:.6g}, with it "
    "the largest is {high:.6g}, so that the dead load may fall alone, by what the blocks have been "
    "through, and no path begins"
)

TURNED = (
    "blocks have come back from where reactions or ties gave way, so that the curve depends on the "
    "step"
)


def at_rest(rest: Rest, initial: Solution | None, has_motions: bool, keeps: bool) -> Iterator[str]:
    """Yields what is to say of a path before its first step: whether it starts displaced, with no
    ``initial`` solution, what loads do, and what is left out at rest."""
    scene = rest.scene
    if initial is None and not has_motions:
        yield DISPLACED
    if has_motions:
        yield MOVED
    if scene.dead.pressures or scene.live.pressures:
        yield TURN
    if keeps:
        yield KEEP
    if scene.reactions:
        yield PUSHES
    yield from _left_out(rest)


def _left_out(rest: Rest) -> Iterator[str]:
    """Yields what is left out at rest because it is no contact of the scene, and what it is worth:
    slivers, edges and corners."""
    scene, worths = rest.scene, [*rest.left_out()]
    alone = rest.first() if worths else None
    if not isinstance(alone, At):
        return
    slivers = dict[frozenset[str], str]()
    if len(rest.facets.slivers):
        for miss in sorted(scene.near_misses, key=lambda miss: miss.size):
            if miss.kind == "sliver":
                slivers[frozenset((miss.a, miss.b))] = miss.sentence(scene.units.length)
    first = alone.shown.load_factor
    for blocks, factor in worths:
        if not blocks:
            if abs(factor - first) <= TOLERANCE * abs(first):
                continue  # they bear nothing
            what = "edges and corners that touch beside contacts"
        elif blocks == ("slivers",):
            what = "all slivers"
        else:
            narrow = f"{'-'.join(blocks)}: narrower than the joint tolerance"
            what = slivers.get(frozenset(blocks), narrow)
        change = f", {factor / first - 1.0:+.1%}" if first > 0.0 else ""
        worth = f"with it the path begins at {factor:.6g}{change}"
        yield f"{what}, left out at rest as solve does; {worth}"


def of_walk(walk: Walk) -> Iterator[str]:
    """Yields what is to say of a run: whether the step matters, symmetry, and what came apart."""
    if any(at.bonds.turned(at.pose) for at in walk.found if at.bonds):
        yield TURNED
    if any(at.slides for at in walk.found):
        yield SLIDES[walk.flow]
    for at in walk.found:
        if walk.out_of_symmetry(at) > FAR * walk.size:
            yield SYMMETRIC.format(w=at.shown.w)
            break
    failures = walk.failures()
    if failures:
        torn = ", ".join(f"{what} at w = {w:.4g}" for w, what in failures[:3])
        more = f" and {len(failures) - 3} more" if failures[3:] else ""
        yield f"gone from there on: {torn}{more}"


def beginning(path: Path) -> str:
    """Whether a path without dilatancy begins where the way from rest ends, or why it does not."""
    found, first = from_rest(path.start), path.load_factor[0]
    if isinstance(found, str):
        return NOT_FROM_REST.format(why=found)
    if abs(first - found[0]) <= SLIDING * abs(found[0]):
        return FROM_REST
    return NOT_FROM_REST.format(why=f"that is at {found[0]:.6g}, which the iterates did not keep")


def halving(path: Path, half: Path) -> tuple[float, str]:
    """How much half the step changes of a path, as a share, and in words: of ``d0``, over itself,
    or of load factors, over the first, whichever is more."""
    unit, change = path.units.displacement, replace(path, halved=half).change
    one, other = (
        f"{run.d0 if np.isfinite(run.d0) else run.displacement[-1]:.4g} {unit} ({run.ending})"
        for run in (path, half)
    )
    said = f"load factors at the same w change by up to {change:+.2%} of the first"
    if path.motions:
        said = f"reactions at the same w by up to {change:+.2%} of the weight"
    if half.followed:
        said += f"; {half.followed}"
    moved = 0.0
    if np.isfinite(path.d0) or np.isfinite(half.d0):
        moved = abs(half.d0 - path.d0) / abs(path.d0)
    most = float(np.nan_to_num(max(abs(change), moved), nan=np.inf))
    return most, f"with half the step it ends at {other} instead of {one}, and {said}"
