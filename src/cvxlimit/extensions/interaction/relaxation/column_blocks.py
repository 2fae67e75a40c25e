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

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.sinks import CONSTANT_COLUMN, Form, Rows
from cvxlimit.solvers.matrices import Point

Entry = tuple[IntArray, IntArray, FloatArray]
"""Rows, columns and values of a sparse matrix."""

_LABELLED = ("columns", "lines", "cones")
"""Fields of :class:`Members` that say which call and which disjunct members are of."""


class Members(NamedTuple):
    """What the columns, lines and cones of a block belong to.

    ``contact`` (d,) are the contacts of the block's disjuncts, -1 for those of no contact. The
    others (2, k) say of each column, line and cone which call to the statement (:class:`Rows`)
    made it, counted from 0 for each of the three, and which disjunct of the block it is of.
    """

    contact: IntArray
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
        The values of the entries, column by column.
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
    stated: Rows,
    owners: list[IntArray],
    forces: Entry,
    contact: IntArray,
    unit: IntArray,
    count: int,
) -> list[ColumnBlock]:
    """Returns the ``count`` blocks of a statement, all of whose columns, lines and cones are sorted
    by block first.

    Parameters
    ----------
    stated : Rows
        The statement, no limit or cone of which has columns of two disjuncts.
    owners : list of int arrays
        The disjuncts of all columns, one array for each call that stated some.
    forces : Entry
        The map from the statement's columns to contact forces.
    contact, unit : (d,) arrays of int
        Contact and block of each disjunct, the blocks numbered from 0.
    """
    # Columns, lines and cones, each with the call that stated it and its disjunct (2, k).
    of_column = np.concatenate(owners)
    of_lines = [_owner(form, of_column) for form in stated.linear]
    of_cones = [_owner(bound, of_column) for bound, *_ in stated.cones]
    labels = [_labels(each) for each in (owners, of_lines, of_cones)]
    # Their places when sorted by block, and where blocks start; disjuncts likewise.
    grouped = [_grouped(unit[disjunct], count) for _, disjunct in labels]
    places, starts = [place for place, _ in grouped], [start for _, start in grouped]
    disjunct_place, disjunct_start = _grouped(unit, count)
    contact = contact[np.argsort(disjunct_place)]
    # The labels in these places, with disjuncts numbered within their block.
    number = disjunct_place - disjunct_start[unit]
    for label, place in zip(labels, places, strict=True):
        label[:, place] = label[0].copy(), number[label[1]]
    # The entries of the matrix, in the new order of columns.
    block = unit[of_column]
    indptr, data, row, kind = _entries(stated, places, starts, block)
    counts = np.diff(indptr)
    # The entries of the map to forces, sorted by block, with columns numbered within it.
    force_row, column, value = forces
    order = np.argsort(block[column], kind="stable")
    force_start = np.searchsorted(block[column][order], np.arange(count + 1))
    column = (places[0][column] - starts[0][block[column]])[order]
    force_row, value = force_row[order], value[order]
    # Each block has a slice of all of these.
    ends = (*starts, disjunct_start, indptr[starts[0]], force_start)
    slices = [[slice(*pair) for pair in pairwise(each.tolist())] for each in ends]
    blocks = []
    for columns, lines, cones, disjuncts, entries, at in zip(*slices, strict=True):
        members = Members(
            contact[disjuncts], labels[0][:, columns], labels[1][:, lines], labels[2][:, cones]
        )
        own = force_row[at], column[at], value[at]
        blocks.append(
            ColumnBlock(members, counts[columns], data[entries], row[entries], kind[entries], own)
        )
    return blocks


def _owner(form: Form, of_column: IntArray) -> IntArray:
    """Returns the disjunct (k,) of each row of a form: that of its columns, all of one."""
    result = np.zeros(form.size, dtype=int)
    is_unknown = form.column != CONSTANT_COLUMN
    result[form.row[is_unknown]] = of_column[form.column[is_unknown]]
    return result


def _labels(owners: list[IntArray]) -> IntArray:
    """Returns (2, k) the number of the call and the disjunct of every member, from the disjuncts of
    each call's members."""
    call = np.repeat(np.arange(len(owners)), [len(each) for each in owners])
    disjunct = np.concatenate([call[:0], *owners])  # without calls an empty array of int
    return np.stack([call, disjunct])


def _grouped(of: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Returns the place of each member when sorted by its group ``of`` (k,), and where the groups
    start (count + 1,), the last entry being the end."""
    order = np.argsort(of, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(of))
    return place, np.searchsorted(of[order], np.arange(count + 1))


def _entries(
    stated: Rows, places: Sequence[IntArray], starts: Sequence[IntArray], block: IntArray
) -> tuple[IntArray, FloatArray, IntArray, NDArray[np.int8]]:
    """Returns where columns start, and the values, rows and kinds of all entries of a statement, as
    :class:`ColumnBlock` has them, in the order of the columns' new places.

    ``places`` and ``starts`` are those of columns, lines and cones when sorted by block, ``block``
    is that of each column as stated.
    """
    column, line, cone = places
    # The new row of each row as stated: equations stay, lines and the three rows of cones move.
    equations = sum(form.size for form in stated.equations)
    first = np.cumsum([0, equations, len(line)])  # where rows of each kind start
    triples = (3 * cone[:, None] + np.arange(3)).ravel()
    moved = np.concatenate([np.arange(equations), first[1] + line, first[2] + triples])
    # The matrix without the constants, rows and columns in their new places.
    whole = stated.entries()
    is_unknown = whole.column != CONSTANT_COLUMN
    at = moved[whole.row[is_unknown]], column[whole.column[is_unknown]]
    matrix = stacked([(*at, whole.value[is_unknown])], (len(moved), len(column)))
    # Each entry's row, numbered within its kind and block; equations are common to all blocks.
    kind = np.searchsorted(first, matrix.indices, side="right") - 1
    none = np.zeros(len(starts[1]) - 1, dtype=int)
    before = np.stack([none, starts[1][:-1], 3 * starts[2][:-1]])
    block_of_entry = np.repeat(np.sort(block), np.diff(matrix.indptr))
    rows = matrix.indices - first[kind]
    rows -= before[kind, block_of_entry]
    return matrix.indptr.astype(int), matrix.data, rows, kind.astype(np.int8)


class Columns:
    """The columns of a program: those of several blocks, which share the rows of the ``equations``.

    ``equations``, ``columns``, ``lines`` and ``cones`` are how many there are in all.
    """

    def __init__(self, blocks: Sequence[ColumnBlock], equations: int) -> None:
        self.blocks, self.equations = blocks, equations
        self.members = tuple(block.members for block in blocks)
        self.starts = [
            _starts(getattr(each, name).shape[1] for each in self.members) for name in _LABELLED
        ]
        self.columns, self.lines, self.cones = (int(start[-1]) for start in self.starts)

    def matrix(self) -> sp.csc_array:
        """Returns the program's matrix (equations + lines + 3 cones, columns)."""
        # Where the rows of each kind of each block begin.
        p, blocks = self.equations, self.blocks
        _, lines, cones = (start[:-1] for start in self.starts)
        offset = np.stack([np.zeros_like(lines), p + lines, p + self.lines + 3 * cones])
        # All blocks' columns side by side, their rows shifted there.
        data = np.concatenate([block.data for block in blocks])
        rows = np.concatenate([block.rows for block in blocks])
        kind = np.concatenate([block.kind for block in blocks])
        number = np.repeat(np.arange(len(blocks)), [len(block.data) for block in blocks])
        indices = (rows + offset[kind, number]).astype(np.int32)
        indptr = np.zeros(self.columns + 1, dtype=np.int32)
        np.cumsum(np.concatenate([block.counts for block in blocks]), out=indptr[1:])
        shape = (p + self.lines + 3 * self.cones, self.columns)
        return sp.csc_array((data, indices, indptr), shape)

    def forces(self) -> Entry:
        """Returns the map from the program's columns to contact forces (6 n,)."""
        rows, columns, values = zip(*(block.forces for block in self.blocks), strict=True)
        offset = np.repeat(self.starts[0][:-1], [len(part) for part in rows])
        return np.concatenate(rows), np.concatenate(columns) + offset, np.concatenate(values)

    def start(self, other: Halfway) -> Point:
        """Returns a point from which a solver of this problem may start, made of another problem's.

        The first disjunct of a contact goes on from the first one that the contact had there, the
        second from the second, and so on: unknowns, duals z and slacks s are taken from there. New
        unknowns begin at zero, new duals and slacks in the middle of their cone, as large as the
        others are on average.
        """
        # The columns, lines and cones there from which these go on; -1 for new ones.
        point, match = other.point, _matched(self.members, other.members)
        columns, lines, cones = (
            _placed(self.members, other.members, name, match) for name in _LABELLED
        )
        # The rows of lines and of cones, three each, and the middle of their cones for new ones.
        first = sum(each.lines.shape[1] for each in other.members)
        triples = np.where(cones[:, None] < 0, -1, first + 3 * cones[:, None] + np.arange(3))
        rows = np.concatenate([lines, triples.ravel()])
        middle = np.concatenate([np.ones(len(lines)), np.tile([1.0, 0.0, 0.0], len(cones))])
        z, s = (
            np.where(rows < 0, float(np.abs(v).mean()) * middle, v[rows])
            for v in (point.z, point.s)
        )
        return Point(np.where(columns < 0, 0.0, point.x[columns]), point.y, z, s)


def stacked(entries: list[Entry], shape: tuple[int, int]) -> sp.csc_array:
    """Returns the sum of all entries as a sparse matrix of a shape."""
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    result = sp.csc_array((values, (rows, columns)), shape)
    result.eliminate_zeros()
    return result


def _starts(sizes: Iterable[int]) -> IntArray:
    """Returns where parts of these sizes begin when they stand one after the other, and the end."""
    return np.cumsum([0, *sizes])


def _matched(own: Sequence[Members], others: Sequence[Members]) -> IntArray:
    """Returns the disjunct of ``others`` that each own one goes on from, of the same rank at the
    same contact; where there is none, how many others there are."""
    (contact, rank), other = _ranked(own), _ranked(others)
    none = other.shape[1]
    sizes = np.maximum(other.max(axis=1, initial=0), [contact.max(), rank.max()]) + 1
    table = np.full(sizes, none)
    table[tuple(other)] = np.arange(none)
    return table[contact, rank]


def _ranked(members: Sequence[Members]) -> IntArray:
    """Returns (2, d) the contact of every disjunct, counted from 1 so that no contact is 0, and its
    rank: how many disjuncts of the same contact come before it."""
    contact = np.concatenate([each.contact for each in members]) + 1
    place, starts = _grouped(contact, int(contact.max(initial=0)) + 1)
    return np.stack([contact, place - starts[contact]])


def _placed(
    own: Sequence[Members], others: Sequence[Members], name: str, match: IntArray
) -> IntArray:
    """Returns for each own column, line or cone, as ``name`` says, the one of the others that the
    same call stated of the disjunct that corresponds by ``match``; -1 for none."""
    call, disjunct = _joined(own, name)
    other_call, other_disjunct = _joined(others, name)
    calls = int(max(call.max(initial=0), other_call.max(initial=0))) + 1
    count = sum(len(each.contact) for each in others)
    place = np.full((calls, count + 1), -1)  # the last column stands for no disjunct
    place[other_call, other_disjunct] = np.arange(len(other_disjunct))
    return np.asarray(place[call, match[disjunct]])


def _joined(members: Sequence[Members], name: str) -> IntArray:
    """Returns the labels (2, k) of all blocks' columns, lines or cones, as ``name`` says, with the
    disjuncts numbered through all blocks."""
    parts = [getattr(each, name) for each in members]
    labels = np.concatenate(parts, axis=1)
    first = _starts(len(each.contact) for each in members)[:-1]
    labels[1] += np.repeat(first, [part.shape[1] for part in parts])
    return labels
