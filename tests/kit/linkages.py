"""Closed forms and linkages against which paths are held; nothing of the package is used here."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]


def rocking(b: float, h: float, w: float) -> float:
    """Load factor of a block of b by h on its toe whose centroid has moved by w."""
    alpha, r = np.arctan(b / h), 0.5 * np.hypot(b, h)
    return float(np.tan(np.arcsin(np.sin(alpha) - w / r)))


def turned(angle: float, x: Array) -> Array:
    """Clockwise in the plane (x, z): towards +x."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * x[0] + s * x[1], -s * x[0] + c * x[1]])


def leaning(
    one: tuple[float, float], other: tuple[float, float], apart: float, w: float,
    friction: float = 0.0,
) -> tuple[float, float, float]:  # fmt: skip
    """Two blocks (b, h), the first pushed over its toe until its top meets the second's side, along
    which it slides down against friction: the load factor at mean displacement w, and both angles.

    Toes at 0 and at ``apart`` + the second's width; equal weight per area.
    """
    (b1, h1), (b2, h2) = one, other
    weight = np.array([b1 * h1, b2 * h2])
    arms = np.array([[-b1 / 2, h1 / 2], [-b2 / 2, h2 / 2]])
    second = np.array([apart + b2, 0.0])
    corner = np.array([0.0, h1])

    def clearance(first: float, of_second: float) -> float:
        face = turned(of_second, np.array([1.0, 0.0]))
        return float((second - turned(first, corner)) @ face) - b2

    def of_second(first: float) -> float:
        if clearance(first, 0.0) >= 0.0:
            return 0.0
        return float(brentq(lambda a: clearance(first, a), 0.0, 1.5, xtol=1e-15))

    def centres(first: float) -> Array:
        angles = first, of_second(first)
        return np.array([turned(a, arm) for a, arm in zip(angles, arms, strict=True)])

    def moved(first: float) -> float:
        return float(weight @ (centres(first)[:, 0] - arms[:, 0])) / weight.sum() - w

    first = float(brentq(moved, 0.0, 0.5, xtol=1e-15))
    angle = of_second(first)
    # Moments about both toes, the first's corner pressing with N along the second's normal, and
    # dragging down along its side.
    face = turned(angle, np.array([1.0, -friction]))
    at = turned(first, corner)
    levers = [at[0] * -face[1] + at[1] * face[0], (at - second)[0] * -face[1] + at[1] * face[0]]
    x, z = centres(first).T
    if angle == 0.0:
        return float(-x[0] / z[0]), first, angle
    # weight (alpha z + x) = +-N lever, for both blocks
    matrix = np.array([[weight[0] * z[0], -levers[0]], [weight[1] * z[1], levers[1]]])
    alpha, _ = np.linalg.solve(matrix, -weight * x)
    return float(alpha), first, angle


def _across(v: Array) -> Array:
    """Rates of arms v (..., 2) that turn clockwise."""
    return np.stack([v[..., 1], -v[..., 0]], axis=-1)


def _way(v: Array) -> float:
    return float(np.arctan2(v[1], v[0]))


class FourBars:
    """A chain of rigid voussoirs on four hinges, in a plane: exact positions and load factors.

    ``joints`` (n + 1, 2, 2) are the inner and outer ends of the joints of n voussoirs, ``hinges``
    four (joint, end) from left to right. Its two abutments are fixed; the live load is horizontal.
    """

    def __init__(self, joints: Array, hinges: Sequence[tuple[int, int]]) -> None:
        self.joints, self.hinges = joints, hinges
        quads = [np.array([a[0], b[0], b[1], a[1]]) for a, b in pairwise(joints)]
        found = [self._area(q) for q in quads]
        self.weight = np.array([area for area, _ in found])
        self.centre = np.array([centre for _, centre in found])
        self.pins = np.array([joints[j][end] for j, end in hinges])
        number = np.arange(len(quads))
        self.body = np.searchsorted([j for j, _ in hinges], number, side="right")  # 1, 2, 3 move

    @staticmethod
    def _area(quad: Array) -> tuple[float, Array]:
        x, z = quad.T
        x1, z1 = np.roll(quad, -1, axis=0).T
        cross = x * z1 - x1 * z
        area = cross.sum() / 2
        return abs(area), np.array([((x + x1) * cross).sum(), ((z + z1) * cross).sum()]) / (
            6 * area
        )

    def pose(self, angle: float) -> tuple[Array, Array]:
        """Angles (3,) of the bars and places (4, 2) of the pins, the first bar turned clockwise."""
        a, b, c, d = self.pins
        second = a + turned(angle, b - a)
        r, s = np.linalg.norm(c - b), np.linalg.norm(d - c)
        span = d - second
        length = np.linalg.norm(span)
        along = (r**2 - s**2 + length**2) / (2 * length)
        up = np.sqrt(r**2 - along**2)
        unit = span / length
        side = np.array([-unit[1], unit[0]])
        first = (c - b) @ np.array([-(d - b)[1], (d - b)[0]])
        third = second + along * unit + np.copysign(up, first) * side
        bars = (b - a, second - a), (c - b, third - second), (d - c, d - third)
        return np.array([_way(x) - _way(y) for x, y in bars]), np.array([a, second, third, d])

    def centres(self, angle: float) -> Array:
        angles, pins = self.pose(angle)
        result = self.centre.copy()
        for k in (1, 2, 3):
            mine = self.body == k
            result[mine] = [
                pins[k - 1] + turned(angles[k - 1], x - self.pins[k - 1]) for x in self.centre[mine]
            ]
        return result

    def rates(self, angle: float) -> Array:
        """Of the centroids (n, 2) for the first bar's rate 1, from the rates of the three bars."""
        _, (a, b, c, d) = self.pose(angle)
        bars = _across(np.array([b - a, c - b, d - c]))
        speed = np.array([1.0, *np.linalg.solve(bars[1:].T, -bars[0])])
        pins, start = np.array([a, b, c]), np.cumsum([np.zeros(2), *(speed[:, None] * bars)[:2]], 0)
        result, centres = np.zeros_like(self.centre), self.centres(angle)
        for k in range(3):
            mine = self.body == k + 1
            result[mine] = start[k] + speed[k] * _across(centres[mine] - pins[k])
        return result

    def load_factor(self, angle: float) -> float:
        rates = self.rates(angle)
        return float(self.weight @ rates[:, 1] / (self.weight @ rates[:, 0]))

    def at(self, w: float) -> float:
        """The load factor at mean displacement w of the live load."""
        sign = np.sign(self.weight @ self.rates(0.0)[:, 0])

        def moved(angle: float) -> float:
            way = self.centres(sign * angle)[:, 0] - self.centre[:, 0]
            return float(self.weight @ way / self.weight.sum()) - w

        return self.load_factor(sign * float(brentq(moved, 0.0, 0.3, xtol=1e-15)))

    @classmethod
    def least(cls, joints: Array) -> FourBars:
        """That with the least load factor of all that hinge at inner and outer ends in turn, and
        whose live load does work on the way down: the mechanism that begins."""
        found = []
        for places in combinations(range(len(joints)), 4):
            for first in (0, 1):
                bars = cls(joints, [(j, (first + k) % 2) for k, j in enumerate(places)])
                alpha = bars.load_factor(0.0)
                if alpha > 0.0:
                    found.append((alpha, bars))
        return min(found, key=lambda each: each[0])[1]
