"""Equilibrium, corner compressions and scaling against hand assembly and rigid motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvxlimit import Block, Load, Scene, builtin_scene
from cvxlimit.errors import InputError
from cvxlimit.masonry import single_block
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statics import DOF, Scaling, Statics
from helpers import hand_equilibrium, rotations, scenes

SEEDS = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=20, deadline=None)


class TestEquilibrium:
    @given(scene=scenes(), turn=rotations())
    @FEW
    def test_by_hand(self, scene: Scene, turn: np.ndarray) -> None:
        scene = scene.moved(turn, (2.0, 3.0, -5.0))
        statics = Statics.of(scene)
        matrix, dead, live = hand_equilibrium(scene)
        difference = abs(statics.matrix - matrix)
        assert difference.nnz == 0 or difference.max() < 1e-12
        np.testing.assert_allclose(statics.dead, dead, rtol=1e-12)
        np.testing.assert_allclose(statics.live, live, rtol=1e-12)

    @given(scene=scenes(), seed=SEEDS)
    @FEW
    def test_inner_forces_balance(self, scene: Scene, seed: int) -> None:
        """All blocks free: contact forces are opposite pairs, so force and moment sum to zero."""
        contacts = scene.contacts
        centroids = np.array([b.centroid for b in scene.blocks])
        everyone = np.arange(len(scene.blocks))
        statics = Statics(contacts, centroids, everyone, np.zeros(0), np.zeros(0))
        x = np.random.default_rng(seed).normal(size=6 * len(contacts))
        wrench = (statics.matrix @ x).reshape(-1, DOF)
        force, moment = wrench[:, :3], wrench[:, 3:] + np.cross(centroids, wrench[:, :3])
        np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-10)
        np.testing.assert_allclose(moment.sum(axis=0), 0.0, atol=1e-10)

    def test_problem_takes_that_of_the_balance_only_where_it_is_the_same(self) -> None:
        """Narrower contacts are other equilibrium; other strengths are not."""
        scene = builtin_scene("arch")
        own, contacts = Assemblage.of(scene), scene.contacts
        narrow = replace(contacts, corner_xy=0.5 * contacts.corner_xy)
        slippery = scene._with_contacts(contacts.with_values(friction=0.4))
        kept = replace(own, statics=replace(own.statics, contacts=narrow))
        pairs = ((kept, scene._with_contacts(narrow)), (own.like(slippery), slippery))
        for taken, anew in pairs:
            found, expected = (LimitProgram(each).equilibrium.matrix for each in (taken, anew))
            np.testing.assert_array_equal(found.toarray(), expected.toarray())
        assert [taken.corners is own.balance.model for taken, _ in pairs] == [False, True]

    @given(scene=scenes(), seed=SEEDS)
    @FEW
    def test_transpose_gives_relative_rates_of_rigid_motions(self, scene: Scene, seed: int) -> None:
        """Eq. 2: velocity of b minus velocity of a at the contact's centre, and relative spin."""
        rates = np.random.default_rng(seed).normal(size=(len(scene.free), DOF))
        moving = {scene.blocks[i].id: u for i, u in zip(scene.free, rates, strict=True)}
        centroid = {block.id: block.centroid for block in scene.blocks}
        found = Statics.of(scene).relative_rates(rates)
        for contact, q in zip(scene.contacts, found, strict=True):
            velocity, spin = np.zeros(3), np.zeros(3)
            for key, sign in ((contact.b, 1.0), (contact.a, -1.0)):
                u = moving.get(key, np.zeros(DOF))
                velocity += sign * (u[:3] + np.cross(u[3:], contact.origin - centroid[key]))
                spin += sign * u[3:]
            axes = np.stack([contact.t1, contact.t2, contact.normal])
            np.testing.assert_allclose(q, [*(axes @ velocity), *(axes @ spin)], atol=1e-12)

    def test_residual_of_a_block_at_rest(self) -> None:
        scene = single_block((0.4, 0.4, 1.0), density=20.0)
        forces = np.array([[0.0, 0.0, 0.4 * 0.4 * 1.0 * 20.0, 0.0, 0.0, 0.0]])
        np.testing.assert_allclose(Statics.of(scene).residual(forces, 0.0), 0.0, atol=1e-12)
        pushed = Statics.of(scene).residual(forces, 0.5)
        np.testing.assert_allclose(pushed, [[0.5 * 3.2, 0, 0, 0, 0, 0]], atol=1e-12)

    def test_live_forces_and_moments_enter(self) -> None:
        live = Load(forces={"b1": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)})
        statics = Statics.of(single_block(live=live))
        assert statics.live.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


class TestCornerCompressions:
    @given(scene=scenes(), turn=rotations(), seed=SEEDS)
    @FEW
    def test_resultants_of_forces_at_corners(
        self, scene: Scene, turn: np.ndarray, seed: int
    ) -> None:
        """Every corner pushes along the normal: sum of forces, and of moments about the centre."""
        scene = scene.moved(turn)
        contacts = scene.contacts
        n, m = len(contacts), len(contacts.corner_xy)
        z = np.random.default_rng(seed).normal(size=m + 3 * n)
        forces = (corner_compressions(contacts).resultant_map @ z).reshape(-1, DOF)
        for j, contact in enumerate(contacts):
            push = z[:m][contacts.corner_contact == j][:, None] * contact.normal
            moment = np.cross(contact.corners - contact.origin, push).sum(axis=0)
            shear = z[[m + j, m + n + j]]
            twist = z[m + 2 * n + j]
            expected = [*shear, push.sum(axis=0) @ contact.normal,
                        moment @ contact.t1, moment @ contact.t2, twist]  # fmt: skip
            np.testing.assert_allclose(forces[j], expected, atol=1e-12)
            assert moment @ contact.normal == pytest.approx(0.0, abs=1e-12)


class TestScaling:
    @given(scene=scenes(), seed=SEEDS)
    @FEW
    def test_round_trip(self, scene: Scene, seed: int) -> None:
        """Scaled residuals, powers and factors are the unscaled ones in other units."""
        generator = np.random.default_rng(seed)
        scaling = Scaling(*(10.0 ** generator.uniform(-6, 6, 4)))
        plain = Statics.of(scene)
        scaled = scaling.apply(plain)
        x = generator.normal(size=(len(scene.contacts), DOF))
        alpha = float(generator.normal())
        units = np.array([1.0, 1.0, 1.0] + [scaling.length] * 3)
        back = scaling.force * units * scaled.residual(x, alpha)
        there = plain.residual(scaling.forces(x), scaling.load_factor(alpha))
        np.testing.assert_allclose(there, back, atol=1e-9 * np.abs(back).max())
        u = generator.normal(size=(len(scene.free), DOF))
        live = float(plain.live @ scaling.mechanism(u).ravel())
        assert live == pytest.approx(float(scaled.live @ u.ravel()), rel=1e-9, abs=1e-12)
        dead = float(plain.dead @ scaling.mechanism(u).ravel())
        expected = scaling.load_factor(float(scaled.dead @ u.ravel()))
        assert dead == pytest.approx(expected, rel=1e-9, abs=1e-9 * abs(scaling.load_factor(1.0)))

    @pytest.mark.parametrize("name", ["tuff-wall", "ferris-tin-loi-1", "arch"])
    def test_total_loads_become_one(self, name: str) -> None:
        scene = builtin_scene(name)
        scaled = Scaling.of(scene).apply(Statics.of(scene))
        for load in (scaled.dead, scaled.live):
            assert np.linalg.norm(load.reshape(-1, DOF)[:, :3], axis=1).sum() == pytest.approx(1.0)
        assert float(np.median(scaled.contacts.area)) == pytest.approx(1.0)

    def test_lengths_are_scaled_once(self) -> None:
        contacts = builtin_scene("tuff-wall").contacts
        scaled = contacts.scaled(1000.0)
        np.testing.assert_allclose(scaled.area, 1e6 * contacts.area)
        np.testing.assert_allclose(scaled.torsion_arm, 1e3 * contacts.torsion_arm)
        np.testing.assert_allclose(scaled.corner_points, 1e3 * contacts.corner_points)

    def test_without_dead_load(self) -> None:
        scene = single_block().with_dead(Load())
        scaling = Scaling.of(scene)
        assert scaling.force == scaling.live > 0.0

    def test_moments_alone_count(self) -> None:
        """A live load of pure moment still has a unit: moment over the typical contact size."""
        scene = single_block((0.5, 0.5, 1.0), live=Load(forces={"b1": (0, 0, 0, 0, 0, 3.0)}))
        assert Scaling.of(scene).live == pytest.approx(3.0 / 0.5)

    def test_far_from_the_origin(self) -> None:
        """Rounding of coordinates at 1e3 block sizes is 1e-13 of them; arms keep 1e-12."""
        near = builtin_scene("tuff-wall")
        far = near.moved(np.eye(3), (100.0, -50.0, 30.0))
        difference = abs(Statics.of(near).matrix - Statics.of(far).matrix)
        assert difference.max() < 1e-12


def test_a_block_between_two_supports_has_self_stress() -> None:
    """Six equations, twelve unknowns: the null space is what wedging can do."""
    blocks = [
        Block.box("left", (-1, 0, 0), (0, 1, 1)),
        Block.box("b", (0, 0, 0), (1, 1, 1), density=1.0),
        Block.box("right", (1, 0, 0), (2, 1, 1)),
    ]
    scene = Scene(tuple(blocks), ("left", "right"), Load(acceleration=(0, 1, 0)))
    matrix = Statics.of(scene).matrix.toarray()
    assert matrix.shape == (6, 12)
    assert np.linalg.matrix_rank(matrix) == 6
    squeeze = np.zeros(12)
    squeeze[[2, 8]] = 1.0
    np.testing.assert_allclose(matrix @ squeeze, 0.0, atol=1e-15)


@pytest.mark.parametrize("density", [1e-200, 1e-320])
def test_loads_that_underflow_are_refused(density: float) -> None:
    ground, block = Block.box("g", (-1, -1, -1), (2, 2, 0)), Block.box("b", (0, 0, 0), (1, 1, 1))
    scene = Scene((ground, replace(block, density=density)), ("g",), Load(acceleration=(1, 0, 0)))
    with pytest.raises(InputError, match="live load of scene 'scene' is below 1e-100 in all"):
        Scaling.of(scene)
