"""Blocks, stacks and wedges in closed form: what every program must get right first."""

from __future__ import annotations

from dataclasses import replace
from math import asinh, atan, cos, pi, sin, sqrt, tan

import numpy as np

from benchmarks.bench.case import SURFACES, Quantity, Value, case
from cvxlimit import Block, Load, PointForce, Scene
from cvxlimit.masonry import single_block, stack


def known(number: float, digits: int = 9, model: str = "conic") -> Value:
    """A value of statics, rounded to so many digits."""
    return Value(f"{number:.{digits}f}", "statics", model=model)


@case(
    "block-rocks", "block 0.2 x 1.0 m pushed at its centroid: b / h",
    Value("0.2", "portioli-2020", "other program"), known(0.2),
)  # fmt: skip
def block_rocks() -> Scene:
    return single_block((0.2, 0.2, 1.0))


@case("block-slides", "block of little friction: mu", known(0.3))
def block_slides() -> Scene:
    return single_block((0.4, 0.4, 0.4), friction=0.3)


@case(
    "block-slides-askew", "block that slides at 22.5 degrees: mu; mu / cos(22.5) on the octagon",
    known(0.3), known(0.3 / cos(pi / 8), model="octagon"),
)  # fmt: skip
def block_slides_askew() -> Scene:
    push = Load(acceleration=(cos(pi / 8), sin(pi / 8), 0.0))
    return single_block((0.4, 0.4, 0.2), friction=0.3, live=push)


@case(
    "block-rocks-on-corner", "block pushed along its diagonal: sqrt(2) b / h",
    known(sqrt(2) * 0.4),
)  # fmt: skip
def block_rocks_on_corner() -> Scene:
    return single_block(live=Load(acceleration=(sqrt(0.5), sqrt(0.5), 0.0)), friction=0.9)


def arm(l1: float, l2: float) -> float:
    """Mean distance of a rectangle's points from its centre (Eq. 16)."""
    r, s = min(l1, l2) / max(l1, l2), max(l1, l2)
    return s * (asinh(r) / r + r * r * asinh(1 / r) + 2 * sqrt(1 + r * r)) / 12


TORQUE = Quantity("torque", "kNm")


@case(
    "block-twisted", "square block twisted about the vertical: c_T mu N",
    known(arm(0.4, 0.4) * 0.7 * 3.2), Value("0.342808", "portioli-exact"),
    models=SURFACES, quantity=TORQUE,
)  # fmt: skip
def block_twisted() -> Scene:
    return single_block(live=Load(forces={"b1": (0, 0, 0, 0, 0, 1)}))


@case(
    "block-2-1-twisted", "block 2 : 1 twisted about the vertical: c_T mu N",
    known(arm(0.4, 0.2) * 0.7 * 1.6), models=SURFACES, quantity=TORQUE,
)  # fmt: skip
def block_2_1_twisted() -> Scene:
    return single_block((0.4, 0.2, 1.0), live=Load(forces={"b1": (0, 0, 0, 0, 0, 1)}))


def sheared(l1: float, l2: float, shear: float, torsion: float) -> Scene:
    """Shares of mu N and of c_T mu N at once, in the plane of the joint below the block."""
    block = single_block((l1, l2, 0.4))
    weight = 20.0 * l1 * l2 * 0.4
    push, twist = 0.7 * weight * shear, 0.7 * weight * arm(l1, l2) * torsion
    return block.with_live(Load(forces={"b1": (push, 0, 0, 0, -0.2 * push, twist)}))


EXACT = Value("1.0000", "portioli-exact", model="exact")


@case(
    "block-1-1-shear-torsion", "square joint, half of its shear and the exact torsion beside it",
    EXACT, known(1 / (0.5 + 0.8124)),
    known((sqrt(0.8124**2 + 1) - 0.8124) / 0.5, model="parabolic"),
    models=SURFACES,
)  # fmt: skip
def block_1_1_shear_torsion() -> Scene:
    return sheared(0.4, 0.4, 0.5, 0.8124)


@case(
    "block-2-1-shear-long", "joint 2 : 1, shear along the long side and the exact torsion",
    EXACT, known(1 / (0.5 + 0.8507)), models=SURFACES,
)  # fmt: skip
def block_2_1_shear_long() -> Scene:
    return sheared(0.4, 0.2, 0.5, 0.8507)


@case(
    "block-2-1-shear-short", "joint 2 : 1, shear along the short side and the exact torsion",
    EXACT, known(1 / (0.5 + 0.7800)), models=SURFACES,
)  # fmt: skip
def block_2_1_shear_short() -> Scene:
    return sheared(0.2, 0.4, 0.5, 0.7800)


@case(
    "block-crushes", "block that rocks on a joint of strength f: (l - W / (f b)) / h",
    known((0.4 - 3.2 / (40.0 * 0.4)) / 1.0), models=("conic",),
)  # fmt: skip
def block_crushes() -> Scene:
    """W = 3.2 kN crushes 0.2 m of the 0.4 m long joint when it stands on its edge."""
    return replace(single_block(), compressive_strength=40.0)


@case("block-up-the-slope", "block pushed up a slope: tan(phi + theta)",
      known(tan(atan(0.5) + 0.2)))  # fmt: skip
def block_up_the_slope() -> Scene:
    return slope(1.0)


@case("block-down-the-slope", "block pushed down a slope: tan(phi - theta)",
      known(tan(atan(0.5) - 0.2)))  # fmt: skip
def block_down_the_slope() -> Scene:
    return slope(-1.0)


def slope(push: float, angle: float = 0.2) -> Scene:
    """A flat block on a slope that rises along +x by ``angle`` radians, pushed horizontally."""
    along, up = np.array([cos(angle), 0, sin(angle)]), np.array([-sin(angle), 0, cos(angle)])
    side = np.array([0.0, 1.0, 0.0])

    def slab(id: str, low: float, high: float, half: float, density: float | None = None) -> Block:
        corners = [
            a * half * along + b * half * side + z * up
            for z in (low, high) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]  # fmt: skip
        faces = ((3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
        return Block.polyhedron(id, np.array(corners), faces, density)

    blocks = (slab("rock", -0.3, 0.0, 1.0), slab("block", 0.0, 0.1, 0.5, 20.0))
    return Scene(blocks, ("rock",), Load(acceleration=(push, 0, 0)), friction=0.5)


@case(
    "wedge-in-a-groove", "prism in a groove pushed along it: mu / sqrt(sin^2 b - mu^2 cos^2 b)",
    known(0.3 / sqrt(0.5 - 0.09 * 0.5)),
    note="With associated flow the prism wedges itself while it slides; Coulomb's law alone has "
    "mu / sin b as its lowest value.",
)  # fmt: skip
def wedge_in_a_groove() -> Scene:
    """Half angle b = 45 degrees. Per face, with shear s down the slope and along the groove,
    N sin b - s cos b = W / 2 and |V|^2 = mu^2 N^2 - s^2 is greatest at the value in the title."""
    y, top = (0.0, 4.0), 0.5
    prism = prism_of("prism", ((0, 0), (top, top), (-top, top)), y, 20.0)
    left = prism_of("left", ((0, 0), (-top, top), (-2, top), (-2, -1), (0, -1)), y)
    right = prism_of("right", ((0, 0), (0, -1), (2, -1), (2, top), (top, top)), y)
    push = Load(forces={"prism": tuple(WEIGHT * np.array([0, 1, 0, -GROOVE, 0, 0]))})
    return Scene((left, right, prism), ("left", "right"), push, friction=0.3)


WEIGHT = 20.0 * 0.25 * 4.0
"""Of the prism in the groove, kN."""

GROOVE = -(2 * 0.5 / 3 - 0.25)
"""From the prism's centroid down to the middle of its faces: the push acts there."""


def prism_of(
    id: str, outline: tuple[tuple[float, float], ...], y: tuple[float, float],
    density: float | None = None,
) -> Block:  # fmt: skip
    """A prism along y on an outline in the plane (x, z), in order around it."""
    n = len(outline)
    corners = np.array([(x, v, z) for v in y for x, z in outline])
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    return Block.polyhedron(id, corners, (range(n), range(n, 2 * n), *sides), density)


@case("stack-rocks", "stack of 8 blocks, rocks as one: b / (n h)", known(0.25))
def stack_rocks() -> Scene:
    return stack(8, friction=0.6)


@case(
    "stack-leans", "stack of 6 that leans by s: (b - 5 s) / (6 h) about the foot",
    known((0.5 - 5 * 0.04) / (6 * 0.25)),
)  # fmt: skip
def stack_leans() -> Scene:
    return stack(6, shift=(0.04, 0.0), friction=0.6)


@case("column-with-a-load", "column with three times its weight on top: (t/2)(W+P) / (W h/2 + P h)",
      known(0.25 * 4 / (0.5 * 2 + 3 * 2.0)))  # fmt: skip
def column_with_a_load() -> Scene:
    """Both its own weight of W = 10 kN and the load on top, P = 3 W, are pushed along x."""
    column = single_block((0.5, 0.5, 2.0))
    top = (0.25, 0.25, 2.0)
    dead = Load(gravity=(0, 0, -1), points=[PointForce("b1", top, (0, 0, -30.0))])
    live = Load(acceleration=(1, 0, 0), points=[PointForce("b1", top, (30.0, 0, 0))])
    return replace(column, dead=dead, live=live)


def overhanging(
    corners: list[tuple[float, float]], tip: str, table: float = 0.0
) -> Scene:  # fmt: skip
    """Unit-length blocks, one per corner (x of its left end, level), on a table that ends at x = 0.

    A weight on the far end of ``tip`` drives the fall.
    """
    h = 0.25
    ground = Block.box("table", (-4, 0, -h), (table, 1, 0))
    blocks = [
        Block.box(f"b{i + 1}", (x, 0, level * h), (x + 1, 1, (level + 1) * h), 20.0)
        for i, (x, level) in enumerate(corners)
    ]
    last = next(b for b in blocks if b.id == tip)
    end = last.vertices.max(axis=0)
    live = Load(points=[PointForce(tip, (float(end[0]), 0.5, float(end[2])), (0, 0, -1))])
    return Scene((ground, *blocks), ("table",), live, friction=0.7)


def harmonic(overhang: float) -> Scene:
    """Four blocks, those on top of a harmonic stack of that overhang."""
    share = overhang / (25 / 24)
    steps = [share / (2 * k) for k in (4, 3, 2, 1)]
    ends = np.cumsum(steps)
    return overhanging([(float(end) - 1.0, i) for i, end in enumerate(ends)], "b4")


@case(
    "overhang-harmonic-4", "harmonic stack of four: overhang of half the fourth harmonic number",
    Value("1.0417", "paterson-zwick-2007"), known(25 / 24, 6),
    quantity=Quantity("overhang over length", parameter={"stands": 1.041666, "falls": 1.041667}),
)  # fmt: skip
def overhang_harmonic_4() -> dict[str, Scene]:
    return {"stands": harmonic(1.041666), "falls": harmonic(1.041667)}


@case("wall-on-its-toe", "wall of one piece, pushed out of its plane: t / h",
      known(0.25 / 3.0))  # fmt: skip
def wall_on_its_toe() -> Scene:
    return single_block((2.0, 0.25, 3.0), live=Load(acceleration=(0, 1, 0)))


HIGH = 4 / 4 * (1 + 2 * 0.5 + 3 * 0.25) / (1 + 0.5 + 0.25)
"""Of the obelisk's centroid."""


@case("obelisk", "frustum of a pyramid on its toe: (b / 2) / height of the centroid",
      known(0.5 / HIGH))  # fmt: skip
def obelisk() -> Scene:
    """Base 1 x 1 m, top 0.5 x 0.5 m, 4 m high."""
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    corners = np.vstack([np.c_[ring, np.zeros(4)], np.c_[ring / 2, np.full(4, 4.0)]])
    faces = ((3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
    ground = Block.box("ground", (-1, -1, -1), (1, 1, 0))
    stone = Block.polyhedron("obelisk", corners, faces, 20.0)
    return Scene((ground, stone), ("ground",), Load(acceleration=(1, 0, 0)), friction=0.9)


@case("hexagonal-drums", "column of three hexagonal drums on an edge: apothem / half the height",
      known(0.5 * sqrt(3) / 2 / 1.5))  # fmt: skip
def hexagonal_drums() -> Scene:
    """Circumradius 0.5 m, three of 1 m, pushed along y, across a side."""
    turns = np.arange(6) * pi / 3
    ring = 0.5 * np.c_[np.cos(turns), np.sin(turns)]
    sides = [(i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i) for i in range(6)]
    drums = [
        Block.polyhedron(
            f"drum{k + 1}", np.vstack([np.c_[ring, np.full(6, float(z))] for z in (k, k + 1)]),
            (range(6), range(6, 12), *sides), 20.0,
        )
        for k in range(3)
    ]  # fmt: skip
    ground = Block.box("ground", (-1, -1, -1), (1, 1, 0))
    return Scene((ground, *drums), ("ground",), Load(acceleration=(0, 1, 0)), friction=0.9)
