"""Nodes of branch and bound: the problem as arrays, how far pressure reaches, states in boxes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from cvxlimit import Block, Load, Scene
from cvxlimit.extensions.interaction.branching.tightening import Reach
from cvxlimit.extensions.interaction.flow import InteractionFlow
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem
from cvxlimit.extensions.interaction.states.cells import triangles
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.extensions.interaction.states.support import whole_boxes
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.masonry import random_wall, single_block
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.readings.named import MOMENTS
from cvxlimit.readings.pressure import effective_arm, half_extent
from cvxlimit.solvers import settings_for
from determinate import arm_at, hexagons, prism, states, tangential
from hull_in_cvxpy import hull_solved

FloatArray = NDArray[np.float64]

TIGHT = settings_for("CLARABEL", 1e-9)


@pytest.mark.exhaustive_cases(
    "signed-torsion-bending-0.0", "signed-torsion-bending-1e-05", "paper-0.0"
)
@pytest.mark.parametrize("precision", [0.0, 1e-5])
@pytest.mark.parametrize("moments", MOMENTS)
def test_rules_within_boxes_are_exact_where_something_is_missing(
    moments: str, precision: float
) -> None:
    """Elsewhere they say that nothing is. To the enclosures' share of the power in play, twice
    without and once with a coarser one, which ends above what is exact and never below."""
    rng = np.random.default_rng(5)
    contacts = random_wall(4).contacts
    boxes = random_boxes(contacts, rng)
    whole = InteractionFlow(contacts, MOMENTS[moments])
    exact = InteractionFlow(contacts, MOMENTS[moments], boxes)
    within = whole.within(boxes, precision)
    signs = set()
    for _ in range(10):
        rates = rng.normal(size=(len(contacts), 6)) * [1.0, 1.0, 1.0, 5.0, 5.0, 5.0]
        found, given = (flow.shortfall(rates).missing for flow in (within, exact))
        fine = 2e-8 * np.abs(rates).max()
        coarse = fine + precision * powers(rates, contacts)
        more = np.maximum(found, 0.0) - np.maximum(given, 0.0)
        assert (more >= -fine).all()
        assert (more <= coarse).all()
        assert np.allclose(within.opened(rates).missing, given, rtol=0.0, atol=fine)
        signs |= set(np.sign(given).tolist())
    assert {-1.0, 1.0} <= signs


@pytest.mark.parametrize("moments", MOMENTS)
@pytest.mark.parametrize(
    "contacts", [random_wall(4).contacts, hexagons().contacts], ids=["rectangles", "polygons"]
)
def test_rules_that_are_asked_together_say_what_each_says(contacts: Contacts, moments: str) -> None:
    """Rows of contacts do not know of each other: the same but for rounding, which enclosures, of
    1e-10 of the powers in play along edges and 1e-8 over boxes, may turn into a step of their
    own."""
    rng, n = np.random.default_rng(8), len(contacts)
    whole = InteractionFlow(contacts, MOMENTS[moments])
    boxes = [random_boxes(contacts, rng) for _ in range(3)]
    every = [rng.normal(size=(n, 6)) for _ in boxes]
    opening = rng.normal(size=(n, 6))
    rules = [whole.within(each) for each in boxes]
    whole.ask_together(rules, every, opening)
    for rule, each, rates in zip(rules, boxes, every, strict=True):
        alone = InteractionFlow(contacts, MOMENTS[moments]).within(each)
        step = 2e-8 * powers(rates, contacts)
        missing, centre, _ = rule.worst(rates)
        expected, place, _ = alone.worst(rates)
        assert (np.abs(missing - expected) <= step).all()
        assert np.array_equal(np.isnan(centre), np.isnan(place))
        found, given = (flow.opened(opening).missing for flow in (rule, alone))
        assert (np.abs(found - given) <= 2e-8 * powers(opening, contacts)).all()


@pytest.mark.parametrize("moments", MOMENTS)
def test_the_rule_of_some_contacts_is_that_of_all_of_them(moments: str) -> None:
    """Asked in turns for two fields, which are kept. To what enclosures leave."""
    contacts, rng, rows = random_wall(4).contacts, np.random.default_rng(9), np.array([7, 3, 12])
    whole = InteractionFlow(contacts, MOMENTS[moments])
    some = whole.of(rows)
    for rates in rng.normal(size=(2, len(contacts), 6)).repeat(2, axis=0):
        step = 2e-8 * powers(rates, contacts)[rows]
        found = some.shortfall(rates[rows]).missing, some.opened(rates[rows]).missing
        for one, every in zip(found, (whole.shortfall(rates), whole.opened(rates)), strict=True):
            assert (np.abs(one - every.missing[rows]) <= step).all()


def powers(rates: FloatArray, contacts: Contacts) -> FloatArray:
    """The most (n,) that forces with N = 1 could do if all did their most at once."""
    half, size = half_extent(contacts), np.abs(rates)
    shear, twist = size[:, COLUMN["V1"]] + size[:, COLUMN["V2"]], size[:, COLUMN["MT"]]
    moments = size[:, [COLUMN["M2"], COLUMN["M1"]]] * half
    found: FloatArray = moments.sum(axis=1) + contacts.friction * (
        shear + twist * np.hypot(*half.T)
    )
    return found


def random_boxes(contacts: Contacts, rng: np.random.Generator) -> FloatArray:
    """Boxes (n, 2, 2), of one sign, of both evenly and unevenly, and some whole."""
    ends = np.sort(rng.uniform(-1.0, 1.0, (len(contacts), 2, 2)), axis=2)
    even = rng.random((len(contacts), 2)) < 0.3
    ends[even, 0] = -ends[even, 1]
    boxes = np.sort(ends, axis=2)
    whole = rng.random(len(contacts)) < 0.3
    return np.where(whole[:, None, None], whole_boxes(contacts), boxes)


@pytest.mark.parametrize("name", sorted(MOMENTS))
@pytest.mark.parametrize("scene", [random_wall(23), hexagons()], ids=["rectangles", "polygons"])
def test_the_same_as_cvxpy_compiles(scene: Scene, name: str) -> None:
    """Both paths to the same problem: same load factor and the same forces and powers."""
    moments, rng = MOMENTS[name], np.random.default_rng(3)
    assemblage = Assemblage.of(scene)
    written = HullProblem(assemblage)
    for boxes in (None, random_boxes(scene.contacts, rng)):
        disjuncts = states_of(moments).box_disjuncts(scene.contacts, boxes)
        ours = written.solve(disjuncts, TIGHT, relief_price=10.0)
        theirs = hull_solved(assemblage, disjuncts, TIGHT, 10.0)
        assert ours.load_factor is not None
        assert ours.load_factor == pytest.approx(theirs.load_factor, rel=1e-6, abs=1e-6)
        assert ours.mechanism is not None
        live = float((scene.live_forces * ours.mechanism).sum())
        assert live == pytest.approx(1.0, rel=1e-6)


def prisms(corners: int) -> Contacts:
    ground = Block.box("ground", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0))
    blocks = (ground, prism("b1", corners, 0.0, 0.4))
    return Scene(blocks, ("ground",), Load(acceleration=(1.0, 0.0, 0.0)), friction=0.6).contacts


@pytest.mark.exhaustive_cases(*(f"{corners}-{name}" for corners in (5, 6) for name in MOMENTS))
@pytest.mark.parametrize("name", sorted(MOMENTS))
@pytest.mark.parametrize("corners", [3, 4, 5, 6, 8])
def test_no_state_in_a_box_does_more_work_than_its_bound(corners: int, name: str) -> None:
    """True states pressed anywhere in a box, against the support that certificates use."""
    contacts, rng = prisms(corners), np.random.default_rng(corners)
    half, corner = half_extent(contacts), contacts.corners_of(0)
    for _ in range(6):
        boxes = random_boxes(contacts, rng)
        weights = rng.dirichlet(np.full(len(corner), 0.5), 80)
        e = weights @ corner
        inside = ((e / half >= boxes[0, :, 0]) & (e / half <= boxes[0, :, 1])).all(axis=1)
        e = e[inside]
        if not len(e):
            continue
        flow = InteractionFlow(contacts, MOMENTS[name], boxes)
        every = [effective_arm(x[[0]], x[[1]], contacts)[0] for x in e]
        for _ in range(10):
            rates = rng.normal(size=(1, 6))
            bound = flow.shortfall(-rates).missing[0]
            way = tangential(e, np.array(every), 0.6, name, rng.normal(size=(len(e), 3)))
            forces = states(e, way)
            forces[:, COLUMN["M1"]], forces[:, COLUMN["M2"]] = e[:, 1], -e[:, 0]
            assert (forces @ rates[0]).max() <= bound + 1e-9


@pytest.mark.parametrize("corners", [3, 5, 6, 8])
def test_arms_of_cells_are_nowhere_too_small(corners: int) -> None:
    """Anywhere in a box some sum over corners of cells has the true arm at least."""
    polygon, rng = prisms(corners).corners_of(0), np.random.default_rng(corners)
    size = np.abs(polygon).max(axis=0)
    for _ in range(8):
        low = rng.uniform(-1.0, 0.8, 2) * size
        high = low + rng.uniform(0.02, 1.0) * size
        corners_of_all = triangles(polygon, low, high).reshape(-1, 3)
        for e in low + rng.random((10, 2)) * (high - low):
            arm = arm_at(polygon, e)
            if arm > 0.0:  # inside the polygon
                places, arms = corners_of_all[:, :2], corners_of_all[:, 2]
                sums = np.vstack([places.T, np.ones(len(arms))])
                most = linprog(-arms, A_eq=sums, b_eq=[*e, 1.0])
                assert most.status == 0
                assert arm <= -most.fun * (1.0 + 1e-9)


def test_cells_tend_to_the_true_arm() -> None:
    """Margins fall faster than boxes shrink."""
    polygon = prisms(6).corners_of(0)
    e = np.array([0.11, 0.07])
    excess = []
    for width in (0.1, 0.01, 0.001):
        arms = triangles(polygon, e - width / 2.0, e + width / 2.0)[..., 2]
        excess.append(float(arms.max()) / arm_at(polygon, e) - 1.0)
    assert excess[1] <= 0.2 * excess[0]
    assert excess[2] <= 0.2 * excess[1] + 1e-9


@pytest.mark.parametrize("is_even", [True, False])
@pytest.mark.parametrize("name", sorted(MOMENTS))
def test_parts_cover_what_they_are_cut_from(name: str, is_even: bool) -> None:
    """Every place of a range is in one of its parts, all of which are smaller; ranges of sizes,
    written backwards, have places on either side of the middle."""
    rng = np.random.default_rng(12)

    def holds(ends: tuple[float, float], e: FloatArray) -> NDArray[np.bool_]:
        near, far = sorted(ends)
        return (near <= (size := np.abs(e) if ends[0] > ends[1] else e)) & (size <= far)

    for _ in range(200):
        low, high = np.sort(rng.uniform(-1.0, 1.0, 2))
        ranges = [(low, high), (-high, high), (-1.0, high)] if high > 0.0 else [(low, high)]
        if is_even and name == "independent":
            ranges.append((max(-low, high, 0.0), 0.5 * max(-low, high, 0.0)))
        for ends in ranges:
            every = rng.uniform(-1.0, 1.0, 200)
            inside = every[holds(ends, every)]
            at = float(rng.uniform(-1.0, 1.0))
            parts = states_of(MOMENTS[name]).split(*ends, at, is_even)
            assert np.any([holds(part, inside) for part in parts], axis=0).all()
            assert all(abs(b - a) < abs(ends[1] - ends[0]) for a, b in parts)
            if not is_even:
                assert all(a < b for a, b in parts)


@pytest.mark.parametrize("name", sorted(MOMENTS))
def test_how_far_pressure_reaches(name: str) -> None:
    """One block: pressure moves with the push, e1 = alpha h / 2, so it is nowhere nearer to the
    middle than that for a load factor of 0.2, and reaches the edge at 0.4."""
    scene = single_block((0.4, 0.4, 1.0), friction=0.7)
    assemblage = Assemblage.of(scene)
    disjuncts = states_of(MOMENTS[name]).box_disjuncts(scene.contacts)
    reach = Reach(HullProblem(assemblage), disjuncts, 0.2)
    ends = []
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            found = reach.furthest(0, axis, sign, TIGHT)
            assert found is not None
            ends.append(sign * found[0])
    along = np.array(ends).reshape(2, 2)
    moving = int(np.abs(along).max(axis=1).argmax())
    assert np.sort(np.abs(along[moving])) == pytest.approx([0.5, 1.0], abs=1e-6)
    assert along[1 - moving] == pytest.approx([0.0, 0.0], abs=1e-6)


def test_no_reach_where_nothing_presses() -> None:
    """A contact without disjuncts carries nothing: there is no answer to where."""
    scene = random_wall(23)
    disjuncts = states_of(MOMENTS["signed"]).box_disjuncts(scene.contacts).without(np.array([0]))
    assert (
        Reach(HullProblem(Assemblage.of(scene)), disjuncts, 0.0).furthest(0, 0, 1.0, TIGHT) is None
    )
