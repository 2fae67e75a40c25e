"""Speed against accuracy: a registry of methods, references, charts.

:func:`compare` is the front door for a user's own scene; ``benchmarks/`` runs the same methods
over scenes of growing size, each in a process of its own with limits of time and memory. To add a
method, write a line into :mod:`cvxlimit.compare.registry`.
"""

from cvxlimit.compare.comparison import DEFAULT_MODELS, Comparison, compare
from cvxlimit.compare.models import Model
from cvxlimit.compare.registry import registry
from cvxlimit.solvers import settings_for

__all__ = [
    "DEFAULT_MODELS",
    "Comparison",
    "Model",
    "compare",
    "registry",
    "settings_for",
]
