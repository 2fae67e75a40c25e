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
