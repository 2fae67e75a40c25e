"""What a smaller model gains.

Every built-in scene, and planar walls, with the full model and with ``auto``: variables, seconds of
CPU (medians) and peak memory, in a process of its own.
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
from cvxlimit import explain, solve
from cvxlimit.masonry import BUILTIN

WALLS = ("wall-24", "wall-34")
"""Units of planar walls twice as many courses high: 3,408 and 6,868 contacts."""

LARGE = "wall-129"
"""99,588 contacts; with ``auto`` only."""

ENOUGH, MOST = 8.0, 31
"""Small scenes run until this many seconds are used, at most so often."""

LIMITS = Limits(3600.0)


@experiment(Part(8, "--large"))
def models(scenes: Sequence[str] = (*BUILTIN, *WALLS), runs: int = 2, large: bool = False) -> Lines:
    """What a smaller model gains: the full one beside ``auto``, where that leaves anything out."""
    yield Head("scene", "contacts", "reduced by", "variables", "with auto", "seconds", "with auto",
               "MB", "with auto", "factors differ by")  # fmt: skip
    for name in scenes:
        lean = apart(partial(measured, name, "auto"), LIMITS)
        if lean["model"]:
            full = apart(partial(measured, name, "full"), LIMITS)
            spent = apart(partial(times, name, runs), LIMITS)
            yield row(name, {**full, "seconds": spent["full"]}, {**lean, "seconds": spent["auto"]})
    if large:
        lean = apart(partial(measured, LARGE, "auto"), LIMITS)
        yield row(LARGE, None, lean)


def row(name: str, full: dict[str, Any] | None, lean: dict[str, Any]) -> tuple[str, ...]:
    """One line of the table."""
    cells = [name, f"{lean['contacts']:,}", " and ".join(lean["model"])]
    for key, form in (("variables", ",d"), ("seconds", ".3g"), ("memory", ".0f")):
        cells += ["" if part is None else f"{part[key]:{form}}" for part in (full, lean)]
    differ = "" if full is None else f"{abs(full['load_factor'] / lean['load_factor'] - 1.0):.0e}"
    return *cells, differ


def measured(name: str, model: str) -> dict[str, Any]:
    """CPU seconds of the first run from contacts to certificate, and peak memory in MB."""
    scene = scene_of(name)
    contacts, start = len(scene.contacts), process_time()
    solution = solve(scene, model=model)
    seconds = process_time() - start
    return {
        "contacts": contacts, "seconds": seconds, "model": solution.model,
        "load_factor": solution.load_factor,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        "variables": list(explain(scene, model=model).sizes.values())[-1].variables,
    }  # fmt: skip


def times(name: str, runs: int) -> dict[str, float]:
    """CPU seconds, medians, in ever other order: a run may disturb the next. Small scenes run more
    often."""
    scene = scene_of(name)
    scene.contacts  # noqa: B018
    taken: dict[str, list[float]] = {"auto": [], "full": []}
    order, start, done = np.random.default_rng(0), process_time(), 0
    while done < runs or (process_time() - start < ENOUGH and done < MOST):
        done += 1
        for model in order.permutation(list(taken)):
            since = process_time()
            solve(scene, model=model)
            taken[model].append(process_time() - since)
    return {model: float(np.median(seconds)) for model, seconds in taken.items()}
