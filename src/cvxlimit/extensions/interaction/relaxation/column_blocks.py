"""Cone programs put together from blocks of columns.

A *block* has the columns of some disjuncts (unknowns of contacts, see :mod:`.hull`) and the rows
that only these columns have: linear inequalities, called *lines*, and second-order cones of three
rows each. Blocks share nothing but the equations of equilibrium. So thousands of problems that
differ in a contact or two share all other blocks, and a solver may start one problem where it was
with another.

A program's rows stand in the order equations, lines, cones; its columns are those of the blocks,
one block after the other.
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
from cvxlimit.solvers.matrices import Point

Entry = tuple[IntArray, IntArray, FloatArray]
"""Rows, columns and values of a sparse matrix."""

Key = tuple[int, bytes]
"""The name of a block: its contact, -1 for none, and the names of its disjuncts."""


class Members(NamedTuple):
    """What the columns, lines and cones of a block belong to.

    Blocks with equal keys are equal. ``names`` are the names of the block's disjuncts, whose first
    bytes are their contact. ``columns``, ``lines`` and ``cones`` hold a label for each column, line
    and cone: its kind (0 for the first call that stated some, 1 for the next, and so on) and the
    number of its disjunct in the block, as :func:`_labels` packs them.
    """

    key: Key
    names: list[bytes]
    columns: IntArray
    lines: IntArray
    cones: IntArray


@dataclass(frozen=True, eq=False)
class ColumnBlock:
    """Columns of a program in compressed form.

    Attributes
    ----------
    members : Members
        What columns, lines and cones belong to.
    counts : (columns,) array of int
        How many entries each column has.
    data : (entries,) array
        The entries, column by column.
    rows, kind : (entries,) arrays of int
        Their rows, numbered within their kind and block: 0 for equations, 1 for lines, 2 for rows
        of cones.
    forces : Entry
        The map from the block's columns to contact forces (6 n,).
    """

    members: Members
    counts: IntArray
    data: FloatArray
    rows: IntArray
    kind: NDArray[np.int8]
    forces: Entry


@dataclass(frozen=True, eq=False)
class Halfway:
    """A point on a solver's way to an answer, and what its numbers belong to, block by block."""

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
    """Cuts a statement into blocks, and returns one for each key.

    Parameters
    ----------
    keys : sequence of Key
        Names of the blocks.
    unit : (k,) array of int
        Block of each of the k disjuncts.
    names : sequence of bytes
        Names of the disjuncts.
    kinds : three lists of int arrays
        The disjuncts of all columns, of all lines and of all cones, one array for each call that
        stated some.
    stated : Rows
        The statement.
    forces : Entry
        The map from the statement's columns to contact forces.
    """
    # Columns, lines, cones and disjuncts sorted by block: the new place of each, and where the
    # blocks start. ``first`` is the first row of each kind.
    equations = sum(form.size for form in stated.equations)
    of = [unit[np.concatenate(each)] for each in kinds]
    places, starts = zip(*(_grouped(each, len(keys)) for each in (*of, unit)), strict=True)
    (column, line, cone, disjunct), first = places, np.cumsum([0, equations, len(of[1])])
    # The statement's matrix with rows and columns in their new places.
    triples = first[2] + (3 * cone[:, None] + np.arange(3)).ravel()
    at = np.concatenate([np.arange(equations), equations + line, triples])
    entries, _ = stated.entries()
    every = [(at[rows], column[columns], values) for rows, columns, values, _ in entries]
    matrix = stacked(every, (len(at), len(column)))
    # Each entry's row, numbered within its kind and block.
    counts = np.diff(matrix.indptr)
    kind = np.searchsorted(first, matrix.indices, side="right") - 1
    before = np.stack([np.zeros(len(keys), dtype=int), starts[1][:-1], 3 * starts[2][:-1]])
    rows = matrix.indices - first[kind] - before[kind, np.repeat(np.sort(of[0]), counts)]
    kind = kind.astype(np.int8)
    # The entries of the map to forces, sorted by block, their columns numbered within the block.
    force_rows, columns, values = forces
    block = of[0][columns]
    order = np.argsort(block, kind="stable")
    force_rows, values = force_rows[order], values[order]
    columns = (column[columns] - starts[0][block])[order]
    inner = np.searchsorted(block[order], np.arange(len(keys) + 1))
    # Labels of columns, lines and cones, and names of disjuncts, sorted by block.
    labels = [
        _labels(each, disjunct - starts[3][unit], place)
        for each, place in zip(kinds, places[:3], strict=True)
    ]
    sorted_names = [names[k] for k in np.argsort(disjunct).tolist()]
    # Each block's slices of columns, lines, cones, disjuncts, entries and force entries.
    slices = [
        [slice(*ends) for ends in pairwise(each.tolist())]
        for each in (*starts, matrix.indptr[starts[0]], inner)
    ]
    return [
        ColumnBlock(
            Members(key, sorted_names[d], labels[0][a], labels[1][b], labels[2][c]),
            counts[a], matrix.data[e], rows[e], kind[e], (force_rows[f], columns[f], values[f]),
        )
        for key, a, b, c, d, e, f in zip(keys, *slices, strict=True)
    ]  # fmt: skip


_CONTACT = 8
"""The first bytes of a disjunct's name, which are its contact."""

_KIND = 1 << 24
"""A number larger than that of the disjuncts of any problem. A label is a kind times this number,
plus the number of a disjunct."""


def _labels(kinds: list[IntArray], disjunct: IntArray, place: IntArray) -> IntArray:
    """Returns the labels of columns, lines or cones in their new places: ``kinds`` holds the
    disjuncts of each kind, ``disjunct`` the number of each disjunct within its block."""
    result = np.empty(len(place), dtype=int)
    result[place] = np.concatenate([_KIND * k + disjunct[each] for k, each in enumerate(kinds)])
    return result


class Columns:
    """The columns of a program, of several blocks that share the rows of ``equations``.

    ``columns``, ``lines`` and ``cones`` are their numbers in all.
    """

    def __init__(self, blocks: Sequence[ColumnBlock], equations: int) -> None:
        self.blocks, self.equations = blocks, equations
        self.members = tuple(block.members for block in blocks)
        self.starts = [_starts(self.members, k) for k in range(2, 5)]
        self.columns, self.lines, self.cones = (start[-1] for start in self.starts)

    def matrix(self) -> sp.csc_array:
        """Returns the program's matrix (equations + lines + 3 cones, columns)."""
        # Where the rows of each kind of each block begin.
        p, blocks = self.equations, self.blocks
        _, lines, cones = (np.array(start[:-1]) for start in self.starts)
        offset = np.stack([np.zeros_like(lines), p + lines, p + self.lines + 3 * cones])
        # All blocks' columns side by side, their rows shifted there.
        every = [(block.data, block.rows, block.kind, block.counts) for block in blocks]
        data, rows, kind, counts = map(np.concatenate, zip(*every, strict=True))
        number = np.repeat(np.arange(len(blocks)), [len(part[0]) for part in every])
        indices = (rows + offset[kind, number]).astype(np.int32)
        indptr = np.zeros(self.columns + 1, dtype=np.int32)
        np.cumsum(counts, out=indptr[1:])
        shape = (p + self.lines + 3 * self.cones, self.columns)
        return sp.csc_array((data, indices, indptr), shape)

    def forces(self) -> Entry:
        """Returns the map from the program's columns to contact forces (6 n,)."""
        rows, columns, values = zip(*(block.forces for block in self.blocks), strict=True)
        offset = np.repeat(self.starts[0][:-1], [len(part) for part in rows])
        return np.concatenate(rows), np.concatenate(columns) + offset, np.concatenate(values)

    def start(self, other: Halfway) -> Point:
        """Returns a point from which a solver of this problem may start, made of another problem's.

        Unknowns, duals z and slacks s that the other problem has too are taken from there. New
        unknowns begin at zero, new duals and slacks in the middle of their cone, as large as the
        others are on average.
        """
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
    """Returns the sum of all entries as a sparse matrix of a shape."""
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
    """Which members of other blocks correspond to the members of one's own.

    A block with the same key corresponds as a whole. Of the blocks that are left, a disjunct
    corresponds to the one with the same name, otherwise to the first one left at the same contact.

    Attributes
    ----------
    twin : (blocks,) array of int
        The other block with the same key, -1 for none.
    new, spare : list of Members
        Own and other blocks without a twin; ``left`` are the numbers of the latter.
    match : array of int
        The disjunct of ``spare`` for each disjunct of ``new``.
    """

    def __init__(self, own: Sequence[Members], others: Sequence[Members]) -> None:
        self.own, self.others = own, others
        number = {each.key: k for k, each in enumerate(others)}
        self.twin = np.array([number.get(each.key, -1) for each in own])
        self.new = [each for each, twin in zip(own, self.twin.tolist(), strict=True) if twin < 0]
        self.left = np.setdiff1d(np.arange(len(others)), self.twin)
        self.spare = [others[k] for k in self.left.tolist()]
        self.match = _matched(self.new, self.spare)

    def places(self, field: int) -> IntArray:
        """Returns which of the others' members corresponds to each own one, -1 for none. ``field``
        is that of :class:`Members`: 2 for columns, 3 for lines, 4 for cones."""
        # Members of blocks with a twin stand in the same order there.
        own, others = (np.array(_starts(every, field)) for every in (self.own, self.others))
        counts = np.diff(own)
        place = np.arange(own[-1]) + np.repeat(others[self.twin] - own[:-1], counts)
        # Others are placed among the members of the spare blocks, then among those of all blocks.
        in_spare = _placed(self.new, self.spare, field, self.match)
        ends = zip(others[self.left].tolist(), others[self.left + 1].tolist(), strict=True)
        at = np.concatenate([*(np.arange(*each) for each in ends), [-1]])
        place[np.repeat(self.twin < 0, counts)] = at[in_spare]
        return place


def _matched(own: Sequence[Members], others: Sequence[Members]) -> IntArray:
    """Returns which of the others' disjuncts corresponds to each disjunct; where none does, their
    number."""
    left: dict[bytes, dict[bytes, int]] = {}  # Numbers of disjuncts by contact and name.
    for number, name in enumerate(name for each in others for name in each.names):
        left.setdefault(name[:_CONTACT], {})[name] = number
    none = _starts(others, 1)[-1]
    return np.array([k for each in own for k in _taken(each.names, left, none)], dtype=int)


def _taken(names: list[bytes], left: dict[bytes, dict[bytes, int]], none: int) -> list[int]:
    """Takes a disjunct for each name out of those ``left``, and returns their numbers: first the
    one with the same name, then any at the same contact, else ``none``."""
    at_contact = [left.get(name[:_CONTACT], {}) for name in names]
    same = [here.pop(name, none) for name, here in zip(names, at_contact, strict=True)]
    return [
        here.pop(next(iter(here))) if number == none and here else number
        for number, here in zip(same, at_contact, strict=True)
    ]


def _placed(
    own: Sequence[Members], others: Sequence[Members], field: int, match: IntArray
) -> IntArray:
    """Returns which of the others' members has the same kind and the disjunct that corresponds by
    ``match``, for each own member; -1 for none."""
    kind, disjunct = _split(own, field)
    other_kind, other_disjunct = _split(others, field)
    kinds = int(max(kind.max(initial=0), other_kind.max(initial=0))) + 1
    place = np.full((kinds, _starts(others, 1)[-1] + 1), -1)
    place[other_kind, other_disjunct] = np.arange(len(other_disjunct))
    return np.asarray(place[kind, match[disjunct]])


def _split(members: Sequence[Members], field: int) -> tuple[IntArray, IntArray]:
    """Returns the kinds of a field's members, and the numbers of their disjuncts among those of all
    blocks."""
    labels = np.concatenate([np.zeros(0, dtype=int), *(each[field] for each in members)])
    counts, first = [len(each[field]) for each in members], np.array(_starts(members, 1)[:-1])
    return labels // _KIND, labels % _KIND + np.repeat(first.astype(int), counts)
