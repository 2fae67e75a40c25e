"""What it would cost to add rows only where they bind.

Solve without torsion, look at every contact, state torsion-shear (Eq. 24) where it is violated,
repeat until it is nowhere; and sliding with ever more facets where it is active.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import process_time

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import Contacts, builtin_scene
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.problem import LimitProblem
from cvxlimit.solvers import LimitState
from cvxlimit.surfaces import Condition, Cone, Norm, Rocking, TorsionShear, YieldSurface, parse_cone

IntArray = NDArray[np.int64]

SCENES = ("tuff-wall", "s12-panel", "house-corner", "barrel-vault", "dome")
_VIOLATED = 1e-7
"""Share of the total load that counts: what solvers leave is below 1e-8."""


class At(YieldSurface):
    """Torsion-shear, or sliding only, at some contacts."""

    def __init__(self, name: str, rows: IntArray, cone: Cone, twist: bool) -> None:
        super().__init__(cone)
        self.name = name  # type: ignore[misc]
        self.rows, self.twist = rows, twist

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        """See the class."""
        at = self.rows
        norms = [Norm({"V1": 1}, {"V2": 1})]
        if self.twist:
            norms.insert(0, Norm({"MT": 1 / contacts.torsion_arm[at]}))
        return [Condition(norms, {"N": contacts.friction[at]}, at)]


@experiment(Part(3))
def lazy(scenes: Sequence[str] = SCENES) -> Lines:
    """Rows added only where they bind, beside all at once."""
    yield Head("scene", "contacts", "rows", "all at once, s", "where needed, s", "rounds",
               "contacts whose rows were added", "factors differ by")  # fmt: skip
    for name in scenes:
        assemblage = Assemblage.of(builtin_scene(name))
        for cone in ("conic", "octagon"):
            yield torsion_where_violated(assemblage, parse_cone(cone))
        yield facets_where_active(assemblage, parse_cone("octagon"), parse_cone("32-gon"))


def torsion_where_violated(assemblage: Assemblage, cone: Cone) -> tuple[object, ...]:
    """Sliding everywhere; torsion-shear where forces exceed it."""
    true = TorsionShear(cone)
    each = np.arange(len(assemblage.contacts))

    def surfaces(rows: IntArray) -> list[YieldSurface]:
        rest = np.setdiff1d(each, rows)
        return [At("slip", rest, cone, twist=False), At("twist", rows, cone, twist=True)]

    return _compared(assemblage, true, surfaces, f"torsion, {cone}")


def facets_where_active(assemblage: Assemblage, coarse: Cone, fine: Cone) -> tuple[object, ...]:
    """Few facets everywhere; many where forces exceed them."""
    each = np.arange(len(assemblage.contacts))

    def surfaces(rows: IntArray) -> list[YieldSurface]:
        rest = np.setdiff1d(each, rows)
        return [At("few", rest, coarse, twist=True), At("many", rows, fine, twist=True)]

    return _compared(assemblage, TorsionShear(fine), surfaces, f"facets, {coarse} to {fine}")


def _compared(assemblage: Assemblage, true, surfaces, what: str) -> tuple[object, ...]:  # type: ignore[no-untyped-def]
    start = process_time()
    all_at_once = _solved(assemblage, [true])
    at_once = process_time() - start
    start = process_time()
    rows, found = np.zeros(0, dtype=np.int64), []
    while True:
        state = _solved(assemblage, [s for s in surfaces(rows) if len(s.rows)])
        excess = true.excess(state.forces, assemblage.contacts)[0]
        violated = np.flatnonzero(excess > _VIOLATED * assemblage.scaling.force)
        violated = np.setdiff1d(violated, rows)
        found.append(len(violated))
        if not len(violated):
            break
        rows = np.union1d(rows, violated)
    lazily = process_time() - start
    apart = abs(state.load_factor / all_at_once.load_factor - 1.0)
    return (
        assemblage.scene.name, len(assemblage.contacts), what, f"{at_once:.2f}", f"{lazily:.2f}",
        len(found), ", ".join(map(str, found)), f"{apart:.0e}",
    )  # fmt: skip


def _solved(assemblage: Assemblage, surfaces: Sequence[YieldSurface]) -> LimitState:
    """The first solver with forces; solvers fail on some of the problems without torsion."""
    problem = LimitProblem(assemblage, [Rocking(), *surfaces])
    states = (problem.run(settings) for settings in problem.ladder())
    return next(state for state in states if state.forces is not None)
