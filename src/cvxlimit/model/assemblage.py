"""The mechanics of one scene, computed once: equilibrium, its scaling, its factorisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COMPONENTS, Contacts
from cvxlimit.model.formulations import ForceModel, corner_compressions
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.scene import Scene
from cvxlimit.solvers.sparse import Solve, factorised, nested_dissection


@dataclass(frozen=True, eq=False)
class Assemblage:
    """Blocks and contacts of a scene as equilibrium sees them, under its loads.

    Everything that analyses share is here and computed once: problems, certificates and bounds
    take an assemblage, and :meth:`under` gives the same under other loads than the scene's.

    Attributes
    ----------
    scene : Scene
    statics : Statics
        In the scene's units.
    scaling : Scaling
    balance : Balance
        Brings forces into equilibrium with the least change.
    repeats : Repeats or None
        What problems of scenes like this one share, once compiled
        (:class:`cvxlimit.reductions.repeated.Repeats`); None for a scene that is solved once.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> assemblage = Assemblage.of(builtin_scene("tuff-wall"))
    >>> assemblage.statics.matrix.shape
    (324, 876)
    """

    scene: Scene
    statics: Statics
    scaling: Scaling
    balance: Balance
    repeats: Any = None

    @classmethod
    def of(cls, scene: Scene | Assemblage, scaling: Scaling | None = None) -> Assemblage:
        """Of a scene; an assemblage is returned as it is."""
        if isinstance(scene, Assemblage):
            return scene
        statics = Statics.of(scene)
        balance = Balance(statics, corner_compressions(statics.contacts))
        return cls(scene, statics, scaling or Scaling.of(scene), balance)

    def under(self, dead: FloatArray, live: FloatArray) -> Assemblage:
        """The same blocks and contacts under other loads (6 free blocks,)."""
        loads = dead.reshape(-1, DOF), live.reshape(-1, DOF)
        scaling = Scaling.under(self.scaling.length, *loads)
        return Assemblage(self.scene, self.statics.under(dead, live), scaling, self.balance)

    def alone(self, load: FloatArray) -> Assemblage:
        """The same with ``load`` as the live one, and no other: which share of it is carried?"""
        return self.under(np.zeros_like(load), load)

    def like(self, scene: Scene) -> Assemblage:
        """The mechanics of a scene of the same geometry: other strengths, densities and loads.

        Equilibrium and its factorisation are kept.
        """
        dead, live = scene.dead_forces.ravel(), scene.live_forces.ravel()
        statics = replace(self.statics.under(dead, live), contacts=scene.contacts)
        statics.__dict__["matrix"] = self.statics.matrix
        return Assemblage(scene, statics, Scaling.of(scene), self.balance, self.repeats)

    def balanced_by(self, balance: Balance) -> Assemblage:
        """The same with another way to restore equilibrium."""
        return replace(self, balance=balance)

    @cached_property
    def scaled(self) -> Statics:
        """Statics in the units of :attr:`scaling`."""
        return self.scaling.apply(self.statics)

    @property
    def contacts(self) -> Contacts:
        """In the scene's units."""
        return self.statics.contacts


_IDLE = 1e-11
"""Stiffness, over the largest, against motions that nothing resists: a step leaves as much of the
residual, and balances take two."""


@dataclass(frozen=True, eq=False)
class Balance:
    """Least changes of internal forces that restore equilibrium: one sparse factorisation.

    Attributes
    ----------
    statics : Statics
        Its loads do not matter here.
    model : ForceModel
        Whose internal forces are changed; torsion counts by its arm, so that all are forces.
    rates : (r free blocks, 6 free blocks) sparse array or None
        The ways in which each block may move, r of them, where loads and internal forces do no
        work on any others, as in a plane; None is all six.
    held : (p,) array of bool or None
        Internal forces that do not change: those that nothing resists.
    """

    statics: Statics
    model: ForceModel
    rates: sp.csr_array | None = None
    held: NDArray[np.bool_] | None = None

    @cached_property
    def matrix(self) -> sp.csr_array:
        """Equilibrium matrix (r free blocks, p) of the internal forces."""
        matrix = self.statics.matrix if self.rates is None else self.rates @ self.statics.matrix
        return (matrix @ self.model.meaning).tocsr()

    def along(self, load: FloatArray) -> FloatArray:
        """Generalised forces (6 free blocks,) along the ways in which blocks may move."""
        return load if self.rates is None else np.asarray(self.rates @ load)

    def motion(self, rates: FloatArray) -> FloatArray:
        """Block rates (free, 6) from those along the ways in which blocks may move."""
        full = rates if self.rates is None else self.rates.T @ rates
        return np.asarray(full).reshape(-1, DOF)

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
        count = int(number.max()) + 1
        ends = np.stack([number[contacts.a], number[contacts.b]])
        ends = np.where(ends < 0, count, ends)
        graph = sp.coo_array((np.ones(ends.shape[1]), tuple(ends)), (count + 1, count + 1))
        return int(connected_components(graph, directed=False)[0]) == 1

    @cached_property
    def solve(self) -> Solve:
        """Solver of B W B' for the equilibrium matrix B of internal forces and their weights W."""
        contacts, number = self.statics.contacts, self.statics.row_of_block
        a, b = number[contacts.a], number[contacts.b]
        free = (a >= 0) & (b >= 0)
        count = int(number.max()) + 1
        ends = np.concatenate([a[free], b[free]]), np.concatenate([b[free], a[free]])
        graph = sp.coo_array((np.ones(2 * free.sum()), ends), shape=(count, count))
        blocks, each = nested_dissection(graph.tocsr()), self.matrix.shape[0] // count
        order = (each * blocks[:, None] + np.arange(each)).ravel()
        ordered = self.matrix[order]
        square = ordered @ sp.diags_array(self.weights) @ ordered.T
        if self.statics.guides:  # rates that guides prevent: any value will do
            idle = sp.eye_array(len(order)) - self.statics.guided
            square = square + idle.tocsr()[order][:, order]
        if self.held is not None:  # ways to move that nothing resists; no load does work on them
            idle = _IDLE * float(square.diagonal().max())
            square = square + idle * sp.eye_array(len(order))
        solve = factorised(square.tocsc())

        def unordered(right: FloatArray) -> FloatArray:
            result = np.empty_like(right)
            result[order] = solve(right[order])
            return result

        return unordered

    def change(self, residual: FloatArray) -> FloatArray:
        """Internal forces (p,) that carry a residual (r free blocks,) of opposite sign."""
        result: FloatArray = -self.weights * (self.matrix.T @ self.solve(residual))
        return result

    def balanced(self, forces: FloatArray, load_factor: float, statics: Statics) -> FloatArray:
        """Forces (n, 6) with the least change that balances the loads of ``statics``."""
        if not self.is_supported:
            return forces
        for _ in range(2):
            change = self.change(self.along(statics.residual(forces, load_factor).ravel()))
            forces = forces + (self.model.meaning @ change).reshape(-1, len(COMPONENTS))
        return forces
