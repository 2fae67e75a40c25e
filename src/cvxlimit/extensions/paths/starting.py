"""Scenes as paths take them: with contacts that a path may begin with, with the end of the way from
rest, where paths without dilatancy begin, and with pressures that keep their direction."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import Door
from cvxlimit.errors import CvxlimitError, GeometryError
from cvxlimit.geometry.detection import detect
from cvxlimit.methods.solving import solve
from cvxlimit.scene.loads import Load, PointForce
from cvxlimit.scene.scene import Scene
from cvxlimit.solution import Status


def for_path(scene: Scene) -> tuple[Scene, GeometryError | None]:
    """The scene with contacts as a path needs them, and why its own contacts are refused, if so.

    On a path blocks may touch at edges alone, and pairs that do not touch yet may have a friction
    of their own, which counts from where they do. Elsewhere both are refused.
    """
    # A block that is tied may touch no other, so all of them are taken for tied.
    refusal: GeometryError | None = None
    try:
        found = scene._detection
    except GeometryError as error:
        refusal, every = error, {block.id for block in scene.blocks}
        found = detect(
            scene.blocks, scene.supports, scene.friction, scene.joint_tolerance, tied=every
        )
    # The friction of pairs that do not touch yet waits until they do.
    touching = set(found.contacts.pairs)
    present = {pair: mu for pair, mu in scene.contact_friction.items() if pair in touching}
    if refusal is None and len(present) == len(scene.contact_friction):
        return scene, None
    contacts = scene._copy(contact_friction=present)._beside("_detection", found).contacts
    # Without any contact, lengths are compared with the size of blocks.
    if not len(contacts):
        size = float(np.median([scene.blocks[i].size for i in scene.free]))
        contacts.__dict__["typical_size"] = size
    return scene._with_contacts(contacts), refusal


@lru_cache(maxsize=1)  # of the scene of a path, for all of its runs
def from_rest(scene: Scene) -> tuple[float, FloatArray] | str:
    """The load factor and the rates (free blocks, 6) at the end of the way from rest, as method
    ``incremental`` finds it; or, in words, why a path cannot begin there."""
    methods = Door("cvxlimit.methods")
    if "incremental" not in methods:
        return str(methods.missing("incremental") or "no method goes it")
    if not len(scene.contacts):
        return "no joint bears anything at rest"
    if scene.contacts.cohesion.any():
        return "the cohesion of joints that have slipped is gone there"
    try:
        found = solve(scene, method=methods["incremental"](spread=False))
    except CvxlimitError as error:
        return str(error)
    if found.status is not Status.REACHED or found.mechanism is None or not found.steps:
        return f"that is: {found.status}"
    rates = np.array([found.mechanism[scene.blocks[i].id] for i in scene.free])
    return found.steps[-1].load_factor, rates


def with_resultants(scene: Scene) -> Scene:
    """The scene with forces in place of pressures: their resultants at the centres of pressure, and
    the moments that remain on faces that are not plane."""
    blocks = {block.id: block for block in scene.blocks}

    def without_pressures(load: Load) -> Load:
        points, forces = [*load.points], dict(load.forces)
        for each in load.pressures:
            at, force, moment = each.resultant(blocks[each.block])
            points.append(PointForce(each.block, tuple(at), tuple(force)))
            if moment.any():
                rest = np.concatenate([np.zeros(3), moment]) + forces.get(each.block, np.zeros(6))
                forces[each.block] = tuple(rest)
        return replace(load, points=points, forces=forces, pressures=())

    return scene._copy(dead=without_pressures(scene.dead), live=without_pressures(scene.live))
