"""Two blocks on a curved joint, and what they carry by a linear program of the test's own.

A joint is a profile z(x), drawn out along y, or a surface z(x, y) on a grid. The two sides may be
meshed apart. The program is planar: both ends of every pair of facets that overlap push with
Coulomb friction; nothing of the package but blocks and scenes is used.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

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
