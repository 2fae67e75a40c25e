"""The front door: one call from a scene to a certified solution."""

from __future__ import annotations

from collections.abc import Sequence

from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver

from cvxlimit.errors import ModelError
from cvxlimit.methods.driver import Method, Progress, Run, drive
from cvxlimit.methods.table import MethodName, check, check_choice, chosen
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.readings.moments import INDEPENDENT, Moments
from cvxlimit.readings.named import MomentsName
from cvxlimit.reductions.choice import MODELS, ModelName
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import SolverSettings, asked_ladder
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import SurfaceName


def solve(
    scene: Scene | Assemblage,
    surface: SurfaceName | Cone | Sequence[YieldSurface] = "conic",
    method: MethodName | Method | None = None,
    *,
    moments: MomentsName | Moments | None = None,
    tolerance: float | None = None,
    formulation: Formulation = corner_compressions,
    solver: str | SolverSettings | type[ConicSolver] | None = None,
    ladder: Sequence[str | SolverSettings | type[ConicSolver]] | None = None,
    verbose: bool = False,
    progress: Progress | None = None,
    model: ModelName = "auto",
) -> Solution:
    """Collapse load factor of a scene, with a bracket recomputed outside the solver.

    Parameters
    ----------
    scene : Scene
        Or the mechanics of one, as an :class:`~cvxlimit.model.assemblage.Assemblage`: what scenes
        of the same geometry share is then computed once (:func:`cvxlimit.sweep` does that).
    surface : str, Cone or sequence of YieldSurface
        ``"conic"`` (default, the exact cone), ``"octagon"`` (the paper's), ``"16-gon"`` or any K;
        ``"octagon-inscribed"`` and so on for the safe side; ``"parabolic"``, on which torsion and
        shear share friction nearer to the exact limit than on the paper's line (Eq. 24), in the
        same time; or your own surfaces.
    method : {"convex", "exact", "fixed-point", "certified", "zero-dilatancy", "gilbert"} or Method
        ``"convex"`` (default) is one convex problem, without interaction with bending.
        ``"exact"`` takes torsion and shear on their exact limit (Eq. 18-21).
        ``"fixed-point"`` and ``"certified"`` let bending reduce torsion and shear strength
        (Eq. 26-32), by the paper's iteration (Eq. 41-43) or with a proved bracket.
        ``"zero-dilatancy"`` is friction that slides without opening contacts: a set of solutions,
        ``solution.members``, without a bracket; ``"gilbert"`` is the usual scheme for one of them.
        With settings of your own: :class:`Certified`, :class:`FixedPoint`,
        :class:`ZeroDilatancy`...; or a loop of your own, as a :class:`Method`. What goes with
        what: :data:`cvxlimit.methods.table.TABLE`.
    moments : {"independent", "signed", "signed-torsion-bending", "paper"} or Moments
        How Eq. 30 adds moments, for the two methods with interaction: every sign on its own, the
        safe reading (default); static torsion about the pressure centre, without or with Eq. 27
        beside it; or tied signs with absolute eccentricities and Eq. 27, with which the paper's
        figures are met, and which depends on the choice of the contacts' axes
        (:class:`~cvxlimit.readings.named.Paper` takes the others).
    tolerance : float or None
        Asked relative width of the bracket; for the fixed point, the change that counts as
        converged. None is 1e-5 for the convex method, 1e-3 for the exact one, 1e-4 for the fixed
        point (the paper's), and for the certified method as narrow as its budget allows, where 5 %
        counts as good.
    formulation : callable
        Which internal forces describe a contact: :func:`corner_compressions` (default, fastest),
        :func:`resultants`, or a function of your own from contacts to a :class:`ForceModel`. For
        the convex method only.
    solver : str, SolverSettings, interface of CVXPY's kind, or None
        The one solver to use, any that CVXPY has installed: ``"CLARABEL"``, ``"MOSEK"``...; None
        is the tested order of several, chosen by size and kind of problem.
    ladder : sequence of the same, or None
        Solvers to try in turn until an answer is certified: ``["MOSEK", "CLARABEL"]``.
    verbose : bool
        True hands through what solvers print of their own work, on stdout.
    progress : callable or None
        Called with one line of text at every step of long work.
    model : {"auto", "full", "least"}
        Size of the model: reduced where that saves time (planar, half of a symmetric scene, parts
        with live load only; :func:`cvxlimit.explain` says which), or full; ``"least"`` is reduced
        wherever that is valid. Bounds are those of the full scene in any case. With interaction
        only the certified method has less, for planar and for symmetric scenes.

    Returns
    -------
    Solution
        ``solution.status`` says whether the bracket closed, the iteration converged, or no
        answer exists.

    Raises
    ------
    InputError
        If ``scene`` is no scene, or its geometry is not valid.
    ModelError
        If an option is not one of those above, or they do not go together.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> solution = solve(builtin_scene("tuff-wall"))
    >>> round(solution.load_factor, 5), solution.lower <= 0.423056 <= solution.upper + 1e-6
    (0.42306, True)
    """
    check_choice("model", model, MODELS)
    settings = {"tolerance": tolerance, "moments": moments}
    asked = chosen(surface, method, settings)
    solvers = asked_ladder(solver, ladder)
    run = Run(scene, surface, INDEPENDENT, formulation, solvers, progress, model, verbose)
    if True:
        if model == "least" and not asked.reduces:
            raise ModelError(f"model 'least' does nothing for method {asked.name!r}: leave it out")
        check(f"method {asked.name!r}", run, asked.takes)
    return drive(asked, run)
