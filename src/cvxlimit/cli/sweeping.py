"""``cvxlimit sweep``: all variations of a scene, over processes, stored as they come."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table
from rich.text import Text

from cvxlimit.bracket import rounded, rounded_down, rounded_up
from cvxlimit.checks import count as whole_number
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.outputs import ExitCode, refuse
from cvxlimit.cli.report import count, show
from cvxlimit.errors import InputError
from cvxlimit.io.fields import one_line
from cvxlimit.methods.interaction.branching.search import processes
from cvxlimit.solution import Status
from cvxlimit.strengths import PROPERTIES
from cvxlimit.studies import sweep

if TYPE_CHECKING:
    from pandas import DataFrame

Job = Callable[[], int]

_SHOWN = 40
"""Rows that are printed; all are in the folder."""


def sweep_command(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE", help="Scene file, or name of a built-in scene.", show_default=False
        ),
    ],
    vary: Annotated[
        list[str],
        typer.Option(
            metavar="NAME=VALUES",
            help=f"What is varied, once or more, all combinations: {', '.join(PROPERTIES)}, "
            "density, size, tilt, direction (degrees), or an option of solve such as surface. "
            "VALUES are 0.5,0.6,0.7 or FIRST:LAST:NUMBER.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Store rows there as they come (Parquet). The same command again goes on where "
            "the last one ended.",
        ),
    ] = None,
    surface: Annotated[
        str, typer.Option(metavar="conic|octagon|K-gon", help="Yield surface, as for solve.")
    ] = "conic",
    workers: Annotated[int, typer.Option(metavar="N", help="Processes that solve.")] = 1,
) -> Job:
    """Solve all variations of a scene; each has a bracket of its own, failures are rows."""
    return partial(_sweep_job, scene, vary, output, surface, workers)


def _sweep_job(
    name: str, vary: Sequence[str], output: Path | None, surface: str, workers: int
) -> ExitCode:
    grid = _grid(vary)
    options: dict[str, Any] = {} if "surface" in grid else {"surface": surface}
    number = whole_number(workers, 1, "--workers")

    def swept(tell: Tell) -> DataFrame:
        with processes(number) as pool:
            return sweep(
                scene_named(name), grid, executor=pool, path=output, progress=tell, **options
            )

    table = interruptible(swept)
    if table.empty:  # only Ctrl-C leaves none
        raise KeyboardInterrupt
    show(_printed(table, list(grid)), Text(_counted(table, output)))
    if table.attrs["is_interrupted"]:
        done = f"{len(table)} of {table.attrs['variations']} variations"
        cure = "run it with --output FOLDER" if output is None else "the same command goes on there"
        return refuse(ExitCode.NOT_GOOD_ENOUGH, f"interrupted after {done}: {cure}")
    return _verdict(table, list(grid))


def _grid(vary: Sequence[str]) -> dict[str, list[Any]]:
    grid: dict[str, list[Any]] = {}
    for given in vary:
        name, sign, values = given.partition("=")
        if not (name and sign and values):
            raise InputError(f"--vary {given}: NAME=VALUES is meant, as in friction=0.5,0.6,0.7")
        if name in grid:
            raise InputError(f"--vary {given}: {name!r} is varied already; give its values at once")
        grid[name] = _values(given, values)
    return grid


def _values(given: str, text: str) -> list[Any]:
    """Numbers or words between commas, or FIRST:LAST:NUMBER evenly spaced ones."""
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
    for name in (*parameters, "load factor", "lower", "upper", "status"):
        result.add_column(one_line(name))
    for row in table.head(_SHOWN).to_dict("records"):
        ends = ("load_factor", rounded), ("lower", rounded_down), ("upper", rounded_up)
        found = [shown(row[name]) if np.isfinite(row[name]) else "" for name, shown in ends]
        inputs = [f"{v:g}" if isinstance(v, float) else str(v) for v in map(row.get, parameters)]
        result.add_row(*map(one_line, inputs), *found, one_line(row["error"] or row["status"]))
    return result


def _counted(table: DataFrame, output: Path | None) -> str:
    kinds = table["status"].where(table["error"] == "", "failed").value_counts()
    said = ", ".join(f"{number} {kind}" for kind, number in kinds.items())
    where = "" if output is None else f"; all rows in {one_line(str(output))}"
    return f"{count(len(table), 'variation')}: {said}{where}"


def _verdict(table: DataFrame, parameters: Sequence[str]) -> ExitCode:
    """Solved if every row is; one line on stderr about the first that is not."""
    good = [not row.error and Status(row.status).is_good for row in table.itertuples()]
    if all(good):
        return ExitCode.SOLVED
    row = table.iloc[good.index(False)]
    where = ", ".join(f"{name} {row[name]}" for name in parameters)
    reason = row["error"] or row["status"]
    return refuse(
        ExitCode.NOT_GOOD_ENOUGH,
        f"{good.count(False)} of {len(good)} variations have no certified answer; the first is "
        f"{where}: {reason}",
    )
