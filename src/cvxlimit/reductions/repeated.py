"""What analyses of scenes share that differ in strengths, densities and loads only."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from typing import Any

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.solvers.interior.iteration import Point
from cvxlimit.solvers.program import ConeProgram

_KEPT = 4
"""Patterns kept: one per pattern of the loads, as a rule two."""

_NEAR = 1e-4
"""Square of the distance between problems, in widths of all, within which one counts alone."""


class Repeats:
    """What problems of one geometry share: ``states`` of
    :class:`~cvxlimit.proof.slater.Witnesses`, by the loads and strengths they are for, and the
    structure of programs by their pattern. Neither depends on whose was the first.

    Problems that :meth:`lead` are solved before all others. With a ``place`` among theirs, the
    blockwise solver starts between them.
    """

    def __init__(self) -> None:
        self.states: dict[object, FloatArray | None] = {}
        self.place: FloatArray | None = None
        self._led: dict[str, list[tuple[FloatArray, Point]]] = {}
        self._kept: OrderedDict[str, dict[str, Any]] = OrderedDict()

    def structure(self, program: ConeProgram) -> dict[str, Any]:
        """What solvers keep about programs with this pattern; see :meth:`ConeProgram.solve`."""
        sizes = program.zero, program.nonneg, len(program.cones), *program.matrix.shape
        digest = hashlib.blake2b(digest_size=16)
        for part in (sizes, program.cones, program.matrix.indptr, program.matrix.indices):
            digest.update(np.asarray(part, dtype=np.int64).tobytes())
        key = digest.hexdigest()
        kept = self._kept.setdefault(key, {})
        self._kept.move_to_end(key)
        if len(self._kept) > _KEPT:
            self._kept.popitem(last=False)
        kept["start"] = self._start(key)
        return kept

    def lead(self, place: FloatArray) -> bool:
        """Start others from a point on the way to the last answer; False if there is none."""
        key, kept = next(reversed(self._kept.items()), ("", {}))
        middle = kept.get("middle")
        led = self._led.setdefault(key, [])
        if middle is None or any(middle is point for _, point in led):
            return False
        led.append((place, middle))
        return True

    def _start(self, key: str) -> Point | None:
        led = self._led.get(key)
        if self.place is None or not led:
            return None
        squares = np.array([((self.place - place) ** 2).sum() for place, _ in led])
        return Point.mean([point for _, point in led], 1.0 / (squares + _NEAR))
