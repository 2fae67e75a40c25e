"""Reference load factors: brackets that are proved, and narrow enough to measure errors against."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from cvxlimit.compare.models import Measurement, Method
from cvxlimit.methods.solving import solve
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import default_ladder, settings_for

WIDTH = 1e-8
"""Relative width that a reference without interaction must have."""

_AIM = 1e-9
"""Relative width at which the search for a narrower bracket stops."""


@dataclass(frozen=True)
class Reference(Method):
    """The bracket against which others are measured: cone, no interaction or the certified one."""

    name: str = "reference"
    line: str = "reference"
    interaction: str = "none"
    moments: str = "independent"

    def measure(self, scene: Scene) -> Measurement:
        """The best bracket; ``load_factor`` is its middle."""
        start = time.perf_counter()
        if self.interaction == "none":
            found = _narrowest(scene)
            status = _in_words(found)
        else:
            found = solve(scene, interaction="certified", moments=self.moments)
            status = str(found.status)
        finite = bool(np.isfinite([found.lower, found.upper]).all())
        return Measurement(
            status,
            0.5 * (found.lower + found.upper) if finite else None,
            found.lower,
            found.upper,
            {},
            time.perf_counter() - start,
            len(scene.contacts),
        )


def _narrowest(scene: Scene) -> Solution:
    """Two exact solvers, each as far as rounding lets it go; all others only if they fall short."""
    first, *others = default_ladder()
    found = solve(scene, tolerance=_AIM, ladder=(first, settings_for("BLOCKWISE", 1e-14)))
    if found.gap <= WIDTH or not found.status.has_answer:
        return found
    more = solve(scene, tolerance=WIDTH, ladder=others)
    return min(found, more, key=lambda solution: solution.gap)


def _in_words(found: Solution) -> str:
    """The width; "bracketed" if a bound rests on an assumption (see Certifier)."""
    return f"{'proved' if found.is_proved else 'bracketed'} to {found.gap:.1e}"
