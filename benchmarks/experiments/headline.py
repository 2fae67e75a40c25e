"""Ours beside the problem written out, and over sizes, side by side in one run."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from benchmarks.baselines import CONES, Literal, ScipyLinprog
from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.machine import fitted_exponent
from benchmarks.runs import Limits, run_apart
from benchmarks.scenes import panel_of, scene_of
from cvxlimit.extensions.studies.comparison import side_by_side
from cvxlimit.extensions.studies.models import Model, Row
from cvxlimit.solution.bracket import Bracket

OURS = Model("cvxlimit/1e-6", "cvxlimit", tolerance=1e-6)
METHODS = {
    "cvxlimit, certified within 1e-6": OURS,
    "cvxlimit, octagon": Model("cvxlimit/octagon/1e-6", surface="octagon", tolerance=1e-6),
    "literal octagon, kN and m": Literal(),
    "the same with all cores": Literal("literal/octagon/kN-m/all-cores"),
    "the same, N and mm": Literal("literal/octagon/N-mm", units="N-mm"),
    "literal cone, kN and m": CONES[0],
    "the cone, N and mm": CONES[1],
    "literal octagon, SciPy": ScipyLinprog(),
}
"""The rows of the table of panels."""

PANELS = ("s12-class", "s10-class")
SIZES = (500, 1_900, 5_000, 9_000, 16_452, 50_000, 100_000)
LARGE = 20_000
"""Contacts from which a panel is solved once, with twenty times the seconds."""

MUCH = 0.001
"""Relative error that a table shows."""

LEAST = 1e-3
"""Seconds that stand for none: a logarithm has no zero."""

PHASES = ("total", "detect", "compile", "solve", "certify")


@experiment(Part(14, "--repeat 3 --limit 40"))
def headline(repeat: int = 5, limit: float = 120.0, sizes: Sequence[int] = SIZES) -> Lines:
    """The default beside the problem written out on two panels, and up to 100,000 contacts."""
    alone = partial(run_apart, limits=Limits(limit, 8.0))
    free = partial(run_apart, limits=Limits(limit, 8.0, threads=None))
    found: list[list[Row]] = []
    for name in PANELS:
        turns = [m for m in METHODS.values() if not m.name.endswith("all-cores")]
        timed = side_by_side(turns, scene_of(name), repeat, run=alone).rows
        rows = {row.method: row for row in timed}
        others = [m for m in METHODS.values() if m.name not in rows]
        last = side_by_side(others, scene_of(name), repeat, run=free, refer=alone).rows
        rows |= {row.method: row for row in last}
        found.append([rows[method.name] for method in METHODS.values()])
    yield Title("Panels")
    yield Head("seconds", *(f"{rows[0].scene}, {rows[0].contacts:,} contacts" for rows in found))
    for words, *rows in zip(METHODS, *found, strict=True):
        yield words, *map(_cell, rows)
    yield Title("Sizes")
    yield from sizes_table([row for size in sizes for row in grown(size, repeat, limit)])


def grown(size: int, repeat: int, limit: float) -> tuple[Row, ...]:
    """Ours on a panel with two returns; no reference is needed for that."""
    is_large = size > LARGE
    run = partial(run_apart, limits=Limits((20 if is_large else 1) * limit, 8.0))
    refer = partial(run_apart, limits=Limits(1.0))
    return side_by_side(
        [OURS], panel_of(size), 1 if is_large else repeat, run=run, refer=refer
    ).rows


def _cell(row: Row) -> str:
    """Seconds, and how far the answer is off where that is much."""
    if row.total is None:
        return row.reason
    is_off = row.error is not None and row.error > MUCH
    return f"{row.total:.2f}" + (f", {row.error:.1%} off" if is_off else "")


def sizes_table(rows: Sequence[Row]) -> Lines:
    """Seconds by phase, memory and bracket at every size, and how seconds grow with contacts."""
    yield Head("contacts", "seconds", *PHASES[1:], "MB", "bracket")
    for row in rows:
        spent = [getattr(row, phase) for phase in PHASES]
        cells = ("" if value is None else f"{value:.2f}" for value in spent)
        width = row.reason
        if not width and row.lower is not None and row.upper is not None:
            width = f"{Bracket(row.lower, row.upper).width:.0e}"
        yield f"{row.contacts:,}", *cells, f"{row.memory or 0:,.0f}", width
    done = [row for row in rows if row.total]
    if len(done) > 1:
        sizes = [float(row.contacts) for row in done]
        spent_in = [[getattr(row, phase) or LEAST for row in done] for phase in PHASES]
        powers = (f"{fitted_exponent(sizes, seconds):.2f}" for seconds in spent_in)
        yield "grows as contacts to the", *powers, "", ""
