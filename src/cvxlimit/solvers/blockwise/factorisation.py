"""Cholesky-like factorisations of a sparse positive definite matrix whose pattern stays.

Rows come in elimination order already. CHOLMOD, which comes with CVXOPT (GPL), is used when that
is installed: it takes half to a third of SuperLU's time.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.sparse import Solve, factorised

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Factorisation(Protocol):
    """Made for one pattern, given by the rows (entries,) of its compressed columns."""

    def __init__(self, indices: IntArray, indptr: IntArray) -> None: ...

    def factorise(self, data: FloatArray) -> Solve:
        """Solver of the matrix with these entries."""


class SuperLU:
    """SciPy's LU, kept symmetric: no pivoting, no reordering."""

    def __init__(self, indices: IntArray, indptr: IntArray) -> None:
        self.indices, self.indptr = indices.astype(np.int32), indptr.astype(np.int32)

    def factorise(self, data: FloatArray) -> Solve:
        """Solver of the matrix with these entries, in the order of the pattern by columns.

        Raises
        ------
        RuntimeError
            If a pivot is zero.
        """
        n = len(self.indptr) - 1
        return factorised(sp.csc_array((data, self.indices, self.indptr), shape=(n, n)))


class Cholmod:
    """CHOLMOD's supernodal Cholesky through CVXOPT."""

    def __init__(self, indices: IntArray, indptr: IntArray) -> None:
        from cvxopt import cholmod, matrix, spmatrix

        self.cholmod, self.matrix = cholmod, matrix
        n = len(indptr) - 1
        columns = np.repeat(np.arange(n), np.diff(indptr))
        self.is_lower = indices >= columns
        rows = matrix(indices[self.is_lower].astype(np.int64))
        self.lower = spmatrix(1.0, rows, matrix(columns[self.is_lower]), (n, n))
        cholmod.options["supernodal"] = 2
        self.symbolic = cholmod.symbolic(self.lower, p=matrix(np.arange(n)))

    def factorise(self, data: FloatArray) -> Solve:
        """As :meth:`SuperLU.factorise`; the solver holds until the next call.

        Raises
        ------
        ArithmeticError
            If the matrix is not positive definite.
        """
        self.lower.V = self.matrix(data[self.is_lower])
        self.cholmod.numeric(self.lower, self.symbolic)
        return self._solve

    def _solve(self, right: FloatArray) -> FloatArray:
        result = self.matrix(right)
        self.cholmod.solve(self.symbolic, result)
        return np.array(result).reshape(right.shape)


BACKENDS: dict[str, type[Factorisation]] = {"cholmod": Cholmod, "superlu": SuperLU}
"""Factorisations by name."""


def best_backend() -> str:
    """``"cholmod"`` where CVXOPT is installed, ``"superlu"`` elsewhere."""
    return "cholmod" if find_spec("cvxopt") else "superlu"
