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
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.model.sinks import CONSTANT_COLUMN, Form, Rows
from cvxlimit.solvers.matrices import Point

Entry = tuple[IntArray, IntArray, FloatArray]
"""Rows, columns and values of a sparse matrix."""


class Members(NamedTuple):
    """What the columns, lines and cones of a block belong to.

    ``contact`` (d,) are the contacts of the block's disjuncts, -1 for what is no contact's. The
    others (2, k) say of each column, line and cone which call stated it (0 for the first one that
    stated some, and so on), and which disjunct of the block it is of.
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
    stated: Rows,
    owners: list[IntArray],
    forces: Entry,
    contact: IntArray,
    unit: IntArray,
    count: int,
) -> list[ColumnBlock]:
    """Cuts a statement into ``count`` blocks.

    Parameters
    ----------
    stated : Rows
        The statement, no limit or cone of which has columns of two disjuncts.
    owners : list of int arrays
        The disjuncts of all columns, one array for each call that stated some.
    forces : Entry
        The map from the statement's columns to contact forces.
    contact, unit : (d,) arrays of int
        Contact and block of each disjunct.
    """
    # The new places of columns, lines, cones and disjuncts, and where the blocks start.
    of_column = np.concatenate(owners)
    limits = stated.linear, [cone[0] for cone in stated.cones]
    rows_of = [[_owner(form, of_column) for form in forms] for forms in limits]
    kinds = [_labels(each) for each in (owners, *rows_of)]
    every = [*(unit[owner] for _, owner in kinds), unit]
    places, starts = zip(*(_grouped(each, count) for each in every), strict=True)
    # Labels in these places, disjuncts numbered within their block.
    number = places[3] - starts[3][unit]
    labels = [np.empty_like(label) for label in kinds]
    for label, (kind, owner), place in zip(labels, kinds, places[:3], strict=True):
        label[:, place] = kind, number[owner]
    contact = contact[np.argsort(places[3])]
    # Entries of the matrix, and of the map to forces, sorted by block.
    indptr, data, row, row_kind = _entries(stated, places, starts, every[0])
    counts = np.diff(indptr)
    rows, columns, values = forces
    block = every[0][columns]
    order = np.argsort(block, kind="stable")
    columns = (places[0][columns] - starts[0][block])[order]
    inner = np.searchsorted(block[order], np.arange(count + 1))
    force = rows[order], columns, values[order]
    # Each block's slices of columns, lines, cones, disjuncts, entries and force entries.
    slices = [
        [slice(*ends) for ends in pairwise(each.tolist())]
        for each in (*starts, indptr[starts[0]], inner)
    ]
    return [
        ColumnBlock(
            Members(contact[d], labels[0][:, a], labels[1][:, b], labels[2][:, c]),
            counts[a], data[e], row[e], row_kind[e], (force[0][f], force[1][f], force[2][f]),
        )
        for a, b, c, d, e, f in zip(*slices, strict=True)
    ]  # fmt: skip


def _owner(form: Form, of_column: IntArray) -> IntArray:
    """Returns the disjunct (k,) of each of a limit's rows, that of any of its columns."""
    result, on = np.zeros(form.size, dtype=int), form.column != CONSTANT_COLUMN
    result[form.row[on]] = of_column[form.column[on]]
    return result


def _labels(owners: list[IntArray]) -> IntArray:
    """Returns for each call's members (k,) the number of the call, and their disjuncts: (2, k)."""
    kind = np.repeat(np.arange(len(owners)), [len(each) for each in owners])
    return np.stack([kind, np.concatenate([kind[:0], *owners])])


def _grouped(of: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Returns where members are when sorted by group, and where groups start."""
    order = np.argsort(of, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(of))
    return place, np.searchsorted(of[order], np.arange(count + 1))


def _entries(
    stated: Rows, places: Sequence[IntArray], starts: Sequence[IntArray], block: IntArray
) -> tuple[IntArray, FloatArray, IntArray, NDArray[np.int8]]:
    """Returns where columns start, and the values, rows and kinds of all entries of a statement
    with columns, lines and cones in new ``places``; ``block`` is that of each column as stated."""
    equations = sum(form.size for form in stated.equations)
    column, line, cone = places[:3]
    triples = (3 * cone[:, None] + np.arange(3)).ravel()
    first = np.cumsum([0, equations, len(line)])
    at = np.concatenate([np.arange(equations), first[1] + line, first[2] + triples])
    whole = stated.entries()
    on = whole.column != CONSTANT_COLUMN
    every = at[whole.row[on]], column[whole.column[on]], whole.value[on]
    matrix = stacked([every], (len(at), len(column)))
    # Each entry's row, numbered within its kind and block.
    kind = np.searchsorted(first, matrix.indices, side="right") - 1
    none = np.zeros(len(starts[1]) - 1, dtype=int)
    before = np.stack([none, starts[1][:-1], 3 * starts[2][:-1]])
    rows = matrix.indices - first[kind]
    rows -= before[kind, np.repeat(np.sort(block), np.diff(matrix.indptr))]
    return matrix.indptr.astype(int), matrix.data, rows, kind.astype(np.int8)


class Columns:
    """The columns of a program, of several blocks that share the rows of ``equations``.

    ``columns``, ``lines`` and ``cones`` are their numbers in all.
    """

    def __init__(self, blocks: Sequence[ColumnBlock], equations: int) -> None:
        self.blocks, self.equations = blocks, equations
        self.members = tuple(block.members for block in blocks)
        self.starts = [
            _starts(each[field].shape[1] for each in self.members) for field in range(1, 4)
        ]
        self.columns, self.lines, self.cones = (int(start[-1]) for start in self.starts)

    def matrix(self) -> sp.csc_array:
        """Returns the program's matrix (equations + lines + 3 cones, columns)."""
        # Where the rows of each kind of each block begin.
        p, blocks = self.equations, self.blocks
        _, lines, cones = (start[:-1] for start in self.starts)
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

        The first disjunct of a contact goes on from the first one that the contact had there, the
        second from the second, and so on: unknowns, duals z and slacks s are taken from there. New
        unknowns begin at zero, new duals and slacks in the middle of their cone, as large as the
        others are on average.
        """
        point, match = other.point, _matched(self.members, other.members)
        columns, lines, cones = (
            _placed(self.members, other.members, field, match) for field in range(1, 4)
        )
        first = sum(each.lines.shape[1] for each in other.members)
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


def _starts(sizes: Iterable[int]) -> IntArray:
    """Returns where each one's part begins, and the last of them ends."""
    return np.array([0, *accumulate(sizes)])


def _matched(own: Sequence[Members], others: Sequence[Members]) -> IntArray:
    """Returns the number of the disjunct of ``others`` that corresponds to each own one: the one
    that comes as late at the same contact. Where there is none it is their number."""
    (contact, rank), other = _ranked(own), _ranked(others)
    none = other.shape[1]
    sizes = np.maximum(other.max(axis=1, initial=0), [contact.max(), rank.max()]) + 1
    table = np.full(sizes, none)
    table[tuple(other)] = np.arange(none)
    return table[contact, rank]


def _ranked(members: Sequence[Members]) -> IntArray:
    """Returns the contact of every disjunct, counted from 1, and how many came before there."""
    contact = np.concatenate([each.contact for each in members]) + 1
    place, starts = _grouped(contact, int(contact.max(initial=0)) + 1)
    return np.stack([contact, place - starts[contact]])


def _placed(
    own: Sequence[Members], others: Sequence[Members], field: int, match: IntArray
) -> IntArray:
    """Returns which of the others' members of a ``field`` of :class:`Members` has the same kind and
    the disjunct that corresponds by ``match``, for each own member; -1 for none."""
    kind, disjunct = _joined(own, field)
    other_kind, other_disjunct = _joined(others, field)
    kinds = int(max(kind.max(initial=0), other_kind.max(initial=0))) + 1
    count = sum(len(each.contact) for each in others)
    place = np.full((kinds, count + 1), -1)
    place[other_kind, other_disjunct] = np.arange(len(other_disjunct))
    return np.asarray(place[kind, match[disjunct]])


def _joined(members: Sequence[Members], field: int) -> IntArray:
    """Returns the kinds of a field's members, and the numbers of their disjuncts among those of all
    blocks: (2, k)."""
    labels = np.concatenate([each[field] for each in members], axis=1)
    first = _starts(len(each.contact) for each in members)[:-1]
    labels[1] += np.repeat(first, [each[field].shape[1] for each in members])
    return labels
