"""What a family makes: a scene, and what is known about its answer from elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cvxlimit.scene import Scene

FALLS, HARMLESS = "falls", "harmless"
"""Answers that are no number: the dead load alone cannot stand; the live load does no harm."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A scene of a family.

    Attributes
    ----------
    scene : Scene
    truth : float, str or None
        Load factor in closed form (associated flow, no interaction), :data:`FALLS`,
        :data:`HARMLESS`, or None where no closed form is known. Statically determinate scenes
        need none here: :func:`benchmarks.stability.truths.closed_form` finds it.
    knob : str
        What makes this one hard, in a few words: ``"contrast 1e+06"``.
    """

    scene: Scene
    truth: float | str | None = None
    knob: str = ""


@dataclass(frozen=True)
class Family:
    """A family: a short name, what is hard about it, and how a scene of it is made."""

    name: str
    what: str
    build: Callable[[np.random.Generator, int], Sample]


def direction(rng: np.random.Generator) -> tuple[float, float, float]:
    """Any direction of space, each as likely as the next."""
    vector = rng.normal(size=3)
    x, y, z = (vector / np.linalg.norm(vector)).tolist()
    return x, y, z


def spread(rng: np.random.Generator, low: float, high: float) -> float:
    """A number between ``low`` and ``high``, every power of ten as likely as the next."""
    return float(10.0 ** rng.uniform(np.log10(low), np.log10(high)))
