"""Walls of 4 x 4 units in three bonds, from the scripts of mosek_optim."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from benchmarks.bench.case import Quantity, Value, case
from cvxlimit import Block, Load, Scene

Box = tuple[int, int, int, int]
"""From and to along x, from and to along z, in units of 1."""

PLAIN: tuple[Box, ...] = ((0, 2, 0, 1), (2, 4, 0, 1))
"""A course of two bricks at the bottom."""


def course(z: int, *ends: int) -> tuple[Box, ...]:
    """Bricks between these ends, one unit high."""
    return tuple((a, b, z, z + 1) for a, b in pairwise(ends))


BONDS = {
    "classical": (
        *PLAIN, *course(1, 0, 1, 3, 4), *course(2, 0, 2, 4), *course(3, 0, 1, 3, 4),
    ),
    "efficient": (*PLAIN, *course(1, 0, 2, 4), *course(2, 0, 1, 3, 4), *course(3, 0, 2, 4)),
    "upright": (
        *PLAIN, (0, 1, 1, 3), *course(1, 1, 3), *course(2, 1, 3), (3, 4, 1, 3), *course(3, 0, 2, 4),
    ),
}  # fmt: skip

HEAVY = 6 * 16
"""Weight of the beam on top, in units: six times that of the wall."""


def bonded(bond: str, top: bool) -> Scene:
    """Friction 0.58 in bed joints, none in head joints; each unit weighs 1."""
    boxes = BONDS[bond]
    bricks = [
        Block.box(f"b{i + 1}", (x0, 0, z0), (x1, 1, z1), 1.0)
        for i, (x0, x1, z0, z1) in enumerate(boxes)
    ]
    ground = Block.box("ground", (-1, -1, -1), (5, 2, 0))
    beam = [Block.box("beam", (0, 0, 4), (4, 1, 5), HEAVY / 4)] if top else []
    live = Load(forces={"beam": (4, 0, 0, 0, 0, 0)}) if top else Load(acceleration=(1, 0, 0))
    scene = Scene((ground, *bricks, *beam), ("ground",), live, friction=0.58)
    contacts = scene.contacts
    heads = {
        (scene.blocks[a].id, scene.blocks[b].id): 0.0
        for a, b, axes in zip(contacts.a, contacts.b, contacts.axes, strict=True)
        if abs(axes[2, 2]) < 0.5
    }
    return replace(scene, contact_friction=heads)


for bond, load in (("classical", "11.92"), ("efficient", "11.58"), ("upright", "11.72")):

    @case(
        f"bond-{bond}-loaded", f"4 x 4 wall, {bond} bond, heavy beam on top, pushed at the beam",
        Value(load, "mosek-optim", "other program"),
        quantity=Quantity("force over four units of weight"),
    )  # fmt: skip
    def loaded(bond: str = bond) -> Scene:
        return bonded(bond, top=True)


for bond in ("classical", "efficient"):

    @case(
        f"bond-{bond}-tilted",
        f"4 x 4 wall, {bond} bond, on a tilting table: slides at mu",
        Value("0.58", "mosek-optim", "other program"),
    )
    def tilted(bond: str = bond) -> Scene:
        return bonded(bond, top=False)
