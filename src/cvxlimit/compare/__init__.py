"""Speed against accuracy: methods side by side on one scene, errors against a reference, a chart.

To add a method, write a line into :mod:`cvxlimit.compare.registry`.
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
