"""Yield surfaces: one small class each. A new one is a file here, or a class in your program."""

from cvxlimit.surfaces.base import Condition, Norm, YieldSurface, slip_resistance, utilisation
from cvxlimit.surfaces.cones import Cone, Conic, Facets, Parabola, parse_cone
from cvxlimit.surfaces.coulomb import ParabolicTorsionShear, Rocking, Sliding, Torsion, TorsionShear

__all__ = [
    "Condition",
    "Cone",
    "Conic",
    "Facets",
    "Norm",
    "Parabola",
    "ParabolicTorsionShear",
    "Rocking",
    "Sliding",
    "Torsion",
    "TorsionShear",
    "YieldSurface",
    "parse_cone",
    "slip_resistance",
    "utilisation",
]
