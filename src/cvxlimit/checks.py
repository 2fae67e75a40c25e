"""Checks of numbers given by users; each refusal names the object and shows the value."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.errors import InputError


def finite_vector(value: Any, length: int, what: str) -> NDArray[np.float64]:
    """``value`` as an array of ``length`` finite numbers; ``what`` names it in the refusal."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} must be {length} numbers, got {value!r}") from error
    if array.shape != (length,):
        raise InputError(f"{what} must be {length} numbers, got {value!r}")
    if not np.isfinite(array).all():
        raise InputError(f"{what} must be finite, got {array.tolist()}")
    return array


def not_negative(value: Any, what: str) -> float:
    """``value`` as a finite float >= 0; ``what`` names it in the refusal."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.floating, np.integer)):
        raise InputError(f"{what} must be a number, got {value!r}")
    if not 0.0 <= value <= sys.float_info.max:
        raise InputError(f"{what} must be finite and not negative, got {value!r:.40}")
    return float(value)


def positive(value: Any, what: str) -> float:
    """``value`` as a finite float > 0; ``what`` names it in the refusal."""
    number = not_negative(value, what)
    if number == 0.0:
        raise InputError(f"{what} must be positive, got {value!r}")
    return number
