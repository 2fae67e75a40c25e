"""What is easily written wrong in a surface of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from cvxlimit import Contacts, Status, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import single_block
from cvxlimit.surfaces import (
    Condition,
    Conic,
    Norm,
    Rocking,
    Sliding,
    TorsionShear,
    YieldSurface,
    coulomb,
)


class Forgetful(YieldSurface):
    """Its ``__init__`` does not call the base's."""

    name = "forgetful"

    def __init__(self, share: float) -> None:
        self.share = share

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        size = Norm({"V1": 1}, {"V2": 1})
        return [Condition([size], {"N": self.share * contacts.friction})]


class Constant(YieldSurface):
    """A constant where the contacts of the rows belong, or a number for a resistance."""

    name = "constant"

    def __init__(self, condition: Condition) -> None:
        super().__init__()
        self.condition = condition

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return self.condition and [self.condition]


def test_without_super_its_cone_is_the_circle() -> None:
    surface = Forgetful(0.5)
    assert surface.cone == Conic()
    found = solve(single_block(friction=0.4), [Rocking(), surface])
    assert found.load_factor == pytest.approx(0.2, rel=1e-5)


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (Condition([Norm({"V1": 1})], {}, 20.0), "must be the contact of each row, got 20.0"),  # type: ignore[arg-type]
        (Condition([Norm({"V1": 1})], 20.0), r"must state forces times numbers.*got 20.0"),  # type: ignore[arg-type]
    ],
)
def test_a_constant_in_the_wrong_place(condition: Condition, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        solve(single_block(), [Rocking(), Constant(condition)])


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        (Condition([Norm({"V1": 1})], {"N": 1.0}, np.array([-1])), "from 0 to 0, got array"),
        (Condition([Norm({"V1": 1})], {"N": 1.0}, np.array([1])), "from 0 to 0, got array"),
        (Condition([Norm({"V1": 1})], {"N": 1.0}, np.array([0.0])), "numbers of contacts"),
        (Condition([Norm()], {"N": 1.0}), "a Norm in surface 'constant' has no rows"),
        (Condition([Norm({"V1": 1})], {"N": "0.5"}), "must be a number, got '0.5'"),
        (Condition([Norm({"V1": 1})], {"N": cp.Variable(name="mu")}), "must not hold a variable"),
        (None, "must state Condition objects, got None"),
    ],
)  # fmt: skip
def test_what_is_no_condition_on_these_contacts(condition: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        solve(single_block(), [Rocking(), Constant(condition)])


@pytest.mark.parametrize(
    "most",
    [Condition([Norm({"V1": 1})], {"1": -0.2}), Condition([], {"N": -1.0, "1": -1.0})],
    ids=["negative", "pulled"],
)
def test_a_surface_that_admits_nothing_has_no_load_factor(most: Condition) -> None:
    """Also where solvers say that any load factor is carried, and forces carry the live load."""
    found = solve(builtin_scene("tuff-wall"), [Rocking(), Constant(most)])
    assert found.status is Status.NOT_CERTIFIED
    assert "'constant' admits no compression at contact 'ground-b1.1'" in found.note


def test_a_named_surface_is_no_polygon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A new name is known everywhere, and methods that state friction themselves refuse it."""
    monkeypatch.setitem(coulomb.SURFACES, "untwisted", (Rocking(), Sliding()))  # type: ignore[arg-type]
    scene = single_block(friction=0.3)
    found = solve(scene, surface="untwisted")
    assert found.surface == "untwisted"
    assert found.load_factor == pytest.approx(0.3, rel=1e-6)  # it slides before it rocks
    with pytest.raises(ModelError):
        solve(scene, surface="untwisted", method="fixed-point")
    with pytest.raises(ModelError, match=r"'untwisted'.*did you mean 'untwisted'"):
        solve(scene, surface="untwised")


class Small(Conic):
    """The circle, whose polar gauge is a tenth too small."""

    def polar_gauge_of(self, rows):
        return 0.9 * super().polar_gauge_of(rows)


class Narrow(Conic):
    """The circle, with an unknown that one of its matrices leaves out."""

    def rows_of(self, size):
        return np.zeros((0, 2 + size)), np.eye(1 + size)


@pytest.mark.parametrize(
    ("cone", "fault"),
    [(Small(), "polar gauge that is too small"), (Narrow(), "P and Q .* as many columns")],
)
def test_cones_on_which_no_bound_can_rest(cone: Conic, fault: str) -> None:
    """A false polar would prove 0.9 times what a slab carries by friction."""
    for surface in (cone, [Rocking(), TorsionShear(cone)]):
        with pytest.raises(ModelError, match=fault):
            solve(single_block(), surface)
