"""Rows of results: medians of runs side by side, each with its error against a reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from cvxlimit.bracket import Bracket, known
from cvxlimit.compare.models import PHASES, Measurement, Method
from cvxlimit.compare.reference import Reference
from cvxlimit.compare.runs import Failure, Limits, run_apart
from cvxlimit.scene import Scene

Advance = Callable[[str], None]
_Question = tuple[str, str, bool]


class Truth(NamedTuple):
    """What a load factor is measured against; ``note`` says how it was found, or why it was not."""

    bracket: Bracket
    note: str


@dataclass(frozen=True)
class Row:
    """One method on one scene: medians over its runs; None where it has no figure.

    ``error`` is relative to the reference, so that what a linearisation loses counts. Seconds by
    phase, and in ``total`` from the scene to the answer, contact detection included; memory in
    MB. ``reason`` says why there is no answer, and is empty otherwise.
    """

    scene: str
    blocks: int
    contacts: int
    method: str
    line: str
    surface: str
    formulation: str
    solver: str
    tolerance: str
    interaction: str
    moments: str
    parameters: str
    status: str
    reason: str
    runs: int
    load_factor: float | None
    lower: float | None
    upper: float | None
    error: float | None
    reference_lower: float | None
    reference_upper: float | None
    reference: str
    detect: float | None
    compile: float | None
    reparametrise: float | None
    solve: float | None
    certify: float | None
    total: float | None
    total_min: float | None
    total_max: float | None
    memory: float | None

    @property
    def failed(self) -> bool:
        """True if there is no answer."""
        return bool(self.reason)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while methods were measured; ``rows`` are those of the methods that have run.

    Their medians are over fewer runs than asked for where the last turn was not finished.
    """

    def __init__(self, rows: list[Row]) -> None:
        super().__init__(f"{len(rows)} methods were measured")
        self.rows = rows


def find_truth(method: Method, scene: Scene, limits: Limits) -> Truth:
    """The reference that fits the method's interaction, in a process of its own."""
    if not method.is_load_factor:
        return Truth(Bracket(), "no reference: no load factor")
    reference = Reference(interaction=method.interaction, moments=method.moments)
    found = run_apart(reference, scene, limits)
    if isinstance(found, Failure):
        return Truth(Bracket(), f"no reference: {found.reason}")
    lower = -np.inf if found.lower is None else found.lower
    upper = np.inf if found.upper is None else found.upper
    return Truth(Bracket(lower, upper), found.status)


def side_by_side(
    methods: Sequence[Method],
    scene: Scene,
    repeat: int,
    limits: Limits,
    advance: Advance = lambda done: None,
    reference_limits: Limits | None = None,
) -> list[Row]:
    """Measure all methods on one scene in turns, so that a busy machine hits them alike.

    A method that fails is not run again. ``advance`` is told after every run.

    Raises
    ------
    Interrupted
        On Ctrl-C, with the rows of what was measured before.
    """
    truths: dict[_Question, Truth] = {}
    for method in methods:
        if _question(method) not in truths:
            truths[_question(method)] = find_truth(method, scene, reference_limits or limits)
            advance("reference")
    tallies = [_Tally(method, scene, truths[_question(method)]) for method in methods]
    try:
        for _ in range(repeat):
            for tally in tallies:
                if tally.failure is None:
                    tally.add(run_apart(tally.method, scene, limits))
                advance(tally.method.name)
    except KeyboardInterrupt as error:
        raise Interrupted([tally.row for tally in tallies if tally.has_run]) from error
    return [tally.row for tally in tallies]


def _question(method: Method) -> _Question:
    """Methods with the same one are measured against the same reference."""
    return method.interaction, method.moments, method.is_load_factor


@dataclass
class _Tally:
    """The runs of one method so far."""

    method: Method
    scene: Scene
    truth: Truth
    runs: list[Measurement] = field(default_factory=list)
    failure: Failure | None = None

    def add(self, result: Measurement | Failure) -> None:
        if isinstance(result, Failure):
            self.failure = result
        else:
            self.runs.append(result)

    @property
    def has_run(self) -> bool:
        return bool(self.runs) or self.failure is not None

    @property
    def row(self) -> Row:
        return row_of(self.method, self.scene, self.runs, self.failure, self.truth)


def number_of_steps(methods: Sequence[Method], repeat: int) -> int:
    """How often :func:`side_by_side` will call ``advance``."""
    return len({_question(method) for method in methods}) + repeat * len(methods)


def row_of(
    method: Method,
    scene: Scene,
    runs: Sequence[Measurement],
    failure: Failure | None,
    truth: Truth,
) -> Row:
    """Medians of ``runs``, or the failure with its reason."""
    axes: dict[str, Any] = dict.fromkeys(
        ("surface", "formulation", "solver", "tolerance", "parameters"), ""
    )
    figures = ("load_factor", "lower", "upper", "error", "total", "total_min", "total_max")
    nothing: dict[str, Any] = dict.fromkeys((*figures, *PHASES, "memory"))
    row = Row(
        scene=scene.name,
        blocks=len(scene.free),
        contacts=len(scene.contacts),
        method=method.name,
        line=method.line,
        **{**axes, **method.axes()},
        status="failed",
        reason=failure.reason if failure else "",
        runs=len(runs),
        **nothing,
        reference_lower=known(truth.bracket.lower),
        reference_upper=known(truth.bracket.upper),
        reference=truth.note,
    )
    return row if failure or not runs else _with_figures(row, runs, truth.bracket)


def _with_figures(row: Row, runs: Sequence[Measurement], bracket: Bracket) -> Row:
    totals = [run.total for run in runs]
    middle = sorted(runs, key=lambda run: run.total)[len(runs) // 2]
    phases: dict[str, Any] = {p: _median(run.seconds.get(p) for run in runs) for p in PHASES}
    return replace(
        row,
        status=middle.status,
        load_factor=middle.load_factor,
        lower=middle.lower,
        upper=middle.upper,
        error=bracket.error(middle.load_factor),
        **phases,
        total=median(totals),
        total_min=min(totals),
        total_max=max(totals),
        memory=_median(run.memory for run in runs),
    )


def _median(values: Iterable[float | None]) -> float | None:
    found = [value for value in values if value is not None]
    return median(found) if found else None
