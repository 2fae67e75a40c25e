"""What a page states so that somebody can do it again by hand: the scene's numbers, loads part by
part with their resultants, and the mechanism as bodies whose powers give the load factor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.results.movement import motion
from cvxlimit.scene import Load, Scene
from cvxlimit.solution import LOAD_FACTOR, Solution
from cvxlimit.solution.kinematics import ContactKind, velocity_of

LONGEST_NAME, MOST_NAMES = 40, 6
"""Largest numbers of characters of a name and of names in a list, so that any structure fits."""

Rows = Iterator[tuple[str, str]]

HEAD = ("object", "author", "place and date")
"""What a page begins with: lines to fill in, or what notes say."""

SOURCES = ("friction", "weight per volume", "earth and water", "ties", "reactions")
"""Values of which somebody who checks asks where they come from."""

BLANK = "." * 40
"""A line to fill in by hand."""


class Stated:
    """What the author of a page states in ``notes``: its head, where values come from, and more."""

    def __init__(self, notes: Mapping[str, str]) -> None:
        self.notes = {str(name): str(text) for name, text in notes.items()}

    def source(self, name: str) -> str:
        """What is stated under a name, or a line to fill in."""
        return self.notes.get(name, BLANK)

    def sourced(self, name: str, value: str) -> str:
        """A value with where it comes from."""
        return f"{value}; source: {self.source(name)}"

    def others(self) -> Rows:
        """Yields what has no place of its own."""
        yield from ((k, v) for k, v in self.notes.items() if k not in (*HEAD, *SOURCES))


def structure(scene: Scene, stated: Stated) -> Rows:
    """Yields facts about blocks, supports, contacts, ties and reactions."""
    unit = scene.units
    free = [scene.blocks[i] for i in scene.free]
    yield "free blocks", f"{len(free)}, weight {scene.total_weight:.6g} {unit.force}"
    yield "supports", f"{len(scene.supports)}: {names(scene.supports)}"
    size = np.ptp(np.concatenate([block.vertices for block in free]), axis=0)
    yield "extent of them all", vector(size, unit.length, " x ")
    density = np.array([block.density or 0.0 for block in free])
    weight = f"{span(density)} {unit.force}/{unit.length}³"
    yield "weight per volume", stated.sourced("weight per volume", weight)
    tolerance = "one hundredth of the thinner block's mean thickness"
    if scene.joint_tolerance is not None:
        tolerance = f"{scene.joint_tolerance:g} {unit.length}"
    joints = len(scene.contacts.faces)
    yield "contacts", f"{joints}, found within a joint tolerance of {tolerance}"
    for tie in scene.ties[:MOST_NAMES]:
        ends = (f"{names([name])} at {vector(at)}" for name, at in zip((tie.a, tie.b), (
            tie.start, tie.end), strict=True))  # fmt: skip
        yield (
            "tie",
            f"anchored in {' and '.join(ends)} {unit.length}, yields at {tie.yield_force:g} "
            f"{unit.force}; assumed by: {stated.source('ties')}",
        )
    if len(scene.ties) > MOST_NAMES:
        yield "ties", f"and {len(scene.ties) - MOST_NAMES} more"
    if scene.reactions:
        yield (
            "reactions",
            "forces of a fixed direction, each as large as equilibrium needs, up to its bound; "
            f"source: {stated.source('reactions')}",
        )
    for own in _alike(scene.reactions, lambda each: each.direction):
        at, most = np.array([each.at for each in own]), np.array([each.most for each in own])
        middle = most @ at / most.sum() if 0.0 < most.sum() < np.inf else at.mean(axis=0)
        yield (
            f"reactions along {vector(np.round(own[0].direction, 6))}",
            f"{len(own)} on {names(unique(each.block for each in own))}: at most "
            f"{span(most)} {unit.force} each, {most.sum():.6g} in all, at {vector(middle)} "
            f"{unit.length} on average",
        )
    yield from (("simplified", remark) for remark in scene.told)
    if not scene.told:
        yield "simplified", "nothing: gaps, overlaps and faces are as the scene has them"


def loads(scene: Scene, solution: Solution, stated: Stated) -> Rows:
    """Yields both load cases, each part with its resultant."""
    blocks = [scene.blocks[i] for i in scene.free]
    for case, load, forces in (
        ("dead", scene.dead, scene.dead_forces),
        ("live", scene.live, scene.live_forces),
    ):
        if case == "live" and solution.quantity != LOAD_FACTOR:
            continue  # a reaction is under the dead load alone
        parts = [*_parts(load, scene)]
        for text, part in parts:
            yield f"{case} load", f"{text}: {_resultant(scene, scene.free, part.on(blocks))}"
        if len(parts) != 1:
            yield f"{case} load, all of it", _resultant(scene, scene.free, forces)
        if load.pressures:
            yield f"{case} pressures", f"source: {stated.source('earth and water')}"
    if solution.quantity == LOAD_FACTOR:
        yield "load factor", "multiplies the live load alone"
    yield "through", "a point on the line along which a resultant acts"


def _weights(load: Load) -> str:
    """Returns in words what of a load is a multiple of weights."""
    said = [] if load.gravity is None else [f"own weight along {vector(load.gravity)}"]
    if load.acceleration is not None:
        said.append(f"weights times {vector(load.acceleration)}")
    said += [
        f"weights times {vector(each.acceleration)}, growing from nothing at "
        f"{vector(each.base)} to that at {vector(each.top)}"
        for each in load.growing
    ]
    if load.weights:
        said.append(f"multiples of their own for {len(load.weights)} blocks")
    return "; ".join(said)


def _parts(load: Load, scene: Scene) -> Iterator[tuple[str, Load]]:
    """Yields the parts of a load that have a resultant of their own, each with what it is."""
    if text := _weights(load):
        yield text, replace(load, forces={}, points=(), pressures=())
    if load.forces:
        yield f"forces at {len(load.forces)} centroids", Load(forces=load.forces)
    if load.points:
        on = unique(each.block for each in load.points)
        text = f"forces at {len(load.points)} points of {names(on)}"
        yield text, Load(points=load.points)
    own, per = {block.id: block for block in scene.blocks}, scene.units.force
    groups = [*_alike(load.pressures, lambda each: (*each.normal, *each.gradient))]
    if len(groups) > MOST_NAMES:  # as on curved faces
        groups = [*_alike(load.pressures, lambda each: [np.linalg.norm(each.gradient)])]
    for group in groups:
        first, on = group[0], unique(each.block for each in group)
        values = np.array([x for each in group for x in each.extent(own[each.block])])
        text = f"pressure of {span(values)} {per}/{scene.units.length}² on {names(on)}"
        if slope := float(np.linalg.norm(first.gradient)):
            text += f", growing by {slope:.6g} {per}/{scene.units.length}³"
        yield text, Load(pressures=group)


def _resultant(scene: Scene, blocks: Sequence[int] | IntArray, forces: FloatArray) -> str:
    """Returns in words the sum of forces and moments (n, 6) about the centroids of ``blocks``, and
    the point of its line nearest their middle."""
    centres = np.array([scene.blocks[i].centroid for i in blocks])
    total, middle = forces[:, :3].sum(axis=0), centres.mean(axis=0)
    moment = (np.cross(centres - middle, forces[:, :3]) + forces[:, 3:]).sum(axis=0)
    text = vector(total, scene.units.force)
    size = float(np.linalg.norm(total))
    if size <= 1e-9 * np.abs(forces[:, :3]).sum():
        return text
    at = middle + np.cross(total, moment) / size**2
    return f"{text} through {vector(at, scene.units.length)}"


def joints(scene: Scene, stated: Stated) -> Rows:
    """Yields friction and strengths, with exceptions."""
    area = f" {scene.units.force}/{scene.units.length}²"
    for what, each in PROPERTIES.items():
        value, own = getattr(scene, what), getattr(scene, f"contact_{what}")
        text = "unlimited" if value == np.inf else f"{value:g}"
        if value not in (0.0, np.inf) and each.metadata["per_area"]:
            text += area
        if own:
            pairs = names([f"{a} - {b}" for a, b in own])
            text += f"; {span(np.array([*own.values()]))} at {len(own)}: {pairs}"
        yield what.replace("_", " "), stated.sourced(what, text) if what in SOURCES else text


def mechanism(scene: Scene, solution: Solution) -> Rows:
    """Yields which joints open, slide and twist, how bodies move, and what the loads do on it."""
    if not solution.mechanism:
        return
    moving, contacts = motion(scene, solution), scene.contacts
    for kind in (ContactKind.OPENS, ContactKind.SLIDES, ContactKind.TWISTS):
        which = np.flatnonzero((moving.contacts.kind == kind) & ~contacts.is_point).tolist()
        if which:
            text = (
                f"{len(which)} of {len(contacts.faces)}: {names(contacts.names[j] for j in which)}"
            )
            yield f"joints {_DO[kind]}", text
    free = np.array(scene.free)
    power = float(scene.live_forces.ravel() @ moving.rates[free].ravel())
    is_balanced = power > 0.0 and solution.quantity == LOAD_FACTOR and not solution.from_rest
    rates = moving.rates / power if is_balanced else moving.rates
    for i, block in enumerate(scene.blocks):
        if block.id in scene.supports and np.any(rates[i]):  # along it the reaction is meant
            yield f"support {block.id}", _moves(scene, i, rates)
    acting = {"dead load": scene.dead_forces}
    if solution.quantity == LOAD_FACTOR:
        acting["live load"] = scene.live_forces
    acting |= {what: forces[free] for what, forces in _holding(scene, rates).items()}
    yield from _bodies(scene, rates, acting)
    if is_balanced and solution.load_factor is not None:
        yield _balance(rates[free], acting, solution.load_factor)


_DO = {ContactKind.OPENS: "open", ContactKind.SLIDES: "slide", ContactKind.TWISTS: "twist"}


def _holding(scene: Scene, rates: FloatArray) -> dict[str, FloatArray]:
    """Returns forces and moments (n_blocks, 6) of ties that lengthen and of reactions that are
    pushed back, at their bounds."""
    place = {block.id: i for i, block in enumerate(scene.blocks)}
    found = {name: np.zeros((len(scene.blocks), 6)) for name in ("ties", "reactions")}
    speed = float(np.abs(rates).max())

    def add(
        what: str, ends: Sequence[tuple[str | None, Any]], line: Any, least: float, most: float
    ) -> None:
        """Adds a force along ``line`` on the first end, and its opposite on the other one."""
        back, own = 0.0, [(place[name], np.array(at)) for name, at in ends if name is not None]
        signs = [1.0 if name == ends[0][0] else -1.0 for name, _ in ends if name is not None]
        for sign, (block, at) in zip(signs, own, strict=True):
            moved = velocity_of(scene, rates, at[None], np.array([block]))[0]
            back -= sign * float(np.dot(line, moved))
        size = 0.0 if abs(back) <= 1e-6 * speed else most if back > 0.0 else least
        for sign, (block, at) in zip(signs, own, strict=True):
            force = sign * size * np.array(line)
            arm = at - scene.blocks[block].centroid
            found[what][block] += [*force, *np.cross(arm, force)]

    for tie in scene.ties:
        line = np.subtract(tie.end, tie.start) / tie.length
        add("ties", [(tie.a, tie.start), (tie.b, tie.end)], line, 0.0, tie.yield_force)
    for each in scene.reactions:
        ends = [(each.block, each.at), (each.on, each.at)]
        add("reactions", ends, each.direction, each.least, each.most)
    return found


def _bodies(scene: Scene, rates: FloatArray, acting: Mapping[str, FloatArray]) -> Rows:
    """Yields blocks that move alike as one body, the heaviest first: what acts on it, and how it
    moves."""
    free = np.array(scene.free)
    still = 1e-6 * float(np.abs(rates).max())
    origin = velocity_of(scene, rates, np.zeros((len(free), 3)), free)
    alike = np.hstack([origin, rates[free, 3:]]) / (still or 1.0)
    groups = [*_alike(range(len(free)), lambda k: alike[k], -1)]
    groups = [own for own in groups if np.abs(rates[free[own]]).max() > still]
    groups.sort(key=lambda own: -sum(scene.blocks[free[k]].weight for k in own))
    for own in groups[:MOST_NAMES]:
        forces = [
            f"{what} {_resultant(scene, free[own], each[own])}"
            for what, each in acting.items()
            if np.abs(each[own]).any()
        ]
        which = _run([scene.blocks[i].id for i in free], own)
        yield (
            f"body of {len(own)} block{'s' * (len(own) != 1)}",
            f"{which} {_moves(scene, free[own[0]], rates)}; on it {', '.join(forces) or 'nothing'}",
        )
    if len(groups) > MOST_NAMES:
        yield "more bodies", f"{len(groups) - MOST_NAMES}, lighter, in the balance below"


def _run(every: Sequence[str], own: Sequence[int]) -> str:
    """Returns the names of some blocks, first and last where all between are among them."""
    if len(own) > 2 and own[-1] - own[0] == len(own) - 1:
        return f"{names([every[own[0]]])} to {names([every[own[-1]]])}"
    return names(every[k] for k in own)


def _moves(scene: Scene, block: int, rates: FloatArray) -> str:
    """Returns in words how a block moves: by a translation, about an axis, or both."""
    small = 1e-6 * float(np.abs(rates).max())
    shift, turn = (np.where(np.abs(x) > small, x, 0.0) for x in np.split(rates[block], 2))
    if not turn.any():
        return f"moves by {vector(shift)}"
    along = float(shift @ turn) / float(turn @ turn) * turn
    axis = scene.blocks[block].centroid + np.cross(turn, shift) / float(turn @ turn)
    axis = np.where(np.abs(axis) > 1e-6 * np.abs(scene.blocks[block].vertices).max(), axis, 0.0)
    said = f"turns by {vector(turn)} about an axis through {vector(axis, scene.units.length)}"
    return said + (f" and moves along it by {vector(along)}" if np.abs(along).max() > small else "")


def _balance(
    rates: FloatArray, acting: Mapping[str, FloatArray], load_factor: float
) -> tuple[str, str]:
    """Returns the powers whose sum is the load factor, on a mechanism with live power 1; the rest
    is what friction and strengths of joints take up."""
    terms = {
        what: -float(forces.ravel() @ rates.ravel())
        for what, forces in acting.items()
        if what != "live load"
    }
    rest = load_factor - sum(terms.values())
    if abs(rest) > 1e-5 * max(abs(load_factor), *map(abs, terms.values())):
        terms["friction and strength of joints"] = rest
    said = " + ".join(f"{value:.6g} ({what})" for what, value in terms.items() if value)
    return (
        "balance of powers",
        f"that of the live load is 1 (force times rate); against it {said or '0'} = "
        f"{load_factor:.6g}, the load factor",
    )


def _alike(
    things: Iterable[Any], key: Callable[[Any], Any], digits: int = 6
) -> Iterator[list[Any]]:
    """Yields lists of things whose keys (numbers) are equal to so many decimals."""
    groups: dict[tuple[float, ...], list[Any]] = {}
    for thing in things:
        rounded = np.round(np.asarray(key(thing), dtype=float), digits) + 0.0  # no -0
        groups.setdefault(tuple(rounded.tolist()), []).append(thing)
    yield from groups.values()


def unique(found: Iterable[str]) -> list[str]:
    """Returns each once, in their order."""
    return [*dict.fromkeys(found)]


def names(found: Iterable[str]) -> str:
    """Returns the first of names, each cut, and how many there are besides."""
    every, most = [*found], LONGEST_NAME
    short = [x if len(x) <= most else f"{x[: most - 1]}…" for x in every[:MOST_NAMES]]
    more = len(every) - len(short)
    return (", ".join(short) or "none") + (f" and {more} more" if more > 0 else "")


def span(values: FloatArray) -> str:
    """Returns the least and the largest value, or the one that all have."""
    low, high = float(values.min()), float(values.max())
    return f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"


def vector(values: Any, unit: str = "", between: str = ", ") -> str:
    """Returns numbers as a vector in words, with zero for rounding."""
    numbers = np.asarray(values, dtype=float)
    small = np.abs(numbers) <= 1e-9 * np.abs(numbers).max(initial=0.0)
    text = between.join(f"{x:.6g}" for x in np.where(small, 0.0, numbers).tolist())
    return f"{text if between != ', ' else f'({text})'} {unit}".rstrip()
