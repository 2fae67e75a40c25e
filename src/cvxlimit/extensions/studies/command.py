"""``cvxlimit sweep``: all variations of a scene, over processes, stored as they come."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table
from rich.text import Text

from cvxlimit.base.arrays import SMALL
from cvxlimit.base.checks import count
from cvxlimit.base.lines import one_line
from cvxlimit.base.search import processes
from cvxlimit.cli.interrupting import Tell, interruptible, with_result
from cvxlimit.cli.options import Command, named_values
from cvxlimit.cli.report import counted
from cvxlimit.cli.shell import ExitCode, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.sweeping import sweep
from cvxlimit.solution import Status
from cvxlimit.solution.bracket import rounded, rounded_down, rounded_up

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, kw_only=True)
class SweepCommand(Command):
    """Solve all variations of a scene; every row has its own bracket, and failures are kept as
    rows.

    Model
    -----
    vary : NAME=VALUES
        What is varied, once or more, all combinations: friction, cohesion, density, size, tilt,
        direction (degrees), compressive_strength, tensile_strength, or an option of solve such as
        surface. VALUES are 0.5,0.6,0.7 or FIRST:LAST:NUMBER.

    Output
    ------
    output, -o : FOLDER
        Store every row there once it is solved (Parquet: pandas.read_parquet reads the folder). The
        same command continues an interrupted sweep.

    Effort
    ------
    workers : N
        Processes that solve; 1 unless given.

    Exit code
    ---------
    0 all variations solved; 2 bad input; 3 none has an answer; 4 some are not solved and kept as
    rows.
    """

    scene: str
    vary: list[str]
    surface: str | None = None
    output: Path | None = None
    workers: int = 1

    def run(self) -> ExitCode:
        grid = _grid(self.vary)
        if self.surface is not None and "surface" in grid:
            raise InputError("--surface and --vary surface=... exclude each other: leave one out")
        number = count(self.workers, 1, "--workers")

        def swept(tell: Tell) -> DataFrame:
            scene = scene_named(self.scene)
            options: dict[str, Any] = (
                {} if "surface" in grid else {"surface": self.surface or "conic"}
            )
            with processes(number) as pool:
                return sweep(
                    scene,
                    grid,
                    executor=pool,
                    path=self.output,
                    progress=with_result(tell),
                    **options,
                )

        table = interruptible(swept)
        if table.empty:  # only Ctrl-C leaves none
            raise KeyboardInterrupt
        show(_printed(table, list(grid)), Text(_counted(table, self.output)))
        if table.attrs["is_interrupted"]:
            done = f"{len(table)} of {table.attrs['variations']} variations"
            goes_on = "the same command goes on there"
            cure = goes_on if self.output else "run it with --output FOLDER to go on"
            return refuse(ExitCode.NOT_GOOD_ENOUGH, f"interrupted after {done}: {cure}")
        return _verdict(table, list(grid))


def _grid(vary: Sequence[str]) -> dict[str, list[Any]]:
    form = "NAME=VALUES is meant, as in friction=0.5,0.6,0.7"
    given = named_values("--vary", vary, form)
    return {name: _values(text, values) for text, name, values in given}


def _values(given: str, text: str) -> list[Any]:
    if ":" not in text:
        return [_value(part.strip()) for part in text.split(",")]
    try:
        first, last, number = text.split(":")
        return np.linspace(float(first), float(last), int(number)).round(12).tolist()
    except ValueError as error:
        raise InputError(f"--vary {given}: FIRST:LAST:NUMBER is meant, as in 0.5:0.9:5") from error


def _value(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _printed(table: DataFrame, parameters: Sequence[str]) -> Table:
    result = Table(box=None, pad_edge=False, header_style="bold")
    ends: dict[str, Callable[[float], str]] = {}
    if table["least_factor"].notna().any():
        ends["least_factor"] = rounded
    ends |= {"load_factor": rounded, "lower": rounded_down, "upper": rounded_up}
    if (table["dilatancy"] > SMALL).any():
        ends["dilatancy"] = partial(rounded, digits=3)
    names = (name.replace("_", " ") for name in ends)
    digits = {name: _telling_apart(table[name].tolist()) for name in parameters}
    for name in (*parameters, *names, "status"):
        result.add_column(one_line(name))
    for row in table.head(40).to_dict("records"):
        found = [shown(row[name]) if np.isfinite(row[name]) else "" for name, shown in ends.items()]
        given = ((row[name], digits[name]) for name in parameters)
        inputs = [f"{v:.{n}g}" if isinstance(v, float) else str(v) for v, n in given]
        result.add_row(*map(one_line, inputs), *found, one_line(row["error"] or row["status"]))
    return result


def _telling_apart(values: Sequence[Any]) -> int:
    """Digits, six or more, with which different numbers are printed differently.

    >>> _telling_apart([0.5, 0.6]), _telling_apart([21.80140948, 21.80140949])
    (6, 10)
    """
    numbers = {value for value in values if isinstance(value, float)}
    alike = (n for n in range(6, 17) if len({f"{x:.{n}g}" for x in numbers}) == len(numbers))
    return next(alike, 17)


def _counted(table: DataFrame, output: Path | None) -> str:
    kinds = table["status"].where(table["error"] == "", "failed").value_counts()
    said = ", ".join(f"{number} {kind}" for kind, number in kinds.items())
    where = "" if output is None else f"; all rows in {one_line(str(output))}"
    if table.attrs["found"]:
        where += f", where {table.attrs['found']} of {len(table)} were found"
    return f"{counted(len(table), 'variation')}: {said}{where}"


def _verdict(table: DataFrame, parameters: Sequence[str]) -> ExitCode:
    statuses = [None if row.error else Status(row.status) for row in table.itertuples()]
    is_interval = table["least_factor"].notna()  # which may have no upper end
    bad = [
        i
        for i, status in enumerate(statuses)
        if status is None or not (status.is_good or (is_interval[i] and not status.has_answer))
    ]
    if not bad:
        return ExitCode.SOLVED
    row = table.iloc[bad[0]]
    where = ", ".join(f"{name} {row[name]}" for name in parameters)
    none_can = all(status is not None and not status.has_answer for status in statuses)
    return refuse(
        ExitCode.NO_ANSWER if none_can else ExitCode.NOT_GOOD_ENOUGH,
        f"{len(bad)} of {len(table)} variations have no certified answer; the first is {where}: "
        f"{row['error'] or row['status']}",
    )
