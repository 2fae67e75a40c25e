"""How contacts move with the vertices of their blocks, to first order.

A contact is the overlap of one facet of each block, projected on the mean of their planes. Each of
its corners lies where two edges cross. An edge belongs to one facet or, where both blocks end
together, to both; it then moves by the mean of both. Normal and height of the contact are the means
of the two facets'. For joints that gape, or faces that are warped, by a share s of their size, the
slopes are right to s.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.facing import FacetTable
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, fan
from cvxlimit.geometry.polygons import united


@dataclass(frozen=True, eq=False)
class Shapes:
    """The distinct points of n contacts: corners of their hulls, and of the pieces of those that
    are not convex.

    Contact j has the rows from ``start[j]`` to ``start[j + 1]`` of ``points`` (m, 2), in its plane
    (t1, t2). ``corner`` (c,) is the row of every corner of the hulls, in the order of
    ``contacts.corner_xy``; ``pieces[j]`` are the rows of each piece of contact j.
    """

    contacts: Contacts
    start: IntArray
    points: FloatArray
    corner: IntArray
    pieces: dict[int, list[IntArray]]

    @classmethod
    def of(cls, contacts: Contacts) -> Shapes:
        start, points, corner = [0], [], []
        pieces: dict[int, list[IntArray]] = {}
        for j in range(len(contacts)):
            polygons = [contacts.corners_of(j), *contacts.pieces.get(j, ())]
            own, place = np.concatenate(polygons), np.arange(sum(map(len, polygons)))
            if len(polygons) > 1:
                near = np.round(own / (RELATIVE_TOLERANCE * float(np.sqrt(contacts.area[j]))))
                _, first, place = np.unique(near, axis=0, return_index=True, return_inverse=True)
                own = own[first]
            rows = np.split(start[-1] + place.ravel(), np.cumsum([*map(len, polygons)])[:-1])
            corner.append(rows[0])
            if len(rows) > 1:
                pieces[j] = rows[1:]
            points.append(own)
            start.append(start[-1] + len(own))
        return cls(
            contacts, np.array(start), np.concatenate(points), np.concatenate(corner), pieces
        )

    def moved(self, shift: FloatArray) -> Contacts:
        """The contacts after their points have moved by ``shift`` (m, 2) in their planes."""
        c, points = self.contacts, self.points + shift
        xy = points[self.corner]
        ahead = np.arange(1, len(xy) + 1)
        ahead[c.corner_start[1:] - 1] = c.corner_start[:-1]
        doubled = xy[:, 0] * xy[ahead, 1] - xy[:, 1] * xy[ahead, 0]
        add = np.add.reduceat
        area = add(doubled, c.corner_start[:-1]) / 2.0
        middle = add(doubled[:, None] * (xy + xy[ahead]), c.corner_start[:-1]) / 6.0
        area[c.is_point] = c.area[c.is_point]  # points stay where they are
        middle /= area[:, None]
        pieces = {}
        for j, parts in self.pieces.items():
            polygons = [points[rows] for rows in parts]
            _, area[j], middle[j] = united(polygons)
            pieces[j] = tuple(polygon - middle[j] for polygon in polygons)
        # of a rectangle each side is the mean of two opposite ones, which has the same slope
        sign = np.sign(c.corner_xy)
        number = np.diff(c.corner_start)[:, None]
        sides = 2.0 * add(sign * xy, c.corner_start[:-1]) / number
        return replace(
            c,
            origin=c.origin + np.einsum("ni,nix->nx", middle, c.axes[:, :2]),
            corner_xy=xy - middle[c.corner_contact],
            sides=np.where(c.is_rectangle[:, None], sides, np.nan),
            area=area,
            pieces=pieces,
        )


@dataclass(frozen=True, eq=False)
class Follows:
    """Derivatives of one contact by the k vertices ``vertex`` of one of its blocks.

    Attributes
    ----------
    contact, block : int
        Numbers of the contact and of the block.
    vertex : (k,)
        Numbers of the block's vertices.
    in_plane : (p, k, 2, 2)
        Of the contact's p points, by the vertex's displacement in the plane (t1, t2); the
        component of the point comes first.
    height : (k,), tilt : (k, 3)
        Of the contact's height along its normal, and of its unit normal, by the displacement of the
        vertex along the normal.
    shares : (k,)
        True for vertices of edges that belong to both blocks.
    """

    contact: int
    block: int
    vertex: IntArray
    in_plane: FloatArray
    height: FloatArray
    tilt: FloatArray
    shares: FloatArray


@dataclass(frozen=True, eq=False)
class _Facet:
    """A facet of a block with vertices ``points`` (v, 3), tiled by ``loops`` of vertex numbers."""

    points: FloatArray
    loops: Sequence[Sequence[int]]

    @property
    def edges(self) -> IntArray:
        """Both ends (e, 2) of each outer edge; edges between two loops are left out."""
        every = {(loop[i - 1], loop[i]) for loop in self.loops for i in range(len(loop))}
        return np.array([(i, k) for i, k in sorted(every) if (k, i) not in every])

    def plane(self, vertex: IntArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the plane's height (k,) at the point ``at`` (3,) and of its unit normal
        (k, 3), by displacements of the vertices ``vertex`` (k,) along the normal."""
        whole, weight = np.zeros(3), []
        turned, middle = np.zeros((len(self.points), 3)), np.zeros(3)
        for loop in self.loops:
            p = self.points[list(loop)]
            vector = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0) / 2.0
            whole += vector
            weight.append(float(np.linalg.norm(vector)))
            middle += weight[-1] * p.mean(axis=0)
        size, total = float(np.linalg.norm(whole)), sum(weight)
        normal, share = whole / size, np.zeros(len(self.points))
        for loop, own in zip(self.loops, weight, strict=True):
            p = self.points[list(loop)]
            chord = np.roll(p, -1, axis=0) - np.roll(p, 1, axis=0)
            turned[list(loop)] += np.cross(normal, chord) / (2.0 * size)
            share[list(loop)] += own / total / len(loop)
        return share[vertex] - turned[vertex] @ (at - middle / total), turned[vertex]


def followed(shapes: Shapes, blocks: Sequence[Block], table: FacetTable) -> Iterator[Follows]:
    """Yields the derivatives of every contact by the vertices of both its blocks, two per contact;
    none for contacts of ties, and for contacts whose facets are not in the table."""
    c = shapes.contacts
    start = np.searchsorted(table.block, np.arange(len(blocks) + 1))
    index = [{p.tobytes(): i for i, p in enumerate(block.vertices)} for block in blocks]
    for j in range(len(c)):
        sides = []
        for block, outward in ((int(c.a[j]), c.axes[j, 2]), (int(c.b[j]), -c.axes[j, 2])):
            # The facet of the block that is nearest to the contact and looks the same way.
            rows = np.arange(start[block], start[block + 1])
            corners = c.origin[j] + c.corners_of(j) @ c.axes[j, :2]
            off = np.abs(
                np.einsum("mkc,mc->mk", corners - table.point[rows, None], table.normal[rows])
            ).max(axis=1)
            off[table.normal[rows] @ outward < 0.9] = np.inf
            best = rows[off.argmin()]
            if off.min() > 0.1 * np.sqrt(c.area[j]):
                break
            loops = [
                [index[block][p.tobytes()] for p in table.corners[row, : table.sides[row]]]
                for row in rows[table.facet[rows] == table.facet[best]]
            ]
            sides.append((block, _Facet(blocks[block].vertices, loops)))
        if len(sides) == 2:
            yield from _both(shapes, j, sides)


class _Edge(NamedTuple):
    """An edge of a facet that passes through a point of a contact.

    ``normal`` (2,) is in the contact's plane, ``side`` 0 for block a and 1 for b, ``ends`` are the
    vertices, and ``part`` is where between them the point lies, from 0 to 1.
    """

    normal: FloatArray
    side: int
    ends: tuple[int, int]
    part: float


def _both(shapes: Shapes, j: int, sides: Sequence[tuple[int, _Facet]]) -> Iterator[Follows]:
    """The derivatives of contact j by the vertices of both ``sides``: a block, and its facet."""
    contacts, through = shapes.contacts, _edges_through(shapes, j, [facet for _, facet in sides])
    vertex = [np.unique([i for loop in facet.loops for i in loop]) for _, facet in sides]
    found = [np.zeros((len(through), len(v), 2, 2)) for v in vertex]
    shares = [np.zeros(len(v), dtype=bool) for v in vertex]
    ways = _neighbours(shapes, j)
    for p, edges in enumerate(through):
        lines = _lines(edges, ways.get(p))
        if not lines:
            continue
        # The point stays on both lines: its displacement d solves normal_i @ d = shift_i, where the
        # shift of a line is shared among its edges, and between the ends of each edge.
        moves = np.linalg.pinv(np.array([line[0].normal for line in lines]))
        for column, line in zip(moves.T, lines, strict=True):
            by_shift = np.outer(column, line[0].normal)
            of = [edge.side for edge in line]
            for edge in line:
                share = 1.0 / len({*of}) / of.count(edge.side)
                for end, weight in zip(edge.ends, (1.0 - edge.part, edge.part), strict=True):
                    at = int(np.searchsorted(vertex[edge.side], end))
                    found[edge.side][p, at] += share * weight * by_shift
                    shares[edge.side][at] |= len({*of}) == 2 and weight > RELATIVE_TOLERANCE
    for side, (block, facet) in enumerate(sides):
        height, tilt = facet.plane(vertex[side], contacts.origin[j])
        # each plane is one of two; that b's normal and its changes point the other way cancels
        half = 0.5 * height, 0.5 * tilt
        yield Follows(j, block, vertex[side], found[side], *half, shares[side])


def _edges_through(shapes: Shapes, j: int, facets: Sequence[_Facet]) -> list[list[_Edge]]:
    """For each point of contact j the edges of both facets that pass through it."""
    c, points = shapes.contacts, shapes.points[shapes.start[j] : shapes.start[j + 1]]
    near = RELATIVE_TOLERANCE * float(np.sqrt(c.area[j]))
    found: list[list[_Edge]] = [[] for _ in points]
    for side, facet in enumerate(facets):
        flat = (facet.points - c.origin[j]) @ c.axes[j, :2].T
        for i, k in facet.edges.tolist():
            along = flat[k] - flat[i]
            length = float(np.linalg.norm(along))
            if length <= near:
                continue
            normal = np.array([-along[1], along[0]]) / length
            part = (points - flat[i]) @ along / length**2
            on = np.abs((points - flat[i]) @ normal) <= near
            on &= (part >= -near / length) & (part <= 1.0 + near / length)
            for p in np.flatnonzero(on).tolist():
                found[p].append(_Edge(normal, side, (i, k), float(part[p])))
    return found


def _lines(edges: Sequence[_Edge], ways: Sequence[FloatArray] | None) -> list[list[_Edge]]:
    """Edges through a point by the lines they lie on; of more than two lines those along ``ways``,
    the contact's own edges there, if it has a corner there."""
    lines: list[list[_Edge]] = []
    for edge in edges:
        x, y = edge.normal
        for line in lines:
            if abs(line[0].normal[0] * y - line[0].normal[1] * x) < RELATIVE_TOLERANCE:
                line.append(edge)
                break
        else:
            lines.append([edge])
    if len(lines) > 2 and ways is not None:
        lines.sort(key=lambda line: min(abs(line[0].normal @ way) for way in ways))
        return lines[:2]
    return lines


def _neighbours(shapes: Shapes, j: int) -> dict[int, list[FloatArray]]:
    """Unit vectors along both edges of the hull at its corners, by point of the contact."""
    c = shapes.contacts
    rows = shapes.corner[c.corner_start[j] : c.corner_start[j + 1]] - shapes.start[j]
    xy = c.corners_of(j)
    back, ahead = xy - np.roll(xy, 1, axis=0), np.roll(xy, -1, axis=0) - xy
    ways = [v / np.linalg.norm(v, axis=1)[:, None] for v in (back, ahead)]
    return {int(row): [ways[0][k], ways[1][k]] for k, row in enumerate(rows)}


def volume_slopes(block: Block) -> tuple[FloatArray, FloatArray]:
    """Derivatives of a block's volume (v, 3) and centroid (v, 3, 3) by its v vertices. Those of the
    centroid are [vertex, component of the centroid, component of the vertex]."""
    count = len(block.vertices)
    # a fan's corners are means of vertices: which ones, three columns at a time
    eye = np.eye(count, 3 * -(-count // 3))
    parts = [fan(eye[:, k : k + 3], block.faces)[0] for k in range(0, eye.shape[1], 3)]
    made = np.concatenate(parts, axis=2)[:, :, :count]
    p = np.einsum("tkv,vx->tkx", made, block.vertices - block.centroid)
    by_volume = np.stack([np.cross(p[:, k - 2], p[:, k - 1]) for k in range(3)], axis=1) / 6.0
    each = np.einsum("tx,tx->t", p[:, 0], by_volume[:, 0])
    by_moment = by_volume[:, :, None, :] * p.sum(axis=1)[:, None, :, None]
    by_moment = (by_moment + each[:, None, None, None] * np.eye(3)) / 4.0
    volume = np.einsum("tkv,tkx->vx", made, by_volume)
    return volume, np.einsum("tkv,tkcx->vcx", made, by_moment) / block.volume
