"""Lower bounds on the load factor with interaction, from forces checked outside the solver.

Contact forces are arrays (n, 6) in the columns V1 V2 N M1 M2 MT of ``COMPONENTS``, N > 0 in
compression, in the scene's units. Eq. 9 is rocking, Eq. 30 torsion, shear and bending.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.extensions.interaction.relaxation.hull import HullProblem
from cvxlimit.extensions.interaction.restriction.steps import SafeStep
from cvxlimit.extensions.interaction.settings import PROOF
from cvxlimit.extensions.interaction.states.majorants import Point
from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.driver import Run
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.formulations import ForceModel, Part, corner_compressions
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor
from cvxlimit.model.statics import block_sizes
from cvxlimit.proof.references import References
from cvxlimit.proof.strength import Strength
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.pressure import centres, half_extent
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import REFERENCE, TOLERANCE, Bracket
from cvxlimit.solvers import LimitState, default_ladder, ladder_for
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES, Rocking


@dataclass(frozen=True, eq=False)
class LowerBound:
    """A lower bound on the load factor with interaction, and the forces (n, 6) that show it.

    ``value`` is -inf if the forces were refused. ``is_proved`` where they satisfy Eq. 9 and 30 and
    equilibrium to rounding; otherwise they do so within :attr:`ProofSettings.accepted`, and
    ``value`` is less by what that is worth if no rate of the exact mechanism exceeds ten times that
    of the block with the least live load, moving alone. ``excess`` and ``residual`` are the largest
    of Eq. 9 and 30 and of equilibrium, over the total load.
    """

    value: float
    forces: FloatArray
    load_factor: float
    is_proved: bool
    excess: float
    residual: float

    @property
    def is_accepted(self) -> bool:
        return bool(np.isfinite(self.value))

    def raising(self, answer: Answer) -> Answer:
        return answer.raised(self.value, self.is_proved, self.load_factor, self.forces)


class LowerBounds:
    """The checker of one scene in one reading, wherever forces come from.

    They are brought into equilibrium. Where they do not pass exactly, they are mixed with a share t
    of a state that carries the dead load alone strictly inside Eq. 30: the mixture is in
    equilibrium with (1 - t) alpha, and is checked itself, since Eq. 30 is not convex.
    """

    def __init__(self, scene: Scene | Assemblage, moments: Moments) -> None:
        self.assemblage, self.moments = Assemblage.of(scene), moments
        self.statics, self.scaling = self.assemblage.statics, self.assemblage.scaling
        self._disjuncts: dict[int, Contacts] = {}

    def of(self, forces: FloatArray, load_factor: float) -> LowerBound:
        """Returns the bound that forces (n, 6) at a load factor prove after they were balanced and,
        if necessary, mixed with a state inside."""
        if not (np.isfinite(forces).all() and np.isfinite(load_factor)):
            return LowerBound(-np.inf, forces, load_factor, False, np.inf, np.inf)
        balanced = self.balanced(forces, load_factor)
        plain = self.checked(balanced, load_factor)
        if plain.is_proved or not np.isfinite(plain.excess):
            return plain
        is_close = plain.is_accepted and max(plain.excess, plain.residual) <= ROUNDING
        most = TOLERANCE if is_close else PROOF.shares[-1]
        shares = [share for share in PROOF.shares if share <= most]
        for share, reserve in self._admissible(balanced, shares):
            mixed = (1.0 - share) * balanced + share * reserve
            bound = self.checked(mixed, (1.0 - share) * load_factor)
            if bound.is_proved:
                return bound
        return plain

    def _admissible(
        self, forces: FloatArray, shares: Sequence[float]
    ) -> Iterator[tuple[float, FloatArray]]:
        """Mixtures that satisfy Eq. 9 and 30, least shares first. Many are tried at a time: that
        takes NumPy hardly longer than one."""
        every, n = list(product(shares, self.reserves)), len(forces)
        at_a_time = max(len(self.reserves), PROOF.rows // max(n, 1), 1)
        for mixtures in (every[k : k + at_a_time] for k in range(0, len(every), at_a_time)):
            mixed = np.concatenate([(1.0 - t) * forces + t * x for t, x in mixtures])
            over = true_excess(mixed, self._repeated(len(mixtures)), self.moments)
            for given, most in zip(mixtures, over.reshape(-1, n).max(axis=1), strict=True):
                if most <= 0.0:
                    yield given

    def _repeated(self, times: int) -> Contacts:
        """Returns all contacts so many times, one after the other, to check states together."""
        if times not in self._disjuncts:
            contacts = self.statics.contacts
            self._disjuncts[times] = contacts.take(np.tile(np.arange(len(contacts)), times))
        return self._disjuncts[times]

    @cached_property
    def reserves(self) -> tuple[FloatArray, ...]:
        """States (n, 6) strictly inside Eq. 9 and 30 that carry the dead load alone."""
        central = central_states(self.assemblage)
        inside = tuple(state for state in central if self._is_inside(state))
        if inside or not np.any(self.statics.dead):
            return inside
        alone = self.assemblage.alone(self.statics.dead)
        problem = LimitProgram(alone, goal=LargestFactor(most=1.0))
        forces = carried(problem.run(default_ladder()[0]))
        if forces is None:
            return ()
        balanced = self.balanced(forces, 0.0)
        return (balanced,) if self._is_inside(balanced) else ()

    def _is_inside(self, state: FloatArray) -> bool:
        if not np.isfinite(state).all() or not self._is_balanced(state, 0.0):
            return False
        return bool(true_excess(state, self.statics.contacts, self.moments).max() < 0.0)

    def checked(self, forces: FloatArray, load_factor: float) -> LowerBound:
        """Returns the bound that forces (n, 6) prove as they are."""
        if not np.isfinite(forces).all():
            return LowerBound(-np.inf, forces, load_factor, False, np.inf, np.inf)
        over = np.maximum(true_excess(forces, self.statics.contacts, self.moments), 0.0)
        rest = block_sizes(self.statics.residual(forces, load_factor), self.scaling.length)
        excess, residual = (float(v.max()) / self.scaling.force for v in (over, rest))
        proved = excess <= 0.0 and self._is_balanced(forces, load_factor)
        rate = REFERENCE * self.statics.rate_of_the_lightest(self.scaling.length)
        lost = 0.0 if proved else float(over.sum() + rest.sum()) * rate
        unit = self.scaling.unit(load_factor)
        is_near = max(excess, residual) <= PROOF.accepted and lost <= PROOF.most_lost * unit
        value = float(load_factor) - lost if proved or is_near else -np.inf
        return LowerBound(value, forces, float(load_factor), proved, excess, residual)

    def is_admissible(self, forces: FloatArray, load_factor: float) -> bool:
        """Returns True if forces satisfy equilibrium, rocking and Eq. 30 up to rounding."""
        bound = self.checked(forces, load_factor)
        return max(bound.excess, bound.residual) <= ROUNDING

    def balanced(self, forces: FloatArray, load_factor: float) -> FloatArray:
        """Returns forces (n, 6) with the least change that balances the loads."""
        return self.assemblage.balance.balanced(forces, load_factor, self.statics)

    def _is_balanced(self, forces: FloatArray, load_factor: float) -> bool:
        return self.statics.is_balanced(forces, load_factor, self.scaling.length)


class TrueStrength(Strength):
    """Eq. 9 and 30 as they stand, for :func:`~cvxlimit.proof.admissible.carried_exactly`."""

    def __init__(self, assemblage: Assemblage, moments: Moments) -> None:
        super().__init__(assemblage, DEFAULT_SURFACES)
        self.moments = moments

    def of(self, part: Assemblage, contacts: IntArray) -> TrueStrength:
        return TrueStrength(part, self.moments)

    @cached_property
    def balance(self) -> Balance:
        """That of the surfaces without interaction: what resists nothing there does so here."""
        return Strength(self.assemblage, DEFAULT_SURFACES).balance

    def excess(self, state: FloatArray) -> FloatArray:
        return true_excess(state, self.contacts, self.moments)

    @property
    def rows(self) -> IntArray:
        return np.arange(len(self.contacts))


def carried(state: LimitState) -> FloatArray | None:
    """Returns the forces (n, 6) that carry all of a load, from the answer of a problem whose load
    factor, the share that is carried, is 0 or 1 but for rounding; None if it is 0."""
    if state.forces is None or not state.load_factor or state.load_factor < 0.5:
        return None
    return state.forces / state.load_factor


def true_excess(forces: FloatArray, contacts: Contacts, moments: Moments) -> FloatArray:
    """Returns by how much forces (n, 6) exceed Eq. 9 or 30 at each contact (n,), as a force."""
    return np.maximum(rocking_excess(forces, contacts), moments.excess(forces, contacts))


def rocking_excess(forces: FloatArray, contacts: Contacts) -> FloatArray:
    """Eq. 9 in force units (n,): how far pressure is outside the contact; tension counts too."""
    outside: FloatArray = -contacts.corner_minimum(-Rocking().excess(forces, contacts)[0])
    return np.maximum(outside, -forces[:, COLUMN["N"]])


def plain_references(assemblage: Assemblage) -> References:
    """Returns the reference states of an assemblage without interaction."""
    return References(assemblage, Strength(assemblage, DEFAULT_SURFACES))


def central_states(assemblage: Assemblage) -> Iterator[FloatArray]:
    """Yields states (n, 6) that carry the dead load with little shear and central pressure: those
    of contacts with less friction and smaller size, :attr:`ProofSettings.reserves`."""
    whole = assemblage.contacts
    for friction, size in PROOF.reserves:
        shrunk = replace(whole.scaled(size), origin=whole.origin)
        smaller = replace(shrunk, friction=friction * whole.friction)
        statics = replace(assemblage.statics, contacts=smaller)
        balance = Balance(statics, corner_compressions(smaller))
        state = plain_references(replace(assemblage, statics=statics, balance=balance)).dead_state
        if state is not None:
            yield state


def prove(run: Run, end: float = np.inf, asked: float = 0.0) -> None:
    """Give ``run.best`` a proved lower bound where it has none, if that costs little of its width,
    or of the relative width ``asked`` for that it has to spare.

    Forces at full slip have no share of friction to spare, and mixing in a state that has some
    moves pressure centres, about which the shear then turns by more than it gains: Eq. 30 is not
    convex. But with the centres held it is. So the frozen problem at the forces' own centres is
    solved once more with a little less friction, in contacts that are a little smaller, and its
    forces are put into balance by changes that leave the centres where they are. What is left over
    is larger than what solver and rounding leave, and the checker has the last word. Where the same
    margin for all contacts does not do, or costs too much, only those that still exceed Eq. 30 get
    a larger one. Where forces are determinate once the centres are held, safe steps with as much
    less friction follow. Beyond ``end`` seconds of the run all take a small share of that time.
    Where none of it does better, a lower bound that was proved on the way up comes back.
    """
    best, sure = run.best, run.best.sure
    if best.forces is None or best.load_factor is None or best.bracket.lower_is_proved:
        return
    width = best.bracket.width
    within = min(PROOF.most_of_width * asked, asked - width)
    spare = max(PROOF.most_of_width * width, TOLERANCE, within) * best.bracket.unit
    least = best.bracket.lower - spare
    if sure is not None and sure.bracket.lower < least:
        sure = None
    unbound = replace(best, bracket=replace(best.bracket, lower=-np.inf))
    found = _proved(run, best.forces, least if sure is None else sure.bracket.lower, end)
    if found is not None:
        run.best = found.raising(unbound)
    elif sure is not None:
        run.best = unbound.raised(sure.bracket.lower, True, sure.load_factor, sure.forces)


def _proved(run: Run, forces: FloatArray, least: float, end: float) -> LowerBound | None:
    """A proved bound of at least ``least`` near the forces."""
    checker = LowerBounds(run.assemblage, run.moments)
    until = (1.0 + PROOF.late) * max(end, run.clock.elapsed)
    ways = ((_proof, True), (_proof, False), (_stepped, True))
    for (tried, is_alike), attempts in zip(ways, PROOF.attempts, strict=True):
        margin = np.full(len(run.contacts), PROOF.margin)
        for number in range(attempts):
            if number > 0 and run.clock.elapsed > until:
                return None
            with run.clock.phase("certify"):
                found = tried(run, checker, forces, margin)
            if found is not None and found.load_factor < least:
                break
            if found is not None and found.is_proved:
                return found
            margin = np.where(is_alike | _exceeds(run, found), PROOF.growth, 1.0) * margin
    return None


def _exceeds(run: Run, found: LowerBound | None) -> BoolArray:
    """Returns which contacts (n,) exceed Eq. 30: all if there is no answer or none exceeds it."""
    if found is None or not np.isfinite(found.forces).all():
        return np.ones(len(run.contacts), dtype=bool)
    over = true_excess(found.forces, run.contacts, run.moments) > 0.0
    return over | (not over.any())


def _stepped(
    run: Run, checker: LowerBounds, forces: FloatArray, margin: FloatArray
) -> LowerBound | None:
    """Returns the bound of a safe step from the forces with a ``margin`` (n,) less friction."""
    step = SafeStep(_slippery(run, margin), run.moments)
    point = step.point(forces, Point.middle(step.statics.contacts), PROOF.accepted)
    state = step.solve(point.shrunk(states_of(run.moments).shrink), ladder_for("tight")[0])
    if state.forces is None or state.load_factor is None:
        return None
    return checker.of(state.forces, state.load_factor)


def _slippery(run: Run, margin: FloatArray) -> Assemblage:
    """Returns the assemblage with friction less by a share ``margin`` (n,) of it."""
    less = replace(run.contacts, friction=(1.0 - margin) * run.contacts.friction)
    return replace(run.assemblage, statics=replace(run.assemblage.statics, contacts=less))


def _proof(
    run: Run, checker: LowerBounds, forces: FloatArray, margin: FloatArray
) -> LowerBound | None:
    """Returns the bound of the frozen problem at the forces' own pressure centres, with a
    ``margin`` (n,) less friction in contacts that are as much smaller."""
    contacts, extent = run.contacts, half_extent(run.contacts)
    centre = centres(forces, contacts, 1.0 - margin)
    is_idle = forces[:, COLUMN["N"]] <= ROUNDING * run.scaling.force
    disjuncts = (
        states_of(run.moments).safe_disjuncts(contacts, centre).without(np.flatnonzero(is_idle))
    )
    state = HullProblem(_slippery(run, margin)).solve(disjuncts, ladder_for("tight")[0])
    if state.forces is None or state.load_factor is None:
        return None
    held = _held(contacts, centre * extent, np.flatnonzero(~is_idle))
    balance = Balance(run.assemblage.statics, held)
    try:
        balanced = balance.balanced(state.forces, state.load_factor, run.assemblage.statics)
    except RuntimeError:  # contacts that are held resist nothing in some way of moving
        return None
    return checker.checked(balanced, state.load_factor)


def _held(contacts: Contacts, e: FloatArray, pressed: IntArray) -> ForceModel:
    """Returns the internal forces of the contacts ``pressed`` whose pressure centres are held at
    the eccentricities ``e`` (n, 2): compression, shear through the centre, and torsion about it."""
    e1, e2 = e[pressed].T
    parts = [
        Part("n", {"N": 1, "M1": e2, "M2": -e1}, pressed, nonneg=True),
        Part("v1", {"V1": 1, "MT": -e2}, pressed),
        Part("v2", {"V2": 1, "MT": e1}, pressed),
        Part("t", {"MT": 1}, pressed),
    ]
    return ForceModel(contacts, parts)


def basis(bracket: Bracket, *remarks: str) -> str:
    """Returns a sentence on what the two bounds rest on, followed by the remarks."""
    if not np.isfinite(bracket.lower):
        lower = "no forces were found that satisfy Eq. 30"
    elif bracket.lower_is_proved:
        lower = "lower bound proved: its forces satisfy Eq. 30 to rounding"
    else:
        lower = (
            f"lower bound not proved: its forces exceed Eq. 30 by up to {PROOF.accepted:.0e} of "
            "the total load; it holds if no block moves more than ten times as fast at collapse, "
            "per unit of work of the live load, as the block with the least live load would alone"
        )
    upper = (
        "upper bound proved by a convex problem that contains every admissible state"
        if bracket.upper_is_proved
        else "upper bound not proved: it holds if no contact bears more than ten times the total "
        "load, or ten times the largest force found"
    )
    return "; ".join(part for part in (lower, upper, *remarks) if part)
