"""What a user would write without the package: the paper's equations, transcribed.

Equation numbers are the paper's. Equilibrium, yield rows and c_T are written here once more from
its formulas; only the contacts' geometry is taken from the scene, and finding it is not timed.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import linprog

from cvxlimit.errors import ModelError
from cvxlimit.extensions.studies.models import Model, Row
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.scene import Scene, Units

FloatArray = NDArray[np.float64]

V1, V2, N, M1, M2, MT = range(6)
UNITS = {"kN-m": (Units("m", "kN"), 1.0, 1.0), "N-mm": (Units("mm", "N"), 1e3, 1e3)}


@dataclass(frozen=True)
class Program:
    """Matrices of Eq. 39: A x + f_D + alpha f_L = 0 and N^T x <= 0."""

    equilibrium: sp.csr_array
    dead: FloatArray
    live: FloatArray
    contacts: Contacts


def program(scene: Scene) -> Program:
    """Equilibrium of the free blocks about their centroids (Eq. 6 and 7)."""
    contacts = scene.contacts
    row = np.full(len(scene.blocks), -1)
    row[scene.free] = np.arange(len(scene.free))
    centroids = np.array([block.centroid for block in scene.blocks])
    matrix = _side(contacts, contacts.b, 1.0, centroids, row) + _side(
        contacts, contacts.a, -1.0, centroids, row
    )
    return Program(
        sp.csr_array(matrix), scene.dead_forces.ravel(), scene.live_forces.ravel(), contacts
    )


def _side(
    contacts: Contacts,
    block: NDArray[np.int64],
    sign: float,
    centroids: FloatArray,
    row: NDArray[np.int64],
) -> sp.coo_array:
    """Forces and moments that contact forces exert on ``block`` (with ``sign``)."""
    n = len(contacts)
    a = np.zeros((n, 6, 6))
    arm = contacts.origin - centroids[block]
    for force, direction in zip((V1, V2, N), (0, 1, 2), strict=True):
        a[:, :3, force] = contacts.axes[:, direction]
        a[:, 3:, force] = np.cross(arm, contacts.axes[:, direction])
    for moment, direction in zip((M1, M2, MT), (0, 1, 2), strict=True):
        a[:, 3:, moment] = contacts.axes[:, direction]
    i = np.broadcast_to(6 * row[block][:, None, None] + np.arange(6)[None, :, None], a.shape)
    j = np.broadcast_to(6 * np.arange(n)[:, None, None] + np.arange(6)[None, None, :], a.shape)
    free = np.broadcast_to((row[block] >= 0)[:, None, None], a.shape)
    shape = (6 * (int(row.max()) + 1), 6 * n)
    return sp.coo_array((sign * a[free], (i[free], j[free])), shape)


def torsion_arms(contacts: Contacts) -> FloatArray:
    """c_T by Eq. 16 as printed."""
    if not contacts.is_rectangle.all():
        raise ModelError("the paper's Eq. 16 is for rectangular contacts")
    l1, l2 = contacts.sides.T
    d = np.hypot(l1, l2)
    sums = l1**3 * np.log((l2 + d) / l1) + l2**3 * np.log((l1 + d) / l2) + 2 * l1 * l2 * d
    result: FloatArray = sums / (12 * l1 * l2)
    return result


def edges(contacts: Contacts) -> sp.csr_array:
    """Eq. 9 for any polygon: the pressure centre (-M2, M1) / N is inside every edge."""
    contact = contacts.corner_contact
    corner = np.arange(len(contact))
    last = corner + 1 == contacts.corner_start[contact + 1]
    after = np.where(last, contacts.corner_start[contact], corner + 1)
    (x, y), (dx, dy) = contacts.corner_xy.T, (contacts.corner_xy[after] - contacts.corner_xy).T
    values = np.concatenate([dx * y - dy * x, -dx, -dy]) / np.tile(np.hypot(dx, dy), 3)
    columns = np.concatenate([6 * contact + component for component in (N, M1, M2)])
    shape = (len(contact), 6 * len(contacts))
    return sp.csr_array((values, (np.tile(corner, 3), columns)), shape=shape)


def octagon_rows(contacts: Contacts, arms: FloatArray) -> sp.csr_array:
    """Eq. 25, 16 rows per contact."""
    rows = np.zeros((len(contacts), 16, 6))
    turn = np.arange(1, 9) * np.pi / 4
    rows[:, :8, MT], rows[:, 8:, MT] = 1.0, -1.0
    rows[:, :, N] = -(arms * contacts.friction)[:, None]
    rows[:, :, V1] = arms[:, None] * np.tile(np.cos(turn), 2)
    rows[:, :, V2] = arms[:, None] * np.tile(np.sin(turn), 2)
    each = np.arange(len(contacts))
    return sp.csr_array(sp.bsr_array((rows, each, np.arange(len(contacts) + 1))))


def written(data: Program, arms: FloatArray, surface: str) -> cp.Problem:
    """The paper's problem as one writes it down: Eq. 7 and 9, and Eq. 25 or 24."""
    x, alpha = cp.Variable((len(data.contacts), 6)), cp.Variable()
    force, contacts = cp.vec(x, order="C"), data.contacts
    limits = [data.equilibrium @ force + data.dead + alpha * data.live == 0]
    if surface == "octagon":
        limits.append(sp.vstack([edges(contacts), octagon_rows(contacts, arms)]) @ force <= 0)
    else:
        strength = cp.multiply(contacts.friction, x[:, N]) - cp.norm(x[:, :2], axis=1)
        limits += [edges(contacts) @ force <= 0, cp.abs(x[:, MT]) <= cp.multiply(arms, strength)]
    return cp.Problem(cp.Maximize(alpha), limits)


def eight_lines(data: Program, arms: FloatArray) -> cp.Problem:
    """What anyone writes first for the cone of Eq. 24."""
    contacts, x, alpha = data.contacts, cp.Variable((len(data.contacts), 6)), cp.Variable()
    forces = cp.vec(x, order="C")
    balance = data.equilibrium @ forces + data.dead + alpha * data.live == 0
    torsion = cp.multiply(1 / arms, cp.abs(x[:, MT]))
    friction = cp.multiply(contacts.friction, x[:, N])
    sliding = cp.norm(x[:, :2], axis=1) + torsion <= friction
    return cp.Problem(cp.Maximize(alpha), [balance, edges(contacts) @ forces <= 0, sliding])


class Literal(Model):
    """The paper's linear program in plain CVXPY, default solver and settings.

    Attributes
    ----------
    units : str
        ``"kN-m"`` or ``"N-mm"``: of the numbers that the solver sees.
    """

    def __init__(
        self, name: str = "literal/octagon/kN-m", line: str = "literal transcription, octagon",
        units: str = "kN-m", surface: str = "octagon",
    ) -> None:  # fmt: skip
        super().__init__(name, line, surface=surface)
        self.units = units

    def measure(self, scene: Scene) -> Row:
        """From known contacts to the load factor."""
        units, length, force = UNITS[self.units]
        scene = scene.in_units(units, length, force) if length != 1.0 else scene
        len(scene.contacts)
        start = time.perf_counter()
        data = program(scene)
        problem = self.problem(data)
        problem.solve()
        total = time.perf_counter() - start
        solver = float(problem.solver_stats.solve_time or 0.0)
        alpha = None if problem.value is None else float(problem.value)
        if alpha is not None and not np.isfinite(alpha):
            alpha = None
        seconds = {"compile": total - solver, "solve": solver}
        return Row(status=problem.status, load_factor=alpha, total=total, **seconds)

    def problem(self, data: Program) -> cp.Problem:
        """One sparse matrix for all contacts."""
        return written(data, torsion_arms(data.contacts), self.options["surface"])


class ScipyLinprog(Literal):
    """The same matrices in SciPy's ``linprog`` (HiGHS), default settings."""

    def __init__(self) -> None:
        line = "SciPy linprog on the same matrices"
        super().__init__("literal/octagon/kN-m/scipy", line)

    def measure(self, scene: Scene) -> Row:
        """From known contacts to the load factor."""
        len(scene.contacts)
        start = time.perf_counter()
        data = program(scene)
        arms = torsion_arms(data.contacts)
        rows = sp.vstack([edges(data.contacts), octagon_rows(data.contacts, arms)]).tocsr()
        equal = sp.hstack([data.equilibrium, sp.csr_array(data.live[:, None])]).tocsr()
        below = sp.hstack([rows, sp.csr_array((rows.shape[0], 1))]).tocsr()
        cost = np.append(np.zeros(rows.shape[1]), -1.0)
        built = time.perf_counter()
        found = linprog(
            cost, below, np.zeros(rows.shape[0]), equal, -data.dead, bounds=(None, None)
        )
        end = time.perf_counter()
        alpha = None if found.x is None else float(found.x[-1])
        status = "optimal" if found.status == 0 else " ".join(str(found.message).split())[:120]
        seconds = {"compile": built - start, "solve": end - built}
        return Row(status=status, load_factor=alpha, total=end - start, **seconds)


CONES = (
    Literal("literal/conic/kN-m", "literal transcription, cone", "kN-m", "conic"),
    Literal("literal/conic/N-mm", "literal, cone, N and mm", "N-mm", "conic"),
)
"""The same with Eq. 24 instead of its 16 planes: a second-order cone per contact."""


def baselines() -> dict[str, Model]:
    """All baselines by name."""
    other = Literal("literal/octagon/N-mm", "literal, octagon, N and mm", "N-mm")
    methods = [Literal(), other, *CONES, ScipyLinprog()]
    return {method.name: method for method in methods}
