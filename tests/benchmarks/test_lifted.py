"""Lower bounds of solutions without dilatancy by products of forces and rates, in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.lifted import (
    Lifted,
    LiftedBound,
    _Lift,
    _near,
    _Products,
    lifted_bound,
)

from cvxlimit import Load, Scene, ZeroDilatancy, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import running_bond, wall
from cvxlimit.methods.driver import Run
from cvxlimit.methods.least_thrust import lower_bound
from cvxlimit.model.program import LimitProgram
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solution import Member
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES
from planar import lowest_member


def built(courses: list[list[float]], height: float, friction: float) -> Scene:
    live = Load(acceleration=(1, 0, 0))
    unit = (0.4, 0.2, height)
    return wall(courses, unit=unit, density=20.0, friction=friction, live=live)


def lowest(scene: Scene) -> Member:
    members = solve(scene, method="zero-dilatancy").members
    return min(members, key=lambda member: member.load_factor)


PATIENT = 3600.0
"""Seconds that no program here takes: a bound is not to depend on what else the machine does."""


def lifted(
    scene: Scene, start: float, upper: float, radius: int | None = None, seconds: float = PATIENT
) -> LiftedBound:
    *_, last = lifted_bound(Run(scene), start, upper, Lifted(radius, seconds))
    return last


@pytest.mark.exhaustive
@pytest.mark.parametrize(("height", "friction"), [(0.4, 0.8), (0.6, 0.5)])
def test_the_lowest_solution_of_five_blocks(height: float, friction: float) -> None:
    """It is met from below."""
    scene = built(running_bond(2, 2), height, friction)
    found = lowest(scene).load_factor
    bound = lifted(scene, lower_bound(Run(scene), found).load_factor, found)
    assert found * (1 - 1e-4) < bound.load_factor <= found
    assert bound.rates > 1e3


@pytest.mark.exhaustive
@pytest.mark.parametrize(("height", "friction"), [(0.4, 0.8), (0.6, 0.5)])
def test_a_mixed_integer_program_agrees(height: float, friction: float) -> None:
    """With limits of forces and rates: an independent path to the lowest solution."""
    scene = built(running_bond(2, 2), height, friction)
    found, proved = lowest_member(scene)
    assert proved == pytest.approx(found, rel=1e-6)
    assert lowest(scene).load_factor == pytest.approx(found, rel=1e-6)
    assert lifted(scene, 0.0, found).load_factor == pytest.approx(found, rel=1e-4)


@pytest.mark.exhaustive
def test_the_lowest_of_31_contacts_is_met_from_every_seed() -> None:
    """Two stones by six courses: the program proves that none is lower."""
    scene = built(running_bond(2, 6), 0.3, 0.6)
    ends = [solve(scene, method=ZeroDilatancy(seed=10 * k)).load_factor for k in range(5)]
    assert ends == pytest.approx([min(ends)] * 5, rel=1e-4)
    assert lifted(scene, 0.0, min(ends), radius=1).load_factor > min(ends) * (1 - 1e-4)


@pytest.mark.exhaustive
def test_solutions_satisfy_every_row() -> None:
    """Of the lifted problem, at any window that they are in: products of a member's forces and
    rates, which were found and checked by another way."""
    scene = built(running_bond(2, 3), 0.3, 0.6)
    run = Run(scene)
    found = Reductions.of(run.assemblage, DEFAULT_SURFACES, model="least")
    problem = LimitProgram(found.assemblage, DEFAULT_SURFACES, reduction=found.best())
    products = _Products.of(problem)
    assert products is not None
    scaling, model = problem.scaling, problem.model
    for member in solve(scene, method="zero-dilatancy").members[:3]:
        alpha = member.load_factor / scaling.load_factor(1.0)
        forces = np.linalg.lstsq(model.resultant_map.toarray(), member.forces.ravel(), rcond=None)[
            0
        ]
        x = np.concatenate([[1.0], forces / scaling.force, [alpha]])
        assert problem.reduction.rates is not None
        units = scaling.live * np.tile(np.repeat([1.0, scaling.length], 3), len(scene.free))
        u = problem.reduction.rates @ (member.mechanism.ravel() * units)
        n = len(scene.contacts)
        slip = products.flow[2 * n : 3 * n, : len(u)] @ -u
        y = np.append(u, np.maximum(slip, 0.0))
        lift = _Lift(products, (0.5 * alpha, 2.0 * alpha), _near(problem, None))
        z = np.outer(x, y).ravel()
        rest = lift.equations @ z
        rest[-1] -= 1.0
        size = np.abs(x).max() * np.abs(y).max()
        assert np.abs(rest).max() < 1e-5 * size
        assert (lift.inequalities @ z).min() > -1e-5 * size
        assert lift.cost @ z == pytest.approx(alpha, rel=1e-6)


def test_fewer_products_are_weaker() -> None:
    scene, found = built(running_bond(2, 2), 0.4, 0.8), 0.5
    bounds = [lifted(scene, 0.0, found, radius=r).load_factor for r in (0, 1)]
    assert bounds[0] <= bounds[1] + 1e-4
    assert bounds[1] <= found


@pytest.mark.exhaustive
def test_windows_narrow_from_below(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where products are few, what one window excludes makes the next one stronger."""
    scene = built(running_bond(2, 3), 0.3, 0.6)
    found = lowest(scene).load_factor
    several = lifted(scene, 0.0, found, radius=0).load_factor
    monkeypatch.setattr("benchmarks.lifted._WORTH", 2.0)
    one = lifted(scene, 0.0, found, radius=0).load_factor
    assert 0.0 < one < several <= found
    assert found - several < 0.5 * (found - one)


def test_what_it_cannot_do_is_said() -> None:
    space = builtin_scene("single-block").with_live(Load(acceleration=(1.0, 0.3, 0.0)))
    assert "in a plane" in lifted(space, 0.0, 1.0).note
    flat = builtin_scene("stack")
    assert "nothing between" in lifted(flat, 0.4, 0.4).note
    late = lifted(built(running_bond(2, 2), 0.4, 0.8), 0.0, 0.5, seconds=0.0)
    assert "not in the time" in late.note
    assert late.load_factor == 0.0
    with pytest.raises(ModelError, match="radius"):
        Lifted(radius=-1)


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(50))
def test_random_walls_are_closed_or_bounded(seed: int) -> None:
    """Of at most 20 contacts: never above the lowest member, however it was found, and on it where
    a mixed-integer program, too slow for more contacts, has the lowest of all."""
    rng = np.random.default_rng(seed)
    pattern = running_bond(int(rng.integers(1, 3)), int(rng.integers(2, 5)))
    if seed % 3 == 0:
        pattern = [[0.5, 0.5] if k % 2 else [1.0] for k in range(int(rng.integers(3, 6)))]
    scene = built(pattern, float(rng.uniform(0.15, 0.7)), float(rng.uniform(0.3, 0.9)))
    found = lowest(scene).load_factor
    start = lower_bound(Run(scene), found).load_factor
    assert start <= found * (1 + 1e-6)
    bound = lifted(scene, start, found).load_factor
    assert bound <= found * (1 + 1e-6)
    if len(scene.contacts) <= 11:
        least, proved = lowest_member(scene)
        assert proved == pytest.approx(least, rel=1e-6)
        assert (found, bound) == pytest.approx((least, least), rel=1e-4)
