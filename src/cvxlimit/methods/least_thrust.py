"""Below which load factor no solution without dilatancy lies: proved, from least thrusts of joints.

Let N' be compressions that no admissible state at a load factor between a and c falls below, joint
by joint. Every solution without dilatancy in that interval has its forces x within the friction
mu N of its own compressions N >= N'. Forces y that balance the loads at a factor F with no more
friction than mu N' are then among those of which x does the least power on its mechanism u, so that

    F  =  -f_D . u - y . A' u  <=  -f_D . u - x . A' u  =  its load factor.

No solution lies between a and the smaller one of c and F. The proof is in docs/lower-bound.md. From
a = 0 on, intervals are excluded one after the other, until friction of the least thrusts at a
carries no more than a.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import SMALL, FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.aside import Aside
from cvxlimit.methods.driver import Run
from cvxlimit.model.formulations import corner_compressions, times
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor, Stated
from cvxlimit.model.statics import DOF
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.gluing import with_contacts
from cvxlimit.proof.minorant import Minorant, minorant
from cvxlimit.proof.tresca import is_friction, tresca
from cvxlimit.reductions.choice import Reductions, contacts_of, loaded_blocks
from cvxlimit.solution.bracket import TOLERANCE, Evidence, Reference
from cvxlimit.solvers import LimitState, Outcome
from cvxlimit.surfaces.base import number, stated
from cvxlimit.surfaces.coulomb import strength_key

WORK, OVERHEAD = 30_000, 50
"""Convex problems times joints that a bound may take beside an answer, a few seconds: five times
what scenes of some fifty joints need. To state and prove a problem costs as much as that many
joints. A count, so that no answer depends on how fast a machine is."""

_RISE = 1e-4
"""Relative rise of the bound in a round below which no further one is begun."""

_FAR = 1e3
"""Load factors, over those of natural size, at which least thrusts show how they grow."""

_FEWER = 0.9
"""Problems for the sum of all open thrusts go on while each leaves at most this share of them."""


@dataclass(frozen=True, eq=False)
class LowerBound:
    """No solution without dilatancy has a load factor from 0 up to ``load_factor``.

    Attributes
    ----------
    load_factor : float
        The bound; 0 where nothing is proved.
    thrusts : (n,)
        Least compressions, as far as they are proved, of admissible states at ``load_factor``: of
        those only, not of states from there on. Zero where the bound is infinite.
    forces : (n, 6) or None
        Forces that carry ``load_factor`` or more with the friction of such compressions.
    rounds, solves : int
        Of least thrusts, and of convex problems in all.
    is_cut : bool
        True if the number of problems ran out first; more of them may raise the bound.
    evidence : mapping of str to Evidence
        By which :func:`excluded_by` finds the same bound again without a solver.
    """

    load_factor: float
    thrusts: FloatArray
    forces: FloatArray | None
    rounds: int
    solves: int
    is_cut: bool
    evidence: Mapping[str, Evidence]


def excluded_by(run: Run, evidence: Mapping[str, Evidence], start: float = 0.0) -> float:
    """The load factor from ``start`` to which evidence excludes every solution without dilatancy:
    rates bound thrusts from below, friction of these carries one interval after the other.

    Raises
    ------
    ModelError
        If forces or rates are none of these blocks, or the surfaces are not covered.
    """
    return _Parts(run).excluded_by(evidence, start)


def lower_bound(
    run: Run, upper: float, states: Iterable[tuple[FloatArray, float]] = (), most: float = np.inf
) -> LowerBound:
    """The largest load factor below which least thrusts exclude every solution without dilatancy.

    Parameters
    ----------
    run : Run
        Its surfaces may be any whose friction grows with compression; see :func:`is_covered`.
    upper : float
        No more is asked for: the load factor of the lowest solution known, or the associated one;
        infinite where there is none.
    states : iterable of (forces (n, 6), load factor)
        Admissible states that are known: what they show need not be sought.
    most : float
        Problems after which no further least thrust is sought; what those found exclude counts.
    """
    return _Search(run, upper, states, most).bound()


def affordable(run: Run) -> int:
    """How many problems a bound may take beside the answer of a run, by :data:`WORK`."""
    return WORK // (OVERHEAD + len(run.contacts))


def excluded_without_end(run: Run, start: float, most: float = np.inf) -> LowerBound:
    """What least thrusts exclude from ``start`` on, of a load of which any multiple is carried with
    dilatancy. Where that is every solution, however large its load factor, the bound is infinite,
    and its ``forces`` carry the live load alone with the friction that least thrusts gain with the
    load factor."""
    return _Search(run, np.inf, (), most).bound(start, has_end=False)


def is_covered(run: Run) -> bool:
    """True if strength depends on forces in such a way that the proof holds: friction grows with
    compression, and is stated by surfaces, not by a formulation of its own."""
    if run.formulation is not corner_compressions:
        return False
    conditions = [c for s in run.surfaces for c in stated(s, run.contacts)]
    slopes = [number(c.resistance.get("N", 0.0)) for c in conditions if is_friction(c)]
    return all(np.min(slope) >= 0.0 for slope in slopes)


@dataclass(frozen=True, eq=False)
class LeastThrust:
    """Goal: the least weighted sum of compressions at a load factor, scaled."""

    weight: cp.Parameter
    factor: cp.Parameter

    def __call__(self, stated: Stated) -> Any:
        stated.into.zero(stated.factor - self.factor)
        pressure = stated.forces["N"]
        return -np.ones(pressure.size) @ times(self.weight, pressure)


class _Thrusts:
    """Bounds on the least thrust of every joint, its least compression at a load factor.

    ``lines`` are proved bounds from below that are linear in the load factor: constant, slope and
    rounding (n,) each. ``pressed_by_factor`` has the compressions (n,) of admissible states: bounds
    from above at their load factors, and their means between those of two states.
    """

    def __init__(self, count: int) -> None:
        self.lines = [(np.zeros(count), np.zeros(count), np.zeros(count))]  # none is below zero
        self.pressed_by_factor: dict[float, FloatArray] = {}

    def at_least(self, start: float, end: float) -> FloatArray:
        """Returns the bounds (n,) from below that hold for all load factors from ``start`` to
        ``end``: the least value of the greatest line, at an end or where two lines cross."""
        constant, slope, rounding = (np.array(part) for part in zip(*self.lines, strict=True))
        constant = constant - max(abs(start), abs(end)) * rounding
        ends = [np.full(constant.shape[1:], end) for end in (start, end)]
        crossings = list[FloatArray]()
        for i in range(len(constant)):
            for k in range(i):
                differ = slope[i] - slope[k]
                at = (constant[k] - constant[i]) / np.where(differ != 0.0, differ, np.inf)
                crossings.append(np.clip(at, start, end))
        greatest = [(constant + slope * at).max(axis=0) for at in (*ends, *crossings)]
        found: FloatArray = np.min(greatest, axis=0)
        return found

    def add_state(self, factor: float, pressed: FloatArray) -> None:
        """Add an admissible state with compressions ``pressed`` (n,) at a load factor."""
        before = self.pressed_by_factor.get(factor)
        self.pressed_by_factor[factor] = pressed if before is None else np.minimum(before, pressed)

    def at_most(self, factor: float) -> FloatArray:
        """Returns the bounds (n,) from above at a load factor: those of states, and of means of two
        states, which are admissible as well."""
        unknown = np.full(len(self.lines[0][0]), np.inf)
        found = self.pressed_by_factor.get(factor, unknown)
        for low, below in self.pressed_by_factor.items():
            for high, above in self.pressed_by_factor.items():
                if low < factor < high:
                    share = (factor - low) / (high - low)
                    found = np.minimum(found, (1.0 - share) * below + share * above)
        return found


class _Parts:
    """The parts of a run's scene that carry the live load, and what least thrusts exclude there."""

    def __init__(self, run: Run) -> None:
        if not is_covered(run):
            raise ModelError(
                "no lower bound without dilatancy: it needs friction that grows with compression, "
                "stated by surfaces"
            )
        self.run = run.auxiliary_run()
        # parts without live load carry their dead load by themselves, however they do it
        given, loaded = run.assemblage, loaded_blocks(run.assemblage.statics)
        self.kept = np.flatnonzero(contacts_of(given.statics, loaded))
        self.part = given if loaded.all() else with_contacts(given, self.kept, loaded)
        self.count, self.friction = len(run.contacts), np.asarray(self.part.contacts.friction)
        self.thrusts = _Thrusts(len(self.kept))
        with run.clock.phase("compile"):
            self.reduced = self._reduced(run.surfaces)
        with run.clock.phase("certify"):
            self.certifier = Certifier(self.reduced.assemblage, run.surfaces)

    def _reduced(self, surfaces: Any) -> Reductions:
        found = Reductions.of(self.part, surfaces, model=self.run.model)
        return replace(found, mirror=None, loaded=None)

    def minorant(self, j: int, rates: FloatArray) -> Minorant | None:
        """Returns the bound on the thrust of joint ``j`` that rates (free blocks, 6) prove."""
        unit = np.zeros((len(self.kept), len(COMPONENTS)))
        unit[j, COLUMN["N"]] = 1.0
        return minorant(self.certifier, unit, rates)

    def add_line(self, found: Mapping[int, Minorant]) -> None:
        """Take a bound on the thrusts of some joints; none of the others is below zero."""
        line = np.zeros((3, len(self.kept)))
        for j, parts in found.items():
            line[:, j] = parts
        self.thrusts.lines.append((line[0], line[1], line[2]))

    def excluded_by(self, evidence: Mapping[str, Evidence], a: float) -> float:
        """Returns to which load factor evidence excludes every one from ``a`` on."""
        for by in evidence.values():
            if by.contacts is not None and by.rates is not None:
                shape = (len(by.contacts), len(self.reduced.assemblage.scene.free), DOF)
                if by.rates.size != np.prod(shape):
                    raise ModelError(f"rates of thrusts must be {shape}, got {by.rates.shape}")
                rates = by.rates.reshape(shape)
                pairs = zip(by.contacts.tolist(), rates, strict=True)
                found = {j: self.minorant(j, u) for j, u in pairs if j < len(self.kept)}
                self.add_line({j: line for j, line in found.items() if line is not None})
            elif by.until is not None and by.until > a and by.forces is not None:
                surfaces = tresca(self.run.surfaces, self.thrusts.at_least(a, by.until))
                certifier = Certifier(self.reduced.assemblage, surfaces)
                certifier.refer_to(by.reference or Reference(), has_live=True)
                state = LimitState(Outcome("given", 0.0, 0.0), by.load_factor, by.forces, by.rates)
                bracket = certifier.of(state)
                if bracket.lower_is_proved:
                    a = max(a, min(bracket.lower, by.until))
        return a


class _Search(_Parts):
    """The search of one run: rounds of least thrusts, and the load factors that they exclude."""

    def __init__(
        self, run: Run, upper: float, states: Iterable[tuple[FloatArray, float]], most: float
    ) -> None:
        super().__init__(run)
        self.most, self.upper = most, upper
        self.solves, self.factor, self.rise = 0, 0.0, _RISE
        self.random = np.random.default_rng(0)
        self.evidence = dict[str, Evidence]()
        for forces, factor in states:
            self.thrusts.add_state(factor, forces[self.kept, COLUMN["N"]])
        with run.clock.phase("compile"):
            found = self.reduced
            self.weight = cp.Parameter(len(self.kept), nonneg=True)
            self.at = cp.Parameter()
            goal = LeastThrust(self.weight, self.at)
            self.problem = LimitProgram(
                found.assemblage, run.surfaces, reduction=found.best(), goal=goal
            )

    def bound(self, start: float = 0.0, has_end: bool = True) -> LowerBound:
        """Returns the bound after rounds of least thrusts, each at the bound so far, until a round
        hardly raises it. Unless it ``has_end``, each round begins by asking whether all load
        factors from there on are excluded, and rises that are not worth a word end it."""
        a, forces, rounds, is_cut = start, None, 0, False
        self.rise = _RISE if has_end else SMALL
        while a < self.upper and not self.run.is_boundless(a):
            # Least thrusts at the bound so far; without an end, whether all from there on is out.
            rounds += 1
            is_cut = self._tighten(a)
            if not (has_end or is_cut):
                ray = self._endless(a)
                if ray is not None:
                    a, forces = np.inf, ray
                    break
                self.upper = 2.0 * max(a, self.part.scaling.ratio)
            # What they exclude from there on.
            before = a
            a, forces, was_cut = self._excluded(a, forces)
            is_cut = is_cut or was_cut
            if is_cut or a - before <= self.rise * a:
                break
            self.upper = self.upper if has_end else np.inf
        # Thrusts and forces of all contacts, with those that carry no live load.
        thrusts, whole = np.zeros(self.count), None
        if np.isfinite(a):
            thrusts[self.kept] = self.thrusts.at_least(a, a)
        if forces is not None:
            whole = np.zeros((self.count, len(COMPONENTS)))
            whole[self.kept] = forces
        return LowerBound(a, thrusts, whole, rounds, self.solves, is_cut, self.evidence)

    # Least thrusts

    def _tighten(self, factor: float) -> bool:
        """Seek the least thrust at a load factor of every joint whose bounds are still apart;
        returns True if problems ran out before."""
        lost = TOLERANCE * self.part.scaling.force / len(self.kept)
        self.factor, self.at.value = factor, factor / self.part.scaling.load_factor(1.0)
        is_asked = self.friction == 0.0  # or need not be

        def apart() -> FloatArray:
            return self.thrusts.at_most(factor) - self.thrusts.at_least(factor, factor)

        # All that are open at once, at random weights: many come out at nothing.
        is_open = (apart() > lost) & ~is_asked
        while is_open.any():
            if self.solves >= self.most:
                return True
            if self._asked(is_open * self.random.uniform(size=len(is_open))) is None:
                return False  # no state carries the load at this factor, or none was found
            before, is_open = is_open.sum(), (apart() > lost) & ~is_asked
            if is_open.sum() > _FEWER * before:
                break
        # Then one by one, that first whose bounds leave most friction open; rates prove each.
        lines, proofs = dict[int, Minorant](), dict[int, FloatArray]()
        while is_open.any() and self.solves < self.most:
            j = int(np.where(is_open, self.friction * apart(), -1.0).argmax())
            is_asked[j] = True
            weight = np.zeros(len(self.kept))
            weight[j] = 1.0
            state = self._asked(weight)
            if state is not None and state.mechanism is not None:
                with self.run.clock.phase("certify"):
                    rates = state.mechanism * self.part.scaling.live  # a force of one: power one
                    found = self.minorant(j, rates)
                if found is not None:
                    lines[j], proofs[j] = found, rates
            is_open = (apart() > lost) & ~is_asked
        self.add_line(lines)
        if proofs:
            of = Evidence(rates=np.concatenate([*proofs.values()]), contacts=np.array([*proofs]))
            self.evidence[f"thrusts {len(self.thrusts.lines) - 1}"] = of
        return bool(is_open.any())

    def _asked(self, weight: FloatArray) -> LimitState | None:
        """Returns the state with the least sum of compressions times ``weight`` (n,), or None."""
        self.weight.value = weight
        state = self._solved(self.problem)
        if state.forces is None:
            return None
        self.thrusts.add_state(self.factor, state.forces[:, COLUMN["N"]])
        return state

    def _solved(self, problem: LimitProgram) -> LimitState:
        self.solves += 1
        return self.run.try_solvers(problem.run, self.run.ladder or problem.ladder()[:2])[0]

    # What they exclude

    def _excluded(
        self, a: float, forces: FloatArray | None
    ) -> tuple[float, FloatArray | None, bool]:
        """Returns the end of the load factors that are excluded from ``a`` on, the forces that show
        it, and whether problems ran out first. Intervals are excluded one after the other; one is
        halved where friction of its least thrusts does not carry its end."""
        width = self.upper - a if np.isfinite(self.upper) else self.part.scaling.ratio
        while a < self.upper and not self.run.is_boundless(a):
            end = min(a + width, self.upper)
            least = self.thrusts.at_least(a, end)
            factor, found = self._carried(least, 2.0 * end)
            if factor > a and found is not None:
                forces = found.forces
                by = replace(found, until=end)
                self.evidence[f"excluded {len(self.evidence) + 1}"] = by
            rise = min(factor, end) - a
            a = max(a, a + rise)  # it is -inf where nothing is proved
            if self.solves >= self.most:
                return a, forces, a < self.upper
            if factor >= end:
                width *= 2.0
                continue
            # Go on as far again where most of it was excluded; else, unless that is all there is or
            # thrusts hardly fall over it, with half of it.
            lost = self.friction @ (self.thrusts.at_least(a, a) - least)
            if rise > self.rise * a and rise > 0.5 * width:
                continue
            if width <= self.rise * a or lost <= TOLERANCE * self.part.scaling.force:
                return a, forces, False
            width *= 0.5
        return a, forces, False

    def _endless(self, a: float) -> FloatArray | None:
        """Returns forces (n, 6) that show that all load factors from ``a`` on are excluded.

        Bounds of least thrusts that are lines, c + s alpha, never fall below zero from ``a`` on
        where they are not below it at ``a`` and s >= 0. Then so much friction carries every such
        load factor if that of c + s a carries ``a``, and that of s alone the live load alone: the
        forces of one and a multiple of those of the other are forces for any. Of each joint it
        takes the line that is highest at ``a``, then the one that is highest far beyond.
        """
        contacts = self.part.contacts
        is_known = strength_key(self.run.surfaces, contacts) is not None
        if not is_known or np.isfinite(contacts.compressive_strength).any():
            return None  # stone that crushes has no such multiples
        far = _FAR * self.part.scaling.ratio + a
        if self._tighten(far):
            return None
        lines = zip(*self.thrusts.lines, strict=True)
        constant, slope, rounding = (np.array(part) for part in lines)
        slope = slope - rounding
        at_a = np.where(slope >= 0.0, constant + slope * a, -1.0)
        dead, live = self.part.statics.dead, self.part.statics.live
        for at in (a, far):
            line = np.where(at_a >= 0.0, constant + slope * at, -1.0).argmax(axis=0)
            least, gained = (np.take_along_axis(x, line[None], axis=0)[0] for x in (at_a, slope))
            if self._carrying(dead + a * live, least, contacts.cohesion) is not None:
                forces = self._carrying(live, gained, 0.0)
                if forces is not None:
                    return forces
        return None

    def _carrying(
        self, load: FloatArray, pressed: FloatArray, cohesion: FloatArray | float
    ) -> FloatArray | None:
        """Returns forces (n, 6) that carry a load alone with cohesion and the friction of these
        compressions (n,), which is further cohesion."""
        contacts = self.part.contacts
        further = contacts.friction * np.maximum(pressed, 0.0) / contacts.area
        held = replace(contacts, friction=0.0 * contacts.friction, cohesion=cohesion + further)
        aside = Aside(self.run.auxiliary_run(self.part.with_contacts(held)), "full")
        return aside.carrying(load, aside.surfaces, self.run.formulation)

    def _carried(self, pressed: FloatArray, most: float) -> tuple[float, Evidence | None]:
        """Returns the proved load factor, at most ``most``, that friction of these compressions
        (n,) carries, and by what; -inf where nothing is proved."""
        surfaces = tresca(self.run.surfaces, pressed)
        with self.run.clock.phase("compile"):
            found = self._reduced(surfaces)
            goal, reduction = LargestFactor(most=most), found.best()
            problem = LimitProgram(found.assemblage, surfaces, reduction=reduction, goal=goal)
        state = self._solved(problem)
        if state.forces is None or state.load_factor is None:
            return -np.inf, None
        with self.run.clock.phase("certify"):
            certifier = Certifier(found.assemblage, surfaces)
        if certifier.references.dead_state is None:
            # without anything to maximise a solver ends well inside
            inside = self._solved(
                LimitProgram(
                    found.assemblage, surfaces, reduction=reduction,
                    goal=lambda stated: 0.0 * goal(stated),
                )
            )  # fmt: skip
            given = certifier.given(inside)
            if given is not None and inside.load_factor is not None:
                certifier.offer_dead_state(given, inside.load_factor)
        with self.run.clock.phase("certify"):
            bracket = certifier.of(state)
        known = certifier.references.known
        by = Evidence(state.load_factor, state.forces, state.mechanism, reference=known)
        return (bracket.lower if bracket.lower_is_proved else -np.inf), by
