"""What commands do with a solution: write it, show it, judge it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.text import Text

from cvxlimit.cli.outputs import (
    PICTURES,
    ExitCode,
    check_outputs,
    check_picture,
    check_suffix,
    refuse,
)
from cvxlimit.cli.report import (
    history,
    is_eventful,
    show,
    summary,
    verdict,
    warn_of_near_misses,
)
from cvxlimit.io import export, write_result
from cvxlimit.io.geometry import EXPORTS
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting import plot
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


@dataclass(frozen=True)
class Files:
    """Where a solution is to be written; None where it is not."""

    json: Path | None
    plot: Path | None
    export: Path | None = None

    def check(self, scene: str) -> None:
        inputs = {} if scene in BUILTIN else {scene: "the scene"}
        check_outputs({"--json": self.json, "--plot": self.plot, "--export": self.export}, inputs)
        if self.export is not None:
            check_suffix("--export", self.export, EXPORTS)
        if self.plot is not None:
            check_picture(self.plot, PICTURES)

    def write(self, scene: Scene, solution: Solution) -> Iterator[Path]:
        if self.json is not None:
            write_result(solution, self.json)
            yield self.json
        if self.plot is not None:
            yield from plot(scene, solution, self.plot)
        if self.export is not None:
            yield from export(scene, self.export, solution)


def deliver(
    scene: Scene, name: str, solution: Solution, files: Files, tolerance: float | None = None
) -> ExitCode:
    written: list[str] = []
    try:
        written.extend(str(path) for path in files.write(scene, solution))
    finally:  # hours of work are shown even if the disk is full by now
        origin = "built-in" if name in BUILTIN else name
        show(summary(solution, origin, tolerance, written))
        if is_eventful(solution):
            show(Text(), history(solution.history))
    warn_of_near_misses(scene)
    status = solution.status
    if status.is_good:
        return ExitCode.SOLVED
    code = ExitCode.NOT_GOOD_ENOUGH if status.has_answer else ExitCode.NO_ANSWER
    return refuse(code, verdict(solution))
