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


def moved_scene(scene: Scene, displacements: Mapping[str, FloatArray]) -> Scene:
    """``scene`` with blocks moved by (6,) displacements; point loads and the ends of ties move with
    their blocks, and pressures turn with them as well."""
    turns = {name: rotation(d[3:]) for name, d in displacements.items()}
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
    return replace(
        scene, blocks=tuple(blocks), dead=moved(scene.dead), live=moved(scene.live),
        ties=tuple(ties),
    )  # fmt: skip


def held_scene(scene: Scene, start: Scene, taut: FloatArray, glued: IntArray, near: float) -> Scene:
    """A ``scene`` that has moved from its ``start``, with those of its ties whose middles are
    ``taut`` (k, 3) up to ``near``, and with cohesion between the blocks (k, 2) that are ``glued``
    alone."""
    if not (scene.ties or start.cohesion or any(start.contact_cohesion.values())):
        return scene
    middles = [0.5 * np.add(tie.start, tie.end) for tie in scene.ties]
    far = [np.linalg.norm(taut - x, axis=1).min(initial=np.inf) for x in middles]
    ties = [tie for tie, d in zip(scene.ties, far, strict=True) if d <= near]
    names = [block.id for block in scene.blocks]
    pairs = {tuple(sorted((names[a], names[b]))) for a, b in glued.tolist()}
    own: Any = {x: start.contact_cohesion.get(x, start.cohesion) for x in pairs}
    return replace(scene, ties=tuple(ties), cohesion=0.0, contact_cohesion=own)
