"""Lower bounds are proved where forces slide fully, too: their pressure centres are held."""

from __future__ import annotations

import pytest

from cvxlimit import Block, Load, Scene, builtin_scene, solve
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.extensions.interaction.restriction.lower_bound import prove
from cvxlimit.masonry import random_wall
from cvxlimit.masonry.walls import SIZES
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.driver import Run
from cvxlimit.readings.moments import SIGNED
from cvxlimit.solution.bracket import Bracket
from helpers import interaction_excess


@pytest.mark.parametrize("seed", [2, 9])
def test_signed_brackets_of_irregular_walls_are_proved(seed: int) -> None:
    """Most contacts are at full slip there, where mixing in another state turns more than it
    spares: the bounds of these walls rested on an assumption."""
    assert_proved(random_wall(seed))


def test_a_narrow_bracket_gives_up_what_a_proof_costs() -> None:
    """2e-5 wide without one, which may cost a tenth of the 1 % that is asked for."""
    wall = random_wall(5032, sizes=(*SIZES, (4, 5)))
    assert_proved(wall)
    assert solve(wall, method="certified", moments="signed").bracket.is_within(1.1e-3)


@pytest.mark.parametrize("seed", [5059, 95003])
def test_a_few_contacts_need_a_larger_margin(seed: int) -> None:
    """Pressed in their corners, where solvers leave more than elsewhere: with one margin for all
    contacts no bound of these walls was proved, or none that was near."""
    assert_proved(random_wall(seed, sizes=(*SIZES, (4, 5))))


@pytest.mark.exhaustive
def test_a_search_goes_on_where_a_proof_costs_more_than_was_to_spare() -> None:
    """This one costs a twentieth of the width at which branching ends."""
    wall = random_wall(98016, sizes=(*SIZES, (4, 5)))
    found = solve(wall, method="certified", moments="signed", tolerance=0.01)
    assert found.status == "certified"
    assert found.bracket.is_proved
    assert found.bracket.is_within(0.01)


def test_what_does_not_move_need_not_open() -> None:
    """No field opens all contacts of this wall, at friction of 0.89; those of its mechanism, whose
    other blocks move as one, are opened by one."""
    assert_proved(random_wall(90043, sizes=(*SIZES, (4, 5))))


def test_a_proved_bound_beneath_an_unproved_one_comes_back() -> None:
    """Forces that no proof follows from, a ten-millionth higher than those that are proved."""
    scene = tower(2)
    run = Run(scene, moments=SIGNED)
    solution = solve(scene, method="certified", moments="signed")
    assert solution.bracket.lower_is_proved
    at, forces = solution.lower, solution.forces
    known = Answer(bracket=Bracket(upper=1.01 * at, upper_is_proved=True))
    for first, second in ((True, False), (False, True)):
        answer = known
        for is_proved in (first, second):
            value = at if is_proved else at * (1.0 + 1e-7)
            given = forces if is_proved else 0.5 * forces
            answer = answer.raised(value, is_proved, value, given)
        assert not answer.bracket.lower_is_proved
        run.best = answer
        prove(run, end=0.0)
        assert run.best.bracket.lower_is_proved
        # No lower than the proved one, and not the unproved one, which is 1e-7 higher.
        assert at * (1.0 - 1e-12) <= run.best.bracket.lower <= at * (1.0 + 1e-9)
        excess = interaction_excess(run.best.forces, scene.contacts, "signed").max()
        assert excess <= 1e-15 * scene.total_weight


@pytest.mark.exhaustive
def test_signed_bracket_of_the_tuff_wall_is_proved() -> None:
    assert_proved(builtin_scene("tuff-wall"))


def tower(blocks: int) -> Scene:
    """Unit cubes on one another, pushed and twisted."""
    parts = [Block.box(f"b{i}", (0, 0, i), (1, 1, i + 1), 20.0) for i in range(blocks)]
    load = Load(forces={f"b{blocks - 1}": (1.0, 0.3, 0.0, 0.0, 0.0, 0.6)})
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    return Scene([ground, *parts], ["ground"], load, friction=0.5)


def assert_proved(scene: Scene) -> None:
    """By the checker of the package and by one of the tests, at 1e-15 of the weight."""
    found = solve(scene, method=Certified(branching_seconds=0.0), moments="signed")
    assert found.bracket.is_proved
    assert "lower bound proved" in found.note
    assert found.forces is not None
    excess = interaction_excess(found.forces, scene.contacts, "signed").max()
    assert excess <= 1e-15 * scene.total_weight
