"""Scenes whose dead load cannot stand, how that is proved by hand, and rungs good and bad."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cvxlimit import Block, Load, Scene, Solution, Status
from cvxlimit.masonry import arch, single_block, stack
from cvxlimit.solvers import SolverSettings, default_ladder
from helpers import missing_opening

GOOD = default_ladder()[0]


STOPPED = SolverSettings("CLARABEL", {"max_iter": 2}, "stopped")


UNKNOWN = SolverSettings("NO_SUCH_SOLVER", label="unknown")


def assert_falls(solution: Solution, scene: Scene) -> None:
    """A mechanism on which the dead load alone works, allowed by the flow rule at every contact.

    1e-6 of the largest rate against a dead load that does work of that order: far from rounding.
    """
    assert solution.status is Status.DEAD_LOAD_UNSTABLE, solution
    assert (solution.load_factor, solution.lower, solution.upper) == (None, -np.inf, np.inf)
    assert "falls" in solution.note
    assert solution.mechanism is not None
    u = np.array([solution.mechanism[scene.blocks[i].id] for i in scene.free])
    power = (u * scene.dead_forces).sum()
    assert power > 0.0
    short = max(0.0, missing_opening(scene, u).max())
    assert short <= 1e-6 * np.abs(u).max()
    # No forces of the size of the load do enough work on what is missing to make up for it.
    assert short * np.abs(scene.dead_forces).sum() * len(scene.contacts) < 0.5 * power


def incline(slope: float, friction: float) -> Scene:
    """A flat block on a plane that rises at ``slope`` degrees along x; gravity along -z."""
    t = np.radians(slope)
    turn = np.array([[np.cos(t), 0, -np.sin(t)], [0, 1, 0], [np.sin(t), 0, np.cos(t)]])
    scene = single_block((1.0, 1.0, 0.1), friction=friction).moved(turn)
    return scene.with_dead(Load(gravity=(0, 0, -1))).with_live(Load(acceleration=(0, 1, 0)))


def floating_pair() -> Scene:
    """Two blocks on each other touch no support; a third one stands on the ground."""
    blocks = (
        Block.box("ground", (-9, -9, -1), (9, 9, 0)),
        Block.box("standing", (0, 0, 0), (1, 1, 1), 20.0),
        Block.box("low", (5, 5, 3), (6, 6, 4), 20.0),
        Block.box("high", (5, 5, 4), (6, 6, 5), 20.0),
    )
    return Scene(blocks, ("ground",), Load(acceleration=(1, 0, 0)))


def hung_from_above() -> Scene:
    blocks = (
        Block.box("ceiling", (-1, -1, 1), (2, 2, 2)),
        Block.box("b", (0, 0, 0), (1, 1, 1), 20.0),
    )
    return Scene(blocks, ("ceiling",), Load(acceleration=(1, 0, 0)))


FALLING: dict[str, Callable[[], Scene]] = {
    "overhang": lambda: stack(2, (1, 1, 0.3), shift=(0.6, 0.0)),
    "leaning stack": lambda: stack(6, (1, 1, 0.2), shift=(0.3, 0.1)),
    "steep incline": lambda: incline(32.0, 0.6),  # arctan 0.6 is 30.96 degrees
    "icy incline": lambda: incline(1.0, 0.0),
    "floating pair": floating_pair,
    "hung from above": hung_from_above,
    "arch too thin": lambda: arch(40, 0.10, friction=10.0),
    "arch that slides": lambda: arch(20, 0.3, friction=0.1),
    "dead load upwards": lambda: single_block().with_dead(Load(gravity=(0, 0, 1))),
    "dead load sideways": lambda: single_block(friction=0.5).with_dead(
        Load(acceleration=(0.6, 0, -1.0))
    ),
}
