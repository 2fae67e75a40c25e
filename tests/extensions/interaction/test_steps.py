"""Safe steps against the same steps stated in CVXPY: every row as its text has it."""

from __future__ import annotations

import cvxpy as cp
import numpy as np
import pytest
from numpy.typing import NDArray

from cvxlimit import Scene
from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.restriction.steps import SafeStep
from cvxlimit.extensions.interaction.states.majorants import Forces, Point, StepRows
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.masonry import panel
from cvxlimit.methods.driver import Run
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.sinks import Constraints
from cvxlimit.readings.named import parse_moments
from cvxlimit.reductions.choice import Reductions
from cvxlimit.scene import Load
from cvxlimit.solvers import run, settings_for

FloatArray = NDArray[np.float64]

SOLVER = settings_for("CLARABEL", 1e-9)


def referee(
    step: SafeStep, point: Point, price: float | None, curvature: float, most: float | None
) -> float:
    """The scaled value of the step's problem."""
    count, own = len(step.kept), step.rectangles.take(step.kept)
    into, model = Constraints(), corner_compressions(own.contacts)
    c, internal = model.unknowns(into)
    names = ("N", "V1", "V2", "X1", "X2", "MT", "m1", "m2", "u", "s1", "s2", "t")
    known = {name: c[name] for name in ("N", "V1", "V2", "MT")} | {"X1": -c["M2"], "X2": c["M1"]}
    value = {name: known.get(name, cp.Variable(count)) for name in names}
    unit = dict(zip(names, np.eye(len(names))[:, :, None] * np.ones(count), strict=True))

    def pair(name: str) -> list[FloatArray]:
        return [unit[f"{name}1"], unit[f"{name}2"]]

    def stated(form: FloatArray) -> cp.Expression:
        return sum(cp.multiply(form[i], value[name]) for i, name in enumerate(names))

    sizes = pair("m"), unit["u"], pair("s"), unit["t"]
    f = Forces(unit["N"], pair("V"), pair("X"), unit["MT"], *sizes)
    slack = cp.Variable(count, nonneg=True)
    limits = [cp.norm(cp.vstack([value["V1"], value["V2"]]), axis=0) <= value["u"]]
    limits += [value["u"] <= cp.multiply(own.contacts.friction, value["N"])]
    for name, size in (("X1", "m1"), ("X2", "m2"), ("V1", "s1"), ("V2", "s2"), ("MT", "t")):
        limits.append(cp.abs(value[name]) <= value[size])
    here = Point(point.centre[step.kept], point.shear[step.kept])
    moments = step.moments
    rows = StepRows(
        f, here, own, moments.slopes, moments.is_limited, states_of(moments).balance
    ).rows()
    for row in rows:
        longer = row.lengthened(f.N, curvature) if row.squares else row
        w = slack - stated(longer.linear)
        roots = [stated(p) for p in longer.squares]
        # norm(roots)^2 <= 4 N w, as one norm
        limits.append(cp.norm(cp.vstack([*roots, value["N"] - w]), axis=0) <= value["N"] + w)
    if price is None:
        limits.append(slack == 0.0)
    half, scaled, alpha = step.half, step.assemblage.scaled, cp.Variable()
    if most is not None:
        limits.append(step.scaling.load_factor(1.0) * alpha <= most)
    forces = model.resultant_map @ cp.hstack(internal)
    load = scaled.dead + alpha * scaled.live
    balance = scaled.matrix @ (forces if half is None else half.forces @ forces) + load
    if half is not None:
        balance = half.rates @ balance
    cost = 0.0 if price is None else price * cp.sum(slack)
    problem = cp.Problem(cp.Maximize(alpha - cost), [balance == 0, *limits, *into.all])
    assert run(problem, SOLVER).has_values
    return float(problem.value)


def small_panel() -> Scene:
    """Symmetric, with contacts on the plane."""
    live = Load(acceleration=(0, -1, 0))
    return panel(0.40, 3, left_return=0.20, right_return=0.20, live=live)


CASES = [
    ("independent", None, 1.0, None),
    ("signed", 5.0, 1.0, None),
    ("paper", None, 0.1, None),
    ("signed-torsion-bending", None, 1.0, 0.01),
]


@pytest.mark.parametrize("part", ["whole", "half"])
@pytest.mark.parametrize(("moments", "price", "curvature", "most"), CASES)
def test_the_matrices_say_what_the_rows_say(
    moments: str, price: float | None, curvature: float, most: float | None, part: str
) -> None:
    """1e-6 of the load factor: both are solved to 1e-9 in scaled forces."""
    run = Run(small_panel(), moments=parse_moments(moments))
    half = None
    if part == "half":
        found = Reductions.of(run.assemblage, run.surfaces, model="least")
        half = SymmetricHalf.of(found, run.moments)
    step, rng = SafeStep(run.assemblage, run.moments, half), np.random.default_rng(3)
    sides, friction = step.statics.contacts.sides, step.statics.contacts.friction[:, None]
    centre = 0.1 * rng.uniform(-1.0, 1.0, sides.shape) * sides
    point = Point(centre, 0.2 * rng.uniform(-1.0, 1.0, sides.shape) * friction)
    state = step.solve(point, SOLVER, price, curvature, most)
    assert state.load_factor is not None
    assert state.forces is not None
    value = state.load_factor / step.scaling.load_factor(1.0)
    value -= 0.0 if price is None else price * state.slack
    assert value == pytest.approx(referee(step, point, price, curvature, most), rel=1e-6)
    residual = run.assemblage.statics.residual(state.forces, state.load_factor)
    assert np.abs(residual).max() < 1e-7 * run.scaling.force  # what the solver leaves
