"""The compiled parts, where they could be built: None where a slower way does the same."""

from __future__ import annotations

import logging
import os
from importlib import import_module
from typing import Any

from cvxlimit.solvers.sources import digest

LOG = logging.getLogger(__name__)


def _loaded(name: str) -> Any:
    if os.environ.get("CVXLIMIT_COMPILED") == "no":
        return None
    try:
        found = import_module(f"cvxlimit.solvers.{name}")
    except ImportError:  # no compiler when the package was installed
        return None
    if getattr(found, "SOURCES", "") == _OF_SOURCES or not _OF_SOURCES:
        return found
    LOG.warning("%s was compiled from other sources and is not used: install again", name)
    return None


_OF_SOURCES = digest()

INTERIOR: Any = _loaded("_interior")
"""Our interior point, ``interior.c``; else other solvers."""

CHOLESKY: Any = _loaded("_cholesky")
"""Sparse factorisation, ``cholesky.c``; else SuperLU."""
