"""Sets of surfaces: the usual one, names for the command line, and which rows are needed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from cvxlimit.errors import ModelError
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone, parse_cone
from cvxlimit.surfaces.coulomb import Rocking, Sliding, Torsion, TorsionShear
from cvxlimit.surfaces.torsion_shear import ParabolicTorsionShear

PARABOLIC = "parabolic"
"""Torsion and shear on a parabola between the paper's line (Eq. 24) and the exact limit."""

_BUILT_IN = {
    kind.name: kind for kind in (Rocking, Sliding, Torsion, TorsionShear, ParabolicTorsionShear)
}

_NAMED: Mapping[str, tuple[YieldSurface, ...]] = MappingProxyType(
    {PARABOLIC: (Rocking(), ParabolicTorsionShear()), "exact": (Rocking(),)}
)

DEFAULT_SURFACES: tuple[YieldSurface, ...] = (Rocking(), TorsionShear())


def needed_surfaces(surfaces: Sequence[YieldSurface]) -> tuple[YieldSurface, ...]:
    """Surfaces whose rows may be needed: those implied by another go.

    A surface is implied by another of the same cone only: facets around a circle do not imply
    the circle, nor does the circle imply facets inside it.
    """
    names = [surface.name for surface in surfaces]
    if Rocking.name not in names:
        raise ModelError(
            f"surfaces {names} lack rocking, so contacts would carry tension: add Rocking()"
        )
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise ModelError(f"surface {twice[0]!r} is given twice; remove one")
    own = [s for s in surfaces if s.name == Rocking.name and type(s) is not Rocking]
    if own:
        raise ModelError(
            f"{type(own[0]).__name__} is named 'rocking', which the formulation replaces by its "
            "own: give it another name and add Rocking()"
        )
    implied = {(name, surface.cone) for surface in surfaces for name in surface.implies}
    return tuple(s for s in surfaces if (s.name, s.cone) not in implied)


def surfaces_of(
    surface: str | Cone | Sequence[YieldSurface],
) -> tuple[tuple[YieldSurface, ...], str]:
    """Surfaces and their name from ``"octagon"``, ``"parabolic"`` ..., a cone, or surfaces.

    Raises
    ------
    ModelError
        For anything else.

    Example
    -------
    >>> [name for _, name in map(surfaces_of, ("8-gon", "parabolic", [Rocking(), TorsionShear()]))]
    ['octagon', 'parabolic', 'rocking(conic)+torsion-shear(conic)']
    """
    if surface == PARABOLIC:
        return _NAMED[PARABOLIC], PARABOLIC
    cone = parse_cone(surface) if isinstance(surface, str) else surface
    if isinstance(cone, Cone):
        return (Rocking(), TorsionShear(cone)), str(cone)
    surfaces = tuple(cone) if isinstance(cone, Iterable) else (cone,)
    if not all(isinstance(s, YieldSurface) for s in surfaces):
        raise ModelError(
            "surface must be a name like 'octagon', a Cone, or a list of YieldSurface objects, "
            f"got {surface!r}"
        )
    return surfaces, "+".join(map(_said, surfaces))


def surfaces_named(name: str, torsion_shear: str = "linear") -> tuple[YieldSurface, ...] | None:
    """The surfaces whose name :func:`surfaces_of` made; None if one of them is not built in.

    >>> [str(surface.cone) for surface in surfaces_named("rocking(conic)+sliding(octagon)")]
    ['conic', 'octagon']
    >>> surfaces_named("rocking(conic)+a surface of one's own(conic)")
    """
    try:
        if not name.endswith(")"):
            return _NAMED.get(torsion_shear) or surfaces_of(name)[0]
        parts = [part.removesuffix(")").split("(") for part in name.split("+")]
        made = [_BUILT_IN[own](*_cones(own, cone)) for own, cone in parts]
    except (KeyError, ValueError, ModelError):
        return None
    return tuple(made)


def _cones(name: str, cone: str) -> list[Cone]:
    return [] if name == ParabolicTorsionShear.name else [parse_cone(cone)]


def _said(surface: YieldSurface) -> str:
    """Name and cone; one's own surface with the name of a built-in one is told from it."""
    kind = _BUILT_IN.get(surface.name)
    own = "" if kind in (None, type(surface)) else " of one's own"
    return f"{surface.name}{own}({surface.cone})"


def words_of(name: str) -> dict[str, str]:
    """How solutions and result files say a surface of that name."""
    if name == PARABOLIC:
        return {"surface": "conic", "torsion_shear": PARABOLIC}
    return {"surface": name, "torsion_shear": "linear"}
