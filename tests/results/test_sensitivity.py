"""Derivatives from forces and mechanism, against differences of solves and closed forms."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cvxlimit import (
    Block,
    GrowingAcceleration,
    Load,
    PointForce,
    Pressure,
    Scene,
    Status,
    builtin_scene,
    solve,
)
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.masonry import arch, single_block
from cvxlimit.results.sensitivity import Sensitivity
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface
from exhaustive import slow

FloatArray = NDArray[np.float64]
TIGHT = 1e-9
STEP = 3e-5


class Ellipse(YieldSurface):
    """sqrt(V^2 + (MT / c_T)^2) <= mu N + c A."""

    name = "ellipse"

    def conditions(self, contacts: Contacts) -> list[Condition]:
        size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / contacts.torsion_arm})
        available = {"N": contacts.friction, "1": contacts.cohesion * contacts.area}
        return [Condition([size], available)]


SURFACES = {"ellipse": [Rocking(), Ellipse()]}


def varied(scene: Scene, seed: int) -> Scene:
    """Other friction in every joint and another weight of every block: mechanisms are unique."""
    random = np.random.default_rng(seed)
    friction = {pair: scene.friction * random.uniform(0.7, 1.3) for pair in scene.contacts.pairs}
    blocks = [
        b if b.density is None else replace(b, density=b.density * random.uniform(0.7, 1.3))
        for b in scene.blocks
    ]
    return replace(scene, blocks=tuple(blocks), contact_friction=friction)


def mapped(scene: Scene, place: Callable[[str, FloatArray], FloatArray]) -> Scene:
    """With the vertices of all blocks elsewhere; points of application stay."""
    blocks = [
        Block.polyhedron(b.id, place(b.id, b.vertices), b.faces, b.density) for b in scene.blocks
    ]
    return replace(scene, blocks=tuple(blocks))


def weighted(scene: Scene, factors: Mapping[str, float]) -> Scene:
    own = [
        replace(b, density=b.density and b.density * factors.get(b.id, 1.0)) for b in scene.blocks
    ]
    return scene._copy(blocks=tuple(own))


def loaded(scene: Scene) -> Scene:
    """With forces at centroids and at a point, a pressure, and a dead force."""
    block = scene.blocks[int(scene.free[-1])]
    top = block.vertices[block.vertices[:, 2].argmax()]
    weight = block.weight
    push = Load(
        acceleration=(1, 0.1, 0),
        forces={block.id: (0.2 * weight, 0, 0, 0, 0.02 * weight * block.size, 0)},
        points=[PointForce(block.id, tuple(top), (0.3 * weight, 0.1 * weight, 0))],
        pressures=[
            Pressure(block.id, (0, 0, 1), 0.4 * weight / block.size**2, (0.3, 0, 0), tuple(top))
        ],
        growing=[GrowingAcceleration((0.2, 0, 0.05), (0, 0, 0), tuple(top))],
    )
    dead = replace(scene.dead, forces={block.id: (0, 0, -weight, 0, 0, 0)})
    return replace(scene, live=push, dead=dead)


def glued(scene: Scene, tension: float = 0.0, crushing: float = np.inf) -> Scene:
    stress = scene.total_weight / len(scene.contacts) / float(np.median(scene.contacts.area))
    return scene.with_joints(
        cohesion=0.4 * stress, tensile_strength=tension * stress,
        compressive_strength=crushing * stress,
    )  # fmt: skip


def slope(at: Callable[[float], float], step: float) -> float:
    """A derivative by four solves, without errors of the second and third order."""
    near, far = (at(k * step) - at(-k * step) for k in (1, 2))
    return (8.0 * near - far) / (12.0 * step)


def pairs_of(
    scene: Scene, surface: str, seed: int, widths: list[float]
) -> Iterator[tuple[str, float, float]]:
    """Derivatives along a direction each, of about all values at once: by the proof, by solves,
    the widths of whose brackets are kept."""
    random = np.random.default_rng(seed)

    def factor(changed: Scene) -> float:
        found = solve(changed, SURFACES.get(surface, surface), tolerance=TIGHT)
        assert found.load_factor is not None
        assert found.lower is not None
        assert found.upper is not None
        widths.append(found.upper - found.lower)
        return found.load_factor

    found = solve(scene, SURFACES.get(surface, surface), tolerance=TIGHT).sensitivity()
    assert found.solution.gap < 1e-8
    # a joint that crushes evenly across may turn that way: only loads in the plane have one slope
    across = [1, 3, 5] if found.has_other_mechanisms else []
    assert bool(across) == np.isfinite(scene.compressive_strength)
    contacts = scene.contacts
    for name in ("friction", "cohesion", "compressive_strength", "tensile_strength"):
        value, by = getattr(contacts, name), getattr(found, name)
        if not (np.isfinite(value) & (value > 0.0)).any():
            continue
        share = dict(zip(contacts.pairs, random.uniform(0.5, 1.0, len(value)), strict=True))
        way = value * [share[pair] for pair in contacts.pairs]

        def joints(k: float, name: str = name, way: FloatArray = way) -> float:
            own = getattr(contacts, name) + k * way
            given = dict(zip(contacts.pairs, own.tolist(), strict=True))
            return factor(scene.with_joints(**{f"contact_{name}": given}))

        yield name, float(by @ way), slope(joints, STEP)
    shares = random.uniform(-1.0, 1.0, len(scene.free))
    weights = np.array([scene.blocks[i].weight for i in scene.free])

    def heavier(k: float) -> float:
        ids = [scene.blocks[i].id for i in scene.free]
        return factor(weighted(scene, dict(zip(ids, 1.0 + k * shares, strict=True))))

    yield "weight", float(found.weight @ (weights * shares)), slope(heavier, STEP)
    by_case = {"dead": found.dead, "live": found.live}
    for case, by in by_case.items():
        further = random.uniform(-1.0, 1.0, by.shape) * weights[:, None]
        further[:, across] = 0.0

        def more(k: float, case: str = case, further: FloatArray = further) -> float:
            load = getattr(scene, case)
            forces = dict(load.forces)
            for i, own in zip(scene.free, further, strict=True):
                key = scene.blocks[i].id
                forces[key] = tuple(np.array(forces.get(key, np.zeros(6))) + k * own)
            return factor(replace(scene, **{case: replace(load, forces=forces)}))

        yield case, float((by * further).sum()), slope(more, STEP)
    # every vertex of every block moves, and blocks still meet: an affine map, of the plane of
    # walls and arches, since forces across these are not unique
    turn = random.uniform(-1.0, 1.0, (3, 3))
    turn[1, [0, 2]] = turn[[0, 2], 1] = 0.0

    def bent(k: float) -> float:
        return factor(mapped(scene, lambda _, at: at + k * at @ turn.T))

    by_vertex = zip(scene.blocks, found.vertices.values(), strict=True)
    total = sum(float((by * (block.vertices @ turn.T)).sum()) for block, by in by_vertex)
    yield "vertices", total, slope(bent, STEP)


SCENES: dict[str, Callable[[], Scene]] = {
    **{name: lambda name=name: builtin_scene(name) for name in (
        "stack", "ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3", "arch", "tuff-wall",
        "house-corner", "arch-on-piers", "flying-buttress", "barrel-vault", "dome",
    )},
    "arch with all kinds of loads": lambda: loaded(builtin_scene("arch")),
    "stack with all kinds of loads": lambda: loaded(builtin_scene("stack")),
    "arch with mortar": lambda: glued(builtin_scene("arch"), tension=0.2),
    "wall with cohesion": lambda: glued(builtin_scene("ferris-tin-loi-1")),
    "arch that crushes": lambda: glued(builtin_scene("arch"), crushing=300.0),
    "stack that crushes and tears": lambda: glued(builtin_scene("stack"), 0.1, 50.0),
}  # fmt: skip
CASES = [
    *((name, "conic", seed) for name in SCENES for seed in (1, 2)),
    ("tuff-wall", "octagon", 1), ("arch-on-piers", "octagon-inscribed", 2),
    ("tuff-wall", "parabolic", 1), ("dome", "parabolic", 1), ("tuff-wall", "ellipse", 1),
    ("house-corner", "ellipse", 1), ("wall with cohesion", "ellipse", 1),
]  # fmt: skip
FAST = [("stack with all kinds of loads", "conic", 1), ("arch", "conic", 2)]


@pytest.mark.parametrize(
    ("name", "surface", "seed"),
    [case if case in FAST else slow(*case) for case in CASES],
)
def test_against_differences(name: str, surface: str, seed: int) -> None:
    widths: list[float] = []
    for what, by, expected in pairs_of(varied(SCENES[name](), seed), surface, seed, widths):
        unsure = 18.0 / 12.0 * max(widths) / STEP  # four solves, each anywhere in its bracket
        assert by == pytest.approx(expected, rel=1e-5, abs=3e-6 + unsure), what


def block_on(
    friction: float, width: float = 1.0, height: float = 2.5, **loads: Load
) -> Sensitivity:
    return solve(
        replace(single_block((width, 1.0, height), friction=friction), **loads)
    ).sensitivity()


class TestClosedForms:
    def test_a_block_that_tips(self) -> None:
        """alpha = b / h, half the width over the height of the centroid above the mean plane of the
        joint: -b / h^2 by that height, of which the top has half; the foot of the block lifts
        plane and centroid alike, and the ground the plane."""
        found = block_on(0.7)
        assert found.friction == pytest.approx(0.0, abs=1e-9)
        top, hinge = found.vertices["b1"][4:], found.vertices["b1"][:4]
        assert top[:, 2].sum() == pytest.approx(-0.16, rel=1e-6)
        assert hinge[:, 2].sum() == pytest.approx(0.0, abs=1e-9)
        assert found.moves[0, 2] == pytest.approx(0.16, rel=1e-6)
        wider = 0.0  # both blocks, whose edges coincide, about the middle of the joint
        for block, by in zip(found.solution.scene.blocks, found.vertices.values(), strict=True):
            wider += (by * (block.vertices - block.centroid))[:, :2].sum()
        assert wider == pytest.approx(0.4, rel=1e-6)
        assert found.moves.sum(axis=0) == pytest.approx(0.0, abs=1e-9)

    def test_a_block_that_slides(self) -> None:
        """alpha = mu + c A / W: 1 by friction, A / W by cohesion, -c A / W^2 by the weight."""
        scene = single_block((1.0, 1.0, 0.5), friction=0.5).with_cohesion(3.0)
        found = solve(scene).sensitivity()
        weight = scene.total_weight
        assert found.friction == pytest.approx([1.0], rel=1e-6)
        assert found.cohesion == pytest.approx([1.0 / weight], rel=1e-6)
        assert found.weight == pytest.approx([-3.0 / weight**2], rel=1e-5)

    def test_what_a_force_adds_and_where(self) -> None:
        """Tipping by a force F at height z about the edge at 1: alpha = W / 2 / (F z)."""
        scene = single_block((1.0, 1.0, 2.0), friction=0.9)
        push = Load(points=[PointForce("b1", (0.0, 0.5, 1.6), (3.0, 0.0, 0.0))])
        found = solve(replace(scene, live=push)).sensitivity()
        factor = scene.total_weight / 2.0 / (3.0 * 1.6)
        by = {
            (row.kind, row.component): row.derivative for row in found.loads if row.case == "live"
        }
        assert by["points", "fx"] == pytest.approx(-factor / 3.0, rel=1e-6)
        assert by["points", "z"] == pytest.approx(-factor / 1.6, rel=1e-6)
        assert found.elasticity("weight").sum() == pytest.approx(1.0, rel=1e-6)

    def test_linear_pressures_and_growing_inertia(self) -> None:
        """alpha = (W / 2) / (p / 2 + g (1/2 - 1/6) + 2/3 W a), of a unit cube under a pressure p
        that grows by g downwards from its top, and an acceleration a that grows with height; its
        live parts are one load, of which alpha is inversely proportional."""
        water = Pressure("b1", (-1, 0, 0), 1.5, (0, 0, -2.0), (0, 0, 1), (0, 0, -1))
        growing = GrowingAcceleration((0.5, 0, 0), (0, 0, 0), (0, 0, 1))
        live = Load(pressures=[water], growing=[growing])
        found = solve(replace(single_block((1, 1, 1), friction=3.0), live=live)).sensitivity()
        scene = found.solution.scene
        weight = scene.total_weight
        moment = 0.75 + 2.0 / 6.0 + 0.5 * weight / 3.0
        alpha = weight / 2.0 / moment
        assert found.factor == pytest.approx(alpha, rel=1e-6)
        by = {(row.kind, row.component): row for row in found.loads if row.case == "live"}
        for key, arm in (
            (("pressures", "pressure"), 0.5),
            (("pressures", "gradient.z"), -1.0 / 6.0),
            (("growing", "x"), weight / 3.0),
        ):
            assert by[key].derivative == pytest.approx(-alpha * arm / moment, rel=1e-5), key
        assert sum(row.value * row.derivative for row in by.values()) == pytest.approx(-alpha)

    def test_the_tuff_wall(self) -> None:
        found = solve(builtin_scene("tuff-wall")).sensitivity()
        assert found.friction.sum() == pytest.approx(0.98164, abs=1e-5)


@pytest.mark.parametrize("name", ["arch", slow("house-corner")])
def test_invariances(name: str) -> None:
    """No change by moving everything, by all weights together, or by other units; derivatives turn
    with the scene."""
    scene = varied(builtin_scene(name), 3)
    found = solve(scene, tolerance=TIGHT).sensitivity()
    every = np.concatenate([*found.vertices.values()])
    assert every.sum(axis=0) == pytest.approx(0.0, abs=1e-6 * np.abs(every).sum())
    assert found.elasticity("weight").sum() == pytest.approx(0.0, abs=1e-6)
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    turned = solve(scene.moved(turn, (3.0, -1.0, 2.0)), tolerance=TIGHT).sensitivity()
    other = np.concatenate([*turned.vertices.values()])
    sided = found.one_sided["vertices"] | turned.one_sided["vertices"]
    scale = np.abs(every).max()
    assert other[~sided] == pytest.approx((every @ turn.T)[~sided], abs=2e-5 * scale)
    small = solve(scene.in_units(scene.units, 1e3, 7.0), tolerance=TIGHT).sensitivity()
    assert small.friction == pytest.approx(found.friction, abs=1e-6)
    assert 7.0 * small.weight == pytest.approx(found.weight, abs=1e-6 / scene.total_weight)


class TestKinks:
    def test_both_sides_of_one(self) -> None:
        """A block that may slide or tip: friction counts downwards only."""
        scene = single_block((1.0, 1.0, 2.0), friction=0.5)
        found = solve(scene, tolerance=TIGHT).sensitivity()
        sides = found.both_sides(lambda d: scene.with_friction(0.5 + d), 0.01)
        assert sides == pytest.approx((1.0, 0.0), abs=1e-4)
        assert found.has_other_mechanisms
        assert -1e-6 <= float(found.friction[0]) <= 1.0 + 1e-6
        assert "other mechanisms" in found.note

    def test_hinges_whose_forces_are_not_unique(self) -> None:
        """Where an arch turns, forces along the hinge are its own; moved at one end it is less or
        more of a hinge. At all other vertices slopes are unique."""
        scene = arch(voussoirs=7)
        found = solve(scene, tolerance=TIGHT).sensitivity()
        sided = dict(
            zip(
                found.vertices,
                np.split(found.one_sided["vertices"], len(scene.blocks)),
                strict=True,
            )
        )
        hinged = {name for name, flags in sided.items() if flags.any()}
        table = found.solution.to_dataframe()
        opens = table[table["state"] == "opens"]
        assert hinged == {*opens["a"], *opens["b"]}
        assert not any(flags.any() for what, flags in found.one_sided.items() if what != "vertices")

    @pytest.mark.parametrize("block", ["b1", "b2"])
    def test_vertices_on_a_shared_edge(self, block: str) -> None:
        """A block that slides glued on one of its own size: cohesion counts on the area that both
        have, so that narrowing either narrows it, widening it does not, and each has half of it."""
        ground = Block.box("b1", (0, 0, -1), (1, 1, 0), density=1e-6)
        slab = Block.box("b2", (0, 0, 0), (1, 1, 0.2), density=1.0)
        push = Load(forces={"b2": (1, 0, 0, 0, -0.1, 0)})  # at the joint
        scene = Scene([ground, slab], ["b1"], push, friction=0.3).with_cohesion(1.0)
        found = solve(scene, tolerance=TIGHT).sensitivity()
        right = {"b1": [5, 6], "b2": [1, 2]}
        assert found.shared[block][right[block]].all()
        own = found.vertices[block][right[block], 0].sum()
        heavier = 0.3 * 0.1 if block == "b2" else 0.0  # friction of the weight of what is added
        assert own == pytest.approx(0.5 + heavier, abs=1e-5)


class TestRefusals:
    @pytest.mark.parametrize(
        ("options", "why"),
        [
            ({"method": "zero-dilatancy"}, "without dilatancy"),
            ({"method": "fixed-point"}, "with interaction"),
            ({"method": "exact"}, "stated by no surface"),
        ],
    )
    def test_what_is_no_optimum(self, options: dict[str, str], why: str) -> None:
        solution = solve(builtin_scene("single-block"), **options)
        with pytest.raises(InputError, match=why):
            solution.sensitivity()

    def test_without_forces(self) -> None:
        solution = replace(solve(builtin_scene("single-block")), forces=None)
        with pytest.raises(InputError, match="no load factor with forces and mechanism"):
            solution.sensitivity()

    def test_uncertified_says_so(self) -> None:
        solution = replace(solve(builtin_scene("single-block")), status=Status.NOT_CERTIFIED)
        found = solution.sensitivity()
        assert not found.is_proved
        assert "prove nothing" in found.note


def test_tables_state_units() -> None:
    found = solve(loaded(builtin_scene("stack"))).sensitivity()
    for what, rows in (
        ("contacts", 5),
        ("blocks", 6),
        ("vertices", 48),
        ("loads", len(found.loads)),
    ):
        table = found.to_dataframe(what)
        assert len(table) == rows
        assert table.attrs["note"] == found.note
        assert set(table.attrs["units"]) <= set(table.columns)
        assert set(table.attrs["description"]) == set(table.columns)
    with pytest.raises(InputError, match="there is no table"):
        found.to_dataframe("joints")


def test_moves_that_change_nothing_are_none() -> None:
    """A dam that slides as one: its factor is friction times weight over water, wherever it is."""
    solution = solve(builtin_scene("dam"))
    found = solution.sensitivity()
    assert not found.moves.any()
    assert [name for name, _ in found.rows[:-1]] == ["friction", "weight"]


def test_a_footprint_with_a_notch() -> None:
    """Corners of the notch count by area and torsion, those of the hull by rocking too."""
    u = np.array([(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
    vertices = np.vstack([np.c_[u, np.zeros(8)], np.c_[u, np.full(8, 2.0)]])
    sides = [[i, (i + 1) % 8, 8 + (i + 1) % 8, 8 + i] for i in range(8)]
    faces = [[*range(8)][::-1], [*range(8, 16)], *sides]
    ground = Block.box("ground", (-1, -1, -1), (4, 4, 0))
    push = Load(acceleration=(0.2, 1, 0), forces={"u": (0, 0, 0, 0, 0, 3.0)})

    def scene(at: FloatArray) -> Scene:
        block = Block.polyhedron("u", at, faces, density=1.0)
        return Scene([ground, block], ["ground"], push, friction=0.3)

    way = np.zeros_like(vertices)
    way[:8, :2] = way[8:, :2] = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 2))
    found = solve(scene(vertices), tolerance=TIGHT).sensitivity()
    by = float((found.vertices["u"] * way).sum())

    def factor(k: float) -> float:
        value = solve(scene(vertices + k * way), tolerance=TIGHT).load_factor
        assert value is not None
        return value

    assert by == pytest.approx(slope(factor, 1e-4), rel=1e-5)
