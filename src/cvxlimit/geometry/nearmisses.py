"""Joints that are nearly there: what the joint tolerance leaves out by little is reported."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from cvxlimit.base.arrays import ROUNDING, FloatArray

Kind = Literal["gap", "angle", "overlap", "sliver"]


@dataclass(frozen=True, eq=False)
class NearMiss:
    """Two facets that are no contact, by little.

    ``kind``: ``"gap"``, they are apart; ``"angle"``, they open by more than the tolerance;
    ``"overlap"``, in each other, less than what is refused; ``"sliver"``, on a width within the
    tolerance. ``size`` (gap, depth or width) was held against ``allowed``; ``place`` (3,) is the
    middle of the joint that is not there, ``outline`` (k, 3) its corners. Of faces at an angle
    ``gaps`` are the distances at the near and at the far end, ``angle`` is that between them
    (radians), and ``cure`` the joint tolerance that joins them; infinite where none does.
    """

    a: str
    b: str
    kind: Kind
    size: float
    allowed: float
    place: FloatArray
    outline: FloatArray
    gaps: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0
    cure: float = math.inf

    @property
    def factor(self) -> float:
        """How many times off the tolerance it is, from 1; slivers count by how wide they are."""
        share = self.size / self.allowed
        return 2.0 - share if self.kind == "sliver" else share

    @property
    def can_be_joined(self) -> bool:
        """False where faces are too steep to each other for any joint tolerance."""
        return self.kind != "angle" or self.cure < math.inf

    def sentence(self, unit: str = "") -> str:
        unit = f" {unit}" if unit else ""
        size = f"{self.size:.3g}{unit}"
        words = f"an overlap of {size}, joined up to {self.allowed:.3g}"
        if self.kind == "gap":
            words = f"a gap of {size}, joined up to {self.allowed:.3g}"
        elif self.kind == "sliver":
            words = f"a joint {size} wide, kept from {self.allowed:.3g}"
        elif self.kind == "angle":
            cure = "no joint tolerance joins faces that are so steep to each other"
            if self.cure < math.inf:
                cure = f"a joint tolerance of {rounded_up(self.cure)} joins them"
            gaps = (gap if abs(gap) > ROUNDING * self.size else 0.0 for gap in self.gaps)
            near, far = (
                f"{abs(gap):.3g}{unit} {'in each other' if gap < 0.0 else 'apart'}" for gap in gaps
            )
            words = (
                f"faces at an angle of {math.degrees(self.angle):.3g} degrees, {near} at one end "
                f"and {far} at the other, joined up to {self.allowed:.3g}; {cure}"
            )
        return f"{self.a}-{self.b}: {words}"


def rounded_up(length: float) -> str:
    """Three digits, of which the last is rounded up."""
    step = 10.0 ** (math.floor(math.log10(length)) - 2)
    return f"{math.ceil(length / step) * step:.3g}"


def near_miss_sentence(near_misses: Sequence[NearMiss], unit: str = "") -> str:
    """How many there are, the worst, which is the nearest to a joint, and the joint tolerance that
    joins all that any can. Empty without any."""
    if not near_misses:
        return ""
    worst = min(near_misses, key=lambda miss: (miss.kind == "sliver", miss.factor))
    enough, count = cure_of_all(near_misses)
    if len(near_misses) == 1:
        said, all_of_them = f"1 joint is nearly there but is none; {worst.sentence(unit)}", "it"
    else:
        said = (
            f"{len(near_misses)} joints are nearly there but are none; the nearest is "
            f"{worst.sentence(unit)}"
        )
        all_of_them = "all" if count == len(near_misses) else f"{count} of them"
    if not count or (worst.kind == "angle" and len(near_misses) == 1):  # which names its own
        return said
    return f"{said}; a joint tolerance of {rounded_up(enough)} joins {all_of_them}"


def cure_of_all(near_misses: Sequence[NearMiss]) -> tuple[float, int]:
    """The joint tolerance (length) that joins all near misses that any can join, and how many these
    are; 0 without any."""
    cures = [miss.cure for miss in near_misses if miss.kind != "sliver" and miss.cure < math.inf]
    return max(cures, default=0.0), len(cures)
