"""The limit problem as its users meet it: with CVXPY's words, and in their units."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any

import cvxpy as cp

from cvxlimit.base.doors import attached
from cvxlimit.errors import ModelError
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.problem.duals import foreign
from cvxlimit.problem.forces import contact_number
from cvxlimit.problem.interfaces import Interface
from cvxlimit.problem.program import UserProgram
from cvxlimit.problem.solving import solved
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import SolverSettings
from cvxlimit.solvers.program import ConeProgram
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone

if TYPE_CHECKING:
    from pandas import DataFrame


class LimitProblem:
    """max load factor  subject to  equilibrium, and strength at every contact; in CVXPY.

    Parameters
    ----------
    scene : Scene
    surface : str, Cone or sequence of YieldSurface
        As :func:`cvxlimit.solve` takes it. Surfaces implied by another are not written.
    friction, cohesion, compressive_strength, tensile_strength : number, array (n,) or Parameter
        In place of the scene's: one for all or one per contact, of joints only; CVXPY
        expressions of Parameters too.
    live, dead : Load, (3,) or (free blocks, 6)
        In place of the scene's loads; numbers, Parameters or expressions of them: an
        acceleration in multiples of weights, or forces and moments at centroids.
    weights : number, array (free blocks,) or Parameter
        Weights of the free blocks, in the scene's order.
    most, least : number, array (reactions,) or Parameter
        Bounds of the scene's reactions, in their order, or one for all. Each has the sign that it
        has in the scene, and is 0 where it is 0 there.
    formulation : callable
        Which forces are the unknowns: :func:`~cvxlimit.model.formulations.corner_compressions`
        (default), :func:`~cvxlimit.model.formulations.resultants`, or one of your own.

    Raises
    ------
    ModelError
        Without rocking, or with the same surface twice, and for values of another shape or with
        Variables.

    Attributes
    ----------
    V1, V2, N, M1, M2, MT : CVXPY expressions (n,)
        Forces of all contacts in the user's units; ``N["a-b"]`` is of one.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> problem = LimitProblem(builtin_scene("single-block"))
    >>> limit = problem.add("service", problem.factor <= 0.1)
    >>> round(problem.solve().load_factor, 6), round(float(limit.dual_value), 4)
    (0.1, 1.0)
    """

    def __init__(
        self,
        scene: Scene,
        surface: str | Cone | Sequence[YieldSurface] = "conic",
        *,
        friction: Any = None,
        cohesion: Any = None,
        compressive_strength: Any = None,
        tensile_strength: Any = None,
        live: Any = None,
        dead: Any = None,
        weights: Any = None,
        most: Any = None,
        least: Any = None,
        formulation: Formulation = corner_compressions,
    ) -> None:
        values = {
            "friction": friction, "cohesion": cohesion, "live": live, "dead": dead,
            "compressive_strength": compressive_strength, "tensile_strength": tensile_strength,
            "weights": weights, "most": most, "least": least,
        }  # fmt: skip
        self._stated = UserProgram(scene, surface, values, formulation)

    def __repr__(self) -> str:
        stated, scene = self._stated, self._stated.assemblage.scene
        sizes = [
            f"{name} {sum(limit.size for limit in limits):,}"
            for name, limits in self.constraints.items()
            if limits
        ]
        variables = sum(variable.size for variable in stated.unknowns)
        parts = [
            f"{len(scene.free):,} blocks, {len(scene.contacts):,} contacts",
            f"{variables:,} variables",
            f"limits: {', '.join(sizes)}",
        ]
        own = stated.values.parameters() + self.problem.parameters()
        names = [f"{p.name()} {p.shape or ''}".strip() for p in dict.fromkeys(own)]
        if names:
            parts.append(f"Parameters: {', '.join(names)}")
        if stated.aim is not None:
            parts.append("maximises an aim of one's own")
        return f"LimitProblem({scene.name!r}, {stated.surface}: {'; '.join(parts)})"

    # What CVXPY shows

    V1 = property(lambda self: self._stated.forces["V1"], doc="Shear (n,) along t1, by contact.")
    V2 = property(lambda self: self._stated.forces["V2"], doc="Shear (n,) along t2, by contact.")
    N = property(lambda self: self._stated.forces["N"], doc="Compression (n,) by contact.")
    M1 = property(lambda self: self._stated.forces["M1"], doc="Moment (n,) about t1, by contact.")
    M2 = property(lambda self: self._stated.forces["M2"], doc="Moment (n,) about t2, by contact.")
    MT = property(lambda self: self._stated.forces["MT"], doc="Torsion (n,) by contact.")

    @property
    def factor(self) -> cp.Expression:
        """The load factor, in CVXPY."""
        return self._stated.factor

    @property
    def problem(self) -> cp.Problem:
        """The problem in CVXPY, every constraint with its label."""
        return self._stated.problem

    @property
    def program(self) -> ConeProgram:
        """The rows that solvers get, at the Parameters' present values. The unknowns are internal
        forces, in units of the whole load, bounds of norms and the load factor."""
        return self._stated.program

    @property
    def constraints(self) -> dict[str, Constraints]:
        """Those of :attr:`problem` by label: surfaces, ``"formulation"``, ``"equilibrium"``, and
        what was added; lists that have a ``dual_value`` as well.

        Duals are in the user's units, as all that is added: what the load factor, or the aim, gains
        per unit by which a row is loosened, a force as a rule. That of equilibrium (6 free blocks,)
        is the mechanism: velocities and rates of turning of each free block, at which the live load
        has power 1. Its entries are what a unit of further dead load takes off the load factor.
        """
        every = {**self._stated.constraints, **self._stated.limits}
        return {name: Constraints(limits) for name, limits in every.items()}

    def interface(self, contact: str | int | tuple[str, str]) -> Interface:
        """What one contact contributes: its forces, its constraints, slacks and duals.

        Parameters
        ----------
        contact : str, int or (str, str)
            Its name, as forces have it, its number, or its two blocks in any order.

        Raises
        ------
        ModelError
            If there is none, or more than one between these blocks.

        Example
        -------
        >>> from cvxlimit import builtin_scene
        >>> problem = LimitProblem(builtin_scene("single-block"))
        >>> problem.interface("ground-b1")
        Interface('ground-b1', limits: rocking 4, torsion-shear 5)
        """
        stated = self._stated
        names, pairs, unit = stated.assemblage.contacts.names, stated.pairs, stated.scaling.force
        j = contact_number(contact, names, pairs)
        return Interface.of(j, names[j], pairs[j], stated.forces, stated.parts(), unit)

    def to_dataframe(self) -> DataFrame:
        """Forces, and what more resistance of each contact gains, as a pandas table.

        A row for each contact: its blocks ``a`` and ``b``, ``V1`` to ``MT``, and
        ``gain_rocking`` and so on, by label: what the load factor, or the aim, gains per unit of
        force by which the contact resists more: the sum of its duals, without those of rows that
        only bound a norm. NaN before a solve. ``attrs["units"]`` has units,
        ``attrs["description"]`` what columns are.

        Raises
        ------
        ModelError
            If pandas is not installed.

        Example
        -------
        >>> from cvxlimit import builtin_scene
        >>> problem = LimitProblem(builtin_scene("single-block"))
        >>> solution = problem.solve()
        >>> problem.to_dataframe()[["N", "gain_rocking", "gain_torsion-shear"]].round(3).values
        array([[3.2, 0.5, 0. ]])
        """
        table: DataFrame = attached("problem_table")(self)
        return table

    @property
    def value(self) -> float | None:
        """The load factor, or the value of the aim, of the last solve; as CVXPY has it, None before
        the first, and infinite where there is no largest value or nothing satisfies the limits."""
        return None if self.problem.value is None else float(self.problem.value)

    @property
    def status(self) -> str | None:
        """CVXPY's status of the last solve; what is proved is the solution's."""
        return self.problem.status

    # What users change

    def add(self, name: str, *limits: cp.Constraint) -> Any:
        """Add limits under a name: CVXPY constraints on :attr:`N`, :attr:`V1` ... :attr:`factor`,
        in the user's units; variables and Parameters of one's own may stand in them.

        Returns the limit, or a list of several, whose ``dual_value`` a solve gives: what the load
        factor, or the aim, gains per unit of slack; of an equation, per unit of its right-hand
        side (what is minimised falls by that).

        Raises
        ------
        ModelError
            For a name that is taken, and for what is no constraint, or not convex.

        Example
        -------
        >>> from cvxlimit import LimitProblem, builtin_scene
        >>> problem = LimitProblem(builtin_scene("single-block"))
        >>> limits = problem.add("weak joint", problem.V1 >= -1.0, problem.V1 <= 1.0)
        >>> round(problem.solve().load_factor, 5)
        0.3125
        """
        if name in self.constraints:
            raise ModelError(
                f"there is a limit {name!r} already: remove it first, or choose a name"
            )
        for limit in limits or (None,):  # none at all is refused as well
            if not isinstance(limit, cp.Constraint):
                raise ModelError(
                    f"limit {name!r} must be a CVXPY constraint, as problem.N <= 3, got {limit!r}"
                )
            if not limit.variables():
                raise ModelError(f"limit {name!r} must be on forces, got {limit}")
            if not limit.is_dcp():
                raise ModelError(f"limit {name!r} is not convex by CVXPY's rules (DCP): {limit}")
            self._refuse_foreign(f"limit {name!r}", limit)
        stated = self._stated
        stated.change({**stated.limits, name: limits}, stated.aim, stated.sense)
        return limits[0] if len(limits) == 1 else list(limits)

    def remove(self, name: str) -> None:
        """Take away the limits that were added under a name.

        Raises
        ------
        ModelError
            If there are none.
        """
        stated, kept = self._stated, dict(self._stated.limits)
        if name not in kept:
            names = ", ".join(map(repr, kept)) or "none"
            raise ModelError(f"there is no added limit {name!r}: there are {names}")
        del kept[name]
        stated.change(kept, stated.aim, stated.sense)

    def _refuse_foreign(self, what: str, expression: Any) -> None:
        """Raises ModelError for an expression with variables of another problem of this kind."""
        other = foreign(expression, self._stated.unknowns)
        if other is not None:
            raise ModelError(
                f"{what} has forces or the load factor of another LimitProblem, variable "
                f"{other.name()!r}: take those of this one, or state both in one cvxpy.Problem, "
                "as docs/problem.md shows"
            )

    def maximise(self, expression: cp.Expression | None) -> None:
        """Maximise a concave expression in place of the load factor; None goes back to that. Fix
        the load factor by a limit, ``problem.add("load", problem.factor == 1)``, for the largest
        force under given loads. ``maximize`` is the same.

        Raises
        ------
        ModelError
            For what is no expression of forces, or none that CVXPY finds concave.
        """
        self._aim_at(expression, 1.0)

    def minimise(self, expression: cp.Expression | None) -> None:
        """Minimise a convex expression, as :meth:`maximise`; ``minimize`` is the same.

        Raises
        ------
        ModelError
            For an expression that CVXPY does not find convex.
        """
        self._aim_at(expression, -1.0)

    maximize, minimize = maximise, minimise

    def _aim_at(self, aim: cp.Expression | None, sense: float) -> None:
        """Maximises (``sense`` 1) or minimises (-1) an aim, or the load factor for None."""
        if aim is None:
            self._stated.change(self._stated.limits, None)
            return
        if not (isinstance(aim, cp.Expression) and aim.variables()):
            raise ModelError(f"an aim must be of forces, as problem.N[0], got {aim!r}")
        if not (aim.is_scalar() and (sense * aim).is_concave()):
            which = "concave can be maximised" if sense > 0.0 else "convex can be minimised"
            raise ModelError(f"only one number that is {which}, got {aim}")
        self._refuse_foreign("the aim", aim)
        self._stated.change(self._stated.limits, aim, sense)

    # What is found

    def solve(
        self,
        solver: str | SolverSettings | None = None,
        *,
        tolerance: float = 1e-5,
        verbose: bool = False,
        warm_start: bool = True,
        **options: Any,
    ) -> Solution:
        """The load factor at the Parameters' present values, with its bracket.

        Solved again after a Parameter has changed, it starts from the solve before, and keeps the
        reference states of the certificate that still hold. Linear limits of one's own have a
        bracket as well, and so has a linear aim under a load factor that a limit gives; the note
        says why others have none. With an aim, :attr:`~cvxlimit.Solution.load_factor` and bracket
        are those of its value, as ``quantity`` says.

        Afterwards all variables, expressions, duals, :attr:`value` and :attr:`status` are those of
        the solution: forces and load factor behind the lower bound, duals behind the upper.

        Parameters
        ----------
        solver : str, SolverSettings or None
            The one solver to use; None is the tested order.
        tolerance : float
            Relative width of the bracket that is asked for.
        verbose : bool
            True hands through what solvers print.
        warm_start : bool
            False starts as if nothing had been solved before.
        options
            The solver's own, as ``max_iter=50``; without one named, of the first that has them.

        Raises
        ------
        TypeError
            For an option that the solver does not have.
        ModelError, InputError
            For a solver that is not installed, and for Parameters without a value or with one that
            no scene can have.

        Example
        -------
        >>> from cvxlimit import builtin_scene
        >>> mu = cp.Parameter(value=0.7)
        >>> problem = LimitProblem(builtin_scene("single-block"), friction=mu)
        >>> found = [round(problem.solve().load_factor, 5)]
        >>> mu.value = 0.3
        >>> [*found, round(problem.solve().load_factor, 5)]
        [0.4, 0.3]
        """
        if not warm_start:
            self._stated.forget()
        solution: Solution = solved(self._stated, solver, tolerance, verbose, options)
        solution.__dict__["problem"] = self
        return solution

    def at_rest(
        self, expression: cp.Expression, factor: float = 0.0, tolerance: float = 1e-5
    ) -> tuple[Solution, Solution]:
        """The least and the largest value of an expression among all forces that carry the dead
        load, each with its bracket: what a joint carries now is between them.

        Parameters
        ----------
        expression : CVXPY expression
            Affine in forces: ``problem.N["a-b"]``.
        factor : float
            So many times the live load act besides.
        tolerance : float
            Relative width of the brackets that is asked for.

        Raises
        ------
        ModelError
            For an expression that is not affine.

        Example
        -------
        >>> from cvxlimit import builtin_scene
        >>> scene = builtin_scene("single-block")
        >>> problem = LimitProblem(scene)
        >>> least, largest = problem.at_rest(problem.N[0])
        >>> [round(s.load_factor / scene.total_weight, 6) for s in (least, largest)]
        [1.0, 1.0]
        """
        # A copy with the load factor fixed shares the variables: these get their values back.
        aside = copy(self)
        aside._stated = copy(self._stated)
        # A name of the user's keeps its own limits beside the one that fixes it.
        fixed = (*self._stated.limits.get("load factor", ()), self.factor == factor)
        aside._stated.change({**self._stated.limits, "load factor": fixed}, None)
        with self._stated.untouched():
            aside.minimise(expression)
            least = aside.solve(tolerance=tolerance)
            aside.maximise(expression)
            return least, aside.solve(tolerance=tolerance)


class Constraints(list[cp.Constraint]):
    """Constraints under one label."""

    @property
    def dual_value(self) -> Any:
        """The dual of the one constraint, or the list of the duals of several; None before a
        solve."""
        values = [each.dual_value for each in self]
        return values[0] if len(values) == 1 else values


def problem_of(solution: Solution) -> Any:
    """The problem that has a solution as its answer: see :attr:`cvxlimit.Solution.problem`."""
    if solution.from_rest is not None:
        return attached("step_problem")(solution)
    problem = LimitProblem(solution.scene, solution.surfaces or solution.surface)
    problem._stated.surface = solution.surface
    return problem
