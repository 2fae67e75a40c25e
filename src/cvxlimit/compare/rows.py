"""Rows of results: medians of runs side by side, each with its error against a reference."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from cvxlimit.bracket import Bracket, known
from cvxlimit.compare.models import PHASES, Measurement, Method
from cvxlimit.errors import CvxlimitError
from cvxlimit.masonry import single_block
from cvxlimit.methods.solving import solve
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solvers import default_ladder, settings_for

WIDTH = 1e-8
"""Relative width that a reference without interaction must have."""

_AIM = 1e-9
"""Relative width at which the search for a narrower bracket stops."""


@dataclass(frozen=True)
class Failure:
    """A run without an answer, and why."""

    reason: str
    is_timeout: bool = False


Advance = Callable[[str], None]
Runner: TypeAlias = "Callable[[Method, Scene], Measurement | Failure]"
"""How one run is made; elsewhere, for those who want it isolated."""

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
    MB where runs have processes of their own. ``reason`` says why there is no answer, and is
    empty otherwise.
    """

    scene: str
    blocks: int
    contacts: int
    method: str
    line: str
    surface: str = ""
    formulation: str = ""
    solver: str = ""
    tolerance: str = ""
    interaction: str = ""
    moments: str = ""
    parameters: str = ""
    status: str = "failed"
    reason: str = ""
    runs: int = 0
    load_factor: float | None = None
    lower: float | None = None
    upper: float | None = None
    error: float | None = None
    reference_lower: float | None = None
    reference_upper: float | None = None
    reference: str = ""
    detect: float | None = None
    compile: float | None = None
    reparametrise: float | None = None
    solve: float | None = None
    certify: float | None = None
    total: float | None = None
    total_min: float | None = None
    total_max: float | None = None
    memory: float | None = None

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


@dataclass(frozen=True)
class Reference(Method):
    """The bracket against which others are measured: cone, no interaction or the certified one."""

    name: str = "reference"
    line: str = "reference"
    interaction: str = "none"
    moments: str = "independent"

    def measure(self, scene: Scene) -> Measurement:
        """The best bracket; ``load_factor`` is its middle."""
        started = time.perf_counter()
        if self.interaction == "none":
            found = _narrowest(scene)
            status = f"{'proved' if found.is_proved else 'bracketed'} to {found.gap:.1e}"
        else:
            found = solve(scene, method="certified", moments=self.moments)
            status = str(found.status)
        finite = bool(np.isfinite([found.lower, found.upper]).all())
        middle = 0.5 * (found.lower + found.upper) if finite else None
        return replace(Measurement.of(found, started), status=status, load_factor=middle)


def _narrowest(scene: Scene) -> Solution:
    """Two exact solvers, each as far as rounding lets it go; all others only if they fall short."""
    first, *others = default_ladder()
    found = solve(scene, tolerance=_AIM, ladder=(first, settings_for("BLOCKWISE", 1e-14)))
    if found.gap <= WIDTH or not found.status.has_answer:
        return found
    more = solve(scene, tolerance=WIDTH, ladder=others)
    return min(found, more, key=lambda solution: solution.gap)


def run_here(method: Method, scene: Scene) -> Measurement | Failure:
    """One run of a method on a copy of the scene; whatever it raises is a failure's reason.

    What earlier runs left is collected before: a full collection takes Python 30 ms and would fall
    into whichever phase comes first.
    """
    gc.collect()
    try:
        found = method.measure(replace(scene))
    except MemoryError:
        return Failure("out of memory")
    except CvxlimitError as error:
        return Failure(str(error))
    except Exception as error:
        return Failure(f"{type(error).__name__}: {' '.join(str(error).split())[:160]}")
    return Failure(f"no load factor: {found.status}") if found.load_factor is None else found


def find_truth(method: Method, scene: Scene, run: Runner) -> Truth:
    """The reference that fits the method's interaction."""
    if not method.is_load_factor:
        return Truth(Bracket(), "no reference: no load factor")
    found = run(Reference(interaction=method.interaction, moments=method.moments), scene)
    if isinstance(found, Failure):
        return Truth(Bracket(), f"no reference: {found.reason}")
    lower = -np.inf if found.lower is None else found.lower
    upper = np.inf if found.upper is None else found.upper
    return Truth(Bracket(lower, upper), found.status)


def side_by_side(
    methods: Sequence[Method],
    scene: Scene,
    repeat: int,
    advance: Advance = lambda done: None,
    run: Runner | None = None,
    refer: Runner | None = None,
) -> list[Row]:
    """Measure all methods on one scene in turns, so that a busy machine hits them alike.

    A method that fails is not run again. ``advance`` is told after every run; ``run`` and ``refer``
    run methods and references elsewhere.

    Raises
    ------
    Interrupted
        On Ctrl-C, with the rows of what was measured before.
    """
    truths: dict[_Question, Truth] = {}
    for method in methods:
        if _question(method) not in truths:
            truths[_question(method)] = find_truth(method, scene, refer or run or run_here)
            advance("reference")
    tallies = [_Tally(method, scene, truths[_question(method)]) for method in methods]
    try:
        for turn in range(repeat):
            for tally in tallies:
                if run is None and turn == 0:
                    with suppress(Exception):  # what is imported and compiled once is not timed
                        tally.method.measure(single_block())
                if tally.failure is None:
                    tally.add((run or run_here)(tally.method, scene))
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
    axes: dict[str, Any] = method.axes()
    row = Row(
        scene=scene.name,
        blocks=len(scene.free),
        contacts=len(scene.contacts),
        method=method.name,
        line=method.line,
        **axes,
        reason=failure.reason if failure else "",
        runs=len(runs),
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
