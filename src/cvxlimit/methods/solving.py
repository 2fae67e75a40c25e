"""The front door: one call from a scene to a certified solution.

Three steps: which method the call means, and whether it goes with the surface and the settings
(:func:`chosen`); whether it takes what the scene has (:func:`check`); and the method itself
(:func:`~cvxlimit.methods.driver.drive`). What goes with what stands in two tables, :data:`TABLE`
of methods and :data:`EXTRAS`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver

from cvxlimit.base.checks import check_choice, ratio
from cvxlimit.base.doors import Door
from cvxlimit.base.progressbar import Progress
from cvxlimit.errors import ModelError
from cvxlimit.methods.driver import Method, Run, drive
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.readings.moments import INDEPENDENT, Moments
from cvxlimit.readings.named import MomentsName
from cvxlimit.reductions.choice import MODELS, ModelName
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import SolverSettings, asked_ladder
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.cones import parse_cone
from cvxlimit.surfaces.coulomb import PARABOLIC, SURFACES, SurfaceName

MethodName = Literal["convex", "exact", "fixed-point", "certified", "zero-dilatancy", "incremental"]
"""Names for type checkers: those of :data:`TABLE`."""

Surface: TypeAlias = "str | Cone | Sequence[YieldSurface]"


EXTRAS: Mapping[str, tuple[Callable[[Run], object], str]] = MappingProxyType(
    {
        "formulation": (
            lambda run: run.formulation is not corner_compressions,
            "brings its own formulation: leave formulation out",
        ),
        "reactions": (
            lambda run: run.contacts.is_point.any(),
            "knows no ties and no reactions, whose bounds its proof would have to scale: leave "
            "them out, give their force as a point load, or take method 'fixed-point', which has "
            "no bracket",
        ),
        "cohesion": (
            lambda run: run.given.contacts.first_of("cohesion"),
            "has no cohesion: take it out of the scene, which has {}",
        ),
        "strength": (
            lambda run: run.contacts.first_of("compressive_strength", "tensile_strength", "least"),
            "knows no strength of stone or mortar and no reactions that push at least so much, got "
            "{}: leave compressive_strength and tensile_strength out of the scene, and give the "
            "least of a reaction as a point load",
        ),
    }
)
"""What not every method takes: how it is seen, and what is said of that where it is not taken."""

TABLE: Mapping[str, type[Method]] = Door("cvxlimit.methods")
"""All methods by name."""


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
    progress: Progress = None,
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
    method : {"convex", "exact", "fixed-point", "certified", "zero-dilatancy", ...} or Method
        ``"convex"`` (default) is one convex problem, without interaction with bending.
        ``"exact"`` takes torsion and shear on their exact limit (Eq. 18-21).
        ``"fixed-point"`` and ``"certified"`` let bending reduce torsion and shear strength
        (Eq. 26-32), by the paper's iteration (Eq. 41-43) or with a proved bracket.
        ``"zero-dilatancy"`` is friction that slides without opening contacts: a set of solutions,
        ``solution.members``, without a bracket. ``"incremental"`` pushes rigid blocks on elastic
        joints from rest to collapse: the one load factor that is reached, without a bound.
        With settings of your own: :class:`Certified`, :class:`FixedPoint`,
        :class:`ZeroDilatancy`, :class:`Incremental`...;
        or a loop of your own, as a :class:`Method`. What goes with
        what: :data:`cvxlimit.methods.solving.TABLE`.
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
    progress : bool, callable or None
        Called with one line of text at every step of long work; True writes it on stderr.
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
    if model == "least" and not asked.reduces:
        raise ModelError(f"model 'least' does nothing for method {asked.name!r}: leave it out")
    check(f"method {asked.name!r}", run, asked.takes)
    return drive(asked, run)


def chosen(surface: Surface, method: str | Method | None, settings: Mapping[str, Any]) -> Method:
    """The method that a call means, with the settings that are not None; refuses a surface, or a
    setting, that does not go with it."""
    asked = "convex" if method is None else method
    if isinstance(asked, str) or not isinstance(asked, Method):
        check_choice("method", asked, TABLE)
        asked = TABLE[asked]()
    kind = "own"
    if str(surface) in ("conic", PARABOLIC):
        kind = str(surface)
    elif isinstance(surface, Cone) or (
        isinstance(surface, str) and (_is_cone(surface) or surface not in SURFACES)
    ):
        kind = "facets"
    if kind not in asked.surfaces:
        takes = [name for name, method in TABLE.items() if kind in method.surfaces]
        raise ModelError(
            f"method {asked.name!r} goes with surface {' or '.join(asked.surfaces)}, got "
            f"{_called(surface)}: that goes with method {' or '.join(map(repr, takes))}"
        )
    own_settings = {name: value for name, value in settings.items() if value is not None}
    for name, value in own_settings.items():
        if not hasattr(asked, name):
            has = [other for other, method in TABLE.items() if hasattr(method, name)]
            raise ModelError(
                f"{name} does nothing for method {asked.name!r}, got {value!r}: leave it out, or "
                f"take method {' or '.join(map(repr, has))}"
            )
    if "tolerance" in own_settings:
        ratio(own_settings["tolerance"], "tolerance")
    return replace(asked, **own_settings) if own_settings else asked


def check(what: str, run: Run, takes: Collection[str]) -> None:
    """Refuse a run with one of :data:`EXTRAS` that ``what`` does not take."""
    for extra, (is_there, refusal) in EXTRAS.items():
        if extra not in takes and (found := is_there(run)):
            raise ModelError(f"{what} {refusal.format(found)}")


def _is_cone(name: str) -> bool:
    """Whether a surface's name is that of a cone, so that nobody else need be asked for it."""
    try:
        return bool(parse_cone(name))
    except ModelError:
        return False


def _called(surface: Surface) -> str:
    return repr(str(surface)) if isinstance(surface, (str, Cone)) else "a list of surfaces"
