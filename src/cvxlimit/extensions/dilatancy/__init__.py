"""Friction that slides without opening: solutions, bounds, what associated answers owe to it.

Its doors are ``cvxlimit.methods`` (``zero-dilatancy``, ``gilbert``), ``cvxlimit.readings`` (what is
known of loads without a limit, what least thrusts prove) and ``cvxlimit.checks``. To read:
``tresca.py``, friction held at its size; ``pair.py``, one solution; ``members.py``, what proves it;
``zero_dilatancy.py``, the search for the lowest; ``agreement.py``, of several searches;
``least_thrust.py``, bounds from below; ``unbounded.py``; ``gilbert.py``; ``proving.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.methods": {
        "zero-dilatancy": "cvxlimit.extensions.dilatancy.zero_dilatancy:ZeroDilatancy",
        "gilbert": "cvxlimit.extensions.dilatancy.gilbert:Gilbert",
    },
    "cvxlimit.checks": {
        "zero-dilatancy": "cvxlimit.extensions.dilatancy.proving:checks",
        "gilbert": "cvxlimit.extensions.dilatancy.proving:checks",
    },
    "cvxlimit.readings": {
        "above_thrusts": "cvxlimit.extensions.dilatancy.proving:above_thrusts",
        "without_dilatancy": "cvxlimit.extensions.dilatancy.unbounded:without_dilatancy",
    },
}
