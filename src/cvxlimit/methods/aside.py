"""What is asked beside the load factor, of convex problems of their own.

- Does the dead load stand alone? The largest share t <= 1 of it that forces carry is 1 then, and
  they are the reference state of lower bounds. Where t is 0, the duals are rates of blocks at which
  the dead load does work.
- If it does not: does it stand with a part of the live load? The largest share beside any multiple
  of the live load says so, and ends inside the interval of load factors that are carried.
- Do contacts wedge each other? The duals of the largest self-stress are rates that open every
  contact, if no contact can be pressed without a load: the opening field of upper bounds.
- Do forces carry a load alone? If it is the live load, any multiple of it is carried.

Two solvers of the ladder are asked at most. No answer is believed: forces and rates go to the
certifier, which proves what they show.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.methods.driver import Run
from cvxlimit.model.assemblage import Reduction
from cvxlimit.model.formulations import Formulation, times
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor, Stated, largest_self_stress
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.checks import RESIDUAL
from cvxlimit.proof.strength import Strength
from cvxlimit.reductions.choice import Reductions
from cvxlimit.solution.bracket import REFERENCE, TOLERANCE, Certificate
from cvxlimit.solvers import LimitState, SolverSettings, settings_for
from cvxlimit.surfaces.base import YieldSurface
from cvxlimit.surfaces.coulomb import needed_surfaces

SOLVERS_ASIDE = 2
"""Of the ladder, for questions beside the load factor: forces inside, and a mechanism that is exact
enough, are all that is asked for, and the first may fail where friction is huge."""

LOOSE = 0.1
"""Tolerance of the first solver for a load alone: whether it stands shows far from the optimum."""


def largest_share(stated: Stated) -> Any:
    """Goal: the largest share, at most all, of the dead load that is carried beside any multiple of
    the live load, either way."""
    share = stated.own["share"] = stated.into.new(name="share", nonneg=True)
    stated.into.nonneg(1.0 - share)
    stated.dead = times(stated.dead, share)
    return share


class Held(NamedTuple):
    """A state of forces that carries the dead load with ``factor`` of the live load; None for both
    where there is none: contact forces below ``resistance`` could not hold it then (infinite if
    none could), and 0 if the question is open."""

    state: FloatArray | None
    factor: float
    resistance: float

    @property
    def remark(self) -> str:
        """Says, where no part of the live load holds the dead load, whether the live load turned
        round does."""
        if self.state is None:
            return "" if self.resistance else "whether a part of the live load holds it is open"
        if self.factor > 0.0:
            return ""
        return (
            f"{-self.factor:.3g} times the live load in the opposite direction would hold it: "
            "reverse the live load, and the answer is from which part of it on the structure stands"
        )


class Aside:
    """A scene with so much ``model`` as asked for, and the questions beside its load factor.

    Attributes
    ----------
    run : Run
    surfaces : tuple of YieldSurface
        Without those that others imply.
    reductions : Reductions
    certifier : Certifier
        Of the full scene; what is found goes to it.
    planar_from : int
        As for :meth:`Reductions.of <cvxlimit.reductions.choice.Reductions.of>`.
    problem : LimitProgram
        That of the load factor, with the smallest model, or one that exists already. Loads alone
        are asked of the solvers of its ladder, for a bracket within ``tolerance``.
    """

    def __init__(
        self,
        run: Run,
        model: str,
        tolerance: float = TOLERANCE,
        problem: LimitProgram | None = None,
        planar_from: int = 0,
    ) -> None:
        self.run, self.tolerance = run, tolerance
        self.surfaces = needed_surfaces(run.surfaces)
        self.reductions = Reductions(run.assemblage, run.formulation)
        if problem is None:
            with run.clock.phase("compile"):
                about = run.assemblage, self.surfaces, run.formulation
                self.reductions = Reductions.of(*about, model, planar_from)
        with run.clock.phase("certify"):
            self.certifier = Certifier(
                self.reductions.assemblage, self.surfaces, run.formulation, width=tolerance
            )
        self.problem = self.smallest_problem() if problem is None else problem

    def smallest_problem(self, dead_state: FloatArray | None = None) -> LimitProgram:
        """The problem with the smallest model. Parts without live load are left out of it only if
        ``dead_state``, forces (n, 6) that carry the dead load, shows that they stand."""
        with self.run.clock.phase("compile"):
            reduction = self.reductions.best(dead_state)
            self.run.reductions = reduction.names
            assemblage = self.reductions.assemblage
            return LimitProgram(assemblage, self.run.surfaces, reduction=reduction)

    @property
    def ladder(self) -> Sequence[SolverSettings]:
        """Solvers in the order in which they are tried."""
        with self.run.clock.phase("compile"):
            return self.run.ladder or self.problem.ladder(self.tolerance)

    def dead_load_alone(self) -> tuple[FloatArray | None, float]:
        """Give the certifier forces that carry the dead load: an interior-point solver ends far
        deeper inside all surfaces than projections do. Where there are none, returns rates on which
        the dead load alone does work, and the contact forces that could hold it all the same,
        infinite if that is proved.

        Asks for the largest share t <= 1 of it. Without constants in the conditions that is 1 or 0,
        so an upper bound below 1 / 2 is a proof; with them only one below 1 is.
        """
        run, what, dead = self.run, "dead load alone", self.run.assemblage.statics.dead
        if not np.any(dead):
            return None, np.inf
        run.tell("checking that the dead load can stand")
        # limits of 1 come out to 1e-8
        enough = 0.5 if self.certifier.strength.is_cone else 1.0 - RESIDUAL
        with run.clock.phase("compile"):
            whole, reduction = self.reductions.assemblage, self.reductions.best()
            problem = LimitProgram(
                whole.alone(dead), run.surfaces, reduction=reduction, goal=LargestFactor(most=1.0)
            )
        for state, certificate in self._shares(problem, what, run.formulation):
            forces = self.certifier.given(state)
            if forces is not None and state.load_factor and state.load_factor > enough:
                if self.certifier.offer_dead_state(forces / state.load_factor):
                    break
            elif state.mechanism is not None and (bounds := certificate()).upper < enough:
                is_proved = bounds.upper_is_proved or not bounds.missing_opening > 0.0
                return state.mechanism, np.inf if is_proved else 1.0 / bounds.missing_opening
        return None, np.inf

    def held_by_live_load(self) -> Held:
        """Finds with which part of the live load the dead load stands that does not stand alone, or
        a proof that it does with none.

        An interior-point solver ends among all states that carry the whole dead load, so that the
        one it gives is well inside where any is. Where there is none, rates on which the live load
        does no power, and the dead load does, show it.
        """
        run, certifier, reductions = self.run, self.certifier, self.reductions
        run.tell("checking whether a part of the live load holds the dead load")
        with run.clock.phase("compile"):
            problem = LimitProgram(
                reductions.assemblage, run.surfaces, reduction=reductions.best(),
                goal=largest_share,
            )  # fmt: skip
        near = Held(None, 0.0, 0.0)
        for settings in (run.ladder or problem.ladder())[:SOLVERS_ASIDE]:
            state = run.solve(problem.run, settings)
            label = f"{settings}, dead load with a part of the live load"
            run.note(replace(state, load_factor=None), label)
            given, share = certifier.given(state), float(state.own.get("share", [0.0])[0])
            with run.clock.phase("certify"):
                if given is not None and state.load_factor is not None and share > 0.5:
                    scale = share if certifier.strength.is_cone else 1.0
                    near = Held(given / scale, state.load_factor / scale, 0.0)
                    if certifier.offer_dead_state(given / scale, near.factor):
                        return near
                if state.mechanism is not None:
                    resistance = self._resistance(state.mechanism)
                    if resistance > 0.0:
                        return Held(None, 0.0, resistance)
        return near if near.factor > 0.0 else Held(None, 0.0, 0.0)

    def _resistance(self, mechanism: FloatArray) -> float:
        """Contact forces that it would take to hold the dead load on a mechanism on which no
        multiple of the live load of any natural size does: infinite if the flow rule allows it, 0
        if it shows nothing."""
        statics, opened = self.certifier.statics, self.certifier.opened(mechanism)
        rates = opened.rates.ravel()
        power = float(statics.dead @ rates) - opened.dissipation
        live = abs(float(statics.live @ rates))
        if not (power > 0.0 and (live == 0.0 or self.run.is_boundless(power / live))):
            return 0.0
        if opened.is_allowed:
            return np.inf
        acting = float(np.abs(statics.dead).sum())
        resistance = power / opened.missing if opened.missing > 0.0 else np.inf
        return resistance if resistance > REFERENCE * acting else 0.0

    def opening_field(self) -> None:
        """Give the certifier rates that open every contact, unless blocks wedge each other. They
        are the duals of the largest self-stress: where contacts cannot press each other without a
        load, some rates open them all."""
        run, reductions = self.run, self.reductions
        run.tell("checking that blocks do not wedge each other")
        with run.clock.phase("compile"):
            goal, whole = largest_self_stress, reductions.best()
            problem = LimitProgram(reductions.assemblage, run.surfaces, goal=goal, reduction=whole)
        for settings in problem.ladder()[:SOLVERS_ASIDE]:
            state = run.solve(partial(problem.run, has_rows=False), settings)
            run.note(replace(state, load_factor=None), f"{settings}, self-stress")
            if state.mechanism is not None and self.certifier.offer_opening_field(state.mechanism):
                return

    def carrying(
        self, load: FloatArray, surfaces: Sequence[YieldSurface], formulation: Formulation
    ) -> FloatArray | None:
        """Forces (n, 6) that carry a ``load`` alone, recomputed outside the solver, or None."""
        run, loaded = self.run, self.reductions.assemblage.under(load, load)
        with run.clock.phase("compile"):
            alone, reduction = loaded.alone(load), self.reductions.best()
            if formulation is not run.formulation:
                reduction = Reduction.none(alone.statics, formulation)
            goal = LargestFactor(most=1.0)
            problem = LimitProgram(alone, surfaces, reduction=reduction, goal=goal)
        # has_rows: where a load grazes, CVXPY's rows show all of 295 scenes to solvers, ours 293
        for state, certificate in self._shares(problem, "load alone", formulation, has_rows=False):
            carrying = self.certifier.given(state)
            if carrying is not None and state.load_factor and state.load_factor > 0.5:
                with run.clock.phase("certify"):
                    strength = Strength(loaded, surfaces, formulation)
                    forces = carried_exactly(strength, carrying / state.load_factor)
                if forces is not None:
                    return forces
            elif certificate().upper < 0.5:
                break
        return None

    def _shares(
        self, problem: LimitProgram, what: str, formulation: Formulation, has_rows: bool = True
    ) -> Iterator[tuple[LimitState, Callable[[], Certificate]]]:
        """Which share <= 1 of a load alone is carried: yields the state of each of the first
        solvers, and what makes its certificate. ``has_rows`` is as for :meth:`LimitProgram.run`."""
        run = self.run

        def certificate(state: LimitState) -> Certificate:
            run.tell("checking the bracket")
            with run.clock.phase("certify"):
                return Certifier(problem.assemblage, problem.surfaces, formulation).of(state)

        solvers = self.ladder
        if solvers[0].name == "BLOCKWISE" and not run.ladder and self.certifier.strength.is_cone:
            solvers = (settings_for("BLOCKWISE", LOOSE), *solvers)
        answers = 0  # a solver that takes no such problem does not count
        for settings in solvers:
            state = run.solve(partial(problem.run, has_rows=has_rows), settings)
            run.note(replace(state, load_factor=None), f"{settings}, {what}")
            yield state, partial(certificate, state)
            answers += state.outcome.has_values or state.outcome.claims_no_optimum
            if answers >= SOLVERS_ASIDE:
                break
