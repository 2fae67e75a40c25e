"""Matrices written straight are those that CVXPY makes of the same problem."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings

from cvxlimit import Scene, builtin_scene
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.direct import DirectProblem
from cvxlimit.model.formulations import (
    Formulation,
    corner_compressions,
    resultants,
    vertex_forces,
)
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface
from cvxlimit.surfaces.coulomb import surfaces_of
from helpers import scenes

SURFACES = ("conic", "octagon", "16-gon-inscribed")


def problem_of(
    scene: Scene,
    surface: str = "conic",
    formulation: Formulation = corner_compressions,
    model: str = "least",
    most: float | None = None,
) -> DirectProblem:
    surfaces = surfaces_of(surface)[0]
    found = Reductions.of(Assemblage.of(scene), surfaces, formulation, model)
    return DirectProblem(found.assemblage, surfaces, found.best(), most)


def assert_same_matrices(problem: DirectProblem) -> None:
    """To 1e-12 of the largest entry, a hundred times the rounding of products of a dozen terms.
    CVXPY puts the load factor first, and otherwise has unknowns and rows in the same order."""
    own = problem.program
    assert own is not None
    data, _, _ = problem.modelled.problem.get_problem_data("CLARABEL")
    dims, order = data["dims"], [*range(1, own.matrix.shape[1]), 0]
    assert (dims.zero, dims.nonneg, tuple(dims.soc)) == (own.zero, own.nonneg, own.cones)
    assert np.array_equal(data["c"][order], own.cost)
    theirs = sp.csc_array(data["A"])[:, order]
    assert abs(own.matrix - theirs).max() <= 1e-12 * abs(theirs).max()
    assert np.abs(own.right - data["b"]).max() <= 1e-12 * np.abs(data["b"]).max()
    assert problem.shape == problem.modelled.shape


@pytest.mark.parametrize("surface", SURFACES)
@settings(max_examples=10)
@given(scene=scenes())
def test_random_scenes(surface: str, scene: Scene) -> None:
    assert_same_matrices(problem_of(scene, surface))


@pytest.mark.parametrize("name", ["arch", "tuff-wall", "dome"])
@pytest.mark.parametrize("model", ["full", "least"])
@pytest.mark.parametrize("surface", SURFACES)
def test_all_reductions(name: str, model: str, surface: str) -> None:
    assert_same_matrices(problem_of(builtin_scene(name), surface, model=model, most=2.0))


@pytest.mark.parametrize("name", ["arch", "tuff-wall", "dome", "s10-panel"])
@pytest.mark.parametrize("model", ["full", "least"])
def test_dead_load_alone(name: str, model: str) -> None:
    """Another load on the same rows is the problem written anew."""
    problem = problem_of(builtin_scene(name), "conic", model=model)
    alone = problem.dead_alone()
    assert_same_matrices(alone)
    anew = replaced(problem)
    assert alone.program is not None
    assert anew.program is not None
    assert abs(alone.program.matrix - anew.program.matrix).max() <= 1e-15
    assert np.array_equal(alone.program.right, anew.program.right)


def replaced(problem: DirectProblem) -> DirectProblem:
    """The same of an assemblage that has the dead load for its live one, and no other."""
    alone = problem.assemblage.alone(problem.assemblage.statics.dead)
    return DirectProblem(alone, problem.surfaces, problem.reduction, most=1.0)


class Own(YieldSurface):
    """Norms of all kinds: weighted, with constants, of one component and of three."""

    name = "own"

    def conditions(self, contacts: Contacts) -> list[Condition]:
        arm, area = contacts.torsion_arm, contacts.area
        cohesion = {"N": 0.7 * contacts.friction, "1": 3.0 * area}
        whole = Norm({"V1": 1}, {"V2": 1, "1": 0.1}, {"MT": 1 / arm})
        some = np.arange(0, len(contacts), 2)
        return [
            Condition([Norm({"V1": 1}, {"V2": 1}, weight=2.0), whole], cohesion),
            Condition([Norm({"MT": 1 / arm[some]}, weight=area[some])], {"N": 1.0}, some),
            Condition([], {"N": -1.0, "1": 1e3}),
        ]


@pytest.mark.parametrize("formulation", [corner_compressions, resultants, vertex_forces])
def test_own_surfaces_and_formulations(formulation: Formulation) -> None:
    scene = builtin_scene("tuff-wall").with_strength(compressive=500.0)
    found = Reductions.of(Assemblage.of(scene), [Rocking(), Own()], formulation)
    problem = DirectProblem(found.assemblage, [Rocking(), Own()], found.best())
    assert_same_matrices(problem)


def test_what_is_not_known_goes_through_cvxpy() -> None:
    """The parabola has a cone of its own; SCS wants more of a problem than its matrices."""
    parabola, plain = (
        problem_of(builtin_scene("tuff-wall"), name) for name in ("parabolic", "conic")
    )
    assert parabola.program is None
    assert plain.program is not None
    pairs = ((parabola, settings_for("CLARABEL")), (plain, settings_for("SCS", 1e-6)))
    for problem, rung in pairs:
        direct, modelled = problem.solve(rung), problem.modelled.solve(rung)
        assert direct.load_factor == pytest.approx(modelled.load_factor, rel=1e-9)


@pytest.mark.parametrize("name", ["arch", "tuff-wall", "dome", "flying-buttress"])
def test_same_answers(name: str) -> None:
    """Both brackets close, and on each other; 1e-5 is the width that is asked for."""
    problem = problem_of(builtin_scene(name))
    certifier = Certifier(problem.assemblage, problem.surfaces)
    rung = settings_for("CLARABEL")
    one, other = (certifier.of(p.solve(rung)) for p in (problem, problem.modelled))
    for bracket in (one, other):
        assert bracket.is_within(1e-5)
    assert one.lower <= other.upper * (1.0 + 1e-12)
    assert other.lower <= one.upper * (1.0 + 1e-12)
