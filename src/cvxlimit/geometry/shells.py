"""Shells: which faces of a mesh bound the same piece of material, and on which side it lies.

Two faces that share an edge with no third face bound the same material: faces connected across
such edges form a *sheet*. Four or more faces meet at an edge where a body touches itself or where
several bodies touch. Sorted by their angle about the edge, they enclose wedges that are material
and empty in turn, and the two faces of a wedge of material belong to the same *shell*. The
orientation of faces in a file is used only where their positions leave a choice, since programs
write faces that are oriented inwards, or differently from one body to the next.

A *side* is a directed edge of a face, as in :class:`~cvxlimit.geometry.mesh.EdgeTable`. All numbers
of faces, sides, edges, sheets and shells start from 0; points are in the scene's length unit.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

import cvxlimit.geometry.mesh as mesh
from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, EdgeTable, Faces
from cvxlimit.geometry.nearby import nearby_pairs


@dataclass(frozen=True, eq=False)
class Shells:
    """The shell of each of f faces, and the orientation that the face needs.

    Attributes
    ----------
    shell : (f,) array of int
        Number of the face's shell. All faces of no closed shell have one number together, 0.
    turned : (f,) array of bool
        True where the face has to be reversed for its normal to point out of the material; False
        for faces of no closed shell.
    closed : (f,) array of bool
        True where the face's shell is closed.
    folds : (f,) array of bool
        True where the face's sheet has one side only, like a Moebius strip.
    """

    shell: IntArray
    turned: BoolArray
    closed: BoolArray
    folds: BoolArray

    @classmethod
    def of(
        cls,
        points: FloatArray,
        faces: Sequence[Sequence[int]],
        table: EdgeTable,
        blur: float = 0.0,
    ) -> Shells:
        """Returns the shells of faces over ``points`` (k, 3), whose sides are ``table`` and whose
        corners may be off by ``blur`` (length).

        Every closed shell is oriented so that it encloses a positive volume, also one that bounds a
        cavity in another.
        """
        # Sheets with an edge of an odd number of faces, or with one side only, close nowhere.
        sheet, turned, folds = _sheets(table, len(faces))
        broken = sheet[table.face[table.uses[table.key] % 2 == 1]]
        closed = ~np.isin(sheet, np.append(broken, sheet[folds]))
        shell = np.where(closed, sheet, -1)
        # Sheets that meet at edges of more than two faces are joined to shells there.
        if (table.uses[table.key[closed[table.face]]] > 2).any():
            joiner = _SheetJoiner(points, faces, table, sheet, turned, blur)
            shell, turned = joiner.shells(shell)
            closed = shell >= 0
        # Shells are numbered from 0, and reversed as a whole where their volume is negative.
        shell = np.unique(shell, return_inverse=True)[1]
        turned = turned & closed
        volume = volumes(points, mesh.flipped(_as_tuples(faces), turned), shell)
        return cls(shell, turned ^ ((volume < 0.0)[shell] & closed), closed, folds)


def _as_tuples(faces: Sequence[Sequence[int]]) -> Faces:
    return tuple(tuple(face) for face in faces)


def volumes(points: FloatArray, faces: Sequence[Sequence[int]], shell: IntArray) -> FloatArray:
    """Returns the volume (s,) of each of s shells, positive where face normals point outwards.

    ``points`` is (k, 3) and ``shell`` (f,) the shell of each face; the unit is length cubed.
    """
    triangles, face = mesh.fan(points, faces)
    result = np.zeros(int(shell.max(initial=-1)) + 1)
    np.add.at(result, shell[face], np.linalg.det(triangles - points.mean(axis=0)) / 6.0)
    return result


def _sheets(table: EdgeTable, count: int) -> tuple[IntArray, BoolArray, BoolArray]:
    """Returns three arrays (count,) about the sheet of each of ``count`` faces.

    They are the number of the sheet; whether the face is oriented against the sheet's first face;
    and whether the sheet has one side only.
    """
    one, other = table.twins()
    # Two faces that pass their common edge from the same vertex are oriented differently.
    differ = (table.start[one] == table.start[other]).astype(np.int64)
    f, g = table.face[one], table.face[other]
    # Every face is a node twice: as given (f) and reversed (f + count). Nodes of neighbours whose
    # orientations agree are linked; where both nodes of a face are connected, the sheet folds.
    rows = np.concatenate([f, f + count])
    columns = np.concatenate([g + count * differ, g + count * (1 - differ)])
    as_given, reverse = mesh.linked(2 * count, rows, columns).reshape(2, count)
    sheet = np.minimum(as_given, reverse)
    return sheet, as_given != sheet, as_given == reverse


@dataclass(eq=False)
class _Walk:
    """One shell as it grows.

    ``is_reversed`` says for each of its sheets whether the shell has it reversed; ``sides`` are the
    shell's sides by (edge, group), see ``_SheetJoiner.groups``.
    """

    is_reversed: dict[int, bool] = field(default_factory=dict)
    sides: dict[tuple[int, int], list[int]] = field(default_factory=dict)


_BLURRED = 0.01
"""Radians; a thinner wedge of stone is none that anybody cuts."""


class _SheetJoiner:
    """Joins sheets to shells at edges of more than two faces, called *shared* edges here.

    An edge is directed from its lower to its higher vertex. A side that runs along this direction
    is crossed, by a right-handed turn about the edge, from the back of its face to the front. The
    material lies at the back of a face whose normal points outwards; so the other face of its wedge
    comes before a side that runs along the edge, and after one that runs against it.

    Attributes
    ----------
    sheet, turned : (f,) arrays
        Sheet of each face, and whether the face is oriented against its sheet.
    along : array of bool
        Whether each side runs along its edge.
    groups : dict
        For each shared edge, lists of sides at the same angle, in the order of their angles.
    place : dict
        (edge, number of the group) of each side at a shared edge.
    sides_of, members : dict
        For each sheet, its sides at shared edges, and its faces.
    """

    def __init__(
        self,
        points: FloatArray,
        faces: Sequence[Sequence[int]],
        table: EdgeTable,
        sheet: IntArray,
        turned: BoolArray,
        blur: float = 0.0,
    ) -> None:
        self.points, self.faces, self.table = points, _as_tuples(faces), table
        self.blur = blur
        self.sheet, self.turned = sheet, turned
        self.along = table.start < table.end
        self.place: dict[int, tuple[int, int]] = {}
        self.groups: dict[int, list[list[int]]] = {}
        self.sides_of: dict[int, list[int]] = defaultdict(list)
        self.members: dict[int, list[int]] = defaultdict(list)
        for face, number in enumerate(sheet.tolist()):
            self.members[number].append(face)
        normals = mesh.area_vectors(points, self.faces)
        order, end = np.argsort(table.key, kind="stable"), np.cumsum(table.uses)
        for edge in np.flatnonzero(table.uses > 2).tolist():
            self._group(edge, order[end[edge] - table.uses[edge] : end[edge]], normals)

    def _group(self, edge: int, sides: IntArray, normals: FloatArray) -> None:
        """Sort the ``sides`` of one edge by angle into groups; ``normals`` (f, 3) are of faces."""
        table = self.table
        # Angles are those of the directions from the edge into the faces, about the edge; angle 0
        # is at the largest of the faces.
        ends = np.sort([table.start[sides[0]], table.end[sides[0]]])
        axis = self.points[ends[1]] - self.points[ends[0]]
        length = max(float(np.linalg.norm(axis)), 1e-300)
        axis = axis / length
        signs = np.where(self.along[sides], 1.0, -1.0)[:, None]
        into = mesh.cross(normals[table.face[sides]], axis) * signs
        areas = np.linalg.norm(into, axis=1)
        across = into[int(areas.argmax())]
        angle = np.arctan2(into @ mesh.cross(axis, across), into @ across)
        turn = np.argsort(angle, kind="stable")
        # A step in angle starts a new group; the first and the last are one across 2 pi. Of faces
        # whose corners are off by the blur, as of two stones at a joint, which comes first is
        # chance: there the file's orientation decides.
        near = RELATIVE_TOLERANCE
        if self.blur:
            near = max(near, min(_BLURRED, self.blur * length / float(areas.min() or 1e-300)))
        new = np.diff(angle[turn]) > near
        groups = np.split(sides[turn], np.flatnonzero(new) + 1)
        if len(groups) > 1 and angle[turn[0]] + 2.0 * np.pi - angle[turn[-1]] <= near:
            groups = [np.concatenate([groups[-1], groups[0]]), *groups[1:-1]]
        self.groups[edge] = [np.sort(group).tolist() for group in groups]
        for number, group in enumerate(self.groups[edge]):
            for side in group:
                self.place[side] = edge, number
                self.sides_of[int(self.sheet[table.face[side]])].append(side)

    def shells(self, shell: IntArray) -> tuple[IntArray, BoolArray]:
        """Returns the shell of each face, -1 for none, and whether the face is to be reversed.

        ``shell`` (f,) has the sheet of each face that a closed shell may have, -1 for the others. A
        walk assumes that the material lies on one side of a sheet and collects the shell around it.
        On the wrong side it collects what bounds an empty space, as a rule everything outside, and
        the volume is negative. Where the walks on both sides enclose a volume, two bodies touch or
        surround a hollow: such sheets are decided last, after all others have been assigned, by the
        orientation that most sheets of the file have.
        """
        shell, turned = shell.copy(), self.turned.copy()
        # Only sheets with shared edges are joined; the others are shells by themselves.
        starts = [n for n in np.unique(shell[shell >= 0]).tolist() if n in self.sides_of]
        free = set(starts)
        votes = 0  # sheets with normals out of the material, less those with normals into it
        for is_sure in (True, False):
            for start in starts:
                if start not in free:
                    continue
                # The first of two walks has the orientation of most sheets.
                first = not is_sure and votes < 0
                walks = [self._walk(start, flips, free) for flips in (first, not first)]
                good = [walk for walk in walks if walk and self._volume(walk) > 0.0]
                if not good or (is_sure and len(good) > 1):
                    continue
                sheets = good[0].is_reversed
                if len(good) == 1:
                    votes += -1 if sheets[start] else 1
                for number, flips in sheets.items():
                    rows = self.members[number]
                    shell[rows], turned[rows] = start, self.turned[rows] ^ flips
                free -= sheets.keys()
        shell[np.isin(self.sheet, list(free))] = -1
        return shell, turned

    def _walk(self, start: int, flips: bool, free: set[int]) -> _Walk | None:
        """Returns the shell around the material at the back of sheet ``start``, or at its front if
        ``flips``, made of ``free`` sheets alone; None if it does not close."""
        walk = _Walk()
        todo: list[int] = []
        self._join(walk, todo, start, flips)
        # Every side of the shell leads across its wedge of material to the sheet opposite.
        while todo:
            side = todo.pop()
            edge, number = self.place[side]
            groups = self.groups[edge]
            onward = self._onward(side, walk)
            beside = (number + onward) % len(groups)
            opposite = self._opposite(walk, groups[beside], (edge, beside), onward, free)
            if opposite is None:
                return None
            sheet, is_reversed = opposite
            if sheet not in walk.is_reversed:
                self._join(walk, todo, sheet, is_reversed)
        return walk

    def _opposite(
        self,
        walk: _Walk,
        group: list[int],
        place: tuple[int, int],
        onward: int,
        free: set[int],
    ) -> tuple[int, bool] | None:
        """Returns the sheet on the far side of a wedge, and whether the shell has it reversed.

        ``group`` are the sides there, ``place`` their (edge, group), and ``onward`` is 1 where the
        wedge was crossed by a right-handed turn, otherwise -1. None if no free sheet is there.
        """
        # Of several sheets at this angle, one that the walk has already comes first ...
        for side in walk.sides.get(place, ()):
            if self._onward(side, walk) == -onward:
                return self._sheet(side), walk.is_reversed[self._sheet(side)]
        # ... then one that is oriented in the file as the walk's first sheet, then any.
        while group and self._sheet(group[-1]) not in free:
            group.pop()  # belongs to another shell for good
        usual = next(iter(walk.is_reversed.values()))
        second: tuple[int, bool] | None = None
        for side in group:
            sheet = self._sheet(side)
            if sheet not in free or sheet in walk.is_reversed:
                continue
            # The wedge has to lie at the back of the face: reversed if it is at the front as given.
            runs_along = bool(self.along[side]) ^ bool(self.turned[self.table.face[side]])
            is_reversed = runs_along is not (onward == 1)
            if is_reversed is usual:
                return sheet, is_reversed
            second = second or (sheet, is_reversed)
        return second

    def _join(self, walk: _Walk, todo: list[int], sheet: int, flips: bool) -> None:
        """Add a sheet to the walk, and its sides to those that are still to be crossed."""
        walk.is_reversed[sheet] = flips
        for side in self.sides_of[sheet]:
            walk.sides.setdefault(self.place[side], []).append(side)
            todo.append(side)

    def _sheet(self, side: int) -> int:
        return int(self.sheet[self.table.face[side]])

    def _onward(self, side: int, walk: _Walk) -> int:
        """Returns 1 if the material beside a side, as its sheet is oriented in the walk, is reached
        by a right-handed turn about the edge, otherwise -1."""
        turned = bool(self.turned[self.table.face[side]]) ^ walk.is_reversed[self._sheet(side)]
        return -1 if bool(self.along[side]) ^ turned else 1

    def _volume(self, walk: _Walk) -> float:
        """Returns the volume that a walk's shell encloses, negative if it is inside out."""
        faces = [
            self.faces[i][::-1] if self.turned[i] ^ flips else self.faces[i]
            for number, flips in walk.is_reversed.items()
            for i in self.members[number]
        ]
        return float(volumes(self.points, faces, np.zeros(len(faces), dtype=np.int64))[0])


def unpinched(points: FloatArray, faces: Faces) -> tuple[FloatArray, Faces]:
    """Returns points and faces of the same closed surface with two faces at every edge.

    Normals point outwards, here and there. Shared edges, along which the surface touches itself,
    are cut in the middle, and vertices are doubled there, so that the parts are joined nowhere.
    """
    # A vertex is put in the middle of every shared edge.
    table = EdgeTable.of(faces)
    several = np.flatnonzero(table.uses > 2)
    if not len(several):
        return points, faces
    sides = np.unique(table.key, return_index=True)[1][several]
    middle = np.full(len(table.uses), -1)
    middle[several] = len(points) + np.arange(len(several))
    points = np.concatenate([points, 0.5 * (points[table.start[sides]] + points[table.end[sides]])])
    cut: list[list[int]] = [[] for _ in faces]
    corners = (table.face, table.start, middle[table.key])
    for face, corner, half in zip(*(each.tolist() for each in corners), strict=True):
        cut[face] += [corner] if half < 0 else [corner, half]
    # Two sides at a shared edge are paired where there is material between them: every side that
    # runs along the edge with the nearest one before it that runs against it and is still free.
    faces, count = _as_tuples(cut), len(faces)
    table = EdgeTable.of(faces)
    joiner = _SheetJoiner(points, faces, table, np.arange(count), np.zeros(count, dtype=bool))
    one, other = (sides.tolist() for sides in table.twins())
    for groups in joiner.groups.values():
        against = [[side for side in group if not joiner.along[side]] for group in groups]
        for number, group in enumerate(groups):
            for side in (side for side in group if joiner.along[side]):
                behind = (
                    against[(number - back) % len(against)] for back in range(1, len(against) + 1)
                )
                one.append(side)
                other.append(next(sides for sides in behind if sides).pop())
    # Corners of faces are one vertex where paired sides identify them, each side's start with the
    # corner after its partner; every set of such corners becomes a vertex of its own.
    first = np.flatnonzero(np.diff(table.face, prepend=-1))
    following = np.arange(1, len(table.face) + 1)
    following[np.append(first[1:], len(following)) - 1] = first
    ends = np.array([one, other])
    corner = mesh.linked(len(following), ends.ravel(), following[ends[::-1]].ravel())
    place = np.unique(corner, return_index=True)[1]
    loops = np.split(corner, first[1:])
    return points[table.start[place]], tuple(tuple(loop.tolist()) for loop in loops)


def nested(
    points: FloatArray, faces: Faces, shell: IntArray, unlike: BoolArray | None = None
) -> list[tuple[int, int]]:
    """Returns the pairs (inner, outer) of closed shells of which one lies within the other.

    All are oriented outwards. If ``unlike`` (s,) is given, only pairs that differ in it count.
    """
    triangles, face = mesh.fan(points, faces)
    order = np.argsort(shell[face], kind="stable")
    parts = np.split(triangles[order], np.cumsum(np.bincount(shell[face]))[:-1])
    low, high = (np.array([end(part, axis=(0, 1)) for part in parts]) for end in (np.min, np.max))
    result = []
    # Bounding boxes come first, then one point of the inner shell and how the outer surrounds it.
    for one, other in nearby_pairs([p.reshape(-1, 3) for p in parts], np.zeros(len(parts))):
        inner, outer = np.concatenate([[one, other], [other, one]], axis=1)
        within = ((low[outer] <= low[inner]) & (high[inner] <= high[outer])).all(axis=1)
        if unlike is not None:
            within &= unlike[inner] != unlike[outer]
        result += [
            (i, k)
            for i, k in zip(inner[within].tolist(), outer[within].tolist(), strict=True)
            if abs(winding(_inner_point(parts[i]), parts[k])) > 0.5
        ]
    return result


def _inner_point(triangles: FloatArray) -> FloatArray:
    """Returns a point (3,) that a shell of ``triangles`` (t, 3, 3) encloses, just behind the middle
    of its largest triangle."""
    vectors = mesh.polygon_vectors(triangles)
    areas = np.linalg.norm(vectors, axis=1)
    largest = int(areas.argmax())
    step = RELATIVE_TOLERANCE * np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0))
    return np.asarray(triangles[largest].mean(axis=0) - step * vectors[largest] / areas[largest])


def by_shell(faces: Sequence[Sequence[int]], shell: IntArray) -> list[list[Sequence[int]]]:
    """Returns the faces of each shell, by the shell's number; ``shell`` (f,) is that of faces."""
    result: list[list[Sequence[int]]] = [[] for _ in range(int(shell.max()) + 1)]
    for face, number in zip(faces, shell.tolist(), strict=True):
        result[number].append(face)
    return result


def winding(point: FloatArray, triangles: FloatArray) -> float:
    """Returns how often a closed surface of ``triangles`` (t, 3, 3) surrounds ``point`` (3,).

    That is 0 outside and 1 within a surface that is oriented outwards: the sum of the triangles'
    solid angles (van Oosterom and Strackee 1983) over 4 pi.
    """
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    top = np.einsum("tk,tk->t", a, np.cross(b, c))
    bottom = la * lb * lc
    for u, v, length in ((a, b, lc), (b, c, la), (c, a, lb)):
        bottom = bottom + np.einsum("tk,tk->t", u, v) * length
    return float(np.arctan2(top, bottom).sum() / (2.0 * np.pi))
