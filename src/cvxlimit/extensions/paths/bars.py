"""Ties and reactions on displaced blocks: forces between two bounds, each as a point of contact.

Each acts on block b along a line n, and its opposite on block a, at a point that moves with the
blocks. It has the greater force the farther it is pushed in, its reach: nothing but its lower bound
short of a seat, all between both bounds at the seat, and its upper bound while it pushes the seat
on. There is no stiffness in it. A reaction acts at a point of b, and its line turns with what it
pushes from: never with the ground. Its reach is how far that point has come against the line, as
block a sees it. A tie's line joins its anchors from b to a, and its reach is its length.

Arrays are over the scene's ties, then the points of its reactions, as among its contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.model.statics import DOF
from cvxlimit.scene import Scene


@dataclass(frozen=True, eq=False)
class Bars:
    """The ties and the reactions of a scene."""

    scene: Scene

    @cached_property
    def contacts(self) -> Contacts:
        """Those among the scene's contacts that are points, as the scene is given."""
        contacts = self.scene.contacts
        return contacts.take(np.flatnonzero(contacts.is_point))

    @cached_property
    def first(self) -> FloatArray:
        """How far they reach in the scene as given."""
        return self.at(Pose.first(self.scene))[2]

    @property
    def is_tie(self) -> BoolArray:
        return np.asarray(np.arange(len(self.contacts)) < len(self.scene.ties))

    def at(self, pose: Pose) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns where they act (k, 3), along which lines (k, 3), and how far they reach (k,)."""
        found, ties = self.contacts, self.scene.ties
        first = found.sense[:, None] * found.axes[:, 2]
        at, n = pose.placed(found.b, found.origin), pose.turned(found.a, first)
        reach = -((pose.origin(found.a, at) - found.origin) * first).sum(axis=1)
        if count := len(ties):
            a, b = found.a[:count], found.b[:count]
            start = pose.placed(a, np.array([tie.start for tie in ties]))
            end = pose.placed(b, np.array([tie.end for tie in ties]))
            at[:count], reach[:count] = 0.5 * (start + end), np.linalg.norm(end - start, axis=1)
            n[:count] = (start - end) / reach[:count, None]
        return at, n, reach

    def least_load(self, pose: Pose) -> FloatArray:
        """Returns what they do to all blocks (B, 6) about their centroids with their least forces
        alone."""
        load, (at, n, _) = np.zeros((len(pose.middle), DOF)), self.at(pose)
        force = self.contacts.least[:, None] * n
        for block, own in ((self.contacts.a, -force), (self.contacts.b, force)):
            turning = np.cross(at - pose.middle[block], own)
            np.add.at(load, block, np.concatenate([own, turning], axis=1))
        return load
