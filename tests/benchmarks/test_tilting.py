"""The way from rest beside MuJoCo, which shares nothing with it: scenes on a table that is tilted
until a block has moved."""

from __future__ import annotations

import pytest
from benchmarks.experiments.tilting import MOVED, tilted
from benchmarks.scenes import scene_of

from cvxlimit import Incremental, solve

pytest.importorskip("mujoco")

SAID = 0.02
"""What soft contacts and a slow turn can tell: contacts give by 0.1 % of a block, and what has
begun to fall needs a second to be seen, in which the load factor grows by 0.004."""


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "name", ["single-block", "stack", "arch", "barrel-vault", "irregular-wall-1"]
)
def test_a_table_tilted_slowly_agrees(name: str) -> None:
    scene = scene_of(name)
    reached = solve(scene, method=Incremental(spread=False)).load_factor
    assert reached is not None
    found = tilted(scene, reached, rate=0.004)
    assert set(found) == set(MOVED)
    assert list(found.values()) == pytest.approx([reached] * len(MOVED), rel=SAID)


def test_what_stands_has_not_moved() -> None:
    """A block on a table that is tilted to a tenth of what makes it tip."""
    assert tilted(scene_of("single-block"), 0.02, rate=0.1) == {}
