"""A wedge that slides along a groove, whose load factor is known in closed form."""

from __future__ import annotations

import numpy as np

from cvxlimit import Block, Load, Scene


def wedge(half: float, dip: float, friction: float) -> Scene:
    """A wedge in a groove whose sides lean by ``half`` degrees from the upright, pushed down it."""
    side, tilt = np.tan(np.radians(half)), np.radians(dip)
    ends = {
        "wedge": ([(0, 0), (side, 1), (-side, 1)], (0.0, 12.0), 20.0),
        "left": ([(0, 0), (-side, 1), (-side - 1, 1), (-1, -1), (0, -1)], (-5.0, 25.0), None),
        "right": ([(0, 0), (0, -1), (1, -1), (side + 1, 1), (side, 1)], (-5.0, 25.0), None),
    }
    blocks = []
    for key, (outline, (start, end), density) in ends.items():
        n = len(outline)
        points = [(x, y, z) for y in (start, end) for x, z in outline]
        faces = [tuple(range(n)), tuple(range(2 * n - 1, n - 1, -1))]
        faces += [(n + i, n + (i + 1) % n, (i + 1) % n, i) for i in range(n)]
        blocks.append(Block.polyhedron(key, points, faces, density))
    down = Load(gravity=(0.0, float(np.sin(tilt)), -float(np.cos(tilt))))
    live = Load(acceleration=(0, 1, 0))
    return Scene(blocks, ["left", "right"], live, dead=down, friction=friction)
