"""What is run: which methods at which size of which case, and the run itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import partial

from benchmarks.baselines import baselines
from benchmarks.cases import Case
from benchmarks.frozen import frozen_methods
from benchmarks.results import Record
from benchmarks.runs import Limits, run_apart
from cvxlimit.compare.comparison import row_of, side_by_side
from cvxlimit.compare.models import Method, Row
from cvxlimit.compare.registry import choose, interaction_registry, registry

GROWTH = (
    "cvxlimit",
    "cvxlimit/1e-6",
    "cvxlimit/full/1e-6",
    "conic/resultants/clarabel-qdldl/1e-8",
    "conic/corners/clarabel-qdldl/1e-8",
    "conic/corners/qoco/1e-8",
    "conic/corners/blockwise-*/1e-8",
    "octagon/corners/blockwise-*/1e-8",
    "octagon/corners/clarabel-qdldl/1e-8",
    "frozen/*",
    "literal/octagon/kN-m",
    "literal/octagon/kN-m/scipy",
    "literal/conic/kN-m",
)
"""Methods whose time and memory are followed over all sizes."""

PER_CONTACT_LIMIT = 500
"""Contacts up to which one CVXPY object per contact is tried: compiling takes minutes above."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class Plan:
    """What to run of the suite.

    Attributes
    ----------
    sizes : tuple of int
        Sizes instead of the cases' own; empty for those.
    methods : tuple of str
        Patterns of method names instead of the usual ones; empty for those.
    repeat : int
    limits, reference_limits : Limits
    """

    sizes: tuple[int, ...] = ()
    methods: tuple[str, ...] = ()
    repeat: int = 3
    limits: Limits = field(default_factory=lambda: Limits(120.0, 8.0))
    reference_limits: Limits = field(default_factory=lambda: Limits(1200.0, 8.0))


QUICK = Plan(sizes=(50, 150), repeat=1, limits=Limits(20.0, 8.0))


def methods_of(case: Case) -> list[Method]:
    """All methods that make sense for a case."""
    if case.interaction:
        return list(interaction_registry().values())
    return [*registry().values(), *frozen_methods().values(), *baselines().values()]


def growth_methods(case: Case) -> list[Method]:
    """The few that are followed over all sizes."""
    methods = methods_of(case)
    return methods if case.interaction else choose(GROWTH, methods)


def run_case(case: Case, plan: Plan, say: Say) -> Iterator[Record]:
    """Records of one case, size by size, smallest first."""
    dropped: dict[str, str] = {}
    for size in sizes_of(case, plan):
        purpose = "study" if size in case.study else "growth"
        methods = methods_of(case) if purpose == "study" else growth_methods(case)
        if plan.methods:
            methods = [m for m in methods_of(case) if matches(m, plan.methods)]
        for row in run_size(case, size, methods, plan, dropped, say) if methods else ():
            yield Record(case.name, case.family, size, purpose, row)


def sizes_of(case: Case, plan: Plan) -> list[int]:
    """The plan's sizes, or the case's own; a case of one size keeps to it."""
    own = sorted({*case.sizes, *case.study})
    if not plan.sizes:
        return own
    return [size for size in sorted(plan.sizes) if len(own) > 1 or size in own]


def matches(method: Method, patterns: Sequence[str]) -> bool:
    """True if one of the patterns (``*`` and ``?``) fits the method's name."""
    return any(fnmatchcase(method.name, pattern) for pattern in patterns)


def run_size(
    case: Case,
    size: int,
    methods: Sequence[Method],
    plan: Plan,
    dropped: dict[str, str],
    say: Say,
) -> list[Row]:
    """Rows of one size; methods that ran out of time or memory are dropped for larger ones."""
    scene = case.build(size)
    contacts = len(scene.contacts)
    skipped = dict(dropped)
    if contacts > PER_CONTACT_LIMIT:
        reason = f"not run: more than {PER_CONTACT_LIMIT} contacts"
        skipped |= {m.name: reason for m in methods if m.name.endswith("/per-contact")}
    wanted = [m for m in methods if m.name not in skipped]
    rows = side_by_side(
        wanted,
        scene,
        plan.repeat,
        lambda done: say(f"{case.name}, {contacts} contacts: {done}"),
        partial(run_apart, limits=plan.limits),
        partial(run_apart, limits=plan.reference_limits),
    )
    for row in rows:
        if "limit" in row.reason:
            dropped[row.method] = f"not run: {row.reason} at {contacts} contacts"
    unmeasured = Row(status="")
    left = [
        row_of(m, scene, [Row(reason=skipped[m.name])], unmeasured)
        for m in methods
        if m.name in skipped
    ]
    return [*rows, *left]
