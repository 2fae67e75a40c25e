"""``python -m benchmarks.methods``: CPU seconds of every method, default settings, a run each."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from time import process_time

from cvxlimit import builtin_scene, solve

SCENES = ("arch", "ferris-tin-loi-2", "tuff-wall", "facade", "house-corner")
METHODS = ("convex", "exact", "gilbert", "fixed-point", "certified", "zero-dilatancy")


def main(arguments: Sequence[str] | None = None) -> None:
    """One row per scene; what has no answer stands in brackets."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.methods", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--methods", nargs="+", default=METHODS)
    asked = parser.parse_args(arguments)
    say("scene", "contacts", *(f"`{method}`" for method in asked.methods))
    say(*["---"] * (2 + len(asked.methods)))
    for name in asked.scenes:
        scene = builtin_scene(name)
        size = len(scene.contacts)
        solve(scene)  # warms up
        say(name, size, *(seconds(name, method) for method in asked.methods))


def say(*cells: object) -> None:
    """A line of a table, at once."""
    sys.stdout.write(f"| {' | '.join(map(str, cells))} |\n")
    sys.stdout.flush()


def seconds(name: str, method: str) -> str:
    """Of one run."""
    scene, start = builtin_scene(name), process_time()
    found = solve(scene, method=method)
    text = f"{process_time() - start:.2g}"
    return text if found.status in ("certified", "converged") else f"({text})"


if __name__ == "__main__":
    main()
