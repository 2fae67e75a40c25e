"""Live loads of which any multiple is carried with dilatancy: do they no harm without it either?

Associated friction lets joints press as hard as it takes, since they would open as they slide. So
forces that carry any multiple of the live load say nothing about friction without dilatancy: a
wedge in a groove jams with it and slides without it. There are three readings.

- The live load does no harm. This is proved where forces *without any friction* carry it alone, and
  others carry the dead load: joints that do not penetrate then let no load do work, however they
  slide. Where that takes friction, it is proved with no more of it than joints have in every state
  of forces (:mod:`cvxlimit.methods.least_thrust`).
- Joints slide without dilatancy: a solution that does was found, by the extension that searches.
- It is not known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door
from cvxlimit.methods.admitting import unlimited
from cvxlimit.methods.aside import Aside
from cvxlimit.methods.driver import Run
from cvxlimit.methods.least_thrust import affordable, excluded_without_end, is_covered
from cvxlimit.model.statics import DOF
from cvxlimit.proof.checks import Check
from cvxlimit.reductions.choice import loaded_blocks
from cvxlimit.solution import LowerEnd, Solution, Status
from cvxlimit.solution.bracket import rounded
from cvxlimit.solution.kinematics import Dilatancy
from cvxlimit.surfaces.coulomb import strength_key

_SEARCH = "slides_without_dilatancy"

_BEYOND = 1e-4
"""Where the dead load stands only with a part of the live load, the proof begins so much beyond the
least one, relative: there, forces are at their limit."""


def judged(run: Run, is_plain: bool = True) -> Status:
    """Which of the three readings a run has that ended :attr:`Status.UNBOUNDED
    <cvxlimit.solution.Status.UNBOUNDED>`: the status, with what shows it in ``run.best``.

    Forces without friction show that the live load does no harm under any law of friction. The rest
    is Coulomb's without interaction: it is asked for where ``is_plain`` is true. Guided supports
    are asked for reactions: they keep their status.
    """
    if run.assemblage.statics.guide is not None:
        return Status.UNBOUNDED
    if free := unlimited(run):  # joints do not slide, with dilatancy or without
        run.remarks.append(f"{free}, so that joints bear any of it")
        return Status.UNBOUNDED
    end = run.best.lower_end
    start = start_of(run, end)
    run.tell("checking whether the live load does any harm without dilatancy")
    status = Status.UNBOUNDED
    forces = carried_without_friction(run, start)
    if forces is not None:
        status = Status.LIVE_LOAD_HARMLESS
        if is_plain:  # those with interaction are strictly inside, and these need not be
            run.best = replace(run.best, forces=forces)
    else:
        run.best = replace(run.best, dilatancy=Dilatancy(np.inf))
        if is_plain and is_covered(run):
            status = _with_least_thrusts(run, start)
    if status is Status.LIVE_LOAD_HARMLESS and end is not None:
        run.remarks.append(f"from {rounded(start, 6)} on it does no harm without dilatancy either")
    return status


def _with_least_thrusts(run: Run, start: float) -> Status:
    """Whether least thrusts prove that the live load does no harm at a load factor above ``start``,
    with what shows it in the run's best answer: forces that prove it, or else the load factor below
    which nothing slides, and a solution that does, where one is found."""
    run.tell("bounding solutions without dilatancy from below")
    bound = excluded_without_end(run, start, affordable(run))
    if np.isinf(bound.load_factor):
        run.best = replace(run.best, forces=bound.forces, dilatancy=None)
        return Status.LIVE_LOAD_HARMLESS
    safe = bound.load_factor if bound.load_factor > start else 0.0
    known, readings = Dilatancy(np.inf, safe=safe), Door("cvxlimit.readings")
    beside = dict(bound.evidence) if safe > 0.0 else {}
    if (search := readings.get(_SEARCH)) is not None:
        if (found := search(run, start, safe)) is not None:
            known, beside["slides"] = found
    elif missing := readings.missing(_SEARCH, "the search for loads at which joints slide"):
        run.remarks.append(str(missing))
    run.best = replace(run.best, dilatancy=known, beside=beside)
    return Status.UNBOUNDED


def start_of(run: Run, end: LowerEnd | None) -> float:
    """From which load factor on a proof begins: a little beyond the lower end, if there is one."""
    return 0.0 if end is None else end.load_factor + _BEYOND * run.scaling.unit(end.load_factor)


def without_limit(check: Check, run: Run, solution: Solution) -> Check:
    """The check of forces that carry the live load alone as what a solution claims of them: that it
    does no harm is sought and proved anew, by a run of its scene."""
    if solution.status is Status.UNBOUNDED:
        return replace(check, claim="any multiple of the live load is carried with dilatancy")
    aside = run.auxiliary_run()
    aside.best = replace(aside.best, lower_end=solution.lower_end)
    is_plain = solution.interaction == "none" and solution.torsion_shear in ("linear", "")
    if check.is_met and judged(aside, is_plain) is not Status.LIVE_LOAD_HARMLESS:
        return replace(check, is_met=False, found="forces carry it alone, but by dilatancy")
    return check


def carried_without_friction(run: Run, start: float) -> FloatArray | None:
    """Forces (n, 6) without friction that carry the live load alone, if others carry the dead load
    and ``start`` times the live load, so that all that is beyond is carried without friction; None
    if none are found, and for surfaces of one's own, whose friction may be another."""
    if strength_key(run.surfaces, run.contacts) is None:
        return None
    contacts, statics = run.contacts, run.assemblage.statics
    smooth = replace(contacts, friction=np.zeros(len(contacts)))
    aside = Aside(run.auxiliary_run(run.assemblage.with_contacts(smooth)), run.model)
    # parts without live load carry their dead load by themselves, however they do it
    is_loaded = np.repeat(loaded_blocks(statics), DOF)
    at_start = np.where(is_loaded, statics.dead + start * statics.live, 0.0)
    is_empty = not at_start.any()
    if not is_empty and aside.carrying(at_start, aside.surfaces, run.formulation) is None:
        return None
    return aside.carrying(statics.live, *aside.certifier.strength.recession())
