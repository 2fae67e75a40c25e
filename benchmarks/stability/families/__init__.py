"""Families of scenes, each after one way in which limit analysis is hard: seeded, any number.

A family is a function from a random generator and a scale to a :class:`Sample`. To add one, write
it into the module it belongs to and give it a line in that module's ``FAMILIES``.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np

from benchmarks.stability.families import extremes, piles, shapes, shells, walls
from benchmarks.stability.families.sample import Family, Sample

__all__ = ["FAMILIES", "Family", "Sample", "key_of", "sample", "samples"]

FAMILIES: dict[str, Family] = {
    family.name: family
    for module in (walls, shells, piles, extremes, shapes)
    for family in module.FAMILIES
}
"""All families by name, in the order of the atlas."""


def sample(family: str, seed: int, scale: int = 1) -> Sample:
    """The scene number ``seed`` of a family; ``scale`` multiplies its numbers of blocks.

    The same on every machine and whatever else was drawn before.

    >>> sample("stacks", 3).scene.name
    'stacks-3'
    """
    rng = np.random.default_rng([zlib.crc32(family.encode()), seed, scale])
    made = FAMILIES[family].build(rng, scale)
    return Sample(made.scene.with_name(f"{family}-{seed}"), made.truth, made.knob)


def samples(number: int, scale: int = 1, first: int = 0) -> Iterator[tuple[str, int, int]]:
    """Names, seeds from ``first`` on, and scale of ``number`` scenes, families in turn."""
    for k in range(number):
        seed, place = divmod(k, len(FAMILIES))
        yield list(FAMILIES)[place], first + seed, scale


def key_of(family: str, seed: int, scale: int) -> str:
    """The key of a scene's rows.

    >>> key_of("walls", 3, 1), key_of("walls", 3, 2)
    ('walls-3', 'walls-3x2')
    """
    assert family in FAMILIES
    return f"{family}-{seed}" + (f"x{scale}" if scale > 1 else "")
