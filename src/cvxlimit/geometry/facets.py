"""Planar facets of a block: its faces grouped by plane, and cut into convex pieces.

Faces in one plane are one facet whether or not they share an edge: what two bodies transmit through
one plane is one contact, and a bridge of no width between two feet must not change its answer.

There are two groupings. :func:`facets` takes what lies within a tolerance of a plane as that plane:
a warped, scanned or hammered face. :func:`planes` joins only what rounding keeps from one plane:
the faces as they are, for joints whose two sides agree on a shape (:mod:`.curved`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

import cvxlimit.geometry.mesh as mesh
from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.mesh import RELATIVE_TOLERANCE, Faces

SAME_WAY = 0.9
"""Cosine below which faces are not one facet, however small they are (26 degrees): a fillet
narrower than the tolerance must not carry a facet around its edge. Nor do facets face each other
that are turned by more."""

_CURVED = 0.5
"""Patches on curved surfaces keep within this share of the tolerance: those of two blocks that meet
there differ, and their planes must still agree within it. Patches of the whole tolerance lose some
8 % of the area of a curved joint."""

_PARALLEL = 0.05
"""Facets whose unit normals, and whose distances over the body's size, differ by less are looked
at for a common plane. Wide enough for facets of 1/20 of the body within any sensible tolerance."""


@dataclass(frozen=True)
class Facets:
    """Planar facets of a body.

    Attributes
    ----------
    faces
        Per facet, the numbers of the body's faces that make it up.
    pieces, facet
        Convex polygons that tile the facets (vertex indices, counter-clockwise seen from outside),
        and the number of the facet that each belongs to, in ascending order.
    sheet
        Per facet, the number of its sheet: facets of one sheet meet without a sharp edge.
    lumped
        Per facet, True if it joins several faces that may be a curved shape rather than a plane.
    """

    faces: Faces
    pieces: Faces
    facet: tuple[int, ...]
    sheet: tuple[int, ...]
    lumped: tuple[bool, ...]

    @classmethod
    def of_faces(cls, faces: Faces) -> Facets:
        """Every face as a facet, piece and sheet of its own, whatever plane it lies in."""
        numbers = tuple(range(len(faces)))
        return cls(tuple((i,) for i in numbers), faces, numbers, numbers, (False,) * len(faces))


def facets(points: FloatArray, faces: Faces, tolerance: float) -> Facets:
    """Groups faces into facets whose corners all lie within ``tolerance`` (length) of the facet's
    mean plane. Curved surfaces are covered by patches, each grown from a large face as far as the
    tolerance lets it."""
    surface = _Surface(points, faces, tolerance, SAME_WAY, narrow=tolerance)
    sheet, label = _joined_across_edges(surface)
    return _facets(surface, faces, sheet, _joined_by_plane(surface, label))


def planes(points: FloatArray, faces: Faces, among: IntArray) -> Facets:
    """Groups the faces with numbers ``among`` (k,) into facets of faces that share an edge and lie
    in one plane to six digits. Faces that share no edge stay apart: on a saddle, distant ones lie
    in one plane."""
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    parallel = 1.0 - 0.5 * RELATIVE_TOLERANCE**2
    some = tuple(faces[i] for i in among.tolist())
    surface = _Surface(points, some, RELATIVE_TOLERANCE * size, parallel, narrow=0.0)
    sheet, label = _joined_across_edges(surface)
    found = _facets(surface, some, sheet, label)
    return replace(found, faces=tuple(tuple(among[list(g)].tolist()) for g in found.faces))


def _facets(surface: _Surface, faces: Faces, sheet: IntArray, label: IntArray) -> Facets:
    """The facets of faces that are grouped by ``label`` (f,), and lie on sheets ``sheet`` (f,)."""
    points = surface.points
    members: dict[int, list[int]] = {}
    for face, group in enumerate(label.tolist()):
        members.setdefault(group, []).append(face)
    pieces: list[tuple[int, ...]] = []
    owner: list[int] = []
    for number, group in enumerate(members.values()):
        found = _convex_pieces(points, [faces[i] for i in group], surface.plane(np.array(group))[0])
        pieces += found
        owner += [number] * len(found)
    # Sheets that have a facet in common are one: a graph of sheets, which are numbered below the
    # number of faces, and facets, numbered from there on, has a link for each face.
    sheets = mesh.linked(len(faces) + int(label.max()) + 1, sheet, len(faces) + label)
    own = sheets[sheet[[group[0] for group in members.values()]]]  # of each facet
    alone = np.bincount(own)[own] == 1
    return Facets(
        tuple(map(tuple, members.values())),
        tuple(pieces),
        tuple(owner),
        tuple(own.tolist()),
        tuple(
            len(group) > 1 and not (is_alone and _is_cut_in_two([faces[i] for i in group]))
            for group, is_alone in zip(members.values(), alone.tolist(), strict=True)
        ),
    )


def _is_cut_in_two(faces: Sequence[tuple[int, ...]]) -> bool:
    """True for two triangles, which alone on a sheet are a warped quadrilateral: whether a file
    holds it whole or cut along a diagonal must not change an answer."""
    return len(faces) == 2 and max(map(len, faces)) == 3


class _Surface:
    """Faces with their area vectors, mean corners and neighbours, for one grouping."""

    def __init__(
        self, points: FloatArray, faces: Faces, tolerance: float, way: float, narrow: float
    ) -> None:
        """A face belongs to a plane if it lies within ``tolerance`` (length) of it and the cosine
        between their normals exceeds ``way``. Faces narrower than ``narrow`` (length) have no
        reliable normal, and need only lie within the tolerance."""
        self.points, self.tolerance, self.way, self.narrow = points, tolerance, way, narrow
        self.vectors = mesh.area_vectors(points, faces)
        self.area = np.linalg.norm(self.vectors, axis=1)
        self.normal = self.vectors / self.area[:, None]
        self.corners = points[mesh.padded(faces)]
        self.middle = np.array([points[list(f)].mean(axis=0) for f in faces])
        steps = np.linalg.norm(np.roll(self.corners, -1, axis=1) - self.corners, axis=2)
        self.narrowness = 2.0 * self.area / steps.max(axis=1)
        table = mesh.EdgeTable.of(faces)
        self.neighbours = [table.face[side] for side in table.twins()]
        self.size = float(np.linalg.norm(np.ptp(points, axis=0)))

    def plane(self, group: IntArray) -> tuple[FloatArray, FloatArray]:
        """Unit normal (3,) and a point (3,) of the mean plane of some faces."""
        normal = self.vectors[group].sum(axis=0)
        weight = self.area[group]
        length = float(np.linalg.norm(normal)) or 1.0  # none for faces all around a body
        return normal / length, weight @ self.middle[group] / weight.sum()

    def fits(
        self, group: IntArray, normal: FloatArray, point: FloatArray, share: float = 1.0
    ) -> BoolArray:
        """Which faces belong to a plane, within a ``share`` of the tolerance."""
        same = self.normal[group] @ normal > self.way
        narrow = self.narrowness[group] <= share * self.narrow
        off = np.abs((self.corners[group] - point) @ normal).max(axis=1)
        return np.asarray((off <= share * self.tolerance) & (same | narrow))


def _joined_across_edges(surface: _Surface) -> tuple[IntArray, IntArray]:
    """Returns the number of each face's sheet (f,) and of its patch (f,). A sheet joins neighbours
    without a sharp edge; a patch is the part of it within the tolerance of one plane. Faces too
    narrow to have a normal belong to patches, but join no sheets."""
    f, g = surface.neighbours
    same = np.einsum("ek,ek->e", surface.normal[f], surface.normal[g]) > surface.way
    sheet = mesh.linked(len(surface.area), f[same], g[same])
    same |= np.minimum(surface.narrowness[f], surface.narrowness[g]) <= surface.narrow
    f, g = f[same], g[same]
    label = mesh.linked(len(surface.area), f, g)
    result = label.copy()
    sizes = np.bincount(label)
    for group in (np.flatnonzero(label == k) for k in np.flatnonzero(sizes > 1).tolist()):
        if not surface.fits(group, *surface.plane(group)).all():
            for patch in _patches(surface, group, f, g):
                result[patch] = result.max() + 1
    return sheet, result


def _patches(surface: _Surface, group: IntArray, f: IntArray, g: IntArray) -> Iterable[IntArray]:
    """Cuts faces that are no plane together into patches. Each is grown from its largest free face,
    by rings of neighbours (pairs ``f``, ``g``) that fit the plane of the patch so far."""
    # The neighbours of each face i: target[begin[i]:begin[i + 1]].
    inside = np.isin(f, group)
    ends = np.concatenate([f[inside], g[inside]]), np.concatenate([g[inside], f[inside]])
    order = np.argsort(ends[0], kind="stable")
    start, target = ends[0][order], ends[1][order]
    begin = np.searchsorted(start, np.arange(len(surface.area) + 1))
    # Seeds by falling area; equal areas in the order of their faces, whatever rounding says.
    free = np.zeros(len(surface.area), dtype=bool)
    free[group] = True
    falling = group[np.argsort(-surface.area[group], kind="stable")]
    area = surface.area[falling]
    alike = np.split(falling, np.flatnonzero(-np.diff(area) > RELATIVE_TOLERANCE * area[:-1]) + 1)
    for seed in np.concatenate([np.sort(seeds) for seeds in alike]).tolist():
        if not free[seed]:
            continue
        patch = frontier = np.array([seed])
        free[seed] = False
        while len(frontier):
            around = np.unique(
                np.concatenate([target[begin[i] : begin[i + 1]] for i in frontier.tolist()])
            )
            around = around[free[around]]
            frontier = around[surface.fits(around, *surface.plane(patch), _CURVED)]
            free[frontier] = False
            patch = np.concatenate([patch, frontier])
        # The plane has moved as the patch grew: faces that no longer fit are free again.
        kept = surface.fits(patch, *surface.plane(patch), _CURVED)
        if not kept[0]:
            kept = np.arange(len(patch)) == 0
        free[patch[~kept]] = True
        yield patch[kept]


def _joined_by_plane(surface: _Surface, label: IntArray) -> IntArray:
    """The labels (f,) after joining patches in one plane, whether or not they share an edge."""
    names, label = np.unique(label, return_inverse=True)
    order = np.argsort(label, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(label))[:-1])
    planes = [surface.plane(group) for group in groups]
    normal, point = (np.array([p[i] for p in planes]) for i in range(2))
    level = np.einsum("gk,gk->g", normal, point - point.mean(axis=0)) / surface.size
    tree = cKDTree(np.column_stack([normal, level]))
    pairs = tree.query_pairs(_PARALLEL, output_type="ndarray").reshape(-1, 2)
    one, other = pairs[np.lexsort(pairs.T[::-1])].T  # the tree's own order turns with the body
    between = point[other] - point[one]
    near = np.abs(np.einsum("pk,pk->p", between, normal[one])) <= surface.tolerance
    near &= np.abs(np.einsum("pk,pk->p", between, normal[other])) <= surface.tolerance
    joined = np.arange(len(names))
    for i, k in zip(one[near].tolist(), other[near].tolist(), strict=True):
        i, k = sorted((int(joined[i]), int(joined[k])))
        both = np.concatenate([groups[i], groups[k]])
        if i != k and surface.fits(both, *surface.plane(both)).all():
            joined[joined == k] = i
            groups[i] = both
    return joined[label]


def _convex_pieces(
    points: FloatArray, faces: Sequence[tuple[int, ...]], normal: FloatArray
) -> list[tuple[int, ...]]:
    """Convex polygons that tile faces in one plane: one, without corners on straight sides, if
    their outline is convex; else the faces as they are, and triangles of those not convex."""
    axes = mesh.plane_axes(normal)
    outline = faces[0] if len(faces) == 1 else _outline(faces)
    if outline is not None and _is_convex(points[list(outline)] @ axes.T):
        return [_without_straight(points, outline, axes)]
    pieces = []
    for face in faces:
        if _is_convex(points[list(face)] @ axes.T):
            pieces.append(face)
        else:
            pieces += [tuple(t) for t in mesh.triangulated(points, [face])[0].tolist()]
    return pieces


def _outline(faces: Sequence[tuple[int, ...]]) -> tuple[int, ...] | None:
    """The loop of vertices around faces in one plane; None if they have several, or holes."""
    sides = {(f[i - 1], f[i]) for f in faces for i in range(len(f))}
    following = {i: k for i, k in sides if (k, i) not in sides}
    if len(following) < sum((k, i) not in sides for i, k in sides):
        return None
    first = next(i for f in faces for i in f if i in following)
    loop = [first]
    while (ahead := following.get(loop[-1])) is not None and ahead != first:
        if len(loop) >= len(following):
            return None
        loop.append(ahead)
    return tuple(loop) if len(loop) == len(following) else None


def _is_convex(corners: FloatArray) -> bool:
    """True for counter-clockwise convex polygons (k, 2), straight corners included."""
    along = np.roll(corners, -1, axis=0) - corners
    ahead = np.roll(along, -1, axis=0)
    turns = mesh.turn(along, ahead)
    scale = np.hypot(*along.T) * np.hypot(*ahead.T)
    bends = np.arctan2(turns, (along * ahead).sum(axis=1))
    once = abs(float(bends.sum()) - 2.0 * np.pi) < 1.0
    return once and bool((turns >= -ROUNDING * scale).all())


def _without_straight(
    points: FloatArray, loop: tuple[int, ...], axes: FloatArray
) -> tuple[int, ...]:
    """The loop without the vertices in the middle of its straight sides."""
    flat = points[list(loop)] @ axes.T
    back, ahead = flat - np.roll(flat, 1, axis=0), np.roll(flat, -1, axis=0) - flat
    scale = np.hypot(*back.T) * np.hypot(*ahead.T)
    bends = mesh.turn(back, ahead) > ROUNDING * scale
    return tuple(i for i, bent in zip(loop, bends, strict=True) if bent)
