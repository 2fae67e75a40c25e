"""Which machine and which versions a figure is from, and how values grow with size."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

PACKAGES = (
    "cvxlimit", "cvxpy", "numpy", "scipy", "clarabel", "cvxopt", "highspy", "scs", "ecos", "qoco",
    "mosek", "gurobipy", "cuopt",
)  # fmt: skip


def environment() -> dict[str, Any]:
    """Versions and machine, without its name."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "source tree" if name == "cvxlimit" else "not installed"
    machine = {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
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


def fitted_exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """p of the least-squares fit of value = constant x size^p; NaN for fewer than two sizes.

    >>> round(fitted_exponent([10, 100, 1000], [3, 300, 30000]), 6)
    2.0
    """
    if len(set(sizes)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
