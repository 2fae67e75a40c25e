"""``cvxlimit shake``: a structure under a ground acceleration, in time."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.table import Table
from rich.text import Text

from cvxlimit.base.files import write_file
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import EFFORT, OUTPUT, argument, command_of, named_block, option, vector
from cvxlimit.cli.report import ExitCode, check_outputs, facts, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.dynamics.record import Record, pulse, read_record
from cvxlimit.extensions.dynamics.shaking import Shaking, shake
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting.look import IMAGES

_KINDS = dict.fromkeys(IMAGES, "curve") | {".gif": "film", ".mp4": "film"}
"""Pictures of a motion, by suffix."""


@dataclass(frozen=True, kw_only=True)
class Shaken:
    """What ``cvxlimit shake`` is asked."""

    scene: str = argument()
    pulse: str | None = option(
        "SHAPE:A:T",
        "Ground acceleration by formula: rectangle, half-sine or sine, of A (in --unit) over T "
        "seconds, as sine:0.5:1.",
    )
    record: Path | None = option(
        "FILE.csv", "Ground acceleration from a table of time (s) and acceleration (in --unit)."
    )
    unit: str | None = option(
        "UNIT", "Of accelerations: g (of pulses unless given), m/s2, cm/s2, mm/s2, gal; records "
        "must be told theirs."
    )  # fmt: skip
    scale: float = option("S", "Factor on the acceleration.", 1.0)
    direction: str | None = option(
        "X,Y,Z", "Along which the ground accelerates; unless given, against the live load."
    )
    control: str | None = option(
        "BLOCK:X,Y,Z", "Block and direction whose displacement is told; unless given, the largest."
    )
    after: float | None = option(
        "S", "Seconds after the record in which blocks may come to rest.", group=EFFORT
    )
    step: float | None = option("S", "The longer step; the other has half of it.", group=EFFORT)
    csv: Path | None = option("OUT", "Write a row per time and run.", group=OUTPUT)
    plot: Path | None = option(
        "OUT.png|.gif", "Draw displacement over time (.svg, .pdf as well), or a film (.mp4 as "
        "well).", group=OUTPUT,
    )  # fmt: skip
    frame: Path | None = option("OUT.png", "Draw the blocks at the end.", group=OUTPUT)


@command_of(
    Shaken,
    "Exit code: 0 all runs agree that it falls, or that it stands; 2 bad input; 4 they do not "
    "agree, or blocks still move at the end.",
)
def shake_command(asked: Shaken) -> ExitCode:
    """Move a structure in time under a ground acceleration, by MuJoCo: does it fall, how far does
    it go."""
    inputs = {} if asked.scene in BUILTIN else {asked.scene: "the scene"}
    if asked.record is not None:
        inputs[str(asked.record)] = "the record"
    outputs = {"--csv": asked.csv, "--plot": asked.plot, "--frame": asked.frame}
    check_outputs(outputs, inputs, plot=list(_KINDS), frame=IMAGES)
    record = _record(asked)
    direction = None if asked.direction is None else vector("--direction", asked.direction, "1,0,0")
    control = named_block(asked.control)

    def shaken(tell: Tell) -> Shaking:
        return shake(
            scene_named(asked.scene), record, direction, after=asked.after, control=control,
            step=asked.step, progress=tell,
        )  # fmt: skip

    shaking = interruptible(shaken)
    if asked.csv is not None:
        write_file(asked.csv, shaking.to_dataframe().to_csv(index=False).encode("utf-8"))
    if asked.plot is not None:
        shaking.plot(_KINDS[asked.plot.suffix.lower()], asked.plot)
    if asked.frame is not None:
        shaking.plot("frame", asked.frame)
    written = [("written", str(file)) for file in outputs.values() if file is not None]
    rows = [
        ("scene", shaking.scene.name),
        ("record", f"{record.name}, largest {record.largest:.4g} m/s2, {record.duration:g} s"),
        ("in short", shaking.headline),
        ("note", "a value is that of the best run, with all in parentheses; nothing is proved"),
    ]
    show(facts([*rows, *written]), Text(), _table(shaking))
    if shaking.falls is None:
        return refuse(ExitCode.NOT_GOOD_ENOUGH, shaking.headline)
    return ExitCode.SOLVED


def _record(asked: Shaken) -> Record:
    if (asked.pulse is None) == (asked.record is None):
        raise InputError("give one of --pulse SHAPE:A:T and --record FILE.csv")
    if asked.record is not None:
        if asked.unit is None:
            raise InputError(f"--record {asked.record}: say the --unit of its accelerations, as g")
        return read_record(asked.record, asked.unit, asked.scale)
    shape, _, rest = str(asked.pulse).partition(":")
    try:
        amplitude, duration = (float(text) for text in rest.split(":"))
    except ValueError as error:
        raise InputError(f"--pulse {asked.pulse}: SHAPE:A:T is meant, as sine:0.5:1") from error
    made = pulse(shape, amplitude, duration, asked.unit or "g")  # type: ignore[arg-type]
    return made if asked.scale == 1.0 else made.scaled(asked.scale)


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
