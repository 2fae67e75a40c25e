"""From rest to collapse: rigid blocks on elastic joints, pushed until the load rises no more.

Its doors are ``cvxlimit.methods`` (``incremental``), ``cvxlimit.checks``, ``cvxlimit.pictures``
(``curve``, ``onset``, ``bedding``) and ``cvxlimit.readings`` (the problem of a step). To read:
``placing.py``, where joints bear; ``joints.py``, what they answer to a motion; ``engine.py``, one
state after another; ``ascent.py``, the way and how it ends; ``incremental.py``, the method;
``stating.py``, one step in CVXPY; ``proving.py``, what can be proved again; ``pictures.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.checks": {"incremental": "cvxlimit.extensions.incremental.proving:checks"},
    "cvxlimit.methods": {
        "incremental": "cvxlimit.extensions.incremental.incremental:Incremental",
    },
    "cvxlimit.pictures": {
        "bedding": "cvxlimit.extensions.incremental.pictures:bedding",
        "curve": "cvxlimit.extensions.incremental.pictures:curve",
        "onset": "cvxlimit.extensions.incremental.pictures:onset",
    },
    "cvxlimit.readings": {
        "step_problem": "cvxlimit.extensions.incremental.stating:step_of",
    },
}
