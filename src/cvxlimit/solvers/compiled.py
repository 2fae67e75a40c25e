"""The compiled parts of the package; each is None where it could not be built, and a slower way is
taken."""

from __future__ import annotations

import logging
import os
from importlib import import_module
from typing import Any

from cvxlimit.solvers.sources import HERE, digest

LOG = logging.getLogger(__name__)


def loaded(name: str) -> Any:
    """Returns the compiled module of a dotted name, which lies beside its source; None if it is not
    wanted, not there, or made of other sources."""
    if os.environ.get("CVXLIMIT_COMPILED") == "no":
        return None
    try:
        module = import_module(name)
    except ImportError:  # There was no compiler when the package was installed.
        return None
    *folders, part = name.split(".")[1:]
    made_of = digest(HERE.parent.joinpath(*folders, f"{part.removeprefix('_')}.c"))
    if getattr(module, "SOURCES", "") == made_of or not made_of:
        return module
    LOG.warning("%s was compiled from other sources and is not used: install again", part)
    return None


CHOLESKY: Any = loaded("cvxlimit.solvers._cholesky")
"""Our sparse factorisation, ``cholesky.c``; without it SuperLU is used."""
