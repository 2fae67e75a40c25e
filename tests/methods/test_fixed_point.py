"""The paper's iteration: what it reaches, and that it says so when it does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from cvxlimit import Block, Load, PointForce, Reaction, Scene, Tie, builtin_scene, solve
from cvxlimit.errors import InputError, ModelError
from cvxlimit.extensions.blockcone.interior import Point
from cvxlimit.io.results import result_from_dict, result_to_dict
from cvxlimit.masonry.walls import random_wall
from cvxlimit.methods.fixed_point import FixedPoint, LeastForces, cycles
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.model.sinks import Rows
from cvxlimit.plotting.look import title
from cvxlimit.readings.moments import INDEPENDENT, SIGNED
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.pressure import Pressure
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.said import said
from cvxlimit.solvers import (
    SolverSettings,
    blockwise,
    default_ladder,
    ladder_for,
    run,
    settings_for,
)
from cvxlimit.surfaces import Cone, Conic, Facets
from helpers import COMPILED
from rows import assert_same_rows


@pytest.mark.parametrize("cone", [Conic(), Facets.circumscribed(8)], ids=str)
@pytest.mark.parametrize("moments", ["independent", "signed"])
def test_first_iterate_is_torsion_shear(moments: str, cone: Conic | Facets) -> None:
    """Eq. 41: pressed at their centres, contacts obey Eq. 24 and nothing else.

    Both problems are solved to 1e-9 or better, so their values agree far below 1e-6.
    """
    scene = builtin_scene("tuff-wall")
    run = solve(scene, cone, method=FixedPoint(max_iterations=1), moments=moments)
    plain = solve(scene, cone)
    assert run.history[0].load_factor == pytest.approx(plain.load_factor, rel=1e-6)


@pytest.mark.exhaustive
def test_signed_conic_with_the_papers_weight_on_the_tuff_wall() -> None:
    """Meets the paper's criterion near the prototype's 0.3413, and wanders on within a few percent:
    which way depends on which of many forces a solver picks."""
    run = solve(builtin_scene("tuff-wall"), "conic", FixedPoint(moments="signed"))
    found = run.iteration
    assert found is not None
    assert found.met_at == pytest.approx(0.3413, rel=0.03)
    assert run.status is Status.NOT_CONVERGED
    assert 0.33 < found.lowest <= found.highest < 0.35


WANDERS = {"independent": random_wall(17), "paper": random_wall(2)}
"""Walls of some thirty contacts on which the iteration never settles under that reading."""


def small_changes(run: Solution, tolerance: float) -> list[bool]:
    return [h.change is not None and h.change <= tolerance for h in run.history]


@pytest.mark.parametrize("moments", WANDERS)
def test_the_band_is_that_of_the_last_iterates(moments: str) -> None:
    """Of those after the first twenty, and of twenty at least; told wherever the answer is."""
    for most in (4, 30, 60):
        rule = FixedPoint(max_iterations=most, tolerance=5e-4, moments=moments)
        run = solve(WANDERS[moments], "conic", rule)
        found = run.iteration
        assert found is not None
        assert run.status is Status.NOT_CONVERGED
        factors = [h.load_factor for h in run.history]
        assert found.last == min(most, max(20, most - 20))
        assert found.lowest == min(factors[-found.last :])
        assert found.highest == max(factors[-found.last :])
        assert run.load_factor is None  # wherever it is asked: nothing holds the last one
        assert result_to_dict(run)["load_factor"] is None
        assert said(run).value == "none"
        assert found.lowest <= factors[-1] <= found.highest
        small = small_changes(run, 5e-4)
        met = small.index(True) if any(small) else None
        assert (found.met_after, found.met_at) == (
            (None, None) if met is None else (met + 1, factors[met])
        )
        ends = f"{found.lowest:#.5g} to {found.highest:#.5g}"
        for told in (run.standing, run.note, repr(run), title(run)):
            assert f"last {found.last} iterates {ends}" in told
        assert result_from_dict(result_to_dict(run)).iteration == found
        assert run.to_dataframe("history").attrs["iteration"]["highest"] == found.highest


def test_only_five_small_changes_in_a_row_are_converged() -> None:
    """On walls that settle, that wander, and that meet the criterion on the way, at a tolerance
    which is met by chance; the bands of those that settled are no wider than the changes allow."""
    ends = set()
    for seed in (1, 2, 7, 8, 9, 10):  # which of them wander, rounding decides
        rule = FixedPoint(tolerance=2e-3, max_iterations=40)
        run = solve(random_wall(seed), "conic", rule)
        found = run.iteration
        assert found is not None
        small = "".join("x" if each else "." for each in small_changes(run, 2e-3))
        ends.add((run.status, "x" in small))
        assert small.find("xxxxx") in ((len(small) - 5,) if run.status.is_good else (-1,))
        if run.status.is_good:
            assert run.status is Status.CONVERGED
            assert found.last == 6
            assert found.width <= 5 * 2e-3
    assert {(Status.CONVERGED, True), (Status.NOT_CONVERGED, True)} <= ends


@pytest.mark.exhaustive_cases("0.8")
@pytest.mark.parametrize("weight", [0.0, 0.8])
def test_independent_signs_do_not_converge_and_it_says_so(weight: float) -> None:
    """Design section 3: with independent signs the tuff wall converges for no weight tried."""
    rule = FixedPoint(weight, max_iterations=12)
    run = solve(builtin_scene("tuff-wall"), method=rule)
    assert run.status in (Status.NOT_CONVERGED, Status.CYCLING)
    assert not run.status.is_good
    assert "certified" in run.note
    assert len(run.history) <= 12


def test_history_keeps_every_solve() -> None:
    run = solve(builtin_scene("tuff-wall"), method=FixedPoint(max_iterations=4))
    assert len(run.history) == 4
    factors = [h.load_factor for h in run.history]
    for before, after, entry in zip(factors, factors[1:], run.history[1:], strict=False):
        assert entry.change == pytest.approx(abs(after - before) / abs(after))
    assert run.history[0].change is None
    assert all(h.seconds > 0.0 and h.status for h in run.history)


def test_rows_and_cvxpy_give_the_same() -> None:
    """Parameters kept compiled by CVXPY (DPP), compiled afresh, and rows that are patched."""
    scene = builtin_scene("tuff-wall")
    pressure = Pressure.of(solve(scene).forces, scene.contacts)
    frozen = FrozenProblem(scene, Conic(), INDEPENDENT)
    factors = [frozen.solve(pressure, default_ladder()[0]).load_factor]
    for ignore_dpp in (False, True):
        assert run(frozen.problem.problem, default_ladder()[0], ignore_dpp).has_values
        scaled = float(frozen.problem.problem.value)
        factors.append(frozen.problem.scaling.load_factor(scaled))
    assert factors[1:] == pytest.approx(factors[:1] * 2, rel=1e-7)


@pytest.mark.exhaustive_cases("ended")
@pytest.mark.parametrize(
    "rule", [FixedPoint(max_iterations=3), FixedPoint()], ids=["stopped", "ended"]
)
def test_it_claims_no_bounds(rule: FixedPoint) -> None:
    """Those of its last frozen problem, 0.3434 on this wall, miss the certified [0.3628, 0.3642]:
    they are not bounds of the collapse load, wherever the iteration ends."""
    run = solve(builtin_scene("tuff-wall"), method=rule, moments="signed")
    assert (run.load_factor is not None) is (run.status is Status.CONVERGED)
    assert (run.lower, run.upper) == (-np.inf, np.inf)
    assert not run.bracket.has_any
    assert all(entry.lower is None and entry.upper is None for entry in run.history)
    assert "no bounds" in run.note
    assert " in " not in title(run).split(": ")[1]
    document = result_to_dict(run)
    assert (document["lower"], document["upper"]) == (None, None)


def test_without_bending_nothing_changes() -> None:
    """A block pushed at the height of its joint slides at mu, in every iterate.

    2e-5: pressure centred to what the solver's 1e-9 leaves of moments, over a small arm.
    """
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    block = Block.box("block", (0, 0, 0), (1, 1, 1), density=20.0)
    push = Load(forces={"block": (20.0, 0.0, 0.0, 0.0, -10.0, 0.0)})
    scene = Scene([ground, block], ["ground"], push, friction=0.5)
    for weight in (0.0, 0.8):
        run = solve(scene, method=FixedPoint(weight))
        assert run.status is Status.CONVERGED
        assert [h.load_factor for h in run.history] == pytest.approx([0.5] * len(run.history), 2e-5)


@pytest.mark.parametrize(
    ("factors", "cyclic"),
    [
        ([0.3, 0.1] * 3, True),
        ([0.3, 0.2, 0.1] * 3, True),
        ([0.3, 0.1] * 2, False),
        ([0.5, 0.4, 0.35, 0.33, 0.32, 0.31], False),
        ([0.3, 0.1, 0.3, 0.1, 0.3, 0.1001], False),
        ([0.3, None, 0.3, None, 0.3, None], False),
    ],
)
def test_cycles_are_recognised(factors: list[float | None], cyclic: bool) -> None:
    assert cycles(factors, 1e-4) is cyclic


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"old_value_weight": 1.0}, "old_value_weight must be at least 0 and below 1"),
        ({"old_value_weight": -0.1}, "old_value_weight"),
        ({"old_value_weight": np.nan}, "old_value_weight"),
        ({"tolerance": 0.0}, "tolerance must be between 0 and 1"),
        ({"max_iterations": 0}, "max_iterations must be at least 1"),
    ],
)
def test_refused_settings(settings: dict[str, float], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        FixedPoint(**settings)


def test_every_rung_has_a_budget() -> None:
    """No single solve of an iteration may run for ever: iterations of interior points, seconds of
    methods whose iterations are many (SCS once took eight minutes over one frozen problem)."""
    for rung in (*ladder_for("iterates"), *default_ladder(), *ladder_for("leading")):
        limits = {"max_iter", "max_iters", "time_limit_secs", "time_limit"} & set(rung.options)
        assert limits, rung
        if rung.name in ("SCS", "HIGHS"):
            assert limits & {"time_limit_secs", "time_limit"}


@pytest.mark.parametrize("rung", [r for r in cp.installed_solvers() if r in ("QOCO", "CLARABEL")])
@pytest.mark.parametrize("has_rows", [False, True])
def test_changed_parameters_reach_the_solver(rung: str, has_rows: bool) -> None:
    """Contacts pressed near their edges carry less; one kept solver object returned the same."""
    scene = builtin_scene("tuff-wall")
    frozen = FrozenProblem(scene, Conic(), INDEPENDENT)
    settings = SolverSettings(rung)
    frozen.set_pressure(Pressure.of(np.zeros((len(scene.contacts), 6)), scene.contacts))
    first = frozen.problem.run(settings, has_rows)
    assert first.forces is not None
    frozen.set_pressure(Pressure.of(first.forces, scene.contacts))
    again = frozen.problem.run(settings, has_rows)
    assert first.load_factor == pytest.approx(0.423056, rel=1e-4)
    assert again.load_factor is not None
    assert again.load_factor < 0.4


def test_least_forces_are_those_of_a_system_solved_by_hand() -> None:
    """A plank on three supports, pushed at its joints: it slides at mu whatever the supports carry.

    All slide, so V = mu N everywhere, and the least of the sum of (1 + mu^2) N^2 + (M2 / length)^2
    under sum N = W and moments about the centroid is a linear system in two unknowns.
    """
    at, mu, height = np.array([0.5, 2.2, 3.5]), 0.5, 0.4
    supports = [Block.box(f"s{x}", (x - 0.2, 0, -1), (x + 0.2, 0.3, 0)) for x in at.tolist()]
    plank = Block.box("plank", (0, 0, 0), (4, 0.3, height), density=20.0)
    push = Load(forces={"plank": (plank.weight, 0, 0, 0, -plank.weight * height / 2, 0)})
    scene = Scene([*supports, plank], [b.id for b in supports], push, friction=mu)
    found = FrozenProblem(scene, Conic(), INDEPENDENT, LeastForces(1e-3))
    state = found.solve(
        Pressure.of(np.zeros((3, 6)), scene.contacts),
        settings_for("CLARABEL"),
    )
    assert state.forces is not None
    length = found.problem.scaling.length
    weights = np.r_[np.full(3, 1.0 / (1.0 + mu**2)), np.full(3, length**2)]
    arms = np.vstack([np.r_[np.ones(3), np.zeros(3)], np.r_[at - 2.0, np.ones(3)]])
    least = weights * (arms.T @ np.linalg.solve(arms * weights @ arms.T, [plank.weight, 0.0]))
    np.testing.assert_allclose(state.forces[:, 2], least[:3], rtol=1e-4)
    np.testing.assert_allclose(np.abs(state.forces[:, 4]), np.abs(least[3:]), atol=1e-4)
    assert state.load_factor == pytest.approx(mu, rel=1e-6)


@pytest.mark.exhaustive
def test_least_forces_and_epsilon_bring_the_tuff_walls_ends_together() -> None:
    """Where the paper's criterion is met: 7e-3 apart with neither; 1e-4 is that criterion. They do
    not settle there, and that is told."""
    rule, scene = FixedPoint(epsilon=1e-2, regularisation=1e-3), builtin_scene("tuff-wall")
    ends = []
    for order in (0, 1):
        places = np.random.default_rng(order).permutation(len(scene.blocks))
        other = replace(scene, blocks=tuple(scene.blocks[i] for i in places))
        for solver in {"CLARABEL", "QOCO"} & set(cp.installed_solvers()):
            run = solve(other, method=rule, moments="signed", ladder=[solver])
            assert run.iteration is not None
            assert run.iteration.met_at is not None
            ends.append(run.iteration.met_at)
    assert np.ptp(ends) <= 1e-4 * np.median(ends)


@pytest.mark.parametrize("setting", ["epsilon", "regularisation"])
def test_refused_negative_settings(setting: str) -> None:
    with pytest.raises(InputError, match=f"{setting} must be finite and not negative"):
        FixedPoint(**{setting: -1e-3})


def pushed_off_its_middle(
    reactions: tuple[Reaction, ...] = (), ties: tuple[Tie, ...] = ()
) -> Scene:
    """A block of weight 20 that a force of 4 alpha bends, twists and slides."""
    ground = Block.box("ground", (-3, -1, -1), (5, 2, 0))
    block = Block.box("b", (0, 0, 0), (1, 1, 1), density=20.0)
    push = Load(points=[PointForce("b", (0.0, 0.8, 0.6), (4.0, 0.0, 0.0))])
    blocks = [ground, block]
    return Scene(blocks, ["ground"], push, friction=0.5, reactions=reactions, ties=ties)


@pytest.mark.parametrize("moments", ["independent", "signed", "signed-torsion-bending", "paper"])
@pytest.mark.parametrize("cone", [Conic(), Facets.circumscribed(8)], ids=str)
def test_a_force_against_the_push_takes_its_bound_off(moments: str, cone: Cone) -> None:
    """On the push's own line only 4 alpha - r counts, so that every iterate is that without it and
    most / 4. To 1e-6: each is solved to 1e-8 or so of a total load near 30."""
    rule = FixedPoint(moments=moments, max_iterations=8, old_value_weight=0.5)
    bare = solve(pushed_off_its_middle(), cone, rule)
    # eccentricities count: without interaction more is carried
    assert bare.history[-1].load_factor < 0.99 * bare.history[0].load_factor
    at, back = (1.0, 0.8, 0.6), (-1.0, 0.0, 0.0)
    for most in (1.0, 3.0):
        held = (
            pushed_off_its_middle((Reaction("b", at, back, most),)),
            pushed_off_its_middle((Reaction("b", at, back, most, -2.0),)),
            pushed_off_its_middle(ties=(Tie("ground", "b", (-2, 0.8, 0.6), (0, 0.8, 0.6), most),)),
        )
        for scene in held:
            found = solve(scene, cone, rule)
            for own, other in zip(found.history, bare.history, strict=False):
                expected = other.load_factor + most / 4.0
                assert own.load_factor == pytest.approx(expected, rel=1e-6)
            assert not found.bracket.has_any
            forces = found.forces[scene.contacts.is_point]
            assert not np.delete(forces, 2, axis=1).any()
            assert forces[:, 2].sum() == pytest.approx(-most if scene.ties else most, rel=1e-6)


@pytest.mark.parametrize("moments", ["independent", "signed", "paper"])
@pytest.mark.parametrize("cone", [Conic(), Facets.circumscribed(8)], ids=str)
def test_patched_rows_with_reactions(moments: str, cone: Cone) -> None:
    """Points have no row of Eq. 32; pressed at their centres, the others obey Eq. 24, which is the
    convex method's. Solved to 1e-8 and 1e-9."""
    wall = random_wall(1)
    top = wall.blocks[int(wall.free[-1])]
    prop = Reaction(top.id, tuple(top.centroid), (-1.0, 0.2, 0.0), top.weight, -0.5 * top.weight)
    scene = replace(wall, reactions=(prop,))
    plain = solve(scene, cone)
    frozen = FrozenProblem(scene, cone, parse_moments(moments))
    for share in (0.0, 1.0):
        pressed = plain.forces * [1, 1, 1, share, share, 1]
        frozen.set_pressure(Pressure.of(pressed, scene.contacts))
        assert_same_rows(frozen.problem)
        names = (*(own.name for own in blockwise()), "CLARABEL")
        found = [frozen.problem.run(settings_for(name, 1e-8)).load_factor for name in names]
        assert found[0] == pytest.approx(found[-1], rel=1e-6, abs=1e-6)
        if not share:
            assert found[-1] == pytest.approx(plain.load_factor, rel=1e-6)


@pytest.mark.parametrize("moments", ["independent", "signed", "paper"])
@pytest.mark.parametrize("cone", [Conic(), Facets.circumscribed(8)], ids=str)
def test_patched_rows_are_those_of_cvxpy(moments: str, cone: Cone) -> None:
    """Whatever the eccentricities were when the rows were written, at edges and corners too; and
    the answer is that of another solver: 1e-6 where one ends near 1e-7."""
    scene = random_wall(1)
    forces = solve(scene).forces
    frozen = FrozenProblem(scene, cone, parse_moments(moments))
    for share in (0.0, 0.5, 1.0):  # the last pressed at edges and corners
        frozen.set_pressure(Pressure.of(forces * [1, 1, 1, share, share, 1], scene.contacts))
        assert_same_rows(frozen.problem)
        found = [
            frozen.problem.run(settings_for(name, 1e-8)).load_factor
            for name in (*(own.name for own in blockwise()), "CLARABEL")
        ]
        assert found[0] == pytest.approx(found[-1], rel=1e-6, abs=1e-6)


def test_iterates_set_values_of_parameters_that_can_be_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One problem, and one value for each of its Parameters in every iterate; the rows are written
    once."""
    found: list[FrozenProblem] = []
    values: dict[str, int] = {}
    made, written, begin = 0, 0, FrozenProblem.__init__

    class Counted(cp.Parameter):
        @property
        def value(self) -> Any:
            return cp.Parameter.value.fget(self)

        @value.setter
        def value(self, new: Any) -> None:
            values[self.name()] = values.get(self.name(), 0) + (new is not None)
            cp.Parameter.value.fset(self, new)

    def kept(self: FrozenProblem, *arguments: Any, **options: Any) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(cp, "Parameter", Counted)
            begin(self, *arguments, **options)
        found.append(self)

    def counted(self: Rows, goal: Any) -> Any:
        nonlocal written
        written += self.theta.size > 1
        return write(self, goal)

    def problems(self: cp.Problem, *arguments: Any, **options: Any) -> None:
        nonlocal made
        made += 1
        start(self, *arguments, **options)

    write, start = Rows.written, cp.Problem.__init__
    monkeypatch.setattr(FrozenProblem, "__init__", kept)
    monkeypatch.setattr(Rows, "written", counted)
    monkeypatch.setattr(cp.Problem, "__init__", problems)
    run = solve(builtin_scene("tuff-wall"), method=FixedPoint(max_iterations=6), moments="signed")
    assert (len(found), written) == (1, 1)
    assert values == dict.fromkeys(found[0].parameters, len(run.history))
    assert made == 0  # the rows serve; the CVXPY problem is made when it is asked for
    assert {p.name() for p in found[0].problem.problem.parameters()} == set(values)
    assert made == 1


@COMPILED
@pytest.mark.parametrize("start", ["another scene's", "noise", "NaN", "far off", "on the boundary"])
def test_a_wrong_start_costs_time_only(start: str) -> None:
    """The answer is that of a cold start: both gaps are below 1e-8 of it."""
    scene = builtin_scene("tuff-wall")
    frozen, other = (FrozenProblem(s, Conic(), SIGNED) for s in (scene, random_wall(1)))
    settings = settings_for("BLOCKWISE", 1e-8)
    centred = Pressure.of(np.zeros((len(scene.contacts), 6)), scene.contacts)
    first = frozen.solve(centred, settings)
    pressure = Pressure.of(first.forces, scene.contacts)
    cold = FrozenProblem(scene, Conic(), SIGNED).solve(pressure, settings)
    rng = np.random.default_rng(0)
    changed = {
        "noise": lambda v: rng.normal(size=v.shape),
        "NaN": lambda v: np.where(rng.random(v.shape) < 0.01, np.nan, v),
        "far off": lambda v: 1e12 * v,
        "on the boundary": np.zeros_like,
    }
    if start in changed:
        point = Point(*map(changed[start], vars(frozen.problem._kept["middle"]).values()))
    else:
        other.solve(Pressure.of(np.zeros((len(other.contacts), 6)), other.contacts), settings)
        point = other.problem._kept["middle"]
    frozen.problem._kept["middle"] = point
    again = frozen.solve(pressure, settings)
    assert again.outcome.status == "optimal"
    assert again.load_factor == pytest.approx(cold.load_factor, rel=3e-8)
