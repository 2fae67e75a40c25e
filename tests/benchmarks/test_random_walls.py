"""Low members without dilatancy on the random walls that the search was chosen on, and others."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from benchmarks.random_walls import planar, retaining

from cvxlimit import Load, Scene, ZeroDilatancy, solve
from cvxlimit.solution.records import ended_apart
from exhaustive import mostly_slow, slow
from members import assert_member


@pytest.mark.parametrize("seed", mostly_slow(range(20), []))
@pytest.mark.parametrize("build", [planar, slow(retaining)])
def test_random_walls(build: Callable[[int], Scene], seed: int) -> None:
    """Every member by a second writing; from other seeds the same lowest one, or it is said that
    searches ended apart, so that more may find lower ones."""
    scene = build(seed)
    ids = [scene.blocks[i].id for i in scene.free]
    scene = scene.with_live(Load(forces=dict(zip(ids, map(tuple, scene.live_forces), strict=True))))
    found = solve(scene, method=ZeroDilatancy(searches=3))
    for member in (found.members[0], found.members[-1]):
        assert_member(scene, member.forces, member.mechanism, member.load_factor)
    other = solve(scene, method=ZeroDilatancy(searches=3, seed=10))
    are_apart = ended_apart(found.searches) or ended_apart(other.searches)
    assert found.load_factor == pytest.approx(other.load_factor, rel=1e-2) or are_apart
