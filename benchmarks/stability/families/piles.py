"""Stacks, wedges and locked blocks: small scenes, most of them with an answer in closed form."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from benchmarks.stability.families.sample import HARMLESS, Family, Sample, direction, spread
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry import running_bond, wall
from cvxlimit.scene import Load, Scene

GROUND = Block.box("ground", (-50, -50, -1), (50, 50, 0))
DENSITY = 20.0


def _stack(rng: np.random.Generator, scale: int) -> Sample:
    """Offsets up to a third of the width: from stable to falling."""
    number = int(rng.integers(1, 7)) * scale
    reach = float(rng.uniform(0.0, 0.35))
    at, z, blocks = np.zeros(2), 0.0, []
    for i in range(number):
        width, height = rng.uniform(0.8, 1.2, 2), float(rng.uniform(0.2, 1.0))
        low, high = (*(at - width / 2), z), (*(at + width / 2), z + height)
        blocks.append(Block.box(f"b{i + 1}", low, high, DENSITY))
        at, z = at + rng.uniform(-reach, reach, 2), z + height
    live = Load(acceleration=direction(rng))
    friction = float(rng.uniform(0.1, 1.0))
    return Sample(Scene((GROUND, *blocks), ("ground",), live, friction=friction),
                  knob=f"offset {reach:.2f}")  # fmt: skip


def prism(name: str, sides: int, radius: float, height: float, density: float) -> Block:
    """An upright prism over a regular polygon, standing on z = 0."""
    angles = 2.0 * np.pi * (np.arange(sides) + 0.25) / sides
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return Block.hull(name, [(*p, z) for p in ring.tolist() for z in (0.0, height)], density)


def _block(rng: np.random.Generator, scale: int) -> Sample:
    """Any force and moment on one prism: shear, torsion, bending and uplift at once."""
    sides, height = int(rng.integers(3, 9)), float(rng.uniform(0.2, 3.0))
    block = prism("block", sides, 1.0, height, DENSITY)
    force = tuple((rng.normal(size=6) * block.weight).tolist())
    live = Load(forces={"block": force})
    scene = Scene((GROUND, block), ("ground",), live, friction=float(rng.uniform(0.1, 1.2)))
    return Sample(scene, knob=f"{sides} sides")


def _wedge(rng: np.random.Generator, scale: int) -> Sample:
    """A wedge in a groove, pushed along it.

    By the flow rule the wedge moves along (1, w), along the groove and up, so that the cheeks, at
    the angle phi from the vertical, open by mu times the slip: w sin(phi) = mu sqrt(1 +
    (w cos(phi))²), and the load factor is w, unless the wedge tips first, which a long one does
    not. At mu >= tan(phi) it locks.
    """
    phi, friction = float(rng.uniform(0.2, 1.2)), spread(rng, 1e-3, 3.0)
    inside = np.sin(phi) ** 2 - (friction * np.cos(phi)) ** 2
    truth = float(friction / np.sqrt(inside)) if inside > 0.0 else HARMLESS
    half, length = float(np.tan(phi)), 60.0
    ends = (0.0, length)
    cheeks = [
        Block.hull(name, [(0, y, 0) for y in ends]
                   + [(s * half * k, y, z) for y in ends for k, z in ((1, 1), (1, 0))])
        for name, s in (("left", -1), ("right", 1))
    ]  # fmt: skip
    corners = [(x, y, z) for y in ends for x, z in ((0, 0), (-half, 1), (half, 1))]
    block = Block.hull("wedge", corners, DENSITY)
    live = Load(acceleration=(0, 1, 0))
    scene = Scene((*cheeks, block), ("left", "right"), live, friction=friction)
    tips = isinstance(truth, float) and truth > 0.4 * length
    return Sample(scene, None if tips else truth, f"mu / tan(phi) {friction / half:.3g}")


def _locked(rng: np.random.Generator, scale: int) -> Sample:
    """Wedged between walls: self-stress without bound, and a rider that it does not help."""
    friction = spread(rng, 1e-2, 1e2)
    sides = [Block.box(n, (x, 0, 0), (x + 1, 1, 1)) for n, x in (("left", -1), ("right", scale))]
    cubes = [Block.box(f"c{i + 1}", (i, 0, 0), (i + 1, 1, 1), DENSITY) for i in range(scale)]
    height = float(rng.uniform(0.1, 1.0))
    rider = Block.box("rider", (0.2, 0.2, 1), (0.8, 0.8, 1 + height), DENSITY)
    ground = Block.box("ground", (-5, -5, -1), (5 + scale, 5, 0))
    live = Load(acceleration=((1, 0, 0), (0, 1, 0))[int(rng.integers(2))])
    names = ("ground", "left", "right")
    scene = Scene((ground, *sides, *cubes, rider), names, live, friction=friction)
    return Sample(scene, min(friction, 0.6 / height), f"friction {friction:.2g}")


def _propped(rng: np.random.Generator, scale: int) -> Sample:
    """Walls between two rigid sides: most directions do no harm, or only if friction is low."""
    scene = wall(
        running_bond(int(rng.integers(2, 4)) * scale, int(rng.integers(2, 5))),
        friction=spread(rng, 1e-2, 2.0),
        side_supports=("start", "end"),
        live=Load(acceleration=direction(rng)),
    )
    return Sample(scene, knob=f"friction {scene.friction:.2g}")


def _grazing(rng: np.random.Generator, scale: int) -> Sample:
    """Pushed down and a little aside: a hair less tilt and the load does no harm at all."""
    friction, height = float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.5, 4.0))
    limit = min(friction, 1.0 / height)
    hair = float(rng.choice([-1, 1])) * spread(rng, 1e-8, 1e-1)
    tilt = limit * (1.0 + hair)
    block = Block.box("b1", (0, 0, 0), (1, 1, height), DENSITY)
    scene = Scene((GROUND, block), ("ground",), Load(acceleration=(tilt, 0, -1)), friction=friction)
    return Sample(scene, limit / (tilt - limit) if hair > 0 else HARMLESS, f"hair {hair:.1e}")


def _degenerate(rng: np.random.Generator, scale: int) -> Sample:
    """Two or more mechanisms with exactly the same load factor, and contacts with the same role."""
    width = float(rng.choice([0.25, 0.5, 1.0]))
    number = int(rng.integers(1, 5)) * scale
    heights = np.arange(number + 1, dtype=float)
    blocks = [
        Block.box(f"b{k}.{i + 1}", (2 * k * width, 0, z0), ((2 * k + 1) * width, width, z1), 1.0)
        for k in range(int(rng.integers(1, 4)))
        for i, (z0, z1) in enumerate(pairwise(heights))
    ]
    friction = width / number
    live = Load(acceleration=(1, 0, 0))
    scene = Scene((GROUND, *blocks), ("ground",), live, friction=friction)
    return Sample(scene, friction, f"{len(blocks)} blocks")


FAMILIES = (
    Family("stacks", "stacks with offsets from stable to falling", _stack),
    Family("blocks", "one prism under any force and moment at once", _block),
    Family("wedges", "wedges in grooves, from slippery to locked", _wedge),
    Family("locked", "blocks wedged between walls, with a rider on top", _locked),
    Family("propped", "walls between rigid sides, where most loads do no harm", _propped),
    Family("grazing", "loads within 10 % to 1e-8 of a direction that does no harm", _grazing),
    Family("degenerate", "several mechanisms at exactly the same load factor", _degenerate),
)
