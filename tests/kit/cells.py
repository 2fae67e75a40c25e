"""Bodies of unit cells: closed surfaces that touch themselves as they happen to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.geometry.blocks import BOX_FACES, Block

CUBE = Block.box("cube", (0, 0, 0), (1, 1, 1))


def cells(places: Sequence[Sequence[int]]) -> tuple[np.ndarray, list[list[int]]]:
    """The boundary of unit cells with their lowest corners at ``places``, vertices shared."""
    filled = {tuple(place) for place in places}
    number: dict[tuple[int, ...], int] = {}
    faces = []
    for place in sorted(filled):
        for face in BOX_FACES:
            corners = CUBE.vertices[list(face)]
            beyond = tuple(int(x) for x in np.add(place, np.rint(2 * corners.mean(axis=0) - 1)))
            if beyond not in filled:
                at = [tuple(int(x) for x in np.add(place, corner)) for corner in corners]
                faces.append([number.setdefault(p, len(number)) for p in at])
    return np.array(list(number), dtype=float), faces
