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

from cvxlimit.compare.models import Method, Row
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.scene import Scene, Units

FloatArray = NDArray[np.float64]

V1, V2, N, M1, M2, MT = range(6)
ROWS = 20
"""Per contact: 4 of Eq. 9 and 16 of Eq. 25."""

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


def rocking_rows(contacts: Contacts) -> FloatArray:
    """Eq. 9 as N_j^T, (n, 4, 6)."""
    rows = np.zeros((len(contacts), 4, 6))
    l1, l2 = contacts.sides.T
    rows[:, 0:2, N] = -l2[:, None] / 2
    rows[:, 0:2, M1] = [1.0, -1.0]
    rows[:, 2:4, N] = -l1[:, None] / 2
    rows[:, 2:4, M2] = [1.0, -1.0]
    return rows


def octagon_rows(contacts: Contacts) -> FloatArray:
    """Eq. 25 as N_j^T, (n, 16, 6)."""
    rows = np.zeros((len(contacts), 16, 6))
    arm = torsion_arms(contacts)
    row = 0
    for sign in (1.0, -1.0):
        for k in range(1, 9):
            rows[:, row, MT] = sign
            rows[:, row, N] = -arm * contacts.friction
            rows[:, row, V1] = arm * np.cos(k * np.pi / 4)
            rows[:, row, V2] = arm * np.sin(k * np.pi / 4)
            row += 1
    return rows


def stacked(blocks: FloatArray) -> sp.csr_array:
    """Rows (n, k, 6) of every contact on the diagonal of one sparse matrix."""
    n, k, _ = blocks.shape
    return sp.csr_array(
        sp.bsr_array((blocks, np.arange(n), np.arange(n + 1)), shape=(k * n, 6 * n))
    )


@dataclass(frozen=True)
class Literal(Method):
    """The paper's linear program in plain CVXPY, default solver and settings.

    Attributes
    ----------
    units : str
        ``"kN-m"`` or ``"N-mm"``: of the numbers that the solver sees.
    """

    name: str = "literal/octagon/kN-m"
    line: str = "literal transcription, octagon"
    units: str = "kN-m"
    surface: str = "octagon"

    def axes(self) -> dict[str, str]:
        """See :class:`Method`."""
        formulation = f"resultants, literal, {self.units}"
        row = {"surface": self.surface, "formulation": formulation, "solver": "CVXPY's default"}
        return {**row, **super().axes()}

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
        """max alpha subject to Eq. 7 and N^T x <= 0, one sparse matrix for all contacts."""
        x, alpha = cp.Variable(6 * len(data.contacts)), cp.Variable()
        rows = np.concatenate([rocking_rows(data.contacts), octagon_rows(data.contacts)], axis=1)
        return cp.Problem(
            cp.Maximize(alpha),
            [data.equilibrium @ x + data.dead + alpha * data.live == 0, stacked(rows) @ x <= 0],
        )


@dataclass(frozen=True)
class LiteralConic(Literal):
    """The same with Eq. 24 instead of its 16 planes: a second-order cone per contact."""

    name: str = "literal/conic/kN-m"
    line: str = "literal transcription, cone"
    surface: str = "conic"

    def problem(self, data: Program) -> cp.Problem:
        """Eq. 9 as rows, Eq. 24 with CVXPY's norm and absolute value."""
        n = len(data.contacts)
        x, alpha = cp.Variable((n, 6)), cp.Variable()
        force = cp.vec(x, order="C")
        arm, friction = torsion_arms(data.contacts), data.contacts.friction
        strength = cp.multiply(friction, x[:, N]) - cp.norm(x[:, :2], axis=1)
        return cp.Problem(
            cp.Maximize(alpha),
            [
                data.equilibrium @ force + data.dead + alpha * data.live == 0,
                stacked(rocking_rows(data.contacts)) @ force <= 0,
                cp.abs(x[:, MT]) <= cp.multiply(arm, strength),
            ],
        )


@dataclass(frozen=True)
class LiteralPerContact(Literal):
    """The linear program with a variable and constraints per contact, as one first writes it."""

    name: str = "literal/octagon/kN-m/per-contact"
    line: str = "literal, one object per contact"

    def problem(self, data: Program) -> cp.Problem:
        """The same rows, contact by contact; equilibrium block by block."""
        contacts, alpha = data.contacts, cp.Variable()
        x = [cp.Variable(6) for _ in range(len(contacts))]
        rows = np.concatenate([rocking_rows(contacts), octagon_rows(contacts)], axis=1)
        constraints = [rows[j] @ x[j] <= 0 for j in range(len(contacts))]
        columns = data.equilibrium.tocsc()
        terms: list[list[cp.Expression]] = [[] for _ in range(len(data.dead) // 6)]
        for j in range(len(contacts)):
            block = columns[:, 6 * j : 6 * j + 6].tocsr()
            for i in np.unique(block.nonzero()[0] // 6):
                terms[i].append(block[6 * i : 6 * i + 6].toarray() @ x[j])
        for i, forces in enumerate(terms):
            rows_of_block = slice(6 * i, 6 * i + 6)
            loads = data.dead[rows_of_block] + alpha * data.live[rows_of_block]
            constraints.append(sum(forces) + loads == 0)
        return cp.Problem(cp.Maximize(alpha), constraints)


@dataclass(frozen=True)
class ScipyLinprog(Literal):
    """The same matrices in SciPy's ``linprog`` (HiGHS), default settings."""

    name: str = "literal/octagon/kN-m/scipy"
    line: str = "SciPy linprog on the same matrices"

    def axes(self) -> dict[str, str]:
        """See :class:`Method`."""
        return {**super().axes(), "solver": "SciPy linprog (HiGHS)"}

    def measure(self, scene: Scene) -> Row:
        """From known contacts to the load factor."""
        len(scene.contacts)
        start = time.perf_counter()
        data = program(scene)
        rows = stacked(
            np.concatenate([rocking_rows(data.contacts), octagon_rows(data.contacts)], axis=1)
        )
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


def baselines() -> dict[str, Method]:
    """All baselines by name."""
    methods = [
        Literal(),
        Literal("literal/octagon/N-mm", "literal, octagon, N and mm", "N-mm"),
        LiteralConic(),
        LiteralConic("literal/conic/N-mm", "literal, cone, N and mm", "N-mm"),
        LiteralPerContact(),
        ScipyLinprog(),
    ]
    return {method.name: method for method in methods}
