"""Random limits of one's own, on scenes with reactions and ties, that some forces satisfy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import cvxpy as cp
import numpy as np

from cvxlimit import LimitProblem, Scene, Status, Tie, solve
from cvxlimit.masonry import random_wall
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LARGEST_FACTOR, Stated
from referee import with_random_reactions


def at_rest(stated: Stated) -> Any:
    """Nothing, under the dead load alone."""
    stated.into.zero(stated.factor)
    return 0.0 * stated.factor


class Drawn(NamedTuple):
    """A limit by name, as constraints of forces (n, 6) and load factor."""

    name: str
    stated: Callable[[Any, Any], list[Any]]


KINDS = ("linear", "quadratic", "norm", "abs", "max", "equation", "factor", "given factor", "share")


def scene_of(seed: int) -> tuple[Scene, np.ndarray, float]:
    """A random wall that collapses, a third with reactions, a third with ties, and how."""
    for number in range(1000 * seed, 1000 * seed + 50):
        scene = random_wall(number, sizes=[(2, 2), (2, 3), (3, 3)])
        if number % 3 == 1:
            scene = with_random_reactions(scene, number, is_planar=False)
        if number % 3 == 2:
            scene = with_tie(scene, number)
        if solve(scene).status is not Status.CERTIFIED:  # a solver's "optimal" proves nothing
            continue
        rest, found = (LimitProgram(scene, goal=goal).run() for goal in (at_rest, LARGEST_FACTOR))
        is_solved = rest.outcome.status == found.outcome.status == "optimal"
        if is_solved and found.forces is not None and 1e-3 < (found.load_factor or 0.0) < 1e3:
            assert found.load_factor is not None
            return scene, found.forces, found.load_factor
    raise AssertionError


def with_tie(scene: Scene, seed: int) -> Scene:
    """Held by a tie from a free block to the ground beside it."""
    rng = np.random.default_rng(seed)
    block = scene.blocks[int(rng.choice(scene.free))]
    support = next(b for b in scene.blocks if b.id in scene.supports)
    far = block.centroid + rng.normal(size=3) * [1.0, 1.0, 0.3] * 2.0
    force = float(rng.uniform(0.1, 1.0)) * scene.total_weight / len(scene.free)
    tie = Tie(block.id, support.id, tuple(block.centroid), tuple(far), force)
    return replace(scene, ties=(tie,))


def between(scene: Scene, forces: np.ndarray, factor: float, rng: Any) -> tuple[np.ndarray, float]:
    """A state that is carried, somewhere between rest and collapse: what limits must leave."""
    calm = LimitProgram(scene, goal=at_rest).run().forces
    assert calm is not None
    share = float(rng.uniform(0.2, 0.9))
    return calm + share * (forces - calm), share * factor


def drawn(
    kind: str, rng: Any, inside: tuple[np.ndarray, float], collapse: tuple[np.ndarray, float],
) -> Drawn:  # fmt: skip
    """A limit that the state ``inside`` keeps, with room unless it is an equation, and that the
    ``collapse`` breaks as a rule."""
    (x0, a0), (x1, a1) = inside, collapse
    count = len(x0)
    weight = np.zeros((count, 6))
    at = rng.choice(count, size=min(count, int(rng.integers(1, 4))), replace=False)
    weight[at, :3] = rng.normal(size=(len(at), 3))
    if (weight * (x1 - x0)).sum() < 0.0:
        weight = -weight
    size = np.abs(x0).max()
    weight /= max(np.abs(weight).max(), 1e-12)
    share = float(rng.uniform(0.1, 0.6))

    def total(x: Any) -> Any:
        return cp.sum(cp.multiply(weight, x)) / size

    of0, of1 = (float((weight * x).sum()) / size for x in (x0, x1))
    right = of0 + share * max(of1 - of0, 0.02)
    if kind == "linear":
        return Drawn(kind, lambda x, a: [total(x) <= right])
    if kind == "share":
        return Drawn(
            kind, lambda x, a: [total(x) + a / a1 <= right + (a0 + share * (a1 - a0)) / a1]
        )
    if kind == "factor":
        return Drawn(kind, lambda x, a: [a <= a0 + share * (a1 - a0)])
    if kind == "given factor":
        return Drawn(kind, lambda x, a: [a == a0])
    if kind == "equation":
        return Drawn(kind, lambda x, a: [total(x) == of0])
    if kind == "abs":
        return Drawn(kind, lambda x, a: [cp.abs(total(x) - of0) <= right - of0])
    rows = at[:2]
    some0, some1 = (x[rows, :3].ravel() / size for x in (x0, x1))

    def some(x: Any) -> Any:
        return cp.hstack([x[int(j), k] for j in rows for k in range(3)]) / size

    if kind == "max":
        top = some0.max() + share * max(some1.max() - some0.max(), 0.02)
        return Drawn(kind, lambda x, a: [cp.max(some(x)) <= top])
    about = some0 * float(rng.uniform(0.5, 1.0))
    if kind == "norm":
        least = np.linalg.norm(some0 - about)
        most = least + share * max(np.linalg.norm(some1 - about) - least, 0.02)
        return Drawn(kind, lambda x, a: [cp.norm(some(x) - about) <= most])
    least = ((some0 - about) ** 2).sum()
    most = least + share * max(((some1 - about) ** 2).sum() - least, 0.02)
    return Drawn(kind, lambda x, a: [cp.sum_squares(some(x) - about) <= most])


def forces_of(problem: LimitProblem) -> Any:
    """All forces (n, 6) of a problem."""
    names = ("V1", "V2", "N", "M1", "M2", "MT")
    return cp.vstack([getattr(problem, name) for name in names]).T


def case(seed: int) -> tuple[Scene, list[Drawn], float]:
    """A scene with one to three limits that can hold together, and its load factor without."""
    rng = np.random.default_rng(seed)
    scene, forces, factor = scene_of(seed)
    inside = between(scene, forces, factor, rng)
    kinds = [KINDS[seed % len(KINDS)], *rng.choice(KINDS, size=int(rng.integers(0, 3)))]
    return scene, [drawn(kind, rng, inside, (forces, factor)) for kind in kinds], factor
