"""Speed against accuracy: a registry of methods, isolated runs, references, charts.

:func:`compare` is the front door for a user's own scene; ``benchmarks/`` runs the same methods
over scenes of growing size. To add a method, write a line into
:func:`~cvxlimit.compare.registry.registry`.
"""

from cvxlimit.compare.comparison import DEFAULT_MODELS, Comparison, compare
from cvxlimit.compare.models import Model
from cvxlimit.compare.registry import registry
from cvxlimit.compare.runs import Limits
from cvxlimit.solvers import settings_for

__all__ = [
    "DEFAULT_MODELS",
    "Comparison",
    "Limits",
    "Model",
    "compare",
    "registry",
    "settings_for",
]
