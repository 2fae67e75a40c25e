"""Hidden surfaces by a depth buffer in NumPy: exact for any faces, no OpenGL, no display."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.geometry.mesh import cross

NOTHING = -1
"""Number of the background in :attr:`Canvas.seen`."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """What is seen at every pixel, row 0 at the top: ``seen`` (height, width) holds face numbers,
    ``nearness`` the distance towards the viewer."""

    seen: NDArray[np.int32]
    nearness: NDArray[np.float32]

    @classmethod
    def blank(cls, height: int, width: int) -> Canvas:
        return cls(
            np.full((height, width), NOTHING, dtype=np.int32),
            np.full((height, width), -np.inf, dtype=np.float32),
        )

    def draw(self, polygon: FloatArray, number: int) -> None:
        """Draw a convex polygon (k, 3): column, row and nearness of its corners, which varies as on
        the plane through them (best fit if they are not flat). Edge-on ones leave no trace."""
        corners: list[list[float]] = polygon.tolist()  # few: quicker one by one than as arrays
        x, y, _ = zip(*corners, strict=True)
        spokes = polygon[1:] - polygon[0]
        normal = cross(spokes[:-1], spokes[1:]).sum(axis=0)
        middle = polygon.mean(axis=0)
        if abs(normal[2]) < 1e-6:
            return
        height, width = self.seen.shape
        low = max(math.ceil(min(x)), 0), max(math.ceil(min(y)), 0)
        high = min(math.floor(max(x)) + 1, width), min(math.floor(max(y)) + 1, height)
        if high[0] <= low[0] or high[1] <= low[1]:
            return
        columns = np.arange(low[0], high[0])
        rows = np.arange(low[1], high[1])[:, None]
        inside = np.ones((len(rows), len(columns)), dtype=bool)
        sign = math.copysign(1.0, normal[2])
        for (x0, y0, _), (x1, y1, _) in zip(corners, [*corners[1:], corners[0]], strict=True):
            inside &= sign * (x1 - x0) * (rows - y0) >= sign * (y1 - y0) * (columns - x0)
        across, down = normal[0] / normal[2], normal[1] / normal[2]
        depth = middle[2] - across * (columns - middle[0]) - down * (rows - middle[1])
        window = np.s_[low[1] : high[1], low[0] : high[0]]
        nearest = inside & (depth > self.nearness[window])
        self.nearness[window][nearest] = depth[nearest]
        self.seen[window][nearest] = number

    def outlines(self, patch: IntArray) -> NDArray[np.bool_]:
        """Pixels where one surface ends; ``patch`` numbers the surface of every face. Numbers
        beyond the faces (marks) have no outline."""
        numbers_below = len(patch)
        known = np.append(patch, NOTHING)  # the background's -1 picks the last
        seen = np.where(self.seen < numbers_below, known[np.minimum(self.seen, numbers_below)],
                        self.seen + numbers_below)  # fmt: skip
        result = np.zeros(seen.shape, dtype=bool)
        for first, second in (
            (np.s_[:, :-1], np.s_[:, 1:]),
            (np.s_[:-1, :], np.s_[1:, :]),
        ):
            differ = seen[first] != seen[second]
            differ &= (self.seen[first] < numbers_below) & (self.seen[second] < numbers_below)
            result[first] |= differ
            result[second] |= differ
        return result
