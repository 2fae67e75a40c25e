"""Numbers far apart: slivers, densities, sizes, friction, loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.stability.families.piles import GROUND
from benchmarks.stability.families.sample import Family, Sample, direction, spread
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry import random_wall
from cvxlimit.scene import Load, Scene, Units


def _small_wall(rng: np.random.Generator, scale: int) -> Scene:
    """A random wall of 14 to 46 contacts; ``scale`` puts others beside it."""
    return random_wall(int(rng.integers(1_000_000)))


def _sliver(rng: np.random.Generator, scale: int) -> Sample:
    """Blocks that share an edge of 1e-4 to 1e-1 of their size: joints nearly above each other."""
    share = spread(rng, 1e-4, 1e-1)
    courses = int(rng.integers(2, 6)) * scale
    blocks = []
    for row in range(courses):
        joint = 1.0 + (share if row % 2 else 0.0)
        spans = (0.0, joint), (joint, 2.0)
        blocks += [
            Block.box(f"b{row + 1}.{k + 1}", (x0, 0, 0.4 * row), (x1, 0.5, 0.4 * (row + 1)), 20.0)
            for k, (x0, x1) in enumerate(spans)
        ]
    live = Load(acceleration=direction(rng))
    scene = Scene((GROUND, *blocks), ("ground",), live, friction=float(rng.uniform(0.3, 0.9)))
    return Sample(scene, knob=f"sides 1 to {share:.0e}")


def _contrast(rng: np.random.Generator, scale: int) -> Sample:
    """Each block's density drawn from up to nine powers of ten."""
    scene, powers = _small_wall(rng, scale), float(rng.uniform(1, 9))
    blocks = tuple(
        b if b.density is None else replace(b, density=10.0 ** float(rng.uniform(0, powers)))
        for b in scene.blocks
    )
    return Sample(replace(scene, blocks=blocks), knob=f"contrast 1e{powers:.0f}")


def _tower(rng: np.random.Generator, scale: int) -> Sample:
    """A pebble on a boulder, or a boulder on a pebble: sizes and weights up to 1e9 apart."""
    ratio = spread(rng, 1e1, 1e3)
    sizes = [1.0, ratio] if rng.random() < 0.5 else [ratio, 1.0]
    z, blocks = 0.0, []
    for i, side in enumerate(sizes):
        low, high = (-side / 2, -side / 2, z), (side / 2, side / 2, z + side)
        blocks.append(Block.box(f"b{i + 1}", low, high, 20.0))
        z += side
    ground = Block.box("ground", (-ratio, -ratio, -ratio), (ratio, ratio, 0))
    friction = float(rng.uniform(0.2, 1.5))
    scene = Scene((ground, *blocks), ("ground",), Load(acceleration=direction(rng)),
                  friction=friction)  # fmt: skip
    return Sample(scene, knob=f"weights 1e{3 * np.log10(ratio):.0f} apart")


def _size(rng: np.random.Generator, scale: int) -> Sample:
    """The same walls from millimetres to kilometres, in kN or in N."""
    length, force = spread(rng, 1e-3, 1e4), float(rng.choice([1.0, 1e3]))
    scene = _small_wall(rng, scale).in_units(Units("-", "-"), length, force)
    return Sample(scene, knob=f"block {0.4 * length:.1e} long")


def _friction(rng: np.random.Generator, scale: int) -> Sample:
    """One coefficient per joint: from 0 to 5, from 1e-6 to 1e6, or the same extreme everywhere."""
    scene, kind = _small_wall(rng, scale), int(rng.integers(4))
    if kind == 0:
        return Sample(scene.with_friction(float(rng.choice([0.0, 1e-6, 1e3, 1e6]))), knob="extreme")
    pairs = [(c.a, c.b) for c in scene.contacts]
    low, high = ((1e-3, 5.0), (1e-6, 1e6), (1e-2, 1e2))[kind - 1]
    own = {pair: spread(rng, low, high) for pair in pairs}
    return Sample(replace(scene, contact_friction=own), knob=f"{low:g} to {high:g}")


def _few(rng: np.random.Generator, scale: int) -> Sample:
    """Live load on one or two blocks; in half the scenes the others have no weight either."""
    scene = _small_wall(rng, scale)
    free = [scene.blocks[i] for i in scene.free]
    chosen = rng.choice(len(free), int(rng.integers(1, 3)), replace=False).tolist()
    live = Load(forces={free[i].id: tuple(rng.normal(size=6).tolist()) for i in chosen})
    if rng.random() < 0.5:
        return Sample(scene.with_live(live), knob="load on few blocks")
    weightless = tuple(b if b.density is None else replace(b, density=0.0) for b in scene.blocks)
    pressed = {free[i].id: (0.0, 0.0, -float(rng.uniform(0.5, 5.0)), 0, 0, 0) for i in chosen}
    dead = Load(forces=pressed)
    return Sample(replace(scene, blocks=weightless, live=live, dead=dead), knob="others weigh 0")


def _factor(rng: np.random.Generator, scale: int) -> Sample:
    """Live loads so large or so small that the load factor is 1e-9 or 1e9."""
    scene, size = _small_wall(rng, scale), spread(rng, 1e-9, 1e9)
    live = Load(acceleration=tuple(size * x for x in direction(rng)))
    return Sample(scene.with_live(live), knob=f"live load x {size:.0e}")


def _mixed(rng: np.random.Generator, scale: int) -> Sample:
    """Several of these at once: slivers or walls, densities, joints without friction, few loads."""
    scene = _sliver(rng, scale).scene if rng.random() < 0.5 else _small_wall(rng, scale)
    powers, slippery = float(rng.uniform(0, 6)), float(rng.choice([0.0, 0.1, 0.3]))
    blocks = tuple(
        b if b.density is None else replace(b, density=10.0 ** float(rng.uniform(0, powers)))
        for b in scene.blocks
    )
    own = {
        (c.a, c.b): 0.0 if rng.random() < slippery else float(rng.uniform(0.3, 1.5))
        for c in scene.contacts
    }
    scene = replace(scene, blocks=blocks, contact_friction=own)
    free = [scene.blocks[i] for i in scene.free]
    if rng.random() < 0.5:
        chosen = free[int(rng.integers(len(free)))]
        push = chosen.weight * rng.normal(size=6) * spread(rng, 1e-3, 1e3)
        scene = scene.with_live(Load(forces={chosen.id: tuple(push.tolist())}))
    length = spread(rng, 1e-3, 1e3)
    scene = scene.in_units(Units("-", "-"), length, 1.0)
    return Sample(scene, knob=f"contrast 1e{powers:.0f}, {slippery:.0%} of joints without friction")


FAMILIES = (
    Family("slivers", "contacts with side ratios down to 1e-4", _sliver),
    Family("densities", "densities up to 1e9 apart in one wall", _contrast),
    Family("boulders", "pebbles on boulders and boulders on pebbles", _tower),
    Family("sizes", "walls from millimetres to kilometres", _size),
    Family("frictions", "friction from 0 to 5 and from 1e-6 to 1e6, joint by joint", _friction),
    Family("few-loads", "loads on few blocks, in half the scenes all others weightless", _few),
    Family("factors", "load factors from 1e-9 to 1e9", _factor),
    Family("mixed", "slivers, densities, joints without friction and few loads at once", _mixed),
)
