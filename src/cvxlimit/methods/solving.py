"""The front door: one call from a scene to a certified solution."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, cast

from cvxlimit.checks import ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.analysis import Convex
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.driver import Progress, Rule, Run, drive
from cvxlimit.methods.exact_friction import ExactFriction
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.methods.gilbert import Gilbert
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.readings.named import MOMENTS, parse_moments
from cvxlimit.methods.zero_dilatancy import ZeroDilatancy
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import SolverSettings
from cvxlimit.surfaces import Cone, YieldSurface

__all__ = ["FLOWS", "INTERACTIONS", "MODELS", "MOMENTS", "check_choice", "solve"]

FLOWS = ("associated", "zero-dilatancy", "gilbert")

INTERACTIONS: dict[str, type[Rule]] = {rule.name: rule for rule in (Convex, FixedPoint, Certified)}


def solve(
    scene: Scene | Assemblage,
    surface: str | Cone | Sequence[YieldSurface] = "conic",
    *,
    interaction: str | Rule | None = "none",
    moments: str | Moments = "independent",
    torsion_shear: str = "linear",
    flow: str = "associated",
    tolerance: float | None = None,
    formulation: Formulation = corner_compressions,
    ladder: Sequence[str | SolverSettings] | None = None,
    progress: Progress | None = None,
    model: str = "auto",
) -> Solution:
    """Collapse load factor of a scene, with a bracket recomputed outside the solver.

    Parameters
    ----------
    scene : Scene
        Or the mechanics of one, as an :class:`~cvxlimit.model.assemblage.Assemblage`: what scenes
        of the same geometry share is then computed once (:func:`cvxlimit.sweep` does that).
    surface : str, Cone or sequence of YieldSurface
        ``"conic"`` (default, exact), ``"octagon"`` (the paper's), ``"16-gon"`` or any K;
        ``"octagon-inscribed"`` and so on for the safe side; or your own surfaces.
    interaction : {"none", "fixed-point", "certified"}, Rule or None
        Whether and how bending reduces torsion and shear strength (Eq. 26-32): not at all, by
        the paper's iteration (Eq. 41-43), or by the certified method; with settings of your own
        as :class:`FixedPoint` or :class:`Certified`; or an outer loop of your own, as a
        :class:`~cvxlimit.methods.driver.Rule`.
    moments : {"independent", "signed", "signed-torsion-bending", "paper"} or Moments
        How Eq. 30 adds moments: every sign on its own, the safe reading; static torsion about the
        pressure centre, without or with Eq. 27 beside it; or tied signs with absolute
        eccentricities and Eq. 27, with which the paper's figures are met, and which depends on the
        choice of the contacts' axes
        (:class:`~cvxlimit.methods.interaction.readings.named.Paper` takes the others).
        Without interaction it makes no difference.
    torsion_shear : {"linear", "parabolic", "exact"}
        How torsion and shear share friction: on the paper's line (Eq. 24), on a parabola between
        it and the exact limit of Eq. 18-21 at the same price, or on that limit to a tolerance of
        1e-3 (:class:`~cvxlimit.methods.exact_friction.ExactFriction`). Without interaction only.
    flow : {"associated", "zero-dilatancy", "gilbert"}
        Whether sliding opens contacts (the associated rule, which has one load factor) or not: then
        the answer is a set of solutions without a bracket, ``solution.members``, and the load
        factor is the lowest found (:class:`~cvxlimit.methods.zero_dilatancy.ZeroDilatancy`);
        ``"gilbert"`` is the usual scheme for one of them, with what its answer is worth
        (:class:`~cvxlimit.methods.gilbert.Gilbert`).
        Without interaction only.
    tolerance : float or None
        Asked relative width of the bracket; for the fixed point, the change that counts as
        converged. None is 1e-5 without interaction, 1e-4 for the fixed point (the paper's), and
        for the certified method as narrow as its budget allows, where 5 % counts as good.
    formulation : callable
        Which internal forces describe a contact: :func:`corner_compressions` (default, fastest),
        :func:`resultants`, or a function of your own from contacts to a :class:`ForceModel`.
        Without interaction only.
    ladder : sequence of str or SolverSettings, or None
        Solvers to try in turn, any that CVXPY has installed: ``["MOSEK", "CLARABEL"]``; None is
        the tested order.
    progress : callable or None
        Called with one line of text at every step of long work.
    model : {"auto", "full", "least"}
        How much model: no more than the scene needs (planar, half of a symmetric scene, parts
        with live load only; :func:`cvxlimit.explain` says which), or all of it; ``"least"`` takes
        reductions that do not pay as well. Bounds are those of the full scene in any case. With
        interaction only the certified method has less, for planar and for symmetric scenes.

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
    if not callable(formulation):
        raise ModelError(
            "formulation must be a function of contacts like "
            f"cvxlimit.model.formulations.resultants, got {formulation!r}"
        )
    check_choice("flow", flow, FLOWS)
    check_choice("model", model, MODELS)
    asked = "none" if interaction is None else interaction
    if flow != "associated" and asked != "none":
        raise ModelError(f"flow {flow!r} goes without interaction: leave the interaction out")
    rule = _rule(_default_rule(torsion_shear, flow) if asked == "none" else asked, tolerance)
    run = Run(
        scene, surface, parse_moments(moments), formulation, ladder, progress, torsion_shear, model
    )
    return drive(rule, run)


def _default_rule(torsion_shear: str, flow: str) -> Rule:
    """Without interaction: one convex problem, unless flow or torsion-shear take several."""
    if flow == "gilbert":
        if torsion_shear != "linear":
            raise ModelError(
                f"Gilbert's scheme goes with torsion_shear 'linear', got {torsion_shear!r}"
            )
        return Gilbert()
    if flow == "zero-dilatancy":
        if torsion_shear == "exact":
            raise ModelError(
                "zero dilatancy goes with torsion_shear 'linear' or 'parabolic', got 'exact'"
            )
        return ZeroDilatancy()
    return ExactFriction() if torsion_shear == "exact" else Convex()


def _rule(interaction: str | Rule, tolerance: float | None) -> Rule:
    """The rule of that name, or the one given, with its tolerance set if one is asked for."""
    if isinstance(interaction, Rule):
        rule: Any = interaction
    else:
        check_choice("interaction", interaction, tuple(INTERACTIONS))
        rule = INTERACTIONS[interaction]()
    if tolerance is not None:
        ratio(tolerance, "tolerance")
        if not hasattr(rule, "tolerance"):
            raise ModelError(f"{type(rule).__name__} has no tolerance to set, got {tolerance!r}")
        rule = replace(rule, tolerance=tolerance)
    return cast("Rule", rule)


def check_choice(what: str, value: str, allowed: Collection[str]) -> None:
    """Refuse a value that is not one of those allowed; ``what`` names it.

    Raises
    ------
    ModelError
    """
    if value not in allowed:
        raise ModelError(f"{what} must be one of {', '.join(allowed)}, got {value!r}")
