"""``docs/evidence/atlas.md`` from the records: tables, pictures, and what they mean."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median

from benchmarks.stability import charts, peers
from benchmarks.stability.families import FAMILIES
from benchmarks.stability.models import BELOW
from benchmarks.stability.outcomes import RIGHT, WRONG, Outcome
from benchmarks.stability.records import Record, Table
from benchmarks.stability.words import (
    CERTIFIED,
    DEFAULT,
    FIXED_POINT,
    HEAD,
    HONEST,
    METHODS,
    MODELS,
    ORDERS,
    PEER,
    SPREADS,
)  # fmt: skip
from cvxlimit.base.files import write_file

_TABLES = ("default", "methods", "models", "certified", "fixed-point", "orders", "peer")

_GOOD = (Outcome.RIGHT, Outcome.NO_ANSWER)


def write(folder: Path) -> list[Path]:
    """The page and its pictures; a study without records is left out."""
    tables = {name: Table(name).rows() for name in _TABLES}
    folder.mkdir(parents=True, exist_ok=True)
    written = [
        charts.saved(draw(tables[study]), folder / name)
        for name, (study, draw) in charts.PICTURES.items()
        if tables[study]
    ]
    parts = [HEAD, families()]
    if rows := tables["default"]:
        parts += [DEFAULT.format(**of_default(rows)), default_table(rows), honest(rows)]
    if rows := tables["methods"]:
        parts += [METHODS.format(**of_methods(rows), wrong=f"{WRONG:.1%}", right=f"{RIGHT:g}"),
                  methods_table(rows), worst(rows, tables["default"])]  # fmt: skip
    if rows := tables["models"]:
        parts += [MODELS.format(**of_models(rows)), models_table(rows)]
    if rows := tables["certified"]:
        parts += [CERTIFIED.format(**of_certified(rows)), certified_table(rows)]
    if rows := tables["fixed-point"]:
        parts += [FIXED_POINT.format(**of_fixed_point(rows)), fixed_point_table(rows),
                  periods(rows)]  # fmt: skip
    if rows := tables["orders"]:
        parts += [ORDERS.format(**of_orders(rows)), orders_table(rows), SPREADS]
    if rows := tables["peer"]:
        parts += [PEER, peer_table(rows)]
    page = folder / "atlas.md"
    write_file(page, ("\n\n".join(part.strip() for part in parts if part) + "\n").encode("utf-8"))
    return [page, *written]


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def families() -> str:
    """What the scenes are."""
    return table(["family", "what is hard"], [(f.name, f.what) for f in FAMILIES.values()])


def _of(rows: Iterable[Record], outcome: str) -> int:
    return sum(row["outcome"] == outcome for row in rows)


def of_default(rows: Sequence[Record]) -> dict[str, object]:
    """Figures of the default's study."""
    good = sum(row["outcome"] in _GOOD for row in rows)
    with_bounds = [row for row in rows if row["outcome"] == Outcome.RIGHT]
    return {
        "scenes": f"{len(rows):,}",
        "right": _of(rows, Outcome.RIGHT),
        "none": _of(rows, Outcome.NO_ANSWER),
        "honest": _of(rows, Outcome.HONEST),
        "wrong": _of(rows, Outcome.WRONG),
        "share": f"{100 * good / len(rows):.2f} %",
        "proved": f"{100 * sum(r['proved'] for r in with_bounds) / len(with_bounds):.1f} %",
        "seconds": f"{sum(r.get('seconds') or 0.0 for r in rows):.0f}",
    }


def default_table(rows: Sequence[Record]) -> str:
    """Family by family."""
    head = ["family", "scenes", "right", "no answer, proved", "honest failure", "wrong",
            "both bounds proved", "contacts", "ms of CPU, median"]  # fmt: skip
    lines = []
    for name in FAMILIES:
        mine = [row for row in rows if row["family"] == name]
        bounds = [row for row in mine if row["outcome"] == Outcome.RIGHT]
        counts = [row["contacts"] for row in mine if "contacts" in row]
        proved = f"{sum(r['proved'] for r in bounds)} of {len(bounds)}" if bounds else "-"
        times = [1000 * row["seconds"] for row in mine if "seconds" in row]
        if mine:
            classes = [_of(mine, o) or "" for o in (*_GOOD, Outcome.HONEST)]
            lines.append([name, len(mine), *classes, _of(mine, Outcome.WRONG), proved,
                          f"{min(counts)}-{max(counts)}", f"{median(times):.0f}"])  # fmt: skip
    return table(head, lines)


def honest(rows: Sequence[Record]) -> str:
    """The honest failures, one by one."""
    failed = [row for row in rows if row["outcome"] == Outcome.HONEST]
    lines = [[r["key"], r.get("knob", ""), _bounds(r), r["status"]] for r in failed]
    return HONEST + table(["scene", "what it has", "bracket", "status"], lines) if lines else ""


def _bounds(row: Record) -> str:
    low, high = row.get("lower"), row.get("upper")
    return f"[{'?' if low is None else f'{low:.7g}'}, {'?' if high is None else f'{high:.7g}'}]"


def of_methods(rows: Sequence[Record]) -> dict[str, object]:
    """Figures of the methods' study."""
    raw = [row for row in rows if row["method"].startswith("raw/")]
    checked = [row for row in rows if row["method"].startswith("checked/")]
    return {
        "scenes": len({(row["family"], row["seed"]) for row in rows}),
        "raw": f"{len(raw):,}",
        "raw_wrong": _of(raw, Outcome.WRONG),
        "checked": f"{len(checked):,}",
        "checked_wrong": _of(checked, Outcome.WRONG),
    }


def methods_table(rows: Sequence[Record]) -> str:
    """Method by method."""
    groups: dict[str, list[Record]] = defaultdict(list)
    for row in rows:
        groups[row["method"]].append(row)
    lines = [
        [charts.labelled(name), len(mine), *[_of(mine, o) or "" for o in Outcome],
         f"{1000 * median(r['seconds'] for r in mine):.0f}"]
        for name, mine in groups.items()
    ]  # fmt: skip
    return table(["method", "scenes", *Outcome, "ms of CPU, median"], lines)


def worst(rows: Sequence[Record], default: Sequence[Record]) -> str:
    """The wrongest of the claims that were called right, one of each family and word."""
    known = {r["key"]: _bounds(r) if "upper" in r and r["upper"] is not None else r["status"]
             for r in default}  # fmt: skip
    wrong = [r for r in rows if r["outcome"] == Outcome.WRONG]
    picked: dict[tuple[str, str], Record] = {}
    for row in sorted(wrong, key=lambda r: -(r["error"] or 1e9)):
        picked.setdefault((row["family"], row["word"]), row)
    lines = [
        [f"{r['family']}-{r['seed']}", charts.labelled(r["method"]), r["word"],
         f"{r['says']:.6g}" if isinstance(r["says"], float) else r["says"],
         known.get(f"{r['family']}-{r['seed']}", "another")]
        for r in list(picked.values())[:14]
    ]  # fmt: skip
    head = ["scene", "method", "status", "its answer", "certified, conic"]
    return (
        "A sample of what was called right and is wrong:\n\n" + table(head, lines) if lines else ""
    )


def of_certified(rows: Sequence[Record]) -> dict[str, object]:
    """Figures of the study with interaction."""
    return {
        "brackets": len(rows),
        "scenes": len({(row["family"], row["seed"]) for row in rows}),
        "refuted": _of(rows, Outcome.WRONG),
        "closed": sum(row.get("truth") is not None for row in rows),
        "states": sum(row.get("states") or 0 for row in rows),
        "five": sum((row.get("gap") or 9.0) <= 0.05 for row in rows),
        "open": sum(row.get("lower") is None and row["outcome"] == Outcome.HONEST for row in rows),
    }


def certified_table(rows: Sequence[Record]) -> str:
    """Family by family, both readings."""
    lines = []
    for name in FAMILIES:
        mine = [row for row in rows if row["family"] == name]
        gaps = sorted(row["gap"] for row in mine if row.get("gap") is not None)
        if mine:
            middle = f"{100 * median(gaps):.2g} %" if gaps else "-"
            most = f"{100 * gaps[-1]:.2g} %" if gaps else "-"
            lines.append([name, len(mine), *[_of(mine, o) or "" for o in Outcome], middle, most])
    return table(["family", "brackets", *Outcome, "width, median", "widest"], lines)


def fixed_point_table(rows: Sequence[Record]) -> str:
    """Weight by weight, both readings: how many iterations ended how."""
    endings = ("converged", "cycling", "not converged", "diverged")
    lines = []
    for reading in dict.fromkeys(row["moments"] for row in rows):
        for weight in sorted({row["weight"] for row in rows}):
            mine = [r for r in rows if r["moments"] == reading and r["weight"] == weight
                    and r.get("first") is not None]  # fmt: skip
            ends = Counter(row["ending"] for row in mine)
            lines.append([reading, f"{weight:g}", len(mine), *[ends[e] or "" for e in endings]])
    head = ["moments", "weight of the old forces", "scenes", "converged", "cycling", "wandering",
            "diverged"]  # fmt: skip
    return table(head, lines)


def periods(rows: Sequence[Record]) -> str:
    """The cycles found."""
    found = Counter(row["period"] for row in rows if row.get("period"))
    if not found:
        return ""
    each = ", ".join(f"{n} of period {p}" for p, n in sorted(found.items()))
    return f"Cycles: {each}."


def of_fixed_point(rows: Sequence[Record]) -> dict[str, object]:
    """How much was asked."""
    scenes = Counter(family for family, _ in {(row["family"], row["seed"]) for row in rows})
    return {"each": min(scenes.values()), "runs": len(rows)}


def of_models(rows: Sequence[Record]) -> dict[str, object]:
    """Figures of the study of models."""
    scenes: dict[tuple[str, int], dict[str, Record]] = defaultdict(dict)
    for row in rows:
        scenes[row["family"], row["seed"]][row["model"]] = row
    pairs = sum(
        mine[a].get("status") is not None and mine[b].get("status") is not None
        for mine in scenes.values()
        for a, b, _ in BELOW
        if a in mine and b in mine
    )
    return {
        "scenes": len(scenes),
        "pairs": f"{pairs:,}",
        "contradicted": _of(rows, Outcome.WRONG) or "none",
        "members": sum(row.get("members") or 0 for row in rows),
    }


def models_table(rows: Sequence[Record]) -> str:
    """Model by model."""
    groups: dict[str, list[Record]] = defaultdict(list)
    for row in rows:
        groups[row["model"]].append(row)
    lines = [
        [name, len(mine), *[_of(mine, o) or "" for o in Outcome],
         f"{1000 * median(r['seconds'] for r in mine):.0f}"]
        for name, mine in groups.items()
    ]  # fmt: skip
    return table(["model", "scenes", *Outcome, "ms of CPU, median"], lines)


def of_orders(rows: Sequence[Record]) -> dict[str, object]:
    """Figures of the study of orders."""
    plain = [spread([r["plain"] for r in mine], mine) for mine in _by_scene(rows).values()]
    return {
        "scenes": len({row["scene"] for row in rows}),
        "runs": f"{len(rows):,}",
        "plain": f"{max(plain, default=0.0):.0e}",
    }


def _by_scene(rows: Iterable[Record]) -> dict[tuple[str, ...], list[Record]]:
    """Runs that should agree: those of one scene, reading and choice of forces."""
    groups: dict[tuple[str, ...], list[Record]] = defaultdict(list)
    for row in rows:
        if row.get("load_factor") is not None and row.get("plain") is not None:
            groups[row["scene"], row["moments"], row["choice"]].append(row)
    return groups


def spread(values: Sequence[float], rows: Sequence[Record]) -> float:
    """How far apart values are, over the load factor without interaction."""
    return (max(values) - min(values)) / abs(median(r["plain"] for r in rows))


def orders_table(rows: Sequence[Record]) -> str:
    """Scene by scene: the spread with every choice of forces, and how many runs converged."""
    groups, lines = _by_scene(rows), []
    choices = list(dict.fromkeys(row["choice"] for row in rows))
    for scene, moments in dict.fromkeys((row["scene"], row["moments"]) for row in rows):
        cells = []
        for choice in choices:
            mine = groups.get((scene, moments, choice), [])
            good = sum(r["ending"] == "converged" for r in mine)
            apart = f"{spread([r['load_factor'] for r in mine], mine):.1e}" if mine else "-"
            cells.append(f"{apart} ({good} of {len(mine)})" if mine else "-")
        lines.append([scene, moments, *cells])
    shown = [f"{choice}: spread (converged)" for choice in choices]
    return table(["scene", "moments", *shown], lines)


def peer_table(rows: Sequence[Record]) -> str:
    """compas_cra beside ours."""
    lines = [
        [r["key"], r["contacts"], f"{r['ours']:.6f}",
         *[p if isinstance(p, str) else f"{p:.1e}" for p in r["tension"]],
         "yes" if peers.agrees(r) else "no", f"{r['seconds']:.2f}", f"{r['seconds_peer']:.2f}"]
        for r in rows
    ]  # fmt: skip
    shares = [f"tension at {share:g}" for share in peers.SHARES]
    return table(["scene", "contacts", "our load factor", *shares, "agree", "s, ours",
                  "s per tilt, RBE"], lines)  # fmt: skip
