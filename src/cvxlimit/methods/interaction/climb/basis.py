"""What a certified bracket rests on, in a sentence."""

from __future__ import annotations

import numpy as np

from cvxlimit.bracket import Bracket
from cvxlimit.methods.interaction.climb.lower_bound import ACCEPTED


def basis(bracket: Bracket, *remarks: str) -> str:
    """How the bounds were proved, or under which assumption they hold; and what else is to say.

    Example
    -------
    >>> basis(Bracket(0.1, np.inf, True), "the time is up").split(";")[0]
    'lower bound proved: its forces satisfy Eq. 30 to rounding'
    """
    if not np.isfinite(bracket.lower):
        lower = "no forces were found that satisfy Eq. 30"
    elif bracket.lower_is_proved:
        lower = "lower bound proved: its forces satisfy Eq. 30 to rounding"
    else:
        lower = (
            f"lower bound: its forces satisfy Eq. 30 to {ACCEPTED:.0e} of the total load, and "
            "what that is worth is taken off if no rate exceeds ten times the lightest block's"
        )
    upper = (
        "upper bound proved against the hull of all true states"
        if bracket.upper_is_proved
        else "upper bound if no contact force exceeds ten times the total load or the largest "
        "one found"
    )
    return "; ".join(part for part in (lower, upper, *remarks) if part)
