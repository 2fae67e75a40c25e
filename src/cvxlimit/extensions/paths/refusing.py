"""Scenes that have no path, or none that is known yet, each refused by the property at fault."""

from __future__ import annotations

from cvxlimit.errors import ModelError, NoAnswerError
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution, Status


def refuse(scene: Scene) -> None:
    """Scenes of which no path is known yet, each with the way round."""
    has = scene.contacts.first_of("tensile_strength", "compressive_strength")
    for load, name in ((scene.dead, "dead"), (scene.live, "live")):
        has = has or f"inertia that grows with height in the {name} load" * bool(load.growing)
    if has:
        raise ModelError(
            f"scene {scene.name!r} has {has}: paths do not know these; leave it out, or solve for "
            "the load factor alone"
        )


def no_path(initial: Solution) -> NoAnswerError | None:
    """Why no path begins at rest, if none does."""
    why = ""
    if not stands(initial):
        why = "the dead load does not stand alone"
    elif initial.status is Status.LIVE_LOAD_HARMLESS:
        why = "the live load does no harm, so that nothing moves under it"
    elif initial.status is Status.UNBOUNDED:
        why = "its load factor has no limit with dilatancy: flow='zero-dilatancy' may begin one"
    elif initial.load_factor is None:
        why = f"its load factor was not found ({initial.status})"
    return NoAnswerError(f"no path begins at scene {initial.scene.name!r}: {why}") if why else None


def stands(initial: Solution) -> bool:
    """Whether the dead load stands alone, as far as is known."""
    return initial.status is not Status.DEAD_LOAD_UNSTABLE and initial.lower_end is None
