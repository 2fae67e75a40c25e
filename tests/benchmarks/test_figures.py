"""The experiment that tries other values of chosen figures: one that matters moves brackets."""

from __future__ import annotations

import pytest
from benchmarks.experiments import figures


@pytest.mark.exhaustive
@pytest.mark.skipif(not hasattr(figures.os, "fork"), reason="scenes are solved in forks")
def test_another_friction_moves_what_slides_then() -> None:
    """A block of 0.4 by 1 tips at 0.4 with friction of 0.7, and slides with 0.1."""
    (friction,) = (f for f in figures.chosen() if f.name == "DEFAULT_FRICTION")
    base = {"single-block": (0.4, 0.4, 1.0)}
    found = figures.trial("plain", {*base}, (friction, 0.1), 1)
    assert found["single-block"][:2] == pytest.approx((0.1, 0.1), rel=1e-5)
    assert {*figures.moved(base, found)} == {*base}
