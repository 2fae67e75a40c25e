"""Forces between bounds: closed forms, and random scenes against linear programs of our own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import coo_array, csr_array, hstack

from cvxlimit import Block, Load, Reaction, Scene, Status, Tie, settlement, solve
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io import read_scene, write_scene
from cvxlimit.masonry import arch, running_bond, wall
from helpers import assert_certified, hand_equilibrium, hand_rows
from referee import with_random_reactions

PUSH = Load(acceleration=(1.0, 0.0, 0.0))
GROUND = Block.box("ground", (-3, -1, -1), (5, 2, 0))


def propped(*reactions: Reaction, friction: float = 0.3) -> Scene:
    """A cube of weight 20 that is pushed along x."""
    cube = Block.box("b", (0, 0, 0), (1, 1, 1), density=20.0)
    return Scene([GROUND, cube], ["ground"], PUSH, friction=friction, reactions=reactions)


class TestByHand:
    @pytest.mark.parametrize(("least", "most"), [(0, 3), (1, 3), (-2, 3), (-3, -1), (2.5, 2.5)])
    @pytest.mark.parametrize("friction", [0.3, 1.5])
    def test_a_block_held_at_its_cap(self, least: float, most: float, friction: float) -> None:
        """Against the push at 0.8 above the ground: alpha W = mu W + r, or about the toe
        alpha W / 2 = W / 2 + 0.8 r; whichever comes first, with r at its upper bound."""
        scene = propped(Reaction("b", (1, 0.5, 0.8), (-1, 0, 0), most, least), friction=friction)
        solution = solve(scene)
        expected = min(friction + most / 20.0, (10.0 + 0.8 * most) / 10.0)
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(expected, rel=1e-6)
        rows = [name.startswith("reaction") for name in solution.contact_names]
        assert solution.forces[rows, 2].sum() == pytest.approx(most, abs=1e-5)

    def test_a_prop_without_a_bound(self) -> None:
        """It pushes until the block turns the other way about its heel: r = 20 alpha - 0.3 x 20,
        and 0.8 r = 10 alpha + 10."""
        solution = solve(propped(Reaction("b", (1, 0.5, 0.8), (-1, 0, 0), np.inf)))
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(14.8 / 6.0, rel=1e-6)

    def test_soil_that_has_room_to_push_the_wrong_way_does_not(self) -> None:
        """Behind the block it rests at its lower bound, since equilibrium chooses it."""
        solution = solve(propped(Reaction("b", (0, 0.5, 0.5), (1, 0, 0), 100.0)))
        assert solution.load_factor == pytest.approx(0.3, rel=1e-6)

    def test_what_pushes_at_least_so_much_is_a_load(self) -> None:
        pushed = propped(Reaction("b", (0, 0.5, 0.0), (1, 0, 0), 4.0, least=2.0))
        assert_certified(solution := solve(pushed))
        assert solution.load_factor == pytest.approx(0.3 - 2.0 / 20.0, rel=1e-6)

    def test_a_tie_is_a_reaction_that_pulls(self) -> None:
        """Between two blocks, along the same line: the same load factor and mechanism."""
        blocks = [GROUND, *(Block.box(n, (x, 0, 0), (x + 1, 1, 1), density=20.0)
                            for n, x in (("a", -1.5), ("b", 1.0)))]  # fmt: skip
        live = Load(forces={"b": (1, 0, 0, 0, 0, 0)})
        tied = Scene(blocks, ["ground"], live, friction=0.4,
                     ties=[Tie("a", "b", (-0.5, 0.5, 0.2), (1.0, 0.5, 0.2), 5.0)])  # fmt: skip
        pull = Reaction("b", (1.0, 0.5, 0.2), (1, 0, 0), 0.0, least=-5.0, on="a")
        other = replace(tied, ties=(), reactions=(pull,))
        found = [solve(scene) for scene in (tied, other)]
        assert found[0].load_factor == pytest.approx(8.0 + 5.0, rel=1e-6)
        assert found[1].load_factor == pytest.approx(8.0 + 5.0, rel=1e-6)
        for each in found:
            assert_certified(each)
            assert each.forces[-1, 2] == pytest.approx(-5.0, rel=1e-6)

    def test_a_settling_support_and_a_prop(self) -> None:
        """A beam of weight 4 and length 2 on piers of 0.2 at its ends, one of which settles: it
        turns about the other's inner edge, 1.8 R = 0.8 x 4 - 0.8 r."""
        piers = [Block.box(f"p{x}", (x, 0, -1), (x + 0.2, 1, 0)) for x in (0.0, 1.8)]
        beam = Block.box("beam", (0, 0, 0), (2, 1, 0.2), density=10.0)
        prop = Reaction("beam", (1.0, 0.5, 0.0), (0, 0, 1), 1.0)
        for first in (["p0.0", "p1.8"], ["p1.8", "p0.0"]):  # whichever stands for the ground
            scene = Scene([*piers, beam], first, PUSH, friction=0.6, reactions=[prop])
            least = settlement(scene, "p1.8", (0, 0, -1))
            assert least.solution.status is Status.CERTIFIED
            assert least.value == pytest.approx((3.2 - 0.8) / 1.8, rel=1e-6)

    def test_the_pushed_ground_has_to_stay(self) -> None:
        beam = Block.box("beam", (0, 0, 0), (2, 1, 0.2), density=10.0)
        pier = Block.box("p", (0, 0, -1), (2, 1, 0))
        prop = Reaction("beam", (1.0, 0.5, 0.0), (0, 0, 1), 1.0)
        scene = Scene([pier, beam], ["p"], PUSH, friction=0.6, reactions=[prop])
        with pytest.raises(InputError, match="needs a ground that stays"):
            settlement(scene, "p", (0, 0, -1))

    def test_the_certified_bracket_says_why_not(self) -> None:
        scene = propped(Reaction("b", (1, 0.5, 0.8), (-1, 0, 0), 3.0))
        with pytest.raises(ModelError, match=r"bounds its proof would .* method 'fixed-point'"):
            solve(scene, method="certified")

    def test_the_fixed_point_refuses_what_pushes_at_least_so_much(self) -> None:
        scene = propped(Reaction("b", (1, 0.5, 0.8), (-1, 0, 0), 3.0, 1.0))
        named = "push at least so much, got least, 1 at contact reaction ground-b:"
        with pytest.raises(ModelError, match=named):
            solve(scene, method="fixed-point")

    def test_exact_torsion_and_no_dilatancy_take_them(self) -> None:
        scene = propped(Reaction("b", (1, 0.5, 0.5), (-1, 0, 0), 3.0))
        for method in ("exact", "zero-dilatancy"):
            found = solve(scene, method=method)
            assert found.load_factor == pytest.approx(0.45, rel=1e-4)

    def test_torsion_on_a_parabola_takes_them(self) -> None:
        """A block turned about its upright axis by the push, and held by a prop off its middle:
        between torsion on the paper's line and exact torsion, and off both."""
        scene = propped(Reaction("b", (1, 0.9, 0.5), (-1, 0, 0), 3.0))
        line, exact = solve(scene), solve(scene, method="exact")
        parabola = solve(scene, surface="parabolic")
        assert_certified(parabola)
        assert line.upper < parabola.lower
        assert parabola.upper < exact.lower


def test_slopes_by_what_reactions_bear() -> None:
    """Against the push 0.8 above the ground: alpha = mu + r / W slides, 1 + 0.08 r rocks."""
    for friction, slope in ((0.3, 1.0 / 20.0), (1.5, 0.08)):
        scene = propped(Reaction("b", (1, 0.5, 0.8), (-1, 0, 0), 3.0), friction=friction)
        found = solve(scene).sensitivity()
        assert found.most == pytest.approx([0.0, slope], rel=1e-6)
        assert "reactions at most" in str(found)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.exhaustive_cases("2", "3", "4", "5")
def test_slopes_by_differences(seed: int) -> None:
    """Of crushing arches between soils on both sides; planar, so that both are near each other."""
    rng = np.random.default_rng(seed)
    ring = arch(9, live=Load(acceleration=(1.0, 0.0, 0.0))).with_strength(compressive=400.0)
    ids, place = [ring.blocks[i].id for i in ring.free], ring.blocks
    soil = []
    for k in range(len(ids)):
        at = place[ring.free[k]].centroid
        way = (1.0, 0.0, 0.0) if at[0] < 0.0 else (-1.0, 0.0, 0.0)
        soil.append(Reaction(ids[k], tuple(at), way, float(rng.uniform(0.05, 0.3))))
    scene, step = replace(ring, reactions=tuple(soil)), 1e-3
    slopes = solve(scene).sensitivity().most[scene.contacts.is_point]
    for k in rng.choice(len(soil), 3, replace=False):
        ends = []
        for way in (1.0, -1.0):
            own = replace(soil[k], most=soil[k].most + way * step)
            changed = replace(scene, reactions=(*soil[:k], own, *soil[k + 1 :]))
            ends.append(solve(changed, tolerance=1e-8).load_factor)
        slope = (ends[0] - ends[1]) / (2.0 * step)
        assert slope == pytest.approx(slopes[k], abs=1e-3 * slopes.max() + 1e-5)


class TestAnswers:
    def test_files_and_units_keep_them(self, tmp_path: Path) -> None:
        given = (
            Reaction("b", (1, 0.5, 0.8), (-1, 0, 0), 3.0, 1.0),
            Reaction("b", (0, 0.5, 0.8), (1, 0, 1), np.inf, on="ground"),
        )
        scene = propped(*given)
        write_scene(scene, tmp_path / "propped.json")
        assert read_scene(tmp_path / "propped.json").reactions == scene.reactions
        in_mm = scene.in_units(type(scene.units)("mm", "N"), 1e3, 1e3)
        assert in_mm.reactions[0].most == 3e3
        assert solve(in_mm).load_factor == pytest.approx(solve(scene).load_factor, rel=1e-6)

    def test_turned_scenes(self) -> None:
        angle = 0.7
        turn = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        scene = propped(Reaction("b", (1, 0.5, 0.8), (-1, 0, 0.2), 3.0, 1.0))
        moved = scene.moved(turn, (3.0, -2.0, 1.0))
        assert solve(moved).load_factor == pytest.approx(solve(scene).load_factor, rel=1e-6)

    @pytest.mark.parametrize(
        ("wrong", "message"),
        [
            (lambda: Reaction("b", (0, 0, 0), (0, 0, 0), 1.0), "direction .* must not be zero"),
            (lambda: Reaction("b", (0, 0, 0), (1, 0, 0), 1.0, 2.0), "least .* above its most"),
            (lambda: Reaction("b", (0, 0, 0), (1, 0, 0), float("nan")), "most .* number.*nan"),
            (lambda: Reaction("b", (0, 0, 0), (1, 0, 0), 1.0, -np.inf), "least .* number"),
            (lambda: Reaction("b", (0, 0, 0), (1, 0, 0), 0.0), "no force"),
            (lambda: Reaction("b", (0, 0, 0), (1, 0, 0), 1.0, on="b"), "itself"),
            (lambda: propped(Reaction("c", (0, 0, 0), (1, 0, 0), 1.0)), "no block 'c'"),
            (lambda: propped(Reaction("ground", (0, 0, 0), (1, 0, 0), 1.0)), "pushes a support"),
        ],
    )  # fmt: skip
    def test_refused(self, wrong: object, message: str) -> None:
        with pytest.raises(InputError, match=message):
            wrong()  # type: ignore[operator]


def linear(scene: Scene, count: int = 8) -> float | None:
    """The load factor of a scene with reactions under facets: hand-made matrices of the scene
    without, and a column with two bounds for every reaction. None if the dead load is not
    carried."""
    bare = replace(scene, reactions=())
    matrix, dead, live = hand_equilibrium(bare)
    unit = np.abs(dead).sum()
    place = {scene.blocks[i].id: k for k, i in enumerate(scene.free)}
    columns = np.zeros((matrix.shape[0], len(scene.reactions)))
    for j, each in enumerate(scene.reactions):
        for key, sign in ((each.block, 1.0), (each.on, -1.0)):
            if key in place:
                i = 6 * place[key]
                arm = np.array(each.at) - scene.blocks[scene.free[place[key]]].centroid
                columns[i : i + 3, j] += sign * np.array(each.direction)
                columns[i + 3 : i + 6, j] += sign * np.cross(arm, each.direction)
    rows = hand_rows(bare, count)
    equal = hstack([matrix, csr_array(columns), coo_array(live[:, None] / unit)]).tocsr()
    found = linprog(
        np.append(np.zeros(equal.shape[1] - 1), -1.0),
        A_ub=hstack([rows, csr_array((rows.shape[0], columns.shape[1] + 1))]).tocsr(),
        b_ub=np.zeros(rows.shape[0]),
        A_eq=equal,
        b_eq=-dead / unit,
        bounds=[(None, None)] * matrix.shape[1]
        + [(each.least / unit, each.most / unit) for each in scene.reactions]
        + [(None, None)],
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return float(found.x[-1]) if found.status == 0 else None


def _walls(seeds: Sequence[int]) -> list[tuple[int, bool]]:
    return [(seed, seed % 2 == 0) for seed in seeds]


def check(seed: int, is_planar: bool) -> None:
    rng = np.random.default_rng(seed)
    push = (1.0, 0.0, 0.0) if is_planar else tuple(rng.normal(size=3) * [1.0, 1.0, 0.3])
    if rng.uniform() < 0.3 and is_planar:
        scene = arch(int(rng.integers(5, 12)), live=Load(acceleration=push))
    else:
        courses = running_bond(int(rng.integers(1, 4)), int(rng.integers(2, 6)))
        scene = wall(courses, friction=float(rng.uniform(0.3, 0.9)), live=Load(acceleration=push))
    scene = with_random_reactions(scene, seed, is_planar)
    expected, found = linear(scene), solve(scene, "octagon", model="least")
    if expected is None:
        none = (Status.DEAD_LOAD_UNSTABLE, Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED)
        assert found.status in none, found
        return
    if found.lower_end is not None:  # the dead load stands with a part of the live load
        expected = max(expected, found.lower_end.load_factor)
    assert found.status is Status.CERTIFIED, found.note
    assert found.load_factor == pytest.approx(expected, rel=2e-6, abs=1e-7)
    assert ("planar" in found.model) == is_planar


@pytest.mark.parametrize(("seed", "is_planar"), _walls(range(4)))
def test_random_scenes_against_a_linear_program(seed: int, is_planar: bool) -> None:
    check(seed, is_planar)


@pytest.mark.exhaustive
@pytest.mark.parametrize(("seed", "is_planar"), _walls(range(4, 112)))
def test_a_hundred_random_scenes_against_a_linear_program(seed: int, is_planar: bool) -> None:
    check(seed, is_planar)
