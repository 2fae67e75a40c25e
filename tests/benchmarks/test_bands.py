"""Bands of the fixed point, through solvers, kernels and compiled parts."""

from __future__ import annotations

import os

import pytest
from benchmarks.experiments.bands import SOLVERS, alone, measured, overlap, told

from cvxlimit.solution import Iteration
from cvxlimit.solvers.table import able

WANDERS = [("random-wall-8", "independent"), ("random-wall-2", "paper")]
"""Walls of some forty contacts on which no solver settles."""


@pytest.mark.exhaustive_cases("random-wall-8-independent")
@pytest.mark.parametrize(("name", "moments"), WANDERS)
def test_bands_overlap_through_solvers_compiled_or_not(name: str, moments: str) -> None:
    """Every solver goes a way of its own. Where none of them settles they wander over the same
    range, a tenth wide here, so that their bands meet although their last iterates do not."""
    solvers = [solver for solver in SOLVERS if solver in able()]
    found = [measured(name, moments, solver) for solver in solvers]
    if moments == "independent":
        other = "yes" if os.environ.get("CVXLIMIT_COMPILED") == "no" else "no"
        found.append(alone(name, moments, "CLARABEL", other))
    assert all(each.last == 40 and each.width > 0.05 for each in found)
    assert max(each.lowest for each in found) < min(each.highest for each in found)


def test_rows_say_what_bands_share_or_how_far_they_are_apart() -> None:
    one = Iteration(5, 0.12345, 0.1, 0.2, 40)
    other, same, far = (Iteration(None, None, *ends, 40)
                        for ends in ((0.15, 0.3), (0.2, 0.2), (0.25, 0.3)))  # fmt: skip
    assert told(one) == "0.1235 after 5; 0.1000 to 0.2000"
    assert told(other) == "0.1500 to 0.3000"
    assert overlap([one, other]) == "0.1500 to 0.2000"
    assert overlap([one, same]) == "0.2000 to 0.2000"
    assert overlap([one, far]) == "none, 20 % apart"
