"""Sets of surfaces: the usual one, names for the command line, and which rows are needed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cvxlimit.errors import ModelError
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone, Conic, parse_cone
from cvxlimit.surfaces.coulomb import Rocking, Sliding, Torsion, TorsionShear
from cvxlimit.surfaces.torsion_shear import ParabolicTorsionShear

TORSION_SHEAR = ("linear", "parabolic", "exact")
"""How torsion and shear share friction: the paper's line (Eq. 24), a parabola between it and the
exact limit, or that limit itself (Eq. 18-21), to a tolerance."""

_BUILT_IN = {
    kind.name: kind for kind in (Rocking, Sliding, Torsion, TorsionShear, ParabolicTorsionShear)
}

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
    surface: str | Cone | Sequence[YieldSurface], torsion_shear: str = "linear"
) -> tuple[tuple[YieldSurface, ...], str]:
    """Surfaces and their name from ``"conic"``, ``"octagon"``, a cone, or surfaces themselves.

    ``"exact"`` torsion-shear is a matter of the formulation: of the surfaces, rocking remains.

    Raises
    ------
    ModelError
        For anything else, and for facets or own surfaces with another torsion-shear than the
        paper's.
    """
    if isinstance(surface, str):
        surface = parse_cone(surface)
    if torsion_shear not in TORSION_SHEAR:
        raise ModelError(
            f"torsion_shear must be one of {', '.join(TORSION_SHEAR)}, got {torsion_shear!r}"
        )
    if isinstance(surface, Cone):
        return _of_cone(surface, torsion_shear), str(surface)
    if torsion_shear != "linear":
        raise ModelError(
            f"torsion_shear {torsion_shear!r} goes with surface 'conic'; in a list of surfaces "
            "give ParabolicTorsionShear() itself"
        )
    surfaces = tuple(surface) if isinstance(surface, Iterable) else (surface,)
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
            return surfaces_of(name, torsion_shear)[0]
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


def _of_cone(cone: Cone, torsion_shear: str) -> tuple[YieldSurface, ...]:
    if torsion_shear == "linear":
        return Rocking(), TorsionShear(cone)
    if not isinstance(cone, Conic):
        raise ModelError(
            f"torsion_shear {torsion_shear!r} is not made of facets: use surface 'conic' with it, "
            f"or torsion_shear 'linear' with {str(cone)!r}"
        )
    return (Rocking(), ParabolicTorsionShear()) if torsion_shear == "parabolic" else (Rocking(),)
