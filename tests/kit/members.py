"""Solutions without dilatancy, written a second time: matrices and rigid motions by hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvxlimit.scene import Scene
from helpers import corners_in_plane, hand_equilibrium, hand_torsion_arm

FloatArray = NDArray[np.float64]

CIRCLE = "conic"


def octagon() -> FloatArray:
    """Corners (8, 2) of the octagon around the unit circle whose first side is across t1."""
    angles = np.pi / 8.0 + np.arange(8) * np.pi / 4.0
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) / np.cos(np.pi / 8.0)


def assert_member(
    scene: Scene,
    forces: FloatArray,
    mechanism: FloatArray,
    factor: float,
    surface: str = CIRCLE,
    tolerance: float = 2e-6,
) -> None:
    """Equilibrium, yield, no penetration, no opening under pressure, friction against slip, and
    reactions between none and their most that bear it wherever they are pushed back.

    ``surface`` is "conic" or "octagon". The tolerance is of yield over the load, of penetration
    over the largest opening and of power over the load factor's.
    """
    matrix, dead, live = hand_equilibrium(scene)
    load = np.abs(dead).sum()
    assert np.abs(matrix @ forces.ravel() + dead + factor * live).max() < 1e-9 * load
    assert abs(live @ mechanism.ravel() - 1.0) < 1e-6
    motion = {block.id: np.zeros(6) for block in scene.blocks}
    motion |= {scene.blocks[i].id: u for i, u in zip(scene.free, mechanism, strict=True)}
    blocks = {block.id: block for block in scene.blocks}
    lost, worst, largest = 0.0, 0.0, 0.0
    cohesion, points = scene.contacts.cohesion, scene.contacts.is_point
    bounds = dict(zip(np.flatnonzero(points).tolist(), scene.reactions, strict=True))  # soil
    for j, (c, x, bond) in enumerate(zip(scene.contacts, forces, cohesion, strict=True)):
        if j in bounds:
            speed = sum(
                sign * np.dot(motion[k][:3] + np.cross(motion[k][3:], at), bounds[j].direction)
                for k, sign in ((bounds[j].block, 1.0), (bounds[j].on, -1.0))
                if k is not None and k in motion
                for at in [np.subtract(bounds[j].at, blocks[k].centroid)]
            )
            assert -tolerance * load < x[2] < bounds[j].most + tolerance * load
            lost += abs(x[2] * speed + bounds[j].most * max(-speed, 0.0))
            continue
        shear, arm = np.hypot(x[0], x[1]), hand_torsion_arm(c)
        resistance = c.friction * x[2] + bond * c.area
        if surface != CIRCLE:
            angles = np.arange(8) * np.pi / 4.0
            shear = max(x[0] * np.cos(angles) + x[1] * np.sin(angles))
        assert shear + abs(x[5]) / arm - resistance < tolerance * load
        corners = corners_in_plane(c)
        for p, e in zip(corners, np.roll(corners, -1, axis=0) - corners, strict=True):
            inside = (e[0] * (x[2] * p[1] - x[3]) - e[1] * (x[2] * p[0] + x[4])) / np.hypot(*e)
            assert inside < tolerance * load * np.sqrt(c.area)
        at = np.vstack([c.origin, c.corners])
        moved = [motion[k][:3] + np.cross(motion[k][3:], at - blocks[k].centroid)
                 for k in (c.a, c.b)]  # fmt: skip
        gap, turning = moved[1] - moved[0], motion[c.b][3:] - motion[c.a][3:]
        worst = min(worst, float((gap[1:] @ c.normal).min()))
        largest = max(largest, float(np.abs(gap @ c.normal).max()))
        slip = np.array([gap[0] @ c.t1, gap[0] @ c.t2])
        rates = np.array([*slip, gap[0] @ c.normal, *(turning @ t for t in (c.t1, c.t2, c.normal))])
        slide = np.hypot(*slip) if surface == CIRCLE else float((octagon() @ slip).max())
        lost += abs(x @ rates + resistance * max(slide, arm * abs(rates[5])))
        largest = max(largest, float(np.hypot(*slip)))
    assert worst > -tolerance * largest
    assert lost < tolerance * max(abs(factor), load / np.abs(live).sum())
