"""Types of arrays, and records of arrays that nobody can write to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

EPSILON = 8.0 * float(np.finfo(float).eps)
"""Rounding of sums of a few dozen products, as a share of the sum of their sizes."""

ROUNDING = 1e-9
"""Share of a size, or of the largest of numbers alike, that is put down to rounding. Of coordinates
it is 1e-13 of a contact's size for a scene a thousand times as large; what solvers leave of forces
and rates that are zero, and two bounds that should be one, is 1e-10 to 1e-9."""

SMALL = 0.01
"""Share from which something is worth a word: of the friction angle an angle, for a contact that is
turned by one bears as if its friction angle were more or less by that, and the load factor of a
joint that slides moves by about as large a share; of the live power dilatancy, without which the
load factor of the same mechanism would be less by that share (mechanisms that rock come out at 1e-6
and less, walls that slide at 0.3 and more); of the largest compression that of a joint."""


def read_only(value: Any) -> Any:
    if not isinstance(value, np.ndarray) or not value.flags.writeable:
        return value
    copy = value.copy()
    copy.flags.writeable = False
    return copy


class ReadOnlyArrays:
    """Base of immutable records with arrays: NumPy's own deepcopy and pickle are writeable."""

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__dict__.update({name: read_only(value) for name, value in state.items()})


class RemadeFromFields:
    """Base of dataclasses with read-only mappings, which do not pickle: copies are made anew.

    What was computed from the fields stays behind.
    """

    def __reduce__(self) -> tuple[object, ...]:
        given = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        plain = {name: dict(x) if isinstance(x, Mapping) else x for name, x in given.items()}
        return partial(type(self), **plain), ()
