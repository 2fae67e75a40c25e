"""Speed against accuracy: models side by side on one scene, errors against a reference, a chart.

Its door is ``cvxlimit.commands`` (``compare``); its public names are those of
:mod:`cvxlimit.compare`. To read: ``models.py``, a model and its row; ``registry.py``, those by
name; ``comparison.py``, the call; ``chart.py``; ``command.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.commands": {"compare": "cvxlimit.extensions.compare.command:CompareCommand"},
}
