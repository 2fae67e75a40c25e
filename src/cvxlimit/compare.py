"""Speed against accuracy: methods side by side on one scene, errors against a reference, a chart.

To add a method, write a line into :mod:`cvxlimit.extensions.compare.registry`.
"""

from cvxlimit.extensions.compare.comparison import DEFAULT_MODELS, Comparison, compare
from cvxlimit.extensions.compare.models import Model
from cvxlimit.extensions.compare.registry import registry
from cvxlimit.solvers import settings_for

__all__ = [
    "DEFAULT_MODELS",
    "Comparison",
    "Model",
    "compare",
    "registry",
    "settings_for",
]
