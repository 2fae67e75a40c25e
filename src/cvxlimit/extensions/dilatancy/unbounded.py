"""Loads of which any multiple is carried with dilatancy: what becomes of them without it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import SMALL
from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.least_thrust import affordable, excluded_without_end, is_covered
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.methods.driver import Run
from cvxlimit.solution import Member, Status
from cvxlimit.solution.kinematics import Dilatancy, sliding_joints

_TRIES, _SEARCHED = 50, 5
"""Tries of the search for a solution that slides, and how many times the problems of a bound it may
take: five times what those need in scenes of some ten joints."""


def without_dilatancy(run: Run, start: float) -> Status:
    """Whether the live load does harm without dilatancy at a load factor above ``start``, with what
    shows it in the run's best answer: forces that prove that it does none, or a solution that
    slides, and the load factor below which there is none.

    Proof and search end after numbers of problems that go with the number of joints. The search
    ends early at a solution that is nearly proved to be the lowest.
    """
    if not is_covered(run):
        return Status.UNBOUNDED
    run.tell("bounding solutions without dilatancy from below")
    bound = excluded_without_end(run, start, affordable(run))
    if np.isinf(bound.load_factor):
        run.best = replace(run.best, forces=bound.forces, dilatancy=None)
        return Status.LIVE_LOAD_HARMLESS
    safe = bound.load_factor if bound.load_factor > start else 0.0
    known, lowest = Dilatancy(np.inf, safe=safe), _lowest(run, start, safe)
    if lowest is not None:
        relative = run.assemblage.statics.relative_rates(lowest.mechanism)
        joints = sliding_joints(run.scene, relative, lowest.mechanism)
        known = Dilatancy(np.inf, *joints, safe, lowest.load_factor)
    run.best = replace(run.best, dilatancy=known)
    return Status.UNBOUNDED


def _lowest(run: Run, start: float, safe: float) -> Member | None:
    """The lowest solution without dilatancy above ``start`` that is found."""
    statics = run.assemblage.statics
    moved = run.assemblage.under(statics.dead + start * statics.live, statics.live)
    aside = run.auxiliary_run(moved)
    lowest: Member | None = None
    with suppress(ModelError):  # it has no proof that it stands at the start
        for tries, _ in enumerate(ZeroDilatancy().steps(aside)):
            beyond = [m for m in aside.best.members if m.load_factor > 0.0]
            members = [replace(m, load_factor=m.load_factor + start) for m in beyond]
            lowest = min(members, key=lambda m: m.load_factor, default=None)
            is_least = lowest is not None and lowest.load_factor <= (1.0 + SMALL) * safe
            is_over = tries >= _TRIES or len(aside.history) > _SEARCHED * affordable(run)
            if is_least or is_over:
                break
    return lowest
