"""The states that bounds refer to: held, they prove them by one certificate; false, nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, Solution, Status, builtin_scene, prove, solve
from cvxlimit.errors import InputError
from cvxlimit.io import result_from_dict
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.references import References
from cvxlimit.solution.bracket import Bracket, Reference
from cvxlimit.surfaces import Rocking, TorsionShear
from helpers import document, read
from intervals import leaning_cube

PUSH = Load(acceleration=(1, 0, 0))
SURFACES = [Rocking(), TorsionShear()]
BUTTRESS = builtin_scene("flying-buttress")


CASES: dict[str, tuple[Scene, dict[str, Any]]] = {
    "deeper state": (builtin_scene("ferris-tin-loi-2"), {"tolerance": 1e-8}),
    "state of projections": (builtin_scene("tuff-wall"), {}),
    "interval": (leaning_cube(), {}),
    "interval of an arch": (BUTTRESS.with_friction(0.3), {}),
    "rough solver": (builtin_scene("ferris-tin-loi-3"), {"solver": "SCS"}),
    "narrow": (builtin_scene("tuff-wall"), {"tolerance": 1e-8}),
}


@cache
def solved(case: str) -> Solution:
    scene, options = CASES[case]
    found = solve(scene, **options)
    if case == "state of projections":
        references = Certifier(scene, SURFACES).references
        states = references.dead_state, references.opening_field
        found = replace(found, reference=Reference(found.reference.load_factor, *states))
    return read(found)


@pytest.mark.parametrize("case", CASES)
def test_bounds_are_proved_without_a_solver(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    held, scene = solved(case), CASES[case][0]
    monkeypatch.setattr(LimitProgram, "run", lambda *_, **__: pytest.fail("a solver was asked"))
    proof = prove(held, scene)
    assert proof.is_proved, str(proof)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["facade", "house-corner"])
def test_what_a_rough_solver_leaves_is_proved(name: str) -> None:
    """Another state to refer to moves these bounds by more than a number may be off."""
    scene = builtin_scene(name)
    proof = prove(read(solve(scene, solver="SCS")), scene)
    assert proof.is_proved, str(proof)


def test_internal_states_are_held_and_proved() -> None:
    """Crushing of contacts that are no rectangles is stated in pressures on cells."""
    scene = three_sided_pier()
    held = read(solve(scene))
    assert held.reference is not None
    assert np.ndim(held.reference.forces) == 1
    assert prove(held, scene).is_proved


def three_sided_pier() -> Scene:
    ring = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
    faces = [[0, 1, 2], [3, 4, 5], [0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]]

    def prism(name: str, low: float, high: float, density: float | None = None) -> Block:
        corners = [(x, y, z) for z in (low, high) for x, y in ring]
        return Block.polyhedron(name, corners, faces, density)

    blocks = [prism("g", -1, 0), prism("p", 0, 3, 20.0)]
    return Scene(blocks, ["g"], PUSH, friction=0.9).with_strength(compressive=1000.0)


def test_a_problem_that_was_changed_holds_the_states_of_the_one_before() -> None:
    problem = solve(builtin_scene("arch")).problem
    first = problem.solve()
    problem.friction = 0.9 * first.scene.contacts.friction
    again = problem.solve()
    proof = prove(read(again), again.scene)
    assert proof.is_proved, str(proof)


# ------------------------------------------------- files without them


def test_files_of_versions_before_say_what_they_lack() -> None:
    held = replace(solved("interval"), reference=None)
    proof = prove(held, CASES["interval"][0])
    assert not proof.is_proved
    assert any("does not hold what its bounds refer to" in each.found for each in proof.missing)


@pytest.mark.parametrize("name", ["tuff-wall", "arch", "dome"])
def test_files_of_versions_before_are_proved_where_projections_find_states(name: str) -> None:
    scene = builtin_scene(name)
    assert prove(replace(read(solve(scene)), reference=None), scene).is_proved


# ------------------------------------------------- false states

Change = Callable[[Reference], Reference]


def forces(change: Callable[[Any], Any]) -> Change:
    return lambda held: replace(held, forces=change(np.array(held.forces)))


FALSE: dict[str, Change] = {
    "turned": forces(lambda x: -x),
    "pulling": forces(lambda x: x - 10.0 * np.abs(x).max()),
    "not a number": forces(lambda x: x * np.nan),
    "infinite": forces(lambda x: x + np.inf),
    "too few": forces(lambda x: x[:-1]),
    "too many": forces(lambda x: np.vstack([x, x])),
    "flat": forces(np.ravel),
    "of another scene": lambda _: Reference(0.1, np.ones((888, 6))),
    "rates of another scene": lambda held: replace(held, rates=np.ones((99, 6))),
}  # fmt: skip


@pytest.mark.parametrize("change", FALSE)
@pytest.mark.parametrize("case", ["state of projections", "interval of an arch"])
def test_false_states_are_refused(case: str, change: str) -> None:
    held = solved(case)
    assert held.reference is not None
    proof = prove(replace(held, reference=FALSE[change](held.reference)), CASES[case][0])
    assert not proof.is_proved
    assert all(check.found for check in proof.missing)


HARMLESS: dict[str, Change] = {
    "ten times": forces(lambda x: 10.0 * x),
    "a tenth": forces(lambda x: 0.1 * x),
    "zero": forces(lambda x: 0.0 * x),
    "noise": forces(lambda x: x + 0.1 * np.random.default_rng(0).normal(size=x.shape)),
    "rates that close": lambda held: replace(held, rates=-np.ones((1, 6))),
    "rates that are none": lambda held: replace(held, rates=np.full((1, 6), np.nan)),
    "another factor": lambda held: replace(held, load_factor=7.0),
    "no number": lambda held: replace(held, load_factor=np.nan),
    "none": lambda held: replace(held, load_factor=None),
}  # fmt: skip


@pytest.mark.parametrize("change", HARMLESS)
@pytest.mark.parametrize("factor", [1.11, 1.5, 100.0])
def test_no_state_proves_what_is_not_so(change: str, factor: float) -> None:
    """Friction ends the interval at 1.1, by hand: forces put into balance again are no better."""
    held, scene = solved("interval"), CASES["interval"][0]
    assert held.reference is not None
    given = replace(HARMLESS[change](held.reference), load_factor=factor)
    more = factor / 1.1
    higher = replace(held, reference=given, load_factor=more * held.load_factor,
                     forces=more * held.forces, bracket=replace(held.bracket, lower=factor,
                     upper=max(factor, held.upper)))  # fmt: skip
    lower = [c for c in prove(higher, scene).checks if c.claim.startswith("lower bound")]
    assert not any(check.is_met for check in lower)


def clamped() -> Scene:
    """A plug between the walls of a trough, which slides on the ground at its friction, 0.5."""
    ring = [(0, 0), (4, 0), (4, 2), (3, 2), (3, 1), (1, 1), (1, 2), (0, 2)]
    corners = [(x, y, z) for y in (0, 4) for x, z in ring]
    sides = [[i, i + 8, (i + 1) % 8 + 8, (i + 1) % 8] for i in range(8)]
    trough = Block.polyhedron("trough", corners, [[*range(8)], [*range(15, 7, -1)], *sides], 1.0)
    ground, plug = (
        Block.box("g", (-5, -5, -1), (9, 9, 0)),
        Block.box("plug", (1, 0, 1), (3, 4, 2), 1.0),
    )
    return Scene([ground, trough, plug], ["g"], PUSH, friction=0.5, name="clamped")


@pytest.mark.parametrize("squeeze", [1e3, 1e9, 1e11, 1e12, 1e13, 1e15])
@pytest.mark.parametrize("hidden", [1e-3, 1.0, 32.0])
def test_forces_of_any_size_hide_no_load(squeeze: float, hidden: float) -> None:
    """Beside forces with which two blocks press each other, 1e13 times their weights, what the
    ground bears too much would be rounding: mixed with these, the trough slid later than at 0.5."""
    scene = clamped()
    statics = Assemblage.of(scene).statics
    presses = np.abs(scene.contacts.axes[:, 2, 0]) > 0.5
    assert presses.sum() == 2
    pressed = np.zeros((len(presses), 6))
    pressed[presses, 2] = 1.0
    assert np.abs(statics.matrix @ pressed.ravel()).max() < 1e-12  # self-stress

    def carrying(factor: float, times: float) -> Any:
        load = statics.dead + factor * statics.live
        found = np.linalg.lstsq(statics.matrix.toarray(), -load, rcond=None)[0]
        return found.reshape(-1, 6) + times * pressed

    state = carrying(0.0, squeeze)
    state[0, 2] += hidden
    held = replace(
        solve(scene), load_factor=0.6, forces=carrying(0.6, 30.0), mechanism=None,
        status=Status.NOT_CERTIFIED, dilatancy=None, reference=Reference(0.6, state),
    )  # fmt: skip
    assert held.load_factor is not None
    share = 3.2 / (16.0 + 0.5 * hidden + 3.2)  # beyond friction, and what is to spare
    for lower in ((1.0 - share) * 0.6, 0.6):
        bracket = Bracket(lower, np.inf, True, False, held.bracket.least)
        proof = prove(replace(held, bracket=bracket), scene)
        assert not proof.is_proved, str(proof)


def test_a_state_with_live_load_serves_intervals_only() -> None:
    """Without its lower end it would not be said that the dead load falls alone."""
    held, scene = solved("interval"), CASES["interval"][0]
    assert not prove(replace(held, lower_end=None), scene).is_proved


def test_damaged_states_are_refused_on_reading() -> None:
    given = document(solved("state of projections"))
    for change, why in (
        ({"forces": [[1.0, 2.0]]}, "force on contact 0"),
        ({"forces": "none"}, "forces"),
        ({"forces": [[None] * 6]}, "V1"),
        ({"rates": [[1.0] * 7]}, "rates of free block 0"),
        ({"load_factor": "high"}, "load_factor"),
        ({"factor": 1.0}, "factor"),
    ):
        with pytest.raises(InputError, match=why):
            result_from_dict(given | {"reference": given["reference"] | change})


@pytest.mark.parametrize("name", ["tuff-wall", "arch", "dome"])
def test_every_state_is_held(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is sought to prove a result again, by projections neither."""
    scene = builtin_scene(name)
    held = read(solve(scene))
    monkeypatch.setattr(References, "_find_dead_state", lambda *_: pytest.fail("it is sought"))
    assert prove(held, scene).is_proved
