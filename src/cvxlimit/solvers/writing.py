"""Cone programs as files: Conic Benchmark Format, MPS, and NumPy arrays."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from cvxlimit.base.files import write_file
from cvxlimit.errors import ModelError
from cvxlimit.solvers.program import ConeProgram

FORMATS = ("cbf", "mps", "npz")


def write_program(
    program: ConeProgram, path: str | os.PathLike[str], form: str, name: str,
    remarks: Sequence[str] = (),
) -> None:  # fmt: skip
    """Writes a program in one of :data:`FORMATS`, with remarks as comments.

    Raises
    ------
    ModelError
        If the form is MPS, which has no cones, and the problem has some.
    InputError
        If the file cannot be written.
    """
    if form == "mps" and program.cones:
        raise ModelError(
            f"MPS has no second-order cones, {name} has {len(program.cones):,}: "
            "choose --surface octagon or another polygon, or --format cbf"
        )
    if form == "npz":
        write_file(Path(path), _packed(program, remarks))
        return
    starts, lines = ("#", _cbf(program)) if form == "cbf" else ("*", _mps(program, name))
    text = "\n".join([*(f"{starts} {remark}" for remark in remarks), *lines])
    write_file(Path(path), f"{text}\n".encode())


def _packed(program: ConeProgram, remarks: Sequence[str]) -> bytes:
    """Returns the program as a compressed file of NumPy arrays."""
    file, a = io.BytesIO(), program.matrix
    np.savez_compressed(
        file, c=program.cost, b=program.right, data=a.data, indices=a.indices, indptr=a.indptr,
        shape=a.shape, zero=program.zero, nonneg=program.nonneg,
        cones=np.array(program.cones, dtype=np.int64), remarks=np.array(remarks),
    )  # fmt: skip
    return file.getvalue()


def _cbf(program: ConeProgram) -> Iterator[str]:
    """Yields lines of the Conic Benchmark Format, version 3, whose constraints are A x + b in K."""
    cost, right, entries = program.cost, program.right, program.matrix.tocoo()
    kinds = [("L=", program.zero), ("L+", program.nonneg), *(("Q", k) for k in program.cones)]
    kinds = [(kind, size) for kind, size in kinds if size]
    costs, rights = map(np.flatnonzero, (cost, right))
    yield from ("VER", "3", "", "OBJSENSE", "MIN", "")
    yield from ("VAR", f"{len(cost)} 1", f"F {len(cost)}", "")
    yield from ("CON", f"{len(right)} {len(kinds)}")
    yield from (f"{kind} {size}" for kind, size in kinds)
    yield from ("", "OBJACOORD", str(len(costs)))
    yield from (f"{j} {cost[j]:.17g}" for j in costs)
    yield from ("", "ACOORD", str(entries.nnz))
    for i, j, value in zip(entries.row, entries.col, entries.data, strict=True):
        yield f"{i} {j} {-value:.17g}"
    yield from ("", "BCOORD", str(len(rights)))
    yield from (f"{i} {right[i]:.17g}" for i in rights)


def _mps(program: ConeProgram, name: str) -> Iterator[str]:
    """Yields lines of free MPS. Every variable is free, and the cost is row ``cost``."""
    yield from (f"NAME {name}", "ROWS", " N cost")
    for i in range(len(program.right)):
        yield f" {'E' if i < program.zero else 'L'} r{i}"
    yield "COLUMNS"
    a = program.matrix
    for j, cost in enumerate(program.cost):
        if cost:
            yield f" x{j} cost {cost:.17g}"
        for k in range(a.indptr[j], a.indptr[j + 1]):
            yield f" x{j} r{a.indices[k]} {a.data[k]:.17g}"
    yield "RHS"
    yield from (f" RHS r{i} {program.right[i]:.17g}" for i in np.flatnonzero(program.right))
    yield "BOUNDS"
    yield from (f" FR BND x{j}" for j in range(len(program.cost)))
    yield "ENDATA"
