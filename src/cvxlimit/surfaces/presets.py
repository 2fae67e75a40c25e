"""Sets of surfaces: the usual one, names for the command line, and which rows are needed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cvxlimit.errors import ModelError
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.cones import Cone, parse_cone
from cvxlimit.surfaces.coulomb import Rocking, TorsionShear

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
    """Surfaces and their name from ``"conic"``, ``"octagon"``, a cone, or surfaces themselves."""
    if isinstance(surface, str):
        surface = parse_cone(surface)
    if isinstance(surface, Cone):
        return (Rocking(), TorsionShear(surface)), str(surface)
    surfaces = tuple(surface) if isinstance(surface, Iterable) else (surface,)
    if not all(isinstance(s, YieldSurface) for s in surfaces):
        raise ModelError(
            "surface must be a name like 'octagon', a Cone, or a list of YieldSurface objects, "
            f"got {surface!r}"
        )
    return surfaces, "+".join(f"{s.name}({s.cone})" for s in surfaces)
