"""What holds displaced blocks together besides friction: cohesion, ties and reactions.

Cohesion of a joint is shared by the points at which it touches, and is gone for good once its
blocks have moved against each other, or would move with it. A tie or a reaction
(:mod:`.bars`) is a point of contact with a largest compression: its gap is how far it is short of
its seat, which is as far as it has been pushed in by then. A tie that yields is longer from then
on, until it is stretched by more than it bears: then it is gone. What a reaction pushes with at
least is a load.

Arrays are over J joints with cohesion, and K ties and points of reactions.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.extensions.paths.bars import Bars
from cvxlimit.extensions.paths.configuration import Points
from cvxlimit.extensions.paths.pairs import CLOSED, Pose
from cvxlimit.scene import Scene


@dataclass(frozen=True, eq=False)
class Bonds:
    """The joints whose blocks have not moved against each other, the ties that hold, and reactions.

    Attributes
    ----------
    bars : Bars
    stretch : float
        Share of its length by which a tie can be stretched.
    is_whole : (J,) array of bool
    seat : (K,) array
        The greatest reach of each bar so far; NaN of ties that are gone.
    """

    bars: Bars
    stretch: float
    is_whole: BoolArray
    seat: FloatArray

    @classmethod
    def first(cls, scene: Scene, stretch: float) -> Bonds | None:
        """Returns those of the scene as given, None where it has neither cohesion nor bars."""
        joints, bars = np.flatnonzero(np.asarray(scene.contacts.cohesion) > 0.0), Bars(scene)
        if not (len(joints) or len(bars.contacts)):
            return None
        return cls(bars, stretch, np.ones(len(joints), dtype=bool), bars.first)

    @property
    def _joints(self) -> IntArray:
        return np.flatnonzero(np.asarray(self.bars.scene.contacts.cohesion) > 0.0)

    @property
    def lasts(self) -> bool:
        """True if no joint has cohesion any more, which explicit steps do not know."""
        return not self.is_whole.any()

    @property
    def names(self) -> list[str]:
        """Of the joints, then of the bars."""
        contacts = self.bars.scene.contacts
        joints = [f"cohesion of {contacts.names[j]}" for j in self._joints.tolist()]
        return [*joints, *self.bars.contacts.names]

    def holding(self, pose: Pose) -> Bonds:
        """Returns those that still hold at a pose: all but what came apart on the way there."""
        contacts, bars = self.bars.scene.contacts, self.bars
        owner, x, size = contacts.corner_contact, contacts.corner_points, contacts.typical_size
        moved = np.zeros(len(contacts))
        way = pose.placed(contacts.b[owner], x) - pose.placed(contacts.a[owner], x)
        np.maximum.at(moved, owner, np.linalg.norm(way, axis=1))
        is_torn = bars.at(pose)[2] > (1.0 + self.stretch) * bars.first + CLOSED * size
        return replace(
            self,
            is_whole=self.is_whole & (moved[self._joints] <= CLOSED * size),
            seat=np.where(is_torn & bars.is_tie, np.nan, self.seat),
        )

    def without(self, names: Collection[str]) -> Bonds:
        """Returns those that are not among the ``names``."""
        gone = np.isin(self.names, [*names])
        count = len(self.is_whole)
        seat = np.where(gone[count:], np.nan, self.seat)
        return replace(self, is_whole=self.is_whole & ~gone[:count], seat=seat)

    def after(self, pose: Pose) -> Bonds:
        """Returns those that hold from a pose on, where seats stay as far as they were pushed; a
        prop without a largest force gives way nowhere."""
        reach = np.maximum(self.seat, self.bars.at(pose)[2])
        return replace(self, seat=np.where(np.isfinite(self.bars.contacts.most), reach, self.seat))

    def turned(self, pose: Pose) -> bool:
        """Returns whether blocks have come back, at a pose, from where bars gave way."""
        near, reach = CLOSED * self.bars.scene.contacts.typical_size, self.bars.at(pose)[2]
        return bool(((self.seat - self.bars.first > near) & (self.seat - reach > near)).any())

    def lost(self, later: Bonds) -> tuple[str, ...]:
        """Names of what holds here and not ``later``."""
        gone = np.append(self.is_whole & ~later.is_whole,
                         np.isnan(later.seat) & ~np.isnan(self.seat))  # fmt: skip
        return tuple(
            name for name, is_gone in zip(self.names, gone.tolist(), strict=True) if is_gone
        )

    def yielded(self, later: Bonds) -> float:
        """Returns the work that bars have taken up by giving way until ``later``, besides that of
        what they push with at least."""
        bars = self.bars.contacts
        more = np.where(np.isfinite(bars.most), bars.most - bars.least, 0.0)
        return float(np.nansum(more * (later.seat - self.seat)))

    def on(self, points: Points, touches: BoolArray, pose: Pose) -> Points:
        """Returns points of blocks at a pose with the cohesion of their joints, where they
        ``touches`` (k,), and with a point for each bar whose force is not given."""
        contacts = self.bars.scene.contacts
        cohesion = np.zeros(len(points))
        strength = np.asarray(contacts.cohesion * contacts.area)
        for j in self._joints[self.is_whole].tolist():
            a, b = contacts.a[j], contacts.b[j]
            own = ((points.a == a) & (points.b == b)) | ((points.a == b) & (points.b == a))
            own &= touches
            cohesion[own] += strength[j] / max(int(own.sum()), 1)
        bars = self.bars.contacts
        kept = np.flatnonzero(~np.isnan(self.seat) & (bars.most > bars.least))
        at, n, reach = (each[kept] for each in self.bars.at(pose))
        none = np.zeros(len(kept))
        held = Points(
            bars.a[kept], bars.b[kept], at, np.concatenate([tangents(n), n[:, None]], axis=1),
            self.seat[kept] - reach, np.zeros((len(kept), 2)), none, none,
            bars.most[kept], bars.least[kept], none == 0.0,
        )  # fmt: skip
        return replace(points, cohesion=cohesion).beside(held)


def tangents(n: FloatArray) -> FloatArray:
    """Returns two unit vectors (k, 2, 3) perpendicular to each normal (k, 3), right-handed with
    it."""
    least = np.eye(3)[np.abs(n).argmin(axis=1)]
    first = np.cross(least, n)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(n, first)], axis=1)
