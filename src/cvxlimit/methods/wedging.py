"""Live loads of which any multiple is carried with dilatancy: do they no harm without it either?

Associated friction lets joints press as hard as it takes, since they would open as they slide. So
forces that carry any multiple of the live load say nothing about friction without dilatancy: a
wedge in a groove jams with it and slides without it. There are three readings.

- The live load does no harm. This is proved where forces *without any friction* carry it alone, and
  others carry the dead load: joints that do not penetrate then let no load do work, however they
  slide. Where that takes friction, it is proved with no more of it than joints have in every state
  of forces (:mod:`cvxlimit.extensions.dilatancy.unbounded`).
- Joints slide without dilatancy: a solution that does was found.
- It is not known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.aside import Aside
from cvxlimit.methods.driver import Run
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.statics import DOF
from cvxlimit.proof.checks import Check
from cvxlimit.reductions.choice import loaded_blocks
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import rounded
from cvxlimit.solution.kinematics import Dilatancy
from cvxlimit.surfaces.coulomb import strength_key

_BEYOND = 1e-4
"""Where the dead load stands only with a part of the live load, the proof begins so much beyond the
least one, relative: there, forces are at their limit."""


def judged(run: Run, is_plain: bool = True) -> Status:
    """Which of the three readings a run has that ended :attr:`Status.UNBOUNDED
    <cvxlimit.solution.Status.UNBOUNDED>`: the status, with what shows it in ``run.best``.

    Forces without friction show that the live load does no harm under any law of friction. The rest
    is Coulomb's without interaction: it is asked for where ``is_plain`` is true, and if the
    extension that knows it is there. Guided supports are asked for reactions: they keep their
    status.
    """
    if run.assemblage.statics.guide is not None:
        return Status.UNBOUNDED
    start, end = 0.0, run.best.lower_end
    if end is not None:
        start = end.load_factor + _BEYOND * run.scaling.unit(end.load_factor)
    run.tell("checking whether the live load does any harm without dilatancy")
    status = Status.UNBOUNDED
    forces = carried_without_friction(run, start)
    if forces is not None:
        status = Status.LIVE_LOAD_HARMLESS
        if is_plain:  # those with interaction are strictly inside, and these need not be
            run.best = replace(run.best, forces=forces)
    else:
        run.best = replace(run.best, dilatancy=Dilatancy(np.inf))
        extension = Door("cvxlimit.readings").get("without_dilatancy")
        if is_plain and extension is not None:
            status = extension(run, start)
    if status is Status.LIVE_LOAD_HARMLESS and end is not None:
        run.remarks.append(f"from {rounded(start, 6)} on it does no harm without dilatancy either")
    return status


def without_limit(check: Check, run: Run, solution: Solution) -> Check:
    """The check of forces that carry the live load alone as what a solution claims of them: that it
    does no harm is sought and proved anew, by a run of its scene."""
    if solution.status is Status.UNBOUNDED:
        return replace(check, claim="any multiple of the live load is carried with dilatancy")
    aside = run.auxiliary_run()
    aside.best = replace(aside.best, lower_end=solution.lower_end)
    is_plain = solution.interaction == "none" and solution.torsion_shear == "linear"
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
    aside = Aside(run.auxiliary_run(with_contacts_of(run.assemblage, smooth)), run.model)
    # parts without live load carry their dead load by themselves, however they do it
    is_loaded = np.repeat(loaded_blocks(statics), DOF)
    at_start = np.where(is_loaded, statics.dead + start * statics.live, 0.0)
    is_empty = not at_start.any()
    if not is_empty and aside.carrying(at_start, aside.surfaces, run.formulation) is None:
        return None
    return aside.carrying(statics.live, *aside.certifier.strength.recession())


def with_contacts_of(assemblage: Assemblage, contacts: Contacts) -> Assemblage:
    """The same mechanics with other strengths of its contacts."""
    statics = replace(assemblage.statics, contacts=contacts)
    statics.__dict__["matrix"] = assemblage.statics.matrix
    return replace(assemblage, statics=statics, strengths={})
