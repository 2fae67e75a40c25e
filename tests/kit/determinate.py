"""Determinate scenes with their load factors under Eq. 30 found by hand, and states of Eq. 30."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from cvxlimit import Block, Load, Scene
from cvxlimit.extensions.interaction.relaxation.upper import UpperBound
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.geometry.polygons import effective_regions, mean_distance
from cvxlimit.masonry import single_block, stack
from cvxlimit.methods.driver import Run
from cvxlimit.readings.named import parse_moments
from cvxlimit.solvers import default_ladder
from helpers import hand_equilibrium, interaction_excess

FloatArray = NDArray[np.float64]

MOMENTS = ["independent", "signed"]


def prism(id: str, sides: int, low: float, high: float, turn: float = 0.0) -> Block:
    angles = turn + 2.0 * np.pi * np.arange(sides) / sides
    ring = 0.5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners = [np.column_stack([ring, np.full(sides, z)]) for z in (low, high)]
    return Block.hull(id, np.vstack(corners), density=20.0)


def hexagons(live: Load | None = None) -> Scene:
    """Two hexagonal prisms on one another; the contacts are a hexagon and a 12-gon."""
    ground = Block.box("ground", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0))
    blocks = (ground, prism("b1", 6, 0.0, 0.4), prism("b2", 6, 0.4, 0.9, turn=0.5))
    push = live or Load(acceleration=(0.3, 1.0, 0.0), forces={"b2": (0, 0, 0, 0, 0, 1.5)})
    return Scene(blocks, ("ground",), push, friction=0.6)


def tangential(
    e: np.ndarray, arm: np.ndarray, friction: float, moments: str, way: np.ndarray
) -> np.ndarray:
    """V1, V2, MT (k, 3) along ``way`` (k, 3), as far as Eq. 30 lets them go with N = 1."""
    v1, v2, mt = way.T
    if moments == "signed":
        torque = np.abs(mt - e[:, 0] * v2 + e[:, 1] * v1)
    else:
        torque = np.abs(v1 * e[:, 1]) + np.abs(v2 * e[:, 0]) + np.abs(mt)
    size = torque + arm * np.hypot(v1, v2)
    return way * (friction * arm / np.where(size > 0.0, size, 1.0))[:, None]


def states(e: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """Forces (k, 6) with N = 1."""
    forces = np.zeros((len(e), 6))
    forces[:, [COLUMN["V1"], COLUMN["V2"], COLUMN["MT"]]] = shear
    forces[:, COLUMN["N"]] = 1.0
    forces[:, COLUMN["M1"]], forces[:, COLUMN["M2"]] = e[:, 1], -e[:, 0]
    return forces


TWIST = Load(acceleration=(0.3, 1.0, 0.0), forces={"b1": (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)})


TOP_TWIST = Load(acceleration=(0.0, 1.0, 0.0), forces={"b2": (0.0, 0.0, 0.0, 0.0, 1.0, 2.5)})


DETERMINATE = {
    "one block": single_block((1.0, 0.5, 0.4), friction=0.6, live=TWIST),
    "one slender block": single_block((0.4, 0.1, 0.4), friction=0.5, live=TWIST),
    "two blocks": stack(2, (1.0, 1.0, 0.8), shift=(0.1, 0.1), friction=0.6, live=TOP_TWIST),
    "hexagons": hexagons(),
}
"""Forces follow from equilibrium, so that the load factor can be searched for by hand."""


@cache
def exact(name: str, moments: str) -> float:
    """Largest load factor whose forces pass the checker, from a fine scan of load factors."""
    scene = DETERMINATE[name]
    matrix, dead, live = hand_equilibrium(scene)
    dense = matrix.toarray()
    x_dead, x_live = np.linalg.solve(dense, -dead), np.linalg.solve(dense, -live)
    _, inward, offset = scene.contacts.edges

    def stands(alpha: float) -> bool:
        forces = (x_dead + alpha * x_live).reshape(-1, 6)
        rows = forces[scene.contacts.corner_contact]
        inside = offset * rows[:, 2] - inward[:, 0] * rows[:, 4] + inward[:, 1] * rows[:, 3]
        if inside.min() < 0.0 or forces[:, 2].min() < 0.0:
            return False
        return bool(interaction_excess(forces, scene.contacts, moments).max() <= 0.0)

    grid = np.linspace(0.0, 2.0, 4_001)
    last = max(i for i, alpha in enumerate(grid) if stands(alpha))
    low, high = grid[last], grid[last + 1]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    return float(low)


def upper_bound(scene: Scene, moments: str, tolerance: float = 1e-5) -> tuple[Run, UpperBound]:
    """A run with the upper bound of the hull, and how it was found."""
    run = Run(scene, moments=parse_moments(moments))
    search = UpperBound(run)
    search.search(tolerance, default_ladder())
    return run, search


def upper(scene: Scene, moments: str, tolerance: float = 1e-5) -> float:
    return upper_bound(scene, moments, tolerance)[0].best.bracket.upper


def arm_at(polygon: FloatArray, e: FloatArray) -> float:
    return mean_distance(effective_regions(polygon, [e])[0], e)
