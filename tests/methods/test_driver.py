"""The driver of outer loops: a loop of a user's own, interruption, books and packing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import cvxpy as cp
import numpy as np
import pytest

from cvxlimit import Contacts, Load, Status, builtin_scene, solve
from cvxlimit.cli.report import verdict
from cvxlimit.errors import ModelError
from cvxlimit.io.results import result_from_dict, result_to_dict
from cvxlimit.masonry import single_block
from cvxlimit.methods.driver import Clock, Method, Run, Steps, drive
from cvxlimit.methods.fixed_point import cycles
from cvxlimit.model.program import LimitProgram
from cvxlimit.solution.bracket import Bracket
from cvxlimit.solution.said import said
from cvxlimit.solvers import SolverSettings, default_ladder
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface
from cvxlimit.surfaces.base import product
from exhaustive import slow
from falling import FALLING, GOOD, STOPPED, UNKNOWN, assert_falls

# An outer loop of a user's own: friction that slides without opening (Gilbert et al. 2006).


class Rotated(YieldSurface):
    """abs(V) + abs(MT) / c_T <= (1 + eta) mu n - eta mu N, with n from the last solve."""

    name = "rotated"

    def __init__(self, eta: float, pressed: cp.Parameter) -> None:
        super().__init__()
        self.eta, self.pressed = eta, pressed

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        norms = [Norm({"MT": 1 / contacts.torsion_arm}), Norm({"V1": 1}, {"V2": 1})]
        mu = contacts.friction
        last = product((1.0 + self.eta) * mu, self.pressed)
        return [Condition(norms, {"N": -self.eta * mu, "1": last})]


@dataclass(frozen=True)
class NonAssociative(Method):
    """Shrinks the friction cone to the normal forces of the last solve until both agree."""

    name: ClassVar[str] = "non-associative"
    axis: ClassVar[str] = "flow"

    eta: float = 0.01
    old_value_weight: float = 0.6
    tolerance: float = 1e-4
    max_iterations: int = 60

    def steps(self, run: Run) -> Steps:
        first = run.solve(LimitProgram(run.assemblage).run, default_ladder()[0])
        run.note(first, "associated")
        assert first.forces is not None
        pressed = cp.Parameter(len(run.contacts), nonneg=True, value=first.forces[:, 2].clip(0.0))
        problem = LimitProgram(run.assemblage, (Rocking(), Rotated(self.eta, pressed)))
        run.remarks = ["one of many solutions without dilatancy"]
        for _ in range(self.max_iterations):
            new, rung = run.try_solvers(problem.run, run.ladder or default_ladder())
            run.note(new, rung)
            if new.forces is None:
                continue
            run.best = replace(run.best, load_factor=new.load_factor, forces=new.forces)
            normal, shear = new.forces[:, 2], np.hypot(*new.forces[:, :2].T)
            shear = shear + np.abs(new.forces[:, 5]) / run.contacts.torsion_arm
            beta = self.old_value_weight
            pressed.value = beta * pressed.value + (1.0 - beta) * normal.clip(0.0)
            yield
            over = float((shear - run.contacts.friction * normal).max())
            if over <= self.tolerance * run.scaling.force:
                return Status.CONVERGED
            if cycles(run.load_factors, self.tolerance):
                return Status.CYCLING
        return Status.NOT_CONVERGED


class TestALoopOfAUsersOwn:
    @pytest.mark.parametrize("friction", [0.2, 0.35])
    def test_a_block_that_slides(self, friction: float) -> None:
        """Its normal force is its weight, whatever the flow rule: mu."""
        run = solve(single_block(friction=friction), method=NonAssociative())
        assert run.status is Status.CONVERGED
        assert run.load_factor == pytest.approx(friction, rel=1e-4)
        assert (run.flow, run.interaction) == ("non-associative", "none")
        assert not run.bracket.has_any
        assert "clarabel" in run.versions

    @pytest.mark.parametrize(("wall", "found"), [(1, 0.639918), (3, 0.355917)])
    def test_walls_of_ferris_and_tin_loi(self, wall: int, found: float) -> None:
        """Below the associated factor, as published for this loop in the plane: solutions are not
        unique, and the path is another one in space, so 2 % is all that can be asked."""
        scene = builtin_scene(f"ferris-tin-loi-{wall}")
        run = solve(scene, method=NonAssociative())
        assert run.load_factor == pytest.approx(found, rel=0.02)
        assert run.load_factor < solve(scene).load_factor
        assert run.history[0].solver == "associated"
        assert len(run.history) > 2

    def test_its_tolerance_is_set_from_outside(self) -> None:
        run = solve(
            single_block(friction=0.2), method=NonAssociative(max_iterations=1), tolerance=0.9
        )
        assert run.status is Status.CONVERGED

    def test_a_rule_without_tolerance_says_so(self) -> None:
        with pytest.raises(ModelError, match="tolerance does nothing for method 'stopping'"):
            solve(single_block(), method=Stopping(0), tolerance=0.1)


# Interruption.


@dataclass(frozen=True)
class Stopping(Method):
    """Raises its bounds step by step until somebody presses Ctrl-C."""

    name: ClassVar[str] = "stopping"

    steps_before: int
    proves: bool = True

    def steps(self, run: Run) -> Steps:
        for number in range(1, self.steps_before + 1):
            if self.proves:
                forces = np.zeros((len(run.contacts), 6))
                run.best = run.best.raised(0.1 * number, True, 0.1 * number, forces)
            run.remarks = [f"{number} steps"]
            yield
        raise KeyboardInterrupt


class TestInterruption:
    def test_the_best_so_far_is_returned(self) -> None:
        run = solve(single_block(), method=Stopping(3))
        assert run.status is Status.INTERRUPTED
        assert run.status.has_answer
        assert not run.status.is_good
        assert run.bracket.lower == run.load_factor == pytest.approx(0.3)
        proved = "the lower bound is proved, up to rounding"
        assert run.note == f"{Status.INTERRUPTED.advice}; {proved}; 3 steps"

    @pytest.mark.parametrize("rule", [Stopping(0), Stopping(2, proves=False)])
    def test_without_bounds_it_is_passed_on(self, rule: Stopping) -> None:
        with pytest.raises(KeyboardInterrupt):
            solve(single_block(), method=rule)


# Books.


def test_phases_inside_phases_count_once(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(range(100))
    monkeypatch.setattr("cvxlimit.methods.driver.time.perf_counter", lambda: float(next(now)))
    clock = Clock()  # 0
    with clock.phase("certify"), clock.phase("solve"):  # 1 to 4, 2 to 3
        pass
    assert clock.seconds == {"detect": 0.0, "compile": 0.0, "solve": 1.0, "certify": 2.0}


CROSSED = {
    "both assumed": ((0.018587, False), (9.4266e-5, False)),
    "lower proved": ((0.5, True), (0.3, False)),
    "upper proved": ((0.5, False), (0.3, True)),
    "about zero": ((1e-3, False), (-1e-3, False)),
    "by little": ((0.3 * (1.0 + 1e-6), False), (0.3, True)),
}


class Crossing(Stopping):
    """Ends with a lower bound above an upper one, whatever it calls that."""

    def __init__(self, ends: tuple[tuple[float, bool], tuple[float, bool]], status: Status) -> None:
        super().__init__(0)
        object.__setattr__(self, "ends", ends)
        object.__setattr__(self, "status", status)

    def steps(self, run: Run) -> Steps:
        (lower, low), (upper, up) = self.ends  # type: ignore[attr-defined]
        forces, rates = np.ones((len(run.contacts), 6)), np.ones((len(run.scene.free), 6))
        run.best = run.best.raised(lower, low, lower, forces).lowered(upper, up, rates)
        yield
        return self.status  # type: ignore[attr-defined]


@pytest.mark.parametrize("status", [Status.CERTIFIED, Status.NOT_CERTIFIED, Status.INTERRUPTED])
@pytest.mark.parametrize("name", CROSSED)
def test_bounds_that_contradict_each_other_are_no_answer(name: str, status: Status) -> None:
    """An assumption behind one fails: neither is used, in Python, text, JSON or on the page."""
    found = drive(Crossing(CROSSED[name], status), Run(single_block()))
    assert found.status is Status.CONTRADICTED
    assert (found.lower, found.upper, found.load_factor) == (-np.inf, np.inf, None)
    assert found.forces is None
    assert found.mechanism is None
    told, held = said(found), result_to_dict(found)
    assert held["status"] == "bounds contradict each other"
    assert (held["lower"], held["upper"], held["load_factor"]) == (None, None, None)
    assert result_from_dict(held).status is Status.CONTRADICTED
    texts = [told.value, told.standing, told.headline, found.note, repr(found), verdict(found)]
    texts.append(re.sub("<[^>]*>", "", found.report()))
    for text in texts[1:]:
        assert "bounds contradict each other" in text
    for number in (f"{end:.4g}" for end, _ in CROSSED[name]):
        assert not any(number in text for text in texts[:-1])
    assert "use its bounds" not in " ".join(texts)


def test_a_bracket_that_equilibrium_cannot_tell_from_zero_is_closed() -> None:
    """Forces count as balanced with 1e-11 of the loads left; above that, widths are relative."""
    assert Bracket(3e-14, 8e-13, least=1e-6).is_within(1e-5)
    assert not Bracket(3e-10, 8e-10, least=1e-6).is_within(1e-5)


def test_the_ladder_is_climbed_until_there_are_forces() -> None:
    ladder = [SolverSettings("NO_SUCH_SOLVER"), *default_ladder()]
    run = Run(single_block(), ladder=ladder)
    state, rung = run.try_solvers(LimitProgram(run.assemblage).run, ladder)
    assert state.forces is not None
    assert rung.name == "CLARABEL"
    assert run.solvers == {"NO_SUCH_SOLVER", "CLARABEL"}


def test_what_an_own_loop_may_not_combine() -> None:
    scene = single_block()
    with pytest.raises(ModelError, match="own formulation"):
        solve(scene, method="fixed-point", formulation=lambda contacts: None)  # type: ignore
    with pytest.raises(ModelError, match="has no cohesion"):
        solve(scene.with_cohesion(1.0), method="fixed-point")


# Late proofs that there is no answer.


def test_an_upper_bound_below_zero_found_late_is_a_fall() -> None:
    """Rungs that answer nothing leave the question open until a good one answers it."""
    scene = FALLING["overhang"]().with_live(Load(acceleration=(1.0, 0.0, 0.0)))
    solution = solve(scene, ladder=[STOPPED, UNKNOWN, GOOD])
    assert_falls(solution, scene)
    assert (solution.bracket, solution.load_factor) == (Bracket(), None)


@pytest.mark.exhaustive
@pytest.mark.parametrize("moments", ["independent", slow("signed")])
def test_a_fall_that_only_branching_finds(moments: str) -> None:
    """Pressed at a quarter of its side and twisted: c there is 0.2966 (design: c(1, 0.5)), the hull
    of all states has 0.3163 between centre and edge, and the dead load needs 0.306."""
    block = single_block((1.0, 1.0, 0.5), friction=0.6, live=Load(acceleration=(0.1, 0.0, 0.0)))
    weight = block.total_weight
    torque = 0.306 * 0.6 * weight
    twisted = Load(gravity=(0, 0, -1), forces={"b1": (0, 0, 0, 0, 0.25 * weight, torque)})
    solution = solve(block.with_dead(twisted), method="certified", moments=moments)
    assert solution.status is Status.DEAD_LOAD_UNSTABLE
    assert (solution.bracket, solution.load_factor) == (Bracket(), None)
    assert "branch and bound" in solution.note
    less = Load(gravity=(0, 0, -1), forces={"b1": (0, 0, 0, 0, 0.25 * weight, 0.95 * torque)})
    stands = solve(block.with_dead(less), method="certified", moments=moments)
    assert stands.status is Status.CERTIFIED
    assert stands.lower > 0.0
