"""Motion in time under a ground acceleration, by MuJoCo (extra ``dynamics``).

Its doors are ``cvxlimit.commands`` (``shake``), ``cvxlimit.writers`` (``.mjcf``) and
``cvxlimit.readings``. To read: ``record.py``, the acceleration; ``convex.py``, blocks in convex
pieces; ``mjcf.py``, the scene as MuJoCo takes it; ``history.py``, one run; ``shaking.py``, the call
and how its runs end; ``pictures.py`` and ``command.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.commands": {"shake": "cvxlimit.extensions.dynamics.command:ShakeCommand"},
    "cvxlimit.writers": {".mjcf": "cvxlimit.extensions.dynamics.mjcf:written"},
    "cvxlimit.readings": {
        "shaking_plot": "cvxlimit.extensions.dynamics.pictures:draw_shaking",
    },
}
