"""Frozen surfaces in unknowns of their own: the same sets as in force components."""

from __future__ import annotations

import numpy as np
import pytest

from cvxlimit import Contacts
from cvxlimit.base.arrays import FloatArray
from cvxlimit.masonry.walls import random_wall
from cvxlimit.model.program import LimitProgram
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Condition, Cone, Conic, Facets, Rocking
from cvxlimit.surfaces.base import condition_excess, evaluate
from cvxlimit.surfaces.frozen import (
    Eccentricity,
    LimitedTorsionShearBending,
    SignedTorsionShearBending,
    TorsionShearBending,
)

CONES = pytest.mark.parametrize("cone", [Conic(), Facets.circumscribed(8)], ids=str)
SURFACES = pytest.mark.parametrize(
    "kind", [TorsionShearBending, SignedTorsionShearBending, LimitedTorsionShearBending]
)


def at_random(contacts: int, kind: type[TorsionShearBending], seed: int) -> Eccentricity:
    """A fifth of the contacts pressed in a corner, a tenth at their centre."""
    rng = np.random.default_rng(seed)
    arm, e1, e2 = rng.uniform([[0.0], [-1.5], [-1.5]], 1.0, (3, contacts))
    arm[: contacts // 5] = 0.0
    e1[-contacts // 10 :] = e2[-contacts // 10 :] = 0.0
    if kind is TorsionShearBending:
        e1, e2 = abs(e1), abs(e2)
    return Eccentricity(arm, e1, e2)


def components(
    surface: TorsionShearBending, contacts: Contacts, seed: int
) -> dict[str, FloatArray]:
    """Random unknowns of the surface's own, and the force components that they give."""
    own, rng = surface.unknowns(contacts), np.random.default_rng(seed)
    values = {name: rng.normal(size=len(contacts)) for name in ("V1", "V2", "MT")}
    values["N"] = rng.uniform(0.0, 8.0, len(contacts))
    for name in [name for form in own.components.values() for name in form if name not in values]:
        values[name] = rng.normal(size=len(contacts))
    for name, form in own.components.items():
        values[name] = evaluate(form, values)
    return values


@CONES
@SURFACES
def test_conditions_say_the_same_of_any_state(kind: type[TorsionShearBending], cone: Cone) -> None:
    """Multiplied by the arm the excess in unknowns of its own is that in force components.

    In a corner the latter leave Coulomb's limit, which the former imply. Sums of products of
    numbers of order one: 1e-12.
    """
    contacts = random_wall(0).contacts
    for seed in range(20):
        at = at_random(len(contacts), kind, seed)
        surface = kind(at, cone)
        values = components(surface, contacts, seed)

        def worst(conditions: list[Condition]) -> list[FloatArray]:
            return [condition_excess(c, surface.cone, values) for c in conditions]  # noqa: B023

        own = worst(list(surface.unknowns(contacts).conditions))
        eq_32, coulomb, *eq_27 = worst(list(surface.conditions(contacts)))
        np.testing.assert_allclose(at.arm * own[0], eq_32, atol=1e-12)
        np.testing.assert_array_less(coulomb, own[0] + 1e-12)
        for mine, theirs in zip(own[1:], eq_27, strict=True):
            np.testing.assert_allclose(at.arm * mine, theirs, atol=1e-12)


@SURFACES
def test_coefficients_stay_bounded(kind: type[TorsionShearBending]) -> None:
    """However small the arm: those that are divided by it are shares of one."""
    at = at_random(100, kind, 3)
    tiny = Eccentricity(1e-300 * at.arm, at.e1, at.e2)
    most = max(1.0, np.abs(at.e1).max(), np.abs(at.e2).max())
    for shares in (kind.shares_of(at), kind.shares_of(tiny)):
        assert all(np.abs(values).max() <= most for values in shares.values())


@CONES
@SURFACES
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.exhaustive)])
def test_answers_are_those_in_force_components(
    kind: type[TorsionShearBending], cone: Cone, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both are solved to 1e-9 of the load; coefficients that vanish cost the old form 1e-6."""
    scene = random_wall(seed)
    surface = kind(at_random(len(scene.contacts), kind, seed), cone)
    found = []
    for own in (True, False):
        if not own:
            monkeypatch.setattr(kind, "unknowns", lambda *_: None)
        state = LimitProgram(scene, (Rocking(), surface)).run(settings_for("CLARABEL", 1e-9))
        found.append(state.load_factor)
        for excess in surface.excess(state.forces, scene.contacts):
            assert excess.max() <= 1e-6 * np.abs(scene.dead_forces).sum()
    assert found[0] == pytest.approx(found[1], rel=1e-6, abs=2e-6)
