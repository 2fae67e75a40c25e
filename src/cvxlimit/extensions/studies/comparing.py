"""``cvxlimit compare``: time and true error of several models on one scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.text import Text

from cvxlimit.cli.interrupting import Tell, interruptible, with_result
from cvxlimit.cli.options import Command
from cvxlimit.cli.report import files_asked
from cvxlimit.cli.shell import ExitCode, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.extensions.studies.comparison import Comparison, compare
from cvxlimit.plotting.look import IMAGES


@dataclass(frozen=True, kw_only=True)
class CompareCommand(Command):
    """Measure time and true error of several models on one scene, in turns.

    Model
    -----
    models : NAMES
        Models, several with commas or several times: cvxlimit (the default), 16-gon and other
        surfaces, and other options of solve joined as in octagon/clarabel/1e-4,
        certified/paper. Unless given: surfaces, solvers and tolerances that come with the package.

    Output
    ------
    csv : FILE
        Write all columns to this CSV file.
    plot : FILE
        Draw time against error (.png, .svg, .pdf).

    Effort
    ------
    repeat : N
        Runs per model, of which that of the median time is shown; 3 unless given.
    """

    scene: str
    models: list[str] | None = None
    csv: Path | None = None
    plot: Path | None = None
    repeat: int = 3

    def run(self) -> ExitCode:
        files_asked(self, "csv", plot=IMAGES)
        names = [name.strip() for text in self.models or () for name in text.split(",")]

        def compared(tell: Tell) -> Comparison:
            scene = scene_named(self.scene)
            return compare(scene, names or None, repeat=self.repeat, progress=with_result(tell))

        found = interruptible(compared)
        show(Text(found.table()))
        if self.csv is not None:
            found.to_dataframe().to_csv(self.csv)
        if self.plot is not None:
            found.plot().savefig(self.plot)
        if found.is_interrupted:
            return refuse(ExitCode.NOT_GOOD_ENOUGH, f"interrupted after {len(found.rows)} models")
        return ExitCode.SOLVED
