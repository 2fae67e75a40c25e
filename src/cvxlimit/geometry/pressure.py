"""Where contacts are pressed."""

from __future__ import annotations

import numpy as np

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN, Contacts

CARRIES = 1e-6
"""Resistances below this share of the largest contact force count as none: solvers leave 1e-9 to
1e-8 of it in joints that carry nothing, and neither the moments over so little nor the share of so
little mean anything."""


def least_carried(forces: FloatArray) -> float:
    """The force below which a contact counts as carrying nothing, for contact forces (n, 6)."""
    return CARRIES * float(np.abs(forces[:, :3]).max(initial=0.0))


def pressure_centres(contacts: Contacts, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where forces (n, 6) press: (e1, e2) = (-M2, M1) / N (n, 2) in the contact's plane, and (n, 3)
    in space; NaN where a contact carries nothing."""
    normal = forces[:, COLUMN["N"]]
    safe = np.where(normal > least_carried(forces), normal, np.nan)
    centre = np.stack([-forces[:, COLUMN["M2"]], forces[:, COLUMN["M1"]]], axis=1) / safe[:, None]
    return centre, contacts.origin + np.einsum("nk,nkx->nx", centre, contacts.axes[:, :2])
