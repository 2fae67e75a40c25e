"""Piles, arches and vaults of random sizes under random pushes, the same for the same seed."""

from __future__ import annotations

import numpy as np

from cvxlimit import Block, Load, Scene
from cvxlimit.masonry import arch, barrel_vault


def pile(seed: int) -> Scene:
    """Two to four boxes on one another, off their middles and turned about z, pushed sideways."""
    random = np.random.default_rng((4, seed))
    blocks, friction = [Block.box("bed", (-3, -3, -1), (3, 3, 0))], dict[tuple[str, str], float]()
    base = 0.0
    for i in range(int(random.integers(2, 5))):
        x, y, z = random.uniform([0.5, 0.5, 0.2], [0.9, 0.9, 0.5])
        made = Block.box(f"b{i}", (-x / 2, -y / 2, 0), (x / 2, y / 2, z), 20.0)
        angle = random.uniform(0.0, 2.0 * np.pi)
        c, s = np.cos(angle), np.sin(angle)
        at = (*random.uniform(-0.06, 0.06, 2), base)
        friction[blocks[-1].id, f"b{i}"] = float(random.uniform(0.2, 0.8))
        blocks.append(made.moved(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), at))
        base += z
    return Scene(blocks, ["bed"], _push(random), contact_friction=friction)


def ring(seed: int) -> Scene:
    """An arch in the plane, pushed along it or down at one voussoir."""
    random = np.random.default_rng((5, seed))
    number = int(random.integers(5, 12))
    live = Load(acceleration=(1, 0, 0))
    if random.uniform() < 0.5:
        at = int(random.integers(1, number + 1))
        live = Load(forces={f"v{at}": (0, 0, -1, 0, 0, 0)})
    return arch(
        number, float(random.uniform(0.12, 0.3)), embrace=float(random.uniform(90, 180)),
        friction=float(random.uniform(0.35, 0.8)), live=live,
    )  # fmt: skip


def vault(seed: int) -> Scene:
    """A short barrel vault in bond, pushed in any horizontal direction."""
    random = np.random.default_rng((6, seed))
    return barrel_vault(
        int(random.integers(4, 7)), float(random.uniform(0.15, 0.3)),
        embrace=float(random.uniform(100, 160)), units=int(random.integers(1, 3)),
        friction=float(random.uniform(0.4, 0.8)), live=_push(random),
    )  # fmt: skip


def _push(random: np.random.Generator) -> Load:
    angle = random.uniform(0.0, 2.0 * np.pi)
    return Load(acceleration=(float(np.cos(angle)), float(np.sin(angle)), 0.0))
