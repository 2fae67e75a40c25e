"""A path as it is asked for, and beside one that slides the same with half the step.

1. What is asked is checked, and the scene solved at rest (:func:`cvxlimit.solve`).
2. One run follows the blocks (:mod:`.following`), and goes on by explicit steps
   (:mod:`.proximal`) where they come to no rest.
3. A path with explicit steps is followed by the other flow rule as well.
4. Where joints slide, and the step was not given, all steps are halved, again and again, until that
   changes little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Literal, get_args

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, is_number, not_negative, positive
from cvxlimit.base.progressbar import Progress, heard_by
from cvxlimit.errors import InputError, ModelError, NoAnswerError
from cvxlimit.extensions.paths.configuration import Flow
from cvxlimit.extensions.paths.following import Walk
from cvxlimit.extensions.paths.path import LEVEL_FOR, SLIDING, WITHIN, Ending, Path, other_than
from cvxlimit.extensions.paths.proximal import go_on
from cvxlimit.extensions.paths.refusing import no_path, refuse, stands
from cvxlimit.extensions.paths.resting import FAR, REACH, At, Rest
from cvxlimit.extensions.paths.starting import begun, from_rest, with_resultants
from cvxlimit.extensions.paths.supports import guided
from cvxlimit.methods.settlement import settlement
from cvxlimit.methods.solving import solve
from cvxlimit.results.movement import checked_control
from cvxlimit.scene import Scene
from cvxlimit.scene.scene import check_scene
from cvxlimit.scene.settling import SupportMotion
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


_CHOICES = {
    "flow": get_args(Flow),
    "certify": ("all", "last", "none"),
    "pressures": ("turning", "keeping"),
}


def pushover(
    scene: Scene | Path,
    step: float | None = None,
    until: float = 0.0,
    flow: Flow | None = None,
    control: tuple[str, Sequence[float]] | None = None,
    certify: Literal["all", "last", "none"] = "all",
    reach: float | None = None,
    halvings: int = 1,
    within: float = WITHIN,
    pressures: Literal["turning", "keeping"] | None = None,
    stretch: float | None = None,
    motion: SupportMotion | Sequence[SupportMotion] | None = None,
    progress: Progress = None,
) -> Path:
    """The path of a structure after its collapse load factor, in finite displacements.

    The live load's points of action are moved on step by step; blocks move exactly, contacts open,
    close and appear, and the load factor is what holds each configuration. A joint has lost its
    cohesion for good once it has opened or slid (``path.failures``). Reactions and ties act at
    points that move with their blocks, and give way at their largest force without stiffness.
    Friction is taken at
    points, so that the first load factor differs from that of :func:`cvxlimit.solve`, which is
    ``path.initial``. A bracket proves what its configuration carries, not that the structure
    gets there. Where iterates do not come to rest explicit steps go on: such a path is followed by
    the other flow rule as well (``path.other_flow``), and ``path.d0_interval`` is over both.

    Parameters
    ----------
    scene : Scene or Path
        A path goes on from its last configuration, with its own step and control unless others are
        given. A scene may start displaced, its blocks on edges and corners, if the push holds it
        there: its first load factor is that of this position, and ``path.initial`` is None.
        ``contact_friction`` may name blocks that touch only later.
    step : float or None
        Of w, the mean displacement of the live load, in the scene's unit of length; None: an eighth
        of what the last slope takes to ``until``, at most an eighth of the contact size, and where
        joints slide, or blocks come back from where reactions gave way, the whole again with each
        step in two (``path.halved``). Where no equilibrium is found, a step is halved.
    until : float
        Load factor at which the path ends; of supports that move how far they do (w), 0 for as far
        as the structure stands.
    flow : {"associated", "zero-dilatancy"} or None
        In steps along which joints slide they open by friction times slip, or not at all; None: as
        the path to go on from, otherwise the first. Where none slides, both are the same. Of the
        states that zero dilatancy allows, the path begins with that at the end of the way from rest
        (:class:`cvxlimit.Incremental`), without cohesion.
    control : (block id, direction) or None
        Whose displacement ``path.displacement`` is; w without one.
    certify : {"all", "last", "none"}
        Which configurations get a bracket.
    reach : float or None
        How far apart faces may be at the start of a step to meet in it (length); None: a fifth of
        the contact size.
    halvings : int
        How often all steps are halved at most, each time for twice the time of the run before.
    within : float
        Change of ``d0``, over itself, and of load factors, over the first, with which halving ends:
        a fiftieth, which no check of a displacement notices.
    pressures : {"turning", "keeping"} or None
        What pressures do that stay, as large as they are, on the faces that they are found on: turn
        with them, as water does, or keep their direction; these are point loads of ``path.scene``
        from then on. None: turning, and of a path to go on from as they are.
    stretch : float or None
        How far a tie is stretched at its strength before it is gone, as a share of its length: a
        material's elongation at rupture. None: 0, a tie is gone once it has yielded; of a path to
        go on from as before.
    motion : SupportMotion or sequence of them, or None
        Supports that move and turn, exactly, under the dead load alone, until no forces carry it:
        the live load does not matter, and ``path.reactions`` has their reaction along the motion.
        w is the way of the first one, or its angle (radians) where it only turns.
    progress : bool, callable or None
        Called with a line of text for every configuration; True writes it on stderr.

    Returns
    -------
    Path
        Where it was interrupted, up to there. Where its load factor stays level because joints
        slide (``path.slides_away``), its ``reason`` names these, and it has no ``d0``. Its
        ``to_dataframe()`` has a row per configuration.

    Raises
    ------
    NoAnswerError
        For a scene that does not stand and that the push does not hold, and a live load that does
        no harm.
    GeometryError
        For blocks that touch nothing, not even at an edge.
    ModelError
        For tensile or compressive strength, and for unknown choices.

    Example
    -------
    A block of 0.4 by 1 m rocks about its edge until its centroid is above it:

    >>> from cvxlimit import builtin_scene, pushover
    >>> path = pushover(builtin_scene("single-block"))
    >>> path.status, round(float(path.load_factor[0]), 6), round(path.d0, 6)
    ('zero', 0.4, 0.2)
    """
    before = scene if isinstance(scene, Path) else None
    scene, given = (scene.start, scene.given) if isinstance(scene, Path) else (scene, None)
    check_scene(scene)
    motions = (motion,) if isinstance(motion, SupportMotion) else tuple(motion or ())
    _check_choices(flow=flow, certify=str(certify), pressures=pressures)
    _check_sizes(step=step, reach=reach, within=within, stretch=stretch)
    count(halvings, 0, "halvings")
    if not is_number(until):
        raise ModelError(f"until must be a load factor, got {until!r}")
    if motions or (before and before.motions):
        not_negative(until, "until, how far supports move,")
    if before is not None:
        if motions and motions != before.motions:
            raise ModelError("a path goes on with its own motions: leave motion out")
        motions = before.motions
    elif motions:
        reaction = settlement(scene, motions)
        if reaction.value is None:
            raise NoAnswerError(
                f"no path begins at scene {scene.name!r}: {reaction.solution.status}"
            )
    if pressures is not None and before is not None:
        raise ModelError(
            f"pressures={pressures!r} is for a scene: a path goes on with its own loads"
        )
    keeps = pressures == "keeping" and bool(scene.dead.pressures or scene.live.pressures)
    scene = with_resultants(scene) if keeps else scene
    if motions and before is None:
        scene, given = guided(scene, motions), scene
    scene, why_not = begun(scene)
    refuse(scene)
    corners = np.concatenate([block.vertices for block in scene.blocks])
    if step is not None and not motions and step > (size := np.ptp(corners, axis=0).max()):
        raise ModelError(f"step must be no longer than all blocks, {size:.4g}, got {step:g}")
    stretch = (before.stretch if before else 0.0) if stretch is None else stretch
    # What all runs share: the solution at rest, and notes that hold of any of them.
    initial, refusal = (before.initial, None) if before else (None, None)
    if not before and not motions:
        initial, refusal = _at_rest(scene, why_not)
    may_be_said = {
        DISPLACED: initial is None and not motions,
        MOVED: motions,
        TURN: scene.dead.pressures or scene.live.pressures,
        KEEP: keeps,
        PUSHES: scene.reactions,
    }
    notes = [note for note, holds in may_be_said.items() if holds]
    reach = reach or REACH * scene.contacts.typical_size
    kind = flow or (before.flow if before else "associated")
    notes += _left_out(Rest(scene, reach, kind, stretch))
    about = None if control is None else checked_control(scene, control)
    about = about or (before.control if before else None)
    task = _Task(
        scene, initial, refusal, float(until), certify, reach, stretch, about, tuple(notes),
        heard_by(progress), motions, given,
    )  # fmt: skip
    # The path, and where it has explicit steps the same by the other flow rule.
    asked = step
    if before is not None:
        before, step = before.with_control(about), step or before.step or None
    path = replace(_run(task, kind, step, before), halved=None, other_flow=None)
    if kind == "zero-dilatancy" and not before and not motions and len(path):
        path = replace(path, notes=(*path.notes, _beginning(path)))
    is_level = path.slides_away and path.level[0] == 0.0
    if path.followed and not is_level and path.status != "interrupted":
        rule, begin = other_than(kind), before.other_flow if before else None
        path = replace(path, other_flow=_run(task, rule, step, begin, f"{rule}: "))
    if path.status == "interrupted" or not (path.slides or TURNED in path.notes):
        return path
    if asked is not None or is_level:
        path = replace(path, notes=(*path.notes, LEVEL_ON if is_level else GIVEN))
    else:
        path = _halved(task, path, before.halved if before else None, halvings, within)
    half = path.halved
    if half is not None and half.status != "interrupted" and not path.ends_like(half):
        path = replace(path, status="not-decided")
        return replace(path, reason=path.headline)
    return replace(path, reason=path.headline) if path.slides_away else path


def _halved(
    task: _Task, path: Path, half: Path | None, halvings: int, within: float
) -> Path:  # fmt: skip
    """A path with every step in two, as often as ``halvings`` says, until that changes no more than
    ``within``; ``half`` is such a run to go on from."""
    notes, other = [*path.notes], path.other_flow
    for _ in range(halvings):
        if path.status == "interrupted":
            break
        path = path.halved or path
        marks = np.sort(np.concatenate([path.w, 0.5 * (path.w[1:] + path.w[:-1])]))
        begin = half or replace(path, configurations=path.configurations[:1], snaps=())
        half = _run(task, path.flow, 0.5 * path.step, begin, "with half the step: ", marks)
        change, said = _change(path, half)
        notes.append(said)
        path = replace(path, halved=half, other_flow=other, notes=tuple(notes))
        if change <= within or half.status == "interrupted":
            break
        half = None
    return path


def _beginning(path: Path) -> str:
    """Whether a path without dilatancy begins where the way from rest ends, or why it does not."""
    found, first = from_rest(path.start), path.load_factor[0]
    if isinstance(found, str):
        return NOT_FROM_REST.format(why=found)
    if abs(first - found[0]) <= SLIDING * abs(found[0]):
        return FROM_REST
    return NOT_FROM_REST.format(why=f"that is at {found[0]:.6g}, which the iterates did not keep")


def _check_choices(**given: str | None) -> None:
    """Refuses what is none of its choices, by the name of its argument."""
    for name, value in given.items():
        if value not in (None, *_CHOICES[name]):
            known = ", ".join(_CHOICES[name])
            raise ModelError(f"{name} must be one of {known}, got {value!r}")


def _check_sizes(*, stretch: float | None, **lengths: float | None) -> None:
    """Refuses lengths that are not positive, and a stretch below zero; None is none."""
    for name, length in lengths.items():
        if length is not None:
            positive(length, name)
    if stretch is not None:
        not_negative(stretch, "stretch")


def _left_out(rest: Rest) -> list[str]:
    """Sentences on what is left out at rest because it is no contact of the scene, and what it is
    worth: slivers, edges and corners."""
    scene, said = rest.scene, list[str]()
    worths = [*rest.left_out()]
    if not worths or not isinstance(alone := rest.first(), At):
        return said
    misses = sorted(scene.near_misses, key=lambda m: m.size) if len(rest.facets.slivers) else []
    misses = [miss for miss in misses if miss.kind == "sliver"]
    wide = {frozenset((m.a, m.b)): m.sentence(scene.units.length) for m in misses}
    first = alone.shown.load_factor
    for blocks, factor in worths:
        if not blocks and abs(factor - first) <= TOLERANCE * abs(first):
            continue  # edges and corners that bear nothing
        what = wide.get(frozenset(blocks), f"{'-'.join(blocks)}: narrower than the joint tolerance")
        what = "all slivers" if blocks == ("slivers",) else what
        what = what if blocks else "edges and corners that touch beside contacts"
        change = f", {factor / first - 1.0:+.1%}" * (first > 0.0)
        worth = f"with it the path begins at {factor:.6g}{change}"
        said.append(f"{what}, left out at rest as solve does; {worth}")
    return said


def _at_rest(
    scene: Scene, why_not: InputError | NoAnswerError | None
) -> tuple[Solution | None, InputError | NoAnswerError | None]:
    """The solution of a scene at rest; or None, and why no path begins there, unless the push holds
    the scene."""
    if why_not is not None:
        return None, why_not
    initial = solve(scene)
    refusal = no_path(initial)
    if refusal is not None and stands(initial):
        raise refusal
    return (initial, None) if refusal is None else (None, refusal)


@dataclass(frozen=True, eq=False)
class _Task:
    """What all runs of a path share: what is asked, the solution at rest or why there is none
    (``refusal``), and the ``notes`` that hold of any run."""

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
        slides, failures = any(x.slides for x in walk.found), walk.failures()
        notes = [*self.notes]
        notes += [TURNED] * any(x.bonds.turned(x.pose) for x in walk.found if x.bonds)
        notes += [SLIDES[walk.flow]] * slides
        off = (x.shown.w for x in walk.found if walk.out_of_symmetry(x) > FAR * walk.size)
        notes += [SYMMETRIC.format(w=w) for w in islice(off, 1)]
        if failures:
            torn = ", ".join(f"{what} at w = {w:.4g}" for w, what in failures[:3])
            more = f" and {len(failures) - 3} more" if failures[3:] else ""
            notes.append(f"gone from there on: {torn}{more}")
        return Path(
            self.initial, tuple(x.shown for x in walk.found), status, reason, walk.flow,
            max(walk.step, longest), tuple(walk.snaps), walk.work(), slides, self.control,
            tuple(notes), until=self.until, failures=failures, stretch=self.stretch,
            motions=self.motions, given=self.given,
        )  # fmt: skip


def _run(
    task: _Task, flow: Flow, step: float | None, begin: Path | None, said: str = "",
    marks: FloatArray | None = None,
) -> Path:  # fmt: skip
    """One run of a path by a ``flow`` rule, from the end of ``begin`` if given, with steps from one
    of the ``marks`` (w) to the next; ``said`` stands before what is told."""
    walk = Walk(
        task.scene, task.certify, task.reach, lambda line: task.tell(f"{said}{line}"), flow,
        task.stretch, task.motions, task.until,
    )  # fmt: skip
    if begin is not None:
        walk.resume(begin)
        if walk.has_come(task.until):
            return begin
    until = -np.inf if task.motions else task.until  # where nothing is carried, no push is so small
    longest = begin.step if begin is not None and len(begin) > 1 else 0.0

    def is_level() -> bool:
        if task.motions or walk.found[-1].shown.w <= walk.size:  # which needs no path to be made
            return False
        so_far = task.path(walk, "slides", "", longest)
        return so_far.level_for(walk.size) and so_far.slides_away

    try:
        ending = walk.walk(step, until, is_level, marks)
        # Where iterates do not settle explicit steps go on, until they do again.
        unsettled = {"not-converged", "blocked"}
        is_at_end = False
        while ending[0] in unsettled and walk.found and walk.lasts and not is_at_end:
            longest, unsettled = max(longest, walk.step), {*unsettled, "falls"}
            end = go_on(walk, until, is_level)
            is_at_end = end is not None
            if end is None:
                ending = walk.walk(step, until, is_level, marks)
                walk.step = max(walk.step, longest)
            elif end[0] != "not-converged" or walk.found[-1].shown.is_followed:
                ending = end
        if ending[0] == "steps" and task.path(walk, "slides", "", longest).slides_away:
            ending = "slides", LEVEL_FOR
    except KeyboardInterrupt:
        if not walk.found:
            raise
        ending = "interrupted", "interrupted: what was found until then"
    start = walk.found[0].shown.load_factor if walk.found else -np.inf
    if task.refusal is not None and start <= task.until:
        raise task.refusal  # no push holds it either
    alone = (task.initial and task.initial.load_factor) or -np.inf
    if len(walk.found) == 1 and start <= task.until < alone and flow != "associated":
        ending = "zero", BETWEEN.format(low=start, high=alone)
    if task.certify == "last":
        walk.found[-1] = walk.proved(walk.found[-1])
    path = task.path(walk, *ending, longest)
    if task.motions and path.status == "falls":
        path = replace(path, fallen=walk.fallen())
    return path


def _change(path: Path, half: Path) -> tuple[float, str]:
    """How much half the step changes of a path, as a share, and in words."""
    unit, most = path.units.displacement, replace(path, halved=half).change
    ends = (x.d0 if np.isfinite(x.d0) else x.displacement[-1] for x in (path, half))
    one, other = (f"{w:.4g} {unit} ({x.ending})" for w, x in zip(ends, (path, half), strict=True))
    of = "load factors at the same w change by up to {:+.2%} of the first"
    of = "reactions at the same w by up to {:+.2%} of the weight" if path.motions else of
    low, high = path.d0, half.d0
    moved = abs(high - low) / abs(low) if np.isfinite(low) or np.isfinite(high) else 0.0
    return float(np.nan_to_num(max(abs(most), moved), nan=np.inf)), (
        f"with half the step it ends at {other} instead of {one}, and {of.format(most)}"
        + f"; {half.followed}" * bool(half.followed)
    )
