"""Records on disk: CSV for people, JSON with versions and machine for comparison."""

from __future__ import annotations

import csv
import io
import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.base.files import write_file
from cvxlimit.compare.models import Row

FORMAT = "cvxlimit-benchmark"
VERSION = 1
PACKAGES = (
    "cvxlimit", "cvxpy", "numpy", "scipy", "clarabel", "cvxopt", "highspy", "scs", "ecos", "qoco",
    "mosek", "gurobipy", "cuopt",
)  # fmt: skip


@dataclass(frozen=True)
class Record:
    """A row and where it belongs: ``purpose`` is "study" (all methods) or "growth" (a few)."""

    case: str
    family: str
    size: int
    purpose: str
    row: Row


def environment() -> dict[str, Any]:
    """Versions and machine, without its name."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "source tree" if name == "cvxlimit" else "not installed"
    machine = {
        "system": f"{platform.system()} {platform.machine()}",
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "memory_gb": _memory(),
        "load_before": round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None,
    }
    started = datetime.now(UTC).isoformat(timespec="seconds")
    return {"started": started, "versions": versions, "machine": machine}


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"


def _memory() -> float | None:
    try:
        return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1)
    except (ValueError, OSError, AttributeError):
        return None


def write(folder: Path, records: Sequence[Record], about: dict[str, Any]) -> tuple[Path, Path]:
    """``results.csv`` and ``results.json`` in ``folder``, each replaced in one step."""
    folder.mkdir(parents=True, exist_ok=True)
    flat = [_flat(record) for record in records]
    table, document = folder / "results.csv", folder / "results.json"
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, _columns())
    writer.writeheader()
    writer.writerows(flat)
    write_file(table, text.getvalue().encode("utf-8"))
    content = {"format": FORMAT, "version": VERSION, **about, "rows": flat}
    write_file(document, json.dumps(content, indent=1).encode("utf-8"))
    return table, document


def read(folder: Path) -> tuple[list[Record], dict[str, Any]]:
    """Records and what is known about their run, from ``results.json``."""
    content = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    if content.get("format") != FORMAT or content.get("version") != VERSION:
        raise ValueError(f"{folder / 'results.json'} is not a {FORMAT} file of version {VERSION}")
    rows = content.pop("rows")
    names = {column.name for column in fields(Row)}
    records = [
        Record(
            **{key: value for key, value in flat.items() if key not in names},
            row=Row(**{key: value for key, value in flat.items() if key in names}),
        )
        for flat in rows
    ]
    return records, content


def _flat(record: Record) -> dict[str, Any]:
    flat = asdict(record)
    return {**{k: v for k, v in flat.items() if k != "row"}, **flat["row"]}


def _columns() -> list[str]:
    own = [column.name for column in fields(Record) if column.name != "row"]
    return own + [column.name for column in fields(Row)]


def fitted_exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """p of the least-squares fit of value = constant x size^p; NaN for fewer than two sizes.

    >>> round(fitted_exponent([10, 100, 1000], [3, 300, 30000]), 6)
    2.0
    """
    if len(set(sizes)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
