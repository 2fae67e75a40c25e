"""The methods, and what goes with what: one table, from which all checks and choices come."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np

from cvxlimit.base.checks import meant, ratio
from cvxlimit.base.doors import Door
from cvxlimit.errors import ModelError
from cvxlimit.methods.driver import Method, Run
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.cones import parse_cone
from cvxlimit.surfaces.coulomb import PARABOLIC, SURFACES

MethodName = Literal["convex", "exact", "fixed-point", "certified", "zero-dilatancy"]
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
            lambda run: np.any(run.given.contacts.cohesion),
            "has no cohesion: take it out of the scene",
        ),
        "strength": (
            lambda run: run.mortar or np.isfinite(run.contacts.compressive_strength).any(),
            "knows no strength of stone or mortar, and no reactions that push at least so much: "
            "leave compressive_strength and tensile_strength out of the scene, and give what is "
            "pushed at least as a point load",
        ),
    }
)
"""What not every method takes: how it is seen, and what is said where it is not taken."""

TABLE: Mapping[str, type[Method]] = Door("cvxlimit.methods")
"""All methods by name."""


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
        if extra not in takes and is_there(run):
            raise ModelError(f"{what} {refusal}")


def check_choice(what: str, value: object, allowed: Collection[str]) -> None:
    if not isinstance(value, str) or value not in allowed:
        got = repr(value)
        if isinstance(value, type):
            got = f"the class {value.__name__}: write {value.__name__}()"
        known = allowed.names if isinstance(allowed, Door) else [*allowed]
        raise ModelError(
            f"{what} must be one of {', '.join(known)}, got {got}"
            + meant(value, known, before="; ")
        )


def _is_cone(name: str) -> bool:
    """Whether a surface's name is that of a cone, so that nobody else need be asked for it."""
    try:
        return bool(parse_cone(name))
    except ModelError:
        return False


def _called(surface: Surface) -> str:
    return repr(str(surface)) if isinstance(surface, (str, Cone)) else "a list of surfaces"
