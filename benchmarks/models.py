"""``python -m benchmarks.models``: how much model scenes need, and what it gains.

Every built-in scene, and planar walls, with the full model and with ``auto``: sizes of the compiled
problem, peak memory (in a process of its own) and seconds of CPU, medians of some runs; and the
best choice by hand, of both models and three solvers.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from time import process_time
from typing import Any

import numpy as np
from rich.console import Console

from cvxlimit import Scene, Status, builtin_scene, explain, solve
from cvxlimit.masonry import BUILTIN, running_bond, wall

console = Console(highlight=False, soft_wrap=True)

WALLS = {"wall-24": 24, "wall-34": 34}
"""Units of planar walls twice as many courses high: 3,408 and 6,868 contacts."""

LARGE = {"wall-129": 129}
"""99,588 contacts; with ``auto`` only."""

ENOUGH, MOST = 8.0, 31
"""Small scenes run until this many seconds are used, at most so often."""

HANDS = ("QOCO", "CLARABEL", "BLOCKWISE")

HEAD = (
    "| scene | contacts | variables | cones | rows | seconds | MB | auto: | variables | cones | "
    "rows | seconds | MB | factors differ by | best by hand |\n" + "|---" * 15 + "|\n"
)


def scene_of(name: str) -> Scene:
    """A built-in scene or one of the walls."""
    units = (WALLS | LARGE).get(name)
    if units is None:
        return builtin_scene(name)
    return wall(running_bond(units, 2 * units), friction=0.65)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.models", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=[*BUILTIN, *WALLS])
    parser.add_argument("--runs", type=int, default=2)
    parser.add_argument("--large", action="store_true", help="the largest wall as well")
    parser.add_argument("--one", nargs=2, metavar=("SCENE", "MODEL"),
                        help="one measurement, as JSON; MODEL may be 'times'")  # fmt: skip
    options = parser.parse_args(arguments)
    if options.one:
        name, what = options.one
        found = times(name, options.runs) if what == "times" else measured(name, what)
        sys.stdout.write(json.dumps(found))
        return
    names = [*options.scenes, *(LARGE if options.large else ())]
    console.print(HEAD, end="")
    for line in table(names, options.runs):
        console.print(line, end="")


def table(names: Sequence[str], runs: int) -> Iterator[str]:
    """Rows of the table."""
    for name in names:
        lean = apart(name, "auto")
        if name in LARGE:
            yield row(name, None, {**lean, "seconds": lean["first"]}, {})
            continue
        full = apart(name, "full")
        seconds = apart(name, "times", runs)
        full["seconds"], lean["seconds"] = seconds.pop("full"), seconds.pop("auto")
        yield row(name, full, lean, seconds)


def row(
    name: str, full: dict[str, Any] | None, lean: dict[str, Any], hands: dict[str, float]
) -> str:
    """One line of Markdown."""
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
    return "| " + " | ".join(cells) + " |\n"


def apart(name: str, what: str, runs: int = 1) -> dict[str, Any]:
    """One measurement in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.models", "--runs", str(runs), "--one", name, what]
    done = subprocess.run(command, capture_output=True, check=True, text=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


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


if __name__ == "__main__":
    main()
