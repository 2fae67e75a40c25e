"""How contact forces become CVXPY variables: corner compressions, or the six resultants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.statics import corner_map
from cvxlimit.surfaces.coulomb import Rocking

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ForceModel:
    """Variables for all contact forces, and what they mean.

    Attributes
    ----------
    maps : list of (variable, sparse (6 n, size))
        The force vector of Eq. 7 is the sum of ``matrix @ vec(variable)`` (column order).
    components : mapping of component name to expression (n,)
    constraints : list
        What the formulation needs so that every contact is free of tension (rocking).
    """

    maps: list[tuple[cp.Variable, sp.csr_array]]
    components: Mapping[str, cp.Expression]
    constraints: list[cp.Constraint]

    def equilibrium(self, matrix: sp.csr_array) -> cp.Expression:
        """A x as an expression (6 free blocks,)."""
        terms = [
            (matrix @ meaning).tocsr() @ (v if v.ndim == 1 else cp.vec(v, order="F"))
            for v, meaning in self.maps
        ]
        return sum(terms[1:], start=terms[0])

    def values(self) -> FloatArray:
        """Forces (n, 6) of the present solution."""
        total = sum(matrix @ np.asarray(v.value).ravel(order="F") for v, matrix in self.maps)
        return np.asarray(total).reshape(-1, len(COMPONENTS))


Formulation = Callable[[Contacts], ForceModel]


def corner_compressions(contacts: Contacts) -> ForceModel:
    """N, M1, M2 from one compression n >= 0 at every corner of the contact's polygon.

    Rocking (Eq. 9) holds by construction for any convex polygon. The fastest form measured.
    """
    n, corners = len(contacts), len(contacts.corner_xy)
    compression = cp.Variable(corners, nonneg=True, name="n")
    shear = cp.Variable((n, 2), name="V")
    torsion = cp.Variable(n, name="MT")
    whole = corner_map(contacts).tocsc()
    maps = [
        (compression, whole[:, :corners].tocsr()),
        (shear, whole[:, corners : corners + 2 * n].tocsr()),
        (torsion, whole[:, corners + 2 * n :].tocsr()),
    ]
    pressure = maps[0][1]
    components: dict[str, cp.Expression] = {
        c: pressure[COLUMN[c] :: len(COMPONENTS)] @ compression for c in ("N", "M1", "M2")
    }
    components |= {"V1": shear[:, 0], "V2": shear[:, 1], "MT": torsion}
    return ForceModel(maps, components, [])


def resultants(contacts: Contacts) -> ForceModel:
    """The six components of Eq. 1 as variables, and one row per contact edge for rocking."""
    n = len(contacts)
    force = cp.Variable((n, len(COMPONENTS)), name="x")
    components = {name: force[:, COLUMN[name]] for name in COMPONENTS}
    index = np.arange(len(COMPONENTS) * n)
    interleave = sp.csr_array(
        (np.ones(len(index)), (index, n * (index % len(COMPONENTS)) + index // len(COMPONENTS)))
    )
    return ForceModel(
        [(force, interleave)], components, Rocking().constraints(components, contacts)
    )
