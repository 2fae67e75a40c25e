"""Time against true error, growth, and where the time goes: many methods on scenes of many sizes.

Methods are those of :mod:`cvxlimit.compare.registry`, and what a user would write without the
package (:mod:`benchmarks.baselines`). Rows are kept as they come, and what stands is not measured
again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import charts, scenes
from benchmarks.baselines import baselines
from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.machine import environment
from benchmarks.rows import Rows
from benchmarks.runs import Limits, run_apart
from cvxlimit.compare.comparison import row_of, side_by_side
from cvxlimit.compare.models import Method, Row
from cvxlimit.compare.registry import choose, interaction_registry, registry
from cvxlimit.scene import Scene

SIZES = (50, 150, 500, 1_900, 5_000, 16_452)
"""Contacts asked for; scenes come close."""


@dataclass(frozen=True)
class Case:
    """A scene swept in size.

    Attributes
    ----------
    family : str
        Cases of one family share their charts.
    build : callable
        From the number of contacts asked for to a scene that has about as many.
    sizes : tuple of int
        Sizes at which a few methods show how they grow.
    study : tuple of int
        Sizes at which all methods are measured: time against error.
    interaction : bool
        True if torsion-shear-bending interaction is the subject.
    """

    family: str
    build: Callable[[int], Scene]
    sizes: tuple[int, ...] = SIZES
    study: tuple[int, ...] = (150, 1_900)
    interaction: bool = False


CASES = {
    "arch": Case("arches", scenes.arch_of, study=(150,)),
    "panel": Case("panels", scenes.panel_of, study=()),
    "planar-wall": Case("planar walls", scenes.planar_wall),
    "propped-wall": Case("propped walls", scenes.propped_wall),
    "planar-wall-interaction": Case(
        "planar walls with interaction", scenes.planar_wall, study=(150,), interaction=True
    ),
    "propped-wall-interaction": Case(
        "propped walls with interaction", scenes.propped_wall, study=(150,), interaction=True
    ),
    "s12-class": Case("S12-class panel", scenes.s12_class, (886,), (886,)),
    "s10-class": Case("S10-class panel", scenes.s10_class, (1_902,), (1_902,)),
}

GROWTH = (
    "cvxlimit", "cvxlimit/1e-6", "cvxlimit/full/1e-6", "conic/resultants/clarabel-qdldl/1e-8",
    "conic/corners/clarabel-qdldl/1e-8", "conic/corners/qoco/1e-8",
    "conic/corners/blockwise-*/1e-8", "octagon/corners/blockwise-*/1e-8",
    "octagon/corners/clarabel-qdldl/1e-8",
    "literal/octagon/kN-m", "literal/octagon/kN-m/scipy", "literal/conic/kN-m",
)  # fmt: skip
"""Methods whose time and memory are followed over all sizes."""

PER_CONTACT_LIMIT = 500
"""Contacts up to which one CVXPY object per contact is tried: compiling takes minutes above."""

REFERENCE_SECONDS = 1200.0
"""For a reference, without which a whole size has no errors."""


@dataclass(frozen=True)
class Record:
    """A row and where it belongs: ``purpose`` is "study" (all methods) or "growth" (a few)."""

    case: str
    family: str
    size: int
    purpose: str
    row: Row
    about: str = ""

    def flat(self) -> dict[str, Any]:
        """As it is stored."""
        own = {name: value for name, value in vars(self).items() if name != "row"}
        return {**own, **asdict(self.row)}

    @classmethod
    def of(cls, flat: Mapping[str, Any]) -> Record:
        """From what is stored."""
        names = {column.name for column in fields(Row)}
        row = Row(**{key: value for key, value in flat.items() if key in names})
        return cls(**{key: value for key, value in flat.items() if key not in names}, row=row)


OWN = '"conic/corners/clarabel-qdldl/*" "conic/corners/qoco/*" "*/blockwise-*/1e-8"'
IN = "--docs docs/evidence --out benchmarks/results"


@experiment(
    Part(7, f"--cases s12-class --limit 15 --repeat 1 {IN}/s12", "chart-panel",
         "benchmarks/results/s12"),
    Part(4, f'--cases planar-wall --sizes 150 --limit 10 --methods "cvxlimit*" {OWN} '
         f'"literal/octagon/kN-m" "literal/conic/kN-m" {IN}/planar', "chart-wall",
         "benchmarks/results/planar"),
    Part(7, "--cases panel --sizes 500 1900 5000 9000 --repeat 1 --limit 120 "
         f'--methods "cvxlimit/1e-*" "conic/corners/qoco/1e-8" {OWN} {IN}/panels', "chart-growth",
         "benchmarks/results/panels"),
)  # fmt: skip
def suite(
    cases: Sequence[str] = tuple(CASES), sizes: Sequence[int] = (), methods: Sequence[str] = (),
    repeat: int = 3, limit: float = 120.0, memory: float = 8.0,
    out: Path = Path("benchmarks/results/suite"), docs: Path | None = None,
) -> Lines:  # fmt: skip
    """Many methods on scenes of many sizes; hours for all. Rows and charts go to a folder."""
    for name in cases:
        if name not in CASES:
            raise SystemExit(f"there is no case {name!r}; there are {', '.join(CASES)}")
    names = [method.name for name in cases for method in methods_of(CASES[name])]
    for pattern in methods:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise SystemExit(f"no method matches {pattern!r}; there are {', '.join(names)}")
    rows, about = Rows(out / "rows.jsonl", "case", "size", "method"), signed(environment(), repeat)
    yield Head("case", "contacts", "method", "s", "error", "MB", "status")
    for name in cases:
        for found in measured(name, sizes, methods, repeat, Limits(limit, memory), rows):
            for row in found:
                rows.add(replace(row, about=about).flat())
                yield row.case, row.row.contacts, row.row.method, *cells(row.row)
    if not len(rows):
        raise SystemExit("nothing was run: none of these methods or sizes belongs to the cases")
    for picture in charts.draw_all([Record.of(row) for row in rows], out):
        if docs is not None:
            (docs / picture.name).write_bytes(picture.read_bytes())


def signed(about: Mapping[str, Any], repeat: int) -> str:
    """Machine and versions, for the small print of a chart."""
    names = ("cvxlimit", "cvxpy", "clarabel", "python")
    versions = ", ".join(f"{name} {about['versions'][name]}" for name in names)
    runs = f"medians of {repeat} runs, in turns" if repeat > 1 else "one run each"
    return f"{about['machine']['cpu']}, one thread per run; {versions}; {runs}"


def cells(row: Row) -> tuple[str, ...]:
    """Of the table."""
    if row.failed or row.total is None:
        return "", "", "", row.reason
    error = "" if row.error is None else f"{row.error:.1e}"
    return f"{row.total:.3f}", error, f"{row.memory or 0:.0f}", row.status


def methods_of(case: Case) -> list[Method]:
    """All methods that make sense for a case."""
    if case.interaction:
        return list(interaction_registry().values())
    return [*registry().values(), *baselines().values()]


def growth_methods(case: Case) -> list[Method]:
    """The few that are followed over all sizes."""
    methods = methods_of(case)
    return methods if case.interaction else choose(GROWTH, methods)


def sizes_of(case: Case, sizes: Sequence[int]) -> list[int]:
    """The sizes asked for, or the case's own; a case of one size keeps to it."""
    own = sorted({*case.sizes, *case.study})
    return [size for size in sorted(sizes or own) if len(own) > 1 or size in own]


def measured(
    name: str, sizes: Sequence[int], patterns: Sequence[str], repeat: int, limits: Limits,
    done: Rows,
) -> Iterator[list[Record]]:  # fmt: skip
    """Records of one case, size by size, smallest first."""
    case, dropped = CASES[name], dict[str, str]()
    for size in sizes_of(case, sizes):
        purpose = "study" if size in case.study else "growth"
        methods = methods_of(case) if purpose == "study" else growth_methods(case)
        if patterns:
            methods = [m for m in methods_of(case) if any(fnmatchcase(m.name, p) for p in patterns)]
        key = {"case": name, "size": size}
        if all({**key, "method": method.name} in done for method in methods):
            continue
        found = run_size(case, size, methods, repeat, limits, dropped)
        yield [Record(name, case.family, size, purpose, row) for row in found]


def run_size(
    case: Case, size: int, methods: Sequence[Method], repeat: int, limits: Limits,
    dropped: dict[str, str],
) -> list[Row]:  # fmt: skip
    """Rows of one size; methods that ran out of time or memory are dropped for larger ones."""
    scene = case.build(size)
    contacts = len(scene.contacts)
    skipped = dict(dropped)
    if contacts > PER_CONTACT_LIMIT:
        reason = f"not run: more than {PER_CONTACT_LIMIT} contacts"
        skipped |= {m.name: reason for m in methods if m.name.endswith("/per-contact")}
    wanted = [m for m in methods if m.name not in skipped]
    refer = partial(run_apart, limits=Limits(max(limits.seconds, REFERENCE_SECONDS), limits.memory))
    run = partial(run_apart, limits=limits)
    rows = side_by_side(wanted, scene, repeat, run=run, refer=refer)
    for row in rows:
        if "limit" in row.reason:
            dropped[row.method] = f"not run: {row.reason} at {contacts} contacts"
    left = [m for m in methods if m.name in skipped]
    unmeasured = Row(status="")
    return [*rows, *(row_of(m, scene, [Row(reason=skipped[m.name])], unmeasured) for m in left)]
