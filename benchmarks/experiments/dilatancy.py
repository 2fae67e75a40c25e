"""Friction without dilatancy: what members scenes have, and what they cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import Scene, Solution, Status, builtin_scene, solve
from cvxlimit.masonry import random_wall
from cvxlimit.methods.dilatancy.gilbert import Gilbert
from cvxlimit.methods.dilatancy.zero_dilatancy import ZeroDilatancy

PLANE = ("ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3")

SPACE = ("tuff-wall", "barrel-vault", "dome", "facade", "house-corner", "s12-panel")

SAME = 1e-4
"""Relative spread of members below which an answer counts as unique: in space their residuals move
load factors by up to about that."""


def seconds_of(work: Callable[[], Solution]) -> tuple[Solution, float]:
    """CPU seconds: what else the machine does counts little."""
    start = time.process_time()
    return work(), time.process_time() - start


def row(scene: Scene, rule: ZeroDilatancy) -> tuple[object, ...]:
    """One scene: associated factor, members, residuals, time in first conic solves."""
    associated, first = seconds_of(lambda: solve(scene, model="full"))
    found, seconds = seconds_of(lambda: solve(scene, method=rule))
    residual = max((member.residual for member in found.members), default=float("nan"))
    members = found.members
    ends = members[:: max(len(members) - 1, 1)]
    span = " to ".join(f"{member.load_factor:.6f}" for member in ends)
    cost = f"{seconds:.1f}", f"{seconds / first:.0f}"
    factor = f"{associated.load_factor:.6f}"
    return scene.name, factor, found.status, span, len(members), f"{residual:.1e}", *cost


HEAD = Head("scene", "associated", "status", "members", "number", "largest residual",
            "CPU s", "in units of the associated solve")  # fmt: skip


def walls(scenes: Sequence[str], starts: int) -> Lines:
    """In the plane, to 1e-6."""
    yield HEAD
    for name in scenes or PLANE:
        yield row(builtin_scene(name), ZeroDilatancy(starts=starts))


def space(scenes: Sequence[str], starts: int) -> Lines:
    """In space, to 1e-4."""
    yield HEAD
    for name in scenes or SPACE:
        yield row(builtin_scene(name), ZeroDilatancy(starts=starts, tolerance=1e-4, descents=0))


def unique(number: int, starts: int) -> Lines:
    """Counts over so many random walls."""
    rule = ZeroDilatancy(tolerance=1e-5, starts=starts)
    counts = {"one answer": 0, "several": 0, "none found": 0, "no associated answer": 0}
    widest = 0.0
    for seed in range(number):
        scene = random_wall(seed)
        if not solve(scene).status.has_answer:
            counts["no associated answer"] += 1
            continue
        found = solve(scene, method=rule)
        if found.status is not Status.CONVERGED:
            counts["none found"] += 1
            continue
        low, high = found.members[0].load_factor, found.members[-1].load_factor
        spread = (high - low) / max(abs(high), abs(low))
        widest = max(widest, spread)
        counts["one answer" if spread <= SAME else "several"] += 1
    yield Head(*counts, "widest spread")
    yield *counts.values(), f"{widest:.3f}"


def gilbert(scenes: Sequence[str]) -> Lines:
    """Where its stop on the load factor leaves Coulomb's law."""
    yield Head("scene", "stops at a change of", "problems", "load factor", "status and check")
    for name in scenes or PLANE:
        for tolerance in (1e-3, 1e-5):
            found = solve(builtin_scene(name), method=Gilbert(tolerance=tolerance))
            worth = found.note.split(": ")[-1].split(";")[0]
            factor = f"{found.load_factor:.6f}"
            yield name, f"{tolerance:g}", len(found.history), factor, f"{found.status}: {worth}"


@experiment(
    Part(1, "--table walls", "dilatancy-walls"),
    Part(6, "--table space", "dilatancy-space"),
    Part(2, "--table unique --number 30", "dilatancy-unique"),
    Part(1, "--table gilbert", "gilbert"),
)
def dilatancy(
    table: str = "walls", scenes: Sequence[str] = (), starts: int = 4, number: int = 50
) -> Lines:
    """Without dilatancy: walls (Ferris & Tin-Loi), space, unique (random walls), gilbert."""
    tables: dict[str, Callable[[], Lines]] = {
        "walls": lambda: walls(scenes, starts),
        "space": lambda: space(scenes, starts),
        "unique": lambda: unique(number, starts),
        "gilbert": lambda: gilbert(scenes),
    }
    if table not in tables:
        raise SystemExit(f"there is no table {table!r}: {', '.join(tables)}")
    yield from tables[table]()
