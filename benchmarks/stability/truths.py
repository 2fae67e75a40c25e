"""Answers from elsewhere: closed forms of determinate scenes, and a linear program of our own.

Nothing here uses the package's conditions, certificate or solvers: equilibrium comes from
:mod:`benchmarks.baselines`, lever arms and conditions are written down once more.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import linprog

from benchmarks.baselines import MT, V1, V2, N, program
from benchmarks.stability.families.sample import FALLS, HARMLESS
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.scene import Scene

FloatArray = NDArray[np.float64]

_SINGULAR = 1e-9
"""Reciprocal condition below which contact forces do not follow from equilibrium alone."""

_MARGIN = 1e-9
"""Share of the forces by which the dead load must be inside or outside to be called so."""


def arm(polygon: FloatArray) -> float:
    """Mean distance of a convex polygon's points (k, 2) from the origin, inside it.

    With h the distance of an edge and s along it from its foot, the integral of the distance over
    the triangle to the origin is h / 3 times that along the edge, 1/2 (s r + h² asinh(s / h)).
    """
    sum_, area = 0.0, 0.0
    for p, q in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        length = float(np.hypot(*(q - p)))
        along = (q - p) / length
        h = float(along[1] * p[0] - along[0] * p[1])
        area += 0.5 * h * length
        if abs(h) > 1e-12 * length:
            s = np.array([p @ along, q @ along])
            ends = 0.5 * (s * np.hypot(h, s) + h * h * np.arcsinh(s / abs(h)))
            sum_ += h / 3.0 * float(ends[1] - ends[0])
    return sum_ / area


def rocking(contacts: Contacts, j: int) -> FloatArray:
    """Rows (k, 6) of Eq. 9 for contact j: N times the centre's distance outside each edge."""
    corners = contacts.corners_of(j)
    rows = np.zeros((len(corners), 6))
    for row, (p, q) in enumerate(zip(corners, np.roll(corners, -1, axis=0), strict=True)):
        x, y = (q - p) / np.hypot(*(q - p))
        rows[row, N] = x * p[1] - y * p[0]
        rows[row, 3], rows[row, 4] = -x, -y  # N e = (-M2, M1)
    return rows


def facets(contacts: Contacts, j: int, number: int, reach: float) -> FloatArray:
    """Rows of Eq. 25 for contact j: a regular polygon in place of the circle of shear."""
    c, angles = arm(contacts.corners_of(j)), 2.0 * np.pi * np.arange(number) / number
    rows = np.zeros((2 * number, 6))
    for sign, part in ((1.0, slice(0, number)), (-1.0, slice(number, None))):
        rows[part, V1], rows[part, V2] = np.cos(angles) / reach, np.sin(angles) / reach
        rows[part, N], rows[part, MT] = -contacts.friction[j], sign / c
    return rows


@dataclass(frozen=True, eq=False)
class Line:
    """Contact forces x + alpha y, both (contacts, 6): those of a determinate scene."""

    contacts: Contacts
    x: FloatArray
    y: FloatArray

    @classmethod
    def of(cls, scene: Scene) -> Line | None:
        """None where contact forces do not follow from equilibrium."""
        data = program(scene)
        matrix = data.equilibrium.toarray()
        if matrix.shape[0] != matrix.shape[1] or 1.0 / np.linalg.cond(matrix) < _SINGULAR:
            return None
        x, y = (np.linalg.solve(matrix, -f).reshape(-1, 6) for f in (data.dead, data.live))
        return cls(data.contacts, x, y)

    def interval(self, torsion: float = 1.0) -> tuple[float, float]:
        """The load factors (low, high) at which all contacts hold; low > high if none does.

        ``torsion`` is the share of the twisting moments that counts: none where a reading of
        Eq. 30 takes moments about other centres.
        """
        low, high = -np.inf, np.inf
        for j, (x, y) in enumerate(zip(self.x, self.y, strict=True)):
            if self.contacts.pieces.get(j) is not None:
                return np.nan, np.nan
            size = max(float(np.abs(x).max()), float(np.abs(y).max()), 1e-300)
            for row in rocking(self.contacts, j):
                low, high = _cut(low, high, float(row @ x), float(row @ y), size)
            c, mu = arm(self.contacts.corners_of(j)), float(self.contacts.friction[j])
            for sign in (1.0, -1.0):
                twist = sign * torsion / c
                reach = mu * x[N] - twist * x[MT], mu * y[N] - twist * y[MT]
                span = _within(x[[V1, V2]], y[[V1, V2]], reach[0], reach[1])
                low, high = max(low, span[0]), min(high, span[1])
        return low, high


def _cut(low: float, high: float, a: float, b: float, size: float) -> tuple[float, float]:
    """The part of (low, high) where a + alpha b <= 0."""
    if abs(b) <= 1e-14 * size:
        return (low, high) if a <= _MARGIN * size else (np.inf, -np.inf)
    return (low, min(high, -a / b)) if b > 0.0 else (max(low, -a / b), high)


def _within(v: FloatArray, w: FloatArray, p: float, q: float) -> tuple[float, float]:
    """The interval where norm(v + alpha w) <= p + alpha q, a convex set; (inf, -inf) if none."""

    def inside(alpha: float) -> bool:
        size = np.abs(v).max() + abs(p) + abs(alpha) * (np.abs(w).max() + abs(q))
        return bool(np.hypot(*(v + alpha * w)) <= p + alpha * q + 1e-13 * size)

    a, b, c = q * q - w @ w, p * q - v @ w, p * p - v @ v
    scale = max(q * q, w @ w, 1e-300)
    if abs(a) <= 1e-14 * scale:
        roots = [-c / (2.0 * b)] if b else []
    elif b * b - a * c < -1e-12 * b * b:
        roots = []
    else:
        big = -b - np.copysign(np.sqrt(max(b * b - a * c, 0.0)), b)
        roots = sorted({float(big / a), float(c / big) if big else 0.0})
    marks = [-np.inf, *sorted(roots), np.inf]
    good = [
        (s, e) for s, e in itertools.pairwise(marks)
        if inside(_between(s, e))
    ]  # fmt: skip
    if not good:
        kept = [r for r in roots if inside(r)]
        return (kept[0], kept[0]) if kept else (np.inf, -np.inf)
    return good[0][0], good[-1][1]


def _between(start: float, end: float) -> float:
    """A number well inside an interval."""
    if np.isfinite(start) and np.isfinite(end):
        return 0.5 * (start + end)
    if np.isfinite(start):
        return start + abs(start) + 1.0
    return end - abs(end) - 1.0 if np.isfinite(end) else 0.0


def closed_form(scene: Scene) -> float | str | None:
    """The load factor of a determinate scene, :data:`FALLS`, :data:`HARMLESS`, or None."""
    line = Line.of(scene)
    if line is None:
        return None
    low, high = line.interval()
    if np.isnan(low) or abs(low) < _MARGIN or abs(high) < _MARGIN:
        return None
    if low > 0.0 or high < 0.0 or low > high:
        return FALLS
    return HARMLESS if np.isinf(high) else high


def linear_bounds(scene: Scene, number: int = 24) -> tuple[float, float]:
    """Load factors with inscribed and circumscribed facets, by HiGHS; nan where it says nothing.

    With 24 facets they are 0.9 % of friction apart; infinite where it finds no limit.
    """
    inscribed, circumscribed = (
        _linear(scene, number, reach) for reach in (np.cos(np.pi / number), 1.0)
    )
    return inscribed, circumscribed


def _linear(scene: Scene, number: int, reach: float) -> float:
    data = program(scene)
    each = [
        np.vstack([rocking(data.contacts, j), facets(data.contacts, j, number, reach)])
        for j in range(len(data.contacts))
    ]
    scaled = [sp.csr_array(r / np.abs(r).max(axis=1)[:, None]) for r in each]
    rows = sp.block_diag(scaled, format="csr")
    force = np.abs(data.dead).sum() or np.abs(data.live).sum()
    live = np.abs(data.live).sum()
    # In units of the total load HiGHS loses blocks that weigh a 1e-9 of it, and 6 % of the answer.
    loads = np.abs(data.dead) / force + np.abs(data.live) / live
    each = loads.reshape(-1, 6).sum(axis=1)
    own = sp.diags_array(1.0 / np.repeat(np.where(each > 0.0, each, 1.0), 6))
    found = linprog(
        np.append(np.zeros(rows.shape[1]), -1.0),
        sp.hstack([rows, sp.csr_array((rows.shape[0], 1))]).tocsr(),
        np.zeros(rows.shape[0]),
        (own @ sp.hstack([data.equilibrium, sp.csr_array(data.live[:, None] / live)])).tocsr(),
        own @ (-data.dead / force),
        bounds=(None, None),
        method="highs",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    if found.status == 3:
        return np.inf
    return float(found.x[-1]) * force / live if found.status == 0 else np.nan
