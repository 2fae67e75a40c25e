"""Numbers that are as a rule in another unit: stones of no quarry, friction of no joint."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cvxlimit.scene.units import METRES

_VAST = 100.0
"""Metres: no stone is as large, nor a facade that is taken as one; bricks in millimetres are. No
structure of stones is twice as high; walls in centimetres are."""

_STONE = 0.5
"""Metres: of several units, that is meant which makes the largest stone most nearly as large."""

_ROUGH = 1.5
"""Friction beyond which no dry joint of stone or brick goes: 56 degrees."""


def doubts(scene: Any) -> Iterator[str]:
    """Yields a sentence each on lengths and on friction of a scene that ask for another unit; on
    lengths only where they are in a unit that can be converted."""
    units, blocks = scene.units, [scene.blocks[i] for i in scene.free]
    metres = METRES.get(units.length, 0.0)
    stone = metres * max(block.size for block in blocks)
    down = np.array(scene.dead.gravity or (0.0, 0.0, -1.0))
    heights = np.concatenate([block.vertices for block in blocks]) @ down
    high = metres * float(np.ptp(heights))
    if stone > _VAST or high > 2.0 * _VAST:
        sizes = {unit: METRES[unit] / metres * stone for unit in ("m", "cm", "mm")}
        meant = min(sizes, key=lambda unit: abs(np.log(sizes[unit] / _STONE)))
        said = f"the largest block is {stone:.3g} m across"
        if not stone > _VAST:
            said = f"the structure is {high:.3g} m high"
        said += f": are coordinates in {units.length}?"
        if meant != units.length:
            said += f" In {meant} the largest block would have {sizes[meant]:.3g} m"
        yield said
    largest = max([scene.friction, *scene.contact_friction.values()])
    if largest > _ROUGH:
        said = f"friction {largest:g} is {np.degrees(np.arctan(largest)):.3g} degrees"
        if largest < 90.0:
            said += f": in degrees? tan {largest:g} = {np.tan(np.radians(largest)):.2f}"
        yield said
