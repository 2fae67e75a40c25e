"""Torsion-shear-bending interaction (Eq. 26-32), proved from below and from above.

Its doors are ``cvxlimit.methods`` (``certified``) and ``cvxlimit.checks``. How Eq. 30 is read is in
:mod:`cvxlimit.readings`. To read, each folder seeing those before it:

- ``states``: what one contact carries under a reading;
- ``relaxation``, ``restriction``, ``branching``: bounds from above, from below, and both closed;
- ``certified.py``: the method that calls them all.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.checks": {"certified": "cvxlimit.extensions.interaction.proving:checks"},
    "cvxlimit.methods": {"certified": "cvxlimit.extensions.interaction.certified:Certified"},
}
