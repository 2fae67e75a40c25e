"""Planes of no thickness as supports: ground drawn as one face, or as triangles of one plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, is_plane, merged
from cvxlimit.geometry.mesh import EdgeTable, area_vectors
from cvxlimit.io.fields import shown


def is_sheet(body: Body) -> bool:
    """True for a body whose corners all lie in one plane, and which has an area in it."""
    if body.is_box or not len(body.faces) or not np.isfinite(body.vertices).all():
        return False
    if min(map(len, body.faces)) < 3 or not is_plane(body.vertices):
        return False
    # The corners may span an area that no face has.
    return bool(np.any(area_vectors(body.vertices, body.faces)))


def with_slabs(bodies: list[Body], fixed: set[str], notes: list[str]) -> list[Body]:
    """Sheets as slabs: a plane of no thickness bears what stands on it, but is no stone."""
    sheets = [body for body in bodies if is_sheet(body)]
    if not sheets:
        return bodies
    loose = [body for body in sheets if body.name not in fixed]
    if loose:
        raise InputError(
            f"block {shown(loose[0].name)} is a plane of no thickness, which encloses no stone: it "
            "can only be a support; name it among the supports, or remove it"
        )
    others = [body for body in bodies if not is_sheet(body)]
    deep = _thickness_for(others)
    notes += [
        f"{shown(body.name)} is a plane of no thickness, taken as support: in the scene a slab of "
        f"{deep:.3g} lies behind it"
        for body in sheets
    ]
    return [_slab(body, others, deep) if is_sheet(body) else body for body in bodies]


def _slab(sheet: Body, others: Sequence[Body], thickness: float) -> Body:
    """The sheet as a slab that lies behind it, seen from where most of the other bodies are."""
    # Corners (k, 3), each stored once, and faces as lists of their numbers.
    points, number = merged(sheet.vertices, np.arange(len(sheet.vertices)))
    faces = [[int(number[i]) for i in face] for face in sheet.faces]
    # The unit normal (3,) is that of the largest face, towards the side of most of the others.
    vectors = area_vectors(points, faces)  # (faces, 3)
    normal = vectors[int(np.linalg.norm(vectors, axis=1).argmax())]
    normal = normal / np.linalg.norm(normal)
    middles = np.array([np.mean(other.vertices, axis=0) for other in others]).reshape(-1, 3)
    if (np.sign((middles - points[0]) @ normal)).sum() < 0:
        normal = -normal
    # The front: all faces turned that way. The back: corner i again as k + i, faces the other way.
    front = [f if v @ normal > 0.0 else f[::-1] for f, v in zip(faces, vectors, strict=True)]
    k, behind = len(points), points - thickness * normal
    back = [[k + i for i in f[::-1]] for f in front]
    # Between them a side along each edge a-b of the rim, that of one face only.
    table = EdgeTable.of(front)
    rim = np.flatnonzero(table.uses[table.key] == 1)
    ends = np.stack([table.start[rim], table.end[rim]], axis=1).tolist()
    sides = [[b, a, k + a, k + b] for a, b in ends]
    return replace(sheet, vertices=np.vstack([points, behind]), faces=[*front, *back, *sides])


def _thickness_for(others: Sequence[Body]) -> float:
    """Of a slab behind a sheet: no thinner than any of the others, whose joint tolerance counts."""
    return max((float(np.ptp(b.vertices, axis=0).min()) for b in others), default=0.0)
