"""The studies: each goes through its scenes one by one and keeps a record of each."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.rows import Row, Rows
from benchmarks.stability import interacting
from benchmarks.stability.families import Sample, key_of, sample, samples
from benchmarks.stability.methods import methods
from benchmarks.stability.models import ask_models
from benchmarks.stability.outcomes import (
    ROUNDING,
    Outcome,
    Reference,
    claim_of,
    judged,
    reference_of,
    refutation,
)
from benchmarks.stability.truths import linear_bounds
from cvxlimit.errors import CvxlimitError
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.methods.solving import solve
from cvxlimit.model.formulations import vertex_forces
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.surfaces import Rocking

Ask = Callable[[Rows, int, int, int], None]

LINEAR_EVERY = 4
"""One scene in so many of the default's study is solved once more as a linear program."""

BUDGET = Certified(solves=8, branching_seconds=3.0)
"""Of the certified method in this bench: a short one, so that many scenes can be tried."""


def ask_default(kept: Rows, number: int, scale: int, first: int = 0) -> None:
    """Our default on ``number`` scenes: what it says, and whether anything refutes it."""
    for family, seed, _ in samples(number, scale, first):
        key = {"key": key_of(family, seed, scale)}
        if key not in kept:
            kept.add({**key, **_default(family, seed, scale)})


def _default(family: str, seed: int, scale: int) -> Row:
    about: Row = {"family": family, "seed": seed, "scale": scale}
    start = time.process_time()
    try:
        made = sample(family, seed, scale)
        solution = solve(made.scene)
    except CvxlimitError as error:
        return {**about, "outcome": Outcome.HONEST, "status": type(error).__name__,
                "why": str(error)}  # fmt: skip
    seconds = time.process_time() - start
    why = refutation(made, solution)
    if not why and seed % LINEAR_EVERY == 0:
        why = _contradiction(made.scene, solution)
    return {
        **about,
        "knob": made.knob,
        "outcome": Outcome.WRONG if why else _own_outcome(solution),
        "why": why or ("" if solution.status.is_good else solution.note),
        "status": solution.status,
        "lower": solution.lower,
        "upper": solution.upper,
        "gap": solution.gap,
        "proved": solution.is_proved,
        "blocks": solution.blocks,
        "contacts": solution.contacts,
        "model": " ".join(solution.model),
        "solves": len(solution.history),
        "seconds": seconds,
    }


def _own_outcome(solution: Solution) -> Outcome:
    """Our own classes: nothing refutes it, so what is claimed holds."""
    if not solution.status.has_answer:
        return Outcome.NO_ANSWER
    return Outcome.RIGHT if solution.status.is_good else Outcome.HONEST


def _contradiction(scene: Scene, solution: Solution) -> str:
    """Why the linear programs refute a bracket, or nothing; they are good to about 1e-6."""
    inscribed, circumscribed = linear_bounds(scene)
    unit = 1e-5 * max(abs(solution.lower), abs(solution.upper), solution.bracket.least)
    if solution.bracket.has_both and inscribed > solution.upper + unit:
        return f"inscribed facets carry {inscribed:.9g}, above {solution.bracket}"
    if solution.bracket.has_both and circumscribed < solution.lower - unit:
        return f"circumscribed facets carry only {circumscribed:.9g}, below {solution.bracket}"
    return ""


def ask_certified(kept: Rows, number: int, scale: int, first: int = 0) -> None:
    """The certified interaction on a short budget: does anything refute its bracket?"""
    for family, seed, _ in samples(number, scale, first):
        for moments in ("independent", "signed"):
            key = {"key": f"{key_of(family, seed, scale)}/{moments}"}
            if key not in kept:
                kept.add({**key, **_certified(family, seed, scale, moments)})


def _certified(family: str, seed: int, scale: int, moments: str) -> Row:
    about: Row = {"family": family, "seed": seed, "scale": scale, "moments": moments}
    start = time.process_time()
    try:
        made = sample(family, seed, scale)
        solution = solve(made.scene, method=BUDGET, moments=moments)
    except CvxlimitError as error:
        return {**about, "outcome": Outcome.HONEST, "status": type(error).__name__,
                "why": str(error)}  # fmt: skip
    seconds = time.process_time() - start
    truth = interacting.closed_form(made.scene, moments)
    states = [state.load_factor for state in interacting.found_states(made.scene, moments)]
    why = _refuted(solution, truth, states)
    outcome = _own_outcome(solution)
    if outcome is Outcome.HONEST and solution.bracket.has_both:
        outcome = Outcome.LOOSE
    return {
        **about,
        "knob": made.knob,
        "outcome": Outcome.WRONG if why else outcome,
        "why": why,
        "status": solution.status,
        "lower": solution.lower,
        "upper": solution.upper,
        "gap": solution.gap,
        "truth": truth,
        "states": len(states),
        "best_state": max(states, default=None),
        "contacts": solution.contacts,
        "seconds": seconds,
    }


def _refuted(solution: Solution, truth: float | None, states: list[float]) -> str:
    """Why a closed form or a state refutes a bracket with interaction, or nothing."""
    unit = ROUNDING * max(abs(solution.upper), abs(solution.lower), 1e-300)
    if not solution.status.has_answer:
        return f"says {solution.status}, the closed form is {truth:.9g}" if truth else ""
    if truth is not None and not solution.lower - unit <= truth <= solution.upper + unit:
        return f"the closed form {truth:.9g} is not in {solution.bracket}"
    best = max(states, default=-np.inf)
    if best > solution.upper + 1e-12 * abs(solution.upper):  # states have more than this to spare
        return f"a state carries {best:.9g}, above {solution.bracket}"
    return ""


def ask_methods(kept: Rows, number: int, scale: int, first: int = 0) -> None:
    """Every method on ``number`` scenes: what it claims, and what that is worth."""
    known = methods()
    for family, seed, _ in samples(number, scale, first):
        made: Sample | None = None
        references: dict[str, Reference | None] = {}
        for method in known:
            key = {"key": f"{key_of(family, seed, scale)}/{method.name}"}
            if key in kept:
                continue
            made = made or sample(family, seed, scale)
            if method.surface not in references:
                references[method.surface] = _reference(made, method.surface)
            reference = references[method.surface]
            if reference is not None:
                kept.add({**key, "family": family, "seed": seed, "method": method.name,
                          **_claimed(method.claims, made, reference)})  # fmt: skip


def _claimed(claims: Callable[[Scene], Any], made: Sample, reference: Reference) -> Row:
    start = time.process_time()
    claim = claims(made.scene)
    seconds = time.process_time() - start
    error = reference.distance(claim.says) if isinstance(claim.says, float) else None
    return {"outcome": judged(claim, reference), "word": claim.word, "error": error,
            "says": claim.says, "lower": reference.lower, "upper": reference.upper,
            "none": reference.none, "seconds": seconds}  # fmt: skip


def _reference(made: Sample, surface: str) -> Reference | None:
    """The certified bracket of a model; None where even that is open, and nothing is judged."""
    own = vertex_forces if surface == "vertex forces" else None
    asked: Any = [Rocking()] if own else surface
    solution = solve(made.scene, asked, **({"formulation": own} if own else {}))
    if solution.status.has_answer and not solution.status.is_good:
        return None
    if surface == "conic":
        return reference_of(made, solution)
    says = claim_of(solution).says
    none = says if isinstance(says, str) else None
    return Reference(solution.lower, solution.upper, none, solution.bracket.least)


STUDIES: dict[str, tuple[Ask, float]] = {
    "default": (ask_default, 1.0),
    "certified": (ask_certified, 0.03),
    "methods": (ask_methods, 0.04),
    "models": (ask_models, 0.02),
}
"""All studies by name, and the share of ``--size`` scenes that each of them takes."""
