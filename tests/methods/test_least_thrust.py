"""Lower bounds of all solutions without dilatancy, from least thrusts of joints."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from cvxlimit import Block, Load, Scene, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.masonry import running_bond, single_block, wall
from cvxlimit.methods.driver import Run
from cvxlimit.methods.least_thrust import LowerBound, lower_bound
from cvxlimit.model.formulations import vertex_forces
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.minorant import minorant
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES
from helpers import hand_equilibrium
from members import assert_member
from planar import _friction_rows, _planar_equilibrium, lowest_member


def bound(scene: Scene, upper: float = np.inf, surface: str = "conic", **given: float) -> float:
    return lower_bound(Run(scene, surface), upper, **given).load_factor


def clamped(friction: float = 1.0, **contacts: float) -> Scene:
    """The middle one of three cubes on one another, of which the outer ones are fixed."""
    blocks = [
        Block.box(f"p{i}", (0, 0, 0.5 * i), (0.5, 0.5, 0.5 * i + 0.5), density=20.0)
        for i in range(3)
    ]
    live = Load(acceleration=(1, 0, 0))
    return Scene(blocks, ["p0", "p2"], live, friction=friction, **contacts)


def bond(stones: int, courses: int, friction: float = 0.6, height: float = 0.4) -> Scene:
    unit = (0.4, 0.2, height)
    live = Load(acceleration=(1, 0, 0))
    return wall(
        running_bond(stones, courses), unit=unit, density=20.0, friction=friction, live=live
    )


class TestClosedForms:
    @pytest.mark.parametrize("surface", ["conic", "octagon", "parabolic"])
    @pytest.mark.parametrize("friction", [0.3, 1.0])
    def test_a_clamped_cube_slides_from_its_friction_on(
        self, friction: float, surface: str
    ) -> None:
        """Its weight presses the lower joint, and nothing need press the upper one: whatever
        clamps it, it does not slide at less. The associated factor is infinite."""
        assert bound(clamped(friction), surface=surface) == pytest.approx(friction, rel=1e-6)

    def test_cohesion_adds_to_it(self) -> None:
        """c A in both joints: 5 and 5 kN/m2 on 0.25 m2, over 2.5 kN."""
        scene = clamped(0.5, cohesion=5.0)
        assert bound(scene) == pytest.approx(0.5 + 2 * 5.0 * 0.25 / 2.5, rel=1e-6)

    @pytest.mark.parametrize("name", ["single-block", "stack", "arch"])
    def test_piles_and_arches_have_the_associated_factor(self, name: str) -> None:
        found = solve(builtin_scene(name)).load_factor
        assert found is not None
        assert bound(builtin_scene(name), found) == pytest.approx(found, rel=1e-5)

    def test_blocks_pushed_up_between_walls(self) -> None:
        """The wall pushes back as hard as the load does, and friction holds 0.7 of that: the weight
        is lifted from 3 alpha = 1 + 0.7 alpha on."""
        blocks = [Block.box("w0", (-1, 0, 0), (0, 1, 1)), Block.box("w1", (1, 0, 0), (2, 1, 1)),
                  Block.box("c", (0, 0, 0), (1, 1, 1), density=20.0)]  # fmt: skip
        scene = Scene(blocks, ["w0", "w1"], Load(acceleration=(1, 0, 3)), friction=0.7)
        assert bound(scene) == pytest.approx(1.0 / 2.3, rel=1e-4)

    def test_a_push_down_alone_has_no_end(self) -> None:
        block = single_block()
        pressed = Scene(block.blocks, block.supports, Load(acceleration=(0, 0, -1)), friction=0.4)
        assert bound(pressed, 30.0) == pytest.approx(30.0)

    def test_parts_that_bear_no_live_load_do_not_matter(self) -> None:
        """A stone that only friction holds stands beside, and with what friction is its own
        matter."""
        ground = Block.box("ground", (-2, -1, -1), (6, 2, 0))
        blocks = [Block.box("a", (0, 0, 0), (1, 1, 0.5), density=20.0),
                  Block.box("w0", (2, 0, 0), (3, 1, 1)), Block.box("w1", (4, 0, 0), (5, 1, 1)),
                  Block.box("held", (3, 0, 0.2), (4, 1, 0.8), density=20.0)]  # fmt: skip
        live = Load(weights={"a": (1, 0, 0)})
        scene = Scene([ground, *blocks], ["ground", "w0", "w1"], live, friction=0.6)
        assert bound(scene) == pytest.approx(0.6, rel=1e-6)


def found(scene: Scene) -> LowerBound:
    return lower_bound(Run(scene), 2.0)


class TestProofs:
    def test_forces_carry_the_bound_with_friction_of_the_least_thrusts(self) -> None:
        scene = builtin_scene("arch")
        result = found(scene)
        assert result.forces is not None
        matrix, dead, live = hand_equilibrium(scene)
        rest = matrix @ result.forces.ravel() + dead + result.load_factor * live
        assert np.abs(rest).max() < 1e-8 * np.abs(dead).sum()
        mu = scene.contacts.friction
        slack = mu * result.thrusts - np.hypot(*result.forces[:, :2].T)
        assert slack.min() > -1e-8 * np.abs(dead).sum()

    @pytest.mark.parametrize("scene", [bond(2, 3), builtin_scene("arch"), builtin_scene("stack")])
    @pytest.mark.exhaustive_cases("scene0")
    def test_least_thrusts_against_a_linear_program(self, scene: Scene) -> None:
        """No least thrust is above SciPy's, and where a round was at the bound none is below it by
        more than what is not asked for."""
        result = found(scene)
        at = planar_least_thrusts(scene, (1.0 - 1e-7) * result.load_factor)
        assert (result.thrusts <= at + 1e-6 * scene.total_weight).all()
        if result.rounds > 1:
            assert result.thrusts == pytest.approx(at, abs=1e-4 * scene.total_weight)

    def test_lines_hold_whatever_rates_they_are_from(self) -> None:
        """All states that are admissible are above: the dead load's, the largest load factor's, and
        those between them."""
        scene, rng = builtin_scene("arch"), np.random.default_rng(0)
        certifier = Certifier(Run(scene).assemblage, DEFAULT_SURFACES)
        dead, solution = certifier.references.dead_state, solve(scene)
        assert dead is not None
        assert solution.forces is not None
        assert solution.load_factor is not None
        states = [(dead, 0.0), (solution.forces, solution.load_factor)]
        for _ in range(30):
            weights = np.zeros((len(scene.contacts), 6))
            weights[rng.integers(len(weights)), COLUMN["N"]] = 1.0
            line = minorant(certifier, weights, rng.normal(size=(len(scene.free), 6)))
            assert line is not None
            for forces, factor in states:
                above = (weights * forces).sum() - line.constant - line.slope * factor
                assert above > -1e-7 * scene.total_weight

    def test_interrupted_searches_keep_what_is_proved(self) -> None:
        result = lower_bound(Run(builtin_scene("arch")), 1.0, most=0)
        assert result.is_cut
        assert result.load_factor == 0.0

    def test_friction_at_corners_is_not_covered(self) -> None:
        run = Run(builtin_scene("arch"), formulation=vertex_forces)
        with pytest.raises(ModelError, match="no lower bound without dilatancy"):
            lower_bound(run, 1.0)


def planar_least_thrusts(scene: Scene, factor: float) -> np.ndarray:
    """By SciPy, joint by joint, in the plane (x, z)."""
    matrix, shear = _planar_equilibrium(scene)
    dead, live = (
        np.column_stack([f[:, 0], f[:, 2], f[:, 4]]).ravel()
        for f in (scene.dead_forces, scene.live_forces)
    )
    n = len(scene.contacts)
    friction = _friction_rows(scene.contacts.friction, shear).tocsr()[:, : 3 * n]
    found = []
    for j in range(n):
        cost = np.zeros(3 * n)
        cost[[j, n + j]] = 1.0
        answer = linprog(
            cost, A_ub=friction, b_ub=np.zeros(2 * n), A_eq=matrix, b_eq=-(dead + factor * live),
            bounds=[(0, None)] * (2 * n) + [(None, None)] * n,
        )  # fmt: skip
        found.append(answer.fun if answer.status == 0 else np.inf)
    return np.array(found)


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(300))
def test_no_member_lies_below(seed: int) -> None:
    """Random walls, sliding and rocking, in the plane and in space, with cohesion and facets: every
    member is right by a second writing, none is above the associated factor, and none below the
    bound, nor is the lowest of all where a mixed-integer program has it."""
    rng = np.random.default_rng(seed)
    across, up = rng.choice([0.0, 0.4]), rng.choice([0.0, -0.3, 0.3])
    live = Load(acceleration=(1.0, across, up))
    scene = wall(
        running_bond(int(rng.integers(1, 4)), int(rng.integers(1, 5))),
        unit=(0.4, 0.2, float(rng.uniform(0.1, 0.8))), density=20.0,
        friction=float(rng.uniform(0.2, 0.9)), live=live,
    )  # fmt: skip
    if seed % 3 == 0:
        scene = scene.with_cohesion(float(rng.uniform(0.0, 3.0)))
    surface = ["conic", "octagon"][seed % 2]
    members = solve(scene, surface, method=ZeroDilatancy(searches=1, budget=60)).members
    for member in members:
        assert_member(scene, member.forces, member.mechanism, member.load_factor, surface)
    factors = [m.load_factor for m in members if m.load_factor >= 0]
    below = bound(scene, 2.0, surface)
    assert below <= min(factors, default=np.inf) * (1 + 1e-5)
    above = solve(scene, surface).load_factor
    if above is not None:
        assert max(factors, default=0.0) <= above * (1 + 1e-5) + 1e-9
    if not across and seed % 3 and len(scene.contacts) <= 9:
        lowest, _ = lowest_member(scene)
        assert below <= max(lowest, 0.0) * (1 + 1e-5)
