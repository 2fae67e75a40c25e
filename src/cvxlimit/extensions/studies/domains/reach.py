"""The goal of a problem with several live loads: the farthest that they reach in a direction."""

from __future__ import annotations

from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.formulations import times
from cvxlimit.model.statement import Stated
from cvxlimit.model.statics import DOF


class Reach:
    """Objective: the largest sum of weighted load factors within a window.

    ``dead`` is the share of the dead load that acts; None lets the problem take any, and asks for
    the largest.
    """

    def __init__(self, loads: FloatArray, dead: float | None) -> None:
        self.loads, self.dead = loads, dead
        self.weights = cp.Parameter(loads.shape[1], value=np.zeros(loads.shape[1]))
        self.window = cp.Parameter(nonneg=True, value=1.0)

    def __call__(self, stated: Stated) -> Any:
        into, scaling = stated.into, stated.assemblage.scaling
        units = scaling.force * np.tile([1.0] * 3 + [scaling.length] * 3, len(self.loads) // DOF)
        factors = stated.own["factors"] = into.new(self.loads.shape[1], "load factors")
        live, dead = (self.loads / units[:, None]) @ factors, stated.dead
        stated.live = np.zeros(len(units))
        for sign in (-1.0, 1.0):
            into.nonneg(sign * factors + self.window)
        if self.dead is None:
            share = into.new(name="share", nonneg=True)
            into.nonneg(1.0 - share)
            into.zero(stated.factor - share)
            stated.dead = live + times(dead, share)
            return share
        into.zero(stated.factor)
        stated.dead = live + self.dead * dead
        return np.ones(factors.size) @ times(self.weights, factors)
