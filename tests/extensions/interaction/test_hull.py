"""Contact hulls: support functions against sampled true states, and global upper bounds.

True states are made here from Eq. 30 as written, with the arm of the independent checker.
"""

from __future__ import annotations

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cvxlimit import Block, Contacts, Load, Scene, builtin_scene
from cvxlimit.errors import ModelError
from cvxlimit.extensions.blockcone.interior import Point
from cvxlimit.extensions.interaction.flow import InteractionFlow
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.extensions.interaction.states.support import whole_boxes
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.geometry.polygons import torsion_arm
from cvxlimit.masonry import random_wall, single_block
from cvxlimit.methods.driver import Run
from cvxlimit.readings.moments import INDEPENDENT, SIGNED
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.pressure import effective_arm, half_extent
from cvxlimit.scene import Units
from cvxlimit.solution.bracket import Bracket
from cvxlimit.solvers import settings_for
from determinate import (
    DETERMINATE,
    MOMENTS,
    exact,
    hexagons,
    prism,
    states,
    tangential,
    upper,
    upper_bound,
)
from exhaustive import slow
from helpers import COMPILED, interaction_excess, named_scene
from hull_in_cvxpy import disjunct_forces

SIDES = [(1.0, 1.0), (1.0, 0.3), (0.2, 0.9), (1.0, 0.02)]
ROUNDING = 1e-12
NAMES = ("independent", "signed", "signed-torsion-bending", "paper")


def block_of(sides: tuple[float, float], friction: float = 0.6) -> Contacts:
    """A block on the ground: one rectangular contact."""
    return single_block((*sides, 0.5), friction=friction).contacts


def rectangle_states(
    contacts: Contacts, moments: str, count: int, seed: int, box: np.ndarray | None = None
) -> np.ndarray:
    """Random states on the yield surface of one rectangle, many near edges, corners and axes."""
    rng = np.random.default_rng(seed)
    low, high = (whole_boxes(contacts)[0] if box is None else box).T
    e = (low + (high - low) * rng.beta(0.3, 0.3, (count, 2))) * contacts.sides[0] / 2.0
    arm = torsion_arm(*(contacts.sides[0] - 2.0 * np.abs(e)).clip(0.0).T)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    near = rng.random(count) < 0.3
    angle = np.where(
        near, np.round(angle * 2 / np.pi) * np.pi / 2 + rng.normal(0, 0.05, count), angle
    )
    twist = rng.choice([0.0, 1.0, -1.0], count) * rng.exponential(0.5, count)
    way = np.stack([np.cos(angle), np.sin(angle), twist], axis=1)
    if moments == "signed":  # twist about the pressure centre
        way[:, 2] += e[:, 0] * way[:, 1] - e[:, 1] * way[:, 0]
    only = rng.random(count) < 0.05
    way[only, :2] = 0.0
    return states(e, tangential(e, arm, contacts.friction[0], moments, way))


def polygon_states(contacts: Contacts, j: int, moments: str, count: int, seed: int) -> np.ndarray:
    """Random states on the yield surface of any polygon; arms by polygon clipping."""
    rng = np.random.default_rng(seed)
    corners = contacts.corners_of(j)
    e = rng.dirichlet(np.full(len(corners), 0.4), count) @ corners
    arm = np.empty(count)
    for i in range(count):
        place = np.zeros((2, len(contacts)))
        place[:, j] = e[i]
        arm[i] = effective_arm(*place, contacts)[j]
    way = rng.normal(size=(count, 3)) * [1.0, 1.0, rng.choice([0.1, 1.0])]
    return states(e, tangential(e, arm, contacts.friction[j], moments, way))


def rates_like(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 6)) * rng.choice([0.0, 0.1, 1.0, 5.0], (count, 6))


def grid_power(contacts: Contacts, moments: str, w: np.ndarray, fine: int = 4) -> float:
    """Largest power by brute force: pressure centres on a grid, directions of shear on a grid."""
    share = np.sin(np.linspace(-np.pi / 2, np.pi / 2, 60 * fine + 1))
    e = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2) * contacts.sides[0] / 2.0
    arm = torsion_arm(*(contacts.sides[0] - 2.0 * np.abs(e)).clip(0.0).T)
    best = -np.inf
    for angle in np.linspace(0.0, 2.0 * np.pi, 90 * fine + 1):
        way = np.tile([np.cos(angle), np.sin(angle), 0.0], (len(e), 1))
        if moments == "signed":
            way[:, 2] = e[:, 0] * way[:, 1] - e[:, 1] * way[:, 0]
        best = max(
            best, (states(e, tangential(e, arm, contacts.friction[0], moments, way)) @ w).max()
        )
    for twist in (-1.0, 1.0):
        way = np.tile([0.0, 0.0, twist], (len(e), 1))
        best = max(
            best, (states(e, tangential(e, arm, contacts.friction[0], moments, way)) @ w).max()
        )
    return float(best)


# -- support functions ---------------------------------------------------------------------------


@pytest.mark.parametrize("moments", MOMENTS)
@pytest.mark.parametrize("sides", SIDES)
def test_no_true_state_does_more_work_than_the_support(
    sides: tuple[float, float], moments: str
) -> None:
    """4 million pairs of states and rates per case."""
    contacts = block_of(sides)
    flow = InteractionFlow(contacts, parse_moments(moments))
    forces = rectangle_states(contacts, moments, 100_000, seed=1)
    for w in rates_like(40, seed=2):
        found = flow.shortfall(-w[None])
        assert not found.unresisted.any()
        assert (forces @ w).max() <= found.missing[0] + ROUNDING * np.abs(w).max()


@pytest.mark.parametrize(("examples", "fine"), [(3, 2), slow(8, 4)])
@pytest.mark.parametrize("moments", ["independent", "signed"])
def test_the_support_is_attained(moments: str, examples: int, fine: int) -> None:
    """Grid values lie below by the grid's spacing squared, 1e-4 for the finer one, where they do
    not meet it."""
    contacts = block_of((1.0, 0.4))
    for w in rates_like(examples, seed=3):
        missing = InteractionFlow(contacts, parse_moments(moments)).shortfall(-w[None]).missing[0]
        best = grid_power(contacts, moments, w, fine)
        assert best <= missing + ROUNDING * np.abs(w).max()
        assert missing - best <= 2e-4 * (4 / fine) ** 2 * np.abs(w).max()


@pytest.mark.parametrize("moments", MOMENTS)
def test_boxes_of_pressure_centres(moments: str) -> None:
    contacts = block_of((1.0, 0.6))
    rng = np.random.default_rng(4)
    for w in rates_like(60, seed=5):
        box = np.sort(rng.uniform(-1.0, 1.0, (2, 2)), axis=1)
        if moments == "independent":  # both signs only in symmetric ranges
            both = (box[:, 0] < 0.0) & (box[:, 1] > 0.0)
            box[both, 0] = -box[both, 1]
        missing = (
            InteractionFlow(contacts, parse_moments(moments), box[None])
            .shortfall(-w[None])
            .missing[0]
        )
        forces = rectangle_states(contacts, moments, 20_000, seed=6, box=box)
        assert (forces @ w).max() <= missing + ROUNDING * np.abs(w).max()
        whole = InteractionFlow(contacts, parse_moments(moments)).shortfall(-w[None]).missing[0]
        assert missing <= whole + 1e-9 * np.abs(w).max()


def test_a_range_of_sizes_holds_what_both_sides_do() -> None:
    """Written backwards, on either side of the middle: no state of any side does more work, and the
    one that does most is on one of them, to the search's 1e-10."""
    contacts, rng = block_of((1.0, 0.6)), np.random.default_rng(8)
    sides = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)])
    for w in rates_like(30, seed=9):
        near, far = np.sort(rng.uniform(0.0, 1.0, (2, 2)), axis=0)
        boxes = [np.sort(np.stack([near * s, far * s], axis=1), axis=1) for s in sides]
        sizes = np.stack([far, near], axis=1)
        found, *each = (
            InteractionFlow(contacts, INDEPENDENT, box[None]).shortfall(-w[None]).missing[0]
            for box in (sizes, *boxes)
        )
        assert found == pytest.approx(max(each), abs=1e-9 * max(1.0, np.abs(w).max()))
        for box in boxes:
            forces = rectangle_states(contacts, "independent", 2_000, seed=10, box=box)
            assert (forces @ w).max() <= found + ROUNDING * np.abs(w).max()


def test_what_presses_equally_far_on_either_side_adds_up_to_true_states() -> None:
    """Why signs need no branch of their own with independent signs."""
    contacts, rng = block_of((1.0, 0.6)), np.random.default_rng(11)
    for seed in range(20):
        e = rng.uniform(0.0, 0.95, 2)
        mixed = 0.0
        for side in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]:
            box = np.stack([e * side, e * side], axis=1)
            own = rectangle_states(contacts, "independent", 500, seed=rng.integers(1000), box=box)
            mixed = mixed + rng.exponential(size=(500, 1)) * own
        alone = contacts.take(np.zeros(500, dtype=int))
        assert interaction_excess(mixed, alone, "independent").max() <= 1e-12, seed


def test_the_worst_place_has_the_support() -> None:
    """A box that is only the worst pressure centre has the same support, to the search's 1e-10."""
    contacts = block_of((1.0, 0.6))
    for w in rates_like(30, seed=7):
        missing, centre, _ = InteractionFlow(contacts, INDEPENDENT).worst(-w[None])
        signs = np.where(w[[COLUMN["M2"], COLUMN["M1"]]] * [-1, 1] >= 0.0, 1.0, -1.0)
        place = np.repeat((np.abs(centre) * signs)[..., None], 2, axis=2)
        at = InteractionFlow(contacts, INDEPENDENT, place).shortfall(-w[None]).missing
        assert at[0] == pytest.approx(missing[0], abs=1e-8 * np.abs(w).max())


@pytest.mark.exhaustive
@pytest.mark.parametrize("moments", MOMENTS)
def test_polygons(moments: str) -> None:
    contacts = hexagons().contacts
    assert not contacts.is_rectangle.any()
    flow = InteractionFlow(contacts, parse_moments(moments))
    for j in range(len(contacts)):
        forces = polygon_states(contacts, j, moments, 1_500, seed=8)
        for w in rates_like(60, seed=9):
            missing = flow.shortfall(-np.tile(w, (len(contacts), 1))).missing[j]
            assert (forces @ w).max() <= missing + ROUNDING * np.abs(w).max()


def test_pointwise_friction_is_inside_the_corner_hull() -> None:
    """Any distribution of Coulomb friction over the polygon, not only sliding about a centre."""
    contacts = hexagons().contacts
    rng = np.random.default_rng(10)
    corners = contacts.corners_of(0)
    points = rng.dirichlet(np.ones(len(corners)), (4_000, 5)) @ corners
    share = rng.dirichlet(np.full(5, 0.4), 4_000)
    angle = rng.uniform(0.0, 2.0 * np.pi, (4_000, 5))
    pull = contacts.friction[0] * share[..., None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    moment = (points[..., 0] * pull[..., 1] - points[..., 1] * pull[..., 0]).sum(axis=1)
    e = (share[..., None] * points).sum(axis=1)
    forces = states(e, np.column_stack([pull.sum(axis=1), moment]))
    for w in rates_like(60, seed=11):
        missing = InteractionFlow(contacts, SIGNED).shortfall(-np.tile(w, (2, 1))).missing[0]
        assert (forces @ w).max() <= missing + ROUNDING * np.abs(w).max()


@pytest.mark.parametrize("moments", MOMENTS)
def test_shortfall_is_sublinear_and_bounded_by_the_cheap_bound(moments: str) -> None:
    contacts = builtin_scene("tuff-wall").contacts
    flow = InteractionFlow(contacts, parse_moments(moments))
    first, second = rates_like(len(contacts), 12), rates_like(len(contacts), 13)
    a, b = flow.shortfall(first).missing, flow.shortfall(second).missing
    size = np.abs(first).max() + np.abs(second).max()
    assert (flow.shortfall(first + second).missing <= a + b + 1e-9 * size).all()
    np.testing.assert_allclose(flow.shortfall(3.0 * first).missing, 3.0 * a, atol=1e-8 * size)
    assert (flow.shortfall_bound(first) >= a - 1e-9 * size).all()


def test_moments_must_be_known() -> None:
    with pytest.raises(ModelError, match=r"independent, signed, .*paper, got 'both'"):
        parse_moments("both")


# -- disjuncts -----------------------------------------------------------------------------------


def reach(disjuncts: Disjuncts, contacts: Contacts, w: np.ndarray) -> float:
    """Largest power of the disjuncts' forces with N = 1, by CVXPY."""
    force, limits = disjunct_forces(disjuncts, contacts)
    problem = cp.Problem(cp.Maximize(w @ force), [*limits, force[COLUMN["N"]] == 1.0])
    problem.solve(solver=cp.CLARABEL)
    return float(problem.value)


@pytest.mark.parametrize("shape", [(1.0, 0.5), 5])
def test_signed_disjuncts_are_the_exact_hull(shape: tuple[float, float] | int) -> None:
    """To 1e-6, Clarabel's default accuracy on powers of order one."""
    contacts = block_of(shape) if isinstance(shape, tuple) else pentagon()
    for w in rates_like(6, seed=14):
        missing = InteractionFlow(contacts, SIGNED).shortfall(-w[None]).missing[0]
        assert reach(states_of(SIGNED).box_disjuncts(contacts), contacts, w) == pytest.approx(
            missing, abs=1e-6 * max(1.0, np.abs(w).max())
        )


def pentagon() -> Contacts:
    ground = Block.box("ground", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0))
    live = Load(acceleration=(1.0, 0.0, 0.0))
    return Scene((ground, prism("b", 5, 0.0, 0.5)), ("ground",), live, friction=0.6).contacts


@pytest.mark.parametrize(
    "box",
    [
        None,
        (-0.4, 0.4, 0.1, 0.7),
        (-0.8, -0.2, 0.3, 0.3),
        (0.7, 0.2, -0.1, 0.6),
        (0.9, 0.4, 0.6, 0.1),
    ],
)
def test_independent_disjuncts_and_the_worst_one_are_the_hull(
    box: tuple[float, ...] | None,
) -> None:
    contacts = block_of((1.0, 0.5))
    boxes = whole_boxes(contacts) if box is None else np.reshape(box, (1, 2, 2))
    flow = InteractionFlow(contacts, INDEPENDENT, boxes)
    first = states_of(INDEPENDENT).box_disjuncts(contacts, boxes)
    for w in rates_like(6, seed=15):
        missing, centre, _ = flow.worst(-w[None])
        size = max(1.0, np.abs(w).max())
        assert reach(first, contacts, w) <= missing[0] + 1e-6 * size
        more = first.joined(
            states_of(INDEPENDENT).disjuncts_at(contacts, np.array([0]), centre, boxes)
        )
        assert reach(more, contacts, w) == pytest.approx(missing[0], abs=1e-6 * size)


@pytest.mark.parametrize("moments", MOMENTS)
def test_boxed_signed_disjuncts_and_safe_disjuncts_are_admissible(moments: str) -> None:
    """Extreme states of safe disjuncts pass the checker, on rectangles and hexagons."""
    for contacts in (block_of((1.0, 0.5)), pentagon()):
        rng = np.random.default_rng(16)
        for _ in range(4):
            centre = rng.uniform(-0.4, 0.4, (1, 2))
            safe = states_of(parse_moments(moments)).safe_disjuncts(contacts, centre, reach=0.1)
            force, limits = disjunct_forces(safe, contacts)
            w = rng.normal(size=6)
            limits = [*limits, force[COLUMN["N"]] == 1.0]
            cp.Problem(cp.Maximize(w @ force), limits).solve(solver=cp.CLARABEL)
            excess = interaction_excess(force.value[None], contacts, moments)
            assert excess[0] <= 1e-7


# -- global bounds -------------------------------------------------------------------------------


def assert_history(run: Run) -> None:
    assert run.best.bracket.upper_is_proved
    known = [h.upper for h in run.history if h.upper is not None]
    assert known
    assert run.best.bracket.upper == min(known)
    assert all(run.clock.seconds[phase] > 0.0 for phase in ("compile", "solve", "certify"))


@pytest.mark.parametrize("moments", NAMES)
def test_on_polygons_mechanisms_prove_what_relaxations_carry(moments: str) -> None:
    """A pentagon with a corner on an axis: disjuncts and support function have the same states."""
    ground = Block.box("ground", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0))
    push = Load(acceleration=(0.6, 0.8, 0.0), forces={"b1": (0.0, 0.0, 0.0, 0.0, 0.0, 0.5)})
    scene = Scene((ground, prism("b1", 5, 0.0, 0.4)), ("ground",), push, friction=0.6)
    run, search = upper_bound(scene, moments)
    assert search.state is not None
    assert run.best.bracket.upper_is_proved
    assert run.best.bracket.upper == pytest.approx(search.state.load_factor, rel=1e-4)


@pytest.mark.exhaustive_cases("hexagons-signed", "hexagons-independent")
@pytest.mark.parametrize("moments", MOMENTS)
@pytest.mark.parametrize("name", DETERMINATE)
def test_bounds_hold_where_forces_are_known(name: str, moments: str) -> None:
    run, _ = upper_bound(DETERMINATE[name], moments)
    assert_history(run)
    assert run.best.bracket.upper >= exact(name, moments) - 1e-9
    assert run.best.bracket.upper <= upper(DETERMINATE[name], "signed") + 1e-7


@pytest.mark.parametrize(("name", "moments", "most", "reason"), [
    ("tuff-wall", "independent", 0.26917, "prototype: hull with priced disjuncts 0.269166"),
    ("tuff-wall", "signed", 0.36423, "prototype: friction at the corners 0.364222"),
    slow("dome", "independent", 0.39850, "triangles of a quarter of the size: 0.398458"),
    slow("s12-panel", "independent", 0.12633, "seen with an earlier program: 0.12632"),
    slow("s12-class", "independent", 0.12643, "prototype: hull with priced disjuncts 0.126427"),
    slow("s12-class", "signed", 0.18212, "prototype: friction at the corners 0.182117"),
    slow("s10-class", "independent", 0.165319, "rocking decides: both hulls meet at 0.165318"),
    slow("s10-class", "signed", 0.165319, "rocking decides: both hulls meet at 0.165318"),
])  # fmt: skip
def test_targets(name: str, moments: str, most: float, reason: str) -> None:
    scene = named_scene(name)
    run, search = upper_bound(scene, moments)
    assert_history(run)
    assert run.best.bracket.upper <= most, reason
    assert search.state is not None
    assert search.state.load_factor is not None
    assert run.best.bracket.upper >= search.state.load_factor - 1e-6 * most
    assert search.state.forces is not None
    assert search.state.forces.shape == (len(scene.contacts), 6)


@pytest.mark.parametrize("moments", MOMENTS)
@pytest.mark.parametrize("name", ["two blocks", "hexagons"])
def test_invariance(name: str, moments: str) -> None:
    """Rotation turns contact frames too: to 1e-5, the bound's own tolerance."""
    scene = DETERMINATE[name]
    first = upper(scene, moments, 1e-6)
    turned = scene.moved(Rotation.from_euler("xyz", [0.4, -0.7, 1.9]).as_matrix(), (3.0, -1.0, 2.0))
    millimetres = scene.in_units(Units("mm", "N"), 1000.0, 1000.0)
    for other in (turned, millimetres):
        assert upper(other, moments, 1e-6) == pytest.approx(first, rel=1e-5)


@pytest.mark.parametrize("moments", MOMENTS)
def test_pressure_at_an_edge(moments: str) -> None:
    """The block rocks about its edge at length / height, with nothing but N on the edge."""
    assert upper(builtin_scene("single-block"), moments) == pytest.approx(0.4, abs=1e-7)


def test_pressure_in_a_corner() -> None:
    """Signed: friction acts in the corner, the block rocks about it at sqrt(2) 0.4. With
    independent signs nothing but N passes a corner, so pressure cannot get there."""
    live = Load(acceleration=(0.5**0.5, 0.5**0.5, 0.0))
    scene = single_block((0.4, 0.4, 1.0), friction=0.7, live=live)
    signed = upper(scene, "signed")
    assert signed == pytest.approx(0.4 * 2.0**0.5, abs=1e-7)
    assert upper(scene, "independent") < 0.9 * signed


@pytest.mark.parametrize("moments", MOMENTS)
def test_a_contact_without_force(moments: str) -> None:
    """Pushed away from a wall it touches, the block does what it would do alone."""
    ground = Block.box("ground", (-1.0, -1.0, -1.0), (2.0, 2.0, 0.0))
    side = Block.box("side", (-0.5, 0.0, 0.0), (0.0, 0.4, 1.0))
    block = Block.box("b1", (0.0, 0.0, 0.0), (0.4, 0.4, 1.0), density=20.0)
    live = Load(acceleration=(1.0, 0.0, 0.0))
    scene = Scene((ground, side, block), ("ground", "side"), live, friction=0.3)
    found = upper(scene, moments)
    alone = single_block((0.4, 0.4, 1.0), friction=0.3, live=live)
    assert found >= upper(alone, moments) - 1e-7
    assert found == pytest.approx(upper(alone, moments), abs=1e-6)


@pytest.mark.parametrize("moments", MOMENTS)
def test_without_friction(moments: str) -> None:
    """Any push slides the block: the bound is zero, not undefined."""
    found = upper(single_block((1.0, 1.0, 0.5), friction=0.0), moments)
    assert found == pytest.approx(0.0, abs=1e-7)


def test_no_bound_where_there_is_none() -> None:
    """A load that presses the block down: the relaxation is unbounded, and says so."""
    down = Load(acceleration=(0.0, 0.0, -1.0))
    run, _ = upper_bound(single_block(live=down), "independent")
    assert run.best.bracket == Bracket(least=run.best.bracket.least)
    assert run.best.mechanism is None


def test_relief_makes_every_problem_solvable() -> None:
    """Pressure held in a corner cannot carry the dead load: the bound is -price at most."""
    scene = single_block((1.0, 1.0, 0.5))
    held = np.array([[[0.9, 1.0], [0.9, 1.0]]])
    up = scene.with_live(Load(forces={"b1": (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)}))
    state = HullProblem(up).solve(
        states_of(INDEPENDENT).box_disjuncts(up.contacts, held), relief_price=50.0
    )
    assert state.mechanism is not None
    assert -float((up.dead_forces * state.mechanism).sum()) <= -50.0 * (1.0 - 1e-6)


def test_nothing_stands_on_a_box_beside_its_contact() -> None:
    """No disjunct is left: the dead load is relieved as a whole and no load factor carries more."""
    ground = Block.box("ground", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0))
    up = Load(forces={"b1": (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)})
    scene = Scene((ground, prism("b1", 3, 0.0, 0.4)), ("ground",), up, friction=0.6)
    disjuncts = states_of(INDEPENDENT).box_disjuncts(
        scene.contacts, np.array([[[0.9, 1.0], [0.9, 1.0]]])
    )
    assert len(disjuncts) == 0
    state = HullProblem(scene).solve(disjuncts, relief_price=50.0)
    assert state.load_factor == pytest.approx(0.0, abs=1e-7)
    assert state.mechanism is not None
    assert -float((scene.dead_forces * state.mechanism).sum()) <= -50.0 * (1.0 - 1e-6)


def test_fractions_are_of_half_sides() -> None:
    np.testing.assert_allclose(half_extent(block_of((1.0, 0.5))), [[0.5, 0.25]])


@COMPILED
@pytest.mark.parametrize("moments", NAMES)
def test_a_start_costs_or_saves_time_only(moments: str) -> None:
    """From halfway to another problem's answer, with other disjuncts of some contacts, and from
    noise: the load factor of a cold solve. Both are solved to 1e-8."""
    scene, rng = random_wall(11), np.random.default_rng(0)
    reading, problem, rung = (
        parse_moments(moments),
        HullProblem(scene),
        settings_for("BLOCKWISE", 1e-8),
    )
    boxes = whole_boxes(scene.contacts)
    first = problem.solve(states_of(reading).box_disjuncts(scene.contacts, boxes), rung)
    boxes[rng.permutation(len(boxes))[:5], :, 0] = 0.2
    disjuncts = states_of(reading).box_disjuncts(scene.contacts, boxes)
    cold = problem.solve(disjuncts, rung, relief_price=10.0)
    assert first.halfway is not None
    assert cold.halfway is not None
    point = first.halfway.point
    noise = Point(*(rng.normal(size=len(v)) for v in (point.x, point.y, point.z, point.s)))
    for start in (first.halfway, cold.halfway, replace(first.halfway, point=noise)):
        warm = problem.solve(disjuncts, rung, relief_price=10.0, start=start)
        assert warm.load_factor == pytest.approx(cold.load_factor, rel=1e-7)


@COMPILED
@pytest.mark.parametrize("moments", NAMES)
def test_pieces_make_up_the_whole(moments: str) -> None:
    """In any order, whole, cut by contact or by disjunct: the same load factor, and forces that are
    in equilibrium with it."""
    scene, rng, rung = random_wall(11), np.random.default_rng(2), settings_for("BLOCKWISE", 1e-9)
    problem, disjuncts = (
        HullProblem(scene),
        states_of(parse_moments(moments)).box_disjuncts(scene.contacts),
    )
    whole = problem.solve(disjuncts, rung)
    assert whole.load_factor is not None
    for unit in (None, disjuncts.contact, np.arange(len(disjuncts))):
        pieces = problem.column_blocks(disjuncts, unit)
        order = rng.permutation(len(pieces))
        state = problem.solve([pieces[k] for k in order], rung)
        assert state.forces is not None
        assert state.load_factor == pytest.approx(whole.load_factor, rel=1e-7)
        rest = problem.assemblage.statics.residual(state.forces, state.load_factor)
        assert np.abs(rest).max() <= 1e-7 * scene.total_weight


@COMPILED
@pytest.mark.parametrize("price", [None, 10.0])
@pytest.mark.parametrize("moments", NAMES)
def test_a_problem_starts_where_it_was_halfway(moments: str, price: float | None) -> None:
    """The same number for each of its variables, and other places only where pieces change theirs;
    cut in another way, too."""
    scene, rng, rung = random_wall(11), np.random.default_rng(4), settings_for("BLOCKWISE", 1e-8)
    problem, disjuncts = (
        HullProblem(scene),
        states_of(parse_moments(moments)).box_disjuncts(scene.contacts),
    )
    pieces = problem.column_blocks(disjuncts, disjuncts.contact)
    halfway = problem.solve(pieces, rung, price).halfway
    assert halfway is not None
    for other in (
        pieces,
        [pieces[k] for k in rng.permutation(len(pieces))],
        problem.column_blocks(disjuncts),
    ):
        joined = problem.columns(other, price)
        start, point = joined.start(halfway), halfway.point
        for found, given in ((start.x, point.x), (start.z, point.z), (start.s, point.s)):
            assert np.array_equal(np.sort(found), np.sort(given))
        matrix = problem.program(joined, price).matrix
        own = problem.program(problem.columns(pieces, price), price).matrix
        sides = np.zeros(len(problem.dead))
        before, after = (
            a.T @ np.concatenate([sides, z]) for a, z in ((own, point.z), (matrix, start.z))
        )
        assert np.allclose(
            np.sort(before), np.sort(after), rtol=0.0, atol=1e-12 * np.abs(before).max()
        )


@COMPILED
@pytest.mark.parametrize("moments", NAMES)
def test_what_ends_early_still_bounds(moments: str) -> None:
    """A load factor that is not reached: the mechanism proves it, and less is not claimed."""
    scene, reading = random_wall(11), parse_moments(moments)
    problem, disjuncts = HullProblem(scene), states_of(reading).box_disjuncts(scene.contacts)
    whole = problem.solve(disjuncts, settings_for("BLOCKWISE", 1e-8)).load_factor
    assert whole is not None
    for above in (1.5, 1.1, 1.01):
        state = problem.solve(disjuncts, settings_for("BLOCKWISE", 1e-8), enough=above * whole)
        rates = state.mechanism
        assert rates is not None
        statics = problem.assemblage.statics
        power = float(statics.live @ rates.ravel())
        bound = -float(statics.dead @ rates.ravel()) / power
        assert whole * (1.0 - 1e-7) <= bound <= above * whole * (1.0 + 1e-7)
