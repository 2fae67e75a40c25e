"""``cvxlimit shake``: a structure under a ground acceleration, in time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.table import Table
from rich.text import Text

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import Command, control_of, vector
from cvxlimit.cli.report import facts, files_asked, write_rows
from cvxlimit.cli.shell import ExitCode, complain, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.dynamics.record import Record, pulse, read_record
from cvxlimit.extensions.dynamics.shaking import Shaking, shake
from cvxlimit.plotting.look import IMAGES

_KINDS = dict.fromkeys(IMAGES, "curve") | {".gif": "film", ".mp4": "film"}
"""Pictures of a motion, by suffix."""


@dataclass(frozen=True, kw_only=True)
class ShakeCommand(Command):
    """Move a structure in time under a ground acceleration, by MuJoCo: does it fall, how far does
    it go.

    Model
    -----
    pulse : SHAPE:A:T
        Ground acceleration by formula: rectangle, half-sine or sine, of A (in --unit) over T
        seconds, as sine:0.5:1.
    record : FILE.csv
        Ground acceleration from a table of time (s) and acceleration (in --unit).
    unit : UNIT
        Of accelerations: g (of pulses unless given), m/s2, cm/s2, mm/s2, gal; records must be told
        theirs.
    scale : S
        Factor on the acceleration.
    direction : X,Y,Z
        Along which the ground accelerates; unless given, against the live load.
    control : BLOCK:X,Y,Z
        Block and direction whose displacement is told; unless given, the largest.

    Effort
    ------
    after : S
        Seconds after the record in which blocks may come to rest.
    step : S
        The longer step; the other has half of it.

    Output
    ------
    csv : OUT
        Write a row per time and run.
    plot : OUT.png|.gif
        Draw displacement over time (.svg, .pdf as well), or a film (.mp4 as well).
    frame : OUT.png
        Draw the blocks at the end.

    Exit code
    ---------
    0 all runs agree that it falls, or that it stands; 2 bad input; 4 they do not agree, or blocks
    still move at the end.
    """

    scene: str
    pulse: str | None = None
    record: Path | None = None
    unit: str | None = None
    scale: float = 1.0
    direction: str | None = None
    control: str | None = None
    after: float | None = None
    step: float | None = None
    csv: Path | None = None
    plot: Path | None = None
    frame: Path | None = None

    def run(self) -> ExitCode:
        reads = {} if self.record is None else {str(self.record): "the record"}
        written = files_asked(self, "csv", reads=reads, plot=[*_KINDS], frame=IMAGES)
        record = self._record()
        control, along = control_of(self.control), self.direction
        direction = None if along is None else vector("--direction", along, "1,0,0")

        def shaken(tell: Tell) -> Shaking:
            return shake(
                scene_named(self.scene), record, direction, after=self.after, control=control,
                step=self.step, progress=tell,
            )  # fmt: skip

        if record.doubt and (self.pulse is None or self.unit is None):  # of pulses it is meant
            complain(f"{self.record or self.pulse}: {record.doubt}")
        shaking = interruptible(shaken)
        write_rows(self.csv, shaking.to_dataframe())
        if self.plot is not None:
            shaking.plot(_KINDS[self.plot.suffix.lower()], self.plot)
        if self.frame is not None:
            shaking.plot("frame", self.frame)
        rows = [
            ("scene", shaking.scene.name),
            ("record", f"{record.name}, largest {record.largest:.4g} m/s2, {record.duration:g} s"),
            ("in short", shaking.headline),
            ("note", "values are of the best run; how far runs spread is no interval; the end is "
             "off by up to a tenth of the way to and fro; nothing is proved"),
        ]  # fmt: skip
        show(facts([*rows, *written]), Text(), _table(shaking))
        if shaking.falls is None:
            return refuse(ExitCode.NOT_GOOD_ENOUGH, shaking.headline)
        return ExitCode.SOLVED

    def _record(self) -> Record:
        if (self.pulse is None) == (self.record is None):
            raise InputError("give one of --pulse SHAPE:A:T and --record FILE.csv")
        if self.record is not None:
            if self.unit is None:
                raise InputError(
                    f"--record {self.record}: say the --unit of its accelerations, as g"
                )
            return read_record(self.record, self.unit, self.scale)
        shape, _, rest = str(self.pulse).partition(":")
        try:
            amplitude, duration = (float(text) for text in rest.split(":"))
        except ValueError as error:
            raise InputError(f"--pulse {self.pulse}: SHAPE:A:T is meant, as sine:0.5:1") from error
        made = pulse(shape, amplitude, duration, self.unit or "g")  # type: ignore[arg-type]
        return made if self.scale == 1.0 else made.scaled(self.scale)


def _table(shaking: Shaking) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    unit = shaking.scene.units.length
    for name in ("step (s)", "contacts (s)", "end", "after (s)", f"peak ({unit})",
                 f"at the end ({unit})", f"deepest ({unit})"):  # fmt: skip
        table.add_column(name, justify="right")
    for each in shaking.histories:
        moved = shaking.displacement(each)
        peak = moved[abs(moved).argmax()]
        numbers = (each.times[-1], peak, moved[-1], each.deepest)
        table.add_row(f"{each.step:.3g}", f"{each.time_constant:.3g}", each.ending,
                      *(f"{x:.4g}" for x in numbers))  # fmt: skip
    return table
