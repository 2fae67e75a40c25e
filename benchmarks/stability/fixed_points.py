"""The paper's fixed point on families of scenes: how it ends."""

from __future__ import annotations

import time
from itertools import product

import numpy as np

from benchmarks.rows import Row, Rows
from benchmarks.stability.families import key_of, sample
from cvxlimit.errors import CvxlimitError
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.methods.solving import solve

WEIGHTS = (0.0, 0.2, 0.5, 0.8, 0.95)
"""Old-value weights of the fixed point's map; the paper's is 0.8."""

READINGS = ("independent", "signed", "paper")

SETTLING = ("walls", "panels", "stacks", "blocks", "slivers", "densities", "few-loads", "sizes",
            "arches", "domes", "rocks", "frictions")  # fmt: skip
"""Families of the fixed point's map: those in which bending, shear and torsion meet."""


def ask_fixed_point(kept: Rows, number: int, scale: int, first: int = 0) -> None:
    """The paper's iteration at every weight and reading: how it ends, and where it went."""
    seeds = range(first, first + max(1, number // len(SETTLING)))
    for seed, family, moments, weight in product(seeds, SETTLING, READINGS, WEIGHTS):
        key = {"key": f"{key_of(family, seed, scale)}/{moments}/{weight}"}
        if key not in kept:
            kept.add({**key, **_iterated(family, seed, scale, moments, weight)})


def _iterated(family: str, seed: int, scale: int, moments: str, weight: float) -> Row:
    about: Row = {"family": family, "seed": seed, "moments": moments, "weight": weight}
    made = sample(family, seed, scale)
    start = time.process_time()
    try:
        solution = solve(made.scene, method=FixedPoint(weight), moments=moments)
    except CvxlimitError as error:
        return {**about, "ending": "refused", "why": str(error)}
    factors = [h.load_factor for h in solution.history]
    return {
        **about,
        "ending": solution.status,
        "period": period(factors) if solution.status == "cycling" else None,
        "iterations": len(factors),
        "factors": [f for f in factors if f is not None][-12:],
        "first": factors[0] if factors else None,
        "seconds": time.process_time() - start,
    }


def period(factors: list[float | None]) -> int | None:
    """The shortest number of iterates after which the last ones repeat.

    >>> period([0.5, 0.1, 0.3, 0.1, 0.3, 0.1, 0.3])
    2
    """
    for lap in range(2, 9):
        tail = [f for f in factors[-2 * lap :] if f is not None]
        if len(tail) == 2 * lap and np.allclose(tail[:lap], tail[lap:], rtol=2e-4):
            return lap
    return None
