"""What is to say of solutions without dilatancy: what was found, and what it says of others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.solution import Member, Search
from cvxlimit.solution.bracket import Bracket, rounded, rounded_down, rounded_up

AGREE = 1e-3
"""Relative difference of load factors up to which searches agree."""


def remarks(
    members: Sequence[Member], bracket: Bracket, searches: Sequence[Search], smallest: float,
    near: float,
) -> list[str]:  # fmt: skip
    """Returns sentences on the ``members``, the lowest first, and the ``bracket`` of all there are;
    ``smallest`` is the least residual of any descent, and a member ``near`` the lower bound is the
    lowest."""
    said = list[str]()
    if members:
        lowest, highest = members[0].load_factor, members[-1].load_factor
        number = f"{len(members)} solutions" if len(members) > 1 else "one solution"
        worst = f"each to {max(m.residual for m in members):.0e} of its load factor"
        span = f"{rounded(lowest)} to {rounded(highest)}"
        said.append(f"{number} without dilatancy found, {span}, {worst}")
        is_lowest = lowest <= bracket.lower + near
        said.append("no solution is lower" if is_lowest else agreement(searches))
        said.append(about_zero(lowest, highest))
    else:
        least = f"the smallest loss was {smallest:.1e} of the load factor"
        said.append(
            "no solution without dilatancy was found, which does not say that there is none; "
            f"{least if np.isfinite(smallest) else 'no pair of problems was solved'}: "
            "search on with --searches, --seed or --budget"
        )
    named_ends = (
        (bracket.lower, f"none is below {rounded_down(bracket.lower)}, by least thrusts"),
        (bracket.upper, f"none above {rounded_up(bracket.upper)}, by associated friction"),
    )
    ends = " and ".join(words for end, words in named_ends if np.isfinite(end))
    if ends:
        said.append(f"the bracket is one of all solutions without dilatancy: {ends}")
    return [*filter(None, said)]


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
