"""Least and largest load factor by a cone program of its own, and scenes whose dead load leans."""

from __future__ import annotations

import cvxpy as cp
import numpy as np

from cvxlimit import Block, Load, Scene
from helpers import corners_in_plane, hand_equilibrium, hand_torsion_arm

BOUNDLESS = 1e4
"""Load factors beyond this are none: the scenes are of the size of 1."""


def leaning_cube() -> Scene:
    """0.1 to 1.1 of a push hold it: 0.6 of its weight pulls, and friction is 0.5."""
    ground = Block.box("g", (-5, -5, -1), (5, 5, 0))
    cube = Block.box("c", (0, 0, 0), (1, 1, 0.5), 1.0)
    dead = Load(gravity=(0, 0, -1), acceleration=(0.6, 0, 0))
    return Scene([ground, cube], ["g"], Load(acceleration=(-1, 0, 0)), dead, friction=0.5)


def ends(scene: Scene) -> tuple[float, float] | None:
    """Both ends of the load factors that are carried, infinite where there is none; None if no
    factor is. Compressions at corners, one cone a contact (Eq. 9 and 24)."""
    matrix, dead, live = hand_equilibrium(scene)
    contacts, alpha = list(scene.contacts), cp.Variable()
    forces, limits = [], []
    for contact in contacts:
        corners = corners_in_plane(contact)
        pressed, shear = cp.Variable(len(corners), nonneg=True), cp.Variable(2)
        torsion, reach = cp.Variable(), hand_torsion_arm(contact)
        normal, (x, y) = cp.sum(pressed), corners.T
        forces += [shear, normal, y @ pressed, -(x @ pressed), torsion]
        friction = contact.friction * normal
        limits.append(cp.norm(shear) + cp.abs(torsion) / reach <= friction)
    limits.append(matrix @ cp.hstack(forces) + dead + alpha * live == 0.0)
    found = []
    for sign in (-1.0, 1.0):
        problem = cp.Problem(cp.Maximize(sign * alpha), [*limits, cp.abs(alpha) <= BOUNDLESS])
        problem.solve(solver="CLARABEL", tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
        if problem.status in ("infeasible", "infeasible_inaccurate"):
            return None
        reached = float(alpha.value)
        found.append(sign * np.inf if abs(reached) > 0.99 * BOUNDLESS else reached)
    return found[0], found[1]


def leaning(seed: int) -> Scene:
    """A pile of two to four slabs on a slab, sometimes clamped between walls, whose dead load pulls
    sideways as well; the live load pulls along any direction."""
    rng = np.random.default_rng(seed)
    blocks, height = [Block.box("ground", (-9, -9, -1), (9, 9, 0))], 0.0
    for i in range(rng.integers(1, 5)):
        size = rng.uniform((0.6, 0.6, 0.1), (1.2, 1.2, 0.6))
        at = rng.uniform(-0.25, 0.25, 2)
        low = np.array([*(at - 0.5 * size[:2]), height])
        height += size[2]
        high = np.array([*(at + 0.5 * size[:2]), height])
        blocks.append(Block.box(f"b{i}", low, high, density=rng.uniform(10.0, 30.0)))
    supports = ["ground"]
    if rng.uniform() < 0.25:  # a block on top that does not move
        blocks.append(Block.box("lid", (-9, -9, height), (9, 9, height + 1.0)))
        supports.append("lid")
    turn, along = rng.uniform(0.0, 2.0 * np.pi), rng.normal(size=3)
    pull = rng.uniform(0.0, 0.9) * np.array([np.cos(turn), np.sin(turn), 0.0])
    return Scene(
        blocks, supports, Load(acceleration=along / np.linalg.norm(along)),
        Load(gravity=(0.0, 0.0, -1.0), acceleration=pull), friction=rng.uniform(0.2, 0.8),
    )  # fmt: skip
