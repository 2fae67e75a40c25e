"""Scenes with moved blocks, and what moves along with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.results.movement import rotation
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Load
from cvxlimit.scene.reactions import places


def moved_scene(scene: Scene, displacements: Mapping[str, FloatArray]) -> Scene:
    """``scene`` with blocks moved by (6,) displacements; point loads, ends of ties and reactions
    move with their blocks, pressures turn with them as well, and reactions with what they push
    from."""
    turns, still = {name: rotation(d[3:]) for name, d in displacements.items()}, np.eye(3)
    blocks, shift = [], dict[str, FloatArray]()
    for block in scene.blocks:
        if block.id in displacements:
            turn, d = turns[block.id], displacements[block.id]
            shift[block.id] = block.centroid + d[:3] - turn @ block.centroid
            block = block.moved(turn, shift[block.id])
        blocks.append(block)
    centre = {block.id: block.centroid for block in scene.blocks}

    def placed(block: str, at: Sequence[float]) -> tuple[float, ...]:
        if block not in displacements:
            return tuple(at)
        arm = turns[block] @ (np.asarray(at) - centre[block])
        return tuple((centre[block] + displacements[block][:3] + arm).tolist())

    def moved(load: Load) -> Load:
        points: Sequence[Any] = [replace(p, at=placed(p.block, p.at)) for p in load.points]
        pressures = [p.moved(turns[p.block], shift[p.block]) for p in load.pressures]
        return replace(load, points=points, pressures=pressures)

    ties = [replace(t, start=placed(t.a, t.start), end=placed(t.b, t.end)) for t in scene.ties]
    reactions = [
        replace(
            r, at=placed(r.block, r.at), direction=tuple(turns.get(r.on or "", still) @ r.direction)
        )
        for r in scene.reactions
    ]
    return replace(
        scene, blocks=tuple(blocks), dead=moved(scene.dead), live=moved(scene.live),
        ties=tuple(ties), reactions=tuple(reactions),
    )  # fmt: skip


def held_scene(scene: Scene, start: Scene, is_seated: Sequence[bool], glued: IntArray) -> Scene:
    """A ``scene`` that has moved from its ``start``, with those ties and forces of reactions alone
    that are at their seats, for each among the contacts, and with cohesion between the blocks
    (k, 2) that are ``glued`` alone."""
    ties = [tie for tie, is_taut in zip(scene.ties, is_seated, strict=False) if is_taut]
    short = {
        point
        for point, is_so in zip(places(scene.reactions), is_seated[len(scene.ties) :], strict=True)
        if not is_so
    }
    reactions = []
    for i, r in enumerate(scene.reactions):
        most = max(r.least, 0.0) if (i, 1.0) in short else r.most
        least = min(r.most, 0.0) if (i, -1.0) in short else r.least
        if most or least:
            reactions.append(replace(r, most=most, least=least))
    scene = replace(scene, ties=tuple(ties), reactions=tuple(reactions))
    if not (start.cohesion or any(start.contact_cohesion.values())):
        return scene
    names = [block.id for block in scene.blocks]
    pairs = {tuple(sorted((names[a], names[b]))) for a, b in glued.tolist()}
    own: Any = {x: start.contact_cohesion.get(x, start.cohesion) for x in pairs}
    return replace(scene, cohesion=0.0, contact_cohesion=own)
