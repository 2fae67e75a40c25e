"""cvxlimit: certified collapse loads of dry-jointed masonry.

A scene goes in; a load factor with a bracket recomputed outside the solver, contact forces and the
collapse mechanism come out. Start with :func:`solve` and :func:`builtin_scene`.

A module is loaded when a name of it is first asked for: CVXPY and SciPy take a second, during which
the command line must be able to answer Ctrl-C. Public names are the lines of ``__init__.pyi``; what
the core and its extensions offer at their doors is known from here on.
"""

import sys
from typing import Any

import lazy_loader

from cvxlimit.base.doors import offer
from cvxlimit.base.versions import __version__ as __version__
from cvxlimit.extensions import check_here, tables
from cvxlimit.offered import OFFERED

for _table in (OFFERED, *tables()):
    offer(_table)

_found, _, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name not in __all__:
        reason = f"module 'cvxlimit' has no attribute {name!r}"
        raise AttributeError(reason, name=name, obj=sys.modules[__name__])  # did you mean ...?
    try:
        return _found(name)
    except ModuleNotFoundError as error:  # of an extension that is not here, or of a library
        check_here(str(error.name).removeprefix("cvxlimit.extensions."), f"cvxlimit.{name}")
        raise


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
