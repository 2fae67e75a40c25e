"""A solver of this package for cones that fall apart into small blocks.

It leads on all but small problems, and starts warm; without it the best solver that is installed
leads, and takes 1.6 to 3.6 times as long. Its door is ``cvxlimit.solvers``. To read:
``interior.c``, which does all of it; ``interior.py``, its call; ``own.py``, CVXPY's interface and
its row.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.solvers": {"BLOCKWISE": "cvxlimit.extensions.blockcone.own:ROW"},
}
