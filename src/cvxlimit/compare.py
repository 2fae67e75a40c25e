"""Speed against accuracy: models side by side on one scene, errors against a reference, a chart."""

from cvxlimit.extensions import studies as _extension  # noqa: F401 - which is told if missing
from cvxlimit.extensions.studies.comparison import DEFAULT_MODELS, Comparison, compare
from cvxlimit.extensions.studies.models import Model
from cvxlimit.solvers import settings_for

__all__ = ["DEFAULT_MODELS", "Comparison", "Model", "compare", "settings_for"]
