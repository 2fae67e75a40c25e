"""One statement, two sinks: rows written straight are those that CVXPY makes of the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings

from cvxlimit import Scene, builtin_scene
from cvxlimit.errors import ModelError
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem
from cvxlimit.extensions.interaction.restriction.pressed import PressedProblem
from cvxlimit.extensions.interaction.restriction.steps import SafeStep
from cvxlimit.extensions.interaction.states.majorants import Point
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.extensions.interaction.states.support import whole_boxes
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.masonry.builtin import BUILTIN
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import (
    Formulation,
    corner_compressions,
    resultants,
    vertex_forces,
)
from cvxlimit.model.point_friction import PointFriction, at_corners
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.sinks import Constraints
from cvxlimit.model.statement import LargestFactor, largest_self_stress
from cvxlimit.proof.certificate import Certifier
from cvxlimit.readings.named import parse_moments
from cvxlimit.reductions.choice import Reductions
from cvxlimit.results.utilisation import LeastUse
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Condition, Conic, Norm, Rocking, YieldSurface
from cvxlimit.surfaces.cones import Cone, Facets
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES, surfaces_of
from helpers import scenes
from rows import assert_same, assert_same_rows, at_random, by_cvxpy

SURFACES = ("conic", "octagon", "16-gon-inscribed", "parabolic")
READINGS = ("independent", "signed", "signed-torsion-bending", "paper")
SMALL = ("single-block", "arch", "tuff-wall")


def problem_of(
    scene: Scene,
    surface: Any = "conic",
    formulation: Formulation = corner_compressions,
    model: str = "least",
    most: float | None = None,
) -> LimitProgram:
    surfaces = surfaces_of(surface)[0]
    found = Reductions.of(Assemblage.of(scene), surfaces, formulation, model)
    goal = LargestFactor(most)
    return LimitProgram(found.assemblage, surfaces, reduction=found.best(), goal=goal)


def everywhere(names: Sequence[str]) -> Any:
    """All scenes, of which only small ones are fast."""
    slow = [
        pytest.param(name, marks=pytest.mark.exhaustive) for name in BUILTIN if name not in names
    ]
    return pytest.mark.parametrize("name", [*names, *slow])


@pytest.mark.parametrize("surface", SURFACES)
@settings(max_examples=5)
@given(scene=scenes())
def test_random_scenes(surface: str, scene: Scene) -> None:
    assert_same_rows(problem_of(scene, surface))


@everywhere(SMALL)
@pytest.mark.parametrize("model", ["full", "least"])
@pytest.mark.parametrize("surface", SURFACES)
def test_all_scenes_and_reductions(name: str, model: str, surface: str) -> None:
    assert_same_rows(problem_of(builtin_scene(name), surface, model=model, most=2.0))


@everywhere(("single-block", "arch"))
@pytest.mark.parametrize("moments", READINGS)
@pytest.mark.parametrize("cone", ["conic", "octagon"])
def test_frozen_at_random_eccentricities(name: str, moments: str, cone: str) -> None:
    plain = surfaces_of(cone)[0][1].cone
    assert_frozen(FrozenProblem(builtin_scene(name), plain, parse_moments(moments)))


@pytest.mark.parametrize("name", ["single-block", "arch"])
@pytest.mark.parametrize("moments", READINGS)
def test_frozen_where_contacts_are_pressed(name: str, moments: str) -> None:
    assert_frozen(PressedProblem(builtin_scene(name), Conic(), parse_moments(moments)))


def assert_frozen(frozen: FrozenProblem) -> None:
    assert set(frozen.problem.problem.parameters()) == set(frozen.parameters.values())
    for seed in range(2):
        at_random(frozen.problem, seed)
        assert_same_rows(frozen.problem)


@pytest.mark.parametrize("name", ["single-block", "arch"])  # CVXPY takes minutes on larger ones
@pytest.mark.parametrize("moments", READINGS)
def test_safe_steps_at_random_points(name: str, moments: str) -> None:
    """With all that a step may have: a price of slack, a bound, and a share of the curvature."""
    assemblage = Assemblage.of(builtin_scene(name))
    step, random = SafeStep(assemblage, parse_moments(moments)), np.random.default_rng(1)
    contacts = step.statics.contacts
    for price, curvature, most in ((None, 1.0, None), (5.0, 1.0, 0.3), (None, 0.1, None)):
        centre = 0.3 * random.uniform(-1.0, 1.0, contacts.sides.shape) * contacts.sides
        shear = random.uniform(-1.0, 1.0, centre.shape) * contacts.friction[:, None]
        stated = step.at(Point(centre, shear), price, curvature, most)
        assert_same_rows(stated)
        at_random(stated)
        assert_same_rows(stated)


def takes_nothing() -> bool:
    """True if CVXPY has variables without entries, as its lowest version here has not."""
    try:
        cp.Variable(0)
    except ValueError:
        return False
    return True


@pytest.mark.skipif(not takes_nothing(), reason="this CVXPY has no variables without entries")
@everywhere(("single-block", "arch"))
@pytest.mark.parametrize("moments", READINGS)
@pytest.mark.parametrize("price", [None, 2.0])
def test_hulls_with_disjuncts_of_all_kinds(name: str, moments: str, price: float | None) -> None:
    """In boxes, at corners, at random centres, and about some: by both sinks, and from pieces."""
    scene, reading = builtin_scene(name), parse_moments(moments)
    problem, contacts, random = HullProblem(scene), scene.contacts, np.random.default_rng(2)
    every, boxes = np.arange(len(contacts)), whole_boxes(contacts)
    centre = random.uniform(-0.9, 0.9, (len(contacts), 2))
    disjuncts = (
        states_of(reading)
        .box_disjuncts(contacts)
        .joined(
            states_of(reading).disjuncts_at(contacts, every, centre, boxes),
            states_of(reading).safe_disjuncts(contacts, centre, 0.1),
        )
    )
    own = problem.program(problem.columns(disjuncts, price), price)
    goal = problem.stated(disjuncts, into := Constraints(), price)
    assert_same(own, by_cvxpy(cp.Problem(cp.Maximize(goal), into.all), into.unknowns))


class Lens(Cone):
    """A cone of one's own: the larger of the norm and twice the first component."""

    def gauge_of(self, rows: Any) -> Any:
        return np.maximum(np.linalg.norm(rows, axis=0), 2.0 * np.abs(rows[0]))

    def polar_gauge_of(self, rows: Any) -> Any:
        raise NotImplementedError

    def rows_of(self, size: int) -> Any:
        """The first row in an unknown of its own: w = t - 2 v1."""
        linear = np.zeros((4, 2 + size))
        linear[:, [0, 1, -1]] = [[0, 0, 1], [1, 2, 0], [1, -2, -1], [-1, 2, 1]]
        return linear, np.eye(1 + size, 2 + size)


class Own(YieldSurface):
    """Norms of all kinds: weighted, with constants, of one component and of three; coefficients and
    constants in Parameters."""

    name = "own"

    def __init__(self, count: int, cone: Cone | None = None) -> None:
        super().__init__(cone)
        self.share, self.each = cp.Parameter(name="share"), cp.Parameter(count, name="each")

    def conditions(self, contacts: Contacts) -> list[Condition]:
        arm, area = contacts.torsion_arm, contacts.area
        cohesion = {"N": 0.7 * contacts.friction, "1": cp.multiply(area, self.each)}
        whole = Norm({"V1": 1}, {"V2": self.share, "1": 0.1 * self.share}, {"MT": 1 / arm})
        some = np.arange(0, len(contacts), 2)
        return [
            Condition([Norm({"V1": 1}, {"V2": 1}, weight=2.0 * self.each), whole], cohesion),
            Condition([Norm({"MT": 1 / arm[some]}, weight=area[some])], {"N": self.share}, some),
            Condition([], {"N": -1.0, "1": 1e3}),
            Condition([], {"1": self.share}),
        ]


FORMULATIONS = {
    "corners": corner_compressions,
    "resultants": resultants,
    "vertices": vertex_forces,
    "field": PlasticField(corner_compressions, divisions=2),
    "points": PointFriction(at_corners, 2),
}


@everywhere(("single-block", "tuff-wall"))
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("physics", ["dry", "mortar and crushing"])
def test_own_surfaces_formulations_and_physics(name: str, formulation: str, physics: str) -> None:
    scene = builtin_scene(name)
    if physics != "dry":
        scene = scene.with_cohesion(3.0)
        # of contacts that are no rectangles only a field at points says how they crush
        can_crush = formulation not in ("resultants", "vertices")
        if can_crush or scene.contacts.is_rectangle.all():
            scene = scene.with_strength(compressive=500.0)
    own = Own(len(scene.contacts))
    problem = problem_of(scene, [Rocking(), own], FORMULATIONS[formulation], "full")
    at_random(problem)
    assert_same_rows(problem)


def test_own_cones() -> None:
    scene = builtin_scene("tuff-wall")
    problem = LimitProgram(scene, surfaces_of(Lens())[0])
    assert_same_rows(problem)
    both = [problem.run(settings_for("CLARABEL"), has_rows).load_factor for has_rows in (0, 1)]
    assert both[0] == pytest.approx(both[1], rel=1e-6)


@pytest.mark.parametrize(
    "goal",
    [largest_self_stress, LeastUse(DEFAULT_SURFACES, 0.1, 5.0)],
    ids=["self-stress", "least use"],
)
def test_other_goals(goal: Any) -> None:
    assert_same_rows(LimitProgram(builtin_scene("tuff-wall"), goal=goal))


def test_a_parameter_without_a_value_is_named() -> None:
    scene = builtin_scene("tuff-wall")
    problem = LimitProgram(scene, [Rocking(), Own(len(scene.contacts))])
    with pytest.raises(ModelError, match=r"Parameter 'each' has no value.*shape"):
        problem.run(settings_for("CLARABEL"))


@pytest.mark.parametrize("solver", ["CLARABEL", "SCS"])
def test_solvers_that_want_more_than_matrices_get_the_same(solver: str) -> None:
    problem = problem_of(builtin_scene("arch"))
    tight = settings_for(solver, None if solver == "CLARABEL" else 1e-7)
    rows, modelled = (problem.run(tight, has_rows).load_factor for has_rows in (True, False))
    assert rows == pytest.approx(modelled, rel=1e-5)


@pytest.mark.parametrize("name", ["arch", "tuff-wall", "dome", "flying-buttress"])
def test_same_answers(name: str) -> None:
    """Both brackets close, and on each other; 1e-5 is the width that is asked for."""
    problem, rung = problem_of(builtin_scene(name)), settings_for("CLARABEL")
    certifier = Certifier(problem.assemblage, problem.surfaces)
    one, other = (certifier.of(problem.run(rung, has_rows)) for has_rows in (True, False))
    for bracket in (one, other):
        assert bracket.is_within(1e-5)
    assert one.lower <= other.upper * (1.0 + 1e-12)
    assert other.lower <= one.upper * (1.0 + 1e-12)


def test_facets_need_two_components() -> None:
    scene = builtin_scene("single-block")
    surfaces = [Rocking(), Own(1, Facets.circumscribed(8))]
    with pytest.raises(ModelError, match="facets bound vectors of two components"):
        _ = LimitProgram(scene, surfaces).program
