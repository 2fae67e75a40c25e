"""Limit problems of scenes that differ in friction and loads only: compiled once, as Parameters.

CVXPY's compile is then a product with a sparse matrix: on the S12 panel 3 ms in place of 25 ms of
CPU. For a scene that is solved once it does not pay: compiling with Parameters takes longer.

What is left is the solver: QOCO takes 22 to 30 iterations of 5.3 ms there, five sixths of a row.
Tried on twelve of its variations, and left out:

- starting our own interior-point method (blockwise) at a neighbour's iterate, where complementarity
  is half the load factor: 10 to 13 iterations in place of 15, of 10 ms each; nearer to the
  neighbour's optimum it takes more than a cold start;
- QOCO with rows scaled by a neighbour's slacks and duals, 20 to 23 iterations, and with loads and
  objective in other units, 20 to 27; with other orders of its rows and columns, up to 20 % slower;
- Moreau 0.4.1, which takes the answer of the variation before as its start: 15 to 20 iterations in
  place of 23, of 9 ms each, together 0.16 to 0.20 s where QOCO took 0.13 to 0.16 s beside it;
- blocks that move as one in a neighbour's mechanism, as one block: 0 to 42 of 314 do;
- a neighbour's mechanism and forces as bounds: with friction 0.02 higher they are 2 % low and 53 %
  high, with the load turned by 5 degrees 99 % low and 0.07 % high.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import ForceVariables, corner_compressions
from cvxlimit.model.problem import Terms
from cvxlimit.reductions.reduction import ReducedProblem, Reduction
from cvxlimit.solvers import Ladder, limit_ladder
from cvxlimit.strengths import PROPERTIES
from cvxlimit.surfaces import Rocking, TorsionShear, YieldSurface

FloatArray = NDArray[np.float64]

_KINDS = (Rocking, TorsionShear)
"""Surfaces whose rows are linear in friction, and say all by their type and cone."""

_KEPT = 4
"""Compiled problems kept: one per pattern of the loads, as a rule two."""


class _Loads:
    """The load factor as objective, loads as Parameters; see :class:`Objective`."""

    def __init__(self, assemblage: Assemblage) -> None:
        self.dead, self.live = (
            _Entries(load) for load in (assemblage.scaled.dead, assemblage.scaled.live)
        )

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        """The scaled terms."""
        return Terms(alpha, self.dead.expression, alpha * self.live.expression)


class _Entries:
    """A load vector whose entries that are not zero are Parameters."""

    def __init__(self, load: FloatArray) -> None:
        self.at = np.flatnonzero(load)
        self.parameter = cp.Parameter(max(len(self.at), 1), value=np.zeros(max(len(self.at), 1)))
        spread = (np.ones(len(self.at)), (self.at, np.arange(len(self.at))))
        shape = (len(load), self.parameter.size)
        self.expression = sp.csr_array(spread, shape=shape) @ self.parameter

    def set(self, load: FloatArray) -> None:
        """Take the entries of another load of the same pattern."""
        self.parameter.value = load[self.at] if len(self.at) else np.zeros(1)


class RepeatedProblem(ReducedProblem):
    """The full model's limit problem, of whichever assemblage it was last given."""

    def __init__(
        self, assemblage: Assemblage, surfaces: Sequence[YieldSurface], reduction: Reduction
    ) -> None:
        is_uniform = np.ptp(reduction.contacts.friction) == 0.0
        self.friction = cp.Parameter(nonneg=True) if is_uniform else cp.Parameter(
            len(reduction.contacts), nonneg=True
        )  # fmt: skip
        self.loads = _Loads(assemblage)
        symbolic: Contacts = copy(reduction.contacts)
        vector = self.friction * np.ones(len(symbolic)) if is_uniform else self.friction
        symbolic.__dict__["friction"] = vector
        super().__init__(
            assemblage, surfaces, _with_contacts(reduction, symbolic), objective=self.loads
        )
        self.renew(assemblage, reduction)

    def ladder(self, tolerance: float = 1e-5) -> Ladder:
        """The usual solvers; QOCO first no tighter than it has to be."""
        return limit_ladder(self.shape, tolerance, is_repeated=True)

    def renew(self, assemblage: Assemblage, reduction: Reduction) -> RepeatedProblem:
        """Take the friction and the loads of an assemblage of the same geometry."""
        self.assemblage, self.reduction = assemblage, reduction
        friction = reduction.contacts.friction
        self.friction.value = float(friction[0]) if self.friction.ndim == 0 else friction
        self.loads.dead.set(assemblage.scaled.dead)
        self.loads.live.set(assemblage.scaled.live)
        return self


def _with_contacts(reduction: Reduction, contacts: Contacts) -> Reduction:
    result = copy(reduction)
    result.__dict__["contacts"] = contacts
    return result


class Repeats:
    """What problems of one geometry share: compiled problems, and reference states of proofs.

    Attributes
    ----------
    states : dict
        Of :class:`~cvxlimit.proof.witnesses.Witnesses`, by the loads and strengths they are for.
    """

    def __init__(self) -> None:
        self.states: dict[object, FloatArray | None] = {}
        self._known: dict[object, RepeatedProblem] = {}

    def problem(
        self, assemblage: Assemblage, surfaces: Sequence[YieldSurface], reduction: Reduction
    ) -> ReducedProblem | None:
        """The compiled problem with the numbers of an assemblage, None if it is not of this kind.

        What decides about its rows is the same whoever was solved before, so that its answers are.
        """
        contacts = reduction.contacts
        is_plain = not reduction.names and reduction.formulation is corner_compressions
        limited = any(
            (getattr(contacts, name) != each.default).any()
            for name, each in PROPERTIES.items()
            if name != "friction"  # the one whose numbers are renewed
        )
        if not is_plain or limited or not all(type(s) in _KINDS for s in surfaces):
            return None
        scaled = assemblage.scaled
        key = (
            tuple((type(s).__name__, str(s.cone)) for s in surfaces),
            assemblage.scaling.length,
            float(np.ptp(contacts.friction)) == 0.0,
            *(np.flatnonzero(load).tobytes() for load in (scaled.dead, scaled.live)),
        )
        known = self._known.get(key)
        if known is not None:
            return known.renew(assemblage, reduction)
        if len(self._known) >= _KEPT:
            self._known.clear()
        self._known[key] = RepeatedProblem(assemblage, surfaces, reduction)
        return self._known[key]
