"""What comes out: load factor and bracket, forces and mechanism, what joints do in it."""

from cvxlimit.solution.bracket import Bracket, Evidence
from cvxlimit.solution.from_rest import FromRest, Step, Trial
from cvxlimit.solution.records import Iterate, Iteration, LowerEnd, Member, Search, Status
from cvxlimit.solution.solution import LOAD_FACTOR, Solution

__all__ = [
    "LOAD_FACTOR",
    "Bracket",
    "Evidence",
    "FromRest",
    "Iterate",
    "Iteration",
    "LowerEnd",
    "Member",
    "Search",
    "Solution",
    "Status",
    "Step",
    "Trial",
]
