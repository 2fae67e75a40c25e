"""A picture is always drawn: of every built-in scene, of random ones, and where GEOS fails."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, seed, settings
from tests.kit.exhaustive import mostly_slow

from cvxlimit import Scene, Solution, builtin_scene, plotting, solve
from cvxlimit.errors import InputError
from cvxlimit.geometry import overlays
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting import PICTURES
from cvxlimit.plotting.look import Saved
from cvxlimit.plotting.visible import Faces
from helpers import scenes

DIAGONAL = (1.0, -2.0, 0.6)
"""From elsewhere than a camera would be put."""


def assert_drawn(made: Saved) -> None:
    kind = made.suffixes[0].removeprefix(".")
    assert len(made.file(kind)) > 1000


def assert_every_picture(scene: Scene) -> None:
    solution = solve(scene)
    assert_drawn(plotting.scene_figure(scene))
    assert_drawn(plotting.scene_page(scene))
    for name, draw in PICTURES.items():
        if name in PICTURES.places:  # an extension's, which has tests of its own
            continue
        options = {"frames": 4} if name == "animation" else {}
        if solution.forces is None or solution.mechanism is None:
            with suppress(InputError):  # what shows them is refused in a sentence
                assert_drawn(draw(solution, **options))
        else:
            assert_drawn(draw(solution, **options))
    assert_drawn(PICTURES["mechanism"](solution, magnification=7.0, viewer=DIAGONAL))


@pytest.mark.parametrize("name", mostly_slow(BUILTIN, ("single-block",)))
def test_of_every_built_in_scene(name: str) -> None:
    assert_every_picture(builtin_scene(name))


@pytest.mark.exhaustive
@seed(20)
@settings(max_examples=20, suppress_health_check=[HealthCheck.too_slow], database=None)
@given(scene=scenes())
def test_of_random_scenes(scene: Scene) -> None:
    assert_every_picture(scene)


@pytest.mark.exhaustive
@pytest.mark.parametrize("viewer", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
def test_straight_along_an_axis(viewer: tuple[float, ...]) -> None:
    """Where arrows are dots, and most faces lines."""
    solution = solve(builtin_scene("arch"))
    for name in sorted(PICTURES.keys() - PICTURES.places.keys() - {"page", "animation"}):
        assert_drawn(PICTURES[name](solution, viewer=viewer))


def test_from_where_nothing_but_glass_is_seen() -> None:
    """Supports are out of sight, and of blocks only lines are drawn: there are no faces."""
    assert Faces([]).visible().shape == (0,)
    line = np.array([[[0.0, 0, 0], [1, 1, 1]]])
    ends, number = Faces([]).visible_lines(line, 0.0)
    assert (len(ends), number.tolist()) == (1, [0])


# --- where GEOS fails ----------------------------------------------------------------------------


class Failing:
    """One of shapely's overlays, which refuses as GEOS does where ``fails`` says so."""

    def __init__(self, overlay, fails) -> None:
        self.overlay, self.fails, self.refused = overlay, fails, 0

    def __call__(self, *given, grid_size=None):
        if self.fails(given, grid_size):
            self.refused += 1
            raise shapely.GEOSException("TopologyException: found non-noded intersection")
        return self.overlay(*given, grid_size=grid_size)


def always(given, grid):
    return True


def exactly(given, grid):
    return grid is None


def many(given, grid):
    """Several at once, and a region less several."""
    return grid is None or isinstance(given[-1], (shapely.MultiPolygon, shapely.GeometryCollection))


FAILURES = {
    "on coordinates as they are": dict.fromkeys(("union_all", "intersection"), exactly),
    "all at once": {"difference": many, "union_all": exactly},
    "unions": {"union_all": always},
    "intersections on fine grids": {"intersection": lambda _, grid: grid is None or grid < 1e-4},
}
"""What may fail without any harm to the picture."""


def some_faces() -> Faces:
    """Rectangles any way round in a box: nearly all of them cut through others."""
    rng = np.random.default_rng(5)
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(25)]
    return Faces([rng.uniform(0.2, 1) * corners @ t.T + rng.uniform(-1, 1, 3) for t in turns])


@pytest.mark.parametrize("failures", FAILURES.values(), ids=FAILURES)
def test_other_ways_lead_to_the_same_picture(failures, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = some_faces().visible()
    made = {name: Failing(getattr(shapely, name), fails) for name, fails in failures.items()}
    for name, failing in made.items():
        monkeypatch.setattr(shapely, name, failing)
    found, size = some_faces().visible(), some_faces().size
    monkeypatch.undo()
    assert all(failing.refused for failing in made.values())
    apart = shapely.area(shapely.symmetric_difference(wanted, found))
    # A line's length times what the coarsest grid moves it by.
    assert apart.max() < size * max(overlays.COARSER) * some_faces().grid
    assert sum(shapely.area(found)) == pytest.approx(sum(shapely.area(wanted)), rel=1e-3)


@pytest.fixture(scope="module")
def arch() -> Solution:
    return solve(builtin_scene("arch"))


@pytest.mark.parametrize("name", ["union_all", "difference", "intersection"])
@pytest.mark.exhaustive_cases("difference")
def test_a_picture_is_drawn_where_overlays_fail(
    name: str, arch: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shapely, name, Failing(getattr(shapely, name), always))
    assert_drawn(arch.plot("mechanism"))


def test_joints_are_found_where_unions_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """A joint in pieces, one of them a hair's breadth wide: grouped on a coarser grid."""
    from cvxlimit.geometry.outlines import _bearing

    boxes = [(0, 0, 1, 1), (1, 0, 2, 1), (3, 0, 3 + 1e-7, 1)]
    pieces = [np.array([(a, b), (c, b), (c, d), (a, d)], dtype=float) for a, b, c, d in boxes]
    wanted = [[len(group), float(group[0][0, 0])] for group in _bearing(pieces, 1e-5)]
    assert wanted == [[2, 0.0], [1, 3.0]]
    grids: list[float] = []
    failing = Failing(shapely.union_all, lambda _, grid: len(grids) < 2 and not grids.append(grid))
    monkeypatch.setattr(shapely, "union_all", failing)
    assert [[len(group), float(group[0][0, 0])] for group in _bearing(pieces, 1e-5)] == wanted
    assert failing.refused == 2
    assert grids[0] < grids[1]
