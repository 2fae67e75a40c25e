"""What an answer is worth: decided by the certificate and closed forms, never by a solver's word.

A method makes a :class:`Claim`. :func:`judged` holds it against a :class:`Reference`, which is the
bracket of forces and a mechanism, recomputed outside all solvers from the full scene, and the
closed form where there is one.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from benchmarks.stability.families.sample import FALLS, HARMLESS, Sample
from benchmarks.stability.truths import closed_form
from cvxlimit.proof.certificate import Certifier
from cvxlimit.scene import Load, Scene
from cvxlimit.solution import Solution, Status
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES

RIGHT, WRONG = 1e-5, 1e-3
"""Relative distance from the certified bracket up to which a claimed value is right, and beyond
which it is wrong; in between it is loose. The first is the default's tolerance, the second ten
times what engineers ask for in the last digit of a load factor."""

ROUNDING = 1e-7
"""Relative disagreement of a proved bound with a closed form that is put down to rounding: with a
live load 1e-8 off a harmless direction, one rounding in the geometry alone makes 1e-8."""


class Outcome(StrEnum):
    """The classes of the atlas, from good to bad."""

    RIGHT = "right"
    NO_ANSWER = "no answer, proved"
    LOOSE = "loose"
    HONEST = "honest failure"
    WRONG = "wrong"


@dataclass(frozen=True)
class Claim:
    """What a method says.

    Attributes
    ----------
    says : float, str or None
        A load factor, :data:`FALLS`, :data:`HARMLESS`, or None: it says that it has failed.
    word : str
        In its own words: the status or the error.
    """

    says: float | str | None
    word: str


@dataclass(frozen=True)
class Reference:
    """What is known about a scene: bounds of its load factor, or why it has none."""

    lower: float
    upper: float
    none: str | None = None
    least: float = 0.0

    @property
    def unit(self) -> float:
        """What errors are relative to."""
        sizes = [abs(x) for x in (self.lower, self.upper) if np.isfinite(x)]
        return max([*sizes, self.least, 1e-300])

    def distance(self, value: float) -> float:
        """How far a value lies outside the bounds, relative."""
        return max(self.lower - value, value - self.upper, 0.0) / self.unit


def judged(claim: Claim, reference: Reference) -> Outcome:
    """The class of a claim.

    >>> judged(Claim(0.5, "optimal"), Reference(0.4, 0.4000001))
    <Outcome.WRONG: 'wrong'>
    """
    if claim.says is None:
        return Outcome.HONEST
    if reference.none is not None or isinstance(claim.says, str):
        return Outcome.NO_ANSWER if claim.says == reference.none else Outcome.WRONG
    error = reference.distance(claim.says)
    if error <= RIGHT:
        return Outcome.RIGHT
    return Outcome.LOOSE if error <= WRONG else Outcome.WRONG


def reference_of(sample: Sample, solution: Solution, surfaces: object = None) -> Reference:
    """The certificate of a solution's forces and mechanism on the full scene, recomputed."""
    scene = sample.scene
    none = _NONE.get(solution.status)
    if none is not None:
        return Reference(np.nan, np.nan, none)
    certifier = Certifier(scene, DEFAULT_SURFACES if surfaces is None else surfaces)  # type: ignore[arg-type]
    mechanism = None if solution.mechanism is None else np.array(list(solution.mechanism.values()))
    found = certifier.certificate(solution.forces, solution.load_factor, mechanism)
    bracket = solution.bracket
    return Reference(
        max(found.lower, bracket.lower), min(found.upper, bracket.upper), None, bracket.least
    )


_NONE = {
    Status.DEAD_LOAD_UNSTABLE: FALLS,
    Status.LIVE_LOAD_HARMLESS: HARMLESS,
    Status.UNBOUNDED: HARMLESS,
}


def claim_of(solution: Solution) -> Claim:
    """What our own solutions say; a bracket that is not certified is an honest failure."""
    none = _NONE.get(solution.status)
    says = none or (solution.load_factor if solution.status.is_good else None)
    return Claim(says, str(solution.status))


def refutation(sample: Sample, solution: Solution) -> str:
    """Why a solution without interaction is wrong, or nothing.

    Its bounds must hold the closed form, those of a fresh certificate must not contradict them,
    and a claim that there is no answer must be carried_exactly out by forces or rates.
    """
    truth = sample.truth if sample.truth is not None else closed_form(sample.scene)
    none = _NONE.get(solution.status)
    if truth is not None and not isinstance(truth, str):
        if none is not None:
            return f"says {none}, and the closed form is {truth:.9g}"
        unit = ROUNDING * max(abs(truth), solution.bracket.least)
        if not solution.lower - unit <= truth <= solution.upper + unit:
            return f"the closed form {truth:.9g} is not in {solution.bracket}"
    elif truth is not None and none != truth and (none or solution.bracket.has_both):
        return f"says {solution.status}, and the closed form says {truth}"
    if none is not None:
        return _unproved(sample.scene, none, solution)
    known = reference_of(sample, solution)
    if known.lower > known.upper + ROUNDING * known.unit:
        return f"a fresh certificate contradicts the bracket {solution.bracket}"
    return ""


def _unproved(scene: Scene, none: str, solution: Solution) -> str:
    """Why a claim that there is no answer is not carried_exactly out by its own forces or rates."""
    if none == FALLS:
        alone = Certifier(scene.with_live(scene.dead).with_dead(Load()), DEFAULT_SURFACES)
        rates = np.array(list((solution.mechanism or {}).values()))
        upper = alone.certificate(None, None, rates).upper if rates.size else np.inf
        return "" if upper < 0.5 else "its mechanism does not prove that the dead load falls"
    statics = Certifier(scene.with_dead(Load()), DEFAULT_SURFACES)
    if solution.forces is None:
        return "no forces that carry the live load"
    rest = np.abs(statics.statics.residual(solution.forces, 1.0)).max()
    over = float(statics.strength.excess(solution.forces).max())
    size = float(np.abs(solution.forces).max())
    good = rest <= 1e-9 * size and over <= 1e-9 * size
    return "" if good else "its forces do not carry the live load alone"
