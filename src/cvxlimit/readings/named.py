"""Readings of Eq. 30 with Eq. 27 beside it, the paper's own among them; all readings by name."""

from __future__ import annotations

from typing import Literal

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import check_choice
from cvxlimit.errors import ModelError
from cvxlimit.readings.moments import INDEPENDENT, SIGNED, Moments, TiedMoments


class SignedTorsionBending(TiedMoments):
    """Signed moments with Eq. 27 beside Eq. 30: abs(MT) <= c mu N, about the contact's own centre.

    The paper updates both in every iteration (its section 4). Statics does not ask for the second:
    torsion about the pressure centre is what friction resists.
    """

    name = "signed-torsion-bending"
    is_limited = True

    def lever(self, e: FloatArray) -> FloatArray:
        return e


class Paper(TiedMoments):
    """abs(MT + s1 abs(e2) V1 + s2 abs(e1) V2) with tied signs, and Eq. 27 beside it.

    Eq. 30 as the paper prints it carries the superscript "tsb,1,2": two functions, like Eq. 24 and
    27, so that its signs change together, with absolute eccentricities. It is not indifferent to
    the frame: a contact's axes turned by 180 degrees about its normal change the signs of V1 and V2
    but not of MT. ``signs`` = (s1, s2) says which of the four choices is meant, for all contacts
    alike; which one the paper's authors made is not known, and none is right. Independent signs
    contain all of them and are the safe reading; signed moments are statics.

    Every state that is admissible with independent signs is so here, for any signs:
    abs(MT) + abs(e2 V1) + abs(e1 V2) <= c (mu N - abs(V)) implies both conditions.

    Example
    -------
    >>> Paper().name, Paper((1, -1)).name
    ('paper', 'paper (+V1 -V2)')
    """

    name = "paper"
    is_limited = True
    caution = (
        "the paper's reading depends on the contacts' axes, which the paper does not state and the "
        "order of the blocks chooses here: others give other factors; moments "
        "'independent' and 'signed' do not depend on them"
    )

    def __init__(self, signs: tuple[int, int] = (1, 1)) -> None:
        if tuple(signs) not in _AXES:
            raise ModelError(f"signs must be two of 1 and -1, got {signs!r}")
        self.signs = signs
        if signs != (1, 1):
            self.name = "paper ({}V1 {}V2)".format(*("+" if s > 0 else "-" for s in signs))

    def lever(self, e: FloatArray) -> FloatArray:
        """(-s2 abs(e1), s1 abs(e2)): MT - d1 V2 + d2 V1 is then the torque."""
        return np.abs(e) * np.array([-self.signs[1], self.signs[0]])


_AXES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Choices of signs: turning a contact's axes by 180 degrees, or mirroring one of them."""

MomentsName = Literal["independent", "signed", "signed-torsion-bending", "paper"]

MOMENTS: dict[str, Moments] = {
    m.name: m for m in (INDEPENDENT, SIGNED, SignedTorsionBending(), Paper())
}
"""By name, as options and files have them."""


def reading_of(name: str) -> Moments | None:
    """The reading that a solution or a result file names, None for one that is not known here.

    Example
    -------
    >>> str(reading_of(Paper((1, -1)).name))
    'paper (+V1 -V2)'
    """
    every = [*MOMENTS.values(), *map(Paper, _AXES)]
    return next((reading for reading in every if reading.name == name), None)


def parse_moments(moments: str | Moments) -> Moments:
    """The reading that is asked for. Raises ModelError for torques other than a lever's, which
    bounds would not know, and for names by which files would take a reading for one of these."""
    if not isinstance(moments, Moments):
        check_choice("moments", moments, MOMENTS)
        return MOMENTS[moments]
    kind, known = type(moments), reading_of(moments.name)
    if known is not None and type(known) is not kind:
        raise ModelError(
            f"moments {moments.name!r} have the name of a reading of this package, for which files "
            "would take them: give them another name"
        )
    is_lever = isinstance(moments, TiedMoments) and kind.torque is TiedMoments.torque
    if known is None and not (is_lever and kind.excess is Moments.excess):
        raise ModelError(
            f"moments {moments.name!r} have a torque of their own, which upper bounds do not know: "
            "derive them from TiedMoments and state a lever"
        )
    return moments
