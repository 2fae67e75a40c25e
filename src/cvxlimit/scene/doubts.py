"""What is as a rule meant otherwise: stones of no quarry, friction of no joint, another axis up."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.scene.units import METRES

_VAST = 100.0
"""Metres: no stone is as large, nor a facade that is taken as one; bricks in millimetres are. No
structure of stones is twice as high; walls in centimetres are."""

_STONE = 0.5
"""Metres: of several units, that is meant which makes the largest stone most nearly as large."""

_ROUGH = 1.5
"""Friction beyond which no dry joint of stone or brick goes: 56 degrees."""


LOWEST_WITHIN = 0.01
"""Share of the structure's height within which supports count as under it, and blocks as lowest:
feet on one plane differ by what coordinates are rounded to (1e-3 of a block at worst in public
models), and the next course lies a block's height above, which is more up to 100 courses."""


def unit_in_doubt(unit: str, what: str, size: float) -> str:
    """The question whether coordinates are in ``unit``, and what ``size`` (metres) a thing would
    have in the unit that was likely meant."""
    sizes = {other: METRES[other] / METRES[unit] * size for other in ("m", "cm", "mm")}
    meant = min(sizes, key=lambda other: abs(np.log(sizes[other] / _STONE)))
    would = f" In {meant} {what} would have {sizes[meant]:.3g} m" if meant != unit else ""
    return f"are coordinates in {unit}?{would}"


def doubts(scene: Any) -> Iterator[str]:
    """Yields a sentence each on lengths and on friction of a scene that ask for another unit, and
    on the axis that points up; on lengths only where they are in a unit that can be converted."""
    units, blocks = scene.units, [scene.blocks[i] for i in scene.free]
    metres = METRES.get(units.length, 0.0)
    stone = metres * max(block.size for block in blocks)
    down = np.array(scene.dead.gravity or (0.0, 0.0, -1.0))
    heights = np.concatenate([block.vertices for block in blocks]) @ down
    high = metres * float(np.ptp(heights))
    if stone > _VAST or high > 2.0 * _VAST:
        said = f"the largest block is {stone:.3g} m across"
        if not stone > _VAST:
            said = f"the structure is {high:.3g} m high"
        yield f"{said}: {unit_in_doubt(units.length, 'the largest block', stone)}"
    largest = max([scene.friction, *scene.contact_friction.values()])
    if largest > _ROUGH:
        said = f"friction {largest:g} is {np.degrees(np.arctan(largest)):.3g} degrees"
        if largest < 90.0:
            said += f": in degrees? tan {largest:g} = {np.tan(np.radians(largest)):.2f}"
        yield said
    yield from _another_axis_up(scene, -down)


def _another_axis_up(scene: Any, up: FloatArray) -> Iterator[str]:
    """A question, where the supports do not lie under the free blocks but would along one other
    axis alone, as where y points up in the file and z in the scene."""
    if not scene.supports:  # reactions hold it
        return
    free = np.concatenate([scene.blocks[i].vertices for i in scene.free])
    fixed = np.concatenate([b.vertices for b in scene.blocks if b.id in set(scene.supports)])

    def is_under(axis: FloatArray) -> bool:
        low, high = (free @ axis).min(), (free @ axis).max()
        return bool((fixed @ axis).max() <= low + LOWEST_WITHIN * (high - low))

    axes = {f"{sign}{name}": axis if not sign else -axis for sign in ("", "-")
            for name, axis in zip("xyz", np.eye(3), strict=True)}  # fmt: skip
    meant = [name for name, axis in axes.items() if is_under(axis)]
    if len(meant) == 1 and not is_under(up):
        yield (
            f"is {meant[0]} up? Along it all supports lie under the other blocks, and against the "
            "weight they do not"
        )
