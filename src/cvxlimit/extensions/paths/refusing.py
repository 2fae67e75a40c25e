"""Scenes that have no path, or none that is known yet, each refused by the property at fault."""

from __future__ import annotations

import numpy as np

from cvxlimit.errors import ModelError, NoAnswerError
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution, Status


def refuse(scene: Scene) -> None:
    """Scenes of which no path is known yet, each with the way round."""
    contacts, has = scene.contacts, None
    way = "leave it out"
    if contacts.is_point.any():
        first = contacts.names[int(np.argmax(contacts.is_point))]
        has = f"{'ties' if scene.ties else 'reactions'}, as {first}"
        way = "give the force that it is to have as a point load, which moves with its block"
    for name, none in (
        ("cohesion", 0.0), ("tensile_strength", 0.0), ("compressive_strength", np.inf)
    ):  # fmt: skip
        value = np.asarray(getattr(contacts, name))
        if has is None and (value != none).any():
            j = int(np.argmax(value != none))
            has = f"{name.replace('_', ' ')}, {value[j]:g} at contact {contacts.names[j]}"
    for load, name in ((scene.dead, "dead"), (scene.live, "live")):
        if load.pressures:
            if has is None:
                way = "give its resultant as a point load, which keeps its direction"
            has = has or f"pressures in the {name} load, as on block {load.pressures[0].block!r}"
        if load.growing:
            has = has or f"inertia that grows with height in the {name} load"
    if has:
        raise ModelError(
            f"scene {scene.name!r} has {has}: paths know dry friction, and loads that do not turn "
            f"with the blocks; {way}, or solve for the load factor alone"
        )


def refuse_answer(initial: Solution) -> None:
    """Scenes whose path does not begin."""
    why = ""
    if initial.status is Status.DEAD_LOAD_UNSTABLE or initial.lower_end is not None:
        why = "the dead load does not stand alone"
    elif initial.status is Status.LIVE_LOAD_HARMLESS:
        why = "the live load does no harm, so that nothing moves under it"
    elif initial.status is Status.UNBOUNDED:
        why = "its load factor has no limit with dilatancy: flow='zero-dilatancy' may begin one"
    elif initial.load_factor is None:
        why = f"its load factor was not found ({initial.status})"
    if why:
        raise NoAnswerError(f"no path begins at scene {initial.scene.name!r}: {why}")
