"""Friction without dilatancy: what members the built-in and random walls have, and what they cost.

python -m benchmarks.dilatancy walls               Ferris & Tin-Loi 1-3, lowest and highest member
python -m benchmarks.dilatancy space               tuff wall, panel S12 and others, to 1e-4
python -m benchmarks.dilatancy unique --walls 50   how often random walls have one answer
python -m benchmarks.dilatancy gilbert             Gilbert's scheme beside it
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable

from cvxlimit import Scene, Solution, Status, builtin_scene, solve
from cvxlimit.masonry import random_wall
from cvxlimit.methods.dilatancy.gilbert import Gilbert
from cvxlimit.methods.dilatancy.zero_dilatancy import ZeroDilatancy

PLANE = ("ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3")

SPACE = ("tuff-wall", "barrel-vault", "dome", "facade", "house-corner", "s12-panel")

SAME = 1e-4
"""Relative spread of members below which an answer counts as unique: in space their residuals move
load factors by up to about that."""


def say(*cells: object) -> None:
    """One line of a table in Markdown."""
    sys.stdout.write(f"| {' | '.join(map(str, cells))} |\n")
    sys.stdout.flush()


def head(*cells: str) -> None:
    """The first line of a table, and the one that parts it from the others."""
    say(*cells)
    say(*["---"] * len(cells))


def seconds_of(work: Callable[[], Solution]) -> tuple[Solution, float]:
    """CPU seconds: what else the machine does counts little."""
    start = time.process_time()
    return work(), time.process_time() - start


def row(scene: Scene, rule: ZeroDilatancy) -> Solution:
    """One scene: associated factor, members, residuals, time in first conic solves."""
    associated, first = seconds_of(lambda: solve(scene, model="full"))
    found, seconds = seconds_of(lambda: solve(scene, method=rule))
    residual = max((member.residual for member in found.members), default=float("nan"))
    members = found.members
    ends = members[:: max(len(members) - 1, 1)]
    span = " to ".join(f"{member.load_factor:.6f}" for member in ends)
    cost = f"{seconds:.1f}", f"{seconds / first:.0f}"
    factor = f"{associated.load_factor:.6f}"
    say(scene.name, factor, found.status, span, len(members), f"{residual:.1e}", *cost)
    return found


HEAD = ("scene", "associated", "status", "members", "number", "largest residual",
        "CPU s", "in units of the associated solve")  # fmt: skip


def walls(options: argparse.Namespace) -> None:
    """In the plane, to 1e-6."""
    head(*HEAD)
    for name in options.scenes or PLANE:
        row(builtin_scene(name), ZeroDilatancy(starts=options.starts))


def space(options: argparse.Namespace) -> None:
    """In space, to 1e-4."""
    head(*HEAD)
    for name in options.scenes or SPACE:
        rule = ZeroDilatancy(starts=options.starts, tolerance=1e-4, descents=options.descents)
        row(builtin_scene(name), rule)


def unique(options: argparse.Namespace) -> None:
    """Counts over random walls."""
    rule = ZeroDilatancy(tolerance=1e-5, starts=options.starts)
    counts = {"one answer": 0, "several": 0, "none found": 0, "no associated answer": 0}
    widest = 0.0
    for seed in range(options.walls):
        scene = random_wall(seed)
        if not solve(scene).status.has_answer:
            counts["no associated answer"] += 1
            continue
        found = solve(scene, method=rule)
        if found.status is not Status.CONVERGED:
            counts["none found"] += 1
            sys.stdout.write(f"{scene.name}: {found.note}\n")
            continue
        low, high = found.members[0].load_factor, found.members[-1].load_factor
        spread = (high - low) / max(abs(high), abs(low))
        widest = max(widest, spread)
        counts["one answer" if spread <= SAME else "several"] += 1
    head(*counts, "widest spread")
    say(*counts.values(), f"{widest:.3f}")


def gilbert(options: argparse.Namespace) -> None:
    """Where its stop on the load factor leaves Coulomb's law."""
    head("scene", "stops at a change of", "problems", "load factor", "status and check")
    for name in options.scenes or PLANE:
        for tolerance in (1e-3, 1e-5):
            found = solve(builtin_scene(name), method=Gilbert(tolerance=tolerance))
            worth = found.note.split(": ")[-1].split(";")[0]
            factor = f"{found.load_factor:.6f}"
            say(name, f"{tolerance:g}", len(found.history), factor, f"{found.status}: {worth}")


def main() -> None:
    """One of the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.dilatancy", description=__doc__)
    actions = {"walls": walls, "space": space, "unique": unique, "gilbert": gilbert}
    parser.add_argument("table", choices=actions)
    parser.add_argument("--scenes", nargs="*", help="built-in scenes, in place of the usual ones")
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("--descents", type=int, default=0, help="in space")
    parser.add_argument("--walls", type=int, default=50, help="random ones")
    options = parser.parse_args()
    actions[options.table](options)


if __name__ == "__main__":
    main()
