"""Ties, against hand calculation."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from cvxlimit import Block, LimitProblem, Load, Reaction, Scene, Status, Tie, builtin_scene, solve
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io import read_scene, write_scene
from cvxlimit.model.formulations import resultants
from cvxlimit.plotting import plot
from cvxlimit.plotting.annotations import yielding
from cvxlimit.plotting.pictures.webpage import Page, page
from cvxlimit.plotting.style import Style
from helpers import rotations

FloatArray = NDArray[np.float64]


def tied_block(force: float, height: float = 2.0) -> Scene:
    """A block 1 x 1 x 2 pushed along +x, tied at its top to a wall 3 behind it."""
    ground = Block.box("ground", (-5, -1, -1), (5, 2, 0))
    wall = Block.box("wall", (-4, 0, 0), (-3, 1, height))
    block = Block.box("block", (0, 0, 0), (1, 1, height), density=10.0)
    tie = Tie("wall", "block", (-3, 0.5, height), (0, 0.5, height), force)
    live = Load(acceleration=(1.0, 0.0, 0.0))
    return Scene([ground, wall, block], ["ground", "wall"], live, friction=0.9, ties=(tie,))


def leaning_arch(force: float) -> Scene:
    """Two blocks side by side on icy ground, tied at their feet, and turned by moments alpha that
    open the joint between them below."""
    ground = Block.box("ground", (-3, -1, -1), (3, 2, 0))
    blocks = [
        Block.box("left", (-1, 0, 0), (0, 1, 1), density=10.0),
        Block.box("right", (0, 0, 0), (1, 1, 1), density=10.0),
    ]
    live = Load(forces={"left": (0, 0, 0, 0, 1, 0), "right": (0, 0, 0, 0, -1, 0)})
    tie = Tie("left", "right", (-0.5, 0.5, 0.0), (0.5, 0.5, 0.0), force)
    return Scene([ground, *blocks], ["ground"], live, friction=0.0, ties=(tie,))


class TestByHand:
    @pytest.mark.parametrize("force", [1.0, 4.0, 8.0])
    def test_tied_block_tips_about_its_toe(self, force: float) -> None:
        """alpha W h / 2 = W l / 2 + T h, unless it slides: alpha W = mu W + T."""
        scene = tied_block(force)
        solution = solve(scene)
        assert solution.status is Status.CERTIFIED
        expected = min(0.5 + 2.0 * force / 20.0, 0.9 + force / 20.0)
        assert solution.load_factor == pytest.approx(expected, rel=1e-5)
        assert solution.forces[-1, 2] == pytest.approx(-force, rel=1e-5)
        assert solution.is_proved

    @pytest.mark.parametrize("is_parameter", [False, True])
    def test_friction_of_all_joints_is_none_of_ties(self, is_parameter: bool) -> None:
        """The block slides, held by a tie that keeps its strength: alpha W = mu W + T."""
        friction = cp.Parameter(value=0.2) if is_parameter else 0.2
        solution = LimitProblem(tied_block(4.0), friction=friction).solve()
        assert solution.status is Status.CERTIFIED
        assert solution.load_factor == pytest.approx(0.2 + 4.0 / 20.0, rel=1e-5)

    def test_files_keep_ties(self, tmp_path: Path) -> None:
        scene = tied_block(4.0)
        write_scene(scene, tmp_path / "tied.json")
        assert read_scene(tmp_path / "tied.json").ties == scene.ties

    def test_a_slack_tie_does_nothing_in_compression(self) -> None:
        scene = tied_block(8.0).with_live(Load(acceleration=(-1.0, 0.0, 0.0)))
        solution = solve(scene)
        assert solution.load_factor == pytest.approx(0.5, rel=1e-5)
        assert solution.forces[-1, 2] == pytest.approx(0.0, abs=1e-6)

    @pytest.mark.parametrize("force", [0.5, 3.0])
    def test_tied_arch(self, force: float) -> None:
        """Each moment is held by the tie below with the thrust at the crown, T h, and by the weight
        with the ground's reaction at the outermost edge, W l / 2."""
        solution = solve(leaning_arch(force))
        assert solution.status is Status.CERTIFIED
        assert solution.load_factor == pytest.approx(force * 1.0 + 10.0 * 0.5, rel=1e-5)
        assert solution.is_proved


class TestConnections:
    """A tie connects: what it holds need not touch anything."""

    ROCK = Block.box("rock", (-1, -1, 5), (1, 1, 6))
    DOWN = Load(acceleration=(0, 0, -1))

    def hung(self, *stones: Block, ties: Sequence[Tie], live: Load = DOWN) -> Scene:
        return Scene([self.ROCK, *stones], ["rock"], live, ties=tuple(ties))

    def certified(self, scene: Scene) -> float:
        solution = solve(scene)
        assert solution.status is Status.CERTIFIED
        assert solution.load_factor is not None
        return solution.load_factor

    def test_a_wall_tied_to_a_rock_that_touches_nothing(self) -> None:
        """Moments about the toe: the wall's weight of 24 at 0.2 inside, the tie's force of 5 along
        (-3, 0, -2) at 0.4 inside and 2.5 up; the live load at mid-height."""
        ground = Block.box("ground", (-1, 0, -1), (2, 1, 0))
        wall = Block.box("wall", (0, 0, 0), (0.4, 1, 3), density=20.0)
        rock = Block.box("rock", (-4, 0, -1), (-3, 1, 1))
        tie = Tie("wall", "rock", (0, 0.5, 2.5), (-3, 0.5, 0.5), 5.0)
        live = Load(acceleration=(1, 0, 0))
        scene = Scene([ground, wall, rock], ["ground", "rock"], live, friction=0.7, ties=(tie,))
        pull = 5.0 / np.hypot(3.0, 2.0)
        expected = (24 * 0.2 + pull * (3 * 2.5 + 2 * 0.4)) / (24 * 1.5)
        assert expected == pytest.approx(0.453056, abs=1e-6)
        assert self.certified(scene) == pytest.approx(expected, rel=1e-6)
        with pytest.raises(InputError, match=r"'rock' .*touches no other block.*tie it to one"):
            solve(replace(scene, ties=()))

    @pytest.mark.parametrize("anchor", [0.0, 0.5])
    def test_a_stone_that_hangs_on_a_tie(self, anchor: float) -> None:
        """At its top, or at its centroid; the tie yields at 25, the stone weighs 10."""
        tie = Tie("stone", "rock", (0, 0, anchor), (0, 0, 5), 25.0)
        assert self.certified(self.hung(cube("stone"), ties=[tie])) == pytest.approx(1.5, rel=1e-6)

    def test_a_stone_between_two_inclined_ties(self) -> None:
        """Pushed sideways until one of them yields: both lines pass through the centroid."""
        ends = [(-0.9, 0, 5), (0.9, 0, 5)]
        ties = [Tie("rock", "stone", end, (0, 0, 0), 8.0) for end in ends]
        length = np.hypot(0.9, 5.0)
        expected = (2 * 8.0 - 10.0 * length / 5.0) * 0.9 / length / 10.0
        scene = self.hung(cube("stone"), ties=ties, live=Load(acceleration=(1, 0, 0)))
        assert self.certified(scene) == pytest.approx(expected, rel=1e-6)

    def test_a_stone_on_four_ties_and_one_hung_below_it(self) -> None:
        places = [(x, y) for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
        four = [Tie("stone", "rock", (x, y, 0.5), (x, y, 5), 10.0) for x, y in places]
        assert self.certified(self.hung(cube("stone"), ties=four)) == pytest.approx(3.0, rel=1e-6)
        below = Tie("stone", "low", (0, 0, -0.5), (0, 0, -2.5), 15.0)
        scene = self.hung(cube("stone"), cube("low", z=-3.0), ties=[*four, below])
        assert self.certified(scene) == pytest.approx(0.5, rel=1e-6)  # 15 / 10 - 1

    def test_two_free_blocks_on_the_ground(self) -> None:
        """Ties along the ground pass on what the second block cannot resist."""
        ground = Block.box("ground", (-5, -1, -1), (5, 1, 0))
        blocks = [ground, cube("p", x=-1.5, z=0.5), cube("q", x=1.5, z=0.5)]
        pull = Load(forces={"q": (1, 0, 0, 0, -0.5, 0)})  # at the foot
        for places, expected in (((-0.3, 0.0, 0.3), 2 * 3.0), ((-0.3, 0.3), 3.0 + 2 * 1.2)):
            ties = tuple(Tie("p", "q", (-1, y, 0.0), (1, y, 0.0), 1.2) for y in places)
            scene = Scene(blocks, ["ground"], pull, friction=0.3, ties=ties)
            assert self.certified(scene) == pytest.approx(expected, rel=1e-6)

    def test_a_tied_group_that_hangs_on_nothing_falls(self) -> None:
        tie = Tie("stone", "low", (0, 0, -0.5), (0, 0, -2.5), 15.0)
        scene = self.hung(cube("held", z=4.5), cube("stone"), cube("low", z=-3.0), ties=[tie])
        solution = solve(scene)
        assert solution.status is Status.DEAD_LOAD_UNSTABLE
        assert any(f"{name!r} falls" in solution.note for name in ("held", "stone", "low"))

    def test_contacts_are_not_shared_where_other_blocks_are_tied(self) -> None:
        scene = self.hung(cube("stone"), ties=[Tie("stone", "rock", (0, 0, 0.5), (0, 0, 5), 25.0)])
        stronger = replace(scene, ties=(replace(scene.ties[0], yield_force=50.0),))
        assert solve(stronger.sharing_contacts_of(scene)).load_factor == pytest.approx(4.0)
        with pytest.raises(InputError, match="tied blocks"):
            replace(scene, ties=()).sharing_contacts_of(scene)


def cube(id: str, x: float = 0.0, z: float = 0.0) -> Block:
    """Of side 1 and weight 10, its centroid in y = 0."""
    middle = np.array([x, 0.0, z])
    return Block.box(id, middle - 0.5, middle + 0.5, density=10.0)


def test_ice_is_proved_too() -> None:
    """A block of weight 5 and length 1 turned over on ice: no state is strictly inside a condition
    without resistance, and none has to be."""
    ground = Block.box("ground", (-1, -1, -1), (3, 2, 0))
    block = Block.box("b1", (0, 0, 0), (1, 1, 0.5), density=10.0)
    turn = Load(forces={"b1": (0, 0, 0, 0, 1, 0)})
    solution = solve(Scene([ground, block], ["ground"], turn, friction=0.0))
    assert solution.status is Status.CERTIFIED
    assert solution.is_proved, solution.note
    assert solution.load_factor == pytest.approx(5.0 * 0.5, rel=1e-5)


def test_a_tie_turned_and_in_other_units() -> None:
    """A quarter turn about z and a step along x; mm and N in place of m and kN."""
    tie = Tie("a", "b", (1, 0, 2), (4, 0, 2), 12.0)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert tie.moved(turn, np.array([5.0, 0.0, 0.0])) == Tie("a", "b", (5, 1, 2), (5, 4, 2), 12.0)
    assert tie.scaled(1e3, 1e3) == Tie("a", "b", (1e3, 0, 2e3), (4e3, 0, 2e3), 12e3)


@pytest.mark.exhaustive
@given(turn=rotations())
@settings(max_examples=2, deadline=None)
def test_rotation_and_units(turn: FloatArray) -> None:
    scene = tied_block(4.0)
    expected = solve(scene).load_factor
    for other in (scene.moved(turn, (1.0, 2.0, 3.0)), scene.in_units(scene.units, 1e3, 7.0)):
        assert solve(other).load_factor == pytest.approx(expected, rel=2e-5)


def test_refusals() -> None:
    scene = builtin_scene("single-block")
    make = lambda tie: Scene(scene.blocks, scene.supports, scene.live, ties=(tie,))  # noqa: E731
    free, fixed = scene.blocks[int(scene.free[0])].id, scene.supports[0]
    with pytest.raises(InputError, match="there is no block 'nobody'"):
        make(Tie("nobody", free, (0, 0, 0), (1, 0, 0), 1.0))
    with pytest.raises(InputError, match=r"yield_force of tie .* must be above 0"):
        Tie(fixed, free, (0, 0, 0), (1, 0, 0), 0.0)
    with pytest.raises(InputError, match="has no length"):
        Tie(fixed, free, (0, 0, 0), (0, 0, 0), 1.0)


@pytest.mark.parametrize("interaction", ["fixed-point", "certified"])
def test_interaction_names_them(interaction: str) -> None:
    """Not their strength, which the scene does not state."""
    with pytest.raises(ModelError, match="knows no ties and no reactions"):
        solve(tied_block(4.0), method=interaction)


@pytest.mark.exhaustive
def test_with_resultants() -> None:
    scene = tied_block(4.0)
    solution = solve(scene, formulation=resultants)
    assert solution.load_factor == pytest.approx(0.9, rel=1e-5)  # 0.5 + 2 T / W


@pytest.mark.exhaustive
def test_picture(tmp_path: Path) -> None:
    """The tie that yields is told from the one that hangs slack."""
    scene = tied_block(4.0)
    pulled, slack = solve(scene), solve(scene.with_live(Load(acceleration=(-1.0, 0.0, 0.0))))
    assert yielding(scene, pulled.forces).tolist() == [True]
    assert yielding(scene, slack.forces).tolist() == [False]
    prop = Reaction("block", scene.ties[0].end, (0, 0, 1), 1e-6)
    beside = replace(scene, reactions=(prop,))
    assert yielding(beside, solve(beside).forces).tolist() == [True]
    plot(scene, pulled, tmp_path / "tied.png")
    assert (tmp_path / "tied.png").stat().st_size > 0


def data_of(made: Page) -> dict[str, Any]:
    """What the page was given to draw."""
    text = str(made).split('type="application/json">')[1].split("</script>")[0]
    data: dict[str, Any] = json.loads(text)
    return data


def test_interactive_page() -> None:
    """The page has the tie that yields and the zone that crushes, and moves them with blocks."""
    scene = tied_block(4.0).with_strength(compressive=2e3)
    data = data_of(page(scene, solve(scene)))
    kinds = [(shape["zone"], shape["colour"]) for shape in data["shapes"]]
    assert kinds == [(True, Style.crushed), (False, Style.yielding)]
    tie = data["shapes"][1]
    assert tie["points"] == [-3.0, 0.5, 2.0, 0.0, 0.5, 2.0]
    assert tie["moves"][:3] == [0.0, 0.0, 0.0]  # its end on the wall
    assert tie["moves"][3] > 0.0
    assert "yields at 4" in tie["text"]
