"""Convex problems as files for those who write solvers: CBF, MPS, NumPy archives."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from cvxlimit.arrays import FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.files import write_file

FORMATS = ("cbf", "mps", "npz")


@dataclass(frozen=True, eq=False)
class ProblemFile:
    """min c . x  subject to  b - A x in {0}^zero x R+^nonneg x second-order cones.

    Attributes
    ----------
    name : str
    cost : (n,), matrix : (m, n) sparse array, right : (m,)
        c, A and b.
    zero, nonneg : int
        Rows of equations, and of inequalities after them.
    cones : tuple of int
        Sizes of the second-order cones that follow.
    remarks : tuple of str
        One comment each, in the file.
    """

    name: str
    cost: FloatArray
    matrix: sp.csc_array
    right: FloatArray
    zero: int
    nonneg: int
    cones: tuple[int, ...] = ()
    remarks: tuple[str, ...] = ()

    def write(self, path: str | os.PathLike[str], form: str) -> None:
        """Write it in one of :data:`FORMATS`.

        Raises
        ------
        ModelError
            If the form is MPS, which has no cones, and the problem has some.
        InputError
            If the file cannot be written.
        """
        if form == "mps" and self.cones:
            raise ModelError(
                f"MPS has no second-order cones, {self.name} has {len(self.cones):,}: "
                "choose --surface octagon or another polygon, or --format cbf"
            )
        if form == "npz":
            write_file(Path(path), self._packed())
            return
        lines = self._cbf() if form == "cbf" else self._mps()
        write_file(Path(path), ("\n".join(lines) + "\n").encode("utf-8"))

    def _packed(self) -> bytes:
        file, a = io.BytesIO(), self.matrix
        np.savez_compressed(
            file, c=self.cost, b=self.right, data=a.data, indices=a.indices, indptr=a.indptr,
            shape=a.shape, zero=self.zero, nonneg=self.nonneg,
            cones=np.array(self.cones, dtype=np.int64), remarks=np.array(self.remarks),
        )  # fmt: skip
        return file.getvalue()

    def _cbf(self) -> Iterator[str]:
        """Conic Benchmark Format, version 3: its constraints are A x + b in K."""
        kinds = [("L=", self.zero), ("L+", self.nonneg), *(("Q", size) for size in self.cones)]
        kinds = [(kind, size) for kind, size in kinds if size]
        entries, costs, rights = self.matrix.tocoo(), *map(np.flatnonzero, (self.cost, self.right))
        yield from (f"# {remark}" for remark in self.remarks)
        yield from ("VER", "3", "", "OBJSENSE", "MIN", "")
        yield from ("VAR", f"{len(self.cost)} 1", f"F {len(self.cost)}", "")
        yield from ("CON", f"{len(self.right)} {len(kinds)}")
        yield from (f"{kind} {size}" for kind, size in kinds)
        yield from ("", "OBJACOORD", str(len(costs)))
        yield from (f"{j} {self.cost[j]:.17g}" for j in costs)
        yield from ("", "ACOORD", str(entries.nnz))
        for i, j, value in zip(entries.row, entries.col, entries.data, strict=True):
            yield f"{i} {j} {-value:.17g}"
        yield from ("", "BCOORD", str(len(rights)))
        yield from (f"{i} {self.right[i]:.17g}" for i in rights)

    def _mps(self) -> Iterator[str]:
        """Free MPS; every variable is free, the cost is row ``cost``."""
        yield from (f"* {remark}" for remark in self.remarks)
        yield from (f"NAME {self.name}", "ROWS", " N cost")
        for i in range(len(self.right)):
            yield f" {'E' if i < self.zero else 'L'} r{i}"
        yield "COLUMNS"
        a = self.matrix
        for j, cost in enumerate(self.cost):
            if cost:
                yield f" x{j} cost {cost:.17g}"
            for k in range(a.indptr[j], a.indptr[j + 1]):
                yield f" x{j} r{a.indices[k]} {a.data[k]:.17g}"
        yield "RHS"
        yield from (f" RHS r{i} {self.right[i]:.17g}" for i in np.flatnonzero(self.right))
        yield "BOUNDS"
        yield from (f" FR BND x{j}" for j in range(len(self.cost)))
        yield "ENDATA"
