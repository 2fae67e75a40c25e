"""How much model scenes need, and what it gains.

Every built-in scene, and planar walls, with the full model and with ``auto``: sizes of the compiled
problem, peak memory (in a process of its own) and seconds of CPU, medians of some runs; and the
best choice by hand, of both models and three solvers.
"""

from __future__ import annotations

import resource
from collections.abc import Sequence
from functools import partial
from time import process_time
from typing import Any

import numpy as np

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.runs import Limits, apart
from benchmarks.scenes import scene_of
from cvxlimit import Status, explain, solve
from cvxlimit.masonry import BUILTIN

WALLS = ("wall-24", "wall-34")
"""Units of planar walls twice as many courses high: 3,408 and 6,868 contacts."""

LARGE = "wall-129"
"""99,588 contacts; with ``auto`` only."""

ENOUGH, MOST = 8.0, 31
"""Small scenes run until this many seconds are used, at most so often."""

LIMITS = Limits(3600.0)
HANDS = ("QOCO", "CLARABEL", "BLOCKWISE")


@experiment(Part(12, "--large"))
def models(scenes: Sequence[str] = (*BUILTIN, *WALLS), runs: int = 2, large: bool = False) -> Lines:
    """How much model scenes need, and what it gains: the full one, ``auto``, and by hand."""
    size = "variables", "cones", "rows", "seconds", "MB"
    yield Head("scene", "contacts", *size, "auto:", *size, "factors differ by", "best by hand")
    for name in scenes:
        lean = apart(partial(measured, name, "auto"), LIMITS)
        full = apart(partial(measured, name, "full"), LIMITS)
        seconds = apart(partial(times, name, runs), LIMITS)
        full["seconds"], lean["seconds"] = seconds.pop("full"), seconds.pop("auto")
        yield row(name, full, lean, seconds)
    if large:
        lean = apart(partial(measured, LARGE, "auto"), LIMITS)
        yield row(LARGE, None, {**lean, "seconds": lean["first"]}, {})


def row(
    name: str, full: dict[str, Any] | None, lean: dict[str, Any], hands: dict[str, float]
) -> tuple[str, ...]:
    """One line of the table."""
    cells = [name, f"{lean['contacts']:,}"]
    for part in (full, lean):
        if part is lean:
            cells.append(" and ".join(lean["model"]) or "-")
        if part is None:
            cells += [""] * 5
        else:
            size = [f"{part[key]:,}" for key in ("variables", "cones", "rows")]
            cells += [*size, f"{part['seconds']:.3g}", f"{part['memory']:.0f}"]
    apart_by = "" if full is None else abs(full["load_factor"] / lean["load_factor"] - 1.0)
    cells.append(apart_by if isinstance(apart_by, str) else f"{apart_by:.0e}")
    best = min(hands, key=hands.__getitem__) if hands else ""
    cells.append(f"{best} {hands[best]:.3g}" if best else "")
    return tuple(cells)


def measured(name: str, model: str) -> dict[str, Any]:
    """Sizes, CPU seconds of the first run from contacts to certificate, peak memory in MB."""
    scene = scene_of(name)
    contacts = len(scene.contacts)
    start = process_time()
    solution = solve(scene, model=model)
    first = process_time() - start
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    size = list(explain(scene, model=model).sizes.values())[-1]
    return {
        "contacts": contacts,
        "variables": size.variables,
        "cones": size.cones,
        "rows": size.rows + size.equations,
        "first": first,
        "memory": memory,
        "model": solution.model,
        "load_factor": solution.load_factor,
    }


def times(name: str, runs: int) -> dict[str, float]:
    """CPU seconds, medians of every choice, in ever other order: a run may disturb the next.

    Choices by hand count where they are certified. Small scenes run more often.
    """
    scene = scene_of(name)
    scene.contacts  # noqa: B018
    choices: dict[str, tuple[str, list[str] | None]] = {m: (m, None) for m in ("auto", "full")}
    choices |= {f"{m} {s}": (m, [s]) for m in ("least", "full") for s in HANDS}
    taken: dict[str, list[float]] = {choice: [] for choice in choices}
    order = np.random.default_rng(0)
    start, done = process_time(), 0
    while done < runs or (process_time() - start < ENOUGH and done < MOST):
        done += 1
        for choice in order.permutation(list(choices)):
            model, ladder = choices[choice]
            since = process_time()
            solution = solve(scene, model=model, ladder=ladder)
            if ladder is None or solution.status is Status.CERTIFIED:
                taken[choice].append(process_time() - since)
    return {choice: float(np.median(t)) for choice, t in taken.items() if t}
