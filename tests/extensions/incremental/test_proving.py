"""What of a load factor reached from rest can be proved again, and what is not looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cvxlimit import Solution, builtin_scene, prove, solve
from cvxlimit.extensions.incremental.incremental import Incremental


@pytest.fixture(scope="module")
def reached() -> Solution:
    return solve(builtin_scene("ferris-tin-loi-3"), method=Incremental(spread=False))


def test_its_forces_carry_the_load_factor(reached: Solution) -> None:
    proof = prove(reached)
    assert proof.is_proved
    assert "from_rest" in str(proof).split("not looked at")[1]


def test_another_load_factor_and_other_forces_are_not_proved(reached: Solution) -> None:
    assert reached.load_factor is not None
    assert reached.forces is not None
    for times in (0.99, 1.01, -1.0):
        assert not prove(replace(reached, load_factor=times * reached.load_factor)).is_proved
    heavy = np.array(reached.forces)
    heavy[:, 0] *= 2.0  # shear
    assert not prove(replace(reached, forces=heavy)).is_proved
