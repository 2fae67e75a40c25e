"""What the package must show, side by side in one run: ratio, overhead, memory, growth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from benchmarks.baselines import CONES, Literal, ScipyLinprog
from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.machine import environment, fitted_exponent
from benchmarks.runs import Limits, run_apart
from benchmarks.scenes import panel_of, s10_class, s12_class
from cvxlimit.compare.comparison import Runner, side_by_side
from cvxlimit.compare.models import Method, Model, Row
from cvxlimit.solvers.sparse import backends

OURS = Model("cvxlimit/1e-6", "cvxlimit", tolerance=1e-6)
OCTAGON = Model("cvxlimit/octagon/1e-6", "cvxlimit, octagon", surface="octagon", tolerance=1e-6)
AGAINST: tuple[Method, ...] = (
    Literal(),
    Literal("literal/octagon/N-mm", units="N-mm"),
    *CONES,
    ScipyLinprog(),
)
ALL_CORES = Literal("literal/octagon/kN-m/all-cores")
WORDS = {
    OURS.name: "cvxlimit, certified within 1e-6",
    OCTAGON.name: "cvxlimit, octagon",
    "literal/octagon/kN-m": "literal octagon, kN and m",
    ALL_CORES.name: "the same with all cores",
    "literal/octagon/N-mm": "the same, N and mm",
    "literal/conic/kN-m": "literal cone, kN and m",
    "literal/conic/N-mm": "the same, N and mm",
    "literal/octagon/kN-m/scipy": "literal octagon, SciPy",
}
"""The methods of the table of panels, in its order."""

PANELS = {"s12-class": s12_class, "s10-class": s10_class}
SIZES = (500, 1_900, 5_000, 9_000, 16_452, 50_000, 100_000)
LARGE = 20_000

MOST_MEMORY, MOST_MEMORY_LARGE = 2_000.0, 8_000.0
LEAST_RATIO, AIM = 6.0, 10.0
MUCH = 0.001
"""Relative error that a table shows."""

WRONG = 0.05
"""Relative error beyond which an answer is none, and its time is shown but not compared: the
octagon itself is 1.4 % off on the S12-class panel."""


@dataclass(frozen=True)
class Check:
    """A promise, what was measured, and whether it holds; None if it is only shown."""

    promise: str
    measured: str
    holds: bool | None

    @property
    def verdict(self) -> str:
        """In a word."""
        return {True: "holds", False: "MISSED", None: "shown"}[self.holds]


@experiment(Part(14, "--repeat 3 --limit 40"))
def headline(repeat: int = 5, limit: float = 120.0, sizes: Sequence[int] = SIZES) -> Lines:
    """What the package must show, side by side in one run: ratio, overhead, memory, growth."""
    limits = Limits(limit, 8.0)
    machine = environment()["machine"]
    yield (
        f"{machine['cpu']}, {machine['cores']} cores, load {machine['load_before']} at start; "
        f"medians of {repeat} runs, methods in turns; blockwise solver with {backends()[0]}"
    )
    rows = speed_rows(repeat, limits)
    many = all_core_rows(repeat, limits)
    yield Title("Panels")
    yield from panels((*rows, *many))
    grown = growth_rows(sizes, repeat, limits)
    yield Title("Sizes")
    yield from sizes_table(grown)
    yield bound(grown)
    yield Title("Promises")
    yield Head("", "promise", "measured")
    for check in (*speed_checks(rows, many), *growth_checks(grown)):
        yield check.verdict, check.promise, check.measured


def apart(limits: Limits) -> Runner:
    """Runs in processes of their own."""
    return partial(run_apart, limits=limits)


def speed_rows(repeat: int, limits: Limits) -> list[Row]:
    """Ours and the baselines on the two panels."""
    rows = []
    for build in PANELS.values():
        rows += side_by_side((OURS, OCTAGON, *AGAINST), build(), repeat, run=apart(limits))
    return rows


def all_core_rows(repeat: int, limits: Limits) -> list[Row]:
    """The literal transcription with all cores, as a user's machine would run it."""
    free = Limits(limits.seconds, limits.memory, threads=None)
    rows = []
    for build in PANELS.values():
        rows += side_by_side([ALL_CORES], build(), repeat, run=apart(free), refer=apart(limits))
    return rows


def growth_rows(sizes: Sequence[int], repeat: int, limits: Limits) -> list[Row]:
    """Ours over the sizes, on panels with two returns; no reference is needed for that.

    Large ones once, with twenty times the seconds.
    """
    rows = []
    for size in sizes:
        is_large = size > LARGE
        here = Limits(20 * limits.seconds, limits.memory) if is_large else limits
        number = 1 if is_large else repeat
        rows += side_by_side(
            [OURS], panel_of(size), number, run=apart(here), refer=apart(Limits(1.0))
        )
    return rows


def speed_checks(rows: Sequence[Row], many: Sequence[Row]) -> list[Check]:
    """Ratios of total times, and whether ours is certified to what it claims."""
    checks = []
    for scene in PANELS:
        here = {row.method: row for row in (*rows, *many) if row.scene == scene}
        ours = here[OURS.name]
        checks.append(certified(ours))
        others = (*(method.name for method in AGAINST[:4]), ALL_CORES.name)
        checks += [ratio(ours, here[name]) for name in others]
        octagon = here[OCTAGON.name]
        error = "unknown" if octagon.error is None else f"{octagon.error:.2%}"
        checks.append(Check(f"{scene}: the octagon's error against the cone", error, None))
    return checks


def certified(ours: Row) -> Check:
    """Our own bracket, recomputed outside the solver, is as narrow as asked."""
    gap = _gap(ours)
    return Check(f"{ours.scene}: certified to 1e-6", f"bracket {gap:.1e}", gap <= 1e-6)


def _gap(row: Row) -> float:
    if row.lower is None or row.upper is None:
        return float("inf")
    return (row.upper - row.lower) / max(abs(row.upper), abs(row.lower))


def ratio(ours: Row, other: Row) -> Check:
    """How many times faster ours is; a baseline without an answer, or a wrong one, is beaten."""
    promise = (
        f"{ours.scene}: at least {LEAST_RATIO:g} times (aim {AIM:g}) as fast as {other.method}"
    )
    if ours.total is None:
        return Check(promise, f"ours failed: {ours.reason}", False)
    if other.total is None:
        return Check(promise, f"{other.method} failed: {other.reason}", True)
    times = other.total / ours.total
    error = "unknown" if other.error is None else f"{other.error:.1e}"
    theirs = f"{other.total:.2f} s, {other.status}, error {error}"
    text = f"{times:.1f} times ({theirs}, against {ours.total:.2f} s)"
    if other.error is not None and other.error > WRONG:
        return Check(f"{ours.scene}: {other.method} is {other.error:.0%} wrong", text, None)
    return Check(promise, text, times >= LEAST_RATIO)


def growth_checks(rows: Sequence[Row]) -> list[Check]:
    """Whether every size has an answer, and the memory of large ones."""
    checks = []
    for row in rows:
        size = row.contacts
        if row.total is None:
            checks.append(Check(f"panel of {size} contacts", row.reason, False))
            continue
        if size > 16_000 and row.memory is not None:
            most_memory = MOST_MEMORY if size < LARGE else MOST_MEMORY_LARGE
            promise = f"{size:,} contacts: peak memory below {most_memory:,.0f} MB"
            checks.append(Check(promise, f"{row.memory:,.0f} MB", row.memory < most_memory))
    return checks


def bound(rows: Sequence[Row]) -> str:
    """Fitted exponents of the total and of its phases: the largest one bounds growth."""
    done = [row for row in rows if row.total is not None]
    if len(done) < 2:
        return "growth: fewer than two sizes"
    sizes = [float(row.contacts) for row in done]
    parts = []
    for phase in ("total", "detect", "compile", "solve", "certify"):
        values = [getattr(row, phase) for row in done]
        if all(values):
            last = values[-1] / (done[-1].total or 1.0)
            parts.append(f"{phase} {fitted_exponent(sizes, values):.2f} ({last:.0%} at the end)")
    first, end = int(sizes[0]), int(sizes[-1])
    return f"growth exponents from {first:,} to {end:,} contacts: " + ", ".join(parts)


def panels(rows: Sequence[Row]) -> Lines:
    """Seconds of every method on either panel, and how far it is off where that is much."""
    found = {(row.method, row.scene): row for row in rows}
    sizes = {row.scene: row.contacts for row in rows}
    yield Head("seconds", *(f"{scene}, {size:,} contacts" for scene, size in sizes.items()))
    for method, words in WORDS.items():
        yield words, *(_cell(found[method, scene]) for scene in sizes)


def _cell(row: Row) -> str:
    if row.total is None:
        return row.reason
    is_off = row.error is not None and row.error > MUCH
    return f"{row.total:.2f}" + (f", {row.error:.1%} off" if is_off else "")


def sizes_table(rows: Sequence[Row]) -> Lines:
    """Seconds of the default and of its phases, memory and bracket at every size."""
    phases = ("detect", "compile", "solve", "certify")
    yield Head("contacts", "seconds", *phases, "MB", "bracket")
    for row in rows:
        spent = [getattr(row, phase) for phase in ("total", *phases)]
        cells = ("" if value is None else f"{value:.2f}" for value in spent)
        bracket = row.reason if row.total is None else f"{_gap(row):.0e}"
        yield f"{row.contacts:,}", *cells, f"{row.memory or 0:,.0f}", bracket
