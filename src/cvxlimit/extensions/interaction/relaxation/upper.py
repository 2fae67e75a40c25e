"""Upper bounds on the load factor from the convex hull of every contact's states.

Bounds never rest on the disjuncts that make the hull: a mechanism is certified against the support
function itself, and shows which disjuncts are missed (column pricing).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray, IntArray
from cvxlimit.extensions.interaction.flow import InteractionFlow
from cvxlimit.extensions.interaction.halves import SymmetricHalf
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem, HullState
from cvxlimit.extensions.interaction.settings import BRACKET
from cvxlimit.extensions.interaction.states.disjuncts import Disjuncts
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solution.bracket import known
from cvxlimit.solvers import LimitState, SolverSettings
from cvxlimit.surfaces import Rocking


def priced_disjuncts(
    flow: InteractionFlow,
    certifier: Certifier,
    mechanism: FloatArray,
    worth: float,
    beside: float = 0.0,
) -> Disjuncts:
    """Disjuncts at the worst pressure centres of contacts that open too little, ``beside`` them
    too.

    ``certifier`` opens the mechanism u by t u0 with t = missing / spare, which raises the bound
    by t times the rate -(f_D + alpha f_L) . u0; contacts count that raise it by ``worth``.
    """
    statics, field = certifier.statics, certifier.references.opening_field
    live = float(statics.live @ mechanism.ravel())
    mechanism = mechanism / live if live > 0.0 else mechanism  # as the certificate has it
    rates = statics.relative_rates(mechanism)
    missing, centre, arm = flow.worst(rates)
    noise = ROUNDING * float(np.abs(rates[:, : COLUMN["N"] + 1]).max())
    chosen = (missing > noise) & np.isfinite(centre).all(axis=1)
    if field is not None:
        bound = -float(statics.dead @ mechanism.ravel())
        price = abs(float((statics.dead + bound * statics.live) @ field.ravel()))
        chosen &= missing * price > worth * -flow.opened(statics.relative_rates(field)).missing
    rows = np.flatnonzero(chosen)

    def at(rows: IntArray, place: FloatArray) -> Disjuncts:
        return states_of(flow.moments).disjuncts_at(
            flow.contacts, rows, place, flow.boxes, arm[rows]
        )

    result = at(rows, centre[rows])
    if beside > 0.0:
        size = np.abs(centre[rows])
        ends = (size <= 0.0) | (size >= 1.0)
        inner = ~ends.all(axis=1) & flow.contacts.is_rectangle[rows]
        for step in (-beside, beside):
            moved = np.clip(size + np.where(ends, 0.0, step), 0.0, 1.0)
            result = result.joined(at(rows[inner], np.copysign(moved, centre[rows])[inner]))
    return result


class UpperBound:
    """Relaxations of a run by the hull of every contact, with disjuncts added as they are missed.

    Bounds go to ``run.best``. ``state`` is the last relaxation with a mechanism;
    ``claims_no_optimum`` if the last solver found it to be without limit.
    """

    def __init__(self, run: Run, half: SymmetricHalf | None = None) -> None:
        self.run = run
        with run.clock.phase("compile"):
            self.flow = InteractionFlow(run.contacts, run.moments, is_coarse=True)
            self.certifier = Certifier(run.assemblage, (Rocking(),), flow=self.flow)
            self.problem = HullProblem(run.assemblage, half)
            self.pieces = self.problem.column_blocks(
                states_of(run.moments).box_disjuncts(run.contacts)
            )
        self.state: LimitState | None = None
        self._beside, self.claims_no_optimum = BRACKET.beside, False

    def search(self, tolerance: float, ladder: Sequence[SolverSettings]) -> None:
        for _ in self.rounds(tolerance, ladder):
            pass

    def rounds(self, tolerance: float, ladder: Sequence[SolverSettings]) -> Iterator[None]:
        """The search, which stops before every solve with further disjuncts."""
        for settings in ladder:
            for _ in range(BRACKET.most_rounds):
                is_changed = self._improve(settings, tolerance)
                factor = None if self.state is None else self.state.load_factor
                upper = self.run.best.bracket.upper
                if factor is not None and upper - factor <= tolerance * self._unit:
                    return
                if not is_changed:
                    break
                yield
            if self.claims_no_optimum:
                return

    def offer(self, mechanism: FloatArray) -> None:
        with self.run.clock.phase("certify"):
            bound = self.certifier.certificate(None, None, mechanism)
            run = self.run
            run.best = run.best.lowered(bound.upper, bound.upper_is_proved, mechanism)

    def _improve(self, settings: SolverSettings, tolerance: float) -> bool:
        run, pieces = self.run, self.pieces
        start = self.state.halfway if isinstance(self.state, HullState) else None
        state = run.solve(lambda s: self.problem.solve(pieces, s, start=start), settings)
        self.claims_no_optimum = state.outcome.claims_no_optimum
        if state.mechanism is None:
            run.note(state, settings, **run.bounds)
            return False
        self.state = state
        with run.clock.phase("certify"):
            bound = self.certifier.certificate(state.forces, None, state.mechanism)
            run.best = run.best.lowered(bound.upper, bound.upper_is_proved, state.mechanism)
            worth = BRACKET.worth_a_disjunct * tolerance * self._unit
            new = priced_disjuncts(self.flow, self.certifier, state.mechanism, worth, self._beside)
        run.note(state, settings, **run.bounds, flow_violation=known(bound.flow_violation))
        self.pieces += self.problem.column_blocks(new)
        self._beside *= BRACKET.beside
        return len(new) > 0

    @property
    def _unit(self) -> float:
        return replace(self.run.best.bracket, lower=-np.inf).unit
