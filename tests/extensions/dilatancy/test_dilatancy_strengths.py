"""Friction without dilatancy on joints that crush, hold by mortar, or are tied: closed forms, and
solutions checked by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cvxlimit import Block, Load, Scene, Solution, Status, Tie, solve
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.masonry import running_bond, single_block, wall
from exhaustive import slow
from helpers import hand_equilibrium, hand_torsion_arm

FloatArray = NDArray[np.float64]

RULE = ZeroDilatancy(searches=1, budget=40)


def wedged() -> Scene:
    """A unit block of weight 1 between the ground and a fixed lintel that just touches it: with
    associated friction no load moves it."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    lintel = Block.box("lintel", (-1, -1, 1), (2, 2, 2))
    block = Block.box("block", (0, 0, 0), (1, 1, 1), density=1.0)
    live = Load(acceleration=(1, 0, 0))
    return Scene([ground, lintel, block], ["ground", "lintel"], live, friction=0.4)


def lowest(scene: Scene) -> float:
    solution = solve(scene, method=RULE)
    assert solution.status is Status.CONVERGED
    assert max(member.residual for member in solution.members) <= RULE.tolerance
    return solution.members[0].load_factor


class TestClosedForms:
    def test_cohesion_of_both_joints(self) -> None:
        """Nothing clamps it in the lowest one: mu + c A / W below, c A / W above."""
        scene = wedged().with_cohesion(0.15)
        assert solve(scene).status is Status.UNBOUNDED
        assert lowest(scene) == pytest.approx(0.4 + 2 * 0.15, rel=1e-5)

    def test_mortar_slides_with_the_cohesion_it_has(self) -> None:
        """Mohr-Coulomb to the tension cut-off: pulled, a joint resists c - mu t; the lintel may
        hang the block on its mortar, but the sum of both joints' resistance is the same."""
        scene = wedged().with_cohesion(0.15).with_strength(tensile=0.1)
        assert lowest(scene) == pytest.approx(0.4 + 2 * 0.15 - 2 * 0.4 * 0.1, rel=1e-5)

    def test_a_tie_that_slides_with_its_block(self) -> None:
        """Held back by the tie's yield force besides friction."""
        tie = Tie("ground", "block", (-3, 0.5, 0.5), (0, 0.5, 0.5), 0.25)
        assert lowest(replace(wedged(), ties=(tie,))) == pytest.approx(0.4 + 0.25, rel=1e-5)

    @pytest.mark.exhaustive
    def test_crushing_does_not_change_the_lowest(self) -> None:
        """No clamping, no crushing. Associated friction has a limit here: stone that crushes makes
        room for dilatancy, so it is far above."""
        scene = wedged().with_strength(compressive=20.0)
        associated = solve(scene)
        assert associated.load_factor > 1.0
        assert lowest(scene) == pytest.approx(0.4, rel=1e-4)

    def test_a_tipping_block_that_crushes(self) -> None:
        """At (l - W / (f b)) / h, whatever slides: nothing does."""
        scene = single_block((1.0, 1.0, 2.0), friction=0.9)
        scene = scene.with_strength(compressive=20.0 * scene.total_weight)
        assert lowest(scene) == pytest.approx((1.0 - 1.0 / 20.0) / 2.0, rel=1e-5)


def small_wall() -> Scene:
    return wall(
        running_bond(2, 2),
        unit=(0.4, 0.2, 0.4),
        density=20.0,
        friction=0.8,
        live=Load(acceleration=(1, 0, 0)),
    )


def drawn(rng: np.random.Generator, sides: FloatArray, strength: float, mu: float, arm: float,
          cohesion: float) -> FloatArray:  # fmt: skip
    """Admissible forces (k, 6) of a rectangle, written down again: effective rectangle, Coulomb's
    law on the line of Eq. 24; where nothing crushes, normal forces of any size."""
    k = 4000
    e = rng.uniform(-0.5, 0.5, (k, 2)) * sides
    most = strength * np.prod(sides - 2 * np.abs(e), axis=1)
    normal = rng.uniform(0.0, 1.0, k) ** 0.3 * np.minimum(most, 50.0)
    size = rng.uniform(0.0, 1.0, k) ** 0.2 * (cohesion + mu * normal)
    share, angle = rng.uniform(0.0, 1.0, k), rng.uniform(0.0, 2 * np.pi, k)
    torsion = (1 - share) * size * arm * rng.choice([-1.0, 1.0], k)
    shear = share * size
    forces = (shear * np.cos(angle), shear * np.sin(angle), normal, normal * e[:, 1],
              -normal * e[:, 0], torsion)  # fmt: skip
    return np.column_stack(forces)


def assert_members_by_hand(scene: Scene, solution: Solution) -> None:
    """Equilibrium, and the maximum of dissipation on every contact: no admissible force does less
    power on its rates, with the opening added that dilatancy would have made."""
    matrix, dead, live = hand_equilibrium(scene)
    place = {scene.blocks[i].id: row for row, i in enumerate(scene.free)}
    rng = np.random.default_rng(0)
    for member in (solution.members[0], solution.members[-1]):
        load, forces = np.abs(dead).sum(), member.forces
        rest = matrix @ forces.ravel() + dead + member.load_factor * live
        assert np.abs(rest).max() < 1e-9 * load
        assert live @ member.mechanism.ravel() == pytest.approx(1.0)
        for contact, x in zip(scene.contacts, forces, strict=True):
            moved, turned = np.zeros(3), np.zeros(3)
            for key, sign in ((contact.b, 1.0), (contact.a, -1.0)):
                if key in place:
                    u = member.mechanism[place[key]]
                    block = next(b for b in scene.blocks if b.id == key)
                    moved += sign * (u[:3] + np.cross(u[3:], contact.origin - block.centroid))
                    turned += sign * u[3:]
            axes = (contact.t1, contact.t2, contact.normal)
            rates = np.array([vector @ axis for vector in (moved, turned) for axis in axes])
            arm = hand_torsion_arm(contact)
            rates[2] += contact.friction * max(np.hypot(*rates[:2]), arm * abs(rates[5]))
            sides = np.ptp(contact.corners - contact.origin, axis=0)
            sides = np.array([np.ptp((contact.corners - contact.origin) @ t) for t in axes[:2]])
            j = scene.contacts.names.index(contact.name)
            strength = float(scene.contacts.compressive_strength[j])
            cohesion = float(scene.contacts.cohesion[j] * scene.contacts.area[j])
            others = drawn(rng, sides, strength, contact.friction, arm, cohesion)
            assert x @ rates <= (others @ rates).min() + 2e-6 * abs(member.load_factor)
            # and the member's own forces are admissible
            shear = np.hypot(x[0], x[1]) + abs(x[5]) / arm
            assert shear <= cohesion + contact.friction * x[2] + 2e-6 * load
            e = np.abs(np.array([x[4], x[3]])) / max(x[2], 1e-9)
            assert x[2] <= strength * np.prod(np.maximum(sides - 2 * e, 1e-9 * sides)) + 1e-5 * load


@pytest.mark.parametrize("strength", [slow({"compressive": 100.0}), {"cohesion": 2.0}])
def test_small_wall_by_hand(strength: dict[str, float]) -> None:
    scene = small_wall()
    if "cohesion" in strength:
        scene = scene.with_cohesion(strength["cohesion"])
    else:
        scene = scene.with_strength(**strength)
    solution = solve(scene, method=RULE)
    assert solution.status is Status.CONVERGED
    assert solution.members[-1].load_factor <= solve(scene).upper * (1 + 1e-6)
    assert_members_by_hand(scene, solution)


def test_members_of_mortar_are_in_equilibrium_with_the_given_loads() -> None:
    """What mortar pulls is taken out of every member, not of the first one only."""
    scene = small_wall().with_cohesion(2.0).with_strength(tensile=1.0)
    solution = solve(scene, method=RULE)
    matrix, dead, live = hand_equilibrium(scene)
    for member in solution.members:
        rest = matrix @ member.forces.ravel() + dead + member.load_factor * live
        assert np.abs(rest).max() < 1e-9 * np.abs(dead).sum()
    assert (solution.members[0].forces[:, 2] >= -scene.contacts.area - 1e-9).all()
