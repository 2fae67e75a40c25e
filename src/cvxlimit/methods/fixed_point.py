"""The paper's fixed point (section 4, Eq. 41-43), with its failures named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import cvxpy as cp
import numpy as np

from cvxlimit.base.checks import count, is_number, not_negative, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.convex import dead_load_falls
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.model.formulations import FORCES
from cvxlimit.model.statement import LARGEST_FACTOR, Stated
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.pressure import Pressure
from cvxlimit.solution import Iterate, Iteration, Status
from cvxlimit.solution.records import IN_A_ROW
from cvxlimit.solvers import default_ladder, ladder_for

FORGOTTEN = 20
"""Solves after which the start counts as forgotten: with the paper's weight of 0.8 it has 1 % left
in the forces then (0.8 ** 20). The band is that of all iterates after these, at least twenty."""

LAPS, LONGEST = 3, 8
"""A cycle is one of 2 to 8 load factors that were run through three times: two could be chance."""


@dataclass(frozen=True)
class LeastForces:
    """The load factor, less ``weight`` times the squared norm of all forces: one state is the best,
    where a solver's choice depends on rounding. V1, V2 and N count in units of the total load,
    moments over the unit of length besides, so the norm does not depend on the contacts' axes.
    """

    weight: float

    is_quadratic: ClassVar[bool] = True  # in cones, moments came out to 1e-2 where gaps were 1e-9

    def __call__(self, stated: Stated) -> Any:
        length = stated.assemblage.scaling.length
        units = {c: 1.0 if c in FORCES else length for c in COMPONENTS}
        square = sum(cp.sum_squares(stated.forces[c] / unit) for c, unit in units.items())
        return stated.factor - self.weight * square


@dataclass(frozen=True)
class FixedPoint(Method):
    """The paper's iteration: solve with frozen eccentricities, blend, repeat.

    The first iterate uses whole contacts (Eq. 41). The paper stops at the first small change
    (Eq. 43). Most iterations wander on from there, each solver along a path of its own, so that
    this is reported in ``solution.iteration`` and the iteration goes on: to five small changes in a
    row, which count as converged, or to ``max_iterations``, with the band of the iterates after
    the first twenty. It has no bracket: the bounds of its last convex problem, with eccentricities
    frozen, are not bounds of the collapse load with interaction. For those see
    :class:`~cvxlimit.extensions.interaction.certified.Certified`.

    Attributes
    ----------
    old_value_weight : float
        Weight beta in [0, 1) of the forces used so far against the new ones, for N, M1 and M2
        alike (Eq. 42, read as Gilbert et al. 2006 do: beta weighs the old value). 0.8 is the
        paper's value.
    tolerance : float
        Relative change of the load factor that counts as small (Eq. 43); the paper's 1e-4.
    max_iterations : int
        Problems solved at most. With fewer than 40 the band holds iterates near the start.
    moments : str or Moments
        How Eq. 30 adds moments: see :func:`cvxlimit.solve`.
    epsilon : float
        The paper's small number of Eq. 41, here in mean block weights: Eq. 31 divides by
        N + epsilon, so that contacts which carry next to nothing count as pressed near their
        centres. The default is its limit: contacts without compression count as pressed there.
    regularisation : float
        Weight of the squared norm of the forces that is taken off the scaled load factor, so that
        the forces behind the next eccentricities are unique and do not depend on rounding. Its
        effect: docs/evidence/atlas.md.

    Example
    -------
    >>> FixedPoint(old_value_weight=0.5).tolerance
    0.0001
    """

    name = "fixed-point"
    answers = "interaction with bending by the paper's iteration (Eq. 41-43), without a bracket"
    axis = "interaction"
    surfaces, takes, reduces = ("conic", "facets"), ("reactions",), False

    old_value_weight: float = 0.8
    tolerance: float = 1e-4
    max_iterations: int = 60
    epsilon: float = 0.0
    regularisation: float = 0.0
    moments: str | Moments = "independent"

    def __post_init__(self) -> None:
        if not (is_number(self.old_value_weight) and 0.0 <= self.old_value_weight < 1.0):
            raise ModelError(
                "old_value_weight must be at least 0 and below 1 (1 would never move), "
                f"got {self.old_value_weight!r}"
            )
        ratio(self.tolerance, "tolerance")
        count(self.max_iterations, 1, "max_iterations")
        not_negative(self.epsilon, "epsilon")
        not_negative(self.regularisation, "regularisation")

    def steps(self, run: Run) -> Steps:
        moments = run.moments = parse_moments(self.moments)
        cautions = ["the iteration gives no bounds on the collapse load"]
        cautions += [moments.caution] if moments.caution else []
        if run.contacts.is_point.any():
            cautions += ["method 'certified' takes the force of ties and reactions as a load only"]
        run.remarks = cautions
        with run.clock.phase("compile"):
            goal = LeastForces(self.regularisation) if self.regularisation else LARGEST_FACTOR
            frozen = FrozenProblem(run.assemblage, run.cone, moments, goal)
        if moments.has_eq_24 and dead_load_falls(run):
            return Status.DEAD_LOAD_UNSTABLE
        epsilon = self.epsilon * run.scaling.force / len(run.scene.free)
        blended = np.zeros((len(run.contacts), len(COLUMN)))
        purpose = "quadratic iterates" if self.regularisation else "iterates"
        ladder = run.ladder or (*ladder_for(purpose), *default_ladder())
        in_a_row = 0  # small changes
        for number in range(self.max_iterations):
            # Eq. 31 and 41: a convex problem with the eccentricities of the forces so far
            pressure = Pressure.of(blended, run.contacts, epsilon)
            state, settings = run.try_solvers(partial(frozen.solve, pressure), ladder)
            change = run.change(state)
            run.note(state, settings, change=change)
            if state.forces is None:
                return Status.DIVERGED if state.outcome.claims_no_optimum else Status.SOLVER_FAILED
            # Eq. 42: its forces, with a share of the old ones
            beta = self.old_value_weight if number else 0.0
            blended = beta * blended + (1.0 - beta) * state.forces
            # Eq. 43, which one small change meets: it is reported, and the iteration goes on
            in_a_row = in_a_row + 1 if change is not None and change <= self.tolerance else 0
            has_converged = in_a_row >= IN_A_ROW
            last = IN_A_ROW + 1 if has_converged else max(FORGOTTEN, number + 1 - FORGOTTEN)
            found = self._iteration(run.history, last)
            run.best = replace(
                run.best, load_factor=state.load_factor, forces=state.forces,
                mechanism=state.mechanism, iteration=found,
            )  # fmt: skip
            run.remarks = [str(found), *cautions]
            yield
            if has_converged:
                return Status.CONVERGED
            if cycles(run.load_factors, self.tolerance):
                return Status.CYCLING
        return Status.NOT_CONVERGED

    def _iteration(self, history: Sequence[Iterate], last: int) -> Iteration:
        """Returns where the paper would have stopped, after the first small change, and the band of
        the ``last`` iterates."""
        met_after, met_at = None, None
        for number, entry in enumerate(history, 1):
            if entry.change is not None and entry.change <= self.tolerance:
                met_after, met_at = number, entry.load_factor
                break
        factors = [entry.load_factor for entry in history[-last:] if entry.load_factor is not None]
        return Iteration(met_after, met_at, min(factors), max(factors), len(factors))


def cycles(values: Sequence[float | None], tolerance: float) -> bool:
    """True if the last values repeat with a period of 2 to 8, three times over.

    >>> cycles([0.5, 0.3, 0.1, 0.3, 0.1, 0.3, 0.1], 1e-4), cycles([0.3, 0.2, 0.1], 1e-4)
    (True, False)
    """
    for period in range(2, min(LONGEST, len(values) // LAPS) + 1):
        laps = np.array(values[-LAPS * period :], dtype=float).reshape(LAPS, period)
        if np.ptp(laps, axis=0).max() <= tolerance * np.abs(laps).max():  # NaN, for None, is more
            return True
    return False
