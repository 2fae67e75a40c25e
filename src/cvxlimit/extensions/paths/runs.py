"""Runs of a path: from rest, or from the end of one, until it ends; and with half the step.

One run follows the blocks (:mod:`.following`), goes on by explicit steps (:mod:`.proximal`) where
they come to no rest, and is written as a :class:`~cvxlimit.extensions.paths.path.Path`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError, NoAnswerError
from cvxlimit.extensions.paths.configuration import Flow
from cvxlimit.extensions.paths.following import LEVEL_FOR, Walk
from cvxlimit.extensions.paths.notes import BETWEEN, halving, of_walk
from cvxlimit.extensions.paths.path import Ending, Path
from cvxlimit.extensions.paths.proximal import go_on
from cvxlimit.scene import Scene
from cvxlimit.scene.settling import SupportMotion
from cvxlimit.solution import Solution


@dataclass(frozen=True, eq=False)
class Task:
    """What all runs of a path share: what is asked, the solution at rest or why there is none
    (``refusal``), the ``notes`` that hold of any run, and what ``tell`` hears of it."""

    scene: Scene
    initial: Solution | None
    refusal: InputError | NoAnswerError | None
    until: float
    certify: str
    reach: float
    stretch: float
    control: tuple[str, tuple[float, float, float]] | None
    notes: tuple[str, ...]
    tell: Callable[[str], None]
    motions: tuple[SupportMotion, ...] = ()
    given: Scene | None = None

    def path(self, walk: Walk, status: Ending, reason: str, longest: float = 0.0) -> Path:
        """What was walked, as a path that ends so; ``longest`` is a step of before."""
        return Path(
            self.initial, tuple(at.shown for at in walk.found), status, reason, walk.flow,
            step=max(walk.step, longest), snaps=tuple(walk.snaps), work=walk.work(),
            slides=any(at.slides for at in walk.found), control=self.control,
            notes=(*self.notes, *of_walk(walk)), until=self.until, failures=walk.failures(),
            stretch=self.stretch, motions=self.motions, given=self.given,
        )  # fmt: skip


def run(
    task: Task, flow: Flow, step: float | None, begin: Path | None, said: str = "",
    marks: FloatArray | None = None,
) -> Path:  # fmt: skip
    """One run of a path by a ``flow`` rule, from the end of ``begin`` if given, with steps from one
    of the ``marks`` (w) to the next; ``said`` stands before what is told."""
    walk = Walk(
        task.scene, task.certify, task.reach, lambda line: task.tell(f"{said}{line}"), flow,
        task.stretch, task.motions, task.until,
    )  # fmt: skip
    longest = 0.0
    if begin is not None:
        walk.resume(begin)
        if walk.has_come(task.until):
            return begin
        longest = begin.step if len(begin) > 1 else 0.0
    until = -np.inf if task.motions else task.until  # where nothing is carried, no push is so small

    def is_level() -> bool:
        if task.motions or walk.found[-1].shown.w <= walk.size:  # which needs no path to be made
            return False
        so_far = task.path(walk, "slides", "", longest)
        return so_far.level_for(walk.size) and so_far.slides_away

    try:
        ending = walk.walk(step, until, is_level, marks)
        # Where iterates do not settle explicit steps go on, until they do again; from then on they
        # also go on where a step finds no equilibrium.
        unsettled = {"not-converged", "blocked"}
        while ending[0] in unsettled and walk.found and walk.lasts:
            longest, unsettled = max(longest, walk.step), {*unsettled, "falls"}
            end = go_on(walk, until, is_level)
            if end is not None:
                if end[0] != "not-converged" or walk.found[-1].shown.is_followed:
                    ending = end
                break
            ending = walk.walk(step, until, is_level, marks)
            walk.step = max(walk.step, longest)
        if ending[0] == "steps" and task.path(walk, "slides", "", longest).slides_away:
            ending = "slides", LEVEL_FOR
    except KeyboardInterrupt:
        if not walk.found:
            raise
        ending = "interrupted", "interrupted: what was found until then"
    # A path that carries nothing at its start is refused, or lies below the solution at rest.
    start = walk.found[0].shown.load_factor if walk.found else -np.inf
    if task.refusal is not None and start <= task.until:
        raise task.refusal  # no push holds it either
    at_rest = None if task.initial is None else task.initial.load_factor
    if len(walk.found) == 1 and flow != "associated" and at_rest and start <= task.until < at_rest:
        ending = "zero", BETWEEN.format(low=start, high=at_rest)
    if task.certify == "last":
        walk.found[-1] = walk.proved(walk.found[-1])
    path = task.path(walk, *ending, longest)
    if task.motions and path.status == "falls":
        path = replace(path, fallen=walk.fallen())
    return path


def halved(task: Task, path: Path, half: Path | None, halvings: int, within: float) -> Path:
    """A path with every step in two, as often as ``halvings`` says, until that changes no more than
    ``within``; ``half`` is such a run to go on from."""
    notes, other = [*path.notes], path.other_flow
    for _ in range(halvings):
        if path.status == "interrupted":
            break
        path = path.halved or path
        marks = np.sort(np.concatenate([path.w, 0.5 * (path.w[1:] + path.w[:-1])]))
        begin = half or replace(path, configurations=path.configurations[:1], snaps=())
        half = run(task, path.flow, 0.5 * path.step, begin, "with half the step: ", marks)
        change, said = halving(path, half)
        notes.append(said)
        path = replace(path, halved=half, other_flow=other, notes=tuple(notes))
        if change <= within or half.status == "interrupted":
            break
        half = None
    return path
