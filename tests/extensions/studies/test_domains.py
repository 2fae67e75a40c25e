"""Load domains: closed forms, cases of geometry, and no contradiction with single solves."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvxlimit import (
    GRAVITY,
    Block,
    Load,
    Reaction,
    Scene,
    Status,
    Tie,
    builtin_scene,
    prove,
    solve,
)
from cvxlimit.errors import InputError, ModelError
from cvxlimit.scene.loads import combined
from cvxlimit.studies import (
    LoadDomain,
    compare_domains,
    load_domain,
    read_domain,
    write_domain,
)
from helpers import scenes

X, Y, Z = (Load(acceleration=axis) for axis in np.eye(3))
SLOPE = np.radians(30.0)
TILTED = Load(gravity=(np.sin(SLOPE), 0.0, -np.cos(SLOPE)))


def block(height: float = 2.5, friction: float = 0.7, dead: Load = GRAVITY) -> Scene:
    """A tower of base 1 x 1 on the ground."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    tower = Block.box("tower", (0, 0, 0), (1, 1, height), density=20.0)
    return Scene([ground, tower], ["ground"], X, dead, friction=friction)


def held_block() -> Scene:
    """A tower that leans on a wall at its back, towards which it can be pushed at will."""
    wall = Block.box("wall", (-1, 0, 0), (0, 1, 2.5))
    scene = block()
    return Scene([*scene.blocks, wall], ["ground", "wall"], X, friction=0.7)


def domain_of(scene: Scene, loads: Any = None, **options: Any) -> LoadDomain:
    return load_domain(scene, loads, progress=False, **options)


def assert_agrees(domain: LoadDomain, scene: Scene, directions: Sequence[Any]) -> None:
    """No bracket of a single solve may lie beyond the domain's; 1e-8 is put down to rounding."""
    loads = list(domain.loads.values())
    for direction in directions:
        solution = solve(scene.with_live(combined(loads, direction)), domain.surface)
        found = domain.load_factor(direction)
        if solution.status is Status.UNBOUNDED:
            assert found.upper == np.inf, (direction, found, solution)
        if solution.load_factor is None:
            continue
        unit = max(abs(solution.upper), found.least)
        assert found.lower <= solution.upper + 1e-8 * unit, (direction, found, solution)
        assert found.upper >= solution.lower - 1e-8 * unit, (direction, found, solution)


def around(domain: LoadDomain, number: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(number, len(domain.units))) * domain.units


def assert_consistent(domain: LoadDomain, directions: Sequence[Any]) -> None:
    """``contains`` says of points on a line what ``load_factor`` says of the line."""
    stands = domain.contains(0.0 * np.asarray(directions[0])) == "carried"
    for direction in directions:
        found = domain.load_factor(direction)
        for share in (0.5, 0.99, 1.01, 2.0, 1e3):
            for bound in (found.lower, found.upper):
                if not np.isfinite(bound) or bound <= 0.0:
                    continue
                said = domain.contains(share * bound * np.asarray(direction))
                if stands:
                    assert said != "not carried" or share * bound > 0.995 * found.lower
                assert said != "carried" or share * bound < 1.005 * found.upper
        if found.lower == np.inf:
            assert domain.contains(1e3 * np.asarray(direction)) == "carried"


def propped(seed: int) -> tuple[Scene, list[Load]]:
    """A pile of one to three blocks that a prop, soil or a tie holds, and two or three loads."""
    rng = np.random.default_rng(seed)
    blocks, low, shift = [Block.box("g", (-5, -5, -1), (9, 9, 0))], 0.0, np.zeros(2)
    for i in range(rng.integers(1, 4)):
        sides = rng.uniform(0.3, 1.0, 3)
        corner = np.append(shift + rng.uniform(-0.1, 0.1, 2), low)
        blocks.append(Block.box(f"b{i}", corner, corner + sides, density=rng.uniform(5, 25)))
        low += sides[2]
    top = blocks[-1]
    at = tuple(top.vertices.min(axis=0) + rng.uniform(0, 1, 3) * np.ptp(top.vertices, axis=0))
    way = [(0, 0, -1), (1, 0, 0), (0, -1, 0), tuple(rng.normal(size=3))][rng.integers(4)]
    most = [np.inf, rng.uniform(0.1, 5.0), 2.0][rng.integers(3)]
    held: dict[str, Any] = {
        "reactions": [Reaction(top.id, at, way, most, on=rng.choice(["g", None]))]
    }
    if rng.random() < 0.3:
        held = {"ties": [Tie(top.id, "g", tuple(top.centroid), (0.6, 0, -0.8), 3.0)]}
    loads = [Load(acceleration=tuple(rng.normal(size=3))) for _ in range(rng.integers(2, 4))]
    return Scene(blocks, ["g"], X, friction=rng.uniform(0.3, 0.9), **held), loads


def prop() -> tuple[Scene, list[Load]]:
    """A block under a prop that presses it down at an edge, as hard as one likes: the loads that
    are carried fill half of the plane, whose edge two rays make that are opposite to rounding."""
    ground = Block.box("g", (-5, -5, -1), (9, 9, 0))
    stone = Block.box("b0", (0, 0, 0), (0.801, 0.408, 0.305), density=5.67)
    at = (0.0, 0.08006708431363757, 0.29798032798353963)
    held = Reaction("b0", at, (0, 0, -1), np.inf, on="g")
    live = Load(acceleration=(-1, 0, 0))
    scene = Scene([ground, stone], ["g"], live, friction=0.794, reactions=[held])
    return scene, [live, Load(acceleration=(-0.35, -0.5, 1.19))]


# Closed forms


def rocking_and_sliding(direction: np.ndarray, height: float, friction: float) -> float:
    """It rocks about an edge of its base, or slides: |a_x|, |a_y| <= 1 / h, norm <= mu."""
    rocks = (1.0 / height) / np.abs(direction).max()
    return float(min(rocks, friction / np.linalg.norm(direction)))


@pytest.mark.parametrize(("height", "friction"), [(2.5, 0.7), (2.0, 0.6), (1.0, 0.5)])
def test_a_block_rocks_or_slides(height: float, friction: float) -> None:
    """Square, square with rounded corners, circle."""
    domain = domain_of(block(height, friction), tolerance=0.02)
    assert domain.status is Status.CERTIFIED
    assert domain.is_proved
    assert domain.gap <= 0.02
    for direction in around(domain, 200):
        found = domain.load_factor(direction)
        exact = rocking_and_sliding(direction, height, friction)
        assert found.lower <= exact * (1 + 1e-9)
        assert found.upper >= exact * (1 - 1e-9)
        assert found.width <= 0.02 + 1e-9


@pytest.mark.parametrize("scene", [block(), builtin_scene("stack")])
def test_polygons_are_exact(scene: Scene) -> None:
    """Rocking alone: a square, met to 1e-6 from both sides."""
    top = max(b.vertices[:, 2].max() for b in scene.blocks)
    base = min(np.ptp(scene.blocks[i].vertices[:, 0]) for i in scene.free)
    side = float(base / top)
    domain = domain_of(scene, tolerance=1e-6)
    for direction in around(domain, 50):
        exact = side / np.abs(direction).max()
        found = domain.load_factor(direction)
        assert found.lower == pytest.approx(exact, rel=1e-6)
        assert found.upper == pytest.approx(exact, rel=1e-6)


def test_a_point_is_carried_or_not_or_open() -> None:
    domain = domain_of(block(1.0, 0.5), tolerance=0.05)
    assert domain.contains((0.3, 0.3)) == "carried"
    assert domain.contains((0.4, 0.4)) == "not carried"
    _, worst = domain.worst
    bracket = domain.load_factor(worst)
    assert domain.contains(0.5 * (bracket.lower + bracket.upper) * worst) == "open"


# Cases of geometry


def test_no_end_where_forces_alone_show_it() -> None:
    """Pressed down, a block bears any weight: beside it |a_x| grows at 1 / h times that."""
    domain = domain_of(block(), {"x": X, "z": Z})
    assert domain.load_factor((0, -1)).lower == np.inf
    assert domain.load_factor((0.39, -1.0)).lower == np.inf
    sideways = domain.load_factor((0.41, -1.0))
    assert sideways.upper == pytest.approx(0.4 / (0.41 - 0.4), rel=1e-5)
    assert domain.load_factor((0, 1)).upper == pytest.approx(1.0, rel=1e-6)
    assert all(s.solution.status is Status.UNBOUNDED for s in domain.supports
               if s.ray is not None and s.solution is not None)  # fmt: skip


def test_a_cone_of_three_loads() -> None:
    """A block that slides: |a_x|, |a_y| within a circle that grows with its weight, 1 - a_z."""
    domain = domain_of(block(1.0, 0.5), {"x": X, "y": Y, "z": Z}, tolerance=0.2)
    assert domain.status is Status.CERTIFIED
    for direction in around(domain, 100):
        slope = np.linalg.norm(direction[:2]) / 0.5 + direction[2]
        exact = 1.0 / slope if slope > 0.0 else np.inf
        found = domain.load_factor(direction)
        assert found.lower <= exact * (1 + 1e-9)
        assert found.upper >= exact * (1 - 1e-9)
        assert exact > 100.0 or found.width <= 0.2 + 1e-9


def test_a_wall_behind_takes_any_push() -> None:
    scene = held_block()
    domain = domain_of(scene, tolerance=0.02)
    assert domain.load_factor((-1, 0)).lower == np.inf
    assert domain.load_factor((1, 0)).width <= 0.02
    assert_agrees(domain, scene, around(domain, 6))


UNBOUNDED = {
    "leaning": (held_block(), None), "pressed": (block(), {"x": X, "z": Z}),
    "pressed on a slope": (block(1.0, 0.3, TILTED), {"x": X, "z": Z}),
    "tuff wall": (builtin_scene("tuff-wall"), None),
    "in space": (block(1.0, 0.5), {"x": X, "y": Y, "z": Z}),
}  # fmt: skip


@pytest.mark.parametrize("name", UNBOUNDED)
@pytest.mark.exhaustive_cases("in space", "tuff wall")
def test_what_has_no_end_is_carried_and_ruled_out_as_far_as_anyone_asks(name: str) -> None:
    """In twenty random directions, up to a million times their natural size: the dead load with
    these loads beside it stands, or it does not."""
    scene, loads = UNBOUNDED[name]
    domain, told = domain_of(scene, loads, tolerance=0.05), []
    rng = np.random.default_rng(4)
    for direction in around(domain, 20, seed=3):
        bracket = domain.load_factor(direction)
        assert (str(bracket) == "unbounded") == (bracket.lower == np.inf)
        far = 100.0 if name == "tuff wall" else 10.0 ** rng.uniform(2.0, 6.0)
        load = combined([scene.dead, *domain.loads.values()], [1.0, *far * direction])
        found = solve(replace(scene, dead=load, live=Load(acceleration=(1, 2, 0))))
        stands = found.status is not Status.DEAD_LOAD_UNSTABLE and found.interval is None
        told.append(domain.contains(far * direction))
        assert told[-1] in ("open", "carried" if stands else "not carried"), (far, direction)
    assert told.count("open") <= 0.05 * len(told)


def test_unbounded_and_nothing_are_words_and_unknown_is_a_question_mark() -> None:
    extent = domain_of(held_block(), tolerance=0.1).extent()
    assert extent["-a_x"] == "unbounded"
    assert extent["a_x"].startswith("[0.5")
    beside = domain_of(block(1.0, 0.3, TILTED)).extent()  # only a push up the slope holds it
    assert beside["a_y"] == beside["-a_y"] == "none"
    assert beside["-a_x"].startswith("[0.75")
    begun = domain_of(held_block(), tolerance=0.1)
    begun = replace(begun, supports=begun.supports[:1])
    assert begun.extent()["a_y"] == "[?, ?]"
    assert begun.extent()["-a_x"].endswith(", ?]")


@pytest.mark.parametrize("name", ["leaning", "pressed on a slope", "tuff wall"])
def test_a_picture_shows_what_the_domain_says_up_to_its_edges(name: str) -> None:
    """Every place of the picture is in the dark area if it is carried, and in none if it is ruled
    out; lines that end a set in the picture end it in truth; and what has an end takes its part."""
    domain = domain_of(*UNBOUNDED[name], tolerance=0.01)
    axes = domain.plot().axes[0]
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    outer, inner = (patch.get_path() for patch in axes.patches)
    places = np.random.default_rng(1).uniform(low, high, (300, 2))
    for place in places:
        said = domain.contains(place)
        assert inner.contains_point(place) == (said == "carried")
        assert outer.contains_point(place) == (said != "not carried")
    for line in (inner.vertices, outer.vertices):
        for start, end in pairwise(line):
            middle = 0.5 * (start + end)
            if ((middle > low) & (middle < high)).all():
                assert domain.contains(middle + 0.02 * (middle - places.mean(axis=0))) != "carried"
    ends = [domain.load_factor(way).upper for way in (*np.eye(2), *-np.eye(2))]
    about = np.linalg.norm(domain.points, axis=1).min() * (domain.contains((0, 0)) != "carried")
    assert (high - low).max() < 8.0 * max(about, *filter(np.isfinite, ends))  # six, and a margin


def test_rays_that_are_opposite_but_for_rounding_make_no_plane() -> None:
    """What ends by a solve ends here, and what has no end there has none, around the circle."""
    scene, loads = prop()
    domain = domain_of(scene, loads)
    turns = np.linspace(0.0, 2.0 * np.pi, 10, endpoint=False)
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    assert_agrees(domain, scene, circle)
    assert_consistent(domain, circle)
    assert domain.load_factor((0, 1)).upper < 1.0


def test_a_third_load_that_adds_nothing() -> None:
    """None at all, or the sum of the others: any multiple of what is no load is carried."""
    plain = domain_of(block())
    for third, idle in ((Load(), (0, 0, 1)), (Load(acceleration=(1, 1, 0)), (1, 1, -1))):
        domain = domain_of(block(), {"x": X, "y": Y, "third": third})
        assert domain.load_factor(idle).lower == np.inf
        assert domain.load_factor(np.negative(idle)).lower == np.inf
        for direction in around(plain, 20):
            exact = plain.load_factor(direction)
            found = domain.load_factor((*direction, 0.0))
            assert found.lower == pytest.approx(exact.lower, rel=1e-6)
            assert found.upper == pytest.approx(exact.upper, rel=1e-6)


def test_without_friction_there_is_one_point() -> None:
    domain = domain_of(block(friction=0.0))
    assert domain.contains((0, 0)) == "carried"
    assert domain.contains((1e-3, 0)) == "not carried"
    assert domain.load_factor((1, 2)).lower == 0.0
    assert domain.load_factor((1, 2)).upper < 1e-7


def test_a_flat_set() -> None:
    """Without friction a block can still be pressed down, and lifted by its weight at most."""
    domain = domain_of(block(friction=0.0), {"x": X, "z": Z})
    assert domain.load_factor((0, 1)).upper == pytest.approx(1.0, abs=1e-6)
    assert domain.load_factor((0, 1)).lower == pytest.approx(1.0, abs=1e-6)
    assert domain.load_factor((0, -1)).lower == np.inf
    assert domain.load_factor((1, 0)).upper < 1e-7


def test_a_block_that_slides_unless_it_is_pushed_up() -> None:
    """On a slope of 30 degrees with friction 0.3: the dead load is not in the set, pushes are.

    Along the slope: |sin - a cos| <= 0.3 (cos + a sin) for a push a against it.
    """
    domain = domain_of(block(1.0, 0.3, TILTED), tolerance=1e-3)
    assert domain.contains((0, 0)) == "not carried"
    least = np.sin(SLOPE) - 0.3 * np.cos(SLOPE)
    assert domain.contains((-1.01 * least, 0)) == "carried"
    assert domain.contains((-0.99 * least, 0)) == "not carried"


def test_zero_on_the_boundary() -> None:
    """Friction is just enough on the slope: no push down it is carried, some up it are."""
    domain = domain_of(block(1.0, float(np.tan(SLOPE)), TILTED))
    assert abs(domain.load_factor((1, 0)).upper) < 1e-6
    assert domain.contains((-0.1, 0)) == "carried"


def test_a_dead_load_that_no_push_makes_stand() -> None:
    domain = domain_of(block(dead=Load(acceleration=(0, 0, 1))))
    assert domain.status is Status.DEAD_LOAD_UNSTABLE
    assert domain.is_empty
    assert domain.contains((0, 0)) == "not carried"
    assert domain.load_factor((1, 0)).upper == -np.inf


def test_loads_of_very_different_size() -> None:
    """A push of a millionth of the weight, and a force of ten thousand units."""
    loads = {
        "x": Load(acceleration=(1e-6, 0, 0)),
        "y": Load(forces={"tower": (0, 1e4, 0, 0, 0, 0)}),
    }
    domain = domain_of(block(), loads)
    assert domain.load_factor((1, 0)).upper == pytest.approx(0.4e6, rel=1e-6)
    assert domain.load_factor((0, 1)).lower == pytest.approx(0.4 * 50.0 / 1e4, rel=1e-6)


# Models


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        (builtin_scene("stack"), {"surface": "octagon"}),
        (builtin_scene("stack"), {"surface": "octagon-inscribed"}),
        (block(1.0, 0.4), {"surface": "parabolic"}),
        (block(1.0, 0.3).with_cohesion(3.0), {}),
        (block().with_cohesion(30.0).with_strength(tensile=10.0), {}),
        pytest.param(block().with_strength(compressive=200.0), {}, marks=pytest.mark.exhaustive),
    ],
)
def test_every_convex_model(scene: Scene, options: dict[str, Any]) -> None:
    domain = domain_of(scene, tolerance=0.05, **options)
    assert domain.status is Status.CERTIFIED
    assert_agrees(domain, scene, around(domain, 4))


@pytest.mark.exhaustive
def test_exact_friction() -> None:
    domain = domain_of(builtin_scene("stack"), tolerance=0.05, method="exact")
    assert domain.load_factor((1, 0)).width < 0.05
    assert domain.is_convex


@pytest.mark.exhaustive
def test_surfaces_are_nested() -> None:
    """A circle between the octagons inside and outside it: the area's ratio is known."""
    found = compare_domains(
        block(1.0, 0.5), ("conic", "octagon", "octagon-inscribed"), tolerance=2e-3, progress=False
    )
    table = found.to_dataframe().set_index("surface")
    octagon = np.tan(np.pi / 8) / (np.pi / 8)
    assert table.loc["octagon", "content"] == pytest.approx(octagon, rel=4e-3)
    assert table.loc["octagon", "error"] == pytest.approx(1 / np.cos(np.pi / 8) - 1, abs=4e-3)
    assert table.loc["octagon-inscribed", "error"] == pytest.approx(np.cos(np.pi / 8) - 1, abs=4e-3)
    assert (table["error_lower"] <= table["error"]).all()


@pytest.mark.exhaustive
def test_with_interaction_nothing_is_said_between_points() -> None:
    scene = builtin_scene("stack")
    domain = domain_of(scene, method="certified", directions=8)
    assert not domain.is_convex
    assert domain.load_factor((1, 0)).lower > 0.0
    between = domain.load_factor((1, 0.1))
    assert between.lower == -np.inf
    assert between.upper > 0.0
    assert domain.contains(0.5 * domain.points[0]) == "open"
    without = domain_of(scene, tolerance=1e-3)
    for point in domain.points:
        assert without.contains(0.999 * point) == "carried"


@pytest.mark.exhaustive
def test_without_dilatancy_there_are_points_only() -> None:
    domain = domain_of(block(1.0, 0.5), method="zero-dilatancy", directions=4)
    assert len(domain.points) >= 4
    assert not len(domain.offsets)


# What comes out


def test_what_is_no_domain_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"domain must be a LoadDomain, got 3.0: load_domain"):
        write_domain(3.0, tmp_path / "domain.json")  # type: ignore[arg-type]
    assert not (tmp_path / "domain.json").exists()


def test_files_pickles_and_tables(tmp_path: Path) -> None:
    scene = held_block()
    domain = domain_of(scene, tolerance=0.1)
    write_domain(domain, tmp_path / "domain.json")
    read = read_domain(tmp_path / "domain.json")
    for other in (read, pickle.loads(pickle.dumps(domain))):
        for direction in around(domain, 5):
            assert other.load_factor(direction) == domain.load_factor(direction)
    assert list(read.names) == list(domain.names)
    solution = read.of(scene).supports[0].solution
    assert solution is not None
    assert solution.scene.name == scene.name
    table = domain.to_dataframe()
    assert len(table) == len(domain.supports)
    assert "<table>" in domain._repr_html_()
    assert "load_factor" not in repr(domain)


def test_every_support_has_the_solution_behind_it() -> None:
    """Forces carry the point, and the bracket of its solution agrees with a solve of its own."""
    domain = domain_of(block(1.0, 0.5), tolerance=0.1)
    for support in domain.supports:
        solution = support.solution
        assert solution is not None
        again = solve(solution.scene)
        assert solution.lower <= again.upper * (1 + 1e-9)
        assert again.lower <= solution.upper * (1 + 1e-9)


def test_going_on_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    scene = block(1.0, 0.5)
    first = domain_of(scene, tolerance=0.01, most_solves=4, path=path)
    assert first.status is Status.NOT_CERTIFIED
    second = domain_of(scene, tolerance=0.01, path=path)
    assert second.status is Status.CERTIFIED
    assert second.solves > first.solves
    assert domain_of(scene, tolerance=0.01, path=path).solves == second.solves
    with pytest.raises(InputError, match="another scene"):
        domain_of(block(1.0, 0.4), path=path)


def test_going_on_where_the_dead_load_alone_does_not_stand(tmp_path: Path) -> None:
    """What the file holds is proved anew, about a state with some push."""
    scene, path = block(1.0, 0.3, TILTED), tmp_path / "domain.json"
    domain_of(scene, tolerance=0.3, path=path)
    domain = domain_of(scene, tolerance=0.01, path=path)
    assert (domain.status, domain.is_proved) == (Status.CERTIFIED, True)
    assert domain.contains((0, 0)) == "not carried"
    assert domain.contains((0.3 * np.cos(SLOPE) - np.sin(SLOPE) - 0.05, 0)) == "carried"


def test_several_directions_at_once() -> None:
    scene = block(1.0, 0.5)
    with ProcessPoolExecutor(2) as pool:
        domain = domain_of(scene, tolerance=0.05, executor=pool)
    assert domain.status is Status.CERTIFIED
    assert_agrees(domain, scene, around(domain, 3))


@pytest.mark.parametrize("name", ["domain.png", "domain.html"])
def test_pictures(tmp_path: Path, name: str) -> None:
    flat = domain_of(block(), tolerance=0.1)
    solid = domain_of(block(), {"x": X, "y": Y, "z": Z}, tolerance=0.3)
    for domain in (flat, solid):
        domain.plot(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 1000


def test_progress_shows_the_gap() -> None:
    lines: list[str] = []
    load_domain(block(1.0, 0.5), tolerance=0.1, progress=lines.append)
    assert "gap" in lines[-1]


def test_what_a_method_does_not_take_is_refused_before_it() -> None:
    stack = builtin_scene("stack")
    prop = Reaction("b1", tuple(stack.blocks[1].centroid), (-1, 0, 0), 0.2)
    with pytest.raises(ModelError, match="method 'certified' knows no ties and no reactions"):
        load_domain(replace(stack, reactions=(prop,)), method="certified")


def test_a_fall_without_dilatancy_is_written_and_read(tmp_path: Path) -> None:
    weak, file = builtin_scene("arch").with_strength(compressive=5.0), tmp_path / "domain.json"
    domain = load_domain(weak, method="zero-dilatancy", path=file)
    assert domain.status is Status.DEAD_LOAD_UNSTABLE
    assert len(domain.to_dataframe())
    proof = prove(file, weak)
    assert proof.is_proved
    assert f"the dead load cannot stand ({len(domain.supports)} times): proved" in str(proof)


@pytest.mark.parametrize(
    ("loads", "options", "message"),
    [
        ([X], {}, "two or three loads, got 1"),
        ([X, "y"], {}, "load 2 must be a Load, got 'y'"),
        ([Load(), Load()], {}, "live load is zero everywhere"),
        (None, {"method": "fixed-point"}, "method must be one of convex, exact"),
        (None, {"surface": "heptagram"}, "heptagram"),
        (None, {"moments": "signed"}, "moments does nothing for method 'convex', got 'signed'"),
        (None, {"model": "half"}, "model must be one of auto, full, least, got 'half'"),
    ],
)
def test_bad_input(loads: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises((InputError, ModelError), match=message):
        domain_of(block(), loads, **options)


def test_bad_questions() -> None:
    domain = domain_of(block(), tolerance=0.3)
    with pytest.raises(InputError, match="must not be zero"):
        domain.load_factor((0, 0))
    with pytest.raises(InputError, match="direction of the load domain"):
        domain.load_factor((1, 0, 0))
    with pytest.raises(InputError, match="point of the load domain"):
        domain.contains((np.nan, 0))


# Larger structures


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["arch", "tuff-wall", "dome", "facade", "house-corner"])
def test_no_contradiction_with_solves(name: str) -> None:
    scene = builtin_scene(name)
    domain = domain_of(scene)
    assert domain.status is Status.CERTIFIED
    assert domain.is_proved
    assert_agrees(domain, scene, around(domain, 8))


@pytest.mark.exhaustive
def test_three_loads_of_a_facade() -> None:
    """Without cohesion the set is a cone whose tip is no weight at all."""
    scene = builtin_scene("facade")
    domain = domain_of(scene, {"x": X, "y": Y, "z": Z}, tolerance=0.1)
    assert domain.status is Status.CERTIFIED
    assert domain.gap <= 0.1
    assert_agrees(domain, scene, around(domain, 10))


@pytest.mark.exhaustive
@settings(max_examples=500, deadline=None)
@given(scenes(), st.integers(0, 10**6))
def test_no_contradiction_on_random_scenes(scene: Scene, seed: int) -> None:
    """Piles, walls, arches and panels, whether they stand or not."""
    domain = domain_of(scene, tolerance=0.1, most_solves=12)
    assert_agrees(domain, scene, around(domain, 3, seed))


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(14, 30))
def test_no_contradiction_where_reactions_and_ties_hold(seed: int) -> None:
    """Half of these sets have no end somewhere; both questions to them are asked in 300 ways, and
    solved anew in six, and along every ray and half-space."""
    scene, loads = propped(seed)
    domain = domain_of(scene, loads, tolerance=0.05, most_solves=40)
    assert_consistent(domain, around(domain, 300, seed))
    known = [*domain.rays, *(domain.normals * domain.units**2)]
    known = [way / np.abs(way).max() for way in known if way.any()]
    assert_agrees(domain, scene, [*around(domain, 6, seed), *known[:6]])
