"""The front door: one call from a scene to a certified solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from cvxlimit.checks import ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.analysis import TOLERANCE, Progress, analyse
from cvxlimit.methods.certified import Certified, run_certified
from cvxlimit.methods.fixed_point import FixedPoint, run_fixed_point
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import SolverSettings
from cvxlimit.surfaces import Cone, YieldSurface, parse_cone
from cvxlimit.versions import versions

INTERACTIONS = ("none", "fixed-point", "certified")
MOMENTS = ("independent", "signed")


def solve(
    scene: Scene,
    surface: str | Cone | Sequence[YieldSurface] = "conic",
    *,
    interaction: str | FixedPoint | Certified | None = "none",
    moments: str = "independent",
    tolerance: float | None = None,
    formulation: Formulation = corner_compressions,
    ladder: Sequence[SolverSettings] | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Collapse load factor of a scene, with a bracket recomputed outside the solver.

    Parameters
    ----------
    scene : Scene
    surface : str, Cone or sequence of YieldSurface
        ``"conic"`` (default, exact), ``"octagon"`` (the paper's), ``"16-gon"`` or any K;
        ``"octagon-inscribed"`` and so on for the safe side; or your own surfaces.
    interaction : {"none", "fixed-point", "certified"}, FixedPoint or Certified, or None
        Whether and how bending reduces torsion and shear strength (Eq. 26-32): not at all, by
        the paper's iteration (Eq. 41-43), or by the certified method; with settings of your own
        as :class:`FixedPoint` or :class:`Certified`.
    moments : {"independent", "signed"}
        How Eq. 30 adds moments: every sign on its own, or static torsion about the pressure
        centre.
    tolerance : float or None
        Asked relative width of the bracket; for the fixed point, the change that counts as
        converged. None is 1e-5 without interaction, 1e-4 for the fixed point (the paper's), and
        for the certified method as narrow as its budget allows, where 5 % counts as good.
    formulation : callable
        Which internal forces describe a contact: :func:`corner_compressions` (default, fastest),
        :func:`resultants`, or a function of your own from contacts to a :class:`ForceModel`.
        Without interaction only.
    ladder : sequence of SolverSettings or None
        Solvers to try in turn; None is the tested order.
    progress : callable or None
        Called with one line of text at every step of long work.

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
        If an option is not one of those above.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> solution = solve(builtin_scene("tuff-wall"))
    >>> round(solution.load_factor, 5), solution.lower <= 0.423056 <= solution.upper + 1e-6
    (0.42306, True)
    """
    check_scene(scene)
    ladder = _checked_ladder(ladder)
    solution = _solved(
        scene, surface, interaction, moments, tolerance, formulation, ladder, progress
    )
    return replace(solution, versions=versions(_solvers(solution, ladder or ())))


def _solvers(solution: Solution, ladder: Sequence[SolverSettings]) -> set[str]:
    """Solvers that ran, as CVXPY calls them; our own labels begin with that name."""

    def name(label: str) -> str:
        own = [rung.name for rung in ladder if label.startswith(str(rung))]
        return own[0] if own else label.replace(",", " ").split()[0]

    return {name(iterate.solver) for iterate in solution.history}


def _solved(
    scene: Scene,
    surface: str | Cone | Sequence[YieldSurface],
    interaction: str | FixedPoint | Certified | None,
    moments: str,
    tolerance: float | None,
    formulation: Formulation,
    ladder: Sequence[SolverSettings] | None,
    progress: Progress | None,
) -> Solution:
    check_choice("moments", moments, MOMENTS)
    if tolerance is not None:
        ratio(tolerance, "tolerance")
    interaction = "none" if interaction is None else interaction
    if isinstance(interaction, str):
        check_choice("interaction", interaction, INTERACTIONS)
        if interaction == "none":
            asked = TOLERANCE if tolerance is None else tolerance
            return analyse(
                scene,
                surface,
                tolerance=asked,
                ladder=ladder,
                formulation=formulation,
                progress=progress,
            )
        interaction = FixedPoint() if interaction == "fixed-point" else Certified()
    if not isinstance(interaction, (FixedPoint, Certified)):
        check_choice("interaction", interaction, INTERACTIONS)
    if formulation is not corner_compressions:
        raise ModelError("interaction brings its own formulation: leave formulation out")
    if tolerance is not None:
        interaction = replace(interaction, tolerance=tolerance)
    cone = _single_cone(surface)
    if isinstance(interaction, FixedPoint):
        return run_fixed_point(scene, cone, moments, interaction, ladder, progress)
    return run_certified(scene, cone, moments, interaction, ladder, progress)


def _checked_ladder(
    ladder: Sequence[SolverSettings] | SolverSettings | None,
) -> Sequence[SolverSettings] | None:
    """Settings as a ladder; one that stands alone is a ladder of one rung."""
    if ladder is None:
        return None
    rungs = [ladder] if isinstance(ladder, SolverSettings) else ladder
    if not isinstance(rungs, Sequence) or not all(isinstance(x, SolverSettings) for x in rungs):
        raise ModelError(
            f"ladder must be a list of SolverSettings, got {ladder!r}: "
            "write [SolverSettings('CLARABEL')], from cvxlimit.solvers"
        )
    return rungs


def _single_cone(surface: str | Cone | Sequence[YieldSurface]) -> Cone:
    if isinstance(surface, str):
        return parse_cone(surface)
    if isinstance(surface, Cone):
        return surface
    raise ModelError(
        "interaction brings its own surface (Eq. 32): give surface as 'conic', 'octagon', "
        "'K-gon' or a Cone, not as a list of surfaces"
    )


def check_choice(what: str, value: str, allowed: Sequence[str]) -> None:
    """Refuse a value that is not one of those allowed; ``what`` names it.

    Raises
    ------
    ModelError
    """
    if value not in allowed:
        raise ModelError(f"{what} must be one of {', '.join(allowed)}, got {value!r}")
