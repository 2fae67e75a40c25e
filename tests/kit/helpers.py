"""Shared by the tests: certified solutions checked by hand, a second path, random scenes.

Nothing here uses the package's equilibrium, yield surfaces or solver: equilibrium is assembled
block by block in a loop, conditions are the paper's equations written out once more.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import coo_array, csr_array, hstack
from scipy.spatial.transform import Rotation

from cvxlimit import Block, Contacts, Load, Scene, Solution, Status, builtin_scene
from cvxlimit.geometry.contacts import Contact
from cvxlimit.geometry.polygons import mean_distance
from cvxlimit.io import result_from_dict, result_to_dict
from cvxlimit.masonry import arch, panel, running_bond, wall
from cvxlimit.readings.named import parse_moments
from cvxlimit.solvers import blockwise
from cvxlimit.surfaces import Condition, Norm, YieldSurface

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-5
"""Default width of a bracket: what every certified solution promises."""

COMPILED = pytest.mark.skipif(not blockwise(), reason="our own solver is not compiled here")


def document(solution: Solution) -> Any:
    """Its file, as it is read."""
    return json.loads(json.dumps(result_to_dict(solution)))


def read(solution: Solution) -> Solution:
    """The solution as it is in a file."""
    return result_from_dict(document(solution))


def assert_certified(
    solution: Solution,
    scene: Scene | None = None,
    *,
    proved: bool = True,
    tolerance: float = TOLERANCE,
) -> None:
    """The promise of a certified solution, and with the scene its equilibrium and powers anew.

    Forces and mechanism come from the solver, so they are held to 1e-6 of the total load and of
    the load factor: far above what a solver leaves, far below an error that could matter.
    """
    assert solution.status is Status.CERTIFIED, (solution.status, solution.note, solution.history)
    assert solution.load_factor is not None
    assert np.isfinite([solution.lower, solution.upper]).all()
    assert solution.lower <= solution.load_factor <= solution.upper
    unit = max(abs(solution.upper), abs(solution.lower))
    assert solution.upper - solution.lower <= tolerance * unit + 1e-11
    if proved:
        assert solution.note.startswith("both bounds are proved, up to rounding")
    assert solution.history
    if scene is None:
        return
    assert solution.forces is not None
    assert solution.mechanism is not None
    assert (solution.blocks, solution.contacts) == (len(scene.free), len(scene.contacts))
    matrix, dead, live = hand_equilibrium(scene)
    load = np.abs(dead).sum() + abs(solution.load_factor) * np.abs(live).sum()
    residual = matrix @ solution.forces.ravel() + dead + solution.load_factor * live
    assert np.abs(residual).max() <= 1e-6 * load
    rates = np.concatenate([solution.mechanism[scene.blocks[i].id] for i in scene.free])
    np.testing.assert_allclose(live @ rates, 1.0, rtol=1e-6)
    np.testing.assert_allclose(-dead @ rates, solution.load_factor, rtol=1e-5, atol=1e-9)


def hand_equilibrium(scene: Scene) -> tuple[csr_array, FloatArray, FloatArray]:
    """A (6 free, 6 contacts), dead and live loads; one contact and block at a time.

    Columns are V1, V2, N, M1, M2, MT of each contact; rows fx, fy, fz, mx, my, mz of each free
    block about its centroid.
    """
    place = {scene.blocks[i].id: row for row, i in enumerate(scene.free)}
    blocks = {block.id: block for block in scene.blocks}
    rows, columns, values = [], [], []
    for j, contact in enumerate(scene.contacts):
        for key, sign in ((contact.a, -1.0), (contact.b, 1.0)):
            if key not in place:
                continue
            arm = contact.origin - blocks[key].centroid
            wrench = np.zeros((6, 6))
            for k, direction in enumerate((contact.t1, contact.t2, contact.normal)):
                wrench[:3, k] = sign * direction
                wrench[3:, k] = sign * np.cross(arm, direction)
                wrench[3:, 3 + k] = sign * direction
            r, c = np.nonzero(wrench)
            rows.append(6 * place[key] + r)
            columns.append(6 * j + c)
            values.append(wrench[r, c])
    index = np.concatenate(rows), np.concatenate(columns)
    shape = (6 * len(place), 6 * len(scene.contacts))
    matrix = coo_array((np.concatenate(values), index), shape=shape).tocsr()
    dead, live = (_hand_load(scene, load) for load in (scene.dead, scene.live))
    return matrix, dead, live


def _hand_load(scene: Scene, load: Load) -> FloatArray:
    result = []
    for i in scene.free:
        block = scene.blocks[i]
        force = np.zeros(6)
        for vector in (load.gravity, load.acceleration):
            if vector is not None:
                force[:3] += (block.density or 0.0) * block.volume * np.array(vector)
        for point in (p for p in load.points if p.block == block.id):
            force[:3] += point.force
            force[3:] += np.cross(np.subtract(point.at, block.centroid), point.force)
        result.append(force + np.array(load.forces.get(block.id, np.zeros(6))))
    return np.concatenate(result)


def corners_in_plane(contact: Contact) -> FloatArray:
    """Corners (k, 2) along t1 and t2 about the contact's centre."""
    arm = contact.corners - contact.origin
    return np.stack([arm @ contact.t1, arm @ contact.t2], axis=1)


def hand_torsion_arm(contact: Contact) -> float:
    """c_T: for rectangles a closed form of Eq. 16 with half sides, as in textbooks."""
    if contact.sides is None:
        return mean_distance(corners_in_plane(contact), (0.0, 0.0))
    a, b = contact.sides[0] / 2.0, contact.sides[1] / 2.0
    logs = a**2 / b * np.arcsinh(b / a) + b**2 / a * np.arcsinh(a / b)
    return float(np.hypot(a, b) / 3.0 + logs / 6.0)


def hand_rows(scene: Scene, count: int, reach: float = 1.0) -> csr_array:
    """Rows (r, 6 contacts) of Eq. 9 and Eq. 25, to be <= 0, for ``count`` facets.

    Eq. 9 for a polygon: the pressure centre lies left of every edge. Eq. 25: every facet of the
    shear with both signs of the torsion; ``reach`` cos(pi / K) makes the facets inscribed.
    """
    blocks = []
    angles = 2.0 * np.pi * np.arange(count) / count
    for contact in scene.contacts:
        corners = corners_in_plane(contact)
        rocking = []
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            (ex, ey), (px, py) = end - start, start
            # cross(edge, e - start) >= 0 with N e = (-M2, M1)
            rocking.append([0.0, 0.0, ex * py - ey * px, -ex, -ey, 0.0])
        rocking = [np.array(row) / np.abs(row).max() for row in rocking]
        mu, arm = contact.friction, hand_torsion_arm(contact)
        yielding = [
            [np.cos(t) / reach, np.sin(t) / reach, -mu, 0.0, 0.0, sign / arm]
            for t in angles
            for sign in (1.0, -1.0)
        ]
        blocks.append(np.array([*rocking, *yielding]))
    rows, columns, values, at = [], [], [], 0
    for j, block in enumerate(blocks):
        r, c = np.nonzero(block)
        rows.append(at + r)
        columns.append(6 * j + c)
        values.append(block[r, c])
        at += len(block)
    index = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(values), index), shape=(at, 6 * len(blocks))).tocsr()


@dataclass(frozen=True)
class LinearAnswer:
    """What SciPy's ``linprog`` says: 0 optimal, 2 infeasible, 3 unbounded."""

    status: int
    load_factor: float | None
    forces: FloatArray | None


def dead_load_stands(scene: Scene, count: int = 8, reach: float = 1.0) -> bool:
    """Whether the dead load alone is carried: the same problem at load factor zero."""
    return linear_load_factor(scene, count, reach, alpha=(0.0, 0.0)).status == 0


def linear_load_factor(
    scene: Scene,
    count: int = 8,
    reach: float = 1.0,
    alpha: tuple[float | None, float | None] = (None, None),
) -> LinearAnswer:
    """Eq. 39 with Eq. 9 and Eq. 25 as matrices of our own, solved by HiGHS.

    Forces are in units of the total load and HiGHS' feasibility is set to its tightest, 1e-10.
    """
    matrix, dead, live = hand_equilibrium(scene)
    unit = np.abs(dead).sum() or np.abs(live).sum()
    rows = hand_rows(scene, count, reach)
    no_load = csr_array((rows.shape[0], 1))
    answer = linprog(
        np.append(np.zeros(matrix.shape[1]), -1.0),
        A_ub=hstack([rows, no_load]).tocsr(),
        b_ub=np.zeros(rows.shape[0]),
        A_eq=hstack([matrix, coo_array(live[:, None] / unit)]).tocsr(),
        b_eq=-dead / unit,
        bounds=[(None, None)] * matrix.shape[1] + [alpha],
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if answer.status != 0:
        return LinearAnswer(answer.status, None, None)
    return LinearAnswer(0, float(answer.x[-1]), unit * answer.x[:-1].reshape(-1, 6))


def yield_excess(scene: Scene, forces: FloatArray) -> FloatArray:
    """Eq. 9 and Eq. 24 per contact, as forces: the larger of both, (contacts,); <= 0 is inside."""
    result = []
    for contact, x in zip(scene.contacts, forces, strict=True):
        v1, v2, n, m1, m2, mt = x
        corners = corners_in_plane(contact)
        outside = [
            (e[0] * (n * p[1] - m1) - e[1] * (n * p[0] + m2)) / np.hypot(*e)
            for p, e in zip(corners, np.roll(corners, -1, axis=0) - corners, strict=True)
        ]
        shear = abs(mt) / hand_torsion_arm(contact) + np.hypot(v1, v2) - contact.friction * n
        result.append(max(shear, *(o / np.sqrt(contact.area) for o in outside)))
    return np.array(result)


def interaction_excess(forces: FloatArray, contacts: Contacts, moments: str) -> FloatArray:
    """The package's checker of Eq. 30, by the name of the convention, (contacts,)."""
    return parse_moments(moments).excess(forces, contacts)


def missing_opening(scene: Scene, rates: FloatArray) -> FloatArray:
    """Dual of Eq. 9 and Eq. 24: opening (contacts,) that block ``rates`` (free, 6) lack.

    Relative rates follow from the rigid motion of the two blocks at the corners. The flow rule
    asks every corner to open by mu times the larger of slip and c_T times twist.
    """
    motion = {block.id: np.zeros(6) for block in scene.blocks}
    motion |= {scene.blocks[i].id: u for i, u in zip(scene.free, rates, strict=True)}
    centroid = {block.id: block.centroid for block in scene.blocks}

    def velocity(key: str, points: FloatArray) -> FloatArray:
        return motion[key][:3] + np.cross(motion[key][3:], points - centroid[key])

    result = []
    for c in scene.contacts:
        opening = (velocity(c.b, c.corners) - velocity(c.a, c.corners)) @ c.normal
        slide = velocity(c.b, c.origin) - velocity(c.a, c.origin)
        slip = np.hypot(slide @ c.t1, slide @ c.t2)
        twist = abs((motion[c.b][3:] - motion[c.a][3:]) @ c.normal)
        needed = c.friction * max(slip, hand_torsion_arm(c) * twist)
        result.append(needed - opening.min())
    return np.array(result)


# Random scenes: small, geometrically sound, and standing unless said otherwise.

FRICTION = st.sampled_from([0.35, 0.5, 0.6, 0.75, 0.9])
SHARES = st.floats(0.0, 1.0).map(lambda x: round(x, 4))


@st.composite
def rotations(draw: st.DrawFn) -> FloatArray:
    """Any rotation in space, as a matrix."""
    seed = draw(st.integers(0, 2**32 - 1))
    quaternion = np.random.default_rng(seed).normal(size=4)
    return np.asarray(Rotation.from_quat(quaternion).as_matrix())


@st.composite
def live_loads(draw: st.DrawFn) -> Load:
    """A push with a horizontal part of 1 in any direction, up to half as much up or down."""
    angle = 2.0 * np.pi * draw(SHARES)
    return Load(acceleration=(np.cos(angle), np.sin(angle), draw(SHARES) - 0.5))


def _prism(id: str, corners: FloatArray, low: float, high: float) -> Block:
    ring = [np.column_stack([corners, np.full(len(corners), z)]) for z in (low, high)]
    return Block.hull(id, np.vstack(ring), density=20.0)


def _regular(sides: int, radius: float, angle: float) -> FloatArray:
    angles = angle + 2.0 * np.pi * np.arange(sides) / sides
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


@st.composite
def piles(draw: st.DrawFn) -> Scene:
    """Prisms with 3 to 6 sides, and bricks, turned and shifted on one another.

    Centres stay within a tenth of the smallest inner radius, so that the pile stands.
    """
    blocks, z = [Block.box("ground", (-3.0, -3.0, -1.0), (3.0, 3.0, 0.0))], 0.0
    for i in range(draw(st.integers(1, 4))):
        angle = 2.0 * np.pi * draw(SHARES)
        sides = draw(st.integers(2, 6))
        if sides == 2:
            half = np.array([0.3 + 0.4 * draw(SHARES), 0.3 + 0.2 * draw(SHARES)])
            corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
            corners = corners @ np.array([[np.cos(angle), np.sin(angle)],
                                          [-np.sin(angle), np.cos(angle)]])  # fmt: skip
        else:
            corners = _regular(sides, 0.5 + 0.3 * draw(SHARES), angle)
        shift = 0.03 * (np.array([draw(SHARES), draw(SHARES)]) - 0.5)
        height = 0.2 + 0.4 * draw(SHARES)
        blocks.append(_prism(f"p{i + 1}", corners + shift, z, z + height))
        z += height
    return Scene(
        tuple(blocks), ("ground",), draw(live_loads()), friction=draw(FRICTION), name="pile"
    )


@st.composite
def walls(draw: st.DrawFn) -> Scene:
    """Running bond of up to 3 units by 4 courses, at times held at one end."""
    unit = (0.2 + 0.3 * draw(SHARES), 0.1 + 0.2 * draw(SHARES), 0.1 + 0.2 * draw(SHARES))
    courses = running_bond(draw(st.integers(1, 3)), draw(st.integers(1, 4)))
    return wall(courses, unit, friction=draw(FRICTION), live=draw(live_loads()))


@st.composite
def arches(draw: st.DrawFn) -> Scene:
    """Shallow and thick enough to stand: 4 to 9 voussoirs over 120 degrees."""
    number, ratio = draw(st.integers(4, 9)), 0.15 + 0.2 * draw(SHARES)
    friction = draw(st.sampled_from([0.5, 0.7, 0.9]))
    return arch(number, ratio, embrace=120.0, friction=friction, live=draw(live_loads()))


@st.composite
def panels(draw: st.DrawFn) -> Scene:
    """A few courses with a return."""
    front, side = 0.2 + 0.1 * draw(SHARES), 0.1 + 0.1 * draw(SHARES)
    courses = draw(st.integers(1, 4))
    return panel(front, courses, left_return=side, friction=draw(FRICTION), live=draw(live_loads()))


CLASS_PANELS = {
    "s12-class": lambda: panel(0.80, 19, left_return=0.52, name="s12-class"),
    "s10-class": lambda: panel(0.88, 34, left_return=0.36, right_return=0.36, name="s10-class"),
}
"""Panels about as large as the paper's S12 and S10, whose own layouts are built in. Published and
earlier values exist for them (0.175819 and 0.165318 with the cone), on S10-class for rocking only.
"""


def named_scene(name: str) -> Scene:
    """One of :data:`CLASS_PANELS`, or a built-in scene."""
    return CLASS_PANELS[name]() if name in CLASS_PANELS else builtin_scene(name)


def scenes() -> st.SearchStrategy[Scene]:
    """Piles, walls, arches and panels under any push."""
    return st.one_of(piles(), walls(), arches(), panels())


def side_by_side() -> Scene:
    """Two unit boxes that touch, one of them pressed down."""
    blocks = [Block.box("ground", (-1, -1, -1), (3, 2, 0))]
    blocks += [Block.box(f"b{i}", (i, 0, 0), (i + 1, 1, 1), density=20.0) for i in range(2)]
    return Scene(blocks, ["ground"], Load(forces={"b0": (0, 0, -1, 0, 0, 0)}), friction=0.6)


def partly_pressed(seed: int) -> Scene:
    """A row of stacks, some of them touching, or a wall in running bond; some blocks pressed down.

    Every block stands within what is below it, so any vertical load is carried, and by linprog on
    matrices of our own the load factor has no limit in 162 of 162.
    """
    rng = np.random.default_rng(seed)
    if seed % 2:
        blocks, x = [Block.box("g", (-1, -1, -1), (20, 3, 0))], 0.0
        for i in range(rng.integers(2, 5)):
            width, height, touches = (
                rng.uniform(0.4, 1.2),
                rng.uniform(0.4, 1.5),
                rng.random() < 0.7,
            )
            for k in range(rng.integers(1, 3)):
                low, high = (x, 0, k * height), (x + width, 1, (k + 1) * height)
                blocks.append(Block.box(f"b{i}.{k}", low, high, density=20.0))
            x += width + (0.0 if touches else 0.2)
        whole = Scene(blocks, ["g"], Load(acceleration=(1, 0, 0)))
    else:
        whole = wall(running_bond(int(rng.integers(2, 5)), int(rng.integers(2, 6))))
    free = [whole.blocks[i].id for i in whole.free]
    chosen = rng.choice(free, size=int(rng.integers(1, max(2, len(free) // 2))), replace=False)
    pressed = {str(b): (0, 0, -float(rng.uniform(0.3, 2.0)), 0, 0, 0) for b in chosen}
    return whole.with_friction(rng.choice([0.4, 0.6, 0.8])).with_live(Load(forces=pressed))


def renumbered(scene: Scene, seed: int) -> Scene:
    """The same scene with its blocks in another order: contacts turn round with them."""
    order = np.random.default_rng(seed).permutation(len(scene.blocks))
    return replace(scene, blocks=tuple(scene.blocks[i] for i in order))


# Users' own surfaces, and single contacts of any shape.


class Share(YieldSurface):
    """Sliding at a share of the friction."""

    name = "share"

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = share

    def conditions(self, contacts: Contacts) -> list[Condition]:
        slip = Norm({"V1": 1}, {"V2": 1})
        return [Condition([slip], {"N": self.share * contacts.friction})]


class Ellipse(YieldSurface):
    """The docstring's example: sqrt(V^2 + (MT / c_T)^2) <= mu N."""

    name = "ellipse"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / contacts.torsion_arm})
        return [Condition([size], {"N": contacts.friction})]


class Core(YieldSurface):
    """Linear rows only: the pressure centre stays in the contact shrunk to ``share``."""

    name = "core"

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = share

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        contact, inward, offset = contacts.edges
        inside = {"N": self.share * offset, "M2": -inward[:, 0], "M1": inward[:, 1]}
        return [Condition((), inside, contact)]


def contact_of(corners: np.ndarray, friction: float = 0.6) -> Contacts:
    """Contact between the ground and a prism with this base."""
    ring = [np.column_stack([corners, np.full(len(corners), z)]) for z in (0.0, 1.0)]
    ground = Block.box("ground", (-9, -9, -1), (9, 9, 0))
    prism = Block.hull("prism", np.vstack(ring), density=1.0)
    live = Load(acceleration=(1, 0, 0))
    return Scene((ground, prism), ("ground",), live, friction=friction).contacts


def regular(sides: int) -> np.ndarray:
    angles = 0.3 + 2.0 * np.pi * np.arange(sides) / sides
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)
