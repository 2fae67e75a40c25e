"""The compiled parts, where they could be built: None where a slower way does the same."""

from __future__ import annotations

import os
from importlib import import_module
from typing import Any

REVISION = 3
"""Of their interfaces (``arguments.h``): what was built from older sources is left alone."""


def _loaded(name: str) -> Any:
    if os.environ.get("CVXLIMIT_COMPILED") == "no":
        return None
    try:
        found = import_module(f"cvxlimit.solvers.{name}")
    except ImportError:  # no compiler when the package was installed
        return None
    return found if found.REVISION == REVISION else None


BATCH: Any = _loaded("interior._batch")
"""Small blocks and cones of the interior point, ``interior/batch.c``; else NumPy."""

SMALL: Any = _loaded("interior._small")
"""The whole interior point for small programs, ``interior/small.c``; else the parts above."""

CHOLESKY: Any = _loaded("_cholesky")
"""Sparse factorisation, ``cholesky.c``; else SuperLU."""
