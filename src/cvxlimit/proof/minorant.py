"""What every admissible state bears at least: bounds of forces that are linear in the load factor.

For block rates u and weights c of contact forces let A' u + c be rates that the flow rule allows,
with dissipation R. Forces x that balance f_D + alpha f_L and exceed no strength do at least -R of
work on them, and -(f_D + alpha f_L) . u on A' u, so that

    c . x  >=  f_D . u - R + alpha f_L . u      at every load factor alpha.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvxlimit.base.arrays import EPSILON, ROUNDING, FloatArray
from cvxlimit.proof.certificate import Certifier

_MORE = 1e-7
"""What a bound may cost where contacts hold each other, so that no rates open all of them: its
weights c are raised by so much, which opens those contacts that they are of."""


class Minorant(NamedTuple):
    """A bound from below, ``constant + slope * alpha``, less ``rounding`` times the largest of
    ``abs(alpha)``."""

    constant: float
    slope: float
    rounding: float = 0.0


def minorant(certifier: Certifier, weights: FloatArray, mechanism: FloatArray) -> Minorant | None:
    """Proved for ``weights`` (n, 6) of contact forces by rates (free blocks, 6), or None.

    Rates need not be exact: those that open contacts too little are opened, as mechanisms are.
    """
    if not np.isfinite(mechanism).all():
        return None
    size = np.abs(mechanism).max(axis=1)
    still = np.where((size > ROUNDING * size.max(initial=0.0))[:, None], mechanism, 0.0)
    for rates, more in ((mechanism, 0.0), (still, _MORE)):
        own = (1.0 + more) * weights
        opened = certifier.opened(rates, (own, np.abs(own)))
        if opened.is_allowed:
            break
    else:
        return None
    statics, u = certifier.statics, opened.rates.ravel()
    constant, slope = float(statics.dead @ u) - opened.dissipation, float(statics.live @ u)
    lost = EPSILON * (float(np.abs(statics.dead) @ np.abs(u)) + abs(opened.dissipation))
    rounding = EPSILON * float(np.abs(statics.live) @ np.abs(u))
    return Minorant(*((part / (1.0 + more)) for part in (constant - lost, slope, rounding)))
