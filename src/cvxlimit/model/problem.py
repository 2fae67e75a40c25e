"""The static problem (Eq. 39) as one vectorised CVXPY problem: a force model, and an objective."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import attrgetter
from typing import Protocol

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.constraints import Inequality, NonNeg, NonPos

from cvxlimit.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage, Reduction, kept_rows, mechanism_of
from cvxlimit.model.formulations import Formulation, corner_compressions, model_of
from cvxlimit.model.variables import ForceVariables
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState, Shape, SolverSettings, limit_ladder, run
from cvxlimit.surfaces.base import Condition, LinearForm, YieldSurface, admissible
from cvxlimit.surfaces.cones import Cone
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES, needed_surfaces


@dataclass(frozen=True, eq=False)
class Terms:
    """What an objective makes of a problem: the goal, the loads, and limits of its own.

    ``dead`` and ``live`` are scaled loads (6 free blocks,), arrays or expressions.
    """

    goal: cp.Expression
    dead: cp.Expression | FloatArray
    live: cp.Expression | FloatArray
    limits: list[cp.Constraint] = field(default_factory=list)


class Objective(Protocol):
    """What a static problem maximises, and what that does to the loads."""

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        """The scaled terms; ``alpha`` is the scaled load factor."""


@dataclass(frozen=True)
class LargestFactor:
    """The load factor, at most ``most`` where only its reach is asked for."""

    most: float | None = None

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        unit = assemblage.scaling.load_factor(1.0)
        limits = [] if self.most is None else [alpha <= self.most / unit]
        return Terms(alpha, assemblage.scaled.dead, alpha * assemblage.scaled.live, limits)


@dataclass(frozen=True)
class LargestSelfStress:
    """Sum of all compressions without any load, none above one: whether blocks hold each other.

    If the value is 0, the duals of equilibrium open every contact by at least 1 more than the flow
    rule asks for: forces that balance themselves do no work on any rates, but positive work where
    every contact opens. If it is positive, duals mean nothing.
    """

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        pressure = forces.components["N"]
        nothing = np.zeros(len(assemblage.scaled.dead))
        return Terms(cp.sum(pressure), nothing, nothing, [pressure <= 1.0, alpha == 0.0])


@dataclass(frozen=True)
class LeastForces:
    """The load factor, less ``weight`` times the squared norm of all forces: one state is the best,
    where a solver's choice depends on rounding. V1, V2 and N count in units of the total load,
    moments over the unit of length besides, so the norm does not depend on the contacts' axes.
    """

    weight: float

    def terms(self, assemblage: Assemblage, forces: ForceVariables, alpha: cp.Variable) -> Terms:
        components, length = forces.components, assemblage.scaling.length
        square = sum(cp.sum_squares(components[c]) for c in ("V1", "V2", "N"))
        square += sum(cp.sum_squares(components[c] / length) for c in ("M1", "M2", "MT"))
        scaled = assemblage.scaled
        return Terms(alpha - self.weight * square, scaled.dead, alpha * scaled.live)


class StaticProblem:
    """max goal  subject to  A x + f_D + alpha f_L = 0  and what bounds the forces x.

    The one static problem: duals of equilibrium are the mechanism. Compiled once; Parameters in its
    limits may change between solves. Equilibrium is asked for along ``rates`` (r, 6 free blocks),
    ways in which blocks may move, one per row; None is all. Rows without forces and loads are left
    out.
    """

    still: FloatArray | None = None
    """Forces (n, 6) of contacts that are no unknowns."""

    def __init__(
        self,
        assemblage: Assemblage,
        forces: ForceVariables,
        limits: Sequence[cp.Constraint] = (),
        objective: Objective | None = None,
        rates: sp.csr_array | None = None,
    ) -> None:
        self.assemblage, self.scaling = assemblage, assemblage.scaling
        self.forces, self._rates = forces, rates
        self.load_factor = cp.Variable(name="alpha")
        terms = (objective or LargestFactor()).terms(assemblage, forces, self.load_factor)
        scaled, load = assemblage.scaled, terms.live + terms.dead
        matrix, loads = scaled.matrix, np.abs(scaled.dead) + np.abs(scaled.live)
        if rates is not None:
            matrix, load, loads = (rates @ matrix).tocsr(), rates @ load, abs(rates) @ loads
        meanings = [meaning for _, meaning in forces.maps]
        self._matrix = (matrix @ sp.hstack(meanings, format="csr")).tocsr()
        self._rows = kept_rows(self._matrix, loads)
        if len(self._rows) < len(loads):
            self._matrix, load = self._matrix[self._rows], load[self._rows]
        variables = [v if v.ndim == 1 else cp.vec(v, order="F") for v, _ in forces.maps]
        self.equilibrium = self._matrix @ cp.hstack(variables) + load == 0.0
        constraints = [self.equilibrium, *forces.constraints, *limits, *terms.limits]
        self.problem = cp.Problem(cp.Maximize(terms.goal), constraints)

    @property
    def units(self) -> FloatArray | float:
        """User's units (p,) of the internal forces, by the scaling that there is now."""
        return 1.0

    def ladder(self, tolerance: float = 1e-5) -> tuple[SolverSettings, ...]:
        """Solvers in the order in which to try them for a bracket within ``tolerance``."""
        return limit_ladder(self.shape, tolerance)

    @cached_property
    def shape(self) -> Shape:
        """Counts, which decide about solvers."""
        stated, own = self.problem.constraints, self.problem.variables()
        rows = [c for c in stated if isinstance(c, (Inequality, NonPos, NonNeg))]
        rows += [v for v in own if v.attributes["nonneg"]]
        cones = sum([c.num_cones() for c in stated if isinstance(c, cp.SOC)])
        variables, signs = (sum(map(attrgetter("size"), found)) for found in (own, rows))
        return Shape(variables, self._matrix.shape[0], cones, signs)

    def solve(self, settings: SolverSettings | None = None, ignore_dpp: bool = False) -> LimitState:
        """One run of one solver, the ladder's first; never raises for what the solver does."""
        outcome = run(self.problem, settings or self.ladder()[0], ignore_dpp)
        alpha = self.load_factor.value
        if not outcome.has_values or alpha is None:
            return LimitState(outcome, None, None, None)
        internal = [np.asarray(v.value).ravel(order="F") for v, _ in self.forces.maps]
        forces = self.scaling.forces(self.forces.values())
        duals = self.equilibrium.dual_value
        if duals is not None:
            duals = mechanism_of(np.asarray(duals), self.assemblage, self._rows, self._rates)
        return LimitState(
            outcome,
            self.scaling.load_factor(float(alpha)),
            forces if self.still is None else forces + self.still,
            duals,
            np.concatenate(internal) * self.units,
        )


class LimitProblem(StaticProblem):
    """max alpha  subject to  A x + f_D + alpha f_L = 0,  x_j in K_j at every contact j.

    Parameters
    ----------
    scene : Scene or Assemblage
    surfaces : sequence of YieldSurface
        Their intersection is K. Rocking must be one of them; those implied by another are not
        written.
    formulation : callable
        :func:`corner_compressions` (default), :func:`resultants`, or one of your own.
    objective : Objective or None
        None is the load factor.
    reduction : Reduction or None
        A smaller model, with a formulation of its own.

    Attributes
    ----------
    strength : mapping of str to list of cvxpy.Constraint
        What bounds the forces: by the name of the surface, or ``"formulation"``.

    Raises
    ------
    ModelError
        Without rocking, or with the same surface twice.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> problem = LimitProblem(builtin_scene("single-block"))
    >>> problem.solve().outcome.status, sorted(problem.strength)
    ('optimal', ['torsion-shear'])
    """

    def __init__(
        self,
        scene: Scene | Assemblage,
        surfaces: Sequence[YieldSurface] = DEFAULT_SURFACES,
        formulation: Formulation = corner_compressions,
        objective: Objective | None = None,
        reduction: Reduction | None = None,
    ) -> None:
        assemblage = Assemblage.of(scene)
        self.surfaces = needed_surfaces(surfaces)
        self.reduction = reduction or Reduction.none(assemblage.statics, formulation)
        self.model = model_of(self.reduction.formulation, self.reduction.contacts)
        scaling, lift = assemblage.scaling, self.reduction.forces
        gives, written = self._written()
        forces = ForceVariables.of(self.model, scaling.force, scaling.length, gives)
        self.strength: dict[str, list[cp.Constraint]] = {}
        for name, condition, cone in written:
            stated = admissible(condition, forces.components, cone)
            self.strength.setdefault(name, []).extend(stated)
        forces = forces if lift is None else forces.lifted(lift)
        limits = [limit for named in self.strength.values() for limit in named]
        self.still = self.reduction.still
        super().__init__(assemblage, forces, limits, objective, self.reduction.rates)

    def _written(self) -> tuple[dict[str, LinearForm], list[tuple[str, Condition, Cone]]]:
        """What unknowns of surfaces' own give, and the conditions to write."""
        model, plain, gives = self.model, list[YieldSurface](), dict[str, LinearForm]()
        written = list[tuple[str, Condition, Cone]]()
        for surface in self.surfaces:
            own = surface.unknowns(model.contacts)
            if own is None or not own.gives.keys() <= model.start.keys() - gives.keys():
                plain.append(surface)
            else:
                gives |= own.gives
                written += [(surface.name, condition, surface.cone) for condition in own.conditions]
        return gives, [*model.strength(plain), *written]

    @property
    def units(self) -> FloatArray:
        scaling = self.scaling
        return np.where(self.model.is_moment, scaling.length, 1.0) * scaling.force
