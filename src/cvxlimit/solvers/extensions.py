"""The compiled parts of the package; each is None where it could not be built, and a slower way is
taken."""

from __future__ import annotations

import logging
import os
from importlib import import_module
from typing import Any

from cvxlimit.solvers.sources import digest

LOG = logging.getLogger(__name__)


def _loaded(name: str) -> Any:
    """Returns a compiled module; None if it is not wanted, not there, or made of other sources."""
    if os.environ.get("CVXLIMIT_COMPILED") == "no":
        return None
    try:
        module = import_module(f"cvxlimit.solvers.{name}")
    except ImportError:  # There was no compiler when the package was installed.
        return None
    if getattr(module, "SOURCES", "") == _DIGEST or not _DIGEST:
        return module
    LOG.warning("%s was compiled from other sources and is not used: install again", name)
    return None


_DIGEST = digest()

INTERIOR: Any = _loaded("_interior")
"""Our interior-point method, ``interior.c``; without it other solvers are used."""

CHOLESKY: Any = _loaded("_cholesky")
"""Our sparse factorisation, ``cholesky.c``; without it SuperLU is used."""
