"""The numbers behind a certified bracket, measured in docs/evidence/interaction-speed.md.

Only speed and width depend on them: bounds are checked outside of all problems. Forces and excess
are shares of the total load, places fractions of the half extents of contacts.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ProofSettings:
    """When forces count, and how they are proved."""

    # residual and excess of Eq. 9 and 30 beyond which forces are refused, and compression up to
    # which a pressure centre means nothing
    accepted: float = 1e-7
    most_lost: float = 0.1  # share of the load factor that excess may be worth: else refused, too
    # shares of a dead-load state mixed in to be strictly admissible, up to the usual width of a
    # bracket where forces are close
    shares: tuple[float, ...] = (1e-9, 1e-8, 1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 1e-3)
    rows: int = 4000  # contacts of mixtures that are tried at a time
    # shares of friction and size that such states may use: with little shear and central pressure
    # what is mixed in never leads outside, although Eq. 30 is not convex
    reserves: tuple[tuple[float, float], ...] = ((0.1, 0.3), (0.2, 0.5), (0.5, 0.7), (1.0, 1.0))
    margin: float = 1e-6  # of friction and size to begin with, where centres are held,
    growth: float = (
        3.0  # and its growth after each attempt, as of prices of slack. So many attempts:
    )
    attempts: tuple[int, int, int] = (5, 12, 4)  # for all contacts, where it did not do, safe steps
    late: float = 0.05  # share of a run's time that proofs take together once that is over
    most_of_width: float = 0.1  # share of the bracket's width that a proof may cost


@dataclass(frozen=True)
class ClimbSettings:
    """Steps to a lower bound; boxes of pressure centres that follow a relaxation to one."""

    penalty_steps: int = 4  # at most
    price: float = 0.7  # of slack at first, over the fastest twist, which is what slack is worth
    long: tuple[float, ...] = (0.1, 0.1, 0.1, 0.3)  # curvature of long steps
    inward: float = 0.05  # share towards the middle: relaxations press on the rims of contacts
    retreats: tuple[float, ...] = (0.005, 0.02, 0.05, 0.2, 1.0)  # the same after a failure
    hope: float = 2.0  # times the predicted gain must reach the best bound, else it is given up
    # prices of slack, scaled, where forces are sought that carry a load alone, the last one until
    # little of it is left; None: a safe step
    prices: tuple[float | None, ...] = (None, 1.0, 10.0, 100.0, 1000.0, 1000.0, 1000.0, None)
    first: float = 0.8  # half width of boxes about given pressure centres
    exploring: int = 8  # boxes that may grow
    settling: int = 12  # boxes that only shrink
    limited: tuple[int, int] = (4, 4)  # both with Eq. 27, where safe steps gain more per second
    others: tuple[int, int] = (6, 18)  # and on contacts that are not rectangles
    shrink: float = 0.8  # factor where forces exceed Eq. 30, while exploring
    growth: float = 1.5  # factor where they do not
    settle: float = 0.6  # factor of all others
    nearly: float = 3e-2  # excess of all contacts from which frozen problems follow
    settled: float = 1e-2  # the same from which steps follow
    frozen: float = 5e-3  # and on contacts that are not rectangles frozen problems,
    retry: float = 0.5  # share of it at which safe problems are tried again
    noise: float = 2e-5  # largest excess that may be due to loose solves alone


@dataclass(frozen=True)
class BranchSettings:
    """What is done at a node of branch and bound, and the search as a whole."""

    narrowest: float = 1e-7  # ranges whose halves solvers could not tell apart
    worth_a_disjunct: float = 0.05  # share of the tolerance that a solve with more must promise
    rounds: int = 2  # solves per node, with disjuncts added
    precision: float = 1e-4  # of powers in its bounds, over the relative tolerance
    at_rest: float = 0.06  # share of the largest speed that contacts at rest have in splits,
    at_rest_tightened: float = 1e-3  # and in the order of tightening
    prior: float = 5.0  # splits that what all contacts have in common counts for
    beside_centre: float = 0.1  # share of a range that it is cut beside the pressure centre
    widened: float = 0.03  # share of it that ranges are widened by where bounds are not closed
    cut: float = 0.1  # least share that tightening must cut off a range, and a round off the gap
    beyond: float = 1e-3  # share it leaves beyond what a solver says is reached
    carried: float = 0.99  # share of the gap carried by contacts whose ranges it tries
    attempts: int = 3  # its solves per end of a range
    tightening: float = 0.25  # share of the time that it may take
    closed: float = 0.9  # share of the gap asked for at which nodes are closed
    at_a_time: int = 200  # contacts of the nodes that are explored together, one node at least
    kept: int = 5000  # pieces of problems: 0.01 MB each
    remembered: int = 1000  # open nodes with points for their parts to start from: 0.1 MB each
    price: float = 10.0  # of the dead load over root bounds: closes nodes without states
    climbing: float = 0.14  # share of problems that search for forces from open nodes,
    # each so far on the way there from the best, in boxes of such half widths at first,
    ahead: tuple[tuple[float, float], ...] = ((1.0, 0.5), (0.5, 0.3), (0.25, 0.5))
    patience: float = 10.0  # and half of it after so many in vain
    safe_reach: float = 0.02  # reach of safe states in a node's widest range
    settled: int = 8  # frozen problems in a row at most,
    steps: int = 16  # places tried on the way between two force states,
    halvings: int = 25  # after the last good one
    told: float = 0.98  # the history has a line when the gap is this share of the last one told


@dataclass(frozen=True)
class BracketSettings:
    """The relaxation of a whole run with disjuncts added to it, and the method as a whole."""

    noise: float = 1e-10  # missing opening over the mechanism's largest rate that solvers leave
    worth_a_disjunct: float = 0.1  # share of the tolerance that a contact must raise the bound by
    beside: float = 0.2  # disjuncts this far beside the worst place too, its square in round 2 ...
    most_rounds: int = 12  # solves with added disjuncts,
    near: float = 0.25  # of the upper bound to the relaxation from which a lower one may come first
    least_problems: float = 2.0  # that there must be time for, or no branching begins
    good: float = 0.05  # width that counts as an answer where no tolerance is asked for
    outer: float = 1e-4  # width at which disjuncts and branching end where none is asked for
    narrow: float = 0.005  # width below which no further start is taken unasked
    wanted: float = 0.01  # width that is wanted where none is asked for, its proof included,
    aim: float = 0.00999  # the one at which branching ends, or sooner by what a proof has cost
    dearer: float = 1.5  # times so much, for the next one may cost more,
    few: int = 6  # on more contacts than these; up to as many both are ``outer``
    budget: float = 10.0  # seconds in all until when it goes on, where none is asked for,
    relaxations: float = 12.0  # or so many times those of the first relaxation
    standing: float = 0.2  # share of it that may go into whether the dead load stands
    branching: float = 60.0  # seconds of branching with a tolerance, or on few contacts,
    least_nodes: int = 30  # until ``budget`` seconds, or a third of all, gain less than 1 % of the
    # gap, but not before so many nodes, however slow the machine


PROOF, CLIMB = ProofSettings(), ClimbSettings()
BRANCH, BRACKET = BranchSettings(), BracketSettings()
