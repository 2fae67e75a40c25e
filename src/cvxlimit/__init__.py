"""cvxlimit: certified collapse loads of dry-jointed masonry.

A scene goes in; a load factor with a bracket recomputed outside the solver, contact forces and the
collapse mechanism come out. Start with :func:`solve` and :func:`builtin_scene`.

A module is loaded when a name of it is first asked for: CVXPY and SciPy take a second, during which
the command line must be able to answer Ctrl-C. Public names are the lines of ``__init__.pyi``.
"""

import pathlib
import re
import sys
from importlib import import_module
from typing import Any

from cvxlimit.base.versions import __version__

_STUB = pathlib.Path(__file__).with_suffix(".pyi").read_text("utf-8")
_HOME = {
    name: module for module, name in re.findall(r"^from (\S+) import (\w+) as \w+$", _STUB, re.M)
}
"""The module that each public name is in."""

__all__ = ["__version__", *(name for name in _HOME if name != "__version__")]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        reason = f"module 'cvxlimit' has no attribute {name!r}"
        raise AttributeError(reason, name=name, obj=sys.modules[__name__])  # did you mean ...?
    home = _HOME[name]
    found = import_module(f"{home}.{name}" if home == "cvxlimit" else home)
    value = found if home == "cvxlimit" else getattr(found, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
