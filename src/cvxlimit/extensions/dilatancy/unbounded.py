"""Loads of which any multiple is carried with dilatancy: what becomes of them without it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import SMALL
from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.methods.driver import Run
from cvxlimit.methods.least_thrust import affordable
from cvxlimit.solution import Member
from cvxlimit.solution.bracket import Evidence
from cvxlimit.solution.kinematics import Dilatancy, sliding_joints

_TRIES, _SEARCHED = 50, 5
"""Tries of the search for a solution that slides, and how many times the problems of a bound it may
take: five times what those need in scenes of some ten joints."""


def slides_without_dilatancy(
    run: Run, start: float, safe: float
) -> tuple[Dilatancy, Evidence] | None:
    """The lowest solution without dilatancy above the load factor ``start`` that is found, with the
    joints that slide in it, and its evidence; None if none is. Below ``safe`` there is none.

    The search ends after numbers of problems that go with the number of joints, and early at a
    solution that is nearly proved to be the lowest.
    """
    lowest = _lowest(run, start, safe)
    if lowest is None:
        return None
    relative = run.assemblage.statics.relative_rates(lowest.mechanism)
    joints = sliding_joints(run.scene, relative, lowest.mechanism)
    by = Evidence(lowest.load_factor, lowest.forces, lowest.mechanism)
    return Dilatancy(np.inf, *joints, safe, lowest.load_factor), by


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
