"""What analyses of scenes share that differ in strengths, densities and loads only."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from typing import Any

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.solvers.program import ConeProgram

_KEPT = 4
"""Patterns kept: one per pattern of the loads, as a rule two."""


class Repeats:
    """What problems of one geometry share: ``states`` of
    :class:`~cvxlimit.proof.slater.Witnesses`, by the loads and strengths they are for, and the
    structure of programs by their pattern. Neither depends on whose was the first.
    """

    def __init__(self) -> None:
        self.states: dict[object, FloatArray | None] = {}
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
        return kept
