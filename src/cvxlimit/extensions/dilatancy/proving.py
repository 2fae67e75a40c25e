"""Solutions without dilatancy, and what least thrusts exclude, proved again: what the method adds
at ``cvxlimit.checks``.

The lowest solution is one if equilibrium, yield, flow rule and complementarity leave no more than
is claimed; the bracket of all of them is that of associated friction above and of least thrusts
below, both solved anew, since a file holds the proof of neither.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.least_thrust import lower_bound
from cvxlimit.extensions.dilatancy.members import Verifier
from cvxlimit.methods.convex_search import ConvexSearch
from cvxlimit.methods.driver import Run
from cvxlimit.proof.checks import SLACK, Check, proved
from cvxlimit.proving.solutions import ProvedAgain
from cvxlimit.solution.bracket import rounded_down, rounded_up


def checks(again: ProvedAgain) -> Iterator[Check]:
    """Every claim of solutions without dilatancy."""
    solution = again.solution
    if not solution.members:
        yield Check("load factor", False, f"flow {solution.flow!r} gives no bounds, and there "
                    "is no solution whose conditions could be checked")  # fmt: skip
        return
    first, *others = solution.members
    claim = f"a solution without dilatancy at {rounded_down(first.load_factor)}"
    factor = solution.load_factor
    if again.forces is None or factor is None or abs(factor - first.load_factor) > again.near:
        yield Check(claim, False, "it is not that of the forces")
    else:
        state = again.state_of(factor, solution.internal)
        try:
            found = Verifier(again.run).member(state, first.start, first.iterations)
        except ModelError:  # internal forces that belong to nothing
            found = None
        worst = np.inf if found is None else found.residual
        said = f"largest residual {worst:.1e}"
        but = f"{said}, {first.residual:.1e} claimed"
        yield proved(claim, worst <= first.residual + SLACK, but, said)
        yield from again.held_checks()
    yield from _ends_of_all(again)
    if others:
        yield Check(f"{len(others)} further solutions without dilatancy", False, "the file "
                    "holds the forces of the lowest only")  # fmt: skip


def _ends_of_all(again: ProvedAgain) -> Iterator[Check]:
    """The bracket of all solutions without dilatancy, found anew: the file holds neither the
    mechanism of associated friction nor least thrusts."""
    held, aside = again.solution.bracket, again.run.auxiliary_run()
    if np.isfinite(held.upper):
        for _ in ConvexSearch(aside, again.run.model).steps():
            pass
        upper = aside.best.bracket.upper
        is_met = upper <= held.upper + max(again.near, SLACK * abs(held.upper))
        said = f"associated friction, solved anew, shows {rounded_up(upper, 9)}"
        yield Check(f"upper bound {rounded_up(held.upper, 9)}", is_met, said)
    yield from above_thrusts(again, aside)


def above_thrusts(again: ProvedAgain, aside: Run) -> Iterator[Check]:
    """A lower bound without dilatancy, if there is one."""
    held = again.solution.bracket
    if np.isfinite(held.lower):
        lower = lower_bound(aside, held.lower).load_factor
        is_met = lower >= held.lower - max(again.near, SLACK * abs(held.lower))
        said = f"least thrusts, found anew, show {rounded_down(lower, 9)}"
        yield Check(f"lower bound {rounded_down(held.lower, 9)}", is_met, said)
