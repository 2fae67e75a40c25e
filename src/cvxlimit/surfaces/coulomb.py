"""Surfaces without interaction with bending (rocking, sliding, torsion), and sets of them.

Letters: N is compression, V the resultant of shear V1 and V2, M1 and M2 are moments about t1 and
t2, MT is torsion; mu is ``contacts.friction``, c the cohesion ``contacts.cohesion``, A
``contacts.area``, c_T the torsion arm ``contacts.torsion_arm``, a length. All have one entry per
contact.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Literal

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import IntArray
from cvxlimit.base.doors import Door
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.surfaces.base import (
    CONSTANT,
    Condition,
    Norm,
    YieldSurface,
    slip_resistance,
)
from cvxlimit.surfaces.cones import Cone, Conic, Facets, Parabola, parse_cone
from cvxlimit.surfaces.exact_torsion import parabola_arm


class Rocking(YieldSurface):
    """The pressure centre stays inside the contact: no tension, infinite strength (Eq. 9).

    For a rectangle abs(M1) <= N l2 / 2 and abs(M2) <= N l1 / 2; here one row per edge of any
    convex polygon: with the edge's inward normal (a1, a2) and offset b,
    N + (-a1 M2 + a2 M1) / b >= 0, because the pressure centre is (-M2 / N, M1 / N).
    """

    name = "rocking"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        contact, inward, offset = contacts.edges
        inside = {"N": 1, "M2": -inward[:, 0] / offset, "M1": inward[:, 1] / offset}
        result = [Condition((), inside, contact)] if len(contact) else []
        if len(points := np.flatnonzero(contacts.is_point)):
            result.append(Condition((), {"N": contacts.sense[points]}, points))
        return result


class Bounds(YieldSurface):
    """sense N <= most at contacts that are points: reactions and ties.

    :func:`with_bounds` adds it wherever there are any. Rocking states the other bound.
    """

    name = "bounds"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        at = bounded(contacts)
        bounds = {"N": -contacts.sense[at], CONSTANT: contacts.most[at]}
        return [Condition((), bounds, at)] if len(at) else []


class Sliding(YieldSurface):
    """abs(V) <= mu N (Eq. 10; Eq. 11 with facets); mu N + c A with cohesion c."""

    name = "sliding"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [Condition([Norm({"V1": 1}, {"V2": 1})], slip_resistance(contacts))]


class Torsion(YieldSurface):
    """abs(MT) <= c_T mu N (Eq. 17), with c_T of Eq. 16; c_T (mu N + c A) with cohesion c."""

    name = "torsion"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [Condition([Norm({"MT": 1 / contacts.torsion_arm})], slip_resistance(contacts))]


class TorsionShear(YieldSurface):
    """abs(MT) / c_T + abs(V) <= mu N (Eq. 24; Eq. 25 with facets); mu N + c A with cohesion c."""

    name = "torsion-shear"
    implies = frozenset({"sliding", "torsion"})
    torsion_shear = "linear"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        norms = [Norm({"MT": 1 / contacts.torsion_arm}), Norm({"V1": 1}, {"V2": 1})]
        return [Condition(norms, slip_resistance(contacts))]


class ParabolicTorsionShear(YieldSurface):
    """abs(MT) / c <= R - abs(V)^2 / R with R = mu N, and c A added with cohesion.

    For rectangles c is c_T (Eq. 16): the parabola lies between the paper's line (Eq. 24) and the
    exact limit of Eq. 18-21, and takes the time of the line. For other polygons c is the largest
    safe arm, c_T or less, see :func:`~cvxlimit.surfaces.exact_torsion.parabola_arm`.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.surfaces import Rocking
    >>> scene = builtin_scene("tuff-wall")
    >>> round(solve(scene, [Rocking(), ParabolicTorsionShear()]).load_factor, 5)
    0.42308
    """

    name = "parabolic torsion-shear"
    implies = frozenset({"sliding", "torsion"})
    torsion_shear = "parabolic"

    def __init__(self) -> None:
        super().__init__(Parabola())

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / parabola_arm(contacts)})
        return [Condition([size], slip_resistance(contacts))]


def bounded(contacts: Contacts) -> IntArray:
    """Returns the contacts (k,) whose force has an upper bound; all points if that is a
    Parameter."""
    if isinstance(contacts.most, cp.Expression):
        return np.flatnonzero(contacts.is_point)
    return np.flatnonzero(contacts.is_point & np.isfinite(contacts.most))


def with_bounds(surfaces: Sequence[YieldSurface], contacts: Contacts) -> tuple[YieldSurface, ...]:
    """Returns the surfaces, and :class:`Bounds` where contacts need it and they lack it."""
    if len(bounded(contacts)) and Bounds.name not in (surface.name for surface in surfaces):
        return (*surfaces, Bounds())
    return tuple(surfaces)


SurfaceName = Literal[
    "conic", "parabolic",
    "octagon", "8-gon", "12-gon", "16-gon", "24-gon", "32-gon", "48-gon", "64-gon",
    "octagon-inscribed", "8-gon-inscribed", "12-gon-inscribed", "16-gon-inscribed",
    "24-gon-inscribed", "32-gon-inscribed", "48-gon-inscribed", "64-gon-inscribed",
]  # fmt: skip
"""Names of surfaces for type checkers; ``Facets.circumscribed(K)`` is any other polygon."""

PARABOLIC = "parabolic"
"""Torsion and shear on a parabola between the paper's line (Eq. 24) and the exact limit."""

BUILT_IN = {
    kind.name: kind for kind in (Rocking, Sliding, Torsion, TorsionShear, ParabolicTorsionShear)
}

PARABOLIC_SURFACES = (Rocking(), ParabolicTorsionShear())
DEFAULT_SURFACES: tuple[YieldSurface, ...] = (Rocking(), TorsionShear())


def strength_key(surfaces: Sequence[YieldSurface], contacts: Contacts) -> Hashable | None:
    """Returns a key that is equal for the same surfaces of this module on contacts of one geometry
    with the same strengths; None for surfaces and cones that may depend on more."""
    plain = (Rocking, Sliding, Torsion, TorsionShear, Bounds), (Conic, Facets)
    if not all(type(s) in plain[0] and type(s.cone) in plain[1] for s in surfaces):
        return None
    kinds = tuple((type(s), s.cone) for s in surfaces)
    names = (*PROPERTIES, "most") if contacts.is_point.any() else PROPERTIES
    return kinds, *(getattr(contacts, name).tobytes() for name in names)


def refuse_lost_cohesion(surfaces: Sequence[YieldSurface], contacts: Contacts) -> None:
    """Raises ModelError for a user's surface whose resistance to slip leaves out the scene's
    cohesion."""
    for surface in surfaces:
        own = () if type(surface) in BUILT_IN.values() else surface.conditions(contacts)
        slips = [c.resistance for c in own if c.norms and "N" in c.resistance]
        if slips and not any(CONSTANT in resistance for resistance in slips):
            raise ModelError(
                f"surface {surface.name!r} would leave the scene's cohesion out: write "
                'slip_resistance(contacts), of cvxlimit.surfaces, in place of {"N": '
                "contacts.friction}, or take it away with scene.with_cohesion(0)"
            )


def needed_surfaces(surfaces: Sequence[YieldSurface]) -> tuple[YieldSurface, ...]:
    """Returns the surfaces without those that another one of the same cone implies. Cones must be
    the same: facets around a circle do not imply the circle, nor does the circle imply facets
    inside it.

    Raises
    ------
    ModelError
        If rocking is missing or not the built-in one, or a surface is given twice.
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
    implied = [(name, surface.cone) for surface in surfaces for name in surface.implies]
    return tuple([s for s in surfaces if (s.name, s.cone) not in implied])


SURFACES: Mapping[str, Sequence[YieldSurface]] = Door("cvxlimit.surfaces")
"""Sets of surfaces that ``surface`` may name, besides cones, which stand for the paper's."""


def surfaces_of(
    surface: str | Cone | Sequence[YieldSurface],
) -> tuple[tuple[YieldSurface, ...], str]:
    """Returns surfaces and their name, from a name like ``"octagon"``, a cone, or surfaces.

    >>> [name for _, name in map(surfaces_of, ("8-gon", "parabolic", [Rocking(), TorsionShear()]))]
    ['octagon', 'parabolic', 'rocking(conic)+torsion-shear(conic)']
    """
    try:
        cone = parse_cone(surface, SURFACES) if isinstance(surface, str) else surface
    except ModelError:
        if surface in SURFACES:
            return tuple(SURFACES[str(surface)]), str(surface)
        raise
    if isinstance(cone, Cone):
        return (Rocking(), TorsionShear(cone)), str(cone)
    surfaces = tuple(cone) if isinstance(cone, Iterable) else (cone,)
    if not all(isinstance(s, YieldSurface) for s in surfaces):
        raise ModelError(
            "surface must be a name like 'octagon', a Cone, or a list of YieldSurface objects, "
            f"got {surface!r}"
        )
    names = []
    for each in surfaces:
        own = "" if BUILT_IN.get(each.name) in (None, type(each)) else " of one's own"
        names.append(f"{each.name}{own}({each.cone})")
    return surfaces, "+".join(names)


def surfaces_named(name: str, torsion_shear: str = "linear") -> tuple[YieldSurface, ...] | None:
    """Returns the surfaces whose name :func:`surfaces_of` made; None if one is not built in.

    >>> [str(surface.cone) for surface in surfaces_named("rocking(conic)+sliding(octagon)")]
    ['conic', 'octagon']
    >>> surfaces_named("rocking(conic)+a surface of one's own(conic)")
    """
    try:
        if torsion_shear == "exact":
            return (Rocking(),)
        if not name.endswith(")"):
            return surfaces_of(PARABOLIC if torsion_shear == PARABOLIC else name)[0]
        parts = [part.removesuffix(")").split("(") for part in name.split("+")]
        parabolic = ParabolicTorsionShear.name  # It has one cone only, which is not given.
        surfaces = [BUILT_IN[s](*([] if s == parabolic else [parse_cone(c)])) for s, c in parts]
    except (KeyError, ValueError, ModelError):
        return None
    return tuple(surfaces)


def words_of(surfaces: Sequence[YieldSurface], name: str) -> dict[str, str]:
    """Returns the words by which results describe surfaces of a name: that, and what they say of
    torsion and shear."""
    said = next((s.torsion_shear for s in surfaces if s.torsion_shear), "")
    return {"surface": "conic" if name == PARABOLIC else name, "torsion_shear": said}


def _is_cone(name: str) -> bool:
    """True for names of this package's cones, of which nobody else has to be asked."""
    try:
        parse_cone(name)
    except ModelError:
        return False
    return True
