"""Friction that slides without opening: solutions, bounds, what associated answers owe to it.

Its doors are ``cvxlimit.methods`` (``zero-dilatancy``), ``cvxlimit.readings`` (where joints slide
under loads without a limit) and ``cvxlimit.checks``. Friction held at its size is the core's
(``proof/tresca.py``), and so are bounds from below (``methods/least_thrust.py``). To read:
``pair.py``, the two convex problems; ``members.py``, the check of a solution; ``descent.py``, how
one is found; ``zero_dilatancy.py``, the search for the lowest; ``remarks.py``, what is said of
them; ``unbounded.py``; ``proving.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.methods": {
        "zero-dilatancy": "cvxlimit.extensions.dilatancy.zero_dilatancy:ZeroDilatancy",
    },
    "cvxlimit.checks": {
        "zero-dilatancy": "cvxlimit.extensions.dilatancy.proving:checks",
        "slides": "cvxlimit.extensions.dilatancy.proving:slides",
    },
    "cvxlimit.readings": {
        "slides_without_dilatancy": (
            "cvxlimit.extensions.dilatancy.unbounded:slides_without_dilatancy"
        ),
    },
}
