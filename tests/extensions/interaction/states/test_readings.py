"""Readings of Eq. 30 written outside the package, and what every reading grants."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cvxlimit import Block, Load, Scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.masonry import random_wall
from cvxlimit.readings.moments import Moments, TiedMoments
from cvxlimit.readings.pressure import Pressure

FloatArray = NDArray[np.float64]


class Mine(TiedMoments):
    """Signed moments once more, as a stranger writes them."""

    name = "mine"

    def lever(self, e: FloatArray) -> FloatArray:
        return e


class MineWithTorsion(TiedMoments):
    """The paper's reading once more."""

    name = "mine with torsion"
    is_limited = True

    def lever(self, e: FloatArray) -> FloatArray:
        return np.stack([-np.abs(e[..., 0]), np.abs(e[..., 1])], axis=-1)


class Halfway(TiedMoments):
    """No reading of the package: torsion about a point half way to the pressure centre."""

    name = "halfway"

    def lever(self, e: FloatArray) -> FloatArray:
        return 0.5 * e


@pytest.mark.exhaustive_cases("mine1-paper")
@pytest.mark.parametrize(("mine", "theirs"), [(Mine(), "signed"), (MineWithTorsion(), "paper")])
def test_a_reading_from_outside_is_as_tight_as_one_inside(mine: Moments, theirs: str) -> None:
    """The same statement gives the same bracket, whoever wrote it: 1e-6 for solvers' rounding."""
    scene = random_wall(30)
    rule = Certified(branching_seconds=0.0)
    outside = solve(scene, method=rule, moments=mine)
    inside = solve(scene, method=rule, moments=theirs)
    assert outside.lower == pytest.approx(inside.lower, rel=1e-6)
    assert outside.upper == pytest.approx(inside.upper, rel=1e-6)
    assert outside.moments == mine.name


def test_its_bracket_holds_what_its_own_checker_admits() -> None:
    scene = random_wall(30)
    found = solve(scene, method=Certified(branching_seconds=0.0), moments=Halfway())
    assert found.lower <= found.upper
    assert found.bracket.is_proved
    assert Halfway().excess(found.forces, scene.contacts).max() <= 0.0
    strict = solve(scene, method=Certified(branching_seconds=0.0), moments="independent")
    assert strict.lower <= found.upper


class Curved(TiedMoments):
    name = "curved"

    def lever(self, e: FloatArray) -> FloatArray:
        return e * np.abs(e)


class Crossed(TiedMoments):
    name = "crossed"

    def lever(self, e: FloatArray) -> FloatArray:
        return e[..., ::-1]


@pytest.mark.parametrize("moments", [Curved(), Crossed()], ids=str)
def test_a_lever_of_another_kind_is_refused(moments: TiedMoments) -> None:
    """Bounds would not hold: convexity within quadrants is what they rest on."""
    with pytest.raises(ModelError, match=rf"lever of moments '{moments}' must be linear"):
        solve(random_wall(30), method="certified", moments=moments)


class Apart(Moments):
    """Both products on their own, one with a sign: no lever's torque."""

    name = "apart"

    def lever(self, e: FloatArray) -> FloatArray:
        return e

    def torque(self, forces: FloatArray, at: Pressure) -> FloatArray:
        v1, v2, mt = forces[:, 0], forces[:, 1], forces[:, 5]
        return np.abs(mt - at.centre[:, 0] * v2) + np.abs(at.centre[:, 1] * v1)


class Turned(Mine):
    """A lever with a torque of its own beside it."""

    name = "turned"
    torque = Apart.torque


class Signed(Halfway):
    """Another lever by the name of a reading of the package."""

    name = "signed"


@pytest.mark.parametrize(
    ("moments", "fault"),
    [
        (Apart(), "'apart' have a torque of their own"),
        (Turned(), "'turned' have a torque of their own"),
        (Signed(), "'signed' have the name of a reading of this package"),
    ],
)
def test_what_bounds_or_files_would_take_for_another_is_refused(
    moments: Moments, fault: str
) -> None:
    """Upper bounds know levers only: with other torques they excluded what single blocks carry."""
    for method in ("certified", "fixed-point"):
        with pytest.raises(ModelError, match=fault):
            solve(random_wall(30), method=method, moments=moments)  # type: ignore[arg-type]


def plus(live: tuple[float, ...]) -> Scene:
    """A block on a plus-shaped base, whose hull is an octagon."""
    a, b = 0.5, 0.15
    quarter = [(a, -b), (a, b), (b, b)]
    outline = [(x, y) for x, y in quarter]
    for _ in range(3):
        outline += [(-y, x) for x, y in outline[-3:]]
    n = len(outline)
    corners = [(x, y, z) for z in (0.0, 0.6) for x, y in outline]
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    faces = [list(range(n))[::-1], list(range(n, 2 * n)), *sides]
    ground = Block.box("ground", (-3, -3, -1), (3, 3, 0))
    block = Block.polyhedron("plus", corners, faces, 20.0)
    return Scene([ground, block], ["ground"], Load(forces={"plus": live}), friction=0.6)


@pytest.mark.exhaustive_cases("live0")
@pytest.mark.parametrize("live", [(0, 0, 0, 0, 0, 1.0), (0.3, 0.1, 0, 0, 0, 1.0)])
def test_independent_signs_are_never_weaker_than_no_interaction(live: tuple[float, ...]) -> None:
    """On a contact that is not convex too: its hull has a longer arm than itself. In pure torsion
    both agree, as there is no eccentricity."""
    scene = plus(live)
    plain = solve(scene)
    found = solve(scene, method=Certified(tolerance=1e-2), moments="independent")
    assert found.bracket.is_proved
    assert found.lower <= plain.upper * (1.0 + 1e-9)
    if not any(live[:2]):
        assert found.lower <= plain.lower * (1.0 + 1e-6) <= found.upper * (1.0 + 2e-6)


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["paper", "signed-torsion-bending"])
def test_polygons_close_under_readings_with_eq_27(name: str) -> None:
    """A plus-shaped contact: the bracket was 41 % wide in the median before cells were used."""
    found = solve(plus((1, 0.3, 0, 0, 0, 0.4)), method=Certified(tolerance=5e-2), moments=name)
    assert found.bracket.is_within(5e-2)
    assert found.bracket.is_proved
