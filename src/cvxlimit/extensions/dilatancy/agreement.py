"""What several searches for low members say together, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.solution import Search
from cvxlimit.solution.bracket import rounded

AGREE = 1e-3
"""Relative difference of load factors up to which searches agree."""


def agreement(searches: Sequence[Search]) -> str:
    """Returns what searches that ended say of each other: whether they agree, and if not where they
    ended and how late the lowest gained last. No search says that there is nothing lower."""
    found = sorted(s.load_factor for s in searches if s.load_factor is not None)
    if not found:
        return ""
    lowest = min(searches, key=lambda s: np.inf if s.load_factor is None else s.load_factor)
    more = "search on with more (--searches) or longer ones (--budget)"
    last = f"the last gain came after {lowest.last_gain} of {lowest.solves} solves"
    if len(searches) == 1:
        return (
            f"one search (seed {lowest.seed}) ended at {rounded(found[0], 4)}, {last}; whether "
            f"there are lower ones is not known: {more}"
        )
    are_all = len(found) == len(searches)
    if are_all and found[-1] - found[0] <= AGREE * max(map(abs, found)):
        return (
            f"{len(searches)} searches agree on {rounded(found[0], 4)}; "
            "whether there are lower ones is not known"
        )
    ends = ", ".join([*(rounded(factor, 4) for factor in found), *["none"] * (not are_all)])
    return f"{ends}: searches do not agree, there may be lower ones; {last}: {more}"


def about_zero(lowest: float, highest: float) -> str:
    """Returns a sentence on load factors below zero, if there are any."""
    if lowest >= 0.0:
        return ""
    if highest > 0.0:
        return (
            "0 lies between solutions: whether this stands under its dead load alone depends on "
            "the state of forces that it is in"
        )
    return "the load factors are below zero: in these states of forces the dead load slides alone"
