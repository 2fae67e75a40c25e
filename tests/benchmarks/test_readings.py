"""Every reading of Eq. 30 on many scenes: lower bounds, and loads without an answer."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.stability.families import sample, samples

from cvxlimit import Load, Scene, Solution, Status, solve
from cvxlimit.errors import ModelError
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.masonry.walls import random_wall

pytestmark = pytest.mark.exhaustive

UNLIMITED = Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED

WALLS = range(1, 15)
SMALL = 40
READINGS = ("independent", "signed", "paper")

CLIMBED = 1e-4
"""Relative width at which a climb that nothing was asked of ends."""

ZERO = 1e-9
"""Load factors are the dead load's share of a live load as large: less than this is none, and the
scenes that bear none at all end this near."""


def certified(scene: Scene, moments: str) -> Solution:
    return solve(scene, method=Certified(branching_seconds=0.0), moments=moments)


def _scene(number: int) -> Scene:
    """Small scenes of all families of the atlas first, then irregular walls."""
    if number < SMALL:
        return sample(*list(samples(SMALL))[number]).scene
    return random_wall(WALLS[number - SMALL])


@pytest.mark.parametrize("number", range(SMALL + len(WALLS)))
def test_signed_moments_have_a_lower_bound_where_independent_signs_have_one(number: int) -> None:
    """Forces that independent signs admit are admitted by statics, and under the paper's signs. A
    climb of its own finds them as near as its bracket is wide. None contradicts the bounds of the
    convex problem."""
    scene = _scene(number)
    strict = certified(scene, "independent")
    for moments in ("signed", "paper"):
        found = certified(scene, moments)
        if found.status in UNLIMITED:
            continue  # any factor is carried
        assert strict.status not in UNLIMITED
        if np.isfinite(strict.lower):
            width = min(found.bracket.upper - found.bracket.lower, CLIMBED * abs(strict.lower))
            slack = width + 1e-6 * abs(strict.lower) + ZERO
            assert found.lower >= strict.lower - slack, (strict, found)
            assert strict.lower <= found.bracket.upper
        if found.bracket.has_both:
            assert found.lower <= found.upper


@pytest.mark.parametrize("seed", range(40))
def test_loads_without_an_answer_are_recognised(seed: int) -> None:
    """A live load that does harm without interaction does so with it; one that does none without
    it does none, or has a factor: near their edges contacts carry less. None is left open."""
    scene = random_wall(seed)
    is_harmless = solve(scene).status in UNLIMITED
    for moments in READINGS:
        found = certified(scene, moments)
        if not is_harmless:
            assert found.status not in UNLIMITED
        else:
            settled = found.status in UNLIMITED or found.bracket.has_both
            assert settled, (moments, found)


@pytest.mark.parametrize("seed", range(20))
def test_dead_loads_that_cannot_stand_are_recognised(seed: int) -> None:
    """A wall whose dead load is tilted beyond friction falls by itself under every reading, unless
    a part of the live load holds it: methods with interaction refuse that."""
    scene = random_wall(seed)
    angle = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    push = 1.5 * float(scene.contacts.friction.max())
    down = np.array([push * np.cos(angle), push * np.sin(angle), -1.0])
    tilted = scene.with_dead(Load(gravity=tuple(down / np.linalg.norm(down))))
    plain = solve(tilted)
    for moments in READINGS:
        if plain.interval is not None:
            with pytest.raises(ModelError, match="needs a dead load that stands alone"):
                certified(tilted, moments)
            continue
        found = certified(tilted, moments)
        if plain.status is Status.DEAD_LOAD_UNSTABLE:
            assert found.status is Status.DEAD_LOAD_UNSTABLE, (moments, found)
            assert found.mechanism is not None
