"""The code check's third way: means of seven records, or what is missing. No engine is needed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cvxlimit import builtin_scene, code_check, pulse, pushover
from cvxlimit.errors import InputError
from cvxlimit.extensions.dynamics.history import Ending, TimeHistory
from cvxlimit.extensions.dynamics.shaking import Shaking
from cvxlimit.extensions.paths.path import Path

CONTROL = ("b1", (1.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def path() -> Path:
    return pushover(builtin_scene("single-block"), certify="none", control=CONTROL)


def moved(by: float, ending: Ending = "stands") -> Shaking:
    """A block that moves by so much and back, under a record of its own."""
    displacements = np.zeros((3, 1, 6))
    displacements[1, 0, 0] = by
    runs = [TimeHistory(1e-3, 4e-3, np.arange(3.0), displacements, ending, (), 0.0)] * 4
    record = pulse("sine", abs(by), 1.0)
    return Shaking(builtin_scene("single-block"), record, np.eye(3)[0], tuple(runs), CONTROL)


def test_a_mean_of_seven_beside_that_of_the_control(path: Path) -> None:
    """d_SLV of a single block is 0.4 d0, at its control too: 0.4 x 0.2 m."""
    for ways, within in ((0.01, "within 0.08"), (-0.03, "beyond 0.08")):
        motions = [moved(k * ways) for k in range(1, 8)]
        value, said = code_check(path, 1.0, motions=motions).histories or (None, "")
        assert value == pytest.approx(4 * abs(ways))
        assert within in said
        # The same record twice counts once.
        assert code_check(path, 1.0, motions=motions * 2).histories == (value, said)


def test_what_is_missing_is_said(path: Path) -> None:
    motions = [moved(0.01 * k) for k in range(1, 8)]
    undecided = replace(motions[1], histories=(moved(0.02, "falls").histories[0],
                                               *motions[1].histories[1:]))  # fmt: skip
    for given, said in (
        (motions[:5], "5 different records of 7: 2 are missing"),
        ([moved(0.01, "falls"), *motions[1:]], "it falls under 1 of 7"),
        ([undecided, motions[0], *motions[2:]], "not decided under 1 of 7"),
    ):
        check = code_check(path, 1.0, motions=given)
        assert check.histories is not None
        assert check.histories[0] is None
        assert said in check.histories[1]
        assert said in str(check)
    assert code_check(path, 1.0).histories is None


def test_another_control_is_refused(path: Path) -> None:
    with pytest.raises(InputError, match="the same one"):
        code_check(path, 1.0, motions=[replace(moved(0.01), control=None)])
    with pytest.raises(InputError, match="with control"):
        code_check(path, 1.0, motions=[replace(moved(0.01), control=("b1", (0.0, 1.0, 0.0)))])
