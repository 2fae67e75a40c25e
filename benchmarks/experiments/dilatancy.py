"""Friction without dilatancy: what members scenes have, and what they cost."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.gilbert import Gilbert
from benchmarks.lifted import Lifted, lifted_bound
from benchmarks.random_walls import planar, retaining
from cvxlimit import Block, Load, Scene, Solution, builtin_scene, solve
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.masonry import running_bond, wall
from cvxlimit.methods.driver import Run
from cvxlimit.methods.least_thrust import lower_bound

PLANE = ("ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3")

SPACE = ("tuff-wall", "facade", "house-corner")

Found = TypeVar("Found")


_PATIENT = 3600.0
"""Seconds that no program here takes: a bound is not to depend on what else the machine does."""


def seconds_of(work: Callable[[], Found]) -> tuple[Found, float]:
    """CPU seconds: what else the machine does counts little."""
    start = time.process_time()
    return work(), time.process_time() - start


HEAD = Head("scene", "contacts", "seed", "associated", "lowest found", "searches", "last gain",
            "largest residual", "solves", "CPU s")  # fmt: skip


def row(scene: Scene, rule: ZeroDilatancy) -> tuple[object, ...]:
    """One scene and first seed: the lowest member, where each search ended, and what it took."""
    associated = solve(scene, model="full").load_factor
    found, seconds = seconds_of(lambda: solve(scene, method=rule))
    residual = max((member.residual for member in found.members), default=float("nan"))
    ends = sorted((s.load_factor or float("nan"), s.last_gain) for s in found.searches)
    factors = [f"{x:.6f}" if x else "none" for x in (associated, found.load_factor)]
    searches = ", ".join(f"{factor:.4f}" for factor, _ in ends)
    late = f"{ends[0][1]} of {rule.budget}" if ends else "first member"
    worth = f"{residual:.1e}", len(found.history), f"{seconds:.1f}"
    return scene.name, len(scene.contacts), rule.seed, *factors, searches, late, *worth


def named(names: Sequence[str], seeds: int) -> Lines:
    """Built-in scenes by default settings, from several first seeds."""
    yield HEAD
    for name in names:
        for seed in range(0, 10 * seeds, 10):
            yield row(builtin_scene(name), ZeroDilatancy(seed=seed))


def ordinary(seeds: int) -> Lines:
    """Random walls by default settings."""
    yield HEAD
    for make in (planar, retaining):
        for seed in range(4 * seeds):
            yield row(make(seed), ZeroDilatancy())


def gilbert(scenes: Sequence[str]) -> Lines:
    """Where its stop on the load factor leaves Coulomb's law."""
    yield Head("scene", "stops at a change of", "problems", "load factor", "status and check")
    for name in scenes or PLANE:
        for tolerance in (1e-3, 1e-5):
            found = solve(builtin_scene(name), method=Gilbert(tolerance=tolerance))
            worth = found.note.split(": ")[-1].split(";")[0]
            last = f"{found.history[-1].load_factor:.6f}"
            yield name, f"{tolerance:g}", len(found.history), last, f"{found.status}: {worth}"


PUSH = Load(acceleration=(1, 0, 0))


def clamped() -> Scene:
    """The middle one of three cubes on one another, of which the outer ones are fixed."""
    cubes = [
        Block.box(f"p{i}", (0, 0, 0.5 * i), (0.5, 0.5, 0.5 * i + 0.5), density=20.0)
        for i in range(3)
    ]
    return Scene(cubes, ["p0", "p2"], PUSH, friction=1.0, name="clamped cube")


def laid(name: str, courses: list[list[float]], height: float, friction: float) -> Scene:
    """A wall in the plane, pushed along it."""
    unit = (0.4, 0.2, height)
    return wall(courses, unit=unit, density=20.0, friction=friction, live=PUSH, name=name)


def leaved(courses: int, first: int) -> Scene:
    """Whole stones and pairs of halves in turn, whole ones first if ``first`` is 0."""
    pattern = [[0.5, 0.5] if (k + first) % 2 else [1.0] for k in range(courses)]
    name = f"leaved, {courses} courses, {('whole', 'halves')[first]} first"
    return laid(name, pattern, 0.3, 0.6)


def lowest(scene: Scene) -> tuple[Scene, str, Solution]:
    """The scene, its associated load factor, and the members that are known."""
    associated = solve(scene, model="full").load_factor
    factor = "none" if associated is None else f"{associated:.6f}"
    return scene, factor, solve(scene, method="zero-dilatancy")


def thrusts(scene: Scene, associated: str, known: Solution) -> tuple[object, ...]:
    """What least thrusts exclude, with all that members show."""
    states = [(member.forces, member.load_factor) for member in known.members]
    least = known.members[0].load_factor
    bound, seconds = seconds_of(lambda: lower_bound(Run(scene), least, states))
    numbers = f"{least:.6f}", f"{bound.load_factor:.6f}", bound.solves, f"{seconds:.1f}"
    return scene.name, len(scene.contacts), associated, *numbers


def products(
    scene: Scene, associated: str, known: Solution, radius: int | None
) -> tuple[object, ...]:
    """What products of forces and rates add to it."""
    least, settings = known.members[0].load_factor, Lifted(radius, seconds=_PATIENT)
    start = lower_bound(Run(scene), least).load_factor
    bounds, seconds = seconds_of(lambda: list(lifted_bound(Run(scene), start, least, settings)))
    bound = bounds[-1]
    numbers = f"{least:.6f}", f"{start:.6f}", f"{bound.load_factor:.6f}"
    worth = f"{1.0 - bound.load_factor / least:.1e}", f"{bound.rates:.0e}", f"{seconds:.1f}"
    within = "all" if radius is None else radius
    return scene.name, len(scene.contacts), within, associated, *numbers, *worth


def below() -> Lines:
    """Bounds that no solution is below, beside the lowest one that was found."""
    named = map(builtin_scene, ("single-block", "stack", "arch", *PLANE[::2], "tuff-wall"))
    bond = laid("running bond, 2 by 2", running_bond(2, 2), 0.4, 0.8)
    yield Title("least thrusts")
    yield Head("scene", "contacts", "associated", "lowest found", "bound", "problems", "CPU s")
    for scene in (*named, clamped(), bond):
        yield thrusts(*lowest(scene))
    yield Title("products")
    yield Head("wall", "contacts", "blocks apart", "associated", "lowest found", "least thrusts",
               "bound", "relative gap", "holds for rates up to", "CPU s")  # fmt: skip
    for scene in (leaved(courses, first) for courses in (4, 5, 7) for first in (0, 1)):
        yield products(*lowest(scene), None)
    tall = lowest(laid("running bond, 2 by 6", running_bond(2, 6), 0.3, 0.6))
    for radius in (None, 2, 1, 0):
        yield products(*tall, radius)


@experiment(
    Part(3, "--table walls", "dilatancy-walls"),
    Part(9, "--table space", "dilatancy-space"),
    Part(9, "--table random", "dilatancy-random"),
    Part(1, "--table gilbert", "gilbert"),
    Part(2, "--table below", "dilatancy-below"),
)
def dilatancy(table: str = "walls", scenes: Sequence[str] = (), seeds: int = 5) -> Lines:
    """Without dilatancy: walls (Ferris & Tin-Loi), space, random, gilbert, below."""
    tables: dict[str, Callable[[], Lines]] = {
        "walls": lambda: named(scenes or PLANE, seeds),
        "space": lambda: named(scenes or SPACE, seeds),
        "random": lambda: ordinary(seeds),
        "gilbert": lambda: gilbert(scenes),
        "below": below,
    }
    if table not in tables:
        raise SystemExit(f"there is no table {table!r}: {', '.join(tables)}")
    yield from tables[table]()
