"""The front door: one call from a scene to a certified solution."""

from __future__ import annotations

from collections.abc import Sequence

from cvxlimit.analysis import TOLERANCE, Progress, analyse
from cvxlimit.errors import ModelError
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import SolverSettings
from cvxlimit.surfaces import Cone, YieldSurface

INTERACTIONS = ("none", "fixed-point", "certified")
MOMENTS = ("independent", "signed")


def solve(
    scene: Scene,
    surface: str | Cone | Sequence[YieldSurface] = "conic",
    *,
    interaction: str = "none",
    moments: str = "independent",
    tolerance: float = TOLERANCE,
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
    interaction : {"none", "fixed-point", "certified"}
        Whether and how bending reduces torsion and shear strength (Eq. 26-32): not at all, by
        the paper's iteration (Eq. 41-43), or by the certified method.
    moments : {"independent", "signed"}
        How Eq. 30 adds moments: every sign on its own, or static torsion about the pressure
        centre.
    tolerance : float
        Asked relative width of the bracket.
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
        If the scene's geometry is not valid.
    ModelError
        If an option is not one of those above.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> solution = solve(builtin_scene("tuff-wall"))
    >>> round(solution.load_factor, 5), solution.lower <= 0.423056 <= solution.upper + 1e-6
    (0.42306, True)
    """
    _check_choice("interaction", interaction, INTERACTIONS)
    _check_choice("moments", moments, MOMENTS)
    if not 0.0 < tolerance < 1.0:
        raise ModelError(f"tolerance must be between 0 and 1, got {tolerance!r}")
    if interaction == "none":
        return analyse(scene, surface, tolerance=tolerance, ladder=ladder, progress=progress)
    raise ModelError(f"interaction {interaction!r} is not available yet")


def _check_choice(what: str, value: str, allowed: Sequence[str]) -> None:
    if value not in allowed:
        raise ModelError(f"{what} must be one of {', '.join(allowed)}, got {value!r}")
