"""Design section 4 at its own size: 2,716 blocks, block weights as units, and success reported.

Found with CVXPY 1.9.3 and Clarabel 0.11.1, unit = block weight: "optimal", primal and dual both
0.11148 at 1e-8 where 0.112059 is right (0.5 % off); a tenth of it: 0.0965 (14 % off); the six
resultants instead of corner compressions: 0.0938 (16 % off). With the total weight as unit,
the same runs give 0.1120587. The smaller scene of this kind is in test_certificate.py.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cvxlimit import Certifier, Scene, solve
from cvxlimit.masonry import panel
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statics import Scaling
from cvxlimit.solvers import LimitState, SolverSettings

pytestmark = pytest.mark.exhaustive

CLARABEL = SolverSettings("CLARABEL", {"direct_solve_method": "qdldl", "max_iter": 200})


@cache
def scene() -> Scene:
    """A panel with two returns, 2,716 blocks."""
    return panel(2.4, 56, left_return=0.76, right_return=0.76)


@cache
def certified() -> tuple[float, float]:
    solution = solve(scene())
    assert solution.lower <= solution.upper
    assert solution.gap <= 1e-5, solution
    return solution.lower, solution.upper


def state(share: float) -> LimitState:
    """Force and live load in units of ``share`` block weights."""
    usual = Scaling.of(scene())
    unit = share / len(scene().free)
    scaling = replace(usual, force=usual.force * unit, live=usual.live * unit)
    return LimitProgram(Assemblage.of(scene(), scaling)).run(CLARABEL)


@pytest.mark.parametrize(("share", "least_error"), [(1.0, 1e-3), (0.1, 0.05)])
def test_sure_of_itself_wrong_and_caught(share: float, least_error: float) -> None:
    lower, upper = certified()
    wrong = state(share)
    assert wrong.outcome.status == "optimal"
    dual = -(wrong.mechanism * scene().dead_forces).sum()
    assert wrong.load_factor == pytest.approx(dual, rel=1e-5)  # five digits and more agree
    assert wrong.load_factor < lower * (1.0 - least_error)
    surfaces = LimitProgram(scene()).surfaces
    c = Certifier(scene(), surfaces).certificate(wrong.forces, wrong.load_factor, wrong.mechanism)
    assert c.width > 0.1
    assert c.lower <= upper
    assert c.upper >= lower


def test_smaller_still() -> None:
    """A thousandth of a block's weight: "optimal" at a factor below zero."""
    lower, upper = certified()
    wrong = state(1e-3)
    c = Certifier(scene(), LimitProgram(scene()).surfaces).certificate(
        wrong.forces, wrong.load_factor, wrong.mechanism
    )
    assert abs(wrong.load_factor) < 0.5 * lower
    assert c.lower <= upper
    assert c.upper >= lower
    assert np.isinf(c.width) or c.width > 0.5
