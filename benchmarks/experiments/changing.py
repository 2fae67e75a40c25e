"""What a limit problem costs whose user changes a Parameter and solves it again, with its proof.

CPU milliseconds of the first solve, statement included, and of re-solves (medians), after changes
of 1 % of friction, 2 % contact by contact, 1 degree of a push, 1 % of a limit that binds; and of
calls of ``solve``, which may take a smaller model, on scenes with that friction. Of frozen problems
with other eccentricities: what setting the Parameters, patching and reading take beyond the solver
itself (the least of all steps).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from statistics import median
from time import perf_counter, process_time
from typing import Any

import cvxpy as cp
import numpy as np

from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.scenes import scene_of
from cvxlimit import LimitProblem, Scene, solve
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.pressure import Pressure
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Conic

KINDS = ("friction", "friction per contact", "direction of the push", "a limit of one's own")
FRICTION = 0.6
SCENES = ("tuff-wall", "s12-panel", "s10-panel")


@experiment(Part(2))
def changing(scenes: Sequence[str] = SCENES, repeat: int = 3, steps: int = 8) -> Lines:
    """What re-solves cost after a Parameter has changed, with their proofs."""
    yield Title("proved")
    yield Head("scene", "what changes", "first, ms", "re-solve, ms", "over first")
    for name in scenes:
        scene = scene_of(name)
        again, forces = 0.0, solve(scene, model="full").forces
        for kind in KINDS:
            first, after = resolved(partial(stated, scene, kind, forces), repeat, steps)
            again = again or after
            yield name, kind, *(f"{1e3 * t:.0f}" for t in (first, after)), f"{after / first:.2f}"
        called = median(called_anew(scene, i) for i in range(steps))
        anew = f"{1e3 * called:.0f}"
        yield name, "friction, by `solve` anew", anew, f"{1e3 * again:.0f}", f"{again / called:.2f}"
    yield Title("patched")
    yield Head("scene", "warm solve, ms", "all else, ms")
    for name in scenes:
        yield name, *(f"{1e3 * t:.1f}" for t in patched(scene_of(name), steps))


Stated = tuple[LimitProblem, cp.Parameter, Callable[[int], Any]]
"""A problem, its Parameter at a value, and the values that follow."""


def stated(scene: Scene, kind: str, forces: Any) -> Stated:
    """With limits that bind under the forces (n, 6) of a first solution."""
    rng, contacts = np.random.default_rng(0), len(scene.contacts)
    if kind == KINDS[0]:
        mu = cp.Parameter(value=FRICTION)
        return LimitProblem(scene, friction=mu), mu, lambda i: FRICTION * (1.0 + 0.01 * i)
    if kind == KINDS[1]:
        each = cp.Parameter(contacts, value=np.full(contacts, FRICTION))
        changed = FRICTION * (1.0 + 0.02 * rng.random((99, contacts)))
        return LimitProblem(scene, friction=each), each, lambda i: changed[i]
    if kind == KINDS[2]:
        push = cp.Parameter(3, value=[1.0, 0.0, 0.0])
        turns = np.deg2rad(np.arange(99))
        along = np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
        return LimitProblem(scene, live=push), push, lambda i: along[i]
    at = int(np.argsort(forces[:, 2])[3 * contacts // 4])
    cap, problem = 0.8 * float(forces[at, 2]), LimitProblem(scene)
    most = cp.Parameter(value=cap)
    problem.add("strut", problem.N[at] <= most)
    return problem, most, lambda i: cap * (1.0 - 0.01 * i)


def resolved(state: Callable[[], Stated], repeat: int, steps: int) -> tuple[float, float]:
    """Seconds of first solves and of re-solves."""
    first, after = [], []
    for _ in range(repeat):
        start = process_time()
        problem, parameter, values = state()
        problem.solve()
        first.append(process_time() - start)
        for i in range(1, steps + 1):
            parameter.value = values(i)
            start = process_time()
            problem.solve()
            after.append(process_time() - start)
    return median(first), median(after)


def called_anew(scene: Scene, step: int) -> float:
    """Seconds of a call on a scene whose contacts are known."""
    changed = scene.with_friction(FRICTION * (1.0 + 0.01 * step))
    start = process_time() if len(changed.contacts) else 0.0
    solve(changed)
    return process_time() - start


def patched(scene: Scene, steps: int) -> tuple[float, float]:
    """Seconds of a warm solve of a frozen problem, and of all else that a re-solve takes."""
    frozen = FrozenProblem(scene, Conic(), parse_moments("signed"))
    forces, rung = np.zeros((len(scene.contacts), 6)), settings_for("BLOCKWISE", 1e-6)
    solves, others = [], []
    for i in range(steps + 1):
        pressure = Pressure.of(forces, scene.contacts)
        start = perf_counter()
        state = frozen.solve(pressure, rung)
        if i:
            solves.append(state.outcome.solve_seconds)
            others.append(perf_counter() - start - solves[-1])
        assert state.forces is not None
        forces = 0.8 * forces + 0.2 * state.forces
    return min(solves), min(others)
