"""Friction that slides without opening: solutions, bounds, what associated answers owe to it.

Its doors are ``cvxlimit.methods`` (``zero-dilatancy``), ``cvxlimit.readings`` (what is
known of loads without a limit, what least thrusts prove) and ``cvxlimit.checks``. To read:
``tresca.py``, friction held at its size; ``pair.py``, the two convex problems; ``members.py``, the
check of a solution; ``descent.py``, how one is found; ``zero_dilatancy.py``, the search for the
lowest; ``agreement.py``, what is said of them; ``least_thrust.py``, bounds from below;
``unbounded.py``; ``proving.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.methods": {
        "zero-dilatancy": "cvxlimit.extensions.dilatancy.zero_dilatancy:ZeroDilatancy",
    },
    "cvxlimit.checks": {
        "zero-dilatancy": "cvxlimit.extensions.dilatancy.proving:checks",
    },
    "cvxlimit.readings": {
        "above_thrusts": "cvxlimit.extensions.dilatancy.proving:above_thrusts",
        "without_dilatancy": "cvxlimit.extensions.dilatancy.unbounded:without_dilatancy",
    },
}
