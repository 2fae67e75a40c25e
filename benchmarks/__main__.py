"""``python -m benchmarks [all | run | charts | headline | list]``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar

from rich.console import Console

from benchmarks import evidence, headline
from benchmarks.cases import Case, all_cases
from benchmarks.results import Record, environment, read, write
from benchmarks.runs import Limits
from benchmarks.suite import QUICK, Plan, methods_of, run_case, sizes_of

console = Console(highlight=False, markup=False, soft_wrap=True)
progress = Console(highlight=False, markup=False, soft_wrap=True, stderr=True)
HERE = Path(__file__).parent
ACTIONS = {
    "all": "measure every figure of the documentation at this commit, two hours on one core; what "
    "has a record of it is not measured again",
    "run": "measure all cases, which takes hours, or some of them, and draw the charts",
    "charts": "draw them again from the results",
    "headline": "the figures of the README, a quarter of an hour",
    "list": "the cases and methods",
}
TAKES = {
    "all": {"parts", "again", "workers"},
    "run": {"cases", "sizes", "methods", "repeat", "limit", "memory", "quick", "out", "docs"},
    "charts": {"out", "docs"},
    "headline": {"repeat", "limit", "memory", "quick", "out"},
    "list": {"cases"},
}
"""Options of each action."""

_Number = TypeVar("_Number", int, float)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the suite, draw its charts, or measure the headline figures."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if options.action is None:
        parser.print_help()
        return 2
    _refuse_unused(parser, options)
    _make_folders(options)
    actions = {"all": _all, "run": _run, "charts": _charts, "headline": _headline, "list": _list}
    try:
        return actions[options.action](options)
    except KeyboardInterrupt:
        kept = {
            "all": "; parts that were finished have their records, the same command goes on",
            "run": f"; sizes that were finished are in {options.out}",
        }
        console.print(f"interrupted{kept.get(options.action, '')}")
        return 130


def _refuse_unused(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    for name, value in vars(options).items():
        given = name != "action" and value != parser.get_default(name)
        if given and name not in TAKES[options.action]:
            parser.error(f"{options.action} does not take --{name}")


def _make_folders(options: argparse.Namespace) -> None:
    """Before anything is measured: a folder that cannot be written to would lose it."""
    out = options.out if options.action in ("run", "headline") else None
    for folder in (out, options.docs):
        try:
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SystemExit(f"{folder} cannot be made a folder: {error.strerror}") from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    add = parser.add_argument
    explained = "; ".join(f"{name}: {text}" for name, text in ACTIONS.items())
    add("action", nargs="?", choices=ACTIONS, help=explained)
    add("--parts", nargs="+", choices=[part.name for part in evidence.PARTS], metavar="PART",
        help="of all: only these; " + ", ".join(part.name for part in evidence.PARTS))  # fmt: skip
    add("--again", action="store_true", help="of all: also what has a record of this commit")
    add("--workers", type=_number(int), default=1,
        help="of all: so many parts at once; no more than there are cores")  # fmt: skip
    add("--cases", nargs="+", metavar="CASE", help="names of cases; all unless given")
    add(
        "--sizes",
        nargs="+",
        type=_number(int),
        default=[],
        help="contacts, instead of the cases' own",
    )
    add("--methods", nargs="+", default=[], help="method names with * and ?; see list")
    add("--repeat", type=_number(int), help="runs per method (run 3, headline 5; 1 with --quick)")
    add("--limit", type=_number(float), help="seconds per run (120; 20 with --quick)")
    add("--memory", type=_number(float), default=8.0, help="GB of address space per run")
    add("--quick", action="store_true", help="small sizes, one run each: does it all work?")
    add("--out", type=Path, default=HERE / "results", help="folder of results and charts")
    add("--docs", type=Path, help="charts also go here (docs/ for those in the README)")
    return parser


def _number(kind: type[_Number]) -> Callable[[str], _Number]:
    def parse(text: str) -> _Number:
        try:
            value = kind(text)
        except ValueError:
            value = kind(0)
        if not 0 < value < float("inf"):
            what = "a whole number" if kind is int else "a number"
            raise argparse.ArgumentTypeError(f"must be {what} above 0, got {text}")
        return value

    return parse


def _plan(options: argparse.Namespace) -> Plan:
    base = QUICK if options.quick else Plan()
    return Plan(
        sizes=tuple(options.sizes) or base.sizes,
        methods=tuple(options.methods),
        repeat=options.repeat or base.repeat,
        limits=Limits(options.limit or base.limits.seconds, options.memory),
        reference_limits=Limits(base.reference_limits.seconds, options.memory),
    )


def _cases(names: Sequence[str] | None) -> list[Case]:
    cases = all_cases()
    unknown = sorted(set(names or ()) - set(cases))
    if unknown:
        raise SystemExit(f"there is no case {unknown[0]!r}; there are {', '.join(cases)}")
    return [case for name, case in cases.items() if not names or name in names]


def _check_methods(patterns: Sequence[str], cases: Sequence[Case]) -> None:
    names = [method.name for case in cases for method in methods_of(case)]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise SystemExit(f"no method of these cases matches {pattern!r}; list shows them")


def _run(options: argparse.Namespace) -> int:
    plan, about = _plan(options), environment()
    cases = _cases(options.cases)
    _check_methods(options.methods, cases)
    about["options"] = {
        "repeat": plan.repeat,
        "seconds_per_run": plan.limits.seconds,
        "threads_per_run": plan.limits.threads,
    }
    rows: list[Record] = []
    for case in cases:
        if not sizes_of(case, plan):
            console.print(f"{case.name}: left out, it has no size but {case.sizes[0]}")
        with console.status(case.name) as status:
            for record in run_case(case, plan, status.update):
                rows.append(record)
                _report(record)
                write(options.out, rows, about)
    if not rows:
        raise SystemExit("nothing was run: none of these methods or sizes belongs to the cases")
    console.print(f"written: {options.out / 'results.csv'} and results.json")
    return _charts(options)


def _report(record: Record) -> None:
    row = record.row
    figures = row.reason
    if not row.failed and row.total is not None:
        error = "?" if row.error is None else f"{row.error:.1e}"
        figures = f"{row.total:9.3f} s  error {error}  {row.memory or 0:6.0f} MB  {row.status}"
    console.print(f"{record.case:24} {row.contacts:6} {row.method:46} {figures}")


def _charts(options: argparse.Namespace) -> int:
    try:
        from benchmarks import charts
    except ImportError as error:
        raise SystemExit(f"charts need Matplotlib ({error}): pip install -e '.[dev]'") from error
    if not (options.out / "results.json").exists():
        raise SystemExit(f"there is no results.json in {options.out}: run writes one")
    try:
        rows, about = read(options.out)
    except (ValueError, TypeError, AttributeError, KeyError) as error:
        raise SystemExit(
            f"results.json in {options.out} was not written by run: {error}"
        ) from error
    for path in charts.draw_all(rows, about, options.out):
        console.print(f"drawn: {path}")
        if options.docs is not None:
            (options.docs / path.name).write_bytes(path.read_bytes())
    return 0


def _all(options: argparse.Namespace) -> int:
    return min(1, evidence.measure(options.parts, options.again, options.workers, console.print))


def _headline(options: argparse.Namespace) -> int:
    limits = Limits(options.limit or (20.0 if options.quick else 120.0), options.memory)
    repeat = options.repeat or (1 if options.quick else 5)
    text = headline.run(repeat, limits, options.out, options.quick, progress.print)
    console.print(text)
    return 0


def _list(options: argparse.Namespace) -> int:
    for case in _cases(options.cases):
        console.print(f"{case.name}: {case.family}, sizes {', '.join(map(str, case.sizes))}")
    names = {m.name: m.line for case in _cases(options.cases) for m in methods_of(case)}
    for name, line in names.items():
        console.print(f"  {name:50} {line}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
