"""What is drawn besides blocks: how joints lie, arrows of loads, and places that need a look."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.loads import Load
from cvxlimit.plotting.camera import upright
from cvxlimit.plotting.movement import free_size
from cvxlimit.scene import Scene

LEVEL_WITHIN = 10.0
"""Degrees off level or upright up to which a joint counts as bed or head joint."""

LONGEST, SHORTEST = 0.15, 0.05
"""Length of the arrows of the largest and of tiny forces, relative to the free blocks' size."""


class JointKind(IntEnum):
    """How a contact lies to the dead load."""

    BED = 1
    HEAD = 2
    SLOPING = 3


@dataclass(frozen=True, eq=False)
class Marking:
    """Contacts to be outlined: what each is, by code; codes without a colour stay unmarked, those
    with a text are in the legend; ``width`` (n,) is each line's share of the widest."""

    contacts: Contacts
    kind: IntArray
    colours: Mapping[Any, str]
    texts: Mapping[Any, str] = field(default_factory=dict)
    width: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Decal:
    """A flat convex shape (k, 3) that lies on a block (index in the scene) and moves with it."""

    points: FloatArray
    block: int
    colour: str
    lift: float = 1.0


@dataclass(frozen=True)
class Arrow:
    """A force as drawn: from ``tail`` to ``tip`` (3,), of a load case, and what it is in words."""

    tail: tuple[float, ...]
    tip: tuple[float, ...]
    case: str
    text: str


@dataclass(frozen=True)
class Mark:
    """A place (3,) that needs a look, and why in words."""

    at: tuple[float, ...]
    text: str


@dataclass(frozen=True, eq=False)
class Annotations:
    """Arrows and marks of a scene, and ids of blocks to blame for a refusal."""

    arrows: tuple[Arrow, ...] = ()
    marks: tuple[Mark, ...] = ()
    culprits: frozenset[str] = frozenset()
    refusal: str = ""


def annotated(scene: Scene, refusal: InputError | None = None) -> Annotations:
    """Loads, near misses and what ``refusal`` blames; contacts are not asked for with one."""
    if refusal is None:
        unit = scene.units.length
        misses = (Mark(tuple(m.place.tolist()), m.sentence(unit)) for m in scene.near_misses)
        return Annotations(tuple(_arrows(scene)), tuple(misses))
    points = refusal.points if isinstance(refusal, GeometryError) else np.empty((0, 3))
    blamed = refusal.blocks if isinstance(refusal, GeometryError) else ()
    marks = tuple(Mark(tuple(p), "here") for p in points.tolist())
    return Annotations(tuple(_arrows(scene)), marks, frozenset(blamed), str(refusal))


def refused(scene: Scene) -> InputError | None:
    """Why the scene's geometry is refused, None if it is not."""
    try:
        len(scene.contacts)
    except InputError as error:
        return error
    return None


def joint_kinds(scene: Scene, contacts: Contacts) -> IntArray:
    """:class:`JointKind` of every contact, by its normal."""
    steep = np.abs(contacts.axes[:, 2] @ upright(scene))
    kind = np.full(len(contacts), JointKind.SLOPING, dtype=np.int64)
    kind[steep >= np.cos(np.radians(LEVEL_WITHIN))] = JointKind.BED
    kind[steep <= np.sin(np.radians(LEVEL_WITHIN))] = JointKind.HEAD
    return kind


def _arrows(scene: Scene) -> Iterator[Arrow]:
    for case, load in (("dead", scene.dead), ("live", scene.live)):
        parts = list(_parts(scene, load))
        largest = max((float(np.linalg.norm(force)) for _, force, _ in parts), default=0.0)
        for at, force, text in parts:
            size = float(np.linalg.norm(force))
            if not size > 0.0:
                continue
            length = max(SHORTEST, LONGEST * size / largest) * free_size(scene)
            ends = (at - length * force / size, at)
            if text.startswith("resultant"):
                ends = (at, at + length * force / size)
            words = f"{case} load, {text}: {size:.4g} {scene.units.force}"
            yield Arrow(tuple(ends[0].tolist()), tuple(ends[1].tolist()), case, words)


def _parts(scene: Scene, load: Load) -> Iterator[tuple[FloatArray, FloatArray, str]]:
    """Point, force and name of what a load consists of; body forces as one resultant."""
    blocks = [scene.blocks[i] for i in scene.free]
    body = replace(load, forces={}, points=(), pressures=(), weights={}).actions(blocks)
    total = body.force.sum(axis=0)
    sizes = np.linalg.norm(body.force, axis=1)
    if sizes.any():
        yield (sizes @ body.at) / sizes.sum(), total, "resultant of the blocks' weights"
    per_area = f"{scene.units.force}/{scene.units.length}\u00b2"
    singles = [
        *((Load(forces={k: f}), f"at the centroid of {k}") for k, f in load.forces.items()),
        *((Load(weights={k: f}), f"from the weight of {k}") for k, f in load.weights.items()),
        *((Load(points=(p,)), f"at a point of {p.block}") for p in load.points),
        *(
            (Load(pressures=(p,)), f"pressure {p.pressure:.4g} {per_area} on {p.block}")
            for p in load.pressures
        ),
    ]
    named = {block.id: block for block in blocks}
    for single, text in singles:
        block = named.get(next(iter(single.named)))
        if block is not None:
            what = single.actions([block])
            acting = int(np.linalg.norm(what.force, axis=1).argmax())
            yield what.at[acting], what.force[acting], text
