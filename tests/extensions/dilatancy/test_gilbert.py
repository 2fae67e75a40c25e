"""Gilbert's scheme: published load factors, and the stop that is not safe."""

from __future__ import annotations

import pytest

from cvxlimit import Status, builtin_scene, solve
from cvxlimit.cli.main import run
from cvxlimit.errors import ModelError
from cvxlimit.extensions.dilatancy.gilbert import Gilbert
from helpers import renumbered, yield_excess

PUBLISHED = {
    "ferris-tin-loi-1": 0.639918,
    "ferris-tin-loi-2": 0.562731,
    "ferris-tin-loi-3": 0.355917,
}
"""By an independent prototype in the plane, eta 0.01, weight 0.6, cohesion 1e-5. The scheme stops
where its start and its path lead it, hence to a few parts in ten thousand."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_published(name: str) -> None:
    """Run until the load factor stands still, forces obey Coulomb to a hundredth of a block."""
    scene = builtin_scene(name)
    solution = solve(scene, method=Gilbert(tolerance=1e-5))
    assert solution.status is Status.CONVERGED
    assert solution.load_factor == pytest.approx(PUBLISHED[name], rel=5e-4)
    weight = scene.total_weight / len(scene.free)
    assert yield_excess(scene, solution.forces).max() < 1e-2 * weight


def test_unsafe_stop() -> None:
    """On wall 2 the load factor settles to a thousandth where forces exceed Coulomb's law by more
    than a hundredth of a block's weight; going on, it rises again."""
    scene = builtin_scene("ferris-tin-loi-2")
    solution = solve(scene, method="gilbert")
    assert solution.history[-1].change < 1e-3  # type: ignore[operator]
    assert solution.status is Status.NOT_CONVERGED
    weight = scene.total_weight / len(scene.free)
    assert yield_excess(scene, solution.forces).max() > 0.01 * weight
    assert "Coulomb's law is exceeded by 0.0" in solution.note
    assert not solution.bracket.has_any
    assert not solution.members


def test_block_that_slides() -> None:
    for scene in (builtin_scene("single-block"), renumbered(builtin_scene("single-block"), 1)):
        low = scene.with_friction(0.3)
        for other in (low, low.in_units(low.units, 1e3, 1e3)):
            assert solve(other, method="gilbert").load_factor == pytest.approx(0.3, rel=1e-3)


def test_command_line() -> None:
    assert run(["solve", "single-block", "--method", "gilbert"]) == 0


def test_refusals() -> None:
    scene = builtin_scene("single-block")
    for changed, options, message in (
        (scene.with_cohesion(1.0), {}, "has no cohesion: take it out"),
        (scene.with_strength(compressive=1e3), {}, "knows no strength"),
        (scene, {"surface": "parabolic"}, "goes with surface conic or facets"),
    ):
        with pytest.raises(ModelError, match=message):
            solve(changed, method="gilbert", **options)
    with pytest.raises(ModelError, match="weight must be above 0"):
        Gilbert(weight=0.0)
