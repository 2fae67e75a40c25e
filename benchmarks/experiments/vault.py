"""Does a cross vault stand without dilatancy? What is proved of one, and which solutions are known.

The vault is of the shape of one whose geometry is public (184 blocks), and falls in two programs
that follow blocks in time. A file of that geometry goes through the same tables.
"""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np

from benchmarks.experiment import Head, Lines, Part, Title, experiment
from cvxlimit import Block, Load, Scene, Status, ZeroDilatancy, solve
from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.io import read_scene

RADII = (3.75, 4.36)
"""Of intrados and extrados, m: those of the public vault."""

FRICTIONS = (0.6, 0.7, 0.8, 0.9)
"""Those at which the public vault is said to fall."""


LOADED = {
    "weight on the crown": [f"groin 1{a}{b}" for a in "+-" for b in "+-"],
    "weight on an open edge": ["y1++.5", "y1-+.5"],
}
"""Stones that bear the live load in place of a push: that of the whole vault."""


def cross_vault(courses: int = 10, stones: int = 6, density: float = 20.0) -> Scene:
    """Two barrels of radii :data:`RADII` that cross at right angles, open on four sides, on the
    lowest stones of their four corners.

    Every quarter has two webs of ``courses`` courses between radial joints, with head joints at
    multiples of a stone's length, ``stones`` of which are half a span, or half-way between them in
    turn. Stones on the groin belong to both webs: they are L-shaped, and reach to the first head
    joint beyond the groin.
    """
    side, angles = RADII[1], np.linspace(0.0, np.pi / 2.0, courses + 1)
    radii, blocks = np.array([*RADII, *RADII[::-1]]), list[Block]()
    for k in range(courses):
        turns = angles[[k, k, k + 1, k + 1]]
        across, height = radii * np.sin(turns), radii * np.cos(turns)
        joints = np.append((np.arange(stones) + (0.5, 1.0)[k % 2]) * side / stones, side)
        joints = np.unique(np.minimum(joints[joints > across.max()], side))
        groin, *ends = (np.stack([across, np.broadcast_to(y, 4), height], axis=1)
                        for y in (across, *(joints if len(joints) else [side])))  # fmt: skip
        weight = density if k + 1 < courses else None  # the lowest stones are fixed
        for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
            name, sign = f"{k + 1}{'+-'[x < 0]}{'+-'[y < 0]}", np.array([x, y, 1])
            corners = np.vstack([ends[0], groin, ends[0][:, OTHER_WEB]]) * sign
            blocks.append(bent(f"groin {name}", corners, weight))
            for place, (near, far) in enumerate(pairwise(ends), start=1):
                for axis, order in (("y", [0, 1, 2]), ("x", OTHER_WEB)):
                    web = np.vstack([near, far])[:, order] * sign
                    blocks.append(Block.hull(f"{axis}{name}.{place}", web, density))
    supports = [block.id for block in blocks if block.density is None]
    live = Load(acceleration=(1.0, 0.0, 0.0))
    return Scene(blocks, supports, live, friction=FRICTIONS[0], name="cross vault")


OTHER_WEB = [1, 0, 2]
"""The other web of a quarter has x and y exchanged."""


def bent(name: str, corners: FloatArray, density: float | None) -> Block:
    """A bar that turns a corner: four corners at its ends, and in its middle (12, 3), some of which
    may coincide."""
    points, at = np.unique(corners.round(12), axis=0, return_inverse=True)
    loops = [[0, 1, 2, 3], [8, 9, 10, 11]]
    loops += [[i + m, (i + 1) % 4 + m, (i + 1) % 4 + m + 4, i + m + 4]
              for m in (0, 4) for i in range(4)]  # fmt: skip
    faces = [list(dict.fromkeys(at[loop].tolist())) for loop in loops]
    return Block.polyhedron(name, points, [face for face in faces if len(face) > 2], density)


def least_friction(scene: Scene, width: float) -> tuple[float, float]:
    """Frictions at which the vault falls and stands under its own weight, proved either way."""
    low, high = 0.0, FRICTIONS[0]
    while high - low > width:
        middle = (low + high) / 2.0
        found = solve(scene.with_friction(middle))
        if found.status is Status.DEAD_LOAD_UNSTABLE:
            low = middle
        elif found.lower >= 0.0:
            high = middle
        else:
            raise ModelError(f"{scene.name}, friction {middle:g}: not proved: {found}")
    return low, high


def solutions(scene: Scene, what: str, rule: ZeroDilatancy) -> tuple[object, ...]:
    """Those without dilatancy that are found, and the bounds of all of them."""
    begun = time.process_time()
    found = solve(scene, method=rule)
    seconds = f"{time.process_time() - begun:.0f}"
    factors = [f"{member.load_factor:.4f}" for member in found.members] or ["none"]
    residual = f"{max((m.residual for m in found.members), default=float('nan')):.0e}"
    lower = "nothing" if found.lower <= 0.0 else f"{found.lower:.4f}"
    ends = factors[0], factors[-1], len(found.members), residual
    return what, scene.friction, *ends, lower, f"{found.upper:.4f}", seconds


@experiment(Part(5, name="cross-vault"))
def vault(file: str = "", searches: int = 1, budget: int = 300, tolerance: float = 1e-5) -> Lines:
    """A cross vault of 184 blocks, or of a scene file: proved to stand, and without dilatancy."""
    scene = read_scene(file) if file else cross_vault()
    low, high = least_friction(scene, 1e-3)
    yield Title("stands")
    yield Head("friction", "push carried, proved", "share of friction that its weight needs")
    for friction in FRICTIONS:
        found = solve(scene.with_friction(friction))
        bracket = f"{found.lower:.4f} to {found.upper:.4f}"
        yield friction, bracket, f"between {low / friction:.3f} and {high / friction:.3f}"
    yield Title("without dilatancy")
    yield Head("live load", "friction", "lowest found", "highest found", "number",
               "largest residual", "lower bound", "upper bound", "CPU s")  # fmt: skip
    rule = ZeroDilatancy(searches=searches, budget=budget, tolerance=tolerance)
    for friction in FRICTIONS:
        yield solutions(scene.with_friction(friction), "push to one side", rule)
    if not file:
        for what, stones in LOADED.items():
            share = (0.0, 0.0, -scene.total_weight / len(stones), 0.0, 0.0, 0.0)
            loaded = scene.with_live(Load(forces=dict.fromkeys(stones, share)))
            yield solutions(loaded.with_friction(0.7), what, rule)
