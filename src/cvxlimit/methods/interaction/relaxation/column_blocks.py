"""Programs put together from pieces: columns of some disjuncts, and the rows that are theirs alone.

Only the equations of equilibrium have columns of several pieces. So thousands of problems that
differ in a contact or two share all other pieces, and one may start where another one was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.sinks import Rows
from cvxlimit.solvers.interior import Point

Entry = tuple[IntArray, IntArray, FloatArray]  # rows, columns and values of a sparse matrix


Key = tuple[int, bytes]  # a contact, -1 for none, and what of it


class Members(NamedTuple):
    """Whose a piece's columns, linear rows and cones are: of which kind, and of which of the
    disjuncts with these ``names``, which begin with their contact. Equal keys are those of equal
    pieces."""

    key: Key
    names: list[bytes]
    columns: IntArray
    lines: IntArray
    cones: IntArray


@dataclass(frozen=True, eq=False)
class ColumnBlock:
    """Columns with ``counts`` entries each: ``data`` in ``rows``, which are numbered within their
    ``kind``, 0 for equations, 1 for linear rows, 2 for those of cones; and ``forces``, the entries
    that give contact forces."""

    members: Members
    counts: IntArray
    data: FloatArray
    rows: IntArray
    kind: NDArray[np.int8]
    forces: Entry


@dataclass(frozen=True, eq=False)
class Halfway:
    """A point on the way to an answer, and whose its numbers are."""

    members: tuple[Members, ...]
    point: Point


def cut(
    keys: Sequence[Key],
    unit: IntArray,
    names: Sequence[bytes],
    kinds: tuple[list[IntArray], list[IntArray], list[IntArray]],
    stated: Rows,
    forces: Entry,
) -> list[ColumnBlock]:
    """A piece for every key, of the disjuncts whose ``unit`` (k,) is its number. ``kinds`` says
    whose columns, linear rows and cones are, kind by kind, as they were ``stated``; cones have
    three rows each."""
    equations = sum(form.size for form in stated.equations)
    of = [unit[np.concatenate(each)] for each in kinds]
    places, starts = zip(*(_grouped(each, len(keys)) for each in (*of, unit)), strict=True)
    (column, line, cone, disjunct), first = places, np.cumsum([0, equations, len(of[1])])
    triples = first[2] + (3 * cone[:, None] + np.arange(3)).ravel()
    at = np.concatenate([np.arange(equations), equations + line, triples])
    entries, _ = stated.entries()
    every = [(at[rows], column[columns], values) for rows, columns, values, _ in entries]
    matrix = stacked(every, (len(at), len(column)))
    counts = np.diff(matrix.indptr)
    kind = np.searchsorted(first, matrix.indices, side="right") - 1
    before = np.stack([np.zeros(len(keys), dtype=int), starts[1][:-1], 3 * starts[2][:-1]])
    rows = matrix.indices - first[kind] - before[kind, np.repeat(np.sort(of[0]), counts)]
    kind = kind.astype(np.int8)
    given, columns, values = forces
    whose = of[0][columns]
    order = np.argsort(whose, kind="stable")
    given, values = given[order], values[order]
    columns = (column[columns] - starts[0][whose])[order]
    inner = np.searchsorted(whose[order], np.arange(len(keys) + 1))
    labels = [
        _labels(each, disjunct - starts[3][unit], place)
        for each, place in zip(kinds, places[:3], strict=True)
    ]
    called = [names[k] for k in np.argsort(disjunct).tolist()]
    slices = [
        [slice(*ends) for ends in pairwise(each.tolist())]
        for each in (*starts, matrix.indptr[starts[0]], inner)
    ]
    return [
        ColumnBlock(
            Members(key, called[d], labels[0][a], labels[1][b], labels[2][c]),
            counts[a], matrix.data[e], rows[e], kind[e], (given[f], columns[f], values[f]),
        )
        for key, a, b, c, d, e, f in zip(keys, *slices, strict=True)
    ]  # fmt: skip


_CONTACT = 8
"""Bytes of a disjunct's name that are its contact."""

_KIND = 1 << 24
"""More disjuncts than a problem has: labels are a kind times this plus the number of a disjunct."""


def _labels(kinds: list[IntArray], disjunct: IntArray, place: IntArray) -> IntArray:
    result = np.empty(len(place), dtype=int)
    result[place] = np.concatenate([_KIND * k + disjunct[each] for k, each in enumerate(kinds)])
    return result


class Columns:
    """A program of pieces, with ``equations`` rows that they share."""

    def __init__(self, pieces: Sequence[ColumnBlock], equations: int) -> None:
        self.pieces, self.equations = pieces, equations
        self.members = tuple(piece.members for piece in pieces)
        self.starts = [_starts(self.members, k) for k in range(2, 5)]
        self.columns, self.lines, self.cones = (start[-1] for start in self.starts)

    def matrix(self) -> sp.csc_array:
        p, pieces = self.equations, self.pieces
        _, lines, cones = (np.array(start[:-1]) for start in self.starts)
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
        offset = np.repeat(self.starts[0][:-1], [len(part) for part in rows])
        return np.concatenate(rows), np.concatenate(columns) + offset, np.concatenate(values)

    def start(self, other: Halfway) -> Point:
        """The point of another problem for this one, where it has what this one has. What is new
        begins at zero, as far from the cones' edges as the others on the mean."""
        point, alike = other.point, _Alike(self.members, other.members)
        columns, lines, cones = (alike.places(kind) for kind in range(2, 5))
        first = sum(len(each.lines) for each in other.members)
        triples = np.where(cones[:, None] < 0, -1, first + 3 * cones[:, None] + np.arange(3))
        rows = np.concatenate([lines, triples.ravel()])
        top = np.concatenate([np.ones(len(lines)), np.tile([1.0, 0.0, 0.0], len(cones))])
        z, s = (
            np.where(rows < 0, float(np.abs(v).mean()) * top, v[rows]) for v in (point.z, point.s)
        )
        return Point(np.where(columns < 0, 0.0, point.x[columns]), point.y, z, s)


def stacked(entries: list[Entry], shape: tuple[int, int]) -> sp.csc_array:
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    result = sp.csc_array((values, (rows, columns)), shape)
    result.eliminate_zeros()
    return result


def _grouped(of: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Returns where members are when sorted by group, and where groups start."""
    order = np.argsort(of, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(of))
    return place, np.searchsorted(of[order], np.arange(count + 1))


def _starts(members: Sequence[Members], field: int) -> list[int]:
    """Returns where each one's part of a field begins, and the last of them ends."""
    return [0, *accumulate(len(each[field]) for each in members)]


class _Alike:
    """Which of ``others`` stands for what in ``own``: equal pieces for all of each other; of what
    is left the same disjunct, or the first one left of the same contact."""

    def __init__(self, own: Sequence[Members], others: Sequence[Members]) -> None:
        self.own, self.others = own, others
        known = {each.key: k for k, each in enumerate(others)}
        self.twin = np.array([known.get(each.key, -1) for each in own])
        self.new = [each for each, twin in zip(own, self.twin.tolist(), strict=True) if twin < 0]
        self.left = np.setdiff1d(np.arange(len(others)), self.twin)
        self.spare = [others[k] for k in self.left.tolist()]
        self.match = _matched(self.new, self.spare)

    def places(self, field: int) -> IntArray:
        """Returns where each one's members are among the others', -1 for nowhere."""
        own, others = (np.array(_starts(every, field)) for every in (self.own, self.others))
        counts = np.diff(own)
        place = np.arange(own[-1]) + np.repeat(others[self.twin] - own[:-1], counts)
        found = _placed(self.new, self.spare, field, self.match)
        ends = zip(others[self.left].tolist(), others[self.left + 1].tolist(), strict=True)
        at = np.concatenate([*(np.arange(*each) for each in ends), [-1]])
        place[np.repeat(self.twin < 0, counts)] = at[found]
        return place


def _matched(own: Sequence[Members], others: Sequence[Members]) -> IntArray:
    """Which of the others' disjuncts stands for each disjunct; for none the one after the last."""
    left: dict[bytes, dict[bytes, int]] = {}  # by contact, and by name
    for number, name in enumerate(name for each in others for name in each.names):
        left.setdefault(name[:_CONTACT], {})[name] = number
    none = _starts(others, 1)[-1]
    return np.array([k for each in own for k in _taken(each.names, left, none)], dtype=int)


def _taken(names: list[bytes], left: dict[bytes, dict[bytes, int]], none: int) -> list[int]:
    own = [left.get(name[:_CONTACT], {}) for name in names]
    found = [here.pop(name, none) for name, here in zip(names, own, strict=True)]
    return [
        here.pop(next(iter(here))) if number == none and here else number
        for number, here in zip(found, own, strict=True)
    ]


def _placed(
    own: Sequence[Members], others: Sequence[Members], field: int, match: IntArray
) -> IntArray:
    """Returns where the members of all kinds are among the others', -1 for nowhere."""
    kind, disjunct = _split(own, field)
    other_kind, other_disjunct = _split(others, field)
    kinds = int(max(kind.max(initial=0), other_kind.max(initial=0))) + 1
    place = np.full((kinds, _starts(others, 1)[-1] + 1), -1)
    place[other_kind, other_disjunct] = np.arange(len(other_disjunct))
    return np.asarray(place[kind, match[disjunct]])


def _split(members: Sequence[Members], field: int) -> tuple[IntArray, IntArray]:
    """Kinds, and numbers of disjuncts in a whole problem."""
    labels = np.concatenate([np.zeros(0, dtype=int), *(each[field] for each in members)])
    counts, first = [len(each[field]) for each in members], np.array(_starts(members, 1)[:-1])
    return labels // _KIND, labels % _KIND + np.repeat(first.astype(int), counts)
