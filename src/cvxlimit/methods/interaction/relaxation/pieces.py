"""Programs put together from pieces: columns of some copies, and the rows that are theirs alone.

Only the equations of equilibrium have columns of several pieces. So thousands of problems that
differ in a contact or two share all other pieces, and one may start where another one was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise, repeat
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.solvers.interior.iteration import Point

Entry = tuple[IntArray, IntArray, FloatArray]  # rows, columns and values of a sparse matrix


Key = tuple[int, bytes]  # a contact, -1 for none, and what of it


class Shape(NamedTuple):
    """What a piece is made of (equal keys: the same), and how many columns, linear rows and cones
    it has, of one kind after another."""

    key: Key
    columns: tuple[int, ...]
    lines: tuple[int, ...]
    cones: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Piece:
    """Columns with ``counts`` entries each: ``data`` in ``rows``, which are numbered within their
    ``kind``, 0 for equations, 1 for linear rows, 2 for those of cones; and ``forces``, the entries
    that give contact forces."""

    shape: Shape
    counts: IntArray
    data: FloatArray
    rows: IntArray
    kind: NDArray[np.int8]
    forces: Entry


@dataclass(frozen=True, eq=False)
class Halfway:
    """A point on the way to an answer, and the pieces of its problem."""

    shapes: tuple[Shape, ...]
    point: Point


def cut(
    keys: Sequence[Key],
    equations: int,
    kinds: tuple[list[IntArray], list[IntArray], list[IntArray]],
    entries: tuple[list[Entry], list[Entry], list[Entry]],
    forces: list[Entry],
) -> list[Piece]:
    """A piece for every key. ``kinds`` says whose columns, linear rows and cones are, kind by kind
    and by the number of the key; ``entries`` are those of equations, linear rows and cones, which
    have three rows each."""
    of = [np.concatenate(each) for each in kinds]
    places, starts = zip(*(_grouped(each, len(keys)) for each in of), strict=True)
    (column, line, cone), first = places, np.cumsum([0, equations, len(of[1])])
    at = np.arange(equations), line, (3 * cone[:, None] + np.arange(3)).ravel()
    every = [
        (first[kind] + at[kind][rows], column[columns], values)
        for kind, own in enumerate(entries)
        for rows, columns, values in own
    ]
    matrix = stacked(every, (int(first[-1]) + 3 * len(cone), len(column)))
    counts = np.diff(matrix.indptr)
    kind = np.searchsorted(first, matrix.indices, side="right") - 1
    before = np.stack([np.zeros(len(keys), dtype=int), starts[1][:-1], 3 * starts[2][:-1]])
    rows = matrix.indices - first[kind] - before[kind, np.repeat(np.sort(of[0]), counts)]
    kind = kind.astype(np.int8)
    given, columns, values = (np.concatenate(part) for part in zip(*forces, strict=True))
    whose = of[0][columns]
    order = np.argsort(whose, kind="stable")
    given, values = given[order], values[order]
    columns = (column[columns] - starts[0][whose])[order]
    inner = np.searchsorted(whose[order], np.arange(len(keys) + 1))
    sizes = [
        map(tuple, np.stack([np.bincount(k, minlength=len(keys)) for k in each], axis=1).tolist())
        for each in kinds
    ]
    slices = [
        [slice(*ends) for ends in pairwise(each.tolist())]
        for each in (starts[0], matrix.indptr[starts[0]], inner)
    ]
    return [
        Piece(
            Shape(key, *size), counts[a], matrix.data[b], rows[b], kind[b],
            (given[c], columns[c], values[c]),
        )
        for key, *size, a, b, c in zip(keys, *sizes, *slices, strict=True)
    ]  # fmt: skip


class Joined:
    """A program of pieces, with ``equations`` rows that they share."""

    def __init__(self, pieces: Sequence[Piece], equations: int) -> None:
        self.pieces, self.equations = pieces, equations
        self.shapes = tuple(piece.shape for piece in pieces)
        self.ends = _ends(self.shapes)
        self.columns, self.lines, self.cones = (end[-1] for end in self.ends)

    def matrix(self) -> sp.csc_array:
        p, pieces = self.equations, self.pieces
        _, lines, cones = (np.array(end[:-1]) for end in self.ends)
        offset = np.stack([np.zeros_like(lines), p + lines, p + self.lines + 3 * cones])
        every = [(piece.data, piece.rows, piece.kind, piece.counts) for piece in pieces]
        data, rows, kind, counts = map(np.concatenate, zip(*every, strict=True))
        number = np.repeat(np.arange(len(pieces)), [len(part[0]) for part in every])
        indices = (rows + offset[kind, number]).astype(np.int32)
        indptr = np.zeros(self.columns + 1, dtype=np.int32)
        np.cumsum(counts, out=indptr[1:])
        shape = (p + self.lines + 3 * self.cones, self.columns)
        return sp.csc_array((data, indices, indptr), shape)

    def forces(self) -> Entry:
        """The entries that give contact forces (6 n,)."""
        rows, columns, values = zip(*(piece.forces for piece in self.pieces), strict=True)
        offset = np.repeat(self.ends[0][:-1], [len(part) for part in rows])
        return np.concatenate(rows), np.concatenate(columns) + offset, np.concatenate(values)

    def start(self, other: Halfway) -> Point:
        """The point of another problem for this one: a piece has what the same one has there, or
        one of its contact, kind by kind. What is new begins at zero, as far from the cones' edges
        as the others on the mean."""
        point, ends = other.point, _ends(other.shapes)
        match = _matched(self.shapes, other.shapes)
        sizes, others = (
            list(zip(*(shape[1:] for shape in shapes), strict=True))
            for shapes in (self.shapes, other.shapes)
        )
        x = _gathered(point.x, match, ends[0], sizes[0], others[0], [0.0])
        sides = []
        for side in (point.z, point.s):
            lines, cones = np.split(side, [ends[1][-1]])
            mean = float(np.abs(side).mean())
            sides.append(
                np.concatenate(
                    [
                        _gathered(lines, match, ends[1], sizes[1], others[1], [mean]),
                        _gathered(cones, match, ends[2], sizes[2], others[2], [mean, 0.0, 0.0]),
                    ]
                )
            )
        return Point(x, point.y, *sides)


def stacked(entries: list[Entry], shape: tuple[int, int]) -> sp.csc_array:
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    result = sp.csc_array((values, (rows, columns)), shape)
    result.eliminate_zeros()
    return result


def _grouped(of: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Where members are when sorted by group, and where groups start."""
    order = np.argsort(of, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(of))
    return place, np.searchsorted(of[order], np.arange(count + 1))


def _gathered(
    values: FloatArray,
    match: Sequence[int],
    ends: Sequence[int],
    sizes: Sequence[tuple[int, ...]],
    others: Sequence[tuple[int, ...]],
    fresh: list[float],
) -> FloatArray:
    """What matched pieces have of some values, those of member i at len(fresh) i, kind by kind;
    ``fresh`` in what is left."""
    step, found = len(fresh), []
    for k, size in zip(match, sizes, strict=True):
        if k >= 0 and others[k] == size:
            found.append(values[step * ends[k] : step * ends[k + 1]])
            continue
        at = ends[k] if k >= 0 else 0
        for own, other in zip(size, others[k] if k >= 0 else repeat(0), strict=False):
            same = min(own, other)
            found += [values[step * at : step * (at + same)], np.array(fresh * (own - same))]
            at += other
    return np.concatenate(found)


def _ends(shapes: Sequence[Shape]) -> list[list[int]]:
    """Where the columns, linear rows and cones of pieces begin, and the last of them ends."""
    each = zip(*(shape[1:] for shape in shapes), strict=True)
    return [[0, *accumulate(map(sum, sizes))] for sizes in each]


def _matched(own: Sequence[Shape], others: Sequence[Shape]) -> list[int]:
    """Which of the others stands for each piece, -1 for none."""
    number = {shape.key: k for k, shape in enumerate(others)}
    found = [number.get(shape.key, -1) for shape in own]
    spare: dict[int, list[int]] = {}
    for k in sorted(set(range(len(others))).difference(found), reverse=True):
        spare.setdefault(others[k].key[0], []).append(k)
    return [
        k if k >= 0 or not (left := spare.get(shape.key[0])) else left.pop()
        for shape, k in zip(own, found, strict=True)
    ]
