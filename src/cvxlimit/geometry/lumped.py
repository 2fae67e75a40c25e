"""Faces that do not lie in the plane of their contact: how many there are, and by which angle.

A contact has one plane. Faces of curved or slightly inclined surfaces that are lumped into one
contact are taken as parts of that plane; the angle between both tells how much this may matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.base.arrays import SMALL
from cvxlimit.geometry.contacts import Contacts


@dataclass(frozen=True)
class Lumped:
    """How far contacts simplify the blocks' faces; angles are in radians.

    Attributes
    ----------
    faces, contacts : int
        Number of faces that do not lie in their contact's plane, counted at every contact, and
        number of these contacts.
    angle : float
        Largest angle between a face and its contact's plane.
    friction_angle : float
        Smallest friction angle of these contacts.
    contact : str
        Contact at which the angle is the largest share of the friction angle.
    contact_angle, contact_friction_angle : float
        Both angles at that contact.

    Example
    -------
    >>> print(Lumped(8, 2, 0.02, 0.5, "low-up", 0.02, 0.5))
    8 faces at 2 joints are taken as planes that they are not in, turned by up to 1.15 degrees, \
where the friction angle is 28.6 degrees or more (at most 4 % of it, at low-up): this could move \
the load factor by as large a share, under oblique loads by several times that; it is certified \
for the scene as detected
    """

    faces: int
    contacts: int
    angle: float
    friction_angle: float
    contact: str
    contact_angle: float
    contact_friction_angle: float

    @property
    def share(self) -> float:
        """The largest angle over the friction angle at the same contact."""
        if not self.contact_friction_angle > 0.0:
            return np.inf
        return self.contact_angle / self.contact_friction_angle

    @property
    def is_worth_a_word(self) -> bool:
        """True if the load factor could differ noticeably with the faces as they are."""
        return self.share >= SMALL

    def __str__(self) -> str:
        """Returns the finding as a sentence."""
        subject = "1 face at 1 joint is taken as a plane that it is not in"
        if self.faces > 1:
            joints = f"{self.contacts} joint{'s' * (self.contacts > 1)}"
            subject = f"{self.faces} faces at {joints} are taken as planes that they are not in"
        angle, friction = (np.degrees(x) for x in (self.angle, self.friction_angle))
        text = (
            f"{subject}, turned by up to {angle:.3g} degrees, where the friction angle is "
            f"{friction:.3g} degrees or more (at most {100.0 * self.share:.2g} % of it, at "
            f"{self.contact})"
        )
        if not self.is_worth_a_word:
            return text
        return (
            f"{text}: this could move the load factor by as large a share, under oblique loads by "
            "several times that; it is certified for the scene as detected"
        )


def lumped_at(contacts: Contacts) -> Lumped | None:
    """Returns how far ``contacts`` simplify faces; None if all lie in their contacts' planes."""
    rows = np.flatnonzero(contacts.lumped)
    if not len(rows):
        return None
    angle, friction = contacts.turned[rows], np.arctan(contacts.friction[rows])
    worst = int(np.argmax(angle / np.maximum(friction, 1e-300)))
    return Lumped(
        faces=int(contacts.lumped[rows].sum()),
        contacts=len(rows),
        angle=float(angle.max()),
        friction_angle=float(friction.min()),
        contact=contacts.names[rows[worst]],
        contact_angle=float(angle[worst]),
        contact_friction_angle=float(friction[worst]),
    )
