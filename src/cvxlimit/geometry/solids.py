"""Blocks from meshes as programs write them: repaired where that is safe, with every repair
listed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

import cvxlimit.geometry.mesh as mesh
import cvxlimit.geometry.polyhedra as polyhedra
from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import positive
from cvxlimit.errors import GeometryError
from cvxlimit.geometry.blocks import Block, Repair
from cvxlimit.geometry.mesh import Faces
from cvxlimit.geometry.orientation import outward


def solid(
    id: str,
    vertices: ArrayLike,
    faces: Sequence[Sequence[int]],
    density: float | None = None,
    tolerance: float | None = None,
) -> Block:
    """Returns a block from a raw mesh of triangles, polygons or both, in any order and orientation.

    ``vertices`` is (k, 3); each face lists vertex indices. What is repaired is listed in
    :attr:`Block.repairs`, by ``kind``:

    ========== ==================================================================================
    welded     vertices in the same place are joined (an STL file repeats them for every triangle)
    unused     vertices without a face are dropped
    degenerate faces without area are dropped
    doubled    of faces listed more than once one stays, or none where they are a wall inside
    joined     vertices in the middle of another face's edge become corners of that face
    turned     faces are reversed so that all normals point outwards
    split      faces warped by more than the joint tolerance are cut into triangles
    ========== ==================================================================================

    ``tolerance`` is the joint tolerance (length; None: one hundredth of the mean thickness): how
    far a face may be warped, and how wide an open seam may be. Vertices closer than 1e-6 of the
    block's size are always joined; others only along open seams, so that small features stay.

    Raises
    ------
    GeometryError
        If what remains encloses no body: it names the block and the place, and carries the points.
    """
    points = polyhedra.vertices_of(id, vertices)
    allowed = None if tolerance is None else positive(tolerance, f"tolerance of block {id!r}")
    wide = [face for face in faces if not _has_two_corners(face)]
    loops = polyhedra.checked_faces(id, wide, len(points))
    # Most blocks are convex and need no repair, which is found in a fifth of the time.
    exact = polyhedra.convex_body(points, loops)
    if exact is not None and exact.faces == loops and len(loops) == len(faces):
        return Block.of_body(id, points, exact, density)
    # Every step relies on those before: seams are looked for among faces that are there once, and
    # orientation among faces that close.
    raw = _Mesh(id, points, loops)
    raw.weld(mesh.RELATIVE_TOLERANCE * raw.size)
    raw.drop_degenerate(len(faces) - len(loops))
    raw.drop_doubled()
    raw.close_seams(polyhedra.JOINT_TOLERANCE * raw.rough_thickness if allowed is None else allowed)
    raw.drop_unused()
    raw.faces, turned = outward(id, raw.points, raw.faces)
    whole = " (the whole shell was inside out)" if turned == len(raw.faces) else ""
    raw.report("turned", turned, f"faces whose normals pointed in{whole}")
    raw.split_warped(allowed)
    polyhedra.check_faces(id, raw.points, raw.faces, mesh.RELATIVE_TOLERANCE * raw.size)
    body = polyhedra.body_inside(id, raw.points, raw.faces, allowed)
    return Block.of_body(id, raw.points, body, density, tuple(raw.repairs))


def _has_two_corners(face: object) -> bool:
    """True for a triangle that names a corner twice, so that two are left."""
    return isinstance(face, Sequence) and len(face) == 3 and len(set(face)) < 3


class _Mesh:
    """A mesh under repair: ``points`` (k, 3), ``faces`` as tuples of indices, its ``size``
    (length), and the ``repairs`` so far."""

    def __init__(self, id: str, points: FloatArray, faces: Faces) -> None:
        self.id = id
        self.points = points
        self.faces = faces
        self.size = float(np.linalg.norm(np.ptp(points, axis=0)))
        self.repairs: list[Repair] = []

    @property
    def rough_thickness(self) -> float:
        """Mean thickness 2 volume / surface (length), for faces of any orientation."""
        # Tetrahedra about the mean point: exact for convex bodies, whatever the orientation.
        triangles, _ = mesh.fan(self.points, self.faces)
        corners = triangles - self.points.mean(axis=0)
        volume = float(np.abs(np.linalg.det(corners)).sum()) / 6.0
        return 2.0 * volume / mesh.surface(self.points, self.faces)

    def default_tolerance(self) -> float:
        """Returns the joint tolerance (length) of the mesh as it is now."""
        volume, _ = mesh.volume_and_centroid(self.points, self.faces)
        return polyhedra.default_tolerance(volume, mesh.surface(self.points, self.faces))

    def weld(self, distance: float, among: IntArray | None = None) -> None:
        """Join vertices closer than ``distance``: all of them, or those with numbers ``among``."""
        chosen = np.arange(len(self.points)) if among is None else among
        pairs = cKDTree(self.points[chosen]).query_pairs(distance, output_type="ndarray")
        if not len(pairs):
            return
        label = mesh.linked(len(self.points), *chosen[pairs].T)
        _, first = np.unique(label, return_index=True)
        self.report("welded", len(self.points) - len(first), "vertices in the same place")
        self.points = self.points[first]
        faces = [label[list(face)].tolist() for face in self.faces]
        self.faces = tuple(tuple(i for k, i in enumerate(f) if i != f[k - 1]) for f in faces)

    def drop_degenerate(self, dropped: int) -> None:
        """Drop faces of fewer than three corners or without area, beside those that are ``dropped``
        already; refuse those that meet themselves."""
        real = [f for f in self.faces if len(set(f)) > 2]
        repeated = next((f for f in real if len(set(f)) < len(f)), None)
        if repeated is not None:
            raise GeometryError(
                f"block {self.id!r} has a face that meets itself at "
                f"{mesh.place(self.points[repeated[0]])}: cut it into simple faces",
                points=self.points[list(repeated)],
                blocks=(self.id,),
            )
        if real:
            # Wider than rounding; slivers that fill a gap of no width leave a seam that is closed.
            areas = np.linalg.norm(mesh.area_vectors(self.points, real), axis=1)
            long = [float(np.linalg.norm(np.ptp(self.points[list(f)], axis=0))) for f in real]
            least = 0.5 * mesh.RELATIVE_TOLERANCE * self.size
            rows = zip(real, areas.tolist(), long, strict=True)
            real = [f for f, area, length in rows if area > least * length]
        self.report("degenerate", dropped + len(self.faces) - len(real), "faces without area")
        if len(real) < 4:
            raise GeometryError(
                f"block {self.id!r} is degenerate: {len(real)} of its {len(self.faces)} faces have "
                "an area, four are needed",
                points=self.points,
                blocks=(self.id,),
            )
        self.faces = tuple(real)

    def drop_doubled(self) -> None:
        """Keep one of several faces with the same vertices, or none where each of its edges belongs
        to two other faces: then it is a wall within the body."""
        copies: dict[frozenset[int], list[tuple[int, ...]]] = defaultdict(list)
        for face in self.faces:
            copies[frozenset(face)].append(face)
        if len(copies) == len(self.faces):
            return
        table = mesh.EdgeTable.of([same[0] for same in copies.values()])
        inner = np.ones(len(copies), dtype=bool)
        np.logical_and.at(inner, table.face, table.uses[table.key] == 3)
        pairs = zip(copies.values(), inner.tolist(), strict=True)
        single = tuple(same[0] for same, is_inner in pairs if len(same) == 1 or not is_inner)
        self.report("doubled", len(self.faces) - len(single), "faces listed more than once")
        self.faces = single

    def close_seams(self, distance: float) -> None:
        """Close open seams up to ``distance`` wide, those without width first."""
        self._join(mesh.RELATIVE_TOLERANCE * self.size)
        _, sides, ends = self._open_sides()
        if len(sides):
            self.weld(distance, ends)
            self.faces = tuple(f for f in self.faces if len(set(f)) > 2)
            self._join(distance)

    def _open_sides(self) -> tuple[mesh.EdgeTable, IntArray, IntArray]:
        """Returns the table of all sides, the numbers of those on edges of one face, and the
        vertices at their ends."""
        table = mesh.EdgeTable.of(self.faces)
        sides = np.flatnonzero(table.uses[table.key] == 1)
        return table, sides, np.union1d(table.start[sides], table.end[sides])

    def _join(self, distance: float) -> None:
        """Make vertices of open edges within ``distance`` of another open edge corners of its
        face."""
        table, sides, ends = self._open_sides()
        if not len(sides):
            return
        self.faces, joined = mesh.with_corners_on(
            sides, ends, distance, self.points, table, self.faces
        )
        self.report("joined", joined, "vertices in the middle of another face's edge")

    def drop_unused(self) -> None:
        """Drop vertices without a face, and number the others anew."""
        used = np.unique([i for f in self.faces for i in f])
        self.report("unused", len(self.points) - len(used), "vertices without a face")
        self.points = self.points[used]
        self.faces = tuple(tuple(np.searchsorted(used, f).tolist()) for f in self.faces)

    def split_warped(self, tolerance: float | None) -> None:
        """Cut faces that are warped by more than ``tolerance`` (length) into triangles.

        None means the default tolerance. Cutting adds surface and so lowers it a little, hence the
        repetition until all faces fit.
        """
        split, most = 0, 0.0
        while True:
            allowed = self.default_tolerance() if tolerance is None else tolerance
            off = polyhedra.warps(self.points, self.faces)
            # A triangle is flat, though rounding tells otherwise where there is next to no volume.
            bent = (off > allowed) & np.array([len(face) > 3 for face in self.faces])
            warped = np.flatnonzero(bent).tolist()
            if not warped:
                break
            split, most = split + len(warped), max(most, float(off.max()))
            cut, _ = mesh.triangulated(self.points, [self.faces[i] for i in warped])
            flat = [self.faces[i] for i in np.flatnonzero(~bent).tolist()]
            self.faces = (*flat, *(tuple(t) for t in cut.tolist()))
        self.report("split", split, f"faces warped by up to {most:.3g}, cut into triangles")

    def report(self, kind: str, count: int, detail: str) -> None:
        """Add a repair to the list if its ``count`` is not 0."""
        if count:
            self.repairs.append(Repair(kind, count, detail))
