"""Eq. 30 asked of solvers that share nothing with this package.

Eq. 9, 10 and 30 on rectangles are written down once more, as a nonlinear program with the pressure
centres among its variables. Uno, through CVXPY, looks for a local optimum: a lower bound, if its
forces pass :func:`benchmarks.stability.interacting.worst`. SCIP branches over all variables for
both bounds, with forces limited to :data:`MOST` times the total weight. Neither may contradict a
certified bracket. Both come with the extra ``referees``.
"""

from __future__ import annotations

import importlib.util
import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cvxpy as cp
import numpy as np
from cvxpy.error import SolverError
from matplotlib.figure import Figure

from benchmarks.baselines import M1, M2, MT, V1, V2, FloatArray, N, program
from benchmarks.charts import figure_of, save, top_legend
from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.scenes import irregular_wall, scene_of
from benchmarks.stability.interacting import arms, worst
from cvxlimit import Scene, solve
from cvxlimit.methods.certified import Certified
from cvxlimit.solution.bracket import Bracket

MOST = 10.0
"""Largest compression that SCIP may use at a contact, over the total weight: it needs bounds."""

LEAST = 1e-4
"""Least side of the effective area, over the contact's: the logarithms in its arm need one."""

CONVENTIONS = ("independent", "signed")

MANY = 1e3
"""Excess over a strength that is next to nothing."""

ADMISSIBLE = 1e-6
"""Excess over Eq. 9 and 30, over the largest compression, up to which forces of Uno count."""


Ask = Callable[[Scene, str, float], tuple[Bracket, str]]
"""Of a scene, a convention and so many seconds: bounds, and why there are none."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """A scene in units of its mean block weight and of its contacts' mean size.

    ``equilibrium`` @ forces + ``dead`` + load factor * ``live`` = 0, with forces contact by contact
    in the order V1, V2, N, M1, M2, MT.
    """

    equilibrium: FloatArray
    dead: FloatArray
    live: FloatArray
    sides: FloatArray
    friction: FloatArray
    total: float
    units: FloatArray

    @classmethod
    def of(cls, scene: Scene) -> Scaled:
        found, contacts = program(scene), scene.contacts
        length = float(np.mean(np.sqrt(contacts.area)))
        force = float(np.mean(np.abs(scene.dead_forces[:, :3]).sum(axis=1)))
        of_row = np.tile([1.0, 1.0, 1.0, length, length, length], len(found.dead) // 6) * force
        of_column = np.tile([1.0, 1.0, 1.0, length, length, length], len(contacts)) * force
        return cls(
            (found.equilibrium.toarray() * of_column) / of_row[:, None],
            found.dead / of_row,
            found.live / of_row,
            contacts.sides / length,
            contacts.friction,
            float(np.abs(scene.dead_forces[:, :3]).sum()) / force,
            of_column,
        )

    def forces(self, values: FloatArray) -> FloatArray:
        """(contacts, 6) in the scene's units."""
        return np.asarray((values.ravel() * self.units).reshape(-1, 6))


def uno(scene: Scene, moments: str, seconds: float) -> tuple[float, FloatArray]:
    """Load factor and forces of a local optimum found by Uno."""
    given, count = Scaled.of(scene), len(scene.contacts)
    f, alpha = cp.Variable((count, 6)), cp.Variable()
    e, slip, arm = cp.Variable((count, 2)), cp.Variable(count), cp.Variable(count)
    half = cp.Variable((count, 2))
    a, b = half[:, 0], half[:, 1]
    size = cp.sqrt(a**2 + b**2)
    log_a, log_b = cp.log(b + size) - cp.log(a), cp.log(a + size) - cp.log(b)
    pressed = [
        given.equilibrium @ cp.vec(f, order="C") + given.dead + alpha * given.live == 0,
        f[:, N] >= 0,
        cp.multiply(f[:, N], e[:, 0]) + f[:, M2] == 0,
        cp.multiply(f[:, N], e[:, 1]) - f[:, M1] == 0,
        cp.abs(e) + half <= given.sides / 2,
        half >= LEAST * given.sides,
        cp.multiply(cp.multiply(6 * arm - 2 * size, a), b)
        == cp.multiply(a**3, log_a) + cp.multiply(b**3, log_b),
        f[:, V1] ** 2 + f[:, V2] ** 2 <= slip**2,
        slip >= 0,
        slip <= cp.multiply(given.friction, f[:, N]),
    ]
    rest = cp.multiply(arm, cp.multiply(given.friction, f[:, N]) - slip)
    if moments == "signed":
        torque = f[:, MT] - cp.multiply(e[:, 0], f[:, V2]) + cp.multiply(e[:, 1], f[:, V1])
        limited = [torque <= rest, -torque <= rest]
    else:
        size_of = cp.Variable((count, 5))
        limited = [
            cp.abs(f[:, V1]) <= size_of[:, 0],
            cp.abs(f[:, V2]) <= size_of[:, 1],
            cp.abs(f[:, MT]) <= size_of[:, 2],
            cp.abs(e) <= size_of[:, 3:],
            cp.multiply(size_of[:, 0], size_of[:, 4])
            + cp.multiply(size_of[:, 1], size_of[:, 3])
            + size_of[:, 2]
            <= rest,
        ]
        size_of.value = np.ones((count, 5))
    f.value = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (count, 1))
    e.value, half.value = np.zeros((count, 2)), given.sides / 2.0
    arm.value, slip.value, alpha.value = arms(*given.sides.T), np.zeros(count), 0.0
    problem = cp.Problem(cp.Maximize(alpha), [*pressed, *limited])
    problem.solve(
        nlp=True,
        solver="UNO",
        preset="ipopt",
        logger="SILENT",
        max_iterations=5000,
        time_limit=seconds,
    )
    if f.value is None or alpha.value is None:
        raise ArithmeticError(f"Uno: {problem.status}")
    return float(alpha.value), given.forces(np.asarray(f.value))


def scip(scene: Scene, moments: str, seconds: float) -> tuple[float, float]:
    """Bounds of SCIP's branching within so many seconds."""
    from pyscipopt import Model, log, sqrt

    given, model = Scaled.of(scene), Model()
    model.hideOutput()
    model.setParam("limits/time", seconds)
    model.setParam("limits/gap", 0.01)
    most = MOST * given.total
    alpha = model.addVar("alpha", lb=0.0, ub=most)
    forces = []
    for (l1, l2), mu in zip(given.sides, given.friction, strict=True):
        reach = mu * most
        n = model.addVar(lb=0.0, ub=most)
        v1, v2 = (model.addVar(lb=-reach, ub=reach) for _ in "12")
        mt = model.addVar(lb=-reach * max(l1, l2), ub=reach * max(l1, l2))
        e1, e2 = (model.addVar(lb=-s / 2, ub=s / 2) for s in (l1, l2))
        a, b = (model.addVar(lb=LEAST * s, ub=s / 2) for s in (l1, l2))
        slip, arm = model.addVar(lb=0.0, ub=reach), model.addVar(lb=0.0, ub=max(l1, l2))
        for side, e, half in ((l1, e1, a), (l2, e2, b)):
            model.addCons(half <= side / 2 - e)
            model.addCons(half <= side / 2 + e)
        size = sqrt(a * a + b * b)
        logs = a**3 * (log(b + size) - log(a)) + b**3 * (log(a + size) - log(b))
        model.addCons(6 * arm * a * b - 2 * size * a * b == logs)
        model.addCons(v1 * v1 + v2 * v2 <= slip * slip)
        model.addCons(slip <= mu * n)
        rest = arm * (mu * n - slip)
        if moments == "signed":
            torque = mt - e1 * v2 + e2 * v1
            model.addCons(torque <= rest)
            model.addCons(-torque <= rest)
        else:
            model.addCons(abs(v1) * abs(e2) + abs(v2) * abs(e1) + abs(mt) <= rest)
        forces += [v1, v2, n, n * e2, -n * e1, mt]
    for row, dead, live in zip(given.equilibrium, given.dead, given.live, strict=True):
        used = np.flatnonzero(row)
        if len(used) or live:
            model.addCons(sum(float(row[k]) * forces[k] for k in used) + dead + live * alpha == 0)
    model.setObjective(alpha, "maximize")
    model.optimize()
    return float(model.getPrimalbound()), float(model.getDualbound())


@dataclass(frozen=True)
class Asked:
    """A question, our answer and a referee's; a lower bound of 0 or an infinite upper one is none.

    ``note`` says why there is no answer.
    """

    scene: Scene
    moments: str
    ours: Bracket
    our_seconds: float
    theirs: Bracket
    their_seconds: float
    note: str = ""

    @property
    def cells(self) -> tuple[object, ...]:
        """Of its row in the table."""
        theirs = [f"{self.theirs.lower:.5g}" if self.theirs.lower > 0.0 else "-"]
        theirs.append("-" if math.isinf(self.theirs.upper) else f"{self.theirs.upper:.5g}")
        return (
            self.scene.name, len(self.scene.contacts), self.moments,
            f"[{self.ours.lower:.5g}, {self.ours.upper:.5g}]", f"{self.our_seconds:.1f}",
            f"[{', '.join(theirs)}]", f"{self.their_seconds:.1f}", self.note or self.verdict,
        )  # fmt: skip

    @property
    def verdict(self) -> str:
        """Both hold their rows to 1e-6 only, and keep a least effective area: 1e-3 is no news."""
        below = 1.0 - self.theirs.lower / self.ours.lower
        above = self.theirs.upper / self.ours.upper - 1.0
        if (
            self.theirs.lower > self.ours.upper * 1.001
            or self.theirs.upper < self.ours.lower * 0.999
        ):
            return "**contradiction**"
        said = (
            "no lower bound" if self.theirs.lower <= 0.0 else f"lower bound {below:.1%} below ours"
        )
        if below <= 1e-3:
            said = "lower bound as ours"
        return said if math.isinf(above) else f"{said}, upper bound {max(above, 0.0):.1%} above"

    @property
    def widths(self) -> tuple[float, float]:
        """Ours and theirs; where one of their bounds is missing, with ours in its place."""
        lower = max(self.theirs.lower, 0.0)
        upper = self.ours.upper if math.isinf(self.theirs.upper) else self.theirs.upper
        return self.ours.width, 1.0 - lower / upper


@experiment(Part(5, "--seconds 10 --picture docs/evidence/referees.png"))
def referees(
    scenes: Sequence[str] = ("tuff-wall", "facade", "house-corner"), walls: int = 8,
    seconds: float = 60.0, picture: Path | None = None,
) -> Lines:  # fmt: skip
    """Uno and SCIP beside certified brackets: scenes of rectangles, and small walls for both."""
    missing = [name for name in ("unopy", "pyscipopt") if importlib.util.find_spec(name) is None]
    if missing:
        raise SystemExit(f'{missing[0]} is not installed: pip install -e ".[dev,referees]"')
    small = small_walls(walls)
    given = {"Uno": (ask_uno, [*map(scene_of, scenes), *small]), "SCIP": (ask_scip, small)}
    found: dict[str, list[Asked]] = {}
    for name, (ask, asked) in given.items():
        yield Title(name)
        yield Head("scene", "contacts", "moments", "certified", "CPU s", name, "CPU s", "verdict")
        found[name] = []
        for scene, moments in itertools.product(asked, CONVENTIONS):
            found[name].append(compared(scene, moments, seconds, ask))
            yield found[name][-1].cells
    if picture is not None:
        save(drawn(found), picture)


def small_walls(number: int) -> list[Scene]:
    """The first irregular walls of at most twenty contacts whose live load does harm."""
    walls = (irregular_wall(seed) for seed in itertools.count(200))
    small = (w for w in walls if len(w.contacts) <= 20 and solve(w).status.has_answer)
    return list(itertools.islice(small, number))


def compared(scene: Scene, moments: str, seconds: float, ask: Ask) -> Asked:
    """The certified method within 1 %, and a referee."""
    start = time.process_time()
    method = Certified(tolerance=0.01, moments=moments, branching_seconds=seconds)
    ours = solve(scene, method=method).bracket
    between = time.process_time()
    theirs, note = ask(scene, moments, seconds)
    end = time.process_time()
    return Asked(scene, moments, ours, between - start, theirs, end - between, note)


def ask_uno(scene: Scene, moments: str, seconds: float) -> tuple[Bracket, str]:
    """Its local optimum as a lower bound, if its forces are admissible."""
    try:
        factor, forces = uno(scene, moments, seconds)
    except (ArithmeticError, SolverError) as error:
        return Bracket(0.0, math.inf), f"no answer: {str(error).split('.')[0]}"
    excess = worst(forces, scene.contacts, moments)
    if excess > ADMISSIBLE:
        by = f"by {excess:.0e}" if excess < MANY else "where next to nothing presses"
        return Bracket(0.0, math.inf), f"{factor:.5g}, whose forces exceed Eq. 30 {by}"
    return Bracket(factor, math.inf), ""


def ask_scip(scene: Scene, moments: str, seconds: float) -> tuple[Bracket, str]:
    """Its two bounds."""
    low, high = scip(scene, moments, seconds)
    return Bracket(max(low, 0.0), high), ""


def drawn(found: dict[str, list[Asked]]) -> Figure:
    """Width of the bracket against CPU time: a grey line joins the answers to one question."""
    figure = figure_of(4.4)
    axes = figure.subplots()
    for (name, rows), colour in zip(found.items(), ("#d55e00", "#009e73"), strict=True):
        for k, row in enumerate(rows):
            ours, theirs = (100.0 * max(width, 2e-4) for width in row.widths)
            seconds = [max(t, 0.03) for t in (row.our_seconds, row.their_seconds)]
            axes.plot(seconds, (ours, theirs), color="0.85", lw=0.8, zorder=1)
            label = None if k else name
            axes.plot(seconds[1], theirs, "s", color=colour, ms=5, label=label, zorder=2)
            own = "cvxlimit" if k == 0 and name == "Uno" else None
            axes.plot(seconds[0], ours, "o", color="#0072b2", ms=5, label=own, zorder=3)
    axes.set(xscale="log", yscale="log", xlabel="CPU seconds")
    axes.set_ylabel("width of the bracket, % (100: one bound missing)")
    top_legend(figure, axes, 3)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_formatter("{x:g}")
    return figure
