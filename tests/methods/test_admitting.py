"""Surfaces that admit nothing, or anything, end in a sentence that says so."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cvxlimit import LimitProblem, Scene, Status, Units, builtin_scene, solve
from cvxlimit.methods.admitting import _nothing as nothing
from cvxlimit.methods.admitting import unlimited
from cvxlimit.methods.driver import BOUNDLESS, Run
from cvxlimit.model.statics import Scaling
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface
from exhaustive import slow

SHEAR = Norm({"V1": 1}, {"V2": 1})


class Own(YieldSurface):
    """Conditions as given."""

    name = "own"

    def __init__(self, conditions: Callable[[Any], list[Condition]]) -> None:
        super().__init__()
        self._conditions = conditions

    def conditions(self, contacts: Any) -> list[Condition]:
        return self._conditions(contacts)


def both(scene: Scene, conditions: Callable[[Any], list[Condition]]) -> Any:
    surfaces = [Rocking(), Own(conditions)]
    return solve(scene, surfaces), LimitProblem(scene, surfaces).solve()


NOTHING: dict[str, Callable[[Any], list[Condition]]] = {
    "negative friction": lambda c: [Condition([SHEAR], {"N": -1.0 * c.friction})],
    "negative constant": lambda c: [Condition([SHEAR], {"1": -1.0})],
    "negative share": lambda c: [Condition([], {"N": -1.0})],
}


@pytest.mark.parametrize("kind", NOTHING)
@pytest.mark.parametrize("name", ["single-block", "stack", slow("tuff-wall"), slow("arch")])
def test_nothing_is_admitted(name: str, kind: str) -> None:
    for found in both(builtin_scene(name), NOTHING[kind]):
        assert found.status in (Status.NOT_CERTIFIED, Status.DEAD_LOAD_UNSTABLE)
        assert found.load_factor is None
        if found.status is Status.NOT_CERTIFIED:
            assert "surface 'own' admits no compression at contact 'ground-b" in found.note or (
                name == "arch" and "surface 'own' admits no compression" in found.note
            )
        else:
            assert "falls" in found.note


ANYTHING: dict[str, tuple[Callable[[Any], list[Condition]], str]] = {
    "no condition": (lambda c: [], "V1, V2 and MT"),
    "rocking again": (lambda c: [Condition([], {"N": 1.0})], "V1, V2 and MT"),
    "one way": (lambda c: [Condition([Norm({"V1": 1})], {"N": c.friction})], "V2 and MT"),
    "torsion alone": (lambda c: [Condition([Norm({"MT": 1})], {"N": c.friction})], "V1 and V2"),
}


@pytest.mark.parametrize("kind", ANYTHING)
def test_anything_is_admitted(kind: str) -> None:
    """A wall beside a rigid one, which shear without limit holds whatever pushes it."""
    conditions, free = ANYTHING[kind]
    for found in both(builtin_scene("tuff-wall"), conditions):
        assert found.status is Status.UNBOUNDED
        assert f"no surface limits {free}" in found.note


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_what_limits_shear_does_not_depend_on_the_unit_of_length(unit: float) -> None:
    scene = builtin_scene("tuff-wall").in_units(Units("of ours", "kN"), unit, 1.0)
    for share, free in ((1e-1, ["MT"]), (1e1, ["V1", "V2", "MT"])):
        most = share * BOUNDLESS * Scaling.of(scene).force
        run = Run(scene, [Rocking(), Own(lambda c, most=most: [Condition([SHEAR], {"1": most})])])
        assert [name for name in ("V1", "V2", "MT") if name in unlimited(run)] == free


def test_rows_of_a_condition_are_of_the_contact_that_they_name() -> None:
    """Two rows at each contact but the first, of which the last refuses all compression."""
    run = Run(builtin_scene("stack"))
    last = len(run.contacts) - 1
    at = np.repeat(np.arange(1, last + 1), 2)
    for rows in (at, at[::-1], np.arange(last + 1)[::-1]):
        refused = np.where(rows == last, -1.0, 1.0)
        own = Own(lambda c, rows=rows, n=refused: [Condition([], {"N": n}, rows)])
        assert f"no compression at contact {run.contacts.names[last]!r}" in nothing(own, run)


def test_a_resistance_without_components_is_none() -> None:
    """No shear at all: nothing is carried beside the dead load."""
    for resistance in ({}, {"1": 0.0}, {"N": 0.0}):
        for found in both(builtin_scene("stack"), lambda c, r=resistance: [Condition([SHEAR], r)]):
            assert found.status is Status.CERTIFIED
            assert found.load_factor == pytest.approx(0.0, abs=1e-9)
