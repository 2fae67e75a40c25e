"""The paper's iteration under every reading of Eq. 30, beside certified brackets.

What :func:`runs.experiments` lists runs in a process of its own: first what was never measured,
then the oldest, until ``--budget`` seconds are over. Results are kept in
``docs/evidence/interaction.jsonl``, and tables and pictures are made from all of them:
``--budget 0`` measures nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from benchmarks.experiment import Lines, Part, Title, experiment
from benchmarks.experiments.interaction import pictures, tables
from benchmarks.experiments.interaction.runs import (
    FIRST,
    Apart,
    Experiment,
    Pair,
    experiments,
    from_row,
    to_row,
)
from benchmarks.rows import Rows

STORE = Path("docs/evidence/interaction.jsonl")
PARTS = ("tables", "brackets", "settings", "orders")
KINDS = (FIRST, "certified", "fixed-point")


@experiment(Part(25, "--budget 1500 --each 40 --docs docs/evidence", keeps=str(STORE)))
def interaction(
    parts: Sequence[str] = PARTS, scenes: Sequence[str] = (), kinds: Sequence[str] = KINDS,
    budget: float = 540.0, each: float = 60.0, out: Path = STORE, docs: Path | None = None,
) -> Lines:  # fmt: skip
    """The paper's iteration, its readings, and certified brackets, within a budget of seconds."""
    kept, started, measured = Rows(out, "key"), perf_counter(), Apart()
    every = list(experiments())
    try:
        for wanted in due(every, kept, parts, scenes):
            if perf_counter() - started > budget:
                break
            if wanted.kind in kinds:
                now = datetime.now(UTC).isoformat(timespec="seconds")
                kept.add(to_row(wanted, replace(measured(wanted, each), measured=now)))
    finally:
        measured.end()
    pairs = listed(kept, every)
    for title, table in tables.TABLES.items():
        yield Title(title)
        yield from table(pairs)
    if docs is not None:
        pictures.draw(docs, pairs)


def due(
    every: Sequence[Experiment], kept: Rows, parts: Sequence[str], scenes: Sequence[str]
) -> list[Experiment]:
    """Experiments of these parts and scenes: those never run first, then the oldest."""

    def since(e: Experiment) -> str:
        row = kept.get({"key": e.key})
        return "" if row is None else str(row["result"]["measured"])

    chosen = [e for e in every if e.part in parts and (not scenes or e.scene in scenes)]
    return sorted(chosen, key=since)


def listed(kept: Rows, every: Sequence[Experiment]) -> list[Pair]:
    """What is known of the experiments there are, in their order."""
    return [from_row(row) for e in every if (row := kept.get({"key": e.key})) is not None]
