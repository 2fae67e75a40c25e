"""Models whose answers differ: each against its own certificate, and against its neighbours.

What a surface, a reading of the moments or a flow rule allows is often contained in what another
one allows: then no answer of the first may lie above what bounds the second.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from benchmarks.baselines import MT, V1, V2, N, program
from benchmarks.rows import Row, Rows
from benchmarks.stability.families import Sample, key_of, sample, samples
from benchmarks.stability.families.sample import FALLS
from benchmarks.stability.outcomes import ROUNDING, Outcome, claim_of, reference_of
from benchmarks.stability.truths import arm, rocking
from cvxlimit.errors import CvxlimitError
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.methods.solving import solve
from cvxlimit.model.formulations import resultants, vertex_forces
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.coulomb import surfaces_of

SHORT = Certified(solves=4, branching_seconds=0.5)
"""Of the certified method: four readings on every scene, so a second each has to do."""

MEMBERS = ZeroDilatancy(searches=1, budget=60)
"""Without dilatancy: enough for a member or two of small scenes."""

STRONG, WEAK = 1e4, 30.0
"""Strength of stone over the total load per area: so strong that it hardly matters, and not. At 1e6
brackets stay 1e-5 to 5e-3 wide: the effective area's cones then hold numbers 1e6 apart."""

LITTLE = 1e-8
"""Cohesion and tensile strength that do not matter, over the total load per area."""

VERIFIED = 1e-5
"""What members may leave of equilibrium and yield, in total loads; the method says 1e-6."""


@dataclass(frozen=True)
class Model:
    """A model: how it is asked, and the surface of its certificate, if plain."""

    name: str
    asks: Callable[[Scene], Solution]
    plain: str | None = None


def _surface(name: str) -> Model:
    return Model(name, partial(solve, surface=name), name)


def _reading(name: str) -> Model:
    return Model(f"certified, {name}", partial(solve, method=replace(SHORT, moments=name)))


def _with(strength: str, share: float) -> Callable[[Scene], Solution]:
    """With a strength of stone or mortar, over the total load per area."""

    def asks(scene: Scene) -> Solution:
        load = np.abs(scene.dead_forces[:, :3]).sum() or np.abs(scene.live_forces[:, :3]).sum()
        area = scene.contacts.area
        area = area.min() if strength == "compressive_strength" else area.max()
        per_area = share * float(load) / float(area)
        other: dict[str, Any] = {strength: per_area}
        if strength == "tensile_strength":  # no more than cohesion over friction
            other["cohesion"] = per_area * float(scene.contacts.friction.max())
        return solve(replace(scene, **other))

    return asks


MODELS = (
    _surface("conic"),
    *(_surface(f"{k}-gon{kind}") for k in (4, 8, 16) for kind in ("-inscribed", "")),
    _surface("parabolic"),
    Model("exact", partial(solve, method="exact")),
    Model("resultants", partial(solve, formulation=resultants), "conic"),
    Model("vertex forces", lambda s: solve(s, [Rocking()], formulation=vertex_forces)),
    Model("full model", partial(solve, model="full"), "conic"),
    Model("least model", partial(solve, model="least"), "conic"),
    Model("strong stone", _with("compressive_strength", STRONG)),
    Model("weak stone", _with("compressive_strength", WEAK)),
    Model("little cohesion", _with("cohesion", LITTLE)),
    Model("little tension", _with("tensile_strength", LITTLE)),
    *map(_reading, ("independent", "paper", "signed-torsion-bending", "signed")),
    Model("zero dilatancy", partial(solve, method=MEMBERS)),
    Model("Gilbert", partial(solve, method="gilbert")),
)

_EQUAL, _NEARLY = 1e-4, 1e-2
"""What models that reduce to the rigid one may differ by, relative: with little cohesion, and with
strong stone, which takes 1e-4 off a contact's sides and more off a factor that hangs on them."""

BELOW: tuple[tuple[str, str, float], ...] = (
    *((f"{k}-gon-inscribed", "conic", ROUNDING) for k in (4, 8, 16)),
    *(("conic", f"{k}-gon", ROUNDING) for k in (4, 8, 16)),
    ("conic", "parabolic", ROUNDING),
    ("conic", "exact", ROUNDING),
    ("parabolic", "exact", ROUNDING),
    *((a, b, ROUNDING) for name in ("resultants", "full model", "least model")
      for a, b in ((name, "conic"), ("conic", name))),
    ("strong stone", "conic", ROUNDING),
    ("conic", "strong stone", _NEARLY),
    ("weak stone", "strong stone", ROUNDING),
    *((a, b, t) for name in ("little cohesion", "little tension")
      for a, b, t in ((name, "conic", _EQUAL), ("conic", name, ROUNDING))),
    ("certified, independent", "certified, paper", ROUNDING),
    ("certified, independent", "certified, signed-torsion-bending", ROUNDING),
    ("certified, signed-torsion-bending", "certified, signed", ROUNDING),
    ("certified, independent", "conic", ROUNDING),  # the others may cancel torsion by shear
    ("certified, signed", "vertex forces", ROUNDING),
    ("zero dilatancy", "conic", ROUNDING),
    ("Gilbert", "conic", 1e-2),
)  # fmt: skip
"""Pairs (a, b): what a allows b allows too, so that no lower bound of a is above an upper one of b;
and by how much, relative, rounding or the model's own tolerance may say otherwise."""


ON_RECTANGLES = {("parabolic", "exact"), ("conic", "strong stone")}
"""Pairs that hold on rectangles only: the parabola leaves the exact set of some polygons, and cells
of constant pressure, which lie inside polygons, do not reach their edges."""

_FAR = 10.0
"""Load factors beyond this many natural ones press stone far harder than the dead load does, and
crush it however harmless they are without: such answers are not held against strong stone."""


def ask_models(kept: Rows, number: int, scale: int, first: int = 0) -> None:
    """Every model on ``number`` scenes: its own certificate, and all pairs."""
    for family, seed, _ in samples(number, scale, first):
        keys = {m.name: {"key": f"{key_of(family, seed, scale)}/{m.name}"} for m in MODELS}
        if all(key in kept for key in keys.values()):
            continue
        made = sample(family, seed, scale)
        found = {m.name: ask(m, made) for m in MODELS}
        for name, why in contradictions(found, made.scene).items():
            found[name] |= {"outcome": Outcome.WRONG, "why": why}
        for name, record in found.items():
            kept.add({**keys[name], "family": family, "seed": seed, "model": name, **record})


def ask(model: Model, made: Sample) -> Row:
    """One model on one scene: what it says, and whether its own certificate bears it out."""
    start = time.process_time()
    try:
        solution = model.asks(made.scene)
    except CvxlimitError as error:
        return {"outcome": Outcome.HONEST, "status": type(error).__name__, "why": str(error),
                "seconds": time.process_time() - start}  # fmt: skip
    seconds = time.process_time() - start
    low, high = span(solution)
    why = _refuted(model, made, solution)
    return {
        "outcome": Outcome.WRONG if why else outcome(solution),
        "status": solution.status,
        "why": why,
        "low": low,
        "high": high,
        "unit": max([solution.bracket.least, *(abs(x) for x in (low, high) if np.isfinite(x))]),
        "natural": solution.bracket.least * 1e6,
        "members": len(solution.members),
        "seconds": seconds,
    }


def span(solution: Solution) -> tuple[float, float]:
    """What it says the load factor is at least and at most; falls and harmless are infinities."""
    says = claim_of(solution).says
    if isinstance(says, str):
        return (-np.inf, -np.inf) if says == FALLS else (np.inf, np.inf)
    if solution.members:
        return max(m.load_factor for m in solution.members), np.inf
    if solution.flow == "gilbert":
        return (-np.inf if says is None else says), np.inf
    return solution.lower, solution.upper


def outcome(solution: Solution) -> Outcome:
    """Its class before anything contradicts it."""
    if not solution.status.has_answer:
        return Outcome.NO_ANSWER
    if solution.status.is_good:
        return Outcome.RIGHT
    return Outcome.LOOSE if solution.bracket.has_both else Outcome.HONEST


def contradictions(found: dict[str, Row], scene: Scene) -> dict[str, str]:
    """Models that cannot both be right, each with the reason."""
    result: dict[str, str] = {}
    rectangles = bool(scene.contacts.is_rectangle.all())
    for lower, upper, margin in BELOW:
        a, b = found.get(lower, {}), found.get(upper, {})
        if (lower, upper) in ON_RECTANGLES and not rectangles:
            continue
        if a.get("low") is None or b.get("high") is None:
            continue
        if upper == "strong stone" and a["low"] > _FAR * a["natural"]:
            continue
        size = "unit" if margin == ROUNDING else "natural"  # strengths are absolute
        if a["low"] > b["high"] + margin * max(a["unit"], b["unit"], a[size], b[size]):
            why = f"{lower} is at least {a['low']:.9g}, {upper} at most {b['high']:.9g}"
            result |= {lower: why, upper: why}
    return result


def _refuted(model: Model, made: Sample, solution: Solution) -> str:
    """Why its own certificate, or its own members, refute it."""
    if model.plain is not None and solution.status.has_answer:
        known = reference_of(made, solution, surfaces_of(model.plain)[0])
        if known.lower > known.upper + ROUNDING * known.unit:
            return f"a fresh certificate contradicts {solution.bracket}"
    for member in solution.members:
        left = leftover(made.scene, member.forces, member.load_factor)
        if left > VERIFIED:
            return f"a member leaves {left:.1e} of equilibrium or yield"
    return ""


def leftover(scene: Scene, forces: Any, load_factor: float) -> float:
    """Largest residual of equilibrium and excess of Eq. 9 and 24, over the total load.

    Both are written down once more, outside the package.
    """
    data = program(scene)
    load = np.abs(data.dead).sum() + abs(load_factor) * np.abs(data.live).sum()
    rest = data.equilibrium @ np.ravel(forces) + data.dead + load_factor * data.live
    found = [float(np.abs(rest).max())]
    for j, x in enumerate(forces):
        contact = data.contacts
        size = np.sqrt(contact.area[j])
        found.append(float((rocking(contact, j) @ x).max()) / size)
        shear = np.hypot(x[V1], x[V2]) + abs(x[MT]) / arm(contact.corners_of(j))
        found.append(float(shear - contact.friction[j] * x[N]))
    return max(found) / load
