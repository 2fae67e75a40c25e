"""A reader of the Conic Benchmark Format, written from its specification: what a stranger reads."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import scipy.sparse as sp


@dataclass
class Cbf:
    """min c . x with A x + b in the cones, in their order; and the file's comments."""

    cost: np.ndarray
    matrix: sp.csr_array
    offset: np.ndarray
    cones: list[tuple[str, int]]
    comments: list[str]


def read_cbf(path: Path) -> Cbf:
    """Sections that free variables and affine constraints need; any other is an error."""
    text = path.read_text("utf-8").splitlines()
    comments = [line[1:].strip() for line in text if line.startswith("#")]
    lines = iter([line for line in text if line.strip() and not line.startswith("#")])
    cost = offset = np.zeros(0)
    matrix, cones = sp.csr_array((0, 0)), []
    for keyword in lines:
        first = next(lines).split()
        if (keyword, first) in (("VER", ["3"]), ("OBJSENSE", ["MIN"])):
            continue
        if keyword == "VAR" and next(lines) == f"F {first[0]}":
            cost = np.zeros(int(first[0]))
        elif keyword == "CON":
            offset = np.zeros(int(first[0]))
            pairs = (line.split() for line in islice(lines, int(first[1])))
            cones = [(kind, int(size)) for kind, size in pairs]
            if sum(size for _, size in cones) != len(offset):
                raise ValueError(f"{path}: the cones have not as many rows as the constraints")
        elif keyword in ("OBJACOORD", "BCOORD", "ACOORD"):
            words = " ".join(islice(lines, int(first[0]))).split()
            table = np.array(words, dtype=float).reshape(int(first[0]), -1)
            at, values = table[:, :-1].astype(np.int64).T, table[:, -1]
            if keyword == "OBJACOORD":
                cost[at[0]] = values
            elif keyword == "BCOORD":
                offset[at[0]] = values
            else:
                matrix = sp.csr_array((values, (at[0], at[1])), (len(offset), len(cost)))
        else:
            raise ValueError(f"{path}: {keyword} {' '.join(first)} was not expected")
    return Cbf(cost, matrix, offset, cones, comments)
