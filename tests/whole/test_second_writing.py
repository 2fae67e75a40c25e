"""Brackets of random scenes against a second writing of everything from the outlines on.

Any outline and any contact, whole and cut, turned and shifted: contacts, load factors, and words
that none exists. With interaction: forces behind lower bounds are checked, and a search for states
that carry more must not pass the upper bounds.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest

from cvxlimit import Status, solve
from cvxlimit.errors import ModelError
from helpers import TOLERANCE
from second_interaction import READINGS, Interaction
from second_writing import JOINT, answer, joints, pile

KINDS = {
    "unstable": (Status.DEAD_LOAD_UNSTABLE,),
    "harmless": (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED),
}

SECOND = 1e-6
"""What Clarabel's answers at its own tolerances of 1e-8 are worth, relative to 1 or the factor."""

ZERO = 1e-11
"""Width of a bracket that is rounding, beside load factors of about 1."""

EXCESS = 2e-7
"""Of checked forces over the total load: lower bounds are told for forces that hold to 1e-7."""


def check(seed: int) -> None:
    """Contacts, and the answer or that there is none."""
    given = pile(seed)
    scene = given.scene()
    contacts = {frozenset((c.a, c.b)): [] for c in scene.contacts}
    for c in scene.contacts:
        contacts[frozenset((c.a, c.b))].append((c.area, c.origin))
    for joint in joints(given.prisms):
        origin = given.turn.apply(joint.base + joint.centre @ joint.axes[:2]) + given.shift
        twins = contacts[frozenset((f"b{joint.a}", f"b{joint.b}"))]
        assert any(
            np.isclose(area, joint.region.area, rtol=1e-6) and np.allclose(at, origin, atol=JOINT)
            for area, at in twins
        ), (joint, twins)
    assert sum(map(len, contacts.values())) == len(joints(given.prisms))
    expected, solution = answer(given), solve(scene)
    if expected.kind == "interval":
        assert solution.lower_end is not None, solution.note
        end, size = solution.lower_end.bracket, SECOND * max(1.0, abs(expected.least))
        assert end.lower - size <= expected.least <= end.upper + size
        if expected.load_factor == np.inf:
            return
    elif expected.kind != "factor":
        assert solution.status in KINDS[expected.kind]
        return
    assert solution.status is Status.CERTIFIED, solution.note
    size = SECOND * max(1.0, abs(solution.upper))
    assert solution.lower - size <= expected.load_factor <= solution.upper + size
    assert solution.upper - solution.lower <= TOLERANCE * abs(solution.upper) + ZERO


@pytest.mark.exhaustive_cases(*map(str, range(5010, 5030)))
@pytest.mark.parametrize("seed", [749, 30891, *range(5000, 5030)])
def test_any_outline(seed: int) -> None:
    """749: a brick on a notched block whose hull lost a corner, [0.28871, 0.28871] for 0.37064."""
    check(seed)


@pytest.mark.exhaustive
@pytest.mark.parametrize("first", range(10000, 12000, 50))
def test_two_thousand_scenes_of_any_outline(first: int) -> None:
    for seed in range(first, first + 50):
        check(seed)


def check_interaction(seed: int, reading: str) -> None:
    """Lower and upper bound, whatever their distance. Intervals are refused."""
    scene = pile(seed, convex=True).scene()
    if solve(scene).interval is not None:
        with pytest.raises(ModelError, match="needs a dead load that stands alone"):
            solve(scene, method="certified", moments=reading)
        return
    solution = solve(scene, method="certified", moments=reading)
    second = Interaction(scene, reading)
    if solution.status is Status.DEAD_LOAD_UNSTABLE:
        middle = np.zeros((len(scene.contacts), 2))
        assert second.search(middle, 25, seed, is_dead_load=True) < 1.0 - SECOND
    if not solution.status.has_answer or solution.forces is None:
        return
    assert solution.load_factor is not None
    assert second.excess(solution.forces, solution.load_factor) <= EXCESS
    normal = np.maximum(solution.forces[:, 2:3], 1e-300)
    centres = np.where(
        solution.forces[:, 2:3] > 0.0, solution.forces[:, [4, 3]] * [-1.0, 1.0] / normal, 0.0
    )
    found = second.search(centres, 25, seed)
    assert solution.upper is not None
    assert found <= solution.upper + SECOND * max(1.0, abs(solution.upper))


@pytest.mark.exhaustive_cases(
    "2-independent", "11-independent", "40137-independent", "40137-signed"
)
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("seed", [1, 2, 11, 40137])
def test_interaction(seed: int, reading: str) -> None:
    check_interaction(seed, reading)


@pytest.mark.exhaustive
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("first", range(20000, 20050, 10))
def test_a_hundred_brackets_with_interaction(first: int, reading: str) -> None:
    for seed in range(first, first + 10):
        check_interaction(seed, reading)


if __name__ == "__main__":
    for number in range(*map(int, sys.argv[1:3])):
        for name in READINGS:
            check_interaction(number, name)
        sys.stdout.write(f"{number} ")
        sys.stdout.flush()
