"""``python -m benchmarks bench``: cases, brackets, tools, tables. See README.md beside it."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

from benchmarks.bench import archive, chart, outside, prove, running
from benchmarks.bench.case import cases
from benchmarks.experiment import Experiment


def listed(case: str = "*") -> Iterator[str]:
    """Names and titles of all cases."""
    for each in cases(case):
        yield f"{each.name:28} {each.record()['title']}"


COMMANDS = {
    name: Experiment(name, run, group="bench")
    for name, run in {
        "list": listed, "prove": prove.all_of, "run": running.run, "table": running.table,
        "chart": chart.draw, "archive": archive.write, "outside": outside.solve,
    }.items()
}  # fmt: skip
"""What can be done, by name."""


def main(arguments: Sequence[str]) -> int:
    """Do what the first argument names, with options; without, tell what there is."""
    if arguments[:1] and arguments[0] in COMMANDS:
        COMMANDS[arguments[0]](arguments[1:])
        return 0
    sys.stdout.writelines(f"{each.name:8} {each.what}\n" for each in COMMANDS.values())
    return 2
