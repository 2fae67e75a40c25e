"""The mechanics of one scene, computed once: equilibrium, its scaling, its factorisation.

With B the equilibrium matrix of internal forces s and W their weights, the least change of s that
takes up a residual r of equilibrium is -W B' (B W B')^-1 r. One sparse factorisation of B W B'
serves all states and loads of a geometry (:class:`Balance`).
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cvxlimit.base.arrays import EPSILON, FloatArray, IntArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.formulations import ForceModel, Formulation, corner_compressions
from cvxlimit.model.statics import BALANCED, DOF, Scaling, Statics
from cvxlimit.scene import Scene
from cvxlimit.solvers.sparse import Solve, factorised


@dataclass(frozen=True, eq=False)
class Assemblage:
    """Blocks and contacts of a scene as equilibrium sees them, under its loads.

    Everything that analyses share is computed once: ``statics`` in the scene's units, ``balance``,
    which brings forces into equilibrium with the least change, and ``strengths``, by key the last
    :class:`~cvxlimit.proof.strength.Strength` that was made for a scene of this geometry.
    """

    scene: Scene
    statics: Statics
    scaling: Scaling
    balance: Balance
    strengths: dict[Hashable, Any] = field(default_factory=dict)
    contacts: Contacts = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "contacts", self.statics.contacts)

    @classmethod
    def of(cls, scene: Scene | Assemblage, scaling: Scaling | None = None) -> Assemblage:
        if isinstance(scene, Assemblage):
            return scene
        statics = Statics.of(scene)
        return cls(scene, statics, scaling or Scaling.of(scene), Balance.of(statics))

    def of_less(self, statics: Statics) -> Assemblage:
        """Returns the mechanics with ``statics`` of a part: it shares nothing, as no other scene
        has its contacts."""
        return replace(self, statics=statics, balance=Balance.of(statics), strengths={})

    def under(self, dead: FloatArray, live: FloatArray) -> Assemblage:
        loads = dead.reshape(-1, DOF), live.reshape(-1, DOF)
        scaling = Scaling.under(self.scaling.length, *loads)
        return Assemblage(self.scene, self.statics.under(dead, live), scaling, self.balance)

    def alone(self, load: FloatArray) -> Assemblage:
        """The same with ``load`` as the live one, and no other: which share of it is carried?"""
        return self.under(np.zeros_like(load), load)

    def like(self, scene: Scene) -> Assemblage:
        """Returns the mechanics with other strengths, densities and loads; equilibrium and its
        factorisation are kept."""
        dead, live = scene.dead_forces.ravel(), scene.live_forces.ravel()
        statics = replace(self.statics.under(dead, live), contacts=scene.contacts)
        statics.__dict__["matrix"] = self.statics.matrix
        return Assemblage(scene, statics, Scaling.of(scene), self.balance, self.strengths)

    def with_contacts(self, contacts: Contacts) -> Assemblage:
        """The same mechanics with other strengths of its contacts."""
        statics = replace(self.statics, contacts=contacts)
        statics.__dict__["matrix"] = self.statics.matrix
        return replace(self, statics=statics, strengths={})

    @property
    def corners(self) -> ForceModel | None:
        """Corner compressions that ``balance`` changes; None where it is of other equilibrium, of a
        part or in a plane."""
        balance = self.balance
        is_own = balance.rates is None and balance.statics.matrix is self.statics.matrix
        return balance.model if is_own else None

    @cached_property
    def scaled(self) -> Statics:
        return self.scaling.apply(self.statics)


@dataclass(frozen=True, eq=False)
class Balance:
    """Least changes of internal forces that restore equilibrium: one sparse factorisation.

    Loads of ``statics`` do not matter here. The internal forces (p,) of ``model`` are changed;
    torsion counts by its arm, so that all are forces, and those that nothing resists are ``held``
    (p,). ``rates`` (r free blocks, 6 free blocks) are the r ways in which each block may move,
    where loads and internal forces do no work on any others, as in a plane; None is all six.
    """

    statics: Statics
    model: ForceModel
    rates: sp.csr_array | None = None
    held: NDArray[np.bool_] | None = None

    @classmethod
    def of(cls, statics: Statics) -> Balance:
        return cls(statics, corner_compressions(statics.contacts))

    @cached_property
    def matrix(self) -> sp.csr_array:
        matrix = self.statics.matrix if self.rates is None else self.rates @ self.statics.matrix
        return (matrix @ self.model.resultant_map).tocsr()

    @cached_property
    def transposed(self) -> sp.csr_array:
        return self.matrix.T.tocsr()

    @cached_property
    def weights(self) -> FloatArray:
        """How willingly each internal force changes, (p,)."""
        arm = np.asarray(self.statics.contacts.torsion_arm)[self.model.contact]
        weights = np.where(self.model.is_moment, arm**2, 1.0)
        return weights if self.held is None else np.where(self.held, 0.0, weights)

    @cached_property
    def is_supported(self) -> bool:
        """True when every block is linked to a support through contacts."""
        contacts, number = self.statics.contacts, self.statics.row_of_block
        count = int(number.max()) + 2  # all supports are one, the last
        ends = number[contacts.a] % count, number[contacts.b] % count
        graph = sp.coo_array((np.ones(len(ends[0])), ends), (count, count))
        return int(connected_components(graph, directed=False)[0]) == 1

    @cached_property
    def solve(self) -> Solve:
        """Solver of B W B' for the equilibrium matrix B of internal forces and their weights W."""
        weighted = self.matrix.copy()
        weighted.data *= self.weights[weighted.indices]
        square = weighted @ self.transposed
        if self.statics.guide is not None:  # rates that guides prevent: any value will do
            square = square + (sp.eye_array(square.shape[0]) - self.statics.guide)
        if self.held is not None or self.statics.contacts.is_point.any():
            # ways to move that nothing resists, as blocks that hang on ties have; no load does work
            # on them: a step leaves as much of the residual, and balances take two
            idle = BALANCED * float(square.diagonal().max())
            square = square + idle * sp.eye_array(square.shape[0])
        free = int(self.statics.row_of_block.max()) + 1
        return factorised(square.tocsc(), square.shape[0] // free)

    def change(self, residual: FloatArray) -> FloatArray:
        return self.along(residual if self.rates is None else np.asarray(self.rates @ residual))

    def along(self, residual: FloatArray) -> FloatArray:
        """The change for a residual along the ways in which blocks may move."""
        return np.asarray(-self.weights * (self.transposed @ self.solve(residual)))

    def balanced(
        self, state: FloatArray, load_factor: float, statics: Statics, is_internal: bool = False
    ) -> FloatArray:
        """Contact forces (n, 6), or internal ones (p,), with the least change that balances the
        loads of ``statics``; the same where some blocks have no support."""
        if not self.is_supported:
            return state
        for _ in range(2):  # the second change removes the rounding of the first
            forces = self.model.forces(state) if is_internal else state
            change = self.change(statics.residual(forces, load_factor).ravel())
            state = state + (change if is_internal else self.model.forces(change))
        return state


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Scaled equilibrium ``matrix @ s + load = 0`` of unknown forces s, along the ways in which
    blocks may move, of which ``rows`` have forces or loads; ``rates`` (ways, 6 free blocks) are
    these ways, None all."""

    matrix: sp.csr_array
    rows: IntArray
    ways: int
    scaling: Scaling
    rates: sp.csr_array | None = None

    @classmethod
    def of(
        cls, matrix: sp.csr_array, loads: FloatArray, scaling: Scaling,
        rates: sp.csr_array | None = None,
    ) -> Equilibrium:  # fmt: skip
        """Makes the equilibrium of a scaled matrix along all ways; ``loads`` (k, 6 free blocks) say
        which rows may have some."""
        size = np.abs(loads).sum(axis=0)
        if rates is not None:
            matrix, size = (rates @ matrix).tocsr(), abs(rates) @ size
            matrix.eliminate_zeros()
        at = np.repeat(np.arange(len(size)), np.diff(matrix.indptr))
        each = np.bincount(at, np.abs(matrix.data), len(size))
        # a row of rounding is empty
        rows = np.flatnonzero((each > EPSILON * each.max(initial=0.0)) | (size != 0.0))
        if len(rows) < len(size):
            matrix = matrix[rows]
        return cls(matrix, rows, len(size), scaling, rates)

    def of_load(self, load: Any) -> Any:
        """A scaled load (6 free blocks,), numbers or a form, on the rows."""
        along = load if self.rates is None else self.rates @ load
        return along if len(self.rows) == self.ways else along[self.rows]

    def mechanism(self, duals: FloatArray) -> FloatArray:
        """Block rates (free, 6) from the duals of the rows."""
        rates = np.zeros(self.ways)
        rates[self.rows] = duals
        full = rates if self.rates is None else np.asarray(self.rates.T @ rates)
        return self.scaling.mechanism(full.reshape(-1, DOF))


@dataclass(frozen=True, eq=False)
class Reduction:
    """A transformation of the limit problem into a smaller one, and the way back.

    Forces and mechanism come back as those of the full scene, and the certificate is computed from
    these alone, so a reduction that is not valid shows as a bracket that stays open. ``names`` say
    what was reduced: ``"parts"``, ``"symmetry"``, ``"planar"``. Unknown are the forces of
    ``contacts``, those ``kept`` (k,) of n, described by ``formulation``; ``forces`` (6 n, 6 k) is
    what they make of the forces of all, None where they are all. ``rates`` are the ways in which
    free blocks move. Contacts that are left out have the ``given_forces`` (n, 6) at every load
    factor.
    """

    names: tuple[str, ...]
    contacts: Contacts
    kept: IntArray
    forces: sp.csr_array | None = None
    rates: sp.csr_array | None = None
    formulation: Formulation = corner_compressions
    given_forces: FloatArray | None = None

    @classmethod
    def none(cls, statics: Statics, formulation: Formulation = corner_compressions) -> Reduction:
        """The full model."""
        every = np.arange(len(statics.contacts))
        return cls((), statics.contacts, every, formulation=formulation)

    def apply(self, equilibrium: sp.csr_array, forces: sp.csr_array) -> sp.csr_array:
        """The equilibrium (6 free blocks, 6 n) of the scene on unknowns, of which ``forces``
        (6 k, p) are the contact forces that are left."""
        every = forces if self.forces is None else self.forces @ forces
        return (equilibrium @ every).tocsr()

    def invert(self, forces: FloatArray) -> FloatArray:
        """The forces (n, 6) of all contacts of the scene from those (k, 6) that are left."""
        if self.forces is not None:
            forces = np.asarray(self.forces @ forces.ravel()).reshape(-1, DOF)
        return forces if self.given_forces is None else forces + self.given_forces
