"""Scenes in the plane (x, z) as a linear program: a second path to their load factors.

Two normal forces and one shear per contact, SciPy's ``linprog``, nothing of the package's solver.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp
from scipy.sparse import coo_array, csr_array, diags_array, eye_array, hstack

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


def lowest_member(scene: Scene, force: float = 3.0, rate: float = 30.0) -> tuple[float, float]:
    """Lowest zero-dilatancy load factor in the plane, and a bound on it.

    Mixed-integer: forces in equilibrium and a mechanism of live power 1; at both ends of a contact
    either the pressure is zero or the opening; it slides one way with all friction against it, or
    the other, or not. Pressures are at most ``force`` total weights, rates at most ``rate`` where
    the whole weight as live load would do power 1.
    """
    matrix = csr_array(_planar_equilibrium(scene)[0])
    dead, live = (
        np.column_stack([f[:, 0], f[:, 2], f[:, 4]]).ravel() / scene.total_weight
        for f in (scene.dead_forces, scene.live_forces)
    )
    n, m = len(scene.contacts), matrix.shape[0]
    each, ends, mu = eye_array(n), eye_array(2 * n), diags_array(scene.contacts.friction)
    press, shear, most = matrix[:, : 2 * n], matrix[:, 2 * n :], hstack([mu, mu])
    sizes = {"p": 2 * n, "t": n, "alpha": 1, "u": m, "right": n, "left": n,
             "pressed": 2 * n, "to_right": n, "to_left": n}  # fmt: skip

    def rows(low: object, high: object, **parts: object) -> LinearConstraint:
        height = next(iter(parts.values())).shape[0]  # type: ignore[attr-defined]
        blocks = [parts.get(name, csr_array((height, k))) for name, k in sizes.items()]
        low, high = (np.broadcast_to(side, (height,)) for side in (low, high))
        return LinearConstraint(hstack(blocks, format="csr"), low, high)

    limits = [
        rows(-dead, -dead, p=press, t=shear, alpha=csr_array(live[:, None])),
        rows(1, 1, u=csr_array(live[None, :])),
        rows(0, 0, u=shear.T, right=-each, left=each),
        rows(0, np.inf, u=press.T),
        rows(-np.inf, rate, u=press.T, pressed=rate * ends),
        rows(-np.inf, 0, p=ends, pressed=-force * ends),
        rows(0, np.inf, p=most, t=each),
        rows(0, np.inf, p=most, t=-each),
        rows(-np.inf, force, p=most, t=each, to_right=force * each),
        rows(-np.inf, force, p=most, t=-each, to_left=force * each),
        rows(-np.inf, 0, right=each, to_right=-rate * each),
        rows(-np.inf, 0, left=each, to_left=-rate * each),
        rows(-np.inf, 1, to_right=each, to_left=each),
    ]
    width = sum(sizes.values())
    free = np.r_[2 * n : 3 * n + 1 + m]
    low, high = np.zeros(width), np.concatenate(
        [np.full(3 * n + 1 + m, force), np.full(2 * n, rate), np.ones(4 * n)]
    )  # fmt: skip
    low[free], high[free] = -np.inf, np.inf
    goal = np.zeros(width)
    goal[3 * n] = 1.0
    whole = np.repeat([0, 1], [width - 4 * n, 4 * n])
    # without a limit of time: the answer is not to depend on what else the machine does
    answer = milp(goal, constraints=limits, bounds=Bounds(low, high), integrality=whole,
                  options={"mip_rel_gap": 1e-7})  # fmt: skip
    assert answer.status == 0, answer.message
    return float(answer.x[3 * n]), float(answer.mip_dual_bound)
