"""Whether a configuration of displaced blocks keeps the laws, written anew."""

from __future__ import annotations

import numpy as np

from cvxlimit.extensions.paths.configuration import Configuration


def assert_balanced_within_friction(shown: Configuration) -> None:
    """Equilibrium of the displaced blocks, compressions, Coulomb's law, and nothing overrun."""
    scene, points, size = shown.scene(), shown.points, shown.start.contacts.typical_size
    weight = shown.start.total_weight
    force = np.einsum("kix,ki->kx", points.axes[:, [2, 0, 1]], shown.forces)
    for i in scene.free.tolist():
        block = scene.blocks[i]
        total = scene.dead.on([block])[0] + shown.load_factor * scene.live.on([block])[0]
        for side, sign in ((points.a, -1.0), (points.b, 1.0)):
            mine = side == i
            arm = points.at[mine] - block.centroid
            total[:3] += sign * force[mine].sum(axis=0)
            total[3:] += sign * np.cross(arm, force[mine]).sum(axis=0)
        assert np.abs(total).max() < 1e-8 * weight * max(1.0, size)
    n, v = shown.forces[:, 0], np.linalg.norm(shown.forces[:, 1:], axis=1)
    assert (n > points.least - 1e-9 * weight).all()
    assert (v <= points.friction * n + points.cohesion + 1e-8 * weight).all()
    assert (n <= points.most + 1e-8 * weight).all()
    assert points.gap[np.isinf(points.most)].min() > -1e-8 * size
