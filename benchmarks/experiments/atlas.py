"""Where methods fail: families of scenes made to break them, and how each answer was judged.

Rows are kept in ``benchmarks/results/stability``, and what this code measured there is not measured
again; ``--kept FOLDER`` prints the rows of a folder, and whose they are. With ``--first 2000``
scenes are asked that nobody has seen.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from statistics import median

from benchmarks.charts import save
from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.rows import Measured, Row
from benchmarks.stability import pictures
from benchmarks.stability.families import FAMILIES
from benchmarks.stability.models import BELOW
from benchmarks.stability.outcomes import Outcome
from benchmarks.stability.studies import STUDIES

FOLDER = Path("benchmarks/results/stability")

_GOOD = (Outcome.RIGHT, Outcome.NO_ANSWER)


@experiment(Part(30, "--docs docs/evidence"))
def atlas(
    studies: Sequence[str] = tuple(STUDIES), size: int = 1100, first: int = 0, scale: int = 1,
    out: Path = FOLDER, docs: Path | None = None, kept: Path | None = None,
) -> Lines:  # fmt: skip
    """Where methods fail: so many scenes for our default from a first seed on, fewer for others;
    ``scale`` multiplies numbers of blocks."""
    for study in studies:
        ask, share = STUDIES[study]
        made = Measured((kept or out) / f"{study}.jsonl", "key", kept=kept is not None)
        if kept is None:
            ask(made, max(1, round(share * size)), scale, first)
        else:
            yield made.said()
        rows = list(made)
        for title, table in TABLES[study].items() if rows else ():
            yield Title(title)
            yield from table(rows)
        for name, (shown, draw) in pictures.PICTURES.items():
            if docs is not None and shown == study and rows:
                save(draw(rows), docs / name)


def _of(rows: Iterable[Row], outcome: str) -> int:
    return sum(row["outcome"] == outcome for row in rows)


def of_default(rows: Sequence[Row]) -> Lines:
    """Sums of the default's study."""
    bounds = [row for row in rows if row["outcome"] == Outcome.RIGHT]
    yield Head("scenes", "right", "no answer, proved", "honest failures", "wrong", "with an answer",
               "both bounds proved", "CPU s")  # fmt: skip
    good = sum(row["outcome"] in _GOOD for row in rows)
    yield (
        f"{len(rows):,}", *(_of(rows, o) for o in (*_GOOD, Outcome.HONEST, Outcome.WRONG)),
        f"{100 * good / len(rows):.2f} %",
        f"{100 * sum(r['proved'] for r in bounds) / max(len(bounds), 1):.1f} %",
        f"{sum(r.get('seconds') or 0.0 for r in rows):.0f}",
    )  # fmt: skip


def by_family(rows: Sequence[Row]) -> Lines:
    """The default, family by family."""
    yield Head("family", "what is hard", "scenes", "right", "no answer, proved",
               "both bounds proved", "ms of CPU, median")  # fmt: skip
    for name, family in FAMILIES.items():
        mine = [row for row in rows if row["family"] == name]
        bounds = [row for row in mine if row["outcome"] == Outcome.RIGHT]
        proved = f"{sum(r['proved'] for r in bounds)} of {len(bounds)}" if bounds else "-"
        times = [1000 * row["seconds"] for row in mine if "seconds" in row]
        if times:
            classes = [_of(mine, o) or "" for o in _GOOD]
            yield name, family.what, len(mine), *classes, proved, f"{median(times):.0f}"


def honest(rows: Sequence[Row]) -> Lines:
    """The honest failures, one by one."""
    yield Head("scene", "what it has", "bracket", "status")
    for r in rows:
        if r["outcome"] == Outcome.HONEST:
            yield r["key"], r.get("knob", ""), _bounds(r), r["status"]


def _bounds(row: Row) -> str:
    low, high = row.get("lower"), row.get("upper")
    return f"[{'?' if low is None else f'{low:.7g}'}, {'?' if high is None else f'{high:.7g}'}]"


def of_methods(rows: Sequence[Row]) -> Lines:
    """Sums of the methods' study."""
    yield Head("", "answers", "wrong, though called right")
    for kind, said in (("raw/", "solver believed"), ("checked/", "checked")):
        mine = [row for row in rows if row["method"].startswith(kind)]
        yield said, f"{len(mine):,}", _of(mine, Outcome.WRONG)


def by_model(rows: Sequence[Row]) -> Lines:
    """A row for every model."""
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["model"]].append(row)
    yield Head("model", "scenes", *Outcome, "ms of CPU, median")
    for name, mine in groups.items():
        middle = f"{1000 * median(r['seconds'] for r in mine):.0f}"
        yield name, len(mine), *(_of(mine, o) or "" for o in Outcome), middle


def worst(rows: Sequence[Row]) -> Lines:
    """The wrongest of the claims that were called right, one of each family and word."""
    yield Head("scene", "method", "status", "its answer", "certified")
    picked: dict[tuple[str, str], Row] = {}
    for row in sorted(rows, key=lambda r: -(r["error"] or 1e9)):
        if row["outcome"] == Outcome.WRONG:
            picked.setdefault((row["family"], row["word"]), row)
    for r in list(picked.values())[:14]:
        says = f"{r['says']:.6g}" if isinstance(r["says"], float) else r["says"]
        known = r["none"] or _bounds(r)
        yield f"{r['family']}-{r['seed']}", pictures.labelled(r["method"]), r["word"], says, known


def of_certified(rows: Sequence[Row]) -> Lines:
    """Sums of the study with interaction."""
    yield Head("brackets", "scenes", "refuted", "closed forms", "states tried", "within 5 %",
               "without a lower bound")  # fmt: skip
    yield (
        len(rows), len({(row["family"], row["seed"]) for row in rows}), _of(rows, Outcome.WRONG),
        sum(row.get("truth") is not None for row in rows),
        sum(row.get("states") or 0 for row in rows),
        sum((row.get("gap") or 9.0) <= 0.05 for row in rows),
        sum(row.get("lower") is None and row["outcome"] == Outcome.HONEST for row in rows),
    )  # fmt: skip


def of_models(rows: Sequence[Row]) -> Lines:
    """Sums of the study of models: pairs of which one allows what the other does."""
    scenes: dict[tuple[str, int], dict[str, Row]] = defaultdict(dict)
    for row in rows:
        scenes[row["family"], row["seed"]][row["model"]] = row
    pairs = sum(
        mine[a].get("status") is not None and mine[b].get("status") is not None
        for mine in scenes.values()
        for a, b, _ in BELOW
        if a in mine and b in mine
    )
    yield Head("scenes", "pairs", "contradicted", "members of zero dilatancy checked")
    members = sum(row.get("members") or 0 for row in rows)
    yield len(scenes), f"{pairs:,}", _of(rows, Outcome.WRONG), members


TABLES: dict[str, dict[str, Callable[[Sequence[Row]], Lines]]] = {
    "default": {"default": of_default, "families": by_family, "open": honest},
    "certified": {"certified": of_certified},
    "methods": {"believed": of_methods, "wrong": worst},
    "models": {"pairs": of_models, "models": by_model},
}
"""Of every study, by their headings."""
