"""Torsion with shear closer to the exact limit of Eq. 18-21 than the paper's line (Eq. 24)."""

from __future__ import annotations

from collections.abc import Sequence

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.surfaces.base import Condition, Norm, YieldSurface
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import slip_resistance
from cvxlimit.surfaces.exact_torsion import parabola_arm

FloatArray = NDArray[np.float64]


class Parabola(Cone):
    """Gauge of vectors (v1, v2, m) whose unit ball is abs(m) <= 1 - v1^2 - v2^2.

    abs(m)/2 + norm(v1, v2, m/2): one second-order cone.

    >>> v = [np.array([0.6]), np.array([0.0]), np.array([0.64])]
    >>> Parabola().gauge(v).tolist()
    [1.0]
    """

    def __str__(self) -> str:
        return "parabola"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Parabola)

    def __hash__(self) -> int:
        return hash(Parabola)

    def _gauge(self, rows: FloatArray) -> FloatArray:
        v1, v2, m = rows
        return np.asarray(np.abs(m) / 2.0 + np.hypot(np.hypot(v1, v2), m / 2.0))

    def _polar_gauge(self, rows: FloatArray) -> FloatArray:
        """Largest s v + t (1 - v^2) for 0 <= v <= 1, with slip s and twist t."""
        slip, twist = np.hypot(rows[0], rows[1]), np.abs(rows[2])
        safe = np.where(twist > 0.0, twist, 1.0)
        turning = twist + slip**2 / (4.0 * safe)
        return np.where(slip < 2.0 * twist, turning, slip)

    def _epigraph(self, bound: cp.Expression, rows: Sequence[cp.Expression]) -> list[cp.Constraint]:
        v1, v2, m = rows
        half = cp.Variable(bound.shape)
        cone = cp.SOC(bound - half, cp.vstack([v1, v2, 0.5 * m]), axis=0)
        return [cone, 0.5 * m <= half, -0.5 * m <= half]

    def _polar_epigraph(
        self, bound: cp.Expression, rows: Sequence[cp.Expression]
    ) -> list[cp.Constraint]:
        """The polar of a sum: the twist is shared between the two gauges."""
        slip_1, slip_2, twist = rows
        share = cp.Variable(bound.shape)
        cone = cp.SOC(bound, cp.vstack([slip_1, slip_2, 2.0 * share]), axis=0)
        return [cone, 2.0 * (twist - share) <= bound, 2.0 * (share - twist) <= bound]


class ParabolicTorsionShear(YieldSurface):
    """abs(MT) / c <= R - abs(V)^2 / R with R = mu N, and c A added with cohesion.

    For rectangles c is c_T (Eq. 16): the parabola lies between the paper's line (Eq. 24) and the
    exact limit of Eq. 18-21, at the price of the line. For other polygons c is the largest safe
    arm, c_T or less, see :func:`~cvxlimit.surfaces.exact_torsion.parabola_arm`.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.surfaces import Rocking
    >>> scene = builtin_scene("tuff-wall")
    >>> round(solve(scene, [Rocking(), ParabolicTorsionShear()]).load_factor, 5)
    0.42308
    """

    name = "parabolic torsion-shear"
    implies = frozenset({"sliding", "torsion"})

    def __init__(self) -> None:
        super().__init__(Parabola())

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / parabola_arm(contacts)})
        return [Condition([size], slip_resistance(contacts))]
