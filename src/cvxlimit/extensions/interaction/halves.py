"""One half of a symmetric scene with interaction: half the problem, bounds of the whole.

Hulls of true states are convex, and safe steps built at a symmetric point are convex and symmetric:
each of these problems has a symmetric solution. Bounds are computed on the whole scene as ever.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import ROUNDING, IntArray
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.assemblage import Reduction
from cvxlimit.readings.moments import Moments
from cvxlimit.reductions.choice import Reductions
from cvxlimit.reductions.mirror import Mirror


@dataclass(frozen=True, eq=False)
class SymmetricHalf:
    """The half of a scene with n contacts on one side of its mirror plane.

    Attributes
    ----------
    kept : (k,), dropped : (n - k,)
        Numbers of the contacts of this half, with those on the plane, and of the other half.
    forces : (6 n, 6 k)
        The map from the forces of the kept contacts to those of all contacts.
    rates : (r, 6 free blocks)
        The r symmetric ways in which blocks move.
    """

    kept: IntArray
    dropped: IntArray
    forces: sp.csr_array
    rates: sp.csr_array

    @classmethod
    def of(cls, found: Reductions, moments: Moments) -> SymmetricHalf | None:
        """The half of a scene, or None where it does not pay or is not valid: without a mirror
        plane, in planar scenes, if the reading of Eq. 30 depends on the side, and with contacts
        that are no rectangles, whose arms rather than the problems take the time."""
        mirror, contacts, whole = found.mirror, found.assemblage.contacts, found.best()
        if mirror is None or found.plane is not None or not contacts.is_rectangle.all():
            return None
        if whole.forces is None or whole.rates is None:
            return None
        if not _is_indifferent(moments, mirror, contacts):
            return None
        dropped = np.setdiff1d(np.arange(len(contacts)), whole.kept)
        return cls(whole.kept, dropped, whole.forces, whole.rates)

    def reduction(self, whole: Reduction) -> Reduction:
        """Returns the reduction of a full model to this half."""
        contacts, kept = whole.contacts.take(self.kept), self.kept
        return replace(whole, contacts=contacts, kept=kept, forces=self.forces, rates=self.rates)


def _is_indifferent(moments: Moments, mirror: Mirror, contacts: Contacts) -> bool:
    """True if Eq. 30 is exceeded by as much after forces are mirrored. They are random: a reading
    that depends on the side differs there almost surely."""
    random = np.random.default_rng(0)
    forces = random.normal(size=(len(contacts), len(COMPONENTS)))
    forces[:, COLUMN["N"]] = np.abs(forces[:, COLUMN["N"]])
    forces[:, COLUMN["M1"] :] *= 0.3 * np.sqrt(contacts.area)[:, None]
    image = np.empty_like(forces)
    image[mirror.contacts] = np.einsum("nij,nj->ni", mirror.carried, forces)
    one = moments.excess(forces, contacts)
    other = moments.excess(image, contacts)[mirror.contacts]
    return bool(np.abs(one - other).max() <= ROUNDING * np.abs(one).max())
