"""Eq. 30 asked of SCIP, which shares nothing with this package.

Eq. 9, 10 and 30 on rectangles are written down once more, as a nonlinear program with the pressure
centres among its variables. SCIP branches over all of them for both bounds, with forces limited to
:data:`MOST` times the total weight. It may not contradict a certified bracket. It comes with the
extra ``referees``.
"""

from __future__ import annotations

import importlib.util
import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.baselines import FloatArray, program
from benchmarks.charts import figure_of, save, top_legend
from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.scenes import irregular_wall
from cvxlimit import Scene, solve
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.solution.bracket import Bracket

MOST = 10.0
"""Largest compression that SCIP may use at a contact, over the total weight: it needs bounds."""

LEAST = 1e-4
"""Least side of the effective area, over the contact's: the logarithms in its arm need one."""

CONVENTIONS = ("independent", "signed")


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
        )


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
    """A question, our bracket and SCIP's; a lower bound of 0 is none."""

    scene: Scene
    moments: str
    ours: Bracket
    our_seconds: float
    theirs: Bracket
    their_seconds: float

    @property
    def cells(self) -> tuple[object, ...]:
        """Of its row in the table."""
        lower = f"{self.theirs.lower:.5g}" if self.theirs.lower > 0.0 else "-"
        return (
            self.scene.name, len(self.scene.contacts), self.moments,
            f"[{self.ours.lower:.5g}, {self.ours.upper:.5g}]", f"{self.our_seconds:.1f}",
            f"[{lower}, {self.theirs.upper:.5g}]", f"{self.their_seconds:.1f}", self.verdict,
        )  # fmt: skip

    @property
    def verdict(self) -> str:
        """SCIP holds its rows to 1e-6 only, and keeps a least effective area: 1e-3 is no news."""
        ours, theirs = self.ours, self.theirs
        if theirs.lower > 1.001 * ours.upper or theirs.upper < 0.999 * ours.lower:
            return "**contradiction**"
        below, above = 1.0 - theirs.lower / ours.lower, max(theirs.upper / ours.upper - 1.0, 0.0)
        said = "as ours" if below <= 1e-3 else f"{below:.1%} below ours"
        lower = f"lower bound {said}" if theirs.lower > 0.0 else "no lower bound"
        return f"{lower}, upper bound {above:.1%} above"


@experiment(Part(5, "--seconds 10 --picture docs/evidence/referees.png"))
def referees(walls: int = 8, seconds: float = 60.0, picture: Path | None = None) -> Lines:
    """SCIP beside certified brackets, on small walls."""
    if importlib.util.find_spec("pyscipopt") is None:
        raise SystemExit('pyscipopt is not installed: pip install -e ".[dev,referees]"')
    yield Head("scene", "contacts", "moments", "certified", "CPU s", "SCIP", "CPU s", "verdict")
    found = []
    for scene, moments in itertools.product(small_walls(walls), CONVENTIONS):
        found.append(compared(scene, moments, seconds))
        yield found[-1].cells
    if picture is not None:
        save(drawn(found), picture)


def small_walls(number: int) -> list[Scene]:
    """The first irregular walls of at most twenty contacts whose live load does harm."""
    walls = (irregular_wall(seed) for seed in itertools.count(200))
    small = (w for w in walls if len(w.contacts) <= 20 and solve(w).status.has_answer)
    return list(itertools.islice(small, number))


def compared(scene: Scene, moments: str, seconds: float) -> Asked:
    """The certified method within 1 %, and SCIP."""
    start = time.process_time()
    method = Certified(tolerance=0.01, moments=moments, branching_seconds=seconds)
    ours = solve(scene, method=method).bracket
    between = time.process_time()
    low, high = scip(scene, moments, seconds)
    theirs = Bracket(max(low, 0.0), high)
    return Asked(scene, moments, ours, between - start, theirs, time.process_time() - between)


def drawn(found: Sequence[Asked]) -> Figure:
    """Width of the bracket against CPU time: a grey line joins the answers to one question."""
    figure = figure_of(4.4)
    axes = figure.subplots()
    seconds = [(each.our_seconds, each.their_seconds) for each in found]
    widths = [(a.ours.width, 1.0 - a.theirs.lower / a.theirs.upper) for a in found]
    x, y = np.maximum(seconds, 0.03).T, 100.0 * np.maximum(widths, 2e-4).T
    axes.plot(x, y, color="0.85", lw=0.8, zorder=1)
    for k, (name, mark) in enumerate({"cvxlimit": "o", "SCIP": "s"}.items()):
        axes.plot(x[k], y[k], mark, color=("#0072b2", "#009e73")[k], ms=5, label=name)
    axes.set(xscale="log", yscale="log", xlabel="CPU seconds")
    axes.set_ylabel("width of the bracket, % (100: one bound missing)")
    top_legend(figure, axes, 2)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_major_formatter("{x:g}")
    return figure
