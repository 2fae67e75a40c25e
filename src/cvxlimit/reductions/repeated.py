"""Results that analyses share whose scenes differ in strengths, densities and loads only."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.solvers.program import ConeProgram

T = TypeVar("T")

_SHARED = 64_000
"""Most contacts, summed over all results of :meth:`Repeats.shared`, that are kept. Scenes of equal
strength share two results, so that this is 32 strengths of 1,000 contacts, or 100 MB. With twenty
strengths in turn it takes some 2 ms off a row of a sweep."""

_KEPT = 4
"""Patterns of programs that are kept: one per pattern of the loads, as a rule two."""


class Repeats:
    """A store of results for problems of one geometry, none of which depends on which problem was
    the first.

    It keeps results that follow from strengths alone (:meth:`shared`), the structure of programs
    by their pattern (:meth:`structure`), and states.

    Attributes
    ----------
    states : dict
        States of :class:`~cvxlimit.proof.slater.Witnesses`, by the loads and strengths they are
        for.
    """

    def __init__(self) -> None:
        self.states: dict[object, FloatArray | None] = {}
        self._shared: dict[Hashable, tuple[Contacts, Any]] = {}
        self._kept: OrderedDict[str, dict[str, Any]] = OrderedDict()
        self._last: tuple[ConeProgram, str] | None = None

    def shared(self, what: Hashable, contacts: Contacts, make: Callable[[], T]) -> T:
        """Returns a result that is the same for all scenes with these contacts; ``make`` makes it
        the first time.

        ``what`` names the result, and the strengths of the contacts if it depends on them. Not for
        several threads at a time.
        """
        before, result = self._shared.pop(what, (contacts, None))
        if result is None or not contacts.is_in_place_of(before):
            result = make()
        self._shared[what] = contacts, result
        if len(self._shared) * len(contacts) > _SHARED:
            self._shared.pop(next(iter(self._shared)))
        own: T = result
        return own

    def structure(self, program: ConeProgram) -> dict[str, Any]:
        """Returns the dictionary in which solvers keep the structure of programs with this pattern;
        see :meth:`ConeProgram.solve`."""
        key = self._pattern(program)
        self._last = program, key
        kept = self._kept.setdefault(key, {})
        self._kept.move_to_end(key)
        if len(self._kept) > _KEPT:
            self._kept.popitem(last=False)
        return kept

    def _pattern(self, program: ConeProgram) -> str:
        """Returns a digest of where the program's entries stand, and of its cones."""
        if self._last is not None and program.is_like(self._last[0]):
            return self._last[1]
        sizes = program.zero, program.nonneg, len(program.cones), *program.matrix.shape
        digest = hashlib.blake2b(digest_size=16)
        for part in (sizes, program.cones, program.matrix.indptr, program.matrix.indices):
            digest.update(np.asarray(part, dtype=np.int64).tobytes())
        return digest.hexdigest()
