"""The bracket of one configuration: the plain limit problem on its closed points, proved in NumPy.

A displaced structure cannot carry its dead load alone, so that the state to mix with carries a load
factor of its own, and the load factor is an unknown of the balance.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from cvxlimit.extensions.paths.configuration import Flow, Points
from cvxlimit.extensions.paths.increment import FINE, Increment, point_forces
from cvxlimit.extensions.paths.loads import Loads
from cvxlimit.extensions.paths.pairs import CLOSED, Pose
from cvxlimit.extensions.paths.supports import opening_field
from cvxlimit.model.assemblage import Balance
from cvxlimit.model.statement import Stated
from cvxlimit.proof.certificate import Certifier
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import Bracket
from cvxlimit.solvers import LimitState, ladder_for
from cvxlimit.surfaces import Rocking


def bracket_of(
    scene: Scene, points: Points, pose: Pose, loads: Loads, flow: Flow = "associated",
    least: float = 0.0,
) -> tuple[Bracket, float]:  # fmt: skip
    """Bounds on the largest load factor that the closed points carry, and their widest gap; up to
    ``least`` a point counts as closed in any case."""
    size = scene.contacts.typical_size
    closed = points.closed(flow, max(CLOSED * size, (1.0 + CLOSED) * least))
    widest = float((closed.distance if flow == "associated" else closed.gap).max(initial=0.0))
    whole = Increment(scene, closed, pose, loads)
    found = _run(whole)
    if found is None or found.internal is None or found.load_factor is None:
        return Bracket(), widest
    certifier = _certifier(whole)
    plain = Increment(scene, closed.unbound, pose, loads) if closed.is_bound else whole
    if (field := opening_field(plain)) is not None:
        certifier.offer_opening_field(field)
    upper = certifier.certificate(None, None, found.mechanism)
    n = found.internal[: len(closed)]
    bearing = closed.take(n > CLOSED * n.max(initial=0.0))
    lower = Bracket()
    for kept in (bearing, closed):  # those that bear nothing leave no room inside
        lower = _lower(Increment(scene, kept, pose, loads))
        if lower.lower_is_proved:
            break
    return Bracket(
        lower.lower, upper.upper, lower.lower_is_proved, upper.upper_is_proved, upper.least
    ), widest


def _lower(given: Increment) -> Bracket:
    """From the best forces on some points, mixed with those that are farthest inside."""
    best, inside = _run(given), _run(given, partial(_deepest, given=given))
    if best is None or best.internal is None or best.load_factor is None:
        return Bracket()
    certifier, statics = _certifier(given), given.assemblage.statics
    if inside is not None and inside.internal is not None:
        certifier.offer_dead_state(inside.internal, float(inside.load_factor or 0.0) or 1e-300)
    factor = certifier.strength.balancing(best.internal, best.load_factor, statics)
    return certifier.certificate(best.internal, factor, best.mechanism)


def _certifier(given: Increment) -> Certifier:
    """Hinges resist no rotation of their own; balances leave such motions to the load factor."""
    certifier = Certifier(given.assemblage, [Rocking()], point_forces)
    model = certifier.strength.model
    none = np.zeros(len(model.contact), dtype=bool)
    certifier.strength.__dict__["balance"] = Balance(given.assemblage.statics, model, held=none)
    return certifier


def _deepest(stated: Stated, given: Increment) -> Any:
    """Goal: what every point has to spare, at most a fair share of the load."""
    n, v1, v2 = (stated.forces[name] for name in ("n", "v1", "v2"))
    spare = stated.own["spare"] = stated.into.new(name="spare")
    most = np.ones(n.size) / n.size
    stated.into.nonneg(most[0] - spare)
    stated.into.cone(n - spare, [v1, v2])
    points, unit = given.points, given.assemblage.scaling.force
    if len(bars := np.flatnonzero(np.isfinite(points.most))):
        stated.into.nonneg((points.most - points.least)[bars] / unit - n[bars] - spare)
    if len(glued := np.flatnonzero((points.friction == 0.0) & (points.cohesion > 0.0))):
        stated.into.cone(points.cohesion[glued] / unit - spare, [v1[glued], v2[glued]])
    return spare


def _run(given: Increment, goal: Any = None) -> LimitState | None:
    problem = given.problem() if goal is None else given.problem(goal)
    for settings in ladder_for("paths", FINE):
        state = problem.run(settings)
        if state.internal is not None:
            return state
    return None
