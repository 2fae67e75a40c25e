"""The pair of problems with gaps and slips: closed forms, and virtual work by hand."""

from __future__ import annotations

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene
from cvxlimit.errors import ModelError
from cvxlimit.masonry import running_bond, single_block, wall
from cvxlimit.methods.dilatancy.displaced import increment
from helpers import hand_equilibrium

SQUAT = single_block((1.0, 1.0, 0.5), friction=0.6)
LIVE = float(np.abs(SQUAT.live_forces).sum())


@pytest.mark.parametrize("tau", [0.0, 0.2])
def test_a_block_slides_on_without_opening(tau: float) -> None:
    """Its way is the work over the load, whatever it slid before; all of the load is friction."""
    along = np.sign(SQUAT.live_forces[0, 0]) * SQUAT.contacts[0].t1[0]
    slip = np.tile([along * tau, SQUAT.contacts[0].t2[0] * tau], (4, 1))
    found = increment(SQUAT, 0.1 * LIVE, np.zeros(4), slip)
    assert found.load_factor == pytest.approx(0.6, rel=1e-5)
    assert np.linalg.norm(found.moved[:, :2], axis=1) == pytest.approx(0.1, rel=1e-4)
    assert np.abs(found.moved[:, 2]).max() < 1e-5
    assert found.loss < 1e-5 * 0.06 * LIVE


def test_a_block_rocks_about_its_toe() -> None:
    """It turns by the work over the load's arm, and opens by the width times that at its heel."""
    scene = single_block((1.0, 1.0, 2.0), friction=0.9)
    live = float(np.abs(scene.live_forces).sum())
    found = increment(scene, 0.1 * live, np.zeros(4), np.zeros((4, 2)))
    assert found.load_factor == pytest.approx(0.5, rel=1e-5)
    assert found.moved[:, 2].max() == pytest.approx(0.1, rel=1e-4)
    assert found.moved[:, 2].min() > -1e-6


def wedged(gap: float) -> tuple[Scene, np.ndarray]:
    """A block between floor and lintel, which is open by ``gap``."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    lintel = Block.box("lintel", (-1, -1, 1), (2, 2, 2))
    block = Block.box("block", (0, 0, 0), (1, 1, 1), density=1.0)
    scene = Scene([ground, lintel, block], ["ground", "lintel"], Load(acceleration=(1, 0, 0)),
                  friction=0.4)  # fmt: skip
    at = scene.contacts.corner_contact
    is_above = np.array(["lintel" in name for name in scene.contacts.names])
    return scene, np.where(is_above[at], gap, 0.0)


def test_an_open_lintel_does_not_clamp() -> None:
    scene, gap = wedged(0.01)
    found = increment(scene, 0.1 * np.abs(scene.live_forces).sum(), gap, np.zeros((len(gap), 2)))
    assert found.load_factor == pytest.approx(0.4, rel=1e-5)
    assert np.abs(found.forces[gap > 0.0]).max() < 1e-4 * np.abs(scene.dead_forces).sum()
    assert (gap + found.moved[:, 2]).min() > -1e-6


def test_loss_by_virtual_work() -> None:
    """A wall with gaps and slips: what forces in balance do on the increment is known without the
    points, and at none of them do the forces exceed friction."""
    rng = np.random.default_rng(0)
    scene = wall(running_bond(2, 3), unit=(0.4, 0.2, 0.15), density=20.0, friction=0.5,
                 live=Load(acceleration=(1, 0.3, 0)))  # fmt: skip
    _, dead, live = hand_equilibrium(scene)
    at = scene.contacts.corner_contact
    gap, slip = 1e-3 * rng.uniform(size=len(at)), 1e-3 * rng.normal(size=(len(at), 2))
    found = increment(scene, 0.01 * np.abs(live).sum(), gap, slip)
    d, way = found.displacement.ravel(), np.column_stack([slip, gap]) + found.moved
    assert live @ d == pytest.approx(0.01 * np.abs(live).sum(), rel=1e-6)
    work = (dead + found.load_factor * live) @ d
    assert (found.forces * found.moved).sum() == pytest.approx(-work, abs=1e-6 * abs(work))
    most = scene.contacts.friction[at] * found.forces[:, 2]
    assert (np.linalg.norm(found.forces[:, :2], axis=1) - most).max() < 1e-6 * np.abs(dead).sum()
    lost = (found.forces * way).sum() + most @ np.linalg.norm(way[:, :2], axis=1)
    size = found.load_factor * (live @ d)
    assert found.loss == pytest.approx(lost, abs=1e-5 * size)
    assert found.loss < 2e-6 * size
    assert way[:, 2].min() > -1e-7


def test_refusals() -> None:
    with pytest.raises(ModelError, match="push must be a number above 0"):
        increment(SQUAT, 0.0, np.zeros(4), np.zeros((4, 2)))
    with pytest.raises(ModelError, match=r"gap must have shape \(4,\), got \(3,\)"):
        increment(SQUAT, 1.0, np.zeros(3), np.zeros((4, 2)))
