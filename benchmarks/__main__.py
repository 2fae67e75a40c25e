"""``python -m benchmarks [list | run | all | bench]``: what is measured, and the open bench."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from rich.console import Console

from benchmarks import evidence
from benchmarks.bench import commands
from benchmarks.experiment import experiments

console = Console(highlight=False, markup=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """List the experiments, run one, make the records of all, or pass on to the open bench."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given[:1] == ["bench"]:
        return commands.main(given[1:])
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    actions = parser.add_subparsers(dest="action")
    actions.add_parser("list", help="what can be measured")
    run = actions.add_parser("run", help="measure one of them: run NAME --help has its options")
    run.add_argument("name", choices=experiments(), metavar="NAME")
    run.add_argument("options", nargs=argparse.REMAINDER)
    every = actions.add_parser(
        "all", help="measure every figure of the documentation at this commit, two hours on one "
        "core; what has a record of it is not measured again")  # fmt: skip
    every.add_argument("--parts", nargs="+", default=[], metavar="PART", choices=[
        part.name for part in evidence.parts()], help="only these")  # fmt: skip
    every.add_argument("--again", action="store_true", help="also what has a record of this commit")
    every.add_argument("--workers", type=int, default=1, help="so many at once: cores, at most")
    every.add_argument("--fill", action="store_true", help="only put present records into pages")
    actions.add_parser("bench", help="the open bench: bench --help")
    asked = parser.parse_args(given)
    try:
        if asked.action == "list":
            _list()
        elif asked.action == "run":
            experiments()[asked.name](asked.options)
        elif asked.action == "all" and asked.fill:
            evidence.fill()
        elif asked.action == "all":
            workers = max(asked.workers, 1)
            return min(1, evidence.measure(asked.parts, asked.again, workers, console.print))
        else:
            parser.print_help()
            return 2
    except KeyboardInterrupt:
        console.print("interrupted: records that were finished are kept, the same command goes on")
        return 130
    return 0


def _list() -> None:
    for each in experiments().values():
        minutes = sum(part.minutes for part in each.parts)
        records = f" {minutes:g} min for its records." if each.parts else ""
        console.print(f"{each.name:12} {each.what}{records}")


if __name__ == "__main__":
    sys.exit(main())
