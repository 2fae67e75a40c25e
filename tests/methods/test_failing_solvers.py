"""A solver's failure is not the structure's: every method says which solver failed, and how."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cvxlimit import FixedPoint, Load, Scene, Solution, Status, builtin_scene, settlement, solve
from cvxlimit.cli.main import run as command
from cvxlimit.errors import ModelError
from cvxlimit.masonry import single_block
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.solving import TABLE
from cvxlimit.solvers import Outcome, SolverSettings

NOWHERE = "failed: no way"


def _settled(scene: Scene) -> Solution:
    return settlement(scene, "ground", (0.0, 0.0, -1.0)).solution


EVERY: dict[str, Callable[[Scene], Solution]] = {
    **{name: lambda scene, name=name: solve(scene, method=name) for name in TABLE},  # type: ignore[misc]
    "settlement": _settled,
}
"""All methods by name, and what is no method but solves problems of its own."""

ASKING = [name for name in EVERY if name != "incremental"]
"""Those whose answer solvers find: the way from rest is followed by an engine of its own."""


@pytest.fixture
def nobody_solves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is asked, every solver breaks down."""

    def broken(*_: object, **__: object) -> Outcome:
        return Outcome(NOWHERE, 0.0, 0.0)

    monkeypatch.setattr("cvxlimit.model.program.run", broken)
    program = "cvxlimit.solvers.program.ConeProgram.solve"
    monkeypatch.setattr(program, lambda *_, **__: (broken(), None, None))


@pytest.mark.usefixtures("nobody_solves")
@pytest.mark.parametrize("name", ASKING)
def test_when_every_solver_fails(name: str) -> None:
    """No load factor, no bound, and no word about the structure or about assumptions."""
    solution = EVERY[name](single_block())
    assert solution.status is Status.SOLVER_FAILED
    assert solution.load_factor is None
    assert not solution.bracket.has_any
    assert "solver CLARABEL" in solution.note
    assert NOWHERE in solution.note
    assert "which says nothing about the structure" in solution.note
    assert "holds if" not in solution.note
    assert "eccentricities" not in solution.note


@pytest.mark.usefixtures("nobody_solves")
@pytest.mark.parametrize("name", [name for name in ASKING if name in TABLE])
@pytest.mark.exhaustive_cases("zero-dilatancy")
def test_the_command_line_says_so(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["solve", "single-block", "--method", name]) == 4
    assert NOWHERE in capsys.readouterr().err


@pytest.mark.usefixtures("nobody_solves")
def test_from_rest_without_solvers_there_is_no_proved_limit() -> None:
    """A block tips at b / h = 0.4, whoever solves; what solvers prove is left out."""
    pytest.importorskip("cvxlimit.extensions.incremental")
    solution = solve(single_block(), method="incremental")
    assert solution.load_factor == pytest.approx(0.4, rel=1e-6)
    assert solution.from_rest is not None
    assert solution.from_rest.limit is None


def test_settings_that_cannot_succeed() -> None:
    """A solver that CVXPY knows, with options it does not."""
    hopeless = SolverSettings("CLARABEL", {"no_such_option": 1}, "hopeless")
    solution = solve(single_block(), method="fixed-point", ladder=[hopeless])
    assert solution.status is Status.SOLVER_FAILED
    assert solution.note.startswith("solver hopeless: failed")


def test_a_failure_on_the_way_keeps_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """The iterates before it stand in the history, and the solver that failed is named."""
    from cvxlimit.solvers import program

    real, runs = program.attempted, []

    def failing_later(*arguments: Any) -> tuple[Outcome, Any]:
        runs.append(1)
        return real(*arguments) if len(runs) < 5 else (Outcome(NOWHERE, 0.0, 0.0), None)

    monkeypatch.setattr(program, "attempted", failing_later)
    rule = FixedPoint(moments="signed")
    solution = solve(builtin_scene("tuff-wall"), method=rule, ladder=["CLARABEL"])
    assert solution.status is Status.SOLVER_FAILED
    assert f"solver CLARABEL: {NOWHERE}" in solution.note
    assert any(iterate.load_factor is not None for iterate in solution.history)


ICY = single_block(friction=0.1).with_dead(Load(acceleration=(1.0, 0.0, -1.0)))
"""A block on an icy slope."""


def test_a_push_uphill_holds_a_block_on_an_icy_slope() -> None:
    """Friction of 0.1 either way; methods that need a dead load that stands alone say so."""
    uphill = ICY.with_live(Load(acceleration=(-1.0, 0.0, 0.0)))
    assert solve(uphill).interval == pytest.approx((0.9, 1.1))
    for name in TABLE.keys() - {"convex"}:
        with pytest.raises(ModelError, match="needs a dead load that stands alone"):
            EVERY[name](uphill)


@pytest.mark.parametrize("push", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)], ids=["down", "across"])
@pytest.mark.parametrize("name", EVERY)
def test_a_dead_load_that_cannot_stand(name: str, push: tuple[float, float, float]) -> None:
    """A block on an icy slope, whatever is asked of it."""
    solution = EVERY[name](ICY.with_live(Load(acceleration=push)))
    assert solution.status is Status.DEAD_LOAD_UNSTABLE, solution
    assert "block 'b1' falls" in solution.note
    assert solution.load_factor is None
    assert solution.mechanism is not None
    rates = solution.mechanism["b1"]
    assert np.dot(rates[:3], [1.0, 0.0, -1.0]) > 0.0


def test_a_slow_rung_beyond_the_budget_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """With solvers a thousand times as slow as they are, nobody is asked after the first bracket,
    which comes back."""
    row = vars(SolverSettings)["row"].func
    slow = property(lambda settings: replace(row(settings), pace=(1.0, 1.0)))
    monkeypatch.setattr(SolverSettings, "row", slow)
    scene, lines = builtin_scene("tuff-wall"), list[str]()
    short = solve(scene, method=Convex(tolerance=1e-15, budget=10.0), progress=lines.append)
    assert short.status is Status.NOT_CERTIFIED
    assert short.gap is not None
    assert short.gap < 1e-5
    assert "budget" in short.note
    assert any("left out" in line for line in lines)
