"""Extensions: each folder stands on the core alone, and may be left out.

Nothing below ``cvxlimit`` outside this folder imports one of them, and none imports another. What a
folder offers at the doors of the core stands in its ``OFFERED``, beside the order in which to read
its files.
"""

from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from cvxlimit.base.doors import Offered


def tables() -> Iterator[Offered]:
    """What each extension that is here offers."""
    for module in iter_modules(__path__):
        yield import_module(f"{__name__}.{module.name}").OFFERED


def __getattr__(name: str) -> Any:
    if name in {module.name for module in iter_modules(__path__)}:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
