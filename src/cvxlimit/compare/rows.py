"""Rows of results: what one run gave, or the medians of several beside a reference."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from cvxlimit.bracket import Bracket, known
from cvxlimit.solution import Solution

PHASES = ("detect", "compile", "reparametrise", "solve", "certify")
"""What is timed apart: contact detection, building and canonicalising the problem, the same again
for changed Parameters, the solver, and the bracket."""


@dataclass(frozen=True)
class Row:
    """One method on one scene: one run of it, or medians over several; None where it has no figure.

    ``error`` is relative to the reference, so that what a linearisation loses counts. Seconds by
    phase, and in ``total`` from the scene to the answer, contact detection included; memory in
    MB where runs have processes of their own. ``reason`` says why there is no answer, and is
    empty otherwise.
    """

    scene: str = ""
    blocks: int = 0
    contacts: int = 0
    method: str = ""
    line: str = ""
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

    @classmethod
    def of(cls, solution: Solution, started: float) -> Row:
        """One run that began at ``started`` on the clock of :func:`time.perf_counter`."""
        found = solution.bracket
        seconds: dict[str, Any] = {k: v for k, v in solution.seconds.items() if k in PHASES}
        return cls(
            status=str(solution.status), load_factor=solution.load_factor,
            lower=known(found.lower), upper=known(found.upper),
            total=time.perf_counter() - started, **seconds,
        )  # fmt: skip

    @property
    def failed(self) -> bool:
        return bool(self.reason)

    @property
    def has_point(self) -> bool:
        """Whether charts can show it."""
        return self.total is not None and self.error is not None

    @property
    def truth(self) -> Bracket:
        """The reference; unbounded where it has an end open."""
        ends = self.reference_lower, self.reference_upper
        return Bracket() if None in ends else Bracket(*ends)  # type: ignore[arg-type]

    @property
    def floor(self) -> float:
        """The reference's relative width: load factors inside it cannot be told apart."""
        return max(0.0, self.truth.width) if self.truth.has_both else 0.0
