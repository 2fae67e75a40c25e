"""Rows of results: medians of runs side by side, each with its error against a reference."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from cvxlimit.bracket import Bracket, known
from cvxlimit.compare.models import PHASES, Measurement, Method
from cvxlimit.errors import CvxlimitError
from cvxlimit.masonry import single_block
from cvxlimit.methods.solving import solve
from cvxlimit.scene import Scene
from cvxlimit.solvers import default_ladder, settings_for

WIDTH = 1e-8
"""Relative width that a reference without interaction must have."""


@dataclass(frozen=True)
class Failure:
    """A run without an answer, and why."""

    reason: str
    is_timeout: bool = False


Runner: TypeAlias = "Callable[[Method, Scene], Measurement | Failure]"
"""How one run is made; elsewhere, for those who want it isolated."""


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
        return bool(self.reason)

    @property
    def floor(self) -> float:
        """The reference's relative width: load factors inside it cannot be told apart."""
        ends = self.reference_lower, self.reference_upper
        return 0.0 if None in ends else max(0.0, Bracket(*ends).width)  # type: ignore[arg-type]


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while methods were measured; ``rows`` are those of the methods that have run.

    Their medians are over fewer runs than asked for where the last turn was not finished.
    """

    def __init__(self, rows: list[Row]) -> None:
        super().__init__(f"{len(rows)} methods were measured")
        self.rows = rows


@dataclass(frozen=True)
class Reference(Method):
    """The bracket against which others are measured; ``load_factor`` is its middle."""

    name: str = "reference"
    line: str = "reference"
    interaction: str = "none"
    moments: str = "independent"

    def measure(self, scene: Scene) -> Measurement:
        started = time.perf_counter()
        if self.interaction != "none":
            found = solve(scene, method="certified", moments=self.moments)
            status = str(found.status)
        else:  # two exact solvers as far as rounding lets them; all others if they fall short
            first, *others = default_ladder()
            found = solve(scene, tolerance=1e-9, ladder=(first, settings_for("BLOCKWISE", 1e-14)))
            if found.gap > WIDTH and found.status.has_answer:
                more = solve(scene, tolerance=WIDTH, ladder=others)
                found = min(found, more, key=lambda solution: solution.gap)
            status = f"{'proved' if found.is_proved else 'bracketed'} to {found.gap:.1e}"
        middle = 0.5 * (found.lower + found.upper) if found.bracket.has_both else None
        return replace(Measurement.of(found, started), status=status, load_factor=middle)


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
    advance: Callable[[str], None] = lambda done: None,
    run: Runner | None = None,
    refer: Runner | None = None,
) -> list[Row]:
    """Measure all methods on one scene in turns, so that a busy machine hits them alike.

    A method that fails is not run again. ``advance`` is told after every run; ``run`` and ``refer``
    run methods and references elsewhere. Ctrl-C raises :class:`Interrupted`.
    """
    measure, truths = run or run_here, dict[object, Truth]()
    for method in methods:
        if _question(method) not in truths:
            truths[_question(method)] = find_truth(method, scene, refer or measure)
            advance("reference")
    results: list[list[Measurement | Failure]] = [[] for _ in methods]

    def rows() -> list[Row]:
        pairs = zip(methods, results, strict=True)
        return [row_of(m, scene, found, truths[_question(m)]) for m, found in pairs if found]

    try:
        for turn in range(repeat):
            for method, found in zip(methods, results, strict=True):
                if run is None and turn == 0:
                    with suppress(Exception):  # what is imported and compiled once is not timed
                        method.measure(single_block())
                if not any(isinstance(result, Failure) for result in found):
                    found.append(measure(method, scene))
                advance(method.name)
    except KeyboardInterrupt as error:
        raise Interrupted(rows()) from error
    return rows()


def _question(method: Method) -> tuple[str, str, bool]:
    return method.interaction, method.moments, method.is_load_factor


def number_of_steps(methods: Sequence[Method], repeat: int) -> int:
    """How often :func:`side_by_side` will call ``advance``."""
    return len({_question(method) for method in methods}) + repeat * len(methods)


def row_of(
    method: Method, scene: Scene, results: Sequence[Measurement | Failure], truth: Truth
) -> Row:
    """Medians of the runs, or the failure with its reason."""
    runs = sorted((x for x in results if isinstance(x, Measurement)), key=lambda run: run.total)
    reasons = [x.reason for x in results if isinstance(x, Failure)]
    row = Row(
        scene.name, len(scene.free), len(scene.contacts), method.name, method.line,
        **method.axes(),  # type: ignore[arg-type]
        reason="".join(reasons),
        runs=len(runs),
        reference_lower=known(truth.bracket.lower),
        reference_upper=known(truth.bracket.upper),
        reference=truth.note,
    )  # fmt: skip
    if reasons or not runs:
        return row
    middle = runs[len(runs) // 2]
    phases: dict[str, Any] = {p: _median(run.seconds.get(p) for run in runs) for p in PHASES}
    return replace(
        row,
        status=middle.status,
        load_factor=middle.load_factor,
        lower=middle.lower,
        upper=middle.upper,
        error=truth.bracket.error(middle.load_factor),
        **phases,
        total=_median(run.total for run in runs),
        total_min=runs[0].total,
        total_max=runs[-1].total,
        memory=_median(run.memory for run in runs),
    )


def _median(values: Iterable[float | None]) -> float | None:
    found = [value for value in values if value is not None]
    return median(found) if found else None
