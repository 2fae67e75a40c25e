"""What is to say of solutions without dilatancy: what was found, and what it says of others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.solution import Member, Search
from cvxlimit.solution.bracket import Bracket, rounded, rounded_down, rounded_up
from cvxlimit.solution.records import ended_apart


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
        span = f"{rounded(lowest)} to {rounded(highest)}"
        said.append(f"{number} without dilatancy found, {span}, {exactness(members)}")
        is_lowest = lowest <= bracket.lower + near
        said.append("no solution is lower" if is_lowest else found_by(searches))
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


def exactness(members: Sequence[Member]) -> str:
    """Returns what members lack: power, and by how much friction misses the slip."""
    worst = max(member.residual for member in members)
    lost = f"{'each lacks' if len(members) > 1 else 'which lacks'} {worst:.0e} of its power at most"
    angle = max(member.angle or 0.0 for member in members)
    if not angle:
        return lost
    if all(member.is_settled for member in members):
        return f"{lost}, and friction off the slip {angle:.0e} of the load factor"
    return f"{lost}; friction is off the slip: about {angle:.0e} of the load factor is not known"


def found_by(searches: Sequence[Search]) -> str:
    """Returns where searches ended, and how late the lowest gained last. None says that there is
    nothing lower, and that they end alike says it neither."""
    found = sorted(s.load_factor for s in searches if s.load_factor is not None)
    if not found:
        return ""
    lowest = min(searches, key=lambda s: np.inf if s.load_factor is None else s.load_factor)
    several = f"{len(searches)} searches" if len(searches) > 1 else "one search"
    ends = list(dict.fromkeys(rounded(factor, 4) for factor in found))
    ends += ["none"] if len(found) < len(searches) else []
    said = f"lowest of {several}, ended at {', '.join(ends)}"
    if ended_apart(searches) or len(searches) == 1:
        return (
            f"{said}; the last gain came after {lowest.last_gain} of {lowest.solves} solves: "
            "search on with more (--searches) or longer ones (--budget)"
        )
    return f"{said}; whether there are lower ones is not known"


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
