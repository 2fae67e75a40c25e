"""``python -m benchmarks.interaction``: the paper's iteration, its readings, certified brackets.

Runs what :mod:`benchmarks.interaction.experiments` lists, in a process of their own: first what
was never measured, then the oldest, until ``--budget`` seconds are over. Results are kept in
``docs/evidence/interaction.json``; with ``--write``, the tables and pictures of the page beside it
are made from all of them. ``--budget 0 --write`` draws only.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from rich.console import Console

from benchmarks.interaction.experiments import FIRST, Apart, Experiment, Result, experiments
from benchmarks.interaction.page import write_page
from cvxlimit.base.files import write_file

console = Console(highlight=False, soft_wrap=True)

PARTS = ("tables", "brackets", "settings", "orders")
KINDS = (FIRST, "certified", "fixed-point")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure within the budget, keep what was found, write the page if asked to."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.interaction", description=__doc__)
    parser.add_argument("--docs", type=Path, default=Path("docs/evidence"))
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--scenes", nargs="+", default=None)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--budget", type=float, default=540.0, help="seconds in all")
    parser.add_argument("--each", type=float, default=60.0, help="CPU seconds per run")
    parser.add_argument("--write", action="store_true", help="make the page's tables and pictures")
    options = parser.parse_args(arguments)
    store, started = options.docs / "interaction.json", perf_counter()
    every = list(experiments())
    found = load(store)
    measured = Apart()
    try:
        for experiment in due(every, found, options.parts, options.scenes):
            if experiment.kind not in options.kinds:
                continue
            if perf_counter() - started > options.budget:
                break
            result = measured(experiment, options.each)
            now = datetime.now(UTC).isoformat(timespec="seconds")
            found[experiment.key] = experiment, replace(result, measured=now)
            _tell(experiment, result)
            found = listed(found, every)
            save(store, found)
    finally:
        measured.end()
    if options.write:
        write_page(options.docs, listed(found, every))


Found = dict[str, tuple[Experiment, Result]]


def due(
    every: Sequence[Experiment],
    found: Found,
    parts: Sequence[str],
    scenes: Sequence[str] | None,
) -> list[Experiment]:
    """Experiments of these parts and scenes: those never run first, then the oldest."""
    chosen = [e for e in every if e.part in parts and (scenes is None or e.scene in scenes)]
    return sorted(chosen, key=lambda e: found[e.key][1].measured if e.key in found else "")


def listed(found: Found, every: Sequence[Experiment]) -> Found:
    """What is known of the experiments there are, in their order."""
    return {e.key: found[e.key] for e in every if e.key in found}


def load(store: Path) -> Found:
    """What is known, by key."""
    if not store.exists():
        return {}
    rows = json.loads(store.read_text(encoding="utf-8"))
    pairs = ((Experiment(**row["experiment"]), row["result"]) for row in rows)
    lists = ("factors", "clock", "lowers", "uppers")
    return {
        experiment.key: (
            experiment,
            Result(**{**result, **{name: tuple(result[name]) for name in lists}}),
        )
        for experiment, result in pairs
    }


def save(store: Path, found: Found) -> None:
    """Write all of it, one row a line."""
    rows = [
        json.dumps({"experiment": asdict(experiment), "result": _rounded(asdict(result))})
        for experiment, result in found.values()
    ]
    write_file(store, ("[\n" + ",\n".join(rows) + "\n]\n").encode())


def _rounded(result: dict[str, object]) -> dict[str, object]:
    """Seven digits are enough for tables and pictures."""

    def short(value: object) -> object:
        if isinstance(value, float):
            return float(f"{value:.7g}")
        return [short(v) for v in value] if isinstance(value, tuple) else value

    return {name: short(value) for name, value in result.items()}


def _tell(experiment: Experiment, result: Result) -> None:
    factor = "none" if result.load_factor is None else f"{result.load_factor:.5f}"
    inside = "" if result.upper is None else f" in [{result.lower}, {result.upper:.5f}]"
    setting = f"beta {experiment.weight:g}, eps {experiment.epsilon:g} {experiment.solver}"
    order = "" if experiment.order < 0 else f", order {experiment.order}"
    console.print(
        f"{experiment.part} {experiment.scene}, {experiment.moments}, {experiment.kind}, "
        f"{experiment.surface}, {setting}{order}: {result.status}, {result.solves} solves, "
        f"{factor}{inside}, {result.seconds:.1f} s"
    )


if __name__ == "__main__":
    main()
