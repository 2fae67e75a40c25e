"""Bridges, soil that resists, loads on a road, vehicles: shapes, closed forms, another program."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.optimize import linprog

from cvxlimit import Load, Reaction, Road, Scene, Status, Vehicle, envelope, passive, solve
from cvxlimit.errors import InputError
from cvxlimit.geometry.polygons import area_and_centroid
from cvxlimit.masonry import Arch, bridge, stack
from helpers import assert_certified

PRESTWOOD = {"thickness": 0.22, "width": 3.8, "cover": 0.165, "density": 17.66, "fill": 20.0}
BOLTON_5 = {"thickness": 0.44, "width": 2.88, "cover": 0.295, "density": 23.7, "fill": 22.2}


class TestShapes:
    @pytest.mark.parametrize(
        ("arch", "area"),
        [
            (Arch(6.0, 3.0), np.pi * 9.0 / 2.0),
            (Arch(6.0, 2.0, "ellipse"), np.pi * 3.0 * 2.0 / 2.0),
            (Arch(6.0, 2.0, "parabola"), 2.0 / 3.0 * 6.0 * 2.0),
            (Arch(6.0, 3.0, "three-centred"), np.pi * 9.0 / 2.0),  # all circles are one
        ],
    )
    def test_area_below_the_intrados(self, arch: Arch, area: float) -> None:
        """Chords leave out a share that falls with the square of their number."""
        off = []
        for count in (40, 80):
            points, _ = replace(arch, voussoirs=count).intrados()
            off.append(area - abs(area_and_centroid(points[::-1])[0]))
        assert 0.0 < off[1] < 0.003 * area
        assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)

    @pytest.mark.parametrize("shape", ["segment", "ellipse", "parabola", "three-centred"])
    def test_joints_stand_at_right_angles_on_equal_chords(self, shape: str) -> None:
        points, normal = Arch(6.0, 2.0, shape).intrados()
        chords = np.diff(points, axis=0)
        length = np.linalg.norm(chords, axis=1)
        assert np.ptp(length) < 0.01 * length.mean()  # arcs are equal, chords nearly
        inner = (chords / length[:, None])[1:] + (chords / length[:, None])[:-1]
        assert np.abs((inner * normal[1:-1]).sum(axis=1)).max() < 0.02
        assert points[0] == pytest.approx([0.0, 0.0], abs=1e-9)
        assert points[len(points) // 2] == pytest.approx([3.0, 2.0], abs=1e-4)

    def test_measured_points_of_a_segment_are_that_segment(self) -> None:
        fine, _ = Arch(6.55, 1.428, voussoirs=4000).intrados()
        fine[[0, -1], 1] = 0.0
        measured = bridge(Arch(0.0, 0.0, points=fine), **PRESTWOOD)
        stated = bridge(Arch(6.55, 1.428), **PRESTWOOD)
        factors = [solve(scene).load_factor for scene in (measured, stated)]
        assert factors[0] == pytest.approx(factors[1], rel=1e-4)

    @pytest.mark.parametrize(
        ("wrong", "message"),
        [
            (lambda: Arch(6.0, 4.0), "rises by at most half its span, 3, got 4"),
            (lambda: Arch(6.0, 0.1, "three-centred"), "rises by more than"),
            (lambda: Arch(6.0, 1.0, "parabol"), "did you mean 'parabola'"),
            (lambda: Arch(6.0, 0.0), "rise"),
            (lambda: Arch(1, 1, points=[(0, 0), (1, 1), (1, 0)]), "growing x"),
            (lambda: bridge([Arch(3, 0.75)] * 2, thickness=0.2), "piers must be"),
            (lambda: bridge([Arch(3, 0.75)] * 2, thickness=0.4, piers=(0.3, 1)), "too narrow"),
            (lambda: bridge("arch", thickness=0.4), "must be Arch objects"),
            (lambda: Vehicle([]), "at least one"),
            (lambda: Vehicle([(0.0, -1.0)]), "force of an axle"),
        ],
    )  # fmt: skip
    def test_refused(self, wrong: object, message: str) -> None:
        with pytest.raises(InputError, match=message):
            wrong()  # type: ignore[operator]


class TestWeights:
    def test_masonry_and_fill_weigh_what_their_areas_do(self) -> None:
        """Between two levels: the fill is what the ring leaves below the road."""
        scene = bridge(Arch(6.55, 1.428), **PRESTWOOD)
        joints = Arch(6.55, 1.428).joints(0.22, 1)
        top, low = joints[:, 1], joints[:, 0]
        ring, _ = area_and_centroid(np.concatenate([top, low[::-1]]))
        level = top[:, 1].max() + 0.165
        above = np.trapezoid(level - top[:, 1], top[:, 0])
        expected = 3.8 * (17.66 * abs(ring) + 20.0 * above)
        assert -scene.dead_forces[:, 2].sum() == pytest.approx(expected, rel=1e-9)

    def test_several_spans_on_caps_and_shafts(self) -> None:
        scene = bridge([Arch(3.0, 0.75, voussoirs=12)] * 3, thickness=0.215, piers=(0.44, 1.5))
        ids = {block.id for block in scene.blocks}
        assert {"s1.v1", "s3.v12", "p1.cap", "p2.4", "p1.ground", "left-abutment"} <= ids
        assert not scene.near_misses
        assert len(scene.contacts) == 3 * 13 + 2 * 5

    def test_rings_fit_each_other(self) -> None:
        scene = bridge(
            Arch(5.0, 1.25, voussoirs=16), rings=3, ring_friction=0.4, friction=0.6, **BOLTON_5
        )
        assert len(scene.contacts) == 3 * 17 + 2 * 16
        assert not scene.told
        assert sorted(set(scene.contacts.friction.tolist())) == [0.4, 0.6]

    def test_a_semicircle_on_piers_has_no_caps(self) -> None:
        scene = bridge([Arch(3.0, 1.5, voussoirs=12)] * 2, thickness=0.2, piers=(0.6, 1.0))
        assert "p1.cap" not in {block.id for block in scene.blocks}
        assert_certified(solve(scene))


class TestSoil:
    def test_an_abutment_that_slides(self) -> None:
        """A block of weight W between soil on one side and a push from the other: mu W + P."""
        pushed = Load(forces={"b1": (1, 0, 0, 0, 0, 0)})
        wall = stack(1, size=(2.0, 1.0, 1.0), density=20.0, friction=0.5, live=pushed)
        soil = passive(wall, 1.0, 18.0, 1.5)
        solution = solve(replace(wall, reactions=soil))
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(0.5 * 40.0 + 1.5 * 18.0 / 2.0, rel=1e-6)

    def test_depth_and_faces(self) -> None:
        """A triangle of pressure below the level, at a third of its height; nothing above it."""
        wall = stack(2, size=(1.0, 2.0, 1.0))
        soil = passive(wall, 1.5, 10.0, 3.0)
        below, above = (sum(r.most for r in soil if r.block == b and r.direction[0] < 0.0)
                        for b in ("b1", "b2"))  # fmt: skip
        assert above == pytest.approx(3.0 * 10.0 * 0.5**2 / 2.0 * 2.0, rel=1e-9)
        assert below + above == pytest.approx(3.0 * 10.0 * 1.5**2 / 2.0 * 2.0, rel=1e-9)
        (top,) = (r for r in soil if r.block == "b2" and r.direction[0] < 0.0)
        assert top.at[2] == pytest.approx(1.0 + 0.5 / 3.0, rel=1e-9)

    def test_between_two_spans_soil_pushes_on_both(self) -> None:
        scene = bridge([Arch(3.0, 0.75, voussoirs=12)] * 2, thickness=0.215, piers=(0.44, 1.5))
        soil = passive(scene, 1.2, 20.0, 1.5)
        mutual = [r for r in soil if r.on is not None]
        assert mutual
        assert all(r.block.startswith("s1.") and r.on.startswith("s2.") for r in mutual)
        outer = {r.block[:3] for r in soil if r.on is None}
        assert outer == {"s1.", "s2."}


def in_plane(scene: Scene, patch: tuple[float, float]) -> float:
    """A linear program of our own for a bridge of one ring under a force of 1 spread evenly over
    ``patch`` (from, to) in plan: joints with two end compressions and a shear, blocks with three
    equations."""
    blocks = [scene.blocks[i] for i in scene.free]
    width = float(np.ptp(blocks[0].vertices[:, 1]))
    joints = [each for each in scene.contacts if not each.name.startswith("reaction")]
    place = {block.id: k for k, block in enumerate(blocks)}
    rows, columns = 3 * len(blocks), 3 * len(joints) + len(scene.reactions) + 1
    matrix, load = np.zeros((rows, columns)), np.zeros(rows)

    def add(column: int, key: str, at: np.ndarray, force: np.ndarray) -> None:
        if key in place:
            arm = at - blocks[place[key]].centroid[[0, 2]]
            i = 3 * place[key]
            matrix[i : i + 2, column] += force
            matrix[i + 2, column] += arm[0] * force[1] - arm[1] * force[0]

    for j, contact in enumerate(joints):
        corners = np.unique(np.round(contact.corners[:, [0, 2]], 9), axis=0)
        n = contact.normal[[0, 2]]
        t = np.array([-n[1], n[0]])
        for key, sign in ((contact.a, -1.0), (contact.b, 1.0)):
            add(3 * j, key, corners[0], sign * n)
            add(3 * j + 1, key, corners[1], sign * n)
            add(3 * j + 2, key, contact.origin[[0, 2]], sign * t)
    for k, r in enumerate(scene.reactions):
        for key, sign in ((r.block, 1.0), (r.on, -1.0)):
            push = sign * np.array(r.direction)[[0, 2]]
            add(3 * len(joints) + k, key, np.array(r.at)[[0, 2]], push)
    for key, point in ((p.block, p) for p in scene.dead.points):
        i = 3 * place[key]
        arm = np.array(point.at)[[0, 2]] - blocks[place[key]].centroid[[0, 2]]
        force = np.array(point.force)[[0, 2]]
        load[i : i + 3] += [*force, arm[0] * force[1] - arm[1] * force[0]]
    for k, block in enumerate(blocks):
        load[3 * k + 1] -= block.weight
        top = block.vertices[block.vertices[:, 1] < width / 2][:, [0, 2]]
        ends = np.array(sorted(_upper(top), key=lambda p: p[0]))
        low, high = max(ends[0, 0], patch[0]), min(ends[1, 0], patch[1])
        if high > low:
            share, x = (high - low) / (patch[1] - patch[0]), 0.5 * (low + high)
            matrix[3 * k + 1, -1] -= share
            matrix[3 * k + 2, -1] -= share * (x - block.centroid[0])
    mu = np.repeat([c.friction for c in joints], 2)
    friction = np.zeros((2 * len(joints), columns))
    for j in range(len(joints)):
        for s in (0, 1):
            friction[2 * j + s, 3 * j : 3 * j + 2] = -mu[2 * j]
            friction[2 * j + s, 3 * j + 2] = 1.0 if s else -1.0
    bounds = [(0, None), (0, None), (None, None)] * len(joints)
    bounds += [(r.least, r.most) for r in scene.reactions] + [(None, None)]
    cost = np.zeros(columns)
    cost[-1] = -1.0
    unit = np.abs(load).sum()
    scaled = [(None if a is None else a / unit, None if b is None else b / unit) for a, b in bounds]
    found = linprog(cost, friction, np.zeros(len(friction)), matrix, -load / unit, scaled)
    assert found.status == 0
    return float(found.x[-1]) * unit


def _upper(corners: np.ndarray) -> list[np.ndarray]:
    """The two of four corners of a voussoir whose chord is above its middle."""
    middle = corners.mean(axis=0)
    order = corners[np.argsort(np.arctan2(*(corners - middle).T[::-1]))]
    pairs = [(order[i - 1], order[i]) for i in range(4)]
    lifted = [0.5 * (a + b)[1] - middle[1] for a, b in pairs]
    return list(pairs[int(np.argmax(lifted))])


class TestLoads:
    @pytest.mark.parametrize("coefficient", [0.0, 1.5, 3.0])
    @pytest.mark.parametrize(
        ("arch", "sizes"), [(Arch(6.55, 1.428), PRESTWOOD), (Arch(5.0, 1.25), BOLTON_5)]
    )
    @pytest.mark.exhaustive_cases("arch0-sizes0-3.0", "arch1-sizes1-1.5")
    def test_prestwood_and_bolton_against_an_own_program(
        self, arch: Arch, sizes: dict[str, float], coefficient: float
    ) -> None:
        scene = bridge(arch, friction=0.6, **sizes)
        level = arch.rise + sizes["thickness"] + sizes["cover"]
        if coefficient:
            scene = replace(scene, reactions=passive(scene, level, sizes["fill"], coefficient))
        at = 0.25 * arch.span
        points = Road(scene, level).load(at, 1.0, 0.6, spread=0.0).points
        solution = solve(scene.with_live(Load(points=points)), model="least")
        assert_certified(solution)
        assert "planar" in solution.model
        # strips at the patch's ends are loaded in their middle, a sixth of a voussoir long
        assert solution.load_factor == pytest.approx(
            in_plane(scene, (at - 0.3, at + 0.3)), rel=2e-3
        )

    @pytest.mark.parametrize("at", [0.75, 1.5])
    def test_the_middle_one_of_three_spans_against_an_own_program(self, at: float) -> None:
        """Soil over a pier pushes on both spans, so that the neighbours must bear it."""
        sizes = {"thickness": 0.215, "width": 2.88, "cover": 0.305, "density": 23.7, "fill": 22.2}
        scene = bridge(
            [Arch(3.0, 0.75, voussoirs=20)] * 3, friction=0.6, piers=(0.44, 1.5), **sizes
        )
        level, middle = 0.75 + 0.215 + 0.305, 3.44 + at
        scene = replace(scene, reactions=passive(scene, level, 22.2, 3.0))
        points = Road(scene, level).load(middle, 1.0, 0.42, spread=0.0).points
        solution = solve(scene.with_live(Load(points=points)))
        assert_certified(solution)
        # strips at the patch's ends are loaded in their middle, as above
        own = in_plane(scene, (middle - 0.21, middle + 0.21))
        assert solution.load_factor == pytest.approx(own, rel=2e-3)
        # from fixed ground over the piers as well, which it has not, soil would hold more
        apart = [replace(r, on=None) for r in scene.reactions]
        apart += [
            replace(r, block=r.on, on=None, direction=tuple(-x for x in r.direction))
            for r in scene.reactions
            if r.on is not None
        ]
        fixed = solve(replace(scene, reactions=apart).with_live(Load(points=points)))
        assert fixed.load_factor > 1.3 * solution.load_factor

    def test_what_is_spread_is_all_there(self) -> None:
        scene = bridge(Arch(6.55, 1.428), **PRESTWOOD)
        road = Road(scene, 1.428 + 0.22 + 0.165)
        for spread in (0.0, 0.5, "boussinesq"):
            found = road.load(3.0, 100.0, spread=spread)
            assert found.lost == 0.0
            assert sum(p.force[2] for p in found.points) == pytest.approx(-100.0, rel=1e-12)
            middle = sum(p.at[0] * p.force[2] for p in found.points) / -100.0
            assert middle == pytest.approx(3.0, abs=0.02)
        half = road.load(-0.2, 100.0)
        assert half.lost > 20.0
        assert half.lost - sum(p.force[2] for p in half.points) == pytest.approx(100.0)
        with pytest.raises(InputError, match="reaches no free block"):
            road.load(-5.0, 100.0)
        with pytest.raises(InputError, match="lies below a face"):
            Road(scene, 1.0).load(3.0, 100.0)

    def test_an_elastic_half_space(self) -> None:
        """Flamant's line loads, along a strip of 0.3 m, at a depth of 0.5 m beside a beam's end."""
        depth, cut = 0.5, 0.15 + 0.5 * np.tan(np.radians(30.0))

        def below(x: float, s: float) -> float:
            return 2.0 * depth**3 / (np.pi * ((x - s) ** 2 + depth**2) ** 2)

        beyond, whole = (dblquad(below, -0.15, 0.15, -cut, end)[0] for end in (-0.1, cut))
        beam = stack(1, size=(4.0, 1.0, 0.5))
        found = Road(beam, 0.5 + depth).load(0.1, 100.0, spread="boussinesq")
        assert found.lost == pytest.approx(100.0 * beyond / whole, rel=1e-9)


class TestVehicles:
    def test_each_position_is_a_solve_of_its_own(self) -> None:
        scene = bridge(Arch(3.0, 0.75, voussoirs=12), thickness=0.2, width=1.0, cover=0.2)
        vehicle, level = Vehicle([(0.0, 30.0), (1.0, 50.0)]), 1.15
        found = envelope(scene, vehicle, [0.5, 1.5, 2.5], level)
        assert [each.is_forward for each in found.crossings] == [True] * 3 + [False] * 3
        road = Road(scene, level)
        for each in found.crossings:
            sign = 1.0 if each.is_forward else -1.0
            points = [
                p
                for behind, force in vehicle.axles
                if road.reaches(each.at - sign * behind)
                for p in road.load(each.at - sign * behind, force).points
            ]
            alone = solve(scene.with_live(Load(points=points)))
            if alone.status in (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED):  # over a springing
                assert each.load_factor == np.inf
            else:
                assert_certified(each.solution)
                assert each.load_factor == pytest.approx(alone.load_factor, rel=1e-6)
        worst = min(each.load_factor for each in found.crossings)
        assert found.worst.load_factor == worst
        table = found.to_dataframe()
        assert table["load_factor"].min() == worst
        assert "least load factor" in str(found)

    @pytest.mark.parametrize("progress", [True, False, None, "lines"])
    def test_one_axle_is_solved_once_at_a_place(
        self, progress: Any, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """Whichever way it goes; two axles are other loads, where they are not each other's."""
        scene = bridge(Arch(3.0, 0.75, voussoirs=12), thickness=0.2, width=1.0, cover=0.2)
        lines = list[str]()
        told = lines.append if progress == "lines" else progress
        given = ([0.5, 1.0], 1.15)
        one = envelope(scene, Vehicle([(0.0, 30.0)]), *given, progress=told)
        assert len({id(each.solution) for each in one.crossings}) == 2
        assert [each.is_forward for each in one.crossings] == [True, True, False, False]
        assert len(lines) == (4 if progress == "lines" else 0)
        assert ("crossing" in capsys.readouterr().err) is (progress is True)
        # 30 in front of 30 by half a metre, at 1.0 forward and at 0.5 backward, is the same load
        two = envelope(scene, Vehicle([(0.0, 30.0), (0.5, 30.0)]), *given, progress=told)
        assert len({id(each.solution) for each in two.crossings}) == 3

    def test_off_the_bridge_any_multiple_is_carried(self) -> None:
        scene = bridge(Arch(3.0, 0.75, voussoirs=12), thickness=0.2, width=1.0, cover=0.2)
        found = envelope(scene, Vehicle([(0.0, 30.0)]), [-5.0, 1.0], 1.15, both_ways=False)
        assert found.crossings[0].load_factor == np.inf
        assert found.crossings[0].lost == 30.0
        table = found.to_dataframe()
        assert table.loc[0, ["load_factor", "lower", "upper"]].tolist() == [np.inf] * 3
        with pytest.raises(InputError, match="beside 'bridge' at all positions"):
            envelope(scene, Vehicle([(0.0, 30.0)]), [-5.0], 1.15)

    def test_three_spans_carry_less_than_one(self) -> None:
        """As the Bolton tests found: the middle span's neighbours give way."""
        sizes = {"thickness": 0.215, "width": 2.88, "cover": 0.305, "density": 23.7, "fill": 22.2,
                 "friction": 0.6}  # fmt: skip
        level, axle = 0.75 + 0.215 + 0.305, Vehicle([(0.0, 1.0)], length=0.42)
        least = []
        for count, places in ((1, np.linspace(0.3, 2.7, 9)), (3, 3.44 + np.linspace(0.3, 2.7, 9))):
            piers = {"piers": (0.44, 1.5)} if count > 1 else {}
            scene = bridge([Arch(3.0, 0.75, voussoirs=20)] * count, **sizes, **piers)
            scene = replace(scene, reactions=passive(scene, level, 22.2, 3.0))
            found = envelope(scene, axle, places, level, both_ways=False)
            assert not np.isnan([each.load_factor for each in found.crossings]).any()
            least.append(found.worst.load_factor)
        assert least[1] < 0.9 * least[0]


def test_free_abutments_need_their_soil() -> None:
    """They slide long before the arch falls; soil behind arch and abutments gives that back."""
    sizes = {"thickness": 0.22, "width": 3.8, "cover": 0.165, "density": 17.66, "fill": 20.0,
             "friction": 0.5}  # fmt: skip
    arch, level = Arch(6.55, 1.428), 1.428 + 0.22 + 0.165
    fixed = bridge(arch, **sizes)
    free = bridge(arch, abutments=(0.6, 1.0), **sizes)
    held = replace(free, reactions=passive(free, level, 20.0, 1.5))
    fixed = replace(fixed, reactions=passive(fixed, level, 20.0, 1.5))
    factors = []
    for scene in (free, held, fixed):
        load = Road(scene, level).load(0.25 * 6.55, 1.0)
        found = solve(scene.with_live(Load(points=load.points)))
        assert found.status is Status.CERTIFIED
        factors.append(found.load_factor)
    assert factors[0] < 0.5 * factors[1] < factors[1] <= factors[2] * (1.0 + 1e-6)
    assert isinstance(held.reactions[0], Reaction)
