"""What a bracket rests on: residuals, and where a bound is not proved, assumptions on sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.solution.bracket import Bracket

REFERENCE = 10.0
"""Where a bound needs an assumption, it is that no contact force of the exact solution exceeds
this multiple of the total load or of the largest force given, and no rate this multiple of the
given mechanism's largest."""

PROVED = "both bounds are proved, up to rounding"
"""The note of a solution whose bracket needs no assumption."""


def assumptions(bracket: Bracket) -> str:
    """Under which assumptions the bounds that exist hold.

    >>> assumptions(Bracket(0.1, 0.2, True, True)), assumptions(Bracket(0.1, lower_is_proved=True))
    ('both bounds are proved, up to rounding', 'the lower bound is proved, up to rounding')
    """
    sides = {
        "lower": f"no block moves more than {REFERENCE:g} times as fast at collapse as the fastest "
        "of the mechanism found",
        "upper": f"no contact bears more than {REFERENCE:g} times the total load, or "
        f"{REFERENCE:g} times the largest force found",
    }
    known = [side for side in sides if np.isfinite(getattr(bracket, side))]
    assumed = [side for side in known if not getattr(bracket, f"{side}_is_proved")]
    if known and not assumed:
        return PROVED if len(known) == 2 else f"the {known[0]} bound is proved, up to rounding"
    return " and ".join(f"the {side} bound holds if {sides[side]}" for side in assumed)


@dataclass(frozen=True)
class Certificate(Bracket):
    """A bracket, and the residuals it was computed from.

    Attributes
    ----------
    equilibrium_residual, yield_excess : float
        Largest over blocks and contacts, in units of the total load (moments over the typical
        contact size).
    flow_violation : float
        Largest missing opening at a contact over the mechanism's largest rate.
    missing_opening : float
        Sum of the missing openings at contacts, for live power 1: contact forces below its
        reciprocal cannot take up that power.
    """

    equilibrium_residual: float = np.nan
    yield_excess: float = np.nan
    flow_violation: float = np.nan
    missing_opening: float = np.nan
