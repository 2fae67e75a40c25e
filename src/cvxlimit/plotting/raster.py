"""Hidden surfaces by a depth buffer in NumPy: exact for any faces, no OpenGL, no display."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NOTHING = -1
"""Number of the background in :attr:`Canvas.seen`."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """What is seen at every pixel, row 0 at the top.

    ``seen`` (height, width) holds face numbers, ``nearness`` the distance towards the viewer.
    """

    seen: NDArray[np.int32]
    nearness: NDArray[np.float32]

    @classmethod
    def blank(cls, height: int, width: int) -> Canvas:
        """A canvas that shows nothing."""
        return cls(
            np.full((height, width), NOTHING, dtype=np.int32),
            np.full((height, width), -np.inf, dtype=np.float32),
        )

    def draw(self, polygon: FloatArray, number: int) -> None:
        """Draw a convex polygon (k, 3): column, row and nearness of its corners.

        The nearness varies as on the plane through the corners (best fit if they are not
        flat). Polygons seen edge-on leave no trace.
        """
        xy = polygon[:, :2]
        doubled = _doubled_area(xy)
        if abs(doubled) < 1e-6:
            return
        low = np.maximum(np.ceil(xy.min(axis=0)), 0).astype(int)
        high = np.minimum(np.floor(xy.max(axis=0)) + 1, self.seen.shape[::-1]).astype(int)
        if (high <= low).any():
            return
        columns = np.arange(low[0], high[0])
        rows = np.arange(low[1], high[1])[:, None]
        inside = np.ones((len(rows), len(columns)), dtype=bool)
        along = (np.roll(xy, -1, axis=0) - xy) * np.sign(doubled)
        for (x, y), (dx, dy) in zip(xy, along, strict=True):
            inside &= dx * (rows - y) >= dy * (columns - x)
        depth = _plane(polygon, columns, rows)
        window = np.s_[low[1] : high[1], low[0] : high[0]]
        nearest = inside & (depth > self.nearness[window])
        self.nearness[window][nearest] = depth[nearest]
        self.seen[window][nearest] = number

    def outlines(self, patch: IntArray) -> NDArray[np.bool_]:
        """Pixels where one surface ends; ``patch`` numbers the surface of every face.

        Numbers beyond the faces (marks) have no outline.
        """
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


def _doubled_area(xy: FloatArray) -> float:
    x, y = (xy - xy[0]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def _plane(polygon: FloatArray, columns: IntArray, rows: IntArray) -> FloatArray:
    """Nearness at pixels on the plane through the polygon's mean with its mean normal."""
    middle = polygon.mean(axis=0)
    spokes = polygon - middle
    nx, ny, nz = np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0)
    result: FloatArray = (
        middle[2] - (nx / nz) * (columns - middle[0]) - (ny / nz) * (rows - middle[1])
    )
    return result
