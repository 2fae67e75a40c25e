"""Where a node is split: the contact that carries most of the gap, and where in its range.

A contact carries the more the more the relaxation's state violates Eq. 30 there, times the speed at
which the contact moves. Of the first nodes' best contacts several are tried, and the one kept
whose parts gain most.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cvxlimit.arrays import FloatArray
from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.interaction.branching.nodes import Explored, Goal, Node, Relaxer
from cvxlimit.methods.interaction.settings import NODES
from cvxlimit.methods.interaction.states.copies import Copies


def scores(relaxer: Relaxer, node: Node, free: NDArray[np.bool_] | None = None) -> FloatArray:
    """How much contacts (n,), or those that are ``free``, carry of the gap: excess of Eq. 30
    times speed."""
    assert node.forces is not None
    assert node.mechanism is not None
    speed = relaxer.speeds(node.mechanism)
    speed = speed + NODES.speed_at_rest * float(speed.max())
    width = np.ptp(node.boxes, axis=2).max(axis=1)
    # what is beyond that in a narrow box is the solver's, and no split takes it away
    most = width * np.maximum(node.forces[:, COLUMN["N"]], 0.0)
    excess = np.clip(relaxer.moments.excess(node.forces, relaxer.contacts), 0.0, most)
    counts = width > NODES.narrowest
    return np.where(counts if free is None else counts & free, excess * speed, 0.0)


def choices(relaxer: Relaxer, node: Node, goal: Goal) -> list[tuple[int, int, float]]:
    """Contacts, axes and fractions at which to split, the best first; none if nothing can."""
    if node.forces is None or node.mechanism is None:
        return _widest(node)
    tried = goal.tried
    seen, free = _beneath(relaxer, node, goal)
    if not free.all():
        tried = 1  # the halves of such contacts have one and the same bound at first
    score = scores(relaxer, seen, free)
    best = [j for j in np.argsort(-score)[:tried].tolist() if score[j] > 0.0]
    return [_place(relaxer, seen, j) for j in best] or _widest(node)


def _beneath(relaxer: Relaxer, node: Node, goal: Goal) -> tuple[Node, NDArray[np.bool_]]:
    """The node with forces and mechanism that tell what to split, and the contacts that count.

    Where a part of the scene collapses at a load factor that no split changes, all excess is
    at rest, and says nothing. With the contacts of that part glued the rest shows how it
    would collapse.
    """
    free = np.ones(len(relaxer.contacts), dtype=bool)
    seen = node
    for _ in range(NODES.layers):
        assert seen.forces is not None
        assert seen.mechanism is not None
        speed = relaxer.speeds(seen.mechanism)
        excess = np.maximum(relaxer.moments.excess(seen.forces, relaxer.contacts), 0.0)
        if float((excess * speed)[free].sum()) > NODES.at_rest * (node.bound - goal.lower):
            return seen, free
        glued = ~free | (speed > NODES.moves * float(speed.max()))
        copies = relaxer.moments.box_copies(relaxer.contacts, node.boxes).joined(node.added)
        state = relaxer.solve(copies, goal.price, np.flatnonzero(glued))
        factor = state.load_factor
        if state.forces is None or state.mechanism is None or factor is None:
            break
        if glued.all() or not node.bound - goal.width < factor < NODES.far * abs(node.bound):
            break
        seen, free = replace(node, forces=state.forces, mechanism=state.mechanism), ~glued
    return (node, np.ones(len(free), dtype=bool)) if seen is node else (seen, free)


def _place(relaxer: Relaxer, node: Node, contact: int) -> tuple[int, int, float]:
    assert node.forces is not None
    centre = relaxer.centre(node.forces)[contact]
    high = node.boxes[contact, :, 1]
    low, centre = relaxer.moments.folded(node.boxes[contact], centre)
    inner = np.maximum((high - centre) * (centre - low), 0.0) + 1e-3 * (high - low) ** 2
    axis = int(inner.argmax())
    return contact, axis, float(centre[axis])


def _widest(node: Node) -> list[tuple[int, int, float]]:
    width = np.ptp(node.boxes, axis=2)
    contact, axis = np.unravel_index(int(width.argmax()), width.shape)
    if width[contact, axis] <= NODES.narrowest:
        return []
    return [(int(contact), int(axis), float(node.boxes[contact, axis].mean()))]


def parts(
    relaxer: Relaxer, node: Node, contact: int, axis: int, at: float
) -> list[tuple[FloatArray, Copies]]:
    """Boxes with one range cut, and the copies that stay in them."""
    low, high = node.boxes[contact, axis]
    added = node.added.without(np.array([contact]))
    parts = []
    for ends in pairwise(relaxer.moments.split(low, high, at)):
        boxes = node.boxes.copy()
        boxes[contact, axis] = ends
        parts.append((boxes, added))
    return parts


def explore(relaxer: Relaxer, node: Node, goal: Goal) -> Explored:
    """Split a node."""
    relaxer.begun()
    best: tuple[float, list[Node]] | None = None
    for contact, axis, at in choices(relaxer, node, goal):
        children = [
            relaxer.evaluated(replace(node, boxes=boxes, added=added), goal)
            for boxes, added in parts(relaxer, node, contact, axis, at)
        ]
        gains = [node.bound - max(child.bound, goal.lower) for child in children]
        gain = min(gains) + 0.1 * float(np.mean(gains))
        if best is None or gain > best[0]:
            best = gain, children
        if max(child.bound for child in children) <= goal.cut:
            break
    if best is None:
        relaxer.closed = node.bound
    return relaxer.explored(best[1] if best else [], goal)
