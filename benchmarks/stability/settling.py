"""The paper's fixed point: how it ends, and how far apart with other orders and solvers."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from benchmarks.stability.asking import Tell, key_of
from benchmarks.stability.families import sample
from benchmarks.stability.records import Record, Table
from cvxlimit.errors import CvxlimitError
from cvxlimit.masonry import builtin_scene
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.methods.solving import solve
from cvxlimit.scene import Scene

WEIGHTS = (0.0, 0.2, 0.5, 0.8, 0.95)
"""Old-value weights of the fixed point's map; the paper's is 0.8."""

READINGS = ("independent", "signed", "paper")

SETTLING = ("walls", "panels", "stacks", "blocks", "slivers", "densities", "few-loads", "sizes",
            "arches", "domes", "rocks", "frictions")  # fmt: skip
"""Families of the fixed point's map: those in which bending, shear and torsion meet."""

CHOICES = {
    "as in the paper": FixedPoint(),
    "epsilon": FixedPoint(epsilon=1e-2),
    "least norm": FixedPoint(regularisation=1e-3),
    "both": FixedPoint(epsilon=1e-2, regularisation=1e-3),
}
"""Which forces the next eccentricities are made of: those that rounding picks, or those of least
norm; and whether contacts that carry next to nothing count as pressed at their centres."""

SPREAD = ("tuff-wall", "walls", "panels", "few-loads", "densities", "s12-panel")
"""Scenes of the study of orders: built-in ones once, the others from families."""

ORDERS, SOLVERS = 3, ("CLARABEL", "QOCO")

LARGE = 200
"""Contacts from which two orders, one solver and the signed reading have to do."""


def ask_fixed_point(number: int, scale: int, tell: Tell, first: int = 0) -> None:
    """The paper's iteration at every weight and reading: how it ends, and where it went."""
    with Table("fixed-point") as table:
        for seed in range(first, first + max(1, number // len(SETTLING))):
            for family in SETTLING:
                tell(f"{family} {seed}")
                for moments in READINGS:
                    for weight in WEIGHTS:
                        key = f"{key_of(family, seed, scale)}/{moments}/{weight}"
                        if key not in table:
                            record = _iterated(family, seed, scale, moments, weight)
                            table.add(key, record)


def _iterated(family: str, seed: int, scale: int, moments: str, weight: float) -> Record:
    about: Record = {"family": family, "seed": seed, "moments": moments, "weight": weight}
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


def ask_orders(number: int, scale: int, tell: Tell, first: int = 0) -> None:
    """The paper's iteration with blocks in other orders, other solvers and a choice of forces."""
    with Table("orders") as table:
        for k in range(number):
            later, place = divmod(k, len(SPREAD))
            seed = first + later
            name = SPREAD[place]
            is_builtin = name.count("-") and name not in SETTLING
            if is_builtin and later:
                continue
            scene = builtin_scene(name) if is_builtin else sample(name, seed, scale).scene
            is_large = len(scene.contacts) > LARGE
            for moments in ("signed",) if is_large else ("signed", "paper"):
                for order in range(2 if is_large else ORDERS):
                    shown = name if is_builtin else f"{name} {seed}"
                    _ask_orders(table, tell, shown, shuffled(scene, order), moments, order)


def _ask_orders(
    table: Table, tell: Tell, name: str, scene: Scene, moments: str, order: int
) -> None:
    for choice in CHOICES:
        for solver in SOLVERS[:1] if len(scene.contacts) > LARGE else SOLVERS:
            key = f"{name}/{moments}/{choice}/{order}/{solver}"
            if key not in table:
                tell(key)
                about = {"scene": name, "moments": moments, "choice": choice, "order": order,
                         "solver": solver}  # fmt: skip
                table.add(key, {**about, **_reordered(scene, moments, choice, solver)})


def _reordered(scene: Scene, moments: str, choice: str, solver: str) -> Record:
    start = time.process_time()
    try:
        found = solve(scene, method=CHOICES[choice], moments=moments, ladder=[solver])
        plain = solve(scene, ladder=[solver])
    except CvxlimitError as error:
        return {"ending": "refused", "why": str(error)}
    return {"ending": found.status, "load_factor": found.load_factor, "plain": plain.load_factor,
            "iterations": len(found.history), "contacts": found.contacts,
            "seconds": time.process_time() - start}  # fmt: skip


def shuffled(scene: Scene, order: int) -> Scene:
    """The same scene with its blocks in another order; order 0 is as it was."""
    if order == 0:
        return scene
    places = np.random.default_rng(order).permutation(len(scene.blocks))
    return replace(scene, blocks=tuple(scene.blocks[i] for i in places))
