"""Friction without dilatancy: published ranges, and solutions checked by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from cvxlimit import Block, Load, Scene, Solution, Status, builtin_scene, solve
from cvxlimit.cli.main import run
from cvxlimit.errors import ModelError
from cvxlimit.io import read_result
from cvxlimit.masonry import single_block
from cvxlimit.methods.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.model.formulations import vertex_forces
from helpers import renumbered, rotations
from members import assert_member

FloatArray = NDArray[np.float64]

PUBLISHED = {
    "ferris-tin-loi-1": (0.638982, 0.642859),
    "ferris-tin-loi-2": (0.557416, 0.579606),
    "ferris-tin-loi-3": (0.355817, 0.388684),
}
"""Lowest and highest exact solutions found by linear programs on complementarity pieces, by an
independent prototype in the plane. The true set may be wider."""

ASSOCIATED = {"ferris-tin-loi-1": 0.642859, "ferris-tin-loi-2": 0.579999,
              "ferris-tin-loi-3": 0.403694}  # fmt: skip


@cache
def solved(name: str, starts: int = 2) -> Solution:
    return solve(builtin_scene(name), method=ZeroDilatancy(starts=starts))


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", PUBLISHED)
class TestWalls:
    def test_within_what_is_known(self, name: str) -> None:
        """All starts converge; nothing is above the associated factor, nothing below what an
        exhaustive search found, and that lowest one is found again."""
        solution = solved(name)
        lowest, _ = PUBLISHED[name]
        assert solution.status is Status.CONVERGED
        assert "2 of 2 starts" in solution.note
        factors = [member.load_factor for member in solution.members]
        assert factors == sorted(factors)
        assert factors[-1] <= ASSOCIATED[name] * (1 + 1e-5)
        assert factors[0] >= lowest * (1 - 1e-5)
        assert factors[-1] > lowest * (1 + 1e-3)
        assert solution.load_factor == factors[0]
        assert max(member.residual for member in solution.members) <= 1e-6
        assert factors[0] == pytest.approx(lowest, rel=1e-5)  # found on purpose, from two starts

    def test_extremes_by_hand(self, name: str) -> None:
        for member in (solved(name).members[0], solved(name).members[-1]):
            assert_member(builtin_scene(name), member.forces, member.mechanism, member.load_factor)

    def test_bracket_of_all(self, name: str) -> None:
        """The associated factor, proved, above all of them."""
        solution = solved(name)
        assert solution.flow == "zero-dilatancy"
        assert solution.bracket.upper_is_proved
        assert solution.upper == pytest.approx(ASSOCIATED[name], rel=1e-5)
        assert solution.members[-1].load_factor <= solution.upper * (1 + 1e-6)


class TestSpace:
    @pytest.mark.exhaustive
    def test_tuff_wall_in_space(self) -> None:
        """From the start at the associated solution, to rounding; checked by hand."""
        scene = builtin_scene("tuff-wall")
        rule = ZeroDilatancy(starts=1, descents=0, tolerance=1e-9)
        solution = solve(scene, method=rule)
        assert solution.status is Status.CONVERGED
        assert 0.3 < solution.load_factor < 0.423056  # below the associated factor
        best = solution.members[0]
        assert best.residual <= 1e-9
        assert_member(scene, best.forces, best.mechanism, best.load_factor)

    @pytest.mark.exhaustive
    def test_parabolic(self) -> None:
        scene = builtin_scene("ferris-tin-loi-1")
        rule = ZeroDilatancy(starts=1)
        solution = solve(scene, surface="parabolic", method=rule)
        assert solution.status is Status.CONVERGED
        assert solution.load_factor <= ASSOCIATED[scene.name] * (1 + 1e-6)


@pytest.mark.exhaustive
@given(rotations())
@settings(max_examples=1)
def test_rotation(turn: FloatArray) -> None:
    """The first start is the same problem in any frame: so is the member that it leads to. Walks
    down from there are random."""
    scene, rule = builtin_scene("ferris-tin-loi-1"), ZeroDilatancy(starts=1, descents=0)
    one, two = (solve(s, method=rule).load_factor for s in (scene, scene.moved(turn)))
    assert one == pytest.approx(two, rel=1e-5)


class TestSmall:
    def test_a_load_straight_down_gives_no_number(self) -> None:
        """It does no harm with associated friction, and what the iteration ends at is no answer."""
        block = single_block()
        pressed = Scene(block.blocks, block.supports, Load(acceleration=(0, 0, -1)), friction=0.4)
        found = solve(pressed, method="zero-dilatancy")
        assert (found.status, found.load_factor) == (Status.NOT_CONVERGED, None)
        assert np.isinf(found.upper)
        assert found.bracket.lower_is_proved or np.isinf(found.lower)  # there is no solution

    def test_wall_one_attains_the_published_range(self) -> None:
        factors = [m.load_factor for m in solved("ferris-tin-loi-1").members]
        assert (factors[0], factors[-1]) == pytest.approx(PUBLISHED["ferris-tin-loi-1"], rel=1e-5)

    def test_a_sliding_and_a_tipping_block_are_unique(self) -> None:
        for height, expected in ((0.5, 0.6), (2.0, 0.5)):
            solution = solve(
                single_block((1.0, 1.0, height), friction=0.6), method="zero-dilatancy"
            )
            spread = [member.load_factor for member in solution.members]
            np.testing.assert_allclose(spread, expected, rtol=1e-5)
            first = solution.members[0]
            assert all(type(x) is float for x in vars(first).values() if np.ndim(x) == 0
                       and not isinstance(x, (str, int)))  # as people read them  # fmt: skip

    def test_wedged_block_slides_at_less_than_the_associated_factor(self) -> None:
        """A block under a fixed lintel that just touches: to slide it must dilate, and cannot, if
        friction is associated. Without dilatancy any clamping force will do, none among them, and
        then it slides at 0.4."""
        ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
        lintel = Block.box("lintel", (-1, -1, 1), (2, 2, 2))
        block = Block.box("block", (0, 0, 0), (1, 1, 1), density=1.0)
        scene = Scene([ground, lintel, block], ["ground", "lintel"], Load(acceleration=(1, 0, 0)),
                      friction=0.4)  # fmt: skip
        assert solve(scene).status is Status.UNBOUNDED
        solution = solve(scene, method=ZeroDilatancy(starts=6))
        assert solution.status is Status.CONVERGED
        assert solution.load_factor == pytest.approx(0.4, rel=1e-5)

    def test_units_and_numbering(self) -> None:
        """The first start is the same problem in any units and order: so is the lowest member on
        its mechanism, as far as that is unique."""
        scene = single_block((1.0, 1.0, 0.5), friction=0.6)
        for other in (scene.in_units(scene.units, 1e3, 1e3), renumbered(scene, 1)):
            found = solve(other, method="zero-dilatancy")
            assert found.load_factor == pytest.approx(0.6, rel=1e-5)

    def test_given_up(self) -> None:
        rule = ZeroDilatancy(starts=1, max_iterations=2)
        solution = solve(builtin_scene("ferris-tin-loi-3"), method=rule)
        assert solution.status is Status.NOT_CONVERGED
        assert "no zero-dilatancy solution was found from 0 of 1 starts" in solution.note
        assert not solution.members

    def test_command_line_and_file(self, tmp_path: Path) -> None:
        out = tmp_path / "out.json"
        arguments = ["solve", "single-block", "--method", "zero-dilatancy", "--json", str(out)]
        assert run(arguments) == 0
        document = json.loads(out.read_text())
        assert document["flow"] == "zero-dilatancy"
        assert document["upper"] == pytest.approx(document["members"][-1]["load_factor"], rel=1e-5)
        again = read_result(out)
        assert len(again.members) == len(document["members"]) > 1
        assert run(["solve", "stack", "--method", "none"]) == 2

    def test_refusals(self) -> None:
        scene = builtin_scene("single-block")
        with pytest.raises(ModelError, match="brings its own formulation"):
            solve(scene, method="zero-dilatancy", formulation=vertex_forces)
        with pytest.raises(ModelError, match="damping must be above 0"):
            replace(ZeroDilatancy(), damping=0.0)
