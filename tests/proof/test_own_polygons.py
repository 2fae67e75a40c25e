"""Friction polygons of one's own, facet by facet: certified as the built-in ones are by name.

Resistances of their conditions grow with shear, so that the flow rule leaves a choice of
multipliers, and these touch rates that must agree exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from cvxlimit import Contacts, builtin_scene, solve
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.flow import FlowRule
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Condition, Facets, Norm, Rocking, TorsionShear, YieldSurface
from helpers import assert_certified

WIDTH = 1e-5


@dataclass(eq=False)
class Polygon(YieldSurface):
    """normals @ V + abs(MT) / c_T <= mu N, one condition for each facet, in one of several ways."""

    normals: np.ndarray
    way: str

    name = "polygon"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        arm, every = contacts.torsion_arm, np.arange(len(contacts))
        friction = contacts.friction
        if self.way == "per contact":
            friction = friction * np.random.default_rng(1).uniform(0.8, 1.2, len(every))
        result = []
        for a, b in self.normals:
            most = {"N": friction, "V1": -a, "V2": -b}
            if self.way == "constants":
                most["1"] = 0.01 * contacts.area
            whole, half = {"MT": 1.0 / arm}, {"MT": 0.5 / arm}
            norms = {
                "split": [Norm(half), Norm({**half, "V1": 0.1 * a})],
                "weighed": [Norm({"MT": 1.0}, weight=1.0 / arm)],
                "apart": [],
            }.get(self.way, [Norm(whole)])
            if self.way == "rows":
                result += [Condition([], {**most, "MT": side / arm}) for side in (-1.0, 1.0)]
            else:
                result.append(
                    Condition(norms, most, every if self.way == "rows of its own" else None)
                )
        if self.way == "apart":
            result.append(Condition([Norm(whole)], {"N": friction}))
        return result


def normals(count: int, shape: str) -> np.ndarray:
    """Facets of a polygon around the circle; of any other no two lie more than 180 degrees apart,
    so that friction is bounded in all directions."""
    angles = 2.0 * np.pi * np.arange(1, count + 1) / count
    generator = np.random.default_rng(count)
    if shape != "regular":
        angles = angles + generator.uniform(0.0, 2.0 * np.pi)
    if shape == "uneven":
        angles = angles + generator.uniform(-0.2, 0.2, count) * np.pi / count
    size = generator.uniform(0.7, 1.4, count) if shape == "uneven" else np.ones(count)
    return size[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


@pytest.mark.parametrize("count", [3, 8, 12])
def test_by_facets_is_as_by_name(count: int) -> None:
    scene = builtin_scene("tuff-wall")
    by_name = solve(scene, [Rocking(), TorsionShear(Facets.circumscribed(count))])
    by_facets = solve(scene, [Rocking(), Polygon(normals(count, "regular"), "plain")])
    for solution in (by_name, by_facets):
        assert_certified(solution)
    assert by_facets.load_factor == pytest.approx(by_name.load_factor, rel=2.0 * WIDTH)


WAYS = ["plain", "rows", "split", "weighed", "apart", "constants", "per contact", "rows of its own"]
FAST = [("plain", 5, "uneven"), ("split", 8, "turned"), ("constants", 3, "uneven")]
ALL = [(way, k, shape) for way in WAYS for k in (3, 4, 5, 7, 12) for shape in ("turned", "uneven")]


@pytest.mark.parametrize(("way", "count", "shape"), FAST)
def test_any_polygon_is_certified(way: str, count: int, shape: str) -> None:
    assert_certified(
        solve(builtin_scene("tuff-wall"), [Rocking(), Polygon(normals(count, shape), way)])
    )


@pytest.mark.exhaustive
@pytest.mark.parametrize(("way", "count", "shape"), ALL)
def test_every_way_to_write_a_polygon_is_certified(way: str, count: int, shape: str) -> None:
    test_any_polygon_is_certified(way, count, shape)


@pytest.mark.parametrize("has_rows", [True, False])
@pytest.mark.parametrize("way", ["plain", "split", "weighed", "constants", "rows"])
@pytest.mark.exhaustive_cases("split-True", "constants-True", "weighed-True")
def test_duals_of_a_solver_are_flows(way: str, has_rows: bool) -> None:
    """With them, the mechanism's dissipation is what least missing opening allows, and the bound
    that it proves is the load factor; 1e-6 is what is left by a solver that was asked for 1e-9."""
    scene = builtin_scene("tuff-wall")
    surfaces = [Rocking(), Polygon(normals(5, "uneven"), way)]
    problem = LimitProgram(scene, surfaces)
    state = problem.run(settings_for("CLARABEL", 1e-9), has_rows)
    assert state.flows is not None
    assert state.mechanism is not None
    certifier = Certifier(scene, problem.surfaces)
    bounds = certifier.of(state)
    assert bounds.upper_is_proved
    assert bounds.upper == pytest.approx(state.load_factor, rel=1e-6)
    relative = certifier.statics.relative_rates(state.mechanism)
    rule = FlowRule(problem.surfaces, scene.contacts)
    given, own = rule.shortfall(relative, state.flows), rule.shortfall(relative)
    largest = np.abs(relative).max()
    for found in (given, own):
        assert np.abs(found.unresisted).max() <= 1e-14 * largest
        assert found.missing.max() <= 1e-6 * largest
    strength = scene.dead_forces[:, :3].sum()
    assert given.dissipation == pytest.approx(own.dissipation, abs=1e-6 * largest * abs(strength))


def test_duals_of_other_conditions_are_not_taken() -> None:
    """Flows of another surface of that name would not fit: they are found anew."""
    scene = builtin_scene("tuff-wall")
    state = LimitProgram(scene, [Rocking(), Polygon(normals(5, "regular"), "plain")]).run()
    assert state.mechanism is not None
    rule = FlowRule([Rocking(), Polygon(normals(7, "regular"), "split")], scene.contacts)
    relative = Certifier(scene, [Rocking()]).statics.relative_rates(state.mechanism)
    with_them, alone = rule.shortfall(relative, state.flows), rule.shortfall(relative)
    np.testing.assert_array_equal(with_them.missing, alone.missing)
