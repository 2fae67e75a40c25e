"""Coefficients that change: 1, and the values of expressions of Parameters, each in its slot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import ModelError


class Source(Protocol):
    """Numbers that theta takes in: a CVXPY expression of Parameters, or what stands for one."""

    @property
    def size(self) -> int: ...

    @property
    def value(self) -> Any: ...

    def parameters(self) -> list[cp.Parameter]: ...


class Theta:
    """1, and the values of coefficients: slots of an expression that came before are the same."""

    def __init__(self) -> None:
        self.size = 1
        self._sources: dict[int, tuple[Source, IntArray]] = {}
        self._parts: list[Source | tuple[IntArray, IntArray]] = []

    def slots(self, source: Source) -> IntArray:
        """Returns where the values (k,) of an expression stand, in column order."""
        if id(source) not in self._sources:
            self._sources[id(source)] = source, self._take(source, source.size)
        return self._sources[id(source)][1]

    def products(self, one: IntArray | None, other: IntArray) -> IntArray:
        """Slots (k,) of products of the values in slots (k,)."""
        if one is None or not one.any():
            return other
        return self._take((one, other), len(other))

    def _take(self, part: Source | tuple[IntArray, IntArray], size: int) -> IntArray:
        self._parts.append(part)
        self.size += size
        return np.arange(self.size - size, self.size)

    def values(self) -> FloatArray:
        """Returns the entries at the Parameters' present values.

        Raises
        ------
        ModelError
            For a Parameter without a value.
        """
        result, end = np.ones(self.size), 1
        for part in self._parts:
            if isinstance(part, tuple):
                found = result[part[0]] * result[part[1]]
            else:
                check_values(part.parameters())
                found = np.asarray(part.value, dtype=float).ravel(order="F")
            result[end : end + len(found)] = found
            end += len(found)
        return result

    def parameters(self) -> list[cp.Parameter]:
        """Those that any coefficient depends on, in the order in which they came."""
        sources = [part for part in self._parts if not isinstance(part, tuple)]
        return list(dict.fromkeys(p for source in sources for p in source.parameters()))


def check_values(parameters: Iterable[cp.Parameter]) -> None:
    for parameter in parameters:
        if parameter.value is None:
            shape = "a number" if parameter.ndim == 0 else f"an array of shape {parameter.shape}"
            raise ModelError(
                f"Parameter {parameter.name()!r} has no value: set its .value to {shape} first"
            )
