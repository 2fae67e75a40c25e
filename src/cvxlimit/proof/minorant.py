"""Lower bounds on weighted sums of contact forces that hold in every admissible state.

Let u be block rates (free blocks, 6), c weights (n, 6) of the contact forces x (n, 6), A the
equilibrium matrix ``Statics.matrix``, f_D and f_L the loads ``Statics.dead`` and ``Statics.live``.
If the flow rule allows the relative rates A' u + c, with dissipation R, then forces x that balance
f_D + alpha f_L and exceed no strength do at least -R of work on these rates. On the part A' u they
do -(f_D + alpha f_L) . u, so that, at every load factor alpha,

    c . x  >=  f_D . u - R + alpha f_L . u.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvxlimit.base.arrays import EPSILON, ROUNDING, FloatArray
from cvxlimit.proof.certificate import Certifier

_RAISE = 1e-7
"""Relative raise of the weights c where contacts hold each other, so that no block rates open all
of them: larger weights open the contacts that they belong to. The bound is divided by it again."""


class Minorant(NamedTuple):
    """The bound ``constant + slope * alpha - rounding * largest``, where ``largest`` is the largest
    ``abs(alpha)`` at which it is used."""

    constant: float
    slope: float
    rounding: float


def minorant(certifier: Certifier, weights: FloatArray, mechanism: FloatArray) -> Minorant | None:
    """Returns the bound for ``weights`` c (n, 6) that the rates u of ``mechanism`` (free blocks, 6)
    prove, or None if they prove none.

    Rates need not be exact: contacts that they open too little are opened, as in a mechanism.
    """
    if not np.isfinite(mechanism).all():
        return None
    size = np.abs(mechanism).max(axis=1)
    without_noise = np.where((size > ROUNDING * size.max(initial=0.0))[:, None], mechanism, 0.0)
    for rates, raised in ((mechanism, 0.0), (without_noise, _RAISE)):
        own = (1.0 + raised) * weights
        opened = certifier.opened(rates, (own, np.abs(own)))
        if opened.is_allowed:
            break
    else:
        return None
    statics, u = certifier.statics, opened.rates.ravel()
    constant, slope = float(statics.dead @ u) - opened.dissipation, float(statics.live @ u)
    lost = EPSILON * (float(np.abs(statics.dead) @ np.abs(u)) + abs(opened.dissipation))
    rounding = EPSILON * float(np.abs(statics.live) @ np.abs(u))
    return Minorant(*((part / (1.0 + raised)) for part in (constant - lost, slope, rounding)))
