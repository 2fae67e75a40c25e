"""Shells: which faces of a mesh bound the same piece of material, and on which side it lies.

At an edge of two faces both bound the same material. At an edge of four or more, where a body
touches itself or several bodies meet, the faces stand around it in turn, and those on either side
of a wedge of material belong together. Nothing is taken from how faces are turned where their
places say enough: files turn them inwards, or one body so and the next one otherwise.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

import cvxlimit.geometry.mesh as mesh
from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, EdgeTable, Faces
from cvxlimit.geometry.nearby import nearby_pairs


@dataclass(frozen=True, eq=False)
class Shells:
    """Of all faces (f,): their ``shell``, whether they are ``turned`` so that normals point out of
    the material, and whether the shell is ``closed``. What is not is as it was given and one shell,
    the first. A sheet ``folds`` where it has one side only."""

    shell: IntArray
    turned: BoolArray
    closed: BoolArray
    folds: BoolArray

    @classmethod
    def of(cls, points: FloatArray, faces: Sequence[Sequence[int]], table: EdgeTable) -> Shells:
        """Makes the shells of faces over ``points`` (k, 3), whose sides are ``table``. A single
        closed shell is turned so that it encloses a positive volume; which of several lie within
        another, and are cavities, is not looked at."""
        sheet, turned, folds = _sheets(table, len(faces))
        broken = sheet[table.face[table.uses[table.key] % 2 == 1]]
        closed = ~np.isin(sheet, np.append(broken, sheet[folds]))
        shell = np.where(closed, sheet, -1)
        if (table.uses[table.key[closed[table.face]]] > 2).any():
            around = _Around(points, faces, table, sheet, turned)
            shell, turned = around.walked(shell)
            closed = shell >= 0
        shell = np.unique(shell, return_inverse=True)[1]
        turned = turned & closed
        volume = volumes(points, mesh.flipped(_loops(faces), turned), shell)
        return cls(shell, turned ^ ((volume < 0.0)[shell] & closed), closed, folds)


def _loops(faces: Sequence[Sequence[int]]) -> Faces:
    return tuple(tuple(face) for face in faces)


def volumes(points: FloatArray, faces: Sequence[Sequence[int]], shell: IntArray) -> FloatArray:
    """Returns the volume of each shell, with the sign of how its faces go round."""
    triangles, face = mesh.fan(points, faces)
    result = np.zeros(int(shell.max(initial=-1)) + 1)
    np.add.at(result, shell[face], np.linalg.det(triangles - points.mean(axis=0)) / 6.0)
    return result


def _sheets(table: EdgeTable, count: int) -> tuple[IntArray, BoolArray, BoolArray]:
    """Faces that hang together across edges of two, named by one of them; which of them are turned
    against that one; and which sheets have one side only, like a Moebius strip."""
    one, other = table.twins()
    differ = (table.start[one] == table.start[other]).astype(np.int64)
    f, g = table.face[one], table.face[other]
    # Every face stands twice, as it is and turned; neighbours are linked where they agree.
    rows = np.concatenate([f, f + count])
    columns = np.concatenate([g + count * differ, g + count * (1 - differ)])
    as_is, reverse = mesh.linked(2 * count, rows, columns).reshape(2, count)
    sheet = np.minimum(as_is, reverse)
    return sheet, as_is != sheet, as_is == reverse


@dataclass(eq=False)
class _Walk:
    """One shell as it grows: how each of its sheets is turned, and its sides at (edge, angle)."""

    sheets: dict[int, bool] = field(default_factory=dict)
    sides: dict[tuple[int, int], list[int]] = field(default_factory=dict)


class _Around:
    """The sides at edges of more than two faces, in turn about them.

    Turning forwards about an edge from its lower to its higher vertex, a side that runs along it
    is passed from behind its face to the front. So material that lies behind a face is met by
    turning back from a side that runs along, and forwards from one that runs against.
    """

    def __init__(
        self,
        points: FloatArray,
        faces: Sequence[Sequence[int]],
        table: EdgeTable,
        sheet: IntArray,
        turned: BoolArray,
    ) -> None:
        self.points, self.faces, self.table = points, _loops(faces), table
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
            self._add(edge, order[end[edge] - table.uses[edge] : end[edge]], normals)

    def _add(self, edge: int, sides: IntArray, normals: FloatArray) -> None:
        """Put the sides of one edge in turn, in groups that stand at the same angle."""
        table = self.table
        ends = np.sort([table.start[sides[0]], table.end[sides[0]]])
        axis = self.points[ends[1]] - self.points[ends[0]]
        axis = axis / max(float(np.linalg.norm(axis)), 1e-300)
        ways = np.where(self.along[sides], 1.0, -1.0)[:, None]
        into = np.cross(normals[table.face[sides]], axis) * ways
        across = into[int(np.linalg.norm(into, axis=1).argmax())]
        angle = np.arctan2(into @ np.cross(axis, across), into @ across)
        turn = np.argsort(angle, kind="stable")
        new = np.diff(angle[turn]) > RELATIVE_TOLERANCE
        groups = np.split(sides[turn], np.flatnonzero(new) + 1)
        if len(groups) > 1 and angle[turn[0]] + 2.0 * np.pi - angle[turn[-1]] <= RELATIVE_TOLERANCE:
            groups = [np.concatenate([groups[-1], groups[0]]), *groups[1:-1]]
        self.groups[edge] = [np.sort(group).tolist() for group in groups]
        for number, group in enumerate(self.groups[edge]):
            for side in group:
                self.place[side] = edge, number
                self.sides_of[int(self.sheet[table.face[side]])].append(side)

    def walked(self, shell: IntArray) -> tuple[IntArray, BoolArray]:
        """Shells of all faces, -1 for those of none, and how they are turned.

        A walk starts from a sheet with the material on one side and goes on around every edge.
        Begun on the wrong side it goes around what is empty, as a rule everything outside, and its
        volume is negative. Where both sides give a body, two bodies touch there, or there is a
        hollow between bodies: those wait for what the others leave, and are believed in the end as
        most of the file is turned.
        """
        shell, turned = shell.copy(), self.turned.copy()
        starts = [n for n in np.unique(shell[shell >= 0]).tolist() if n in self.sides_of]
        free = set(starts)
        votes = 0  # for files whose faces point out of the material, less those whose do not
        for is_sure in (True, False):
            for start in starts:
                if start not in free:
                    continue
                first = not is_sure and votes < 0
                found = [self._walk(start, way, free) for way in (first, not first)]
                good = [walk for walk in found if walk and self._volume(walk) > 0.0]
                if not good or (is_sure and len(good) > 1):
                    continue
                sheets = good[0].sheets
                if len(good) == 1:
                    votes += -1 if sheets[start] else 1
                for number, flips in sheets.items():
                    rows = self.members[number]
                    shell[rows], turned[rows] = start, self.turned[rows] ^ flips
                free -= sheets.keys()
        shell[np.isin(self.sheet, list(free))] = -1
        return shell, turned

    def _walk(self, start: int, flips: bool, free: set[int]) -> _Walk | None:
        """The shell around the material on one side of a sheet; None if it does not close."""
        walk = _Walk()
        todo: list[int] = []
        self._join(walk, todo, start, flips)
        while todo:
            side = todo.pop()
            edge, number = self.place[side]
            groups = self.groups[edge]
            onward = 1 if self._is_along(side, walk) is False else -1
            beside = (number + onward) % len(groups)
            found = self._facing(walk, groups[beside], (edge, beside), onward, free)
            if found is None:
                return None
            sheet, way = found
            if sheet not in walk.sheets:
                self._join(walk, todo, sheet, way)
        return walk

    def _facing(
        self,
        walk: _Walk,
        group: list[int],
        place: tuple[int, int],
        onward: int,
        free: set[int],
    ) -> tuple[int, bool] | None:
        """The sheet on the far side of a wedge, of several at one angle the walk's own or else one
        that is turned in the file as the walk is, and whether it has to be turned."""
        for side in walk.sides.get(place, ()):
            if (1 if self._is_along(side, walk) is False else -1) == -onward:
                return self._sheet(side), walk.sheets[self._sheet(side)]
        while group and self._sheet(group[-1]) not in free:
            group.pop()  # of another shell: never asked for again
        usual = next(iter(walk.sheets.values()))
        second: tuple[int, bool] | None = None
        for side in group:
            sheet = self._sheet(side)
            if sheet not in free or sheet in walk.sheets:
                continue
            # Material on this side of it lies behind: turned if it is not so as it is.
            runs_along = bool(self.along[side]) ^ bool(self.turned[self.table.face[side]])
            way = runs_along is not (onward == 1)
            if way is usual:
                return sheet, way
            second = second or (sheet, way)
        return second

    def _join(self, walk: _Walk, todo: list[int], sheet: int, flips: bool) -> None:
        walk.sheets[sheet] = flips
        for side in self.sides_of[sheet]:
            walk.sides.setdefault(self.place[side], []).append(side)
            todo.append(side)

    def _sheet(self, side: int) -> int:
        return int(self.sheet[self.table.face[side]])

    def _is_along(self, side: int, walk: _Walk) -> bool:
        turned = bool(self.turned[self.table.face[side]]) ^ walk.sheets[self._sheet(side)]
        return bool(self.along[side]) ^ turned

    def _volume(self, walk: _Walk) -> float:
        faces = [
            self.faces[i][::-1] if self.turned[i] ^ flips else self.faces[i]
            for number, flips in walk.sheets.items()
            for i in self.members[number]
        ]
        return float(volumes(self.points, faces, np.zeros(len(faces), dtype=np.int64))[0])


def unpinched(points: FloatArray, faces: Faces) -> tuple[FloatArray, Faces]:
    """The same closed surface, its normals pointing out, but with two faces at every edge: those
    along which it touches itself are cut in the middle, and vertices there are doubled."""
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
    faces, count = _loops(cut), len(faces)
    table = EdgeTable.of(faces)
    around = _Around(points, faces, table, np.arange(count), np.zeros(count, dtype=bool))
    one, other = (sides.tolist() for sides in table.twins())
    for groups in around.groups.values():
        left = [[side for side in group if not around.along[side]] for group in groups]
        for number, group in enumerate(groups):
            for side in (side for side in group if around.along[side]):
                behind = (left[(number - back) % len(left)] for back in range(1, len(left) + 1))
                one.append(side)
                other.append(next(sides for sides in behind if sides).pop())
    first = np.flatnonzero(np.diff(table.face, prepend=-1))
    following = np.arange(1, len(table.face) + 1)
    following[np.append(first[1:], len(following)) - 1] = first
    ends = np.array([one, other])
    corner = mesh.linked(len(following), ends.ravel(), following[ends[::-1]].ravel())
    place = np.unique(corner, return_index=True)[1]
    loops = np.split(corner, first[1:])
    return points[table.start[place]], tuple(tuple(loop.tolist()) for loop in loops)


def outward(id: str, points: FloatArray, faces: Faces) -> tuple[Faces, int]:
    """The faces turned so that all normals point out, and how many were turned; refused if the
    surface is open, has one side only, or encloses several bodies that do not touch."""
    table = EdgeTable.of(faces)
    check_closed(id, points, table)
    found = Shells.of(points, faces, table)
    if found.folds.any():
        bad = points[list(faces[int(np.argmax(found.folds))])]
        raise GeometryError(
            f"block {id!r} has a surface with one side only, like a Moebius strip, near "
            f"{mesh.place(bad.mean(axis=0))}: mend the mesh",
            points=bad,
            blocks=(id,),
        )
    if not found.closed.all():
        edge = table.key[table.uses[table.key].argmax()]
        fault = f"belongs to {table.uses[edge]} faces, which bound no material between them"
        raise _not_closed(id, points, table, np.array([edge]), fault)
    oriented = mesh.flipped(faces, found.turned)
    turned = found.turned ^ _is_cavity(id, points, oriented, found.shell)[found.shell]
    return mesh.flipped(faces, turned), int(turned.sum())


def check_closed(id: str, points: FloatArray, table: EdgeTable) -> None:
    """Refuse a surface with edges of an odd number of faces, and name one."""
    wrong = np.flatnonzero(table.uses % 2 == 1)
    if not len(wrong):
        return
    most = int(table.uses[wrong].max())
    fault = "has no face on its other side" if most == 1 else f"belongs to {most} faces"
    raise _not_closed(id, points, table, wrong, fault)


def _not_closed(
    id: str, points: FloatArray, table: EdgeTable, wrong: IntArray, fault: str
) -> GeometryError:
    side = int(np.flatnonzero(table.key == wrong[int(np.argmax(table.uses[wrong]))])[0])
    ends = points[[table.start[side], table.end[side]]]
    sides = np.flatnonzero(np.isin(table.key, wrong))
    more = f", and {len(wrong) - 1} more edges are at fault" if len(wrong) > 1 else ""
    return GeometryError(
        f"block {id!r} is not closed: the edge between vertices {table.start[side]} and "
        f"{table.end[side]}, from {mesh.place(ends[0])} to {mesh.place(ends[1])}, {fault}{more}; "
        "mend the mesh so that every edge belongs to two faces, or to four where the body touches "
        "itself",
        points=points[np.stack([table.start[sides], table.end[sides]], axis=1)].reshape(-1, 3),
        blocks=(id,),
    )


def _is_cavity(id: str, points: FloatArray, faces: Faces, shell: IntArray) -> BoolArray:
    """Which shells are cavities of one body, (s,): they lie within another. The others have to hang
    together at vertices, or they are several bodies."""
    count = int(shell.max()) + 1
    if count == 1:
        return np.zeros(1, dtype=bool)
    own = [np.unique(np.concatenate(x)) for x in by_shell(faces, shell)]
    volume = volumes(points, faces, shell)
    if not volume.min() > 0.0:
        flat = own[int(np.argmin(volume))]
        raise GeometryError(
            f"block {id!r} has faces that lie on each other near "
            f"{mesh.place(points[flat].mean(axis=0))} and enclose nothing: remove them",
            points=points[flat],
            blocks=(id,),
        )
    depth = np.bincount([i for i, _ in nested(points, faces, shell)], minlength=count)
    holder, links = np.full(len(points), -1), []
    for s in np.flatnonzero(depth == 0).tolist():
        links += [(s, t) for t in np.unique(holder[own[s]]).tolist() if t >= 0]
        holder[own[s]] = s
    body = mesh.linked(count, *np.array(links, dtype=np.int64).reshape(-1, 2).T)
    apart = np.unique(np.where(depth == 0, body, -1), return_index=True)[1]
    bodies = np.concatenate([apart[depth[apart] == 0], np.flatnonzero(depth == 2)])
    if len(bodies) > 1:
        witness = np.array([points[own[s][0]] for s in bodies.tolist()])
        raise GeometryError(
            f"block {id!r} consists of {len(bodies)} separate bodies, one of them at "
            f"{mesh.place(witness[1])}: make a block of each",
            points=witness,
            blocks=(id,),
        )
    return np.asarray(depth == 1)


def nested(
    points: FloatArray, faces: Faces, shell: IntArray, unlike: BoolArray | None = None
) -> list[tuple[int, int]]:
    """Pairs of closed shells, all turned outwards, of which the first lies within the second; only
    those that differ in ``unlike`` (s,), if that is given."""
    triangles, face = mesh.fan(points, faces)
    order = np.argsort(shell[face], kind="stable")
    parts = np.split(triangles[order], np.cumsum(np.bincount(shell[face]))[:-1])
    low, high = (np.array([end(part, axis=(0, 1)) for part in parts]) for end in (np.min, np.max))
    result = []
    for one, other in nearby_pairs([p.reshape(-1, 3) for p in parts], np.zeros(len(parts))):
        inner, outer = np.concatenate([[one, other], [other, one]], axis=1)
        within = ((low[outer] <= low[inner]) & (high[inner] <= high[outer])).all(axis=1)
        if unlike is not None:
            within &= unlike[inner] != unlike[outer]
        result += [
            (i, k)
            for i, k in zip(inner[within].tolist(), outer[within].tolist(), strict=True)
            if abs(winding(_within(parts[i]), parts[k])) > 0.5
        ]
    return result


def _within(triangles: FloatArray) -> FloatArray:
    """A point that a shell encloses, close to the middle of its largest triangle."""
    vectors = mesh.polygon_vectors(triangles)
    areas = np.linalg.norm(vectors, axis=1)
    largest = int(areas.argmax())
    step = RELATIVE_TOLERANCE * np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0))
    return np.asarray(triangles[largest].mean(axis=0) - step * vectors[largest] / areas[largest])


def by_shell(faces: Faces, shell: IntArray) -> list[list[tuple[int, ...]]]:
    result: list[list[tuple[int, ...]]] = [[] for _ in range(int(shell.max()) + 1)]
    for face, number in zip(faces, shell.tolist(), strict=True):
        result[number].append(face)
    return result


def winding(point: FloatArray, triangles: FloatArray) -> float:
    """How often a closed surface of ``triangles`` (t, 3, 3) goes round ``point``, 0 outside: solid
    angles (van Oosterom and Strackee 1983) over 4 pi."""
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    top = np.einsum("tk,tk->t", a, np.cross(b, c))
    bottom = la * lb * lc
    for u, v, length in ((a, b, lc), (b, c, la), (c, a, lb)):
        bottom = bottom + np.einsum("tk,tk->t", u, v) * length
    return float(np.arctan2(top, bottom).sum() / (2.0 * np.pi))
