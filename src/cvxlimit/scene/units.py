"""The user's units: names of them, and those of length and force that can be converted."""

from __future__ import annotations

from dataclasses import dataclass

from cvxlimit.base.checks import of_type

METRES = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
"""Units of length that can be converted, in metres."""

KILONEWTONS = {"kN": 1.0, "N": 1e-3, "MN": 1e3}
"""Units of force that can be converted, in kilonewtons."""

G = 9.81
"""Acceleration of gravity, m/s2, as codes have it: between masses and weights."""


@dataclass(frozen=True)
class Units:
    """Names of the user's units; results come back in them. Nothing is converted."""

    length: str = "m"
    force: str = "kN"

    def __post_init__(self) -> None:
        for name in ("length", "force"):
            of_type(getattr(self, name), str, f"unit of {name} must be a text")


DEFAULT_UNITS = Units()
