"""A path as it is asked for, and beside one that slides the same with half the step.

1. What is asked is checked: choices, sizes, and motions of supports.
2. The scene is made one that can be followed, and solved at rest (:func:`cvxlimit.solve`).
3. Notes say what the path leaves out or assumes (:mod:`.notes`).
4. One run follows the blocks (:mod:`.runs`); a path with explicit steps is followed by the other
   flow rule as well.
5. Where joints slide, and the step was not given, all steps are halved, again and again, until that
   changes little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from cvxlimit.base.checks import count, is_number, not_negative, positive
from cvxlimit.base.progressbar import Progress, heard_by
from cvxlimit.errors import InputError, ModelError, NoAnswerError
from cvxlimit.extensions.paths.configuration import Flow
from cvxlimit.extensions.paths.notes import GIVEN, LEVEL_ON, TURNED, at_rest, beginning
from cvxlimit.extensions.paths.path import Path, other_than
from cvxlimit.extensions.paths.refusing import no_path, refuse, stands
from cvxlimit.extensions.paths.resting import REACH, Rest
from cvxlimit.extensions.paths.runs import Task, halved, run
from cvxlimit.extensions.paths.starting import for_path, with_resultants
from cvxlimit.extensions.paths.supports import guided
from cvxlimit.extensions.paths.wording import WITHIN
from cvxlimit.methods.settlement import settlement
from cvxlimit.methods.solving import solve
from cvxlimit.results.movement import checked_control
from cvxlimit.scene import Scene
from cvxlimit.scene.scene import check_scene
from cvxlimit.scene.settling import SupportMotion
from cvxlimit.solution import Solution

_CHOICES = {
    "flow": get_args(Flow),
    "certify": ("all", "last", "none"),
    "pressures": ("turning", "keeping"),
}


def pushover(
    scene: Scene | Path, step: float | None = None, until: float = 0.0, flow: Flow | None = None,
    control: tuple[str, Sequence[float]] | None = None,
    certify: Literal["all", "last", "none"] = "all", reach: float | None = None, halvings: int = 1,
    within: float = WITHIN, pressures: Literal["turning", "keeping"] | None = None,
    stretch: float | None = None, motion: SupportMotion | Sequence[SupportMotion] | None = None,
    progress: Progress = None,
) -> Path:  # fmt: skip
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
    before, given = None, None
    if isinstance(scene, Path):
        before, given, scene = scene, scene.given, scene.start
    # 1. What is asked.
    check_scene(scene)
    for name, choice in (("flow", flow), ("certify", certify), ("pressures", pressures)):
        if choice not in (None, *_CHOICES[name]):
            known = ", ".join(_CHOICES[name])
            raise ModelError(f"{name} must be one of {known}, got {choice!r}")
    for name, length in (("step", step), ("reach", reach), ("within", within)):
        if length is not None:
            positive(length, name)
    if stretch is not None:
        not_negative(stretch, "stretch")
    count(halvings, 0, "halvings")
    if not is_number(until):
        raise ModelError(f"until must be a load factor, got {until!r}")
    motions = (motion,) if isinstance(motion, SupportMotion) else tuple(motion or ())
    if motions or (before and before.motions):
        not_negative(until, "until, how far supports move,")
    if before is not None:
        if motions and motions != before.motions:
            raise ModelError("a path goes on with its own motions: leave motion out")
        if pressures is not None:
            raise ModelError(
                f"pressures={pressures!r} is for a scene: a path goes on with its own loads"
            )
        motions = before.motions
    elif motions:
        reaction = settlement(scene, motions)
        if reaction.value is None:
            status = reaction.solution.status
            raise NoAnswerError(f"no path begins at scene {scene.name!r}: {status}")
    # 2. The scene as it is followed, and the solution at rest or why there is none.
    keeps = pressures == "keeping" and bool(scene.dead.pressures or scene.live.pressures)
    if keeps:
        scene = with_resultants(scene)
    if motions and before is None:
        scene, given = guided(scene, motions), scene
    scene, why_not = for_path(scene)
    refuse(scene)
    size = np.ptp(np.concatenate([block.vertices for block in scene.blocks]), axis=0).max()
    if step is not None and not motions and step > size:
        raise ModelError(f"step must be no longer than all blocks, {size:.4g}, got {step:g}")
    initial, refusal = (None, None) if before is None else (before.initial, None)
    if before is None and not motions:
        initial, refusal = _at_rest(scene, why_not)
    # 3. What all runs share.
    reach = reach or REACH * scene.contacts.typical_size
    kind, about = flow or "associated", None
    if control is not None:
        about = checked_control(scene, control)
    if before is not None:
        kind, about = flow or before.flow, about or before.control
        stretch = before.stretch if stretch is None else stretch
    stretch = stretch or 0.0
    notes = tuple(at_rest(Rest(scene, reach, kind, stretch), initial, bool(motions), keeps))
    task = Task(
        scene, initial, refusal, float(until), certify, reach, stretch, about, notes,
        heard_by(progress), motions, given,
    )  # fmt: skip
    # 4. The path, and where it has explicit steps the same by the other flow rule.
    asked = step
    if before is not None:
        before, step = before.with_control(about), step or before.step or None
    path = replace(run(task, kind, step, before), halved=None, other_flow=None)
    if kind == "zero-dilatancy" and before is None and not motions and len(path):
        path = replace(path, notes=(*path.notes, beginning(path)))
    is_level = path.slides_away and path.level[0] == 0.0
    if path.followed and not is_level and path.status != "interrupted":
        rule, begin = other_than(kind), before.other_flow if before else None
        path = replace(path, other_flow=run(task, rule, step, begin, f"{rule}: "))
    # 5. Where the curve depends on the step, the same with half of it.
    if path.status == "interrupted" or not (path.slides or TURNED in path.notes):
        return path
    if asked is not None or is_level:
        path = replace(path, notes=(*path.notes, LEVEL_ON if is_level else GIVEN))
    else:
        path = halved(task, path, before.halved if before else None, halvings, within)
    half = path.halved
    if half is not None and half.status != "interrupted" and not path.ends_like(half):
        path = replace(path, status="not-decided")
        return replace(path, reason=path.headline)
    return replace(path, reason=path.headline) if path.slides_away else path


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
