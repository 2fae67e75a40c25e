"""One reduction of the static problem: a smaller problem, and the way back to the full scene.

Fewer contacts whose forces are unknown, fewer ways to move: both are linear maps into the full
scene, and what follows from them is all there is. Forces and mechanism come back as those of the
full scene, and the certificate is computed on the full scene from these alone, so a reduction that
is not valid shows as a bracket that stays open, never as an answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.crushing import limited
from cvxlimit.model.formulations import (
    ForceVariables,
    Formulation,
    corner_compressions,
    model_of,
)
from cvxlimit.model.problem import Objective, StaticProblem
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.surfaces.base import YieldSurface, admissible
from cvxlimit.surfaces.presets import needed_surfaces

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Reduction:
    """A transformation of the static problem, and its inverse.

    Attributes
    ----------
    names : tuple of str
        What was reduced, in order: ``"parts"``, ``"symmetry"``, ``"planar"``; none for the full
        model.
    contacts : Contacts
        Those whose forces are unknown, k of them.
    blocks : int
        Number of the scene's free blocks.
    forces : (6 n, 6 k) sparse array or None
        What they make of the forces of all contacts; None where they are all.
    rates : (r, 6 free blocks) sparse array or None
        The ways in which blocks move, one per row; None is all.
    formulation : Formulation
        For ``contacts``.
    still : (n, 6) array or None
        Forces of contacts that are left out, the same at every load factor.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> full = Reduction.none(Statics.of(builtin_scene("arch")))
    >>> full.names, full.degrees_of_freedom
    ((), 120)
    """

    names: tuple[str, ...]
    contacts: Contacts
    blocks: int
    forces: sp.csr_array | None = None
    rates: sp.csr_array | None = None
    formulation: Formulation = corner_compressions
    still: FloatArray | None = None

    @classmethod
    def none(cls, statics: Statics, formulation: Formulation = corner_compressions) -> Reduction:
        """The full model."""
        return cls((), statics.contacts, len(statics.dead) // DOF, formulation=formulation)

    @property
    def degrees_of_freedom(self) -> int:
        """Ways in which blocks move."""
        return DOF * self.blocks if self.rates is None else int(self.rates.shape[0])


class ReducedProblem(StaticProblem):
    """The limit problem of a scene as a reduction leaves it; answers are those of the full scene.

    Parameters
    ----------
    assemblage : Assemblage
    surfaces : sequence of YieldSurface
    reduction : Reduction
    objective : Objective or None
        None is the load factor.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.surfaces.presets import surfaces_of
    >>> assemblage = Assemblage.of(builtin_scene("arch"))
    >>> full = Reduction.none(assemblage.statics)
    >>> state = ReducedProblem(assemblage, surfaces_of("conic")[0], full).solve()
    >>> state.forces.shape, state.mechanism.shape
    ((21, 6), (20, 6))
    """

    def __init__(
        self,
        assemblage: Assemblage,
        surfaces: Sequence[YieldSurface],
        reduction: Reduction,
        objective: Objective | None = None,
    ) -> None:
        self.surfaces, self.reduction = needed_surfaces(surfaces), reduction
        self.model = model_of(limited(reduction.formulation), reduction.contacts)
        scaling = assemblage.scaling
        forces = ForceVariables.of(self.model, scaling.force, scaling.length)
        limits = [
            limit
            for condition, cone in self.model.strength(self.surfaces)
            for limit in admissible(condition, forces.components, cone)
        ]
        if reduction.forces is not None:
            lifted = [(v, (reduction.forces @ meaning).tocsr()) for v, meaning in forces.maps]
            forces = replace(forces, maps=lifted)
        super().__init__(assemblage, forces, limits, objective, reduction.rates)

    def _forces(self) -> FloatArray:
        forces, still = super()._forces(), self.reduction.still
        return forces if still is None else forces + still

    def _internal(self) -> FloatArray:
        units = np.where(self.model.is_moment, self.scaling.length, 1.0) * self.scaling.force
        return self.forces.internal() * units
