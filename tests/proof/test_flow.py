"""The flow rule in NumPy is the dual of the admissible forces: power, tightness, leftovers."""

from __future__ import annotations

from collections.abc import Sequence

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvxlimit import COMPONENTS, Contacts, Scene, builtin_scene
from cvxlimit.model.formulations import resultants
from cvxlimit.model.sinks import Constraints
from cvxlimit.model.statement import admissible
from cvxlimit.model.statics import Statics
from cvxlimit.proof.flow import FlowRule, corner_openings
from cvxlimit.surfaces import Facets, Rocking, Sliding, Torsion, TorsionShear, YieldSurface
from cvxlimit.surfaces.base import stated
from helpers import Core, Ellipse, contact_of, missing_opening, piles, regular, rotations

SETS: dict[str, list[YieldSurface]] = {
    "rocking": [],
    "conic": [TorsionShear()],
    "octagon": [TorsionShear(Facets.circumscribed(8))],
    "pentagon-inscribed": [TorsionShear(Facets.inscribed(5))],
    "sliding+torsion": [Sliding(), Torsion()],
    "ellipse": [Ellipse()],
    "overlapping": [TorsionShear(), Ellipse(), Sliding(Facets.circumscribed(6))],
    "core": [TorsionShear(), Core(0.7)],
    "core alone": [Core(0.7)],
}
BOUNDS_TANGENTIAL = {name for name in SETS if name not in ("rocking", "core alone")}


def contacts_of(sides: int) -> Contacts:
    return contact_of(regular(sides), friction=0.6)


def least_power(surfaces: Sequence[YieldSurface], contacts: Contacts, rates: np.ndarray) -> float:
    """The least power of admissible forces with N = 1 on ``rates``: primal side, by CVXPY."""
    into = Constraints()
    force, _ = resultants(contacts).unknowns(into)
    into.zero(force["N"] - 1.0)
    for surface in (Rocking(), *surfaces):
        for condition in stated(surface, contacts):
            admissible(into, condition, force, surface.cone)
    power = sum(rates[0, k] * force[c][0] for k, c in enumerate(COMPONENTS))
    problem = cp.Problem(cp.Minimize(power), into.all)
    problem.solve(solver=cp.CLARABEL)
    return float(problem.value)


@pytest.mark.parametrize("sides", [3, 4, 6])
@pytest.mark.parametrize("name", sorted(BOUNDS_TANGENTIAL))
def test_shortfall_is_minus_the_least_power(name: str, sides: int) -> None:
    """Strong duality, contact by contact: no bound on the power of forces could be better.

    To 1e-6: Clarabel's default accuracy on both sides, on numbers of order one.
    """
    contacts = contacts_of(sides)
    flow = FlowRule(SETS[name], contacts)
    for rates in np.random.default_rng(sides).normal(size=(4, 1, 6)):
        found = flow.shortfall(rates)
        np.testing.assert_allclose(found.unresisted, 0.0, atol=1e-12)
        assert found.dissipation == 0.0
        assert found.missing[0] == pytest.approx(
            -least_power(SETS[name], contacts, rates), abs=1e-6
        )


@pytest.mark.parametrize("name", ["rocking", "core alone"])
def test_without_tangential_rates_openings_remain(name: str) -> None:
    contacts = contacts_of(5)
    for rates in np.random.default_rng(7).normal(size=(4, 1, 6)):
        rates[0, [0, 1, 5]] = 0.0
        found = FlowRule(SETS[name], contacts).shortfall(rates)
        assert not found.unresisted.any()
        assert found.missing[0] == pytest.approx(
            -least_power(SETS[name], contacts, rates), abs=1e-6
        )


@pytest.mark.parametrize("name", sorted(SETS))
def test_admissible_forces_do_no_less_work_than_promised(name: str) -> None:
    """x @ q >= -shortfall N for random admissible x: what upper bounds rest on."""
    scene = builtin_scene("tuff-wall")
    contacts, surfaces = scene.contacts, [Rocking(), *SETS[name]]
    generator = np.random.default_rng(3)
    rates = generator.normal(size=(len(contacts), 6))
    flow = FlowRule(surfaces, contacts)
    found = flow.shortfall(rates)
    missing, slip = found.missing, found.unresisted.reshape(3, -1).T
    size = np.median(np.sqrt(contacts.area))
    tested = 0
    for _ in range(200):
        x = generator.normal(size=rates.shape) * [0.2, 0.2, 1, 0.01, 0.01, 0.005]
        ok = np.all(
            [
                contacts.corner_minimum(-y) >= 0.0 if len(y) != len(contacts) else y <= 0.0
                for s in surfaces
                for y in s.excess(x, contacts)
            ],
            axis=0,
        )
        free = (slip * x[:, [0, 1, 5]] / [1, 1, size]).sum(axis=1)  # what no surface resists
        power = (x * rates).sum(axis=1) + free
        assert (power[ok] >= -missing[ok] * x[ok, 2] - 1e-9).all()
        tested += int(ok.sum())
    assert tested > 500


def test_leftovers_are_what_no_surface_resists() -> None:
    contacts = contacts_of(4)
    rates = np.array([[1.0, 2.0, 3.0, 0.0, 0.0, 4.0]])
    nothing, size = np.zeros((1, 3)), np.sqrt(contacts.area[0])
    for surfaces, expected in (
        ([TorsionShear()], nothing),
        ([Sliding()], -np.array([[0.0, 0.0, 4.0 * size]])),
        ([Torsion()], -np.array([[1.0, 2.0, 0.0]])),
        ([], -np.array([[1.0, 2.0, 4.0 * size]])),
    ):
        found = FlowRule(surfaces, contacts).shortfall(rates).unresisted
        np.testing.assert_allclose(found, expected[0], atol=1e-12)


@pytest.mark.parametrize("name", ["conic", "octagon", "sliding+torsion", "ellipse", "core"])
def test_constraints_allow_what_numpy_allows(name: str) -> None:
    """The least uniform opening that makes rates feasible in CVXPY is the shortfall in NumPy."""
    contacts = contacts_of(6)
    flow = FlowRule(SETS[name], contacts)
    for rates in np.random.default_rng(11).normal(size=(3, 1, 6)):
        extra = cp.Variable()
        openings = corner_openings(rates, contacts) + extra
        inner = cp.hstack([openings, rates[:, 0], rates[:, 1], rates[:, 5]])
        flow.stated(into := Constraints(), inner)
        problem = cp.Problem(cp.Minimize(extra), into.all)
        problem.solve(solver=cp.CLARABEL)
        assert flow.shortfall(rates).missing[0] == pytest.approx(extra.value, abs=1e-6)


@given(scene=piles(), turn=rotations(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_block_motions_by_hand(scene: Scene, turn: np.ndarray, seed: int) -> None:
    """Shortfall from A^T u equals the one from the rigid motion of every contact's corners."""
    scene = scene.moved(turn, (1.0, -2.0, 3.0))
    statics = Statics.of(scene)
    rates = np.random.default_rng(seed).normal(size=(len(scene.free), 6))
    found = FlowRule([TorsionShear()], scene.contacts).shortfall(statics.relative_rates(rates))
    np.testing.assert_allclose(found.missing, missing_opening(scene, rates), atol=1e-9)


def test_shortfall_is_homogeneous_and_falls_with_opening() -> None:
    contacts = builtin_scene("tuff-wall").contacts
    rates = np.random.default_rng(5).normal(size=(len(contacts), 6))
    for surfaces in (SETS["conic"], SETS["octagon"]):
        flow = FlowRule(surfaces, contacts)
        missing = flow.shortfall(rates).missing
        np.testing.assert_allclose(flow.shortfall(3.0 * rates).missing, 3.0 * missing, atol=1e-12)
        opened = rates + np.array([0, 0, 0.7, 0, 0, 0])
        np.testing.assert_allclose(flow.shortfall(opened).missing, missing - 0.7, atol=1e-12)
