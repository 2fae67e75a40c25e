"""A reader of the Conic Benchmark Format, written from its specification: what a stranger reads."""

from __future__ import annotations

from dataclasses import dataclass
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
        if keyword == "VER":
            assert first == ["3"]
        elif keyword == "OBJSENSE":
            assert first == ["MIN"]
        elif keyword == "VAR":
            assert next(lines).split() == ["F", first[0]]
            cost = np.zeros(int(first[0]))
        elif keyword == "CON":
            offset = np.zeros(int(first[0]))
            pairs = (next(lines).split() for _ in range(int(first[1])))
            cones = [(kind, int(size)) for kind, size in pairs]
            assert sum(size for _, size in cones) == len(offset)
        else:
            entries = [next(lines).split() for _ in range(int(first[0]))]
            values = np.array([float(entry[-1]) for entry in entries])
            at = np.array([[int(i) for i in entry[:-1]] for entry in entries]).T
            if keyword == "OBJACOORD":
                cost[at[0]] = values
            elif keyword == "BCOORD":
                offset[at[0]] = values
            elif keyword == "ACOORD":
                matrix = sp.csr_array((values, (at[0], at[1])), (len(offset), len(cost)))
            else:
                raise ValueError(f"no section {keyword!r} was expected")
    return Cbf(cost, matrix, offset, cones, comments)
