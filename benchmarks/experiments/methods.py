"""CPU seconds of every method, default settings, a run each."""

from __future__ import annotations

from collections.abc import Sequence
from time import process_time

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.gilbert import Gilbert
from cvxlimit import builtin_scene, solve

SCENES = ("arch", "ferris-tin-loi-2", "tuff-wall", "facade", "house-corner")
METHODS = ("convex", "exact", "gilbert", "fixed-point", "certified", "zero-dilatancy")


@experiment(Part(5))
def methods(scenes: Sequence[str] = SCENES, names: Sequence[str] = METHODS) -> Lines:
    """Every method on some scenes; what has no answer stands in brackets."""
    yield Head("scene", "contacts", *(f"`{method}`" for method in names))
    for name in scenes:
        scene = builtin_scene(name)
        solve(scene)  # warms up
        yield name, len(scene.contacts), *(seconds(name, method) for method in names)


def seconds(name: str, method: str) -> str:
    """Of one run."""
    scene, start = builtin_scene(name), process_time()
    found = solve(scene, method=Gilbert() if method == Gilbert.name else method)
    text = f"{process_time() - start:.2g}"
    return text if found.status in ("certified", "converged") else f"({text})"
