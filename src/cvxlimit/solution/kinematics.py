"""What joints do in a mechanism, and what they make of sliding: open, slide, twist, dilate."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import compress

import numpy as np

from cvxlimit.base.arrays import SMALL, FloatArray, IntArray
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import rounded, rounded_down

VISIBLE = SMALL
"""Contact rates below this fraction of the largest corner speed are not counted as movement, nor
marked: at the drawn scale they come to a thousandth of the structure's size, one pixel of the
picture. The flow-rule error of a certified mechanism is orders of magnitude smaller."""

FACET_DILATION = 2.0**0.5
"""Sliding on K circumscribed facets dilates up to 1 / cos(pi / K) more than on the cone; K >= 4."""

_NAMED = 5
"""Sliding joints that a sentence names; all are in :attr:`Dilatancy.sliding`."""


class ContactKind(IntEnum):
    """What a contact does in a mechanism."""

    CLOSED = 0
    OPENS = 1
    SLIDES = 2
    TWISTS = 3


@dataclass(frozen=True, eq=False)
class ContactMotion:
    """Relative rates (block b against block a) at n contacts with m corners in all.

    Attributes
    ----------
    opening : (m,)
        Rate along the contact normal at every corner; positive opens.
    slip : (n,)
        Largest rate in the contact plane over the corners.
    twist : (n,)
        Rotation rate about the contact normal, signed.
    widest : (n,)
        Largest opening over the corners.
    kind : (n,)
        :class:`ContactKind` codes.
    """

    opening: FloatArray
    slip: FloatArray
    twist: FloatArray
    widest: FloatArray
    kind: IntArray


def velocity_of(scene: Scene, rates: FloatArray, points: FloatArray, block: IntArray) -> FloatArray:
    """Rate u + r x (p - centroid) of ``points`` (p, 3), each carried by a ``block`` (p,)."""
    centroids = np.array([b.centroid for b in scene.blocks])[block]
    return np.asarray(rates[block, :3] + np.cross(rates[block, 3:], points - centroids))


def corner_speeds(scene: Scene, rates: FloatArray) -> FloatArray:
    """Largest speed over the corners of each block, (n_blocks,), at rates (n_blocks, 6)."""
    corners = [block.vertices for block in scene.blocks]
    count = np.array([*map(len, corners)])
    owner = np.repeat(np.arange(len(count)), count)
    velocity = velocity_of(scene, rates, np.concatenate(corners), owner)
    start = np.cumsum(count) - count
    return np.sqrt(np.maximum.reduceat(np.einsum("ij,ij->i", velocity, velocity), start))


def relative_rates(scene: Scene, rates: FloatArray) -> FloatArray:
    """Rates (n, 6) of block b against block a at every contact's centre, along its axes: two slips,
    the opening, two rotations that open one side, the twist."""
    c = scene.contacts
    one, other = (velocity_of(scene, rates, c.origin, block) for block in (c.a, c.b))
    parts = other - one, rates[c.b, 3:] - rates[c.a, 3:]
    return np.concatenate([np.einsum("nik,nk->ni", c.axes, part) for part in parts], axis=1)


def contact_motion(contacts: Contacts, relative: FloatArray, threshold: float) -> ContactMotion:
    """What each contact does at :func:`relative_rates` (n, 6).

    It is closed when no corner's rate exceeds ``threshold``. Associated sliding dilates: a slip s
    lifts the contact by friction times s. A contact slides or twists when its slip is at least the
    opening that this leaves unexplained, and some corner opens by no more than the dilation (times
    :data:`FACET_DILATION`). Any other that moves opens. It twists, and does not slide, when the
    centre it turns about is no farther off than a corner.
    """
    c = contacts
    at, (x, y) = relative[c.corner_contact], c.corner_xy.T
    opening = at[:, 2] + y * at[:, 3] - x * at[:, 4]
    slip = -c.corner_minimum(-np.hypot(at[:, 0] - y * at[:, 5], at[:, 1] + x * at[:, 5]))
    twist, centre_slip = relative[:, 5], np.hypot(relative[:, 0], relative[:, 1])
    dilation = c.friction * np.maximum(centre_slip, c.torsion_arm * np.abs(twist))
    widest = -c.corner_minimum(-opening)
    reach = -c.corner_minimum(-np.hypot(x, y))
    carried = c.corner_minimum(opening) <= FACET_DILATION * dilation + threshold
    shears = (slip > threshold) & (slip >= widest - dilation) & carried
    kind = np.full(len(c), ContactKind.CLOSED, dtype=np.int64)
    kind[widest > threshold] = ContactKind.OPENS
    shears &= ~c.is_point  # they resist no slip
    kind[shears] = ContactKind.SLIDES
    kind[shears & (centre_slip <= np.abs(twist) * reach)] = ContactKind.TWISTS
    return ContactMotion(opening, slip, twist, widest, kind)


@dataclass(frozen=True)
class Dilatancy:
    """How far a load factor rests on joints that open because they slide.

    Associated friction lifts a joint by the coefficient of friction times its slip, against the
    compression that it bears. Real stone hardly does, so that the live load is spared this work.

    Attributes
    ----------
    share : float
        Power of compressions on the openings that go with sliding, over the power of the live load
        at the load factor: 0 where blocks rock, 1 where they only slide. It is also the relative
        change of the load factor with that of all friction. Infinite where any multiple of the
        live load is carried, and whether without dilatancy is not proved.
    sliding : tuple of str
        Names of the contacts that slide or twist in the mechanism, where ``share`` is above
        :data:`~cvxlimit.base.arrays.SMALL`; else none.
    moving : int
        Joints that open, slide or twist: neither ties nor reactions.
    safe : float
        Load factor below which nothing slides without dilatancy, proved; 0 where none is known.
    slides_at : float or None
        Where any multiple is carried with dilatancy: the lowest load factor found at which joints
        slide without it; None where none is known.

    Example
    -------
    >>> print(Dilatancy(1.18, ("ground-a", "ground-b"), 3))
    2 of 3 moving joints slide: without dilatancy it may fall at less, which method \
'zero-dilatancy' (--method zero-dilatancy) looks for; 1 % less friction would take about 1.18 % \
off the load factor; those that slide: ground-a, ground-b
    """

    share: float
    sliding: tuple[str, ...] = ()
    moving: int = 0
    safe: float = 0.0
    slides_at: float | None = None

    @property
    def is_worth_a_word(self) -> bool:
        """True where the load factor is on the unsafe side by more than is worth a word
        (:data:`~cvxlimit.base.arrays.SMALL`)."""
        return self.share > SMALL

    @property
    def is_all(self) -> bool:
        """True where any multiple of the live load is carried with dilatancy, and without it the
        load slides or nothing is known."""
        return bool(np.isinf(self.share))

    @property
    def known(self) -> str:
        """In two words, where any multiple of the live load is carried with dilatancy."""
        slides_at = self.slides_at
        return "not known" if slides_at is None else f"slides at {rounded(slides_at, 5)}"

    @property
    def row(self) -> str:
        """The verdict in a few words, without names; empty where there is nothing to say, or no
        load factor to say it of."""
        if not self.is_worth_a_word or self.is_all:
            return ""
        slides = f"{len(self.sliding)} of {self.moving} moving joints slide"
        slides += "s" * (len(self.sliding) == 1)
        if not self.sliding:
            slides = "joints slip where they open"
        return f"{slides}: without dilatancy it may fall at less"

    def __str__(self) -> str:
        """One sentence, the verdict first and names last; empty where there is nothing to say."""
        if not self.is_worth_a_word:
            return ""
        named, more = ", ".join(self.sliding[:_NAMED]), len(self.sliding) - _NAMED
        named += f" and {more} more" if more > 0 else ""
        named = f"; those that slide: {named}" if named else ""
        if self.is_all:
            return self._without_limit() + named
        return (
            f"{self.row}, which method 'zero-dilatancy' (--method zero-dilatancy) looks for; "
            f"1 % less friction would take about {self.share:.3g} % off the load factor{named}"
        )

    def _without_limit(self) -> str:
        """The sentence where any multiple of the live load is carried with dilatancy."""
        method = "method 'zero-dilatancy' (--method zero-dilatancy)"
        proved = f"below {float(rounded_down(self.safe, 5)):g} they do not (proved)"
        proved = f", and {proved}" if self.safe > 0.0 else ""
        if self.slides_at is None:
            return (
                "with dilatancy any multiple of the live load is carried; whether joints slide "
                f"without it is not known{proved}: {method} looks for loads at which they do"
            )
        return (
            f"without dilatancy joints slide at a load factor of {rounded(self.slides_at, 5)}, the "
            f"lowest found{proved}, and {method} looks for lower ones; with it any multiple of "
            "the live load is carried, since joints press as hard as it takes"
        )


def dilatancy_of(
    scene: Scene, forces: FloatArray, relative: FloatArray, rates: FloatArray, power: float
) -> Dilatancy:
    """Dilatancy in a mechanism under forces (n, 6) that go with it.

    ``relative`` (n, 6) are the contacts' rates, ``rates`` (free blocks, 6) those of blocks, and
    ``power`` is that of the live load at the load factor.

    Per contact it is the power of compressions on openings, as far as shear and torsion do as much
    on slips: at an optimum they are equal in a joint that slides, and neither does any where it
    rocks. Forces and mechanism of bounds that are apart differ, and stone that crushes takes power
    from compressions: the smaller of the two is what sliding accounts for.
    """
    work = forces * relative
    opened, slid = work[:, 2:5].sum(axis=1), -work[:, [0, 1, 5]].sum(axis=1)
    share = float(np.maximum(np.minimum(opened, slid), 0.0).sum()) / power
    if not share > SMALL:
        return Dilatancy(share)
    return Dilatancy(share, *sliding_joints(scene, relative, rates))


def sliding_joints(
    scene: Scene, relative: FloatArray, rates: FloatArray
) -> tuple[tuple[str, ...], int]:
    """Names of the contacts that slide or twist at rates as in :func:`dilatancy_of`, and how many
    move: of joints, not of ties and reactions."""
    every = np.zeros((len(scene.blocks), 6))
    every[scene.free] = rates
    visible = VISIBLE * float(corner_speeds(scene, every).max())
    kind, names = contact_motion(scene.contacts, relative, visible).kind, scene.contacts.names
    sliding = tuple(compress(names, kind >= ContactKind.SLIDES))
    return sliding, int(((kind != ContactKind.CLOSED) & ~scene.contacts.is_point).sum())
