"""The numbers behind a certified bracket, measured in docs/evidence/closing.md.

Only speed and width depend on them: bounds are checked outside of all problems. Unless a comment
says otherwise, forces and *excess* (by how much forces exceed a yield condition) are shares of the
total load, and distances are fractions of the half extents of contacts. The *gap* is the upper
bound less the lower one.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ProofSettings:
    """When the checker accepts forces as a lower bound, and how forces that it refuses are mended.

    Forces are mended by mixing them with a *safe* state: forces that carry the dead load strictly
    inside Eq. 9 and 30.
    """

    # Largest residual of equilibrium and largest excess of Eq. 9 and 30 of accepted forces. A
    # contact with less compression than this has no pressure centre.
    accepted: float = 1e-7
    # Share of the load factor that the excess may be worth; beyond it forces are refused as well.
    most_lost: float = 0.1
    # Shares of the safe state that are tried, smallest first. Where forces are close to admissible
    # only those up to the usual width of a bracket are.
    shares: tuple[float, ...] = (1e-9, 1e-8, 1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 1e-3)
    # Contacts of mixtures that are checked in one call.
    rows: int = 4000
    # Shares of friction, and of the size of contacts, that a safe state may use. With little shear
    # and central pressure a mixture never leads outside, although Eq. 30 is not convex.
    reserves: tuple[tuple[float, float], ...] = ((0.1, 0.3), (0.2, 0.5), (0.5, 0.7), (1.0, 1.0))
    # Margin, a share of friction and size, that the first attempt of a proof with held pressure
    # centres keeps.
    margin: float = 1e-6
    # Factor of that margin after each attempt, and of the price of slack after each penalty step.
    growth: float = 3.0
    # Attempts whose margin grows at all contacts, then those whose margin grows only where Eq. 30
    # was exceeded, then safe steps with a margin at all contacts.
    attempts: tuple[int, int, int] = (5, 12, 4)
    # Time that all proofs together may take when a run's time is over, as a share of that time.
    late: float = 0.05
    # Share of the bracket's width that a proof may cost.
    most_of_width: float = 0.1


@dataclass(frozen=True)
class ClimbSettings:
    """How a search climbs to a lower bound.

    It takes *steps*, convex problems built at forces, or holds pressure centres in *boxes* that
    follow those of a relaxation and shrink.
    """

    # Steps. Penalty steps may exceed Eq. 30 by a *slack* at a price.
    penalty_steps: int = 4  # At most so many in a row.
    # First price of slack over the fastest twist of the mechanism, which is what slack is worth.
    price: float = 0.7
    # Share of a safe step's curvature that successive long steps have.
    long: tuple[float, ...] = (0.1, 0.1, 0.1, 0.3)
    # Share by which the relaxation's pressure centres are moved towards the middle of contacts
    # before steps begin there: relaxations press on the rims.
    inward: float = 0.05
    # The same share after each failure of a safe step.
    retreats: tuple[float, ...] = (0.005, 0.02, 0.05, 0.2, 1.0)
    # Prices of slack, scaled, of successive steps to forces that carry a load alone; None is a safe
    # step. At the last price little slack is left.
    prices: tuple[float | None, ...] = (None, 1.0, 10.0, 100.0, 1000.0, 1000.0, 1000.0, None)

    # Boxes.
    first: float = 0.8  # Half width at first.
    exploring: int = 8  # Rounds at first, in which boxes may grow.
    settling: int = 12  # Rounds after them, in which boxes only shrink.
    # Both numbers of rounds with Eq. 27, where safe steps gain more per second than boxes.
    limited: tuple[int, int] = (4, 4)
    others: tuple[int, int] = (6, 18)  # Both where some contacts are not rectangles.
    shrink: float = 0.8  # Factor of boxes whose forces exceed Eq. 30, while exploring.
    growth: float = 1.5  # Factor of boxes whose forces do not, while exploring.
    settle: float = 0.6  # Factor of all boxes, while settling.
    # Excess, summed over contacts, below which frozen problems (pressure centres held) are tried.
    nearly: float = 3e-2
    settled: float = 1e-2  # The same below which boxes end and safe steps follow, ...
    frozen: float = 5e-3  # ... or frozen problems, where some contacts are not rectangles.


@dataclass(frozen=True)
class BranchSettings:
    """What branch and bound does at a node, and how it searches.

    A node allows each contact a *range* of pressure centres along each side; its relaxation is over
    the hull of *disjuncts*, states pressed at one place (:mod:`.relaxation.hull`).
    """

    # The bound of a node.
    rounds: int = 2  # Solves of a node, each with the disjuncts that the one before missed.
    # Error of powers (forces times rates) in the bound, and tolerance of its solver, over the
    # relative tolerance: at 1e-2 splits followed noise.
    precision: float = 1e-4
    # Share of a range by which it is widened for its bound, where the bound did not close the node.
    widened: float = 0.03
    # Price at which any share of the dead load may be taken off, over the root's bound. It gives
    # every relaxation a solution, and so closes nodes without states.
    price: float = 10.0
    # A node is closed if its bound is above the lower bound by this share of the tolerance or less.
    closed: float = 0.9

    # Which range is split, and where.
    narrowest: float = 1e-7  # Ranges below it are not split: solvers could not tell halves apart.
    at_rest: float = 0.06  # Speed of contacts at rest in scores of splits, over the largest speed.
    # Splits that the average gain of all contacts counts for beside those of a contact itself.
    prior: float = 5.0
    # A range is cut beside the pressure centre, by this share of it.
    beside_centre: float = 0.1

    # Tightening: ranges of the root are cut before the first split.
    tightening: float = 0.25  # Share of the time that it may take.
    # Least share that a solve must cut off a range, and a round off the gap, to go on.
    cut: float = 0.1
    # Share of a range that is left beyond what a solver says pressure centres reach.
    beyond: float = 1e-3
    attempts: int = 3  # Solves for each end of a range.

    # The search.
    at_a_time: int = 200  # Contacts of the nodes that are explored together; at least one node.
    kept: int = 5000  # Blocks of columns of problems that are kept, of 0.01 MB each.
    # Open nodes that keep a point from which their children's solver may start, of 0.1 MB each.
    remembered: int = 1000

    # Lower bounds.
    climbing: float = 0.14  # Share of all problems that climbs from open nodes may take, ...
    patience: float = 10.0  # ... and half of it after so many climbs in vain.
    # Where climbs start, as a share of the way from the best forces to a node's, and the half width
    # of their first boxes.
    ahead: tuple[tuple[float, float], ...] = ((1.0, 0.5), (0.5, 0.3), (0.25, 0.5))
    # Distance from a node's pressure centres within which frozen problems hold them, over the
    # widest of the node's ranges.
    safe_reach: float = 0.02
    settled: int = 8  # Frozen problems in a row at most.
    steps: int = 16  # Places checked on the way from one force state to another, ...
    halvings: int = 25  # ... and halvings of the last step, behind the last admissible place.


@dataclass(frozen=True)
class BracketSettings:
    """How the method divides its work between a relaxation, climbs and branch and bound."""

    # The relaxation of the whole run, to which disjuncts are added round by round.
    # Share of the tolerance by which a contact's new disjuncts must raise the bound, of nodes too.
    worth_a_disjunct: float = 0.1
    # Disjuncts are added at the worst place and this far beside it: in round 2 the square of this
    # distance, and so on.
    beside: float = 0.2
    most_rounds: int = 12  # Solves with added disjuncts at most.
    # When ``budget`` is spent, a first lower bound is sought before further disjuncts are added, if
    # the relaxation's load factor is below the upper bound by this share of it or less.
    near: float = 0.25

    # Widths of the bracket, relative. ``few`` contacts or fewer are held to the width ``outer``.
    good: float = 0.05  # Counts as an answer where no tolerance is asked for.
    # What is wanted where none is asked for, the cost of a proof included: branching ends at a
    # little less, and at less again by what a proof has cost so far.
    wanted: float = 0.01
    narrow: float = 0.005  # No further start of a climb is taken below it where none is asked for.
    outer: float = 1e-4  # Adding disjuncts and branching end here where none is asked for.
    few: int = 6

    # Seconds.
    budget: float = 10.0  # A run without a tolerance branches until so many, ...
    relaxations: float = 12.0  # ... or so many times the first relaxation's, if more.
    branching: float = 60.0  # Branching with a tolerance, or on few contacts.
    standing: float = 0.2  # Share of the budget for whether the dead load stands.
    # Branching ends when ``budget`` seconds, or a third of all, have gained less than 1 % of the
    # gap, but not before so many nodes, however slow the machine.
    least_nodes: int = 30


PROOF, CLIMB = ProofSettings(), ClimbSettings()
BRANCH, BRACKET = BranchSettings(), BracketSettings()
