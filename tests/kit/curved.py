"""Two blocks on a curved joint, and what they carry by a linear program of the test's own.

A joint is a profile z(x), drawn out along y, or a surface z(x, y) on a grid. The two sides may be
meshed apart. The program is planar: both ends of every pair of facets that overlap push with
Coulomb friction; nothing of the package but blocks and scenes is used.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import cvxpy as cp
import numpy as np
from scipy.optimize import linprog

from cvxlimit.geometry.blocks import Block
from cvxlimit.scene import Load, Scene

Profile = Callable[[np.ndarray], np.ndarray]


def arc(radius: float, half: float) -> Profile:
    """An arc of a circle over -half <= x <= half, its ends at height 0."""
    springing = np.sqrt(radius**2 - half**2)
    return lambda x: np.sqrt(np.maximum(radius**2 - x**2, 0.0)) - springing


def dish(rise: float, half: float) -> Profile:
    return lambda x: rise * (1.0 - (x / half) ** 2)


def vee(rise: float, half: float) -> Profile:
    return lambda x: rise * (1.0 - np.abs(x) / half)


def stations(profile: Profile, half: float, count: int, is_arc: bool = False) -> np.ndarray:
    """Points (count + 1, 2) of a profile: at equal steps of x, or of the angle of an arc."""
    x = np.linspace(-half, half, count + 1)
    if is_arc:
        radius = (half**2 + profile(np.zeros(1))[0] ** 2) / (2.0 * profile(np.zeros(1))[0])
        angle = np.arcsin(half / radius)
        x = radius * np.sin(np.linspace(-angle, angle, count + 1))
        x[[0, -1]] = -half, half
    return np.column_stack([x, profile(x)])


def prism(id: str, outline: np.ndarray, depth: float, density: float | None) -> Block:
    """An outline (k, 2) in x and z, drawn out along y."""
    k = len(outline)
    points = np.array([(x, y, z) for y in (0.0, depth) for x, z in outline])
    sides = [(i, (i + 1) % k, (i + 1) % k + k, i + k) for i in range(k)]
    return Block.polyhedron(id, points, [range(k), range(k, 2 * k), *sides], density)


def joined(
    lower: np.ndarray, upper: np.ndarray, friction: float, top: float = 1.0, depth: float = 0.5
) -> Scene:
    """A block up to the height ``top`` on a support, over profiles (k, 2) that may differ."""
    half = lower[-1, 0]
    corners = np.array([(half, top), (-half, top)])
    base = np.array([(-half, lower[:, 1].min() - 1.0), (half, lower[:, 1].min() - 1.0)])
    return Scene(
        [
            prism("up", np.vstack([upper, corners]), depth, 20.0),
            prism("low", np.vstack([base, lower[::-1]]), depth, None),
        ],
        ["low"],
        Load(acceleration=(1, 0, 0)),
        friction=friction,
    )


def overlaps(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends (k, 2, 2) and normals (k, 2) of the overlaps of all pairs of facets of two profiles, on
    the middle line between both."""
    ends, normals = [], []
    for a, b in pairwise(lower):
        for c, d in pairwise(upper):
            if min(b[0], d[0]) - max(a[0], c[0]) <= 1e-9 * (upper[-1, 0] - upper[0, 0]):
                continue
            along = (b - a) / np.linalg.norm(b - a) + (d - c) / np.linalg.norm(d - c)
            along /= np.linalg.norm(along)
            normal = np.array([-along[1], along[0]])
            start = max(a @ along, c @ along)
            end = min(b @ along, d @ along)
            if end <= start:
                continue
            here = []
            for t in (start, end):  # heights of both lines over the middle direction
                heights = [
                    (p @ normal) + (t - p @ along) * ((q - p) @ normal) / ((q - p) @ along)
                    for p, q in ((a, b), (c, d))
                ]
                here.append(t * along + 0.5 * sum(heights) * normal)
            ends.append(here)
            normals.append(normal)
    return np.array(ends), np.array(normals)


def planar_load_factor(scene: Scene, lower: np.ndarray, upper: np.ndarray) -> float:
    """Largest share of its weight that the upper block carries along x, by a linear program."""
    ends, normals = overlaps(lower, upper)
    points, normal = ends.reshape(-1, 2), np.repeat(normals, 2, axis=0)
    tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
    block = next(b for b in scene.blocks if b.id == "up")
    arms = points - block.centroid[[0, 2]]
    mu = scene.friction
    columns = []
    for way in (1.0, -1.0):  # both edges of each end's friction cone
        force = normal + way * mu * tangent
        moment = arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0]
        columns.append(np.vstack([force.T, moment]))
    size = np.abs(arms).max()
    equations = np.hstack([*columns, np.array([[1.0], [0.0], [0.0]])])
    equations[2] /= size
    cost = np.zeros(equations.shape[1])
    cost[-1] = -1.0
    found = linprog(cost, A_eq=equations, b_eq=[0.0, 1.0, 0.0], method="highs",
                    bounds=[(0, None)] * (len(cost) - 1) + [(None, None)])  # fmt: skip
    assert found.status == 0, found.message
    return float(-found.fun)


def smooth_arc(radius: float, angle: float, friction: float, height: float) -> float:
    """Closed form: two edge forces at -angle and angle, each turned by the friction angle; the
    block's centroid lies ``height`` above the arc's centre."""
    phi = np.arctan(friction)
    equations = np.array([
        [np.sin(-angle - phi), np.sin(angle - phi), 1.0],
        [np.cos(angle + phi), np.cos(angle - phi), 0.0],
        [radius * np.sin(phi), radius * np.sin(phi), -height],
    ])  # fmt: skip
    return float(np.linalg.solve(equations, [0.0, 1.0, 0.0])[2])


Surface = Callable[[np.ndarray, np.ndarray], np.ndarray]


def bowl(rise: float) -> Surface:
    """A paraboloid over the unit square about the origin, 0 in two corners, with axes between x
    and y: cells along them would be flat."""
    return lambda x, y: rise * (1.0 - 2.0 * (x**2 + y**2 + 0.5 * x * y) + 0.25)


def saddle(rise: float) -> Surface:
    return lambda x, y: 4.0 * rise * x * y


def grid(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (m, 2) of the unit square about the origin, and triangles (t, 3)."""
    line = np.linspace(-0.5, 0.5, count + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    index = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    a, b, c, d = (
        index[:-1, :-1].ravel(), index[1:, :-1].ravel(),
        index[1:, 1:].ravel(), index[:-1, 1:].ravel(),
    )  # fmt: skip
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.column_stack([x.ravel(), y.ravel()]), triangles


def cushion(id: str, surface: Surface, count: int, level: float, density: float | None) -> Block:
    """A square block with one doubly curved side, the other at ``level``."""
    flat, triangles = grid(count)
    index = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    points = np.vstack([
        np.column_stack([flat, surface(*flat.T)]),
        np.column_stack([corners, np.full(4, level)]),
    ])  # fmt: skip
    p, q, r, s = range(len(flat), len(flat) + 4)
    sides = [
        [*index[:, 0].tolist(), q, p], [*index[-1].tolist(), r, q],
        [*index[::-1, -1].tolist(), s, r], [*index[0, ::-1].tolist(), p, s], [p, q, r, s],
    ]  # fmt: skip
    return Block.polyhedron(id, points, [*triangles.tolist(), *sides], density)


def cushioned(surface: Surface, lower: int, upper: int, friction: float) -> Scene:
    """A block on a support, both of one doubly curved surface, meshed apart."""
    blocks = [
        cushion("up", surface, upper, 1.0, 20.0),
        cushion("low", surface, lower, -1.0, None),
    ]
    return Scene(blocks, ["low"], Load(acceleration=(1, 0, 0)), friction=friction)


def spatial_load_factor(scene: Scene, surface: Surface, count: int) -> float:
    """Largest load factor of :func:`cushioned` with equal meshes, by a cone program over all
    triangles: compressions at the corners, |V| + |MT| / c_T <= mu N, c_T by quadrature. The two
    triangles of a cell must not lie in one plane, or else they are one contact."""
    flat, triangles = grid(count)
    points = np.column_stack([flat, surface(*flat.T)])[triangles]
    edges = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    normal = np.cross(*edges)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    first = edges[0] / np.linalg.norm(edges[0], axis=1)[:, None]
    second = np.cross(normal, first)
    middle = points.mean(axis=1)
    block = next(b for b in scene.blocks if b.id == "up")
    arm, turned = middle - block.centroid, points - block.centroid
    k = len(triangles)
    n, v, t = cp.Variable((k, 3), nonneg=True), cp.Variable((k, 2)), cp.Variable(k)
    alpha = cp.Variable()
    force = cp.sum(normal.T @ n, axis=1) + first.T @ v[:, 0] + second.T @ v[:, 1]
    moment = sum(np.cross(turned[:, i], normal).T @ n[:, i] for i in range(3))
    moment += np.cross(arm, first).T @ v[:, 0] + np.cross(arm, second).T @ v[:, 1] + normal.T @ t
    share = (np.arange(60) + 0.5) / 60
    u, w = (x.ravel() for x in np.meshgrid(share, share))
    u, w = np.where(u + w > 1.0, 1.0 - u, u), np.where(u + w > 1.0, 1.0 - w, w)
    spread = (u - 1 / 3)[:, None, None] * edges[0] + (w - 1 / 3)[:, None, None] * edges[1]
    reach = np.linalg.norm(spread, axis=2).mean(axis=0)
    total = cp.sum(n, axis=1)
    problem = cp.Problem(
        cp.Maximize(alpha),
        [
            force == np.array([0.0, 0.0, 1.0]) - alpha * np.array([1.0, 0.0, 0.0]),
            moment == 0.0,
            cp.norm(v, axis=1) + cp.multiply(1.0 / reach, cp.abs(t)) <= scene.friction * total,
        ],
    )
    problem.solve(solver=cp.CLARABEL)
    assert problem.status == "optimal", problem.status
    return float(problem.value)
