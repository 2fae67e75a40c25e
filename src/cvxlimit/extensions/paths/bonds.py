"""What holds displaced blocks together besides friction: cohesion, and ties.

Cohesion of a joint is shared by the points at which it touches, and is gone for good once its
blocks have moved against each other, or would move with it. A tie is a straight member between two
points of blocks: a point of contact whose compression is the tie's tension, whose normal points
along the tie from b to a, and whose gap is what the tie is slack by, with a largest force. It
yields at its strength and is longer from then on, until it is stretched by more than it bears: then
it is gone.

Arrays are over J joints with cohesion, and T ties.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.extensions.paths.configuration import CLOSED, Points
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.scene import Scene


@dataclass(frozen=True, eq=False)
class Bonds:
    """The joints whose blocks have not moved against each other, and the ties that hold.

    Attributes
    ----------
    scene : Scene
    stretch : float
        Share of its length by which a tie can be stretched.
    is_whole : (J,) array of bool
    length : (T,) array
        The greatest length of each tie so far; NaN of those that are gone.
    """

    scene: Scene
    stretch: float
    is_whole: BoolArray
    length: FloatArray

    @classmethod
    def first(cls, scene: Scene, stretch: float) -> Bonds | None:
        """Returns those of the scene as given, None where it has neither cohesion nor ties."""
        joints = np.flatnonzero(np.asarray(scene.contacts.cohesion) > 0.0)
        if not (len(joints) or scene.ties):
            return None
        lengths = np.array([tie.length for tie in scene.ties])
        return cls(scene, stretch, np.ones(len(joints), dtype=bool), lengths)

    @cached_property
    def _joints(self) -> IntArray:
        return np.flatnonzero(np.asarray(self.scene.contacts.cohesion) > 0.0)

    @cached_property
    def _ends(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Blocks a and b of the ties, and their anchors on both at first (T, 3)."""
        number = {block.id: i for i, block in enumerate(self.scene.blocks)}
        ties = self.scene.ties
        blocks = np.array([(number[tie.a], number[tie.b]) for tie in ties], int).reshape(-1, 2)
        anchors = np.array([(tie.start, tie.end) for tie in ties]).reshape(-1, 2, 3)
        return blocks[:, 0], blocks[:, 1], anchors[:, 0], anchors[:, 1]

    @property
    def names(self) -> list[str]:
        """Of the joints, then of the ties."""
        contacts, count = self.scene.contacts, len(self.scene.ties)
        joints = [f"cohesion of {contacts.names[j]}" for j in self._joints.tolist()]
        return joints + [contacts.names[j] for j in np.flatnonzero(contacts.is_point)[:count]]

    def _lines(self, pose: Pose) -> tuple[FloatArray, FloatArray]:
        """Both anchors of the ties (T, 3) at a pose."""
        a, b, start, end = self._ends
        return pose.placed(a, start), pose.placed(b, end)

    def holding(self, pose: Pose) -> Bonds:
        """Returns those that still hold at a pose: all but what came apart on the way there."""
        contacts, size = self.scene.contacts, self.scene.contacts.typical_size
        owner, x = contacts.corner_contact, contacts.corner_points
        moved = np.zeros(len(contacts))
        way = pose.placed(contacts.b[owner], x) - pose.placed(contacts.a[owner], x)
        np.maximum.at(moved, owner, np.linalg.norm(way, axis=1))
        start, end = self._lines(pose)
        first = np.array([tie.length for tie in self.scene.ties])
        most = (1.0 + self.stretch) * first + CLOSED * size
        is_torn = np.linalg.norm(end - start, axis=1) > most
        return replace(
            self,
            is_whole=self.is_whole & (moved[self._joints] <= CLOSED * size),
            length=np.where(is_torn, np.nan, self.length),
        )

    def without(self, names: Collection[str]) -> Bonds:
        """Returns those that are not among the ``names``."""
        gone = np.isin(self.names, [*names])
        count = len(self.is_whole)
        length = np.where(gone[count:], np.nan, self.length)
        return replace(self, is_whole=self.is_whole & ~gone[:count], length=length)

    def after(self, pose: Pose) -> Bonds:
        """Returns those that hold from a pose on, where ties that have yielded stay longer."""
        start, end = self._lines(pose)
        return replace(self, length=np.maximum(self.length, np.linalg.norm(end - start, axis=1)))

    def lost(self, later: Bonds) -> tuple[str, ...]:
        """Names of what holds here and not ``later``."""
        gone = np.append(self.is_whole & ~later.is_whole,
                         np.isnan(later.length) & ~np.isnan(self.length))  # fmt: skip
        return tuple(
            name for name, is_gone in zip(self.names, gone.tolist(), strict=True) if is_gone
        )

    def stretched(self, later: Bonds) -> float:
        """Returns the work that ties have taken up by yielding until ``later``."""
        most = np.array([tie.yield_force for tie in self.scene.ties])
        return float(np.nansum(most * (later.length - self.length)))

    def on(self, points: Points, touches: BoolArray, pose: Pose) -> Points:
        """Returns points of blocks at a pose with the cohesion of their joints, where they
        ``touches`` (k,), and with a point for each tie."""
        contacts = self.scene.contacts
        cohesion = np.zeros(len(points))
        strength = np.asarray(contacts.cohesion * contacts.area)
        for j in self._joints[self.is_whole].tolist():
            a, b = contacts.a[j], contacts.b[j]
            own = ((points.a == a) & (points.b == b)) | ((points.a == b) & (points.b == a))
            own &= touches
            cohesion[own] += strength[j] / max(int(own.sum()), 1)
        kept = np.flatnonzero(~np.isnan(self.length))
        a, b = self._ends[0][kept], self._ends[1][kept]
        start, end = (each[kept] for each in self._lines(pose))
        along = np.linalg.norm(end - start, axis=1)
        n = (start - end) / along[:, None]
        most = np.array([self.scene.ties[i].yield_force for i in kept.tolist()])
        ties = Points(
            a, b, 0.5 * (start + end), np.concatenate([tangents(n), n[:, None]], axis=1),
            self.length[kept] - along, np.zeros((len(kept), 2)), np.zeros(len(kept)),
            most=most,
        )  # fmt: skip
        return replace(points, cohesion=cohesion).beside(ties)


def tangents(n: FloatArray) -> FloatArray:
    """Returns two unit vectors (k, 2, 3) perpendicular to each normal (k, 3), right-handed with
    it."""
    least = np.eye(3)[np.abs(n).argmin(axis=1)]
    first = np.cross(least, n)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(n, first)], axis=1)
