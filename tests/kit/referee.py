"""A limit problem written anew in CVXPY, contact by contact, to compare with: with reactions, ties,
limits of one's own, and resistances that are larger by so much."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import cvxpy as cp
import numpy as np

from cvxlimit import Reaction, Scene
from helpers import corners_in_plane, hand_equilibrium, hand_torsion_arm

ROUNDING = 3e-6
"""Relative error of the referee's optima: asked for 1e-10, its forces on one wall exceed strength
by 3e-8 of the weight in many contacts, which comes to 1.2e-6 of the load factor in all."""

Own = Callable[[Any, Any], list[Any]]
"""Limits, of contact forces (n, 6) and load factor as CVXPY expressions."""


class Verdict(NamedTuple):
    """CVXPY's status, and the optimum in the user's units, None without one."""

    status: str
    value: float | None

    @property
    def optimum(self) -> float:
        assert self.value is not None, self.status
        return self.value


def referee(
    scene: Scene,
    limits: Own | None = None,
    aim: Callable[[Any, Any], Any] | None = None,
    more: Mapping[tuple[str, int], Any] | None = None,
) -> Verdict:
    """The largest load factor, or aim. ``more`` is how much more a contact resists, in the user's
    units: by ``("rocking", j)`` every corner pulls so much, or each; ``("torsion-shear", j)`` is
    cohesion.
    """
    matrix, dead, live = hand_equilibrium(scene)
    x, alpha = cp.Variable(matrix.shape[1]), cp.Variable()
    unit, more = float(np.abs(dead).sum()), more or {}
    stated = [matrix @ x + dead / unit + alpha * (live / unit) == 0]
    contacts = scene.contacts
    for j, contact in enumerate(contacts):
        v1, v2, n, m1, m2, mt = (x[6 * j + k] for k in range(6))
        if contacts.is_point[j]:
            stated += [x[6 * j + k] == 0 for k in (0, 1, 3, 4, 5)]
            size = contacts.sense[j] * n
            stated.append(size >= contacts.least[j] / unit)
            if np.isfinite(contacts.most[j]):
                stated.append(size <= contacts.most[j] / unit)
            continue
        corners = corners_in_plane(contact)
        press = cp.Variable(len(corners))
        stated.append(press >= -more.get(("rocking", j), 0.0) / unit)
        stated += [n == cp.sum(press), m1 == press @ corners[:, 1], m2 == -press @ corners[:, 0]]
        shear = cp.norm(cp.hstack([v1, v2])) + cp.abs(mt) / hand_torsion_arm(contact)
        extra = more.get(("torsion-shear", j), 0.0) / unit
        stated.append(shear <= contact.friction * n + extra)
    users = unit * cp.reshape(x, (len(contacts), 6), order="C")
    stated += [] if limits is None else limits(users, alpha)
    goal = alpha if aim is None else aim(users, alpha)
    problem = cp.Problem(cp.Maximize(goal), stated)
    for tolerance in (1e-10, 1e-9, 1e-8):
        tight = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what is inaccurate: the comparison tells
            problem.solve(solver=cp.CLARABEL, **tight)
        if problem.status in (cp.OPTIMAL, cp.INFEASIBLE, cp.UNBOUNDED):
            break
    value = None if goal.value is None else float(goal.value)
    return Verdict(problem.status, value)


def with_random_reactions(scene: Scene, seed: int, is_planar: bool) -> Scene:
    """Some of the free blocks pushed, pulled or held: from the ground or from each other, by forces
    of the size of a block's weight."""
    rng = np.random.default_rng(seed)
    free = [scene.blocks[i] for i in scene.free]
    weight = scene.total_weight / len(free)
    chosen: list[Reaction] = []
    for _ in range(rng.integers(1, 7)):
        block, other = (free[k] for k in rng.choice(len(free), 2, replace=len(free) < 2))
        at = block.centroid + rng.uniform(-0.4, 0.4, 3) * np.ptp(block.vertices, axis=0)
        way = rng.normal(size=3)
        if is_planar:  # in the plane of the wall
            at[1], way[1] = block.centroid[1], 0.0
        most = weight * float(rng.choice([0.1, 1.0, 5.0, np.inf], p=[0.3, 0.4, 0.2, 0.1]))
        low = rng.choice([0.0, 0.2, -1.0], p=[0.6, 0.2, 0.2])
        least = float(low * min(most, weight))
        on = other.id if rng.uniform() < 0.3 and other is not block else None
        chosen.append(Reaction(block.id, tuple(at), tuple(way), most, least, on))
    return replace(scene, reactions=tuple(chosen))
