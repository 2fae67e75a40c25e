"""The methods, and what goes with what: one table, from which all checks and choices come."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np

from cvxlimit.base.checks import meant, ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.methods.driver import Method, Run
from cvxlimit.methods.exact_friction import ExactFriction
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import NAMED, PARABOLIC

MethodName = Literal["convex", "exact", "fixed-point", "certified", "zero-dilatancy"]
"""Names for type checkers: those of :data:`TABLE`."""

Surface: TypeAlias = "str | Cone | Sequence[YieldSurface]"


@dataclass(frozen=True)
class Row:
    """What one method goes with.

    Attributes
    ----------
    method : Method
        With the settings it has unless others are given.
    surfaces : tuple of str
        Kinds of surfaces: ``"conic"``, ``"facets"``, ``"parabolic"``, ``"own"``.
    scenes : tuple of str
        What it takes besides dry contacts: keys of :data:`EXTRAS`.
    reduces : bool
        Whether it takes less than all of the scene where that is enough.
    """

    method: Method
    surfaces: tuple[str, ...]
    scenes: tuple[str, ...] = ()
    reduces: bool = False


EXTRAS: Mapping[str, tuple[Callable[[Run], object], str]] = MappingProxyType(
    {
        "formulation": (
            lambda run: run.formulation is not corner_compressions,
            "brings its own formulation: leave formulation out",
        ),
        "reactions": (
            lambda run: run.contacts.is_point.any(),
            "knows no ties and no reactions, which have no pressure centre: leave them out",
        ),
        "cohesion": (
            lambda run: np.any(run.given.contacts.cohesion),
            "has no cohesion: take it out of the scene",
        ),
        "strength": (
            lambda run: run.mortar or np.isfinite(run.contacts.compressive_strength).any(),
            "knows no strength of stone or mortar: leave compressive_strength and "
            "tensile_strength out of the scene",
        ),
    }
)
"""What not every method takes: how it is seen, and what is said where it is not taken."""

_EVERY = ("conic", "facets", "parabolic", "own")
_JOINTS = ("reactions", "cohesion", "strength")

_ROWS = (
    Row(Convex(), _EVERY, ("formulation", *_JOINTS), reduces=True),
    Row(ExactFriction(), ("conic",), _JOINTS),
    Row(FixedPoint(), ("conic", "facets")),
    Row(Certified(), ("conic",), reduces=True),
    Row(ZeroDilatancy(), _EVERY, _JOINTS),
)

TABLE: Mapping[str, Row] = MappingProxyType({row.method.name: row for row in _ROWS})
"""All methods by name."""


def chosen(surface: Surface, method: str | Method | None, settings: Mapping[str, Any]) -> Method:
    """The method that a call means, with the settings that are not None; refuses a surface, or a
    setting, that does not go with it."""
    asked = "convex" if method is None else method
    if isinstance(asked, str) or not isinstance(asked, Method):
        check_choice("method", asked, TABLE)
        asked = TABLE[asked].method
    kind = "facets" if isinstance(surface, (str, Cone)) and surface not in NAMED else "own"
    if str(surface) in ("conic", PARABOLIC):
        kind = str(surface)
    row = TABLE.get(asked.name)
    if row is not None and kind not in row.surfaces:
        takes = [name for name, row in TABLE.items() if kind in row.surfaces]
        raise ModelError(
            f"method {asked.name!r} goes with surface {' or '.join(row.surfaces)}, got "
            f"{_called(surface)}: that goes with method {' or '.join(map(repr, takes))}"
        )
    own_settings = {name: value for name, value in settings.items() if value is not None}
    for name, value in own_settings.items():
        if not hasattr(asked, name):
            has = [other for other, row in TABLE.items() if hasattr(row.method, name)]
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
    if value not in allowed:
        got = repr(value)
        if isinstance(value, type):
            got = f"the class {value.__name__}: write {value.__name__}()"
        raise ModelError(
            f"{what} must be one of {', '.join(allowed)}, got {got}"
            + meant(value, allowed, before="; ")
        )


def _called(surface: Surface) -> str:
    return repr(str(surface)) if isinstance(surface, (str, Cone)) else "a list of surfaces"
