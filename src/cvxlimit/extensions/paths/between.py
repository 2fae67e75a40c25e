"""A configuration at a displacement between two of a path."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from cvxlimit.base.arrays import ROUNDING
from cvxlimit.extensions.paths.configuration import Configuration
from cvxlimit.extensions.paths.following import Walk
from cvxlimit.extensions.paths.path import Path
from cvxlimit.extensions.paths.resting import REACH, At, Failed


def configuration_at(path: Path, displacement: float) -> Configuration:
    """Returns the configuration where ``path.displacement`` first reaches ``displacement``, solved
    for between two of the path. After a snap, and where iterates between do not settle or settle on
    what carries nothing between two that carry something, as may happen where joints slide, it is
    the second of these, which carries less."""
    after = int(np.flatnonzero(path.displacement >= displacement)[0])
    there = path[after]
    same = path.displacement[after] - displacement <= ROUNDING * path.start.contacts.typical_size
    if same or any(after == start for start, _ in path.pieces):
        return there
    size = path.start.contacts.typical_size
    walk = Walk(
        path.start, "all", REACH * size, lambda line: None, path.flow, path.stretch, path.motions
    )  # fmt: skip
    walk.resume(path)
    here, found = walk.found[after - 1], dict[float, At]()

    def beyond(w: float) -> float:
        settled = walk.settle(here, w)
        if isinstance(settled, Failed):
            raise ArithmeticError
        found[w] = settled
        return float(replace(path, configurations=(settled.shown,)).displacement[0] - displacement)

    w = displacement
    with suppress(ArithmeticError):
        if path.control is not None:
            w = float(brentq(beyond, here.shown.w, there.w, xtol=ROUNDING * size))
        if w not in found:
            beyond(w)
    if w not in found:
        return there
    shown = walk.proved(found[w]).shown
    lost = shown.load_factor < min(0.0, here.shown.load_factor, there.load_factor)
    return there if lost else shown
