"""The collapse load written a second time, from the outlines of blocks on, and scenes to ask about.

Nothing here uses the package but to hand it the scene: contacts are intersections of outlines by
shapely, torsion arms are integrated by Gauss' rule, equilibrium is assembled anew, and Clarabel is
called without CVXPY. A scene is layers of prisms of any outline (convex or not, with holes, cut in
two by a line), one layer on another, turned and shifted as a whole.

The model is that of the paper with the cone: pressure anywhere within the hull of a contact
(Eq. 9), abs(MT) / c_T + norm(V) <= mu N about the centroid of the contact itself (Eq. 24).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import clarabel
import numpy as np
import scipy.sparse as sp
import shapely
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from shapely import affinity
from shapely.ops import linemerge, split

from cvxlimit import Block, Load, Scene

FloatArray = NDArray[np.float64]

THIN = 1e-3
"""Overlaps narrower than this are slivers, which are a contact or not by the joint tolerance: such
scenes are drawn again."""

JOINT = 1e-6
"""Joint tolerance of the scenes, far below every length in them."""


@dataclass(frozen=True, eq=False)
class Prism:
    """A block: its outline in the plane, and between which heights it stands."""

    outline: shapely.Polygon
    low: float
    high: float
    density: float
    is_fixed: bool = False

    @property
    def weight(self) -> float:
        """Without a sign."""
        return self.density * self.outline.area * (self.high - self.low)

    @property
    def centroid(self) -> FloatArray:
        """Of the body, (3,)."""
        middle = self.outline.centroid
        return np.array([middle.x, middle.y, (self.low + self.high) / 2.0])


@dataclass(frozen=True, eq=False)
class Joint:
    """A contact: blocks a and b, frame (t1, t2, n) with n from a to b, and its regions in (t1, t2).

    ``region`` is relative to ``base``, any point of the plane.
    """

    a: int
    b: int
    base: FloatArray
    axes: FloatArray
    region: shapely.Geometry

    @property
    def centre(self) -> FloatArray:
        """Centroid of the region in its plane, (2,)."""
        return np.array([self.region.centroid.x, self.region.centroid.y])

    @property
    def corners(self) -> FloatArray:
        """Those of the hull about the centre, (k, 2)."""
        ring = shapely.get_coordinates(self.region.convex_hull.exterior)[:-1]
        return np.asarray(ring - self.centre)

    @property
    def arm(self) -> float:
        """Mean distance of the region's points from its centre."""
        return mean_distance(self.region, self.centre)


@dataclass(frozen=True, eq=False)
class Pile:
    """Blocks and the push, before the whole is turned and shifted."""

    prisms: tuple[Prism, ...]
    friction: float
    live: FloatArray
    turn: Rotation
    shift: FloatArray

    def scene(self) -> Scene:
        """For the package."""
        blocks = [self._block(i, prism) for i, prism in enumerate(self.prisms)]
        fixed = tuple(f"b{i}" for i, prism in enumerate(self.prisms) if prism.is_fixed)
        down, live = self.turn.apply([[0.0, 0.0, -1.0], self.live])
        return Scene(
            blocks,
            fixed,
            Load(acceleration=tuple(live)),
            dead=Load(gravity=tuple(down)),
            friction=self.friction,
            joint_tolerance=JOINT,
        )

    def _block(self, i: int, prism: Prism) -> Block:
        points, faces = _body(prism)
        density = None if prism.is_fixed else prism.density
        return Block.polyhedron(f"b{i}", self.turn.apply(points) + self.shift, faces, density)


def _body(prism: Prism) -> tuple[FloatArray, list[tuple[int, ...]]]:
    """Corners and faces; a hole is a ring of as many corners as the outline has."""
    rings = [shapely.get_coordinates(prism.outline.exterior)[:-1]]
    rings += [shapely.get_coordinates(hole)[:-1] for hole in prism.outline.interiors]
    k = len(rings[0])
    flat = np.vstack(rings)
    points = np.vstack([np.column_stack([flat, np.full(len(flat), z)])
                        for z in (prism.low, prism.high)])  # fmt: skip
    m, faces = len(flat), []
    for i in range(k):
        j = (i + 1) % k
        faces.append((i, j, j + m, i + m))
        if len(rings) == 2:
            faces += [(k + j, k + i, k + i + m, k + j + m)]
            faces += [(i, k + i, k + j, j), (i + m, j + m, k + j + m, k + i + m)]
    if len(rings) == 1:
        faces += [tuple(reversed(range(k))), tuple(range(m, m + k))]
    return points, faces


# Contacts.


def joints(prisms: Sequence[Prism]) -> list[Joint]:
    """All contacts; those of two fixed blocks are none.

    Raises
    ------
    ValueError
        If two blocks meet in a sliver, or overlap.
    """
    found = []
    for (i, p), (j, q) in combinations(enumerate(prisms), 2):
        if p.is_fixed and q.is_fixed:
            continue
        if abs(p.high - q.low) < 1e-9 or abs(q.high - p.low) < 1e-9:
            (a, below), (b, _) = ((i, p), (j, q)) if p.low < q.low else ((j, q), (i, p))
            region = _areas(p.outline.intersection(q.outline))
            if region is not None:
                base = np.array([0.0, 0.0, below.high])
                found.append(Joint(a, b, base, np.eye(3), region))
        elif min(p.high, q.high) - max(p.low, q.low) > 1e-9:
            found += _beside(i, j, p, q)
    return found


def _areas(region: shapely.Geometry) -> shapely.Geometry | None:
    """The parts that are areas, or None; a sliver is refused."""
    parts = [p for p in shapely.get_parts(region) if p.geom_type == "Polygon" and p.area > 1e-12]
    if not parts:
        return None
    whole = shapely.union_all(parts)
    opened = whole.buffer(-THIN / 2, join_style="mitre").buffer(THIN / 2, join_style="mitre")
    if whole.symmetric_difference(opened).area > 1e-9:
        raise ValueError("a sliver")
    return whole


def _beside(i: int, j: int, p: Prism, q: Prism) -> Iterator[Joint]:
    """Upright contacts of two prisms of one layer: one for every line their outlines share."""
    if p.outline.intersection(q.outline).area > 1e-9:
        raise ValueError("an overlap")
    shared = p.outline.boundary.intersection(q.outline.boundary)
    lines = [g for g in shapely.get_parts(shared) if g.geom_type == "LineString" and g.length > 0]
    low, high = max(p.low, q.low), min(p.high, q.high)
    groups: list[tuple[FloatArray, FloatArray, list[tuple[float, float]]]] = []
    for line in _straight(lines):
        start, end = line
        if np.hypot(*(end - start)) < THIN:
            raise ValueError("a sliver")
        along = (end - start) / np.hypot(*(end - start))
        for base, way, spans in groups:
            if abs(_cross(way, along)) < 1e-9 and abs(_cross(way, start - base)) < 1e-9:
                spans.append(
                    tuple(sorted((float((start - base) @ way), float((end - base) @ way))))
                )
                break
        else:
            groups.append((start, along, [(0.0, float(np.hypot(*(end - start))))]))
    for base, way, spans in groups:
        region = shapely.union_all([shapely.box(s, 0.0, e, high - low) for s, e in spans])
        across = np.array([way[1], -way[0]])
        middle = base + way * (spans[0][0] + spans[0][1]) / 2.0
        if not q.outline.buffer(1e-9).covers(shapely.Point(middle + 1e-4 * across)):
            across = -across
        t1, t2 = np.array([*way, 0.0]), np.array([0.0, 0.0, 1.0])
        if np.cross(t1, t2) @ [*across, 0.0] < 0.0:  # right-handed: the region is mirrored
            t1, region = -t1, affinity.scale(region, -1.0, 1.0, origin=(0.0, 0.0))
        yield Joint(i, j, np.array([*base, low]), np.array([t1, t2, [*across, 0.0]]), region)


def _cross(p: FloatArray, q: FloatArray) -> float:
    return float(p[0] * q[1] - p[1] * q[0])


def _straight(lines: list[Any]) -> Iterator[tuple[FloatArray, FloatArray]]:
    merged = linemerge(lines) if len(lines) > 1 else lines[0] if lines else None
    for line in [] if merged is None else shapely.get_parts(merged).tolist():
        points = shapely.get_coordinates(line.simplify(1e-9))
        yield from pairwise(points)


def mean_distance(region: shapely.Geometry, point: FloatArray) -> float:
    """Mean distance of a region's points from a point: over triangles from the point to each edge.

    The integral of |r| over the triangle (0, p, q) is h / 3 times that of |r| along p-q, by Gauss'
    rule in pieces: |r| is smooth along an edge unless the edge passes close to the point, where h
    is small.
    """
    nodes, weights = np.polynomial.legendre.leggauss(16)
    pieces = np.linspace(0.0, 1.0, 9)
    t = (pieces[:-1, None] + np.diff(pieces)[:, None] * (nodes + 1.0) / 2.0).ravel()
    w = (np.diff(pieces)[:, None] * weights / 2.0).ravel()
    total = 0.0
    for part in shapely.get_parts(region):
        part = shapely.geometry.polygon.orient(part)
        for ring in (part.exterior, *part.interiors):
            corners = shapely.get_coordinates(ring) - point
            for p, q in pairwise(corners):
                sizes = np.linalg.norm(p + t[:, None] * (q - p), axis=1)
                total += _cross(p, q) / 3.0 * float(w @ sizes)
    return total / region.area


# The problem.


@dataclass(frozen=True)
class Answer:
    """A "factor", or that there is none: "unstable", "harmless"; "unknown" if Clarabel failed.

    An "interval" of factors from ``least`` on, where the dead load stands only with a part of the
    live load; its end is infinite where the live load does no harm."""

    kind: str
    load_factor: float = np.nan
    least: float = np.nan


def answer(pile: Pile) -> Answer:
    """The largest load factor; whether dead load and live load alone are carried is asked first."""
    contacts = joints(pile.prisms)
    dead, live = loads(pile)
    stands, is_harmless = (
        _is_carried(largest(pile, contacts, np.zeros_like(dead), load, most=1.0))
        for load in (dead, live)
    )
    if stands is None or is_harmless is None:
        return Answer("unknown")
    if not stands:
        least, has_least = largest(pile, contacts, dead, -live)
        most, has_most = (np.inf, True) if is_harmless else largest(pile, contacts, dead, live)
        is_held = has_least and has_most and most > 0.0
        return Answer("interval", most, -least) if is_held else Answer("unstable")
    if is_harmless:
        return Answer("harmless")
    factor, is_solved = largest(pile, contacts, dead, live)
    return Answer("factor", factor) if is_solved else Answer("unknown")


def _is_carried(reached: tuple[float, bool]) -> bool | None:
    """Of a load alone all is carried or nothing, as the conditions are a cone; None: cannot tell.

    So a coarse answer is enough, which Clarabel calls almost solved where the share is 0.
    """
    share, _ = reached
    return None if not (share < 1e-3 or share > 1.0 - 1e-3) else share > 0.5


def loads(pile: Pile) -> tuple[FloatArray, FloatArray]:
    """Dead and live load (6 free) over the total weight, about each block's centroid."""
    free = [p for p in pile.prisms if not p.is_fixed]
    total = sum(p.weight for p in free)
    dead, live = np.zeros((2, len(free), 6))
    for k, prism in enumerate(free):
        dead[k, 2] = -prism.weight / total
        live[k, :3] = prism.weight / total * pile.live
    return dead.ravel(), live.ravel()


def equilibrium(pile: Pile, contacts: Sequence[Joint]) -> sp.csc_array:
    """(6 free, 6 contacts): columns are V1, V2, N, M1, M2, MT at the centre of each contact."""
    place = {i: k for k, i in enumerate(i for i, p in enumerate(pile.prisms) if not p.is_fixed)}
    matrix = sp.lil_array((6 * len(place), 6 * len(contacts)))
    for j, joint in enumerate(contacts):
        origin = joint.base + joint.centre @ joint.axes[:2]
        for block, sign in ((joint.a, -1.0), (joint.b, 1.0)):
            if block in place:
                arm = origin - pile.prisms[block].centroid
                at = 6 * place[block]
                for k, axis in enumerate(joint.axes):
                    matrix[at : at + 3, 6 * j + k] = sign * axis
                    matrix[at + 3 : at + 6, 6 * j + k] = sign * np.cross(arm, axis)
                    matrix[at + 3 : at + 6, 6 * j + 3 + k] = sign * axis
    return sp.csc_array(matrix)


def largest(
    pile: Pile,
    contacts: Sequence[Joint],
    dead: FloatArray,
    live: FloatArray,
    most: float | None = None,
) -> tuple[float, bool]:
    """max alpha with forces that balance dead + alpha live, and whether Clarabel solved it.

    Variables: alpha, then for every contact its corner compressions, V1, V2, MT.
    """
    full = equilibrium(pile, contacts)
    maps, cones, rows = [], [], []
    column = 1
    for joint in contacts:
        k = len(joint.corners)
        to_forces = np.zeros((6, k + 3))
        to_forces[2, :k] = 1.0
        to_forces[3, :k], to_forces[4, :k] = joint.corners[:, 1], -joint.corners[:, 0]
        to_forces[[0, 1, 5], [k, k + 1, k + 2]] = 1.0
        maps.append(to_forces)
        rows.append((np.hstack([-np.eye(k), np.zeros((k, 3))]), column))
        cones.append(clarabel.NonnegativeConeT(k))
        for sign in (1.0, -1.0):  # norm(V) <= mu N - sign MT / c_T
            cone = np.zeros((3, k + 3))
            cone[0, :k], cone[0, k + 2] = -pile.friction, sign / joint.arm
            cone[1, k], cone[2, k + 1] = -1.0, -1.0
            rows.append((cone, column))
            cones.append(clarabel.SecondOrderConeT(3))
        column += k + 3
    balance = sp.hstack(
        [sp.csc_array(live[:, None]), full @ sp.block_diag([*map(sp.csc_array, maps)])]
    )
    stacked = [sp.hstack([sp.csc_array((len(b), at)), sp.csc_array(b),
                          sp.csc_array((len(b), column - at - b.shape[1]))])
               for b, at in rows]  # fmt: skip
    right = [-dead] + [np.zeros(len(b)) for b, _ in rows]
    cones.insert(0, clarabel.ZeroConeT(len(dead)))
    if most is not None:
        first = sp.csc_array(([1.0], ([0], [0])), shape=(1, column))
        stacked.append(first)
        right.append(np.array([most]))
        cones.append(clarabel.NonnegativeConeT(1))
    objective = np.zeros(column)
    objective[0] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.direct_solve_method = False, "qdldl"
    solver = clarabel.DefaultSolver(
        sp.csc_matrix((column, column)), objective,
        sp.csc_matrix(sp.vstack([balance, *stacked])), np.concatenate(right), cones, settings,
    )  # fmt: skip
    solution = solver.solve()
    return float(solution.x[0]), str(solution.status) == "Solved"


# Scenes.

OUTLINES = {
    "square": [(-1, -1), (1, -1), (1, 1), (-1, 1)],
    "slab": [(-1, -0.4), (1, -0.4), (1, 0.4), (-1, 0.4)],
    "brick": [(-0.6, -0.3), (0.6, -0.3), (0.6, 0.3), (-0.6, 0.3)],
    "strip": [(-1, -0.05), (1, -0.05), (1, 0.05), (-1, 0.05)],
    "L": [(-1, -1), (1, -1), (1, 0), (0, 0), (0, 1), (-1, 1)],
    "T": [(-1, 0.4), (-0.3, 0.4), (-0.3, -1), (0.3, -1), (0.3, 0.4), (1, 0.4), (1, 1), (-1, 1)],
    "U": [(-1, -1), (1, -1), (1, 1), (0.5, 1), (0.5, -0.4), (-0.5, -0.4), (-0.5, 1), (-1, 1)],
    "plus": [(-1, -0.3), (-0.3, -0.3), (-0.3, -1), (0.3, -1), (0.3, -0.3), (1, -0.3), (1, 0.3),
             (0.3, 0.3), (0.3, 1), (-0.3, 1), (-0.3, 0.3), (-1, 0.3)],
}  # fmt: skip


def outline(rng: np.random.Generator, convex: bool) -> shapely.Polygon:
    """A polygon of size about 1 around the origin: named, regular, irregular, or with a hole."""
    kind = rng.integers(3 if convex else 5)
    if kind == 0:
        k = int(rng.integers(3, 9))
        angles = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(k) / k
        return shapely.Polygon(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    if kind == 1:
        return shapely.Polygon(OUTLINES[rng.choice(["square", "slab", "brick", "strip"])])
    if kind == 2:
        cloud = shapely.MultiPoint(rng.uniform(-1, 1, (int(rng.integers(3, 9)), 2)))
        return cloud.convex_hull
    if kind == 3:
        return shapely.Polygon(OUTLINES[rng.choice(["L", "T", "U", "plus"])])
    k = int(rng.integers(3, 8))
    angles = 2 * np.pi * (np.arange(k) + rng.uniform(0, 0.5, k)) / k
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=1) * rng.uniform(0.4, 1.0, k)[:, None]
    whole = shapely.Polygon(rim)
    if rng.random() < 0.5 or not whole.contains(shapely.Point(0, 0).buffer(0.05)):
        return whole
    return shapely.Polygon(rim, [rim * rng.uniform(0.2, 0.6)])


def placed(rng: np.random.Generator, shape: shapely.Polygon) -> shapely.Polygon:
    """Scaled, turned and shifted; half of the time on a grid, where corners coincide."""
    size = rng.uniform(0.5, 1.0, 2)
    if rng.random() < 0.5:
        size = rng.choice([0.5, 1.0, 1.0], 2)
        turned = affinity.rotate(shape, 90.0 * rng.integers(4), origin=(0, 0))
        moved = affinity.scale(turned, *size, origin=(0, 0))
        return affinity.translate(moved, *(0.1 * rng.integers(-9, 10, 2)))
    turned = affinity.scale(shape, *size, origin=(0, 0))
    turned = affinity.rotate(turned, rng.uniform(0, 360), origin=(0, 0))
    return affinity.translate(turned, *rng.uniform(-0.25, 0.25, 2))


def pile(seed: int, convex: bool = False) -> Pile:
    """A random scene: 1 to 4 layers on a fixed base, each of one or two prisms, turned and shifted.

    ``convex``: outlines are convex, and so are all contacts.
    """
    rng = np.random.default_rng([seed, 7])
    while True:
        prisms = [Prism(placed(rng, outline(rng, convex)), -1.0, 0.0, 1.0, is_fixed=True)]
        low = 0.0
        for _ in range(int(rng.integers(1, 5))):
            shape, high = _above(rng, prisms, low, convex), low + float(rng.uniform(0.2, 1.0))
            parts = [shape]
            if rng.random() < 0.4 and not shape.interiors:
                angle, point = rng.uniform(0, np.pi), rng.uniform(-0.3, 0.3, 2)
                way = 9.0 * np.array([np.cos(angle), np.sin(angle)])
                parts = list(split(shape, shapely.LineString([point - way, point + way])).geoms)
            prisms += [Prism(p, low, high, float(rng.uniform(0.5, 3.0))) for p in parts]
            low = high
        if not all(p.outline.is_valid and p.outline.area > 0.02 and _is_stout(p) for p in prisms):
            continue
        try:
            touching = {i for joint in joints(prisms) for i in (joint.a, joint.b)}
        except ValueError:
            continue
        if len(touching) < len(prisms):
            continue
        angle = rng.uniform(0, 2 * np.pi)
        live = np.array([np.cos(angle), np.sin(angle), rng.uniform(-0.5, 0.5)])
        turn, shift = Rotation.identity(), np.zeros(3)
        if rng.random() < 0.5:
            turn = Rotation.random(random_state=np.random.RandomState(seed))
            shift = rng.uniform(-1, 1, 3) * rng.choice([0.0, 1.0, 100.0])
        return Pile(tuple(prisms), float(rng.uniform(0.2, 1.2)), live, turn, shift)


def _above(
    rng: np.random.Generator, prisms: Sequence[Prism], low: float, convex: bool
) -> shapely.Polygon:
    """An outline for the next layer; mostly one whose middle stands on the layer below."""
    below = shapely.union_all([p.outline for p in prisms if abs(p.high - low) < 1e-9])
    for _ in range(8):
        shape = placed(rng, outline(rng, convex))
        if shape.intersection(below).convex_hull.contains(shape.centroid):
            break
    return shape


def _is_stout(prism: Prism) -> bool:
    """No part of the outline is thinner than a sliver."""
    opened = prism.outline.buffer(-THIN, join_style="mitre").buffer(THIN, join_style="mitre")
    return bool(prism.outline.symmetric_difference(opened).area < 1e-9)
