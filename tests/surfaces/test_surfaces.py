"""Yield surfaces without a solver: gauges, the paper's rows, polygons, users' own surfaces."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from cvxlimit import Contacts, Load, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import single_block, stack
from cvxlimit.model.formulations import corner_compressions, resultants
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.sinks import Constraints
from cvxlimit.problem.problem import LimitProblem
from cvxlimit.surfaces import (
    Condition,
    Cone,
    Conic,
    Facets,
    Norm,
    Parabola,
    Rocking,
    Sliding,
    Torsion,
    TorsionShear,
    YieldSurface,
    parse_cone,
    slip_resistance,
)
from cvxlimit.surfaces.coulomb import needed_surfaces, surfaces_of
from helpers import (
    Core,
    Ellipse,
    assert_certified,
    contact_of,
    corners_in_plane,
    hand_torsion_arm,
    regular,
    yield_excess,
)

ROUNDING = 1e-12
"""Sums of a few products of numbers of order one, in double precision."""

KS = [3, 4, 5, 7, 8, 9, 16, 33]


class Cushion(YieldSurface):
    """Sliding whose friction is a Parameter per contact: may change between solves."""

    name = "cushion"

    def __init__(self, friction: float, contacts: int) -> None:
        super().__init__()
        self.mu = cp.Parameter(contacts, value=np.full(contacts, friction))

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [Condition([Norm({"V1": 1}, {"V2": 1})], {"N": self.mu})]


def vectors(seed: int, n: int = 200) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).normal(size=(2, n)))


def polygon_corners(k: int, circumscribed: bool) -> np.ndarray:
    """Corners (k, 2) halfway between facet normals, drawn by hand; unit circle in or around."""
    angles = 2.0 * np.pi * (np.arange(k) + 0.5) / k
    radius = 1.0 / np.cos(np.pi / k) if circumscribed else 1.0
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def facets(k: int, circumscribed: bool) -> Facets:
    return Facets.circumscribed(k) if circumscribed else Facets.inscribed(k)


class TestConic:
    def test_three_four_five(self) -> None:
        rows = [np.array([3.0, -5.0]), np.array([-4.0, 12.0])]
        assert Conic().gauge(rows).tolist() == [5.0, 13.0]
        assert Conic().polar_gauge(rows).tolist() == [5.0, 13.0]

    def test_any_number_of_components(self) -> None:
        rows = [np.array([2.0]), np.array([3.0]), np.array([6.0])]
        assert Conic().gauge(rows).tolist() == [7.0]

    @pytest.mark.parametrize("cone", [Conic(), Facets.circumscribed(8), Facets.inscribed(5)])
    def test_one_component_is_its_absolute_value(self, cone: Conic | Facets) -> None:
        assert cone.gauge([np.array([-2.0, 3.0])]).tolist() == [2.0, 3.0]
        assert cone.polar_gauge([np.array([-2.0, 3.0])]).tolist() == [2.0, 3.0]


@pytest.mark.parametrize("circumscribed", [True, False])
@pytest.mark.parametrize("k", KS)
class TestFacets:
    def test_gauge_is_one_on_the_polygon_drawn_by_hand(self, k: int, circumscribed: bool) -> None:
        corners = polygon_corners(k, circumscribed)
        share = np.random.default_rng(k).uniform(size=k)[:, None]
        points = share * corners + (1.0 - share) * np.roll(corners, 1, axis=0)
        cone = facets(k, circumscribed)
        np.testing.assert_allclose(cone.gauge(list(points.T)), 1.0, atol=ROUNDING)
        np.testing.assert_allclose(cone.gauge(list(2.5 * corners.T)), 2.5, atol=ROUNDING)

    def test_polar_gauge_is_the_support_function(self, k: int, circumscribed: bool) -> None:
        v = vectors(k)
        expected = (polygon_corners(k, circumscribed) @ np.stack(v)).max(axis=0)
        polar = facets(k, circumscribed).polar_gauge(v)
        np.testing.assert_allclose(polar, expected, atol=ROUNDING)

    def test_duality(self, k: int, circumscribed: bool) -> None:
        """r @ v <= polar(r) gauge(v) for all pairs, with equality for some v for every r."""
        r, v = np.stack(vectors(1)), np.stack(vectors(2))
        cone = facets(k, circumscribed)
        product = cone.polar_gauge(list(r))[:, None] * cone.gauge(list(v))[None, :]
        assert (r.T @ v <= product + ROUNDING).all()
        corners = polygon_corners(k, circumscribed).T
        reached = (r.T @ corners / cone.gauge(list(corners))[None, :]).max(axis=1)
        np.testing.assert_allclose(cone.polar_gauge(list(r)), reached, atol=ROUNDING)

    def test_on_its_side_of_the_circle(self, k: int, circumscribed: bool) -> None:
        v = vectors(3)
        gauge, exact = facets(k, circumscribed).gauge(v), Conic().gauge(v)
        worst = 1.0 / np.cos(np.pi / k)
        low, high = (exact / worst, exact) if circumscribed else (exact, exact * worst)
        assert (low - ROUNDING <= gauge).all()
        assert (gauge <= high + ROUNDING).all()


class Diamond(Cone):
    """abs(v1) + abs(v2): with w >= abs(v1), abs(v2) <= t - w."""

    def gauge_of(self, rows: np.ndarray) -> np.ndarray:
        return np.asarray(np.abs(rows).sum(axis=0))

    def polar_gauge_of(self, rows: np.ndarray) -> np.ndarray:
        return np.asarray(np.abs(rows).max(axis=0))

    def rows_of(self, size: int) -> tuple[np.ndarray, np.ndarray]:
        linear = [[0.0, -1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]]
        linear += [[1.0, 0.0, -1.0, -1.0], [1.0, 0.0, 1.0, -1.0]]
        return np.array(linear), np.zeros((0, 4))


CONES = [(Conic(), 2), (Conic(), 4), (Parabola(), 3), (Diamond(), 2)]
CONES += [(facets(k, side), 2) for k in KS for side in (True, False)]


@pytest.mark.parametrize("polar", [False, True])
@pytest.mark.parametrize(("cone", "size"), [*CONES, (Diamond(), 1)], ids=str)
def test_matrices_of_a_cone_are_its_gauge_and_its_polar(cone: Cone, size: int, polar: bool) -> None:
    """The least bound that they allow is what NumPy says, for both. To 1e-7: Clarabel at its
    default 1e-8 on numbers of order one."""
    v = np.random.default_rng(size).normal(size=(size, 20))
    into = Constraints()
    if polar:
        bound, rows = cone.polar(into, 20, size)
        for row, values in zip(rows, v, strict=True):
            into.zero(row - values)
    else:
        cone.epigraph(into, bound := cp.Variable(20), [cp.Constant(row) for row in v])
    cp.Problem(cp.Minimize(cp.sum(bound)), into.all).solve(solver=cp.CLARABEL)
    expected = (cone.polar_gauge if polar else cone.gauge)(list(v))
    np.testing.assert_allclose(bound.value, expected, atol=1e-7)


def test_facets_approach_the_circle_as_one_over_k_squared() -> None:
    """The worst ratio 1 / cos(pi / K) - 1 falls by 4 when K doubles, to a few per cent at K = 8."""
    angles = np.linspace(0.0, 2.0 * np.pi, 20001)
    v = [np.cos(angles), np.sin(angles)]
    counts = np.array([8, 16, 32, 64])
    for circumscribed in (True, False):
        gap = [np.abs(facets(k, circumscribed).gauge(v) - 1.0).max() for k in counts.tolist()]
        rate = np.polyfit(np.log(counts), np.log(gap), 1)[0]
        assert rate == pytest.approx(-2.0, abs=0.05)


class TestNames:
    @pytest.mark.parametrize(
        ("name", "cone"),
        [
            ("conic", Conic()),
            ("octagon", Facets.circumscribed(8)),
            ("8-gon", Facets.circumscribed(8)),
            ("3-gon", Facets.circumscribed(3)),
            ("64-gon-inscribed", Facets.inscribed(64)),
            ("octagon-inscribed", Facets.inscribed(8)),
        ],
    )
    def test_parsed_and_printed(self, name: str, cone: Conic | Facets) -> None:
        assert parse_cone(name) == cone
        assert parse_cone(str(cone)) == cone

    @pytest.mark.parametrize(
        "name", ["", "circle", "gon", "8gon", "-8-gon", "8.5-gon", "conic-inscribed", "octagon "]
    )
    def test_other_names_are_refused(self, name: str) -> None:
        with pytest.raises(ModelError, match=f"surface must be .* got {name!r}"):
            parse_cone(name)

    @pytest.mark.parametrize("k", [-1, 0, 1, 2, True, 8.0])
    def test_too_few_facets(self, k: Any) -> None:
        for make in (Facets.circumscribed, Facets.inscribed):
            with pytest.raises(ModelError, match=f"at least 3 facets, got {k!r}"):
                make(k)

    def test_two_gon(self) -> None:
        with pytest.raises(ModelError, match="at least 3 facets, got 2"):
            parse_cone("2-gon-inscribed")


class TestSlidingAndTorsion:
    """Set forces, ask for the excess, change the coefficients, ask again."""

    def test_sliding(self) -> None:
        contacts = single_block(friction=0.5).contacts
        forces = np.array([[3.0, -4.0, 10.0, 7.0, 7.0, 7.0]])
        assert Sliding().excess(forces, contacts)[0].tolist() == [0.0]
        assert Sliding().excess(1.1 * forces, contacts)[0] == pytest.approx([0.0], abs=ROUNDING)
        slippery = contacts.with_values(friction=np.array([0.3]))
        assert Sliding().excess(forces, slippery)[0].tolist() == [2.0]

    def test_torsion(self) -> None:
        square = single_block((1.0, 1.0, 1.0), friction=0.5).contacts
        forces = np.array([[3.0, -4.0, 10.0, 7.0, 7.0, -0.3825978582]])
        expected = 1.0 - 5.0  # MT / c_T - mu N with c_T of published.json
        assert Torsion().excess(forces, square)[0] == pytest.approx([expected], abs=1e-9)
        double = square.scaled(2.0)
        assert Torsion().excess(forces, double)[0] == pytest.approx([0.5 - 5.0], abs=1e-9)

    def test_torsion_shear_is_their_sum(self) -> None:
        contacts = single_block((1.0, 0.5, 1.0), friction=0.4).contacts
        forces = np.array([[0.6, 0.8, 10.0, 0.0, 0.0, 2.0 * 0.2966167080]])
        assert TorsionShear().excess(forces, contacts)[0] == pytest.approx([-1.0], abs=1e-9)
        rough = contacts.with_values(friction=np.array([0.2]))
        assert TorsionShear().excess(forces, rough)[0] == pytest.approx([1.0], abs=1e-9)

    def test_facets_lean_on_the_contact_axes(self) -> None:
        """mu N along the axes; mu N / cos(22.5 degrees) halfway between two facet normals."""
        contacts = single_block(friction=0.5).contacts
        far = 0.5 / np.cos(np.pi / 8.0)
        angles = np.pi / 8.0 * np.arange(16)
        reach = np.where(np.arange(16) % 2 == 0, 0.5, far)
        for angle, v in zip(angles, reach, strict=True):
            forces = np.array([[v * np.cos(angle), v * np.sin(angle), 1.0, 0.0, 0.0, 0.0]])
            for cone, share in ((Facets.circumscribed(8), 1.0), (Facets.inscribed(8), 0.5 / far)):
                y = Sliding(cone).excess(share * forces * [1, 1, 1 / share, 1, 1, 1], contacts)
                assert y[0] == pytest.approx([0.0], abs=ROUNDING)

    @given(seed=st.integers(0, 2**32 - 1))
    @settings(max_examples=20, deadline=None)
    def test_homogeneous_and_convex(self, seed: int) -> None:
        generator = np.random.default_rng(seed)
        contacts = stack(50).contacts
        x, z = generator.normal(size=(2, 50, 6))
        for surface in (
            Rocking(), Sliding(), Torsion(), TorsionShear(), TorsionShear(Facets.inscribed(5)),
            Ellipse(), Core(0.5),
        ):  # fmt: skip
            for y, y2, yz, mixed in zip(
                *(surface.excess(f, contacts) for f in (x, 2.5 * x, z, 0.3 * x + 0.7 * z)),
                strict=True,
            ):
                np.testing.assert_allclose(y2, 2.5 * y, atol=1e-11)
                assert (mixed <= 0.3 * y + 0.7 * yz + 1e-11).all()


class TestPaperRows:
    """Eq. 9 and Eq. 25 as printed, row by row."""

    @pytest.mark.parametrize("k", [8, 5, 12])
    def test_eq_25(self, k: int) -> None:
        contacts = builtin_scene("tuff-wall").contacts
        forces = np.random.default_rng(k).normal(size=(len(contacts), 6))
        forces[:, 5] *= 0.05
        (y,) = TorsionShear(Facets.circumscribed(k)).excess(forces, contacts)
        for j, contact in enumerate(contacts):
            v1, v2, n, _, _, mt = forces[j]
            arm = hand_torsion_arm(contact)
            rows = [
                sign * mt / arm + np.cos(t) * v1 + np.sin(t) * v2 - contact.friction * n
                for sign in (1, -1)
                for t in 2.0 * np.pi * np.arange(k) / k
            ]
            assert y[j] == pytest.approx(max(rows), abs=ROUNDING)

    def test_eq_9_on_rectangles(self) -> None:
        contacts = builtin_scene("tuff-wall").contacts
        forces = np.random.default_rng(0).normal(size=(len(contacts), 6))
        forces[:, 3:5] *= 0.05
        worst = contacts.corner_minimum(-Rocking().excess(forces, contacts)[0])
        n, m1, m2 = forces[:, 2:5].T
        l1, l2 = contacts.sides.T
        expected = np.minimum(n - np.abs(m1) / (l2 / 2), n - np.abs(m2) / (l1 / 2))
        np.testing.assert_allclose(worst, expected, atol=ROUNDING)

    def test_hand_written_excess_agrees(self) -> None:
        """The helper that other tests check solutions with says the same as the classes."""
        contacts = (scene := builtin_scene("tuff-wall")).contacts
        forces = np.random.default_rng(1).normal(size=(len(contacts), 6)) * [1, 1, 1, 0.05, 0.05, 0]
        inside = np.all(
            [
                TorsionShear().excess(forces, contacts)[0] <= 0.0,
                contacts.corner_minimum(-Rocking().excess(forces, contacts)[0]) >= 0.0,
            ],
            axis=0,
        )
        assert 0 < inside.sum() < len(contacts)
        np.testing.assert_array_equal(yield_excess(scene, forces) <= 0.0, inside)


class TestRockingOnPolygons:
    @pytest.mark.parametrize("sides", [3, 4, 5, 6])
    def test_is_point_in_polygon(self, sides: int) -> None:
        contacts = contact_of(regular(sides))
        polygon = shapely.Polygon(corners_in_plane(contacts[0]))
        generator = np.random.default_rng(sides)
        inside = 0
        for e, n in zip(
            generator.uniform(-1.2, 1.2, (500, 2)), generator.uniform(0.1, 9, 500), strict=True
        ):
            forces = np.array([[9.0, 9.0, n, n * e[1], -n * e[0], 9.0]])
            admissible = Rocking().excess(forces, contacts)[0].max() <= 0.0
            assert admissible == polygon.covers(shapely.Point(e))
            inside += admissible
            assert Rocking().excess(-forces, contacts)[0].max() > 0.0  # no tension anywhere
        assert 50 < inside < 450

    def test_excess_is_the_moment_over_the_distance_to_the_edge(self) -> None:
        contacts = single_block((2.0, 1.0, 1.0)).contacts
        edge = np.array([[0.0, 0.0, 3.0, 0.0, 3.0 * 1.0, 0.0]])  # pressure centre at e1 = -1
        assert Rocking().excess(edge, contacts)[0].max() == pytest.approx(0.0, abs=ROUNDING)
        beyond = edge + np.array([0, 0, 0, 0, 0.5, 0])
        assert Rocking().excess(beyond, contacts)[0].max() == pytest.approx(0.5 / 1.0)


class TestConditions:
    @pytest.mark.parametrize(
        ("condition", "message"),
        [
            (Condition([Norm({"Mt": 1})], {"N": 0.5}), "component 'Mt': did you mean 'MT'"),
            (Condition([Norm({"V1": 1})], {"cohesion": 1.0}), "component 'cohesion': known are"),
            (Condition([Norm({"V1": 1})], {"N": np.nan}), "coefficient of N .* must be finite"),
            (Condition([Norm({"V1": np.ones(7)})], {"N": 1}), r"one number or 1 of them.*(7,)"),
            (Condition([Norm({"V1": "mu"})], {"N": 1}), "must be a number, got 'mu'"),
            (Condition([Norm({"V1": 1}, weight=None)], {"N": 1}), "weight of a norm"),
            (Condition([Norm({"V1": 1}, weight=-1)], {"N": 1}), "must not be negative, got -1"),
            (
                Condition([Norm({"V1": 1}, weight=cp.Parameter(value=-0.5))], {"N": 1}),
                "weight of a norm in .* must not be negative, got -0.5",
            ),
            ("abs(V) <= mu N", "must state Condition objects"),
        ],
    )
    def test_what_is_mistyped_is_refused_by_name(self, condition: Condition, message: str) -> None:
        class Mistyped(YieldSurface):
            name = "mistyped"

            def conditions(self, contacts: Contacts) -> Sequence[Condition]:
                return [condition]

        with pytest.raises(ModelError, match="surface 'mistyped'") as refusal:
            solve(single_block(), [Rocking(), Mistyped()])
        assert re.search(message, str(refusal.value))

    def test_facets_refuse_three_components(self) -> None:
        contacts = single_block().contacts
        with pytest.raises(ModelError, match="this surface has 3: use surface 'conic'"):
            Ellipse(Facets.circumscribed(8)).excess(np.ones((1, 6)), contacts)
        with pytest.raises(ModelError, match="this surface has 3: use surface 'conic'"):
            solve(single_block(), [Rocking(), Ellipse(Facets.circumscribed(8))])

    def test_parameter_coefficients(self) -> None:
        contacts = single_block().contacts
        surface = Cushion(0.5, 1)
        forces = np.array([[3.0, 4.0, 10.0, 0.0, 0.0, 0.0]])
        assert surface.excess(forces, contacts)[0].tolist() == [0.0]
        surface.mu.value = np.array([0.2])
        assert surface.excess(forces, contacts)[0].tolist() == [3.0]


def scalar_rows(problem: LimitProgram) -> int:
    return sum(constraint.size for constraint in problem.problem.constraints)


class TestRowsWritten:
    """n contacts, m corners, f free blocks: what a scene needs and no more."""

    @pytest.mark.parametrize("k", [5, 8])
    @pytest.mark.parametrize("extra", [(), (Sliding,), (Torsion,), (Torsion, Sliding)])
    def test_implied_surfaces_are_not(self, k: int, extra: tuple[type[YieldSurface], ...]) -> None:
        scene, cone = builtin_scene("tuff-wall"), Facets.circumscribed(k)
        n, m, f = len(scene.contacts), len(scene.contacts.corner_xy), len(scene.free)
        surfaces = [*(s(cone) for s in extra), TorsionShear(cone), Rocking()]
        yielding = 2 * n + k * n  # |MT| <= bound, K facets of V <= the rest
        for formulation in (corner_compressions, resultants):  # either way a row for each corner
            problem = LimitProgram(scene, surfaces, formulation=formulation)
            assert scalar_rows(problem) == 6 * f + yielding + m

    def test_without_the_sum_both_are(self) -> None:
        scene = builtin_scene("tuff-wall")
        n, m, f = len(scene.contacts), len(scene.contacts.corner_xy), len(scene.free)
        cone = Facets.circumscribed(8)
        problem = LimitProgram(scene, [Rocking(), Sliding(cone), Torsion(cone)])
        assert scalar_rows(problem) == 6 * f + 8 * n + 2 * n + m

    def test_names_kept(self) -> None:
        kept = needed_surfaces([Sliding(), Rocking(), Torsion(), TorsionShear()])
        assert [s.name for s in kept] == ["rocking", "torsion-shear"]

    @pytest.mark.parametrize(
        ("sum_cone", "slide_cone", "share"),
        [
            (Facets.circumscribed(8), Conic(), 1.0),  # the octagon alone would give 1.082
            (Conic(), Facets.inscribed(8), 1.0),
            (Conic(), Facets.inscribed(4), np.cos(np.pi / 4) / np.cos(np.pi / 8)),
            (Facets.circumscribed(8), Facets.inscribed(4), np.cos(np.pi / 4) / np.cos(np.pi / 8)),
        ],
    )
    def test_another_cone_is_not_implied(
        self, sum_cone: Cone, slide_cone: Cone, share: float
    ) -> None:
        """Sliding by another cone than the sum's may be the stricter one: it must count.

        Pushed halfway between two of the octagon's normals; the square's normals are 22.5 degrees
        off, so its inscribed version resists cos(45) / cos(22.5) of mu.
        """
        t = np.pi / 8.0
        live = Load(acceleration=(np.cos(t), np.sin(t), 0.0))
        scene = single_block((1.0, 1.0, 0.2), friction=0.5, live=live)
        solution = solve(scene, [Rocking(), TorsionShear(sum_cone), Sliding(slide_cone)])
        assert_certified(solution, scene, proved=False)
        assert solution.load_factor == pytest.approx(0.5 * share, rel=1e-6)

    def test_a_rocking_of_ones_own_is_not_silently_replaced(self) -> None:
        class Half(Rocking):
            def conditions(self, contacts: Contacts) -> Sequence[Condition]:
                return Core(0.5).conditions(contacts)

        with pytest.raises(ModelError, match=r"Half is named 'rocking'.*another name"):
            solve(single_block(), [Half(), TorsionShear()])

    def test_cohesion_is_not_left_out_in_silence(self) -> None:
        class Slip(Sliding):
            def conditions(self, contacts: Contacts) -> Sequence[Condition]:
                return [Condition([Norm({"V1": 1}, {"V2": 1})], {"N": contacts.friction})]

        class Whole(Sliding):
            def conditions(self, contacts: Contacts) -> Sequence[Condition]:
                return [Condition([Norm({"V1": 1}, {"V2": 1})], slip_resistance(contacts))]

        scene = single_block((1.0, 1.0, 0.2), friction=0.1).with_cohesion(0.5)
        with pytest.raises(
            ModelError, match=r"'sliding' would leave the scene's cohesion out.*0\)"
        ):
            solve(scene, [Rocking(), Slip()])
        with pytest.raises(ModelError, match="would leave the scene's cohesion out"):
            LimitProblem(scene, [Rocking(), Slip()]).solve()
        own = solve(scene, [Rocking(), Whole()])
        assert own.load_factor == pytest.approx(solve(scene, [Rocking(), Sliding()]).load_factor)
        dry = solve(scene.with_cohesion(0), [Rocking(), Slip()])
        assert dry.load_factor == pytest.approx(0.1, rel=1e-6)
        assert solve(scene, [Rocking()]).status == "certified"  # what never slips loses none

    def test_no_python_object_per_contact(self) -> None:
        small, large = (
            len(LimitProgram(builtin_scene(name)).problem.constraints)
            for name in ("single-block", "tuff-wall")
        )
        assert small == large

    @pytest.mark.parametrize(
        ("surfaces", "message"),
        [
            ([TorsionShear()], "lack rocking, so contacts would carry tension"),
            ([], "lack rocking"),
            ([Rocking(), Sliding(), Sliding()], "'sliding' is given twice"),
        ],
    )
    def test_refusals(self, surfaces: list[YieldSurface], message: str) -> None:
        with pytest.raises(ModelError, match=message):
            solve(single_block(), surfaces)

    def test_surfaces_must_be_surfaces(self) -> None:
        with pytest.raises(ModelError, match="a list of YieldSurface objects, got"):
            surfaces_of(["rocking"])  # type: ignore[list-item]


class TestOwnSurfaces:
    """A user's surface, solved and certified, between surfaces that contain it."""

    @pytest.mark.parametrize("name", ["tuff-wall", "ferris-tin-loi-3"])
    def test_ellipse(self, name: str) -> None:
        """TorsionShear inside the ellipse, the ellipse inside sliding and torsion."""
        scene = builtin_scene(name)
        inner = solve(scene)
        middle = solve(scene, [Rocking(), Ellipse()])
        outer = solve(scene, [Rocking(), Sliding(), Torsion()])
        for solution in (inner, middle, outer):
            assert_certified(solution, scene, proved=False)
        assert inner.lower <= middle.upper
        assert middle.lower <= outer.upper

    def test_ellipse_lies_strictly_between_where_torsion_and_shear_mix(self) -> None:
        """One block twisted and pushed: closed forms of all three surfaces."""
        mu, arm, h = 0.5, 0.3825978582, 20.0
        twist = Load(forces={"b1": (1.0, 0.0, 0.0, 0.0, 0.0, arm)})
        scene = single_block((1.0, 1.0, 0.1), density=10.0 * h, friction=mu, live=twist)
        weight = 10.0 * h * 0.1
        expected = {
            1.0 / 2.0: [Rocking(), TorsionShear()],
            1.0 / np.sqrt(2.0): [Rocking(), Ellipse()],
            1.0: [Rocking(), Sliding(), Torsion()],
        }
        for share, surfaces in expected.items():
            solution = solve(scene, surfaces)
            assert_certified(solution, scene, proved=False)
            assert solution.load_factor == pytest.approx(share * mu * weight, rel=1e-6)

    @pytest.mark.parametrize("share", [0.3, 0.8, 1.0])
    def test_linear_rows_alone(self, share: float) -> None:
        """Rocking about an edge of the shrunk contact: share * b / h."""
        solution = solve(single_block((0.4, 0.4, 1.0)), [Rocking(), Core(share)])
        assert_certified(solution, single_block((0.4, 0.4, 1.0)))
        assert solution.load_factor == pytest.approx(share * 0.4, rel=1e-6)

    def test_linear_rows_with_norms(self) -> None:
        scene = builtin_scene("ferris-tin-loi-1")
        factors = []
        for share in (0.6, 0.8, 1.0):
            solution = solve(scene, [Rocking(), TorsionShear(), Core(share)])
            assert_certified(solution, scene, proved=False)
            factors.append(solution)
        assert all(a.lower < b.upper for a, b in pairwise(factors))
        # A core of the whole contact changes nothing: the published value.
        assert factors[-1].load_factor == pytest.approx(0.642859, rel=1e-5)

    def test_one_sided_linear_row(self) -> None:
        """Shear along t1 limited to one side only: V1 >= -0.1 N."""

        class OneWay(YieldSurface):
            name = "one-way"

            def conditions(self, contacts: Contacts) -> Sequence[Condition]:
                return [Condition((), {"N": 0.1, "V1": 1})]

        ways = []
        for push in (1.0, -1.0):
            scene = single_block((1, 1, 0.2), friction=0.5, live=Load(acceleration=(push, 0, 0)))
            assert abs(scene.contacts[0].t1[0]) == 1.0
            solution = solve(scene, [Rocking(), TorsionShear(), OneWay()])
            assert_certified(solution, scene)
            ways.append(solution.load_factor)
        assert sorted(ways) == pytest.approx([0.1, 0.5], rel=1e-6)

    @pytest.mark.parametrize("formulation", [corner_compressions, resultants])
    @pytest.mark.parametrize("has_rows", [False, True])
    def test_parameters_change_between_solves(self, formulation: Any, has_rows: bool) -> None:
        """A slab slides at mu: one compiled problem, several frictions, no other answer."""
        scene = single_block((1.0, 1.0, 0.2))
        surface = Cushion(0.3, 1)
        problem = LimitProgram(scene, [Rocking(), surface, Torsion()], formulation=formulation)
        for mu in (0.3, 0.6, 0.1):
            surface.mu.value = np.array([mu])
            state = problem.run(has_rows=has_rows)
            assert state.load_factor == pytest.approx(mu, rel=1e-7)
