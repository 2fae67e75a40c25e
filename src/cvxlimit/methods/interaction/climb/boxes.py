"""Boxes of pressure centres, one per contact, that follow a relaxation to admissible forces.

The convex hull of a contact's states pressed within a box holds states that are not admissible; the
smaller the box, the less they exceed Eq. 30. So boxes shrink where the forces of the last
relaxation exceed it, and only there: contacts that are admissible within a large box stay free to
follow the others. While the way is still open (*exploring*) they even grow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.interaction.states.copies import Copies
from cvxlimit.methods.interaction.states.pressure import Pressure
from cvxlimit.methods.interaction.states.support import half_extent

FloatArray = NDArray[np.float64]

_SHRINK, _GROWTH = 0.8, 1.5
"""Factors of a box while exploring. Lower bounds of S12 with signed moments by the factors of the
first eight boxes, 0.6 from there: 0.8 and 1.5 0.17453, 0.8 and 1 0.17399, 0.7 and 1.2 0.17399,
0.6 and 1 0.17396; 0.6 for all contacts alike, as boxes once were, 0.17198."""

_SETTLING = 0.6
"""Factor where boxes only shrink; 0.4 ended at 0.1741 there, and 0.5 took as many solves."""

_OVER = 1e-6
"""Excess of Eq. 30, over the total load, from which a box is too large: what the solvers that lead
the way leave."""

_LARGEST = 2.0
"""Half width of the largest box, in half sides: the whole contact from wherever it is."""

_PRESSED = 1e-7
"""Compression, over the total load, from which a pressure centre means something."""


class Boxes:
    """Boxes about the pressure centres of ``forces`` (n, 6), or about the contacts' centres.

    Attributes
    ----------
    centre : (n, 2) array
        As fractions of :func:`half_extent`.
    size : (n,) array
        To either side, likewise.
    excess, largest : float
        By how much the last forces exceed Eq. 30, summed over all contacts that have boxes and at
        the worst of them, over the total load.
    """

    def __init__(
        self,
        contacts: Contacts,
        moments: Moments,
        force: float,
        forces: FloatArray | None = None,
        size: float = _LARGEST,
    ) -> None:
        self.contacts, self.moments, self.force = contacts, moments, force
        self.half = half_extent(contacts)
        self.centre = np.zeros((len(contacts), 2))
        self.size = np.full(len(contacts), size)
        self.excess = self.largest = np.inf
        if forces is not None:
            self.centre = self.centres(forces, self.centre)

    @property
    def copies(self) -> Copies:
        """The hull of all states within the boxes."""
        reach = self.size[:, None]
        ends = np.stack([self.centre - reach, self.centre + reach], axis=2)
        return self.moments.box_copies(self.contacts, np.clip(ends, -1.0, 1.0))

    def follow(self, forces: FloatArray, *, exploring: bool) -> None:
        """Move to the forces' pressure centres; shrink where they exceed Eq. 30."""
        over = np.maximum(self.moments.excess(forces, self.contacts), 0.0) / self.force
        over[~self.contacts.is_rectangle] = 0.0  # their hull is of the whole contact anyway
        self.excess, self.largest = float(over.sum()), float(over.max())
        self.centre = self.centres(forces, self.centre)
        shrink, growth = (_SHRINK, _GROWTH) if exploring else (_SETTLING, 1.0)
        self.size = np.minimum(np.where(over > _OVER, shrink, growth) * self.size, _LARGEST)

    def centres(self, forces: FloatArray, otherwise: FloatArray) -> FloatArray:
        """Pressure centres (n, 2) as fractions of the half extent; idle contacts keep theirs."""
        at = Pressure.of(forces, self.contacts)
        centre = np.stack([at.e1, at.e2], axis=1) / self.half
        pressed = forces[:, [COLUMN["N"]]] > _PRESSED * self.force
        return np.where(pressed, np.clip(centre, -1.0, 1.0), otherwise)
