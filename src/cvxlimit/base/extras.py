"""Libraries that come with extras: imported when they are used, and named when they are missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from cvxlimit.errors import ModelError


def needed(module: str, extra: str, what: str) -> Any:
    """``module``, imported; ``what`` needs it, and the ``extra`` of the package brings it."""
    try:
        return import_module(module)
    except ImportError as error:
        name = module.split(".")[0]
        raise ModelError(f'{what} need {name}: pip install "cvxlimit[{extra}]"') from error
