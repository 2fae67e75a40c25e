"""What is drawn besides blocks: joints, arrows of loads, marks, crushed zones and ties."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.contacts import COLUMN, Contacts, pressure_centres
from cvxlimit.plotting.camera import upright
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import Motion, displaced, free_size
from cvxlimit.results.utilisation import contact_forces
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Load
from cvxlimit.scene.pressures import Pressure
from cvxlimit.solution import Solution

LEVEL_WITHIN = 10.0
"""Degrees off level or upright up to which a joint counts as bed or head joint."""

LONGEST, SHORTEST = 0.15, 0.05
"""Length of the arrows of the largest and of tiny forces, and of the largest resultant and the
largest gain by a move, relative to the free blocks' size."""


class JointKind(IntEnum):
    """How a contact lies with respect to the dead load."""

    BED = 1
    HEAD = 2
    SLOPING = 3


@dataclass(frozen=True, eq=False)
class Marking:
    """Contacts to be outlined: the ``kind`` (n,) of each, with colours and texts by kind; kinds
    with a text are in the legend, and ``width`` (n,) is each line's width over the widest."""

    contacts: Contacts
    kind: IntArray
    colours: Mapping[Any, str]
    texts: Mapping[Any, str] = field(default_factory=dict)
    width: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Decal:
    """A flat convex shape: corners (k, 3) on a block (its number in the scene), with which it
    moves."""

    points: FloatArray
    block: int
    colour: str
    lift: float = 1.0


@dataclass(frozen=True)
class Arrow:
    """A force as drawn: from ``tail`` to ``tip`` (3,), with its load case, a text, and whether it
    is the ``total`` of what acts on all blocks."""

    tail: tuple[float, ...]
    tip: tuple[float, ...]
    case: str
    text: str
    total: bool = False


@dataclass(frozen=True)
class Mark:
    """A place ``at`` (3,) that needs a look, with a text that says why."""

    at: tuple[float, ...]
    text: str


@dataclass(frozen=True, eq=False)
class Annotations:
    """Arrows and marks of a scene, the ids of blocks to blame for a ``refusal``, and the largest
    force of each load case whose arrows are to scale."""

    arrows: tuple[Arrow, ...] = ()
    marks: tuple[Mark, ...] = ()
    culprits: frozenset[str] = frozenset()
    refusal: str = ""
    largest: Mapping[str, float] = field(default_factory=dict)


def annotated(scene: Scene, refusal: InputError | None = None) -> Annotations:
    """Returns loads and near misses, or with a ``refusal`` loads and what it blames; contacts are
    then not looked for."""
    if refusal is None:
        unit = scene.units.length
        misses = (Mark(tuple(m.place.tolist()), m.sentence(unit)) for m in scene.near_misses)
        return Annotations(tuple(_arrows(scene)), tuple(misses))
    points = refusal.points if isinstance(refusal, GeometryError) else np.empty((0, 3))
    blamed = refusal.blocks if isinstance(refusal, GeometryError) else ()
    marks = tuple(Mark(tuple(p), "here") for p in points.tolist())
    return Annotations(tuple(_arrows(scene)), marks, frozenset(blamed), str(refusal))


def without_live_load(notes: Annotations) -> Annotations:
    """Returns what is drawn of a structure under its dead load alone."""
    return replace(notes, arrows=tuple(a for a in notes.arrows if a.case != "live"))


def loads_to_scale(scene: Scene, live: float) -> Annotations:
    """Returns the loads at load factor ``live``, arrows in proportion to forces. Each case has a
    scale of its own, since a push may be a hundredth of the weights."""
    largest = {}
    for case, load, times in (("dead", scene.dead, 1.0), ("live", scene.live, live)):
        sizes = [float(np.linalg.norm(times * force)) for _, force, _ in _parts(scene, load)]
        if any(sizes):  # no load, or a load factor of zero
            largest[case] = max(sizes)
    arrows = (arrow for arrow in _arrows(scene, live) if arrow.case in largest)
    return replace(annotated(scene), arrows=tuple(arrows), largest=largest)


def refused(scene: Scene) -> InputError | None:
    """Returns why the scene's geometry is refused, None if it is not."""
    try:
        len(scene.contacts)
    except InputError as error:
        return error
    return None


def joint_kinds(scene: Scene, contacts: Contacts) -> IntArray:
    """Returns the :class:`JointKind` (n,) of each contact, by its inclination."""
    steep = np.abs(contacts.axes[:, 2] @ upright(scene))
    kind = np.full(len(contacts), JointKind.SLOPING, dtype=np.int64)
    kind[steep >= np.cos(np.radians(LEVEL_WITHIN))] = JointKind.BED
    kind[steep <= np.sin(np.radians(LEVEL_WITHIN))] = JointKind.HEAD
    return kind


def _arrows(scene: Scene, live: float | None = None) -> Iterator[Arrow]:
    """Yields an arrow for each part of both loads: between ``SHORTEST`` and ``LONGEST``, or with a
    load factor ``live``, whose sign turns those of the live load, in proportion to forces."""
    least = SHORTEST if live is None else 0.0
    for case, load in (("dead", scene.dead), ("live", scene.live)):
        turned = -1.0 if case == "live" and live is not None and live < 0.0 else 1.0
        parts = [part for part in _parts(scene, load) if part[1].any()]
        largest = max((float(np.linalg.norm(force)) for _, force, _ in parts), default=0.0)
        for at, force, text in parts:
            size = float(np.linalg.norm(force))
            length = max(least, LONGEST * size / largest) * free_size(scene)
            along = turned * length * force / size
            total = text.startswith("resultant")
            tail, tip = (at, at + along) if total else (at - along, at)
            words = f"{case} load, {text}: {size:.4g} {scene.units.force}"
            yield Arrow(tuple(tail.tolist()), tuple(tip.tolist()), case, words, total)


def _parts(scene: Scene, load: Load) -> Iterator[tuple[FloatArray, FloatArray, str]]:
    """Yields point of action (3,), force (3,) and text of each part of a load."""
    blocks = [scene.blocks[i] for i in scene.free]
    body = replace(load, forces={}, points=(), pressures=(), weights={}).actions(blocks)
    total = body.force.sum(axis=0)
    sizes = np.linalg.norm(body.force, axis=1)
    if sizes.any():
        yield (sizes @ body.at) / sizes.sum(), total, "resultant of the blocks' weights"
    singles = [
        *((Load(forces={k: f}), f"at the centroid of {k}") for k, f in load.forces.items()),
        *((Load(weights={k: f}), f"from the weight of {k}") for k, f in load.weights.items()),
        *((Load(points=(p,)), f"at a point of {p.block}") for p in load.points),
        *(
            (Load(pressures=(p,)), f"{_pressure_text(p, scene)} on {p.block}")
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


def _pressure_text(pressure: Pressure, scene: Scene) -> str:
    """Returns a pressure in words, with its units."""
    units = f"{scene.units.force}/{scene.units.length}"
    text = f"pressure {pressure.pressure:.4g} {units}\u00b2"
    slope = float(np.linalg.norm(pressure.gradient))
    return f"{text} that grows by {slope:.4g} {units}\u00b3" if slope else text


_AT_STRENGTH = 1e-3
"""Share of its strength that a contact or a tie may lack and still counts as yielding."""


def crushed_zones(scene: Scene, forces: FloatArray) -> dict[int, FloatArray]:
    """Returns the corners (4, 3) of the crushed zone by number of the contact.

    ``forces`` (n, 6) are V1 V2 N M1 M2 MT, N > 0 in compression.

    A contact crushes where the pressure that its normal force and moments need is the strength: on
    the effective rectangle around the pressure centre (Eq. 26), which no smaller one could bear.
    """
    c, normal = scene.contacts, forces[:, COLUMN["N"]]
    centre, _ = pressure_centres(c, forces)
    half = c.sides / 2.0 - np.abs(centre)
    is_limited = np.isfinite(c.compressive_strength)
    strength = np.where(is_limited, c.compressive_strength, 0.0)
    can_crush = is_limited & c.is_rectangle & ~np.isnan(half[:, 0])
    can_crush &= ~c.is_point
    most = (1.0 - _AT_STRENGTH) * strength * 4.0 * half.prod(axis=1)
    is_full = (half <= 0.0).any(axis=1) | (normal >= most)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return {
        j: c.origin[j] + (centre[j] + signs * np.maximum(half[j], 0.0)) @ c.axes[j, :2]
        for j in np.flatnonzero(can_crush & is_full).tolist()
    }


def yielding(scene: Scene, forces: FloatArray) -> BoolArray:
    """Returns whether each tie yields under contact forces (n, 6); ties are the first points."""
    ties = np.flatnonzero(scene.contacts.is_point)[: len(scene.ties)]
    tension = -forces[ties, COLUMN["N"]]
    strength = np.array([tie.yield_force for tie in scene.ties])
    return np.asarray(tension >= (1.0 - _AT_STRENGTH) * strength)


@dataclass(frozen=True, eq=False)
class Shape:
    """A crushed zone, or a tie as a line: its ``points`` (k, 3), their movements in the drawn
    mechanism (``moves``, (k, 3)), a text about it, and the ``label`` of its kind in the legend."""

    points: FloatArray
    moves: FloatArray
    colour: str
    text: str
    label: str

    @property
    def is_zone(self) -> bool:
        return len(self.points) > 2


def shapes_of(scene: Scene, solution: Solution, moving: Motion) -> list[Shape]:
    """Returns the crushed zones and the ties of a solution, as the drawn mechanism moves them."""
    forces = contact_forces(scene, solution)
    if forces is None:
        return []

    def shape(points: FloatArray, blocks: list[int], colour: str, text: str, label: str) -> Shape:
        moves = displaced(scene, moving, points, np.array(blocks)) - points
        return Shape(points, moves, colour, text, label)

    result = []
    contacts = scene.contacts
    for j, corners in crushed_zones(scene, forces).items():
        text = f"crushed zone of {contacts.names[j]}"
        blocks = [int(contacts.a[j])] * len(corners)
        result.append(shape(corners, blocks, Style.crushed, text, "crushed zone"))
    place = {block.id: i for i, block in enumerate(scene.blocks)}
    for tie, yields in zip(scene.ties, yielding(scene, forces), strict=True):
        points = np.array([tie.start, tie.end])
        colour = Style.yielding if yields else Style.tie
        text = f"tie {tie.a}-{tie.b} {'yields at' if yields else 'below'} {tie.yield_force:g}"
        label = "tie yields" if yields else "tie"
        result.append(shape(points, [place[tie.a], place[tie.b]], colour, text, label))
    return result
