"""``python -m benchmarks bench``: cases, brackets, tools, tables. See README.md beside it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.bench import archive, chart, outside, prove, running
from benchmarks.bench.case import cases

console = Console(highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Parse and do."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks bench", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    options = {
        "list": "names and titles of all cases",
        "prove": "brackets into the records; those that stand are kept",
        "run": "tools on cases, one row at a time; rows that stand are kept",
        "table": "what the tools answered, beside the proof; --write: into docs/evidence/bench.md",
        "chart": "models against experiments; --write: into docs/evidence/bench.png",
        "archive": "problems for those who write solvers, in one file with checksums",
        "outside": "other solvers on an archive, from its files alone; --write: into the docs",
    }
    for name, text in options.items():
        command = commands.add_parser(name, help=text, description=text)
        if name in ("archive", "outside"):
            command.add_argument("archive", type=Path, metavar="ARCHIVE.zip")
        elif name != "chart":
            command.add_argument("--case", default="*", metavar="PATTERN")
        if name == "archive":
            command.add_argument("--most", type=int, default=100_000, help="contacts, at most")
            command.add_argument("--hard", type=int, default=100, help="hard small problems")
        if name == "prove":
            command.add_argument("--model", default="*", metavar="PATTERN")
        if name == "run":
            command.add_argument("--tool", default="*", metavar="NAME")
        if name in ("run", "outside"):
            command.add_argument("--seconds", type=float, default=60.0, help="for one of them")
        if name in ("table", "chart", "outside"):
            command.add_argument("--write", action="store_true")
        if name == "table":
            command.add_argument("--all", action="store_true", help="also what all got right")
    asked = parser.parse_args(arguments)
    if asked.command == "archive":
        archive.write(asked.archive, asked.most, asked.hard, console.print)
    elif asked.command == "outside":
        found = outside.solve(asked.archive, asked.seconds, console.print)
        outside.table(found, asked.write, console.print)
    elif asked.command == "list":
        for each in cases(asked.case):
            console.print(f"{each.name:28} {each.record()['title']}")
    elif asked.command == "prove":
        prove.all_of(asked.case, asked.model, console.print)
    elif asked.command == "run":
        running.run(asked.tool, asked.case, asked.seconds, console.print)
    elif asked.command == "table":
        running.table(asked.case, asked.write, asked.all, console.print)
    else:
        chart.draw(asked.write, console.print)
