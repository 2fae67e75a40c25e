"""Methods whose work is done above their class: the one place where that is looked up."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any


def attached(name: str) -> Callable[..., Any]:
    """The function of that name in :mod:`cvxlimit.plotting.reports`, loaded when first asked
    for."""
    found: Callable[..., Any] = getattr(import_module("cvxlimit.plotting.reports"), name)
    return found
