"""Scenes in the plane (x, z) as a linear program: a second path to their load factors.

Two normal forces and one shear per contact, SciPy's ``linprog``, nothing of the package's solver.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array, hstack

from cvxlimit.scene import Scene


def planar_load_factor(scene: Scene) -> float | None:
    """The largest load factor in the plane (x, z), or None if no load factor is in equilibrium."""
    matrix, shear = _planar_equilibrium(scene)
    dead, live = (
        np.column_stack([f[:, 0], f[:, 2], f[:, 4]]).ravel() / scene.total_weight
        for f in (scene.dead_forces, scene.live_forces)
    )
    count = len(scene.contacts)
    columns = hstack([matrix, coo_array(live[:, None])])
    friction = _friction_rows(scene.contacts.friction, shear)
    answer = linprog(
        np.append(np.zeros(3 * count), -1.0),
        A_ub=friction,
        b_ub=np.zeros(friction.shape[0]),
        A_eq=columns,
        b_eq=-dead,
        bounds=[(0, None)] * (2 * count) + [(None, None)] * (count + 1),
        options={"primal_feasibility_tolerance": 1e-10},
    )
    assert answer.status in (0, 2), answer.message
    return float(answer.x[-1]) if answer.status == 0 else None


def _planar_equilibrium(scene: Scene) -> tuple[coo_array, np.ndarray]:
    """Columns: normal force at both ends of every contact (2 n), then shear (n)."""
    contacts, count = scene.contacts, len(scene.contacts)
    place = {int(block): row for row, block in enumerate(scene.free)}
    entries: list[tuple[int, int, float]] = []
    for j, contact in enumerate(contacts):
        normal = contact.normal[[0, 2]]
        tangent = np.array([-normal[1], normal[0]])
        points = contact.corners[:, [0, 2]]
        along = points @ tangent
        ends = points[along.argmin()], points[along.argmax()]
        forces = (
            (j, ends[0], normal),
            (count + j, ends[1], normal),
            (2 * count + j, ends[0], tangent),
        )
        for column, point, force in forces:
            for block, sign in ((contacts.a[j], -1.0), (contacts.b[j], 1.0)):
                if int(block) in place:
                    arm = point - scene.blocks[block].centroid[[0, 2]]
                    moment = arm[1] * force[0] - arm[0] * force[1]
                    rows = (*(sign * force), sign * moment)
                    entries += [(3 * place[int(block)] + k, column, v) for k, v in enumerate(rows)]
    row, column, value = (np.array(part) for part in zip(*entries, strict=True))
    shape = (3 * len(place), 3 * count)
    return coo_array((value, (row, column)), shape=shape), np.arange(2 * count, 3 * count)


def _friction_rows(friction: np.ndarray, shear: np.ndarray) -> coo_array:
    """|V| <= mu (n1 + n2), two rows per contact; the last column is the load factor's."""
    count = len(friction)
    rows, index = np.arange(2 * count), np.tile(np.arange(count), 2)
    mu = -friction[index]
    parts = [(rows, index, mu), (rows, count + index, mu),
             (rows, shear[index], np.repeat([1.0, -1.0], count))]  # fmt: skip
    row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    return coo_array((value, (row, column)), shape=(2 * count, 3 * count + 1))
