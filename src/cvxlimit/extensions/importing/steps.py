"""How far apart the numbers lie that a file can hold: single precision, or a text of few digits."""

from __future__ import annotations

from decimal import Decimal

import numpy as np

from cvxlimit.base.arrays import FloatArray

FEW = 9
"""Numbers with fewer digits may have been cut; doubles written in full have 15 to 17."""

_CUT = 6
"""Digits that programs leave which cut at all; numbers of fewer are round."""


def step_of(points: FloatArray) -> float:
    """How far a coordinate may be off (length), as the file has no further digits: 0 for doubles
    written in full, and for round numbers."""
    far = float(np.abs(points).max(initial=0.0))
    if holds_single(points):
        return float(np.spacing(np.float32(far)))
    digits = digits_of(points)
    return last_place(far, digits) if _CUT <= digits < FEW else 0.0


def holds_single(points: FloatArray) -> bool:
    """True if all are numbers of single precision."""
    return bool((points.astype(np.float32) == points).all())


def digits_of(values: FloatArray) -> int:
    """The most significant digits that a number among the values has.

    >>> digits_of(np.array([[1200.0, 0.25, 3.125]]))
    4
    """
    different = np.unique(values).tolist()
    return max((len(Decimal(repr(x)).normalize().as_tuple().digits) for x in different), default=0)


def last_place(x: float, digits: int) -> float:
    """What the last of so many digits of a number is worth; 0 is taken as 1.

    >>> last_place(4321.0, 6)
    0.01
    """
    return float(10.0 ** (np.floor(np.log10(x or 1.0)) + 1 - digits))
