"""The bracket of a load factor: two bounds, what they rest on, and the arithmetic of both."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context
from functools import partial
from typing import Self

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray, IntArray

TOLERANCE = 1e-5
"""Default width of the bracket, relative to its upper end; what is less of a load factor is not
worth a word. Lower bounds below this share of :attr:`Bracket.least` are zero but for rounding:
forces count as balanced with residuals of 1e-11 of the loads, and :attr:`Bracket.least` is a
millionth of these."""

REFERENCE = 10.0
"""Where a bound needs an assumption, it is that no contact force of the exact solution exceeds
this multiple of the total load or of the largest force given, and no rate this multiple of the
given mechanism's largest."""


@dataclass(frozen=True)
class Bracket:
    """Bounds on one load factor; every method, report and picture uses this one.

    Attributes
    ----------
    lower, upper : float
        Static and kinematic bound; infinite where there is none.
    lower_is_proved, upper_is_proved : bool
        True if the bound needs no assumption, up to rounding.
    least : float
        Smallest size by which widths are measured: a bracket that holds zero has no relative
        width of its own. See :attr:`cvxlimit.model.statics.Scaling.least`.

    Example
    -------
    >>> bracket = Bracket().raised(0.375, True).lowered(0.5, True)
    >>> bracket.is_within(0.3), bracket.is_within(0.2), str(bracket)
    (True, False, '[0.375, 0.5]')
    """

    lower: float = -np.inf
    upper: float = np.inf
    lower_is_proved: bool = False
    upper_is_proved: bool = False
    least: float = 0.0

    def raised(self, lower: float, is_proved: bool) -> Self:
        """Returns the bracket with a better lower bound; a lower one changes nothing."""
        if not lower > self.lower:
            return self
        return replace(self, lower=float(lower), lower_is_proved=is_proved)

    def lowered(self, upper: float, is_proved: bool) -> Self:
        """Returns the bracket with a better upper bound; a higher one changes nothing, unless it
        proves an equal one."""
        proof = self.unit * ROUNDING if is_proved and not self.upper_is_proved else 0.0
        if not upper < self.upper + proof:
            return self
        return replace(self, upper=float(upper), upper_is_proved=is_proved)

    @property
    def turned(self) -> Bracket:
        """The bracket of the same factor with its sign turned.

        >>> print(Bracket(0.25, 0.5).turned)
        [-0.5, -0.25]
        """
        proofs = self.upper_is_proved, self.lower_is_proved
        return Bracket(-self.upper, -self.lower, *proofs, self.least)

    def shifted(self, by: float) -> Bracket:
        """The bracket of a factor that is so much larger.

        >>> print(Bracket(0.25, 0.5).shifted(1.0))
        [1.25, 1.5]
        """
        proofs = self.lower_is_proved, self.upper_is_proved
        return Bracket(self.lower + by, self.upper + by, *proofs, self.least)

    @property
    def has_both(self) -> bool:
        """True if both bounds are finite."""
        return bool(np.isfinite(self.lower) and np.isfinite(self.upper))

    @property
    def has_any(self) -> bool:
        """True if a bound is finite."""
        return bool(np.isfinite(self.lower) or np.isfinite(self.upper))

    @property
    def is_below_zero(self) -> bool:
        """True if not even the dead load alone is carried: upper bound below zero and rounding."""
        return self.upper < -self.least

    @property
    def unit(self) -> float:
        """What widths are relative to: the larger bound, or :attr:`least` where zero is inside, or
        outside by no more than the residual of equilibrium that counts as rounding."""
        finite = filter(np.isfinite, (abs(self.lower), abs(self.upper)))
        least = 0.0 if self.lower > TOLERANCE * self.least else self.least
        return max([*finite, least, 1e-300])

    @property
    def width(self) -> float:
        """Upper less lower bound over :attr:`unit`; infinite without both."""
        return (self.upper - self.lower) / self.unit if self.has_both else float("inf")

    @property
    def contradicts(self) -> bool:
        """True if the lower bound exceeds the upper one by more than rounding."""
        return self.width < -ROUNDING

    @property
    def is_proved(self) -> bool:
        """True if neither bound needs an assumption."""
        return self.lower_is_proved and self.upper_is_proved

    @property
    def basis(self) -> str:
        """What the bounds that exist rest on, in a sentence.

        >>> Bracket(0.1, 0.2, True, True).basis, Bracket(0.1, lower_is_proved=True).basis
        ('both bounds are proved, up to rounding', 'the lower bound is proved, up to rounding')
        """
        sides = {
            "lower": f"no block moves more than {REFERENCE:g} times as fast at collapse as the "
            "fastest of the mechanism found",
            "upper": f"no contact bears more than {REFERENCE:g} times the total load, or "
            f"{REFERENCE:g} times the largest force found",
        }
        known = [side for side in sides if np.isfinite(getattr(self, side))]
        assumed = [side for side in known if not getattr(self, f"{side}_is_proved")]
        if known and not assumed:
            proved = "both bounds are" if len(known) == 2 else f"the {known[0]} bound is"
            return f"{proved} proved, up to rounding"
        return " and ".join(f"the {side} bound holds if {sides[side]}" for side in assumed)

    def is_within(self, tolerance: float) -> bool:
        """True if the bracket is no wider than ``tolerance`` and does not contradict itself."""
        return abs(self.width) <= tolerance and not self.contradicts

    def error(self, load_factor: float | None) -> float | None:
        """Largest relative error that ``load_factor`` may have, the truth being inside.

        >>> Bracket(0.99, 1.0).error(1.01), Bracket(0.99).error(1.01)
        (0.02, None)
        """
        if load_factor is None or not self.has_both:
            return None
        worst = max(abs(load_factor - self.lower), abs(load_factor - self.upper))
        return round(worst, 15) / self.unit

    def clipped(self, load_factor: float) -> float:
        """The nearest load factor inside."""
        return float(np.clip(load_factor, self.lower, max(self.lower, self.upper)))

    def shown(self, digits: int) -> str:
        """Shows both ends, rounded outwards to so many digits; ``unbounded`` and ``none`` where
        any multiple is carried, or none is, and ``?`` for an end that is not known.

        >>> Bracket(0.4230561, 0.4230593).shown(5)
        '[0.42305, 0.42306]'
        >>> Bracket(float("inf"), float("inf")).shown(5), Bracket(0.1).shown(5)
        ('unbounded', '[0.10000, ?]')
        """
        if self.lower == np.inf or self.upper == -np.inf:
            return "unbounded" if self.lower == np.inf else "none"
        return f"[{rounded_down(self.lower, digits)}, {rounded_up(self.upper, digits)}]"

    def __str__(self) -> str:
        return self.shown(7)


@dataclass(frozen=True)
class Certificate(Bracket):
    """A bracket, and the residuals it was computed from.

    Attributes
    ----------
    equilibrium_residual, yield_excess : float
        Largest over blocks and contacts, in units of the total load (moments over the typical
        contact size).
    flow_violation : float
        Largest missing opening at a contact over the mechanism's largest rate.
    missing_opening : float
        Sum of the missing openings at contacts, for live power 1: contact forces below its
        reciprocal cannot take up that power.
    """

    equilibrium_residual: float = np.nan
    yield_excess: float = np.nan
    flow_violation: float = np.nan
    missing_opening: float = np.nan


@dataclass(frozen=True, eq=False)
class Reference:
    """What both bounds were computed with beside forces and mechanism, and depend on a little.

    None of it is believed: who computes the bounds again checks whether it is what it should be.

    Attributes
    ----------
    load_factor : float or None
        For which the forces were put into equilibrium: the solver's, which the bracket may clip.
    forces : (contacts, 6) or (p,) array, or None
        Forces strictly inside all surfaces that carry the dead load, with a part of the live load
        where it does not stand alone; internal ones where strength is stated in these. None where
        projections found them, which find them again.
    rates : (free blocks, 6) array or None
        Rates that open every contact; None where projections found them.
    """

    load_factor: float | None = None
    forces: FloatArray | None = field(default=None, repr=False)
    rates: FloatArray | None = field(default=None, repr=False)

    @property
    def turned(self) -> Reference:
        """The same of the live load turned round."""
        return replace(self, load_factor=None if self.load_factor is None else -self.load_factor)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a bound is proved by: numbers that anybody can check on the scene, however they were
    found. See :attr:`Solution.evidence <cvxlimit.solution.Solution.evidence>`.

    With weights A, loads f and a load factor alpha, forces x with A x + f_dead + alpha f_live = 0
    that no contact refuses prove that alpha is carried, and rates u with f_live . u = 1 that the
    flow rule allows that no more is than what contacts take up in them, less f_dead . u.

    Attributes
    ----------
    load_factor : float or None
        Which the forces carry.
    forces : (contacts, 6) array or None
        V1, V2, N, M1, M2, MT on block b of each contact, user's units.
    rates : (free blocks, 6) array or None
        ux, uy, uz, rx, ry, rz at the centroids, scaled to live power 1.
    internal : (p,) array or None
        Internal forces, where strength is stated in these.
    reference : Reference or None
        A state inside (its ``forces``) and an opening field (its ``rates``): a little of them makes
        up for what rounding leaves of forces and rates.
    cells : (contacts,) array or None
        Cells across each contact at whose centroids friction acts, where internal forces are those
        of such points.
    contacts : (k,) array or None
        Whose least thrusts are proved by rates: ``rates`` (k times free blocks, 6) then.
    until : float or None
        Load factor up to which the friction of least thrusts excludes every solution without
        dilatancy.
    """

    load_factor: float | None = None
    forces: FloatArray | None = field(default=None, repr=False)
    rates: FloatArray | None = field(default=None, repr=False)
    internal: FloatArray | None = field(default=None, repr=False)
    reference: Reference | None = field(default=None, repr=False)
    cells: IntArray | None = field(default=None, repr=False)
    contacts: IntArray | None = field(default=None, repr=False)
    until: float | None = None


def rounded(value: float, digits: int = 7, rounding: str = ROUND_HALF_EVEN) -> str:
    """The nearest number with so many digits as text; ``?`` where there is none."""
    if not np.isfinite(value):
        return "?"
    exact = float(value) + 0.0  # no minus zero
    return f"{Context(prec=digits, rounding=rounding).create_decimal_from_float(exact):g}"


rounded_down = partial(rounded, rounding=ROUND_FLOOR)
"""A lower bound as text that is no larger."""

rounded_up = partial(rounded, rounding=ROUND_CEILING)
"""An upper bound as text that is no smaller."""


def known(value: float) -> float | None:
    """A figure as it goes into histories and tables: None where it is not finite."""
    return float(value) if np.isfinite(value) else None
