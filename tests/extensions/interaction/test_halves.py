"""One half of a symmetric scene with interaction: the bounds are those of the whole."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from cvxlimit import Scene, solve
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem
from cvxlimit.extensions.interaction.restriction.inner import InnerMethod
from cvxlimit.extensions.interaction.restriction.lower_bound import LowerBounds
from cvxlimit.extensions.interaction.restriction.steps import SafeStep
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.masonry import panel
from cvxlimit.methods.driver import Run
from cvxlimit.readings.named import parse_moments
from cvxlimit.reductions.choice import Reductions
from cvxlimit.scene import Load
from cvxlimit.solvers import settings_for

READINGS = ("independent", "signed", "signed-torsion-bending")
SOLVER = settings_for("CLARABEL", 1e-9)


def small_panel() -> Scene:
    """A panel with two returns, pushed across: symmetric, with blocks and contacts on the plane."""
    return panel(0.40, 5, left_return=0.20, right_return=0.20, live=Load(acceleration=(0, -1, 0)))


def half_of(run: Run) -> SymmetricHalf | None:
    """That of a run's scene, however small."""
    found = Reductions.of(run.assemblage, run.surfaces, model="least")
    return SymmetricHalf.of(found, run.moments)


@pytest.mark.parametrize("moments", READINGS)
def test_a_half_relaxes_no_more_than_the_whole(moments: str) -> None:
    """The hull's load factor is the same, its forces balance the whole scene, and blocks move in
    the mirror like their partners."""
    run = Run(small_panel(), moments=parse_moments(moments))
    half = half_of(run)
    assert half is not None
    assert len(half.kept) < 0.6 * len(run.contacts)
    assert len(half.kept) > 0.5 * len(run.contacts)  # some lie on the plane
    disjuncts = states_of(run.moments).box_disjuncts(run.contacts)
    whole = HullProblem(run.assemblage).solve(disjuncts, SOLVER)
    found = HullProblem(run.assemblage, half).solve(disjuncts, SOLVER)
    assert found.load_factor == pytest.approx(whole.load_factor, rel=1e-6)
    residual = run.assemblage.statics.residual(found.forces, found.load_factor)
    assert np.abs(residual).max() < 1e-6 * run.scaling.force
    live = run.assemblage.statics.live @ found.mechanism.ravel()
    assert live == pytest.approx(1.0, abs=1e-6)


@pytest.mark.exhaustive_cases("signed")
@pytest.mark.parametrize("moments", READINGS)
def test_safe_steps_on_a_half_are_safe_on_the_whole(moments: str) -> None:
    """At the middle both have the same optimum (a symmetric convex problem); every answer passes
    the checker, which knows nothing of the mirror."""
    run = Run(small_panel(), moments=parse_moments(moments))
    half = half_of(run)
    method = InnerMethod(run)
    whole = method.step.solve(method.middle, SOLVER)
    method.step = SafeStep(run.assemblage, run.moments, half)
    found = method.step.solve(method.middle, SOLVER)
    assert found.load_factor == pytest.approx(whole.load_factor, rel=1e-6)
    checker = LowerBounds(run.scene, run.moments)
    for iterate in islice(method.improve(method.middle), 3):
        bound = checker.of(iterate.state.forces, iterate.state.load_factor)
        assert bound.is_accepted
        assert bound.value <= iterate.state.load_factor + 1e-9


def test_no_half_where_the_mirror_changes_something() -> None:
    """Neither friction on one side, nor a reading whose signs are tied to the contacts' axes."""
    scene = small_panel()
    contacts = scene.contacts
    pair = contacts.block_ids[contacts.a[0]], contacts.block_ids[contacts.b[0]]
    rough = replace(scene, contact_friction={pair: 0.9})
    assert half_of(Run(scene)) is not None
    assert half_of(Run(rough)) is None
    assert half_of(Run(scene, moments=parse_moments("paper"))) is None


@pytest.mark.exhaustive
def test_certified_brackets_with_and_without_the_mirror_overlap() -> None:
    """Either bracket holds the truth; the model says which one used a half."""
    scene = small_panel()
    rule = Certified(starts="relaxation", solves=8, branching_seconds=0.0)
    whole = solve(scene, method=replace(rule), model="full")
    half = solve(scene, method=replace(rule), model="least")
    assert half.model == ("symmetry",)
    assert whole.model == ()
    assert half.upper == pytest.approx(whole.upper, rel=2e-4)  # what disjuncts are added down to
    assert half.lower <= whole.upper
    assert whole.lower <= half.upper
    assert half.lower == pytest.approx(whole.lower, rel=0.02)  # other paths to local optima
