"""Every measured figure of the documentation: the records of all experiments, and the pages.

``python -m benchmarks all`` makes the record of each :class:`~benchmarks.experiment.Part` at one
commit, keeps what was printed in ``docs/evidence/records``, and puts that between the marks of the
pages: ``<!-- record NAME -->`` for all of it, ``<!-- record NAME: TITLE -->`` for what stands below
the heading ``### TITLE``.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from datetime import datetime
from itertools import groupby
from pathlib import Path
from time import perf_counter

from benchmarks.experiment import Part, experiments
from benchmarks.machine import environment
from cvxlimit.base.files import write_file
from cvxlimit.base.versions import __version__

ROOT = Path(__file__).parents[1]
EVIDENCE = ROOT / "docs" / "evidence"
FOLDER = EVIDENCE / "records"
SOURCES = ("src", "benchmarks", "pyproject.toml")
"""What a figure depends on."""


def parts() -> list[Part]:
    """Every record there is to make; each stands beside the experiment that makes it."""
    return [part for each in experiments().values() for part in each.parts]


@dataclass(frozen=True)
class Record:
    """What a part printed, and when, where and with what code it did."""

    part: str
    command: str
    version: str
    commit: str
    measured: str
    machine: str
    minutes: float
    output: str

    def section(self, title: str | None = None) -> str:
        """The output, or the lines below one of its headings."""
        if title is None:
            return self.output
        found = re.search(rf"^### {re.escape(title)}\n(.*?)(?=^### |\Z)", self.output, re.M | re.S)
        if found is None:
            raise ValueError(f"the record of {self.part} has no heading {title!r}")
        return found[1]

    def block(self, title: str | None = None) -> str:
        """Markdown for a page: tables as they are, other lines as text, and where all is from.

        With the title "stamp" the last alone, for pages whose tables the part writes itself.
        """
        day = f"{datetime.fromisoformat(self.measured):%d %B %Y}".lstrip("0")
        stamp = (
            f"*`python -m {self.command}`: {max(self.minutes, 1):.0f} min with cvxlimit "
            f"{self.version} at {self.commit} on {day}; {self.machine}.*"
        )
        tables = [] if title == "stamp" else _paragraphs(self.section(title))
        return "\n\n".join((*tables, stamp))


def _paragraphs(output: str) -> list[str]:
    """Runs of table lines as they are, runs of other lines between fences."""
    lines = [line for line in output.splitlines() if line.strip()]
    runs = [(is_table, "\n".join(run)) for is_table, run in groupby(lines, _is_row)]
    return [text if is_table else f"```text\n{text}\n```" for is_table, text in runs]


def _is_row(line: str) -> bool:
    return line.startswith("|")


def read(part: str, folder: Path = FOLDER) -> Record | None:
    """The record of a part, or None before it was first measured."""
    path = folder / f"{part}.json"
    if not path.exists():
        return None
    content = json.loads(path.read_text(encoding="utf-8"))
    return Record(**{column.name: content[column.name] for column in fields(Record)})


def measure(names: Sequence[str], again: bool, workers: int, say: Callable[[str], None]) -> int:
    """Run the parts that have no record of this commit, so many at a time, and fill the pages.

    Returns how many failed.
    """
    commit = committed()
    FOLDER.mkdir(exist_ok=True)
    due = [part for part in parts() if not names or part.name in names]
    due.sort(key=lambda part: -part.minutes)  # the longest first, so that workers end together
    if not again:
        due = [part for part in due if (known := read(part.name)) is None or known.commit != commit]
    say(f"{len(due)} parts to measure, some {sum(part.minutes for part in due):g} min of one core")
    with ThreadPoolExecutor(workers) as pool:
        done = pool.map(lambda part: _measured(part, commit, say), due)
        failed = len(due) - sum(done)
    fill()
    return failed


def _measured(part: Part, commit: str, say: Callable[[str], None]) -> bool:
    say(f"{part.name}: about {part.minutes:g} min")
    _forget_older(part, commit)
    try:
        record = run(part, commit, lambda line: say(f"{part.name}: {line}"))
    except subprocess.CalledProcessError as error:
        say(f"{part.name}: failed with exit code {error.returncode}")
        return False
    write_file(FOLDER / f"{part.name}.json", (json.dumps(asdict(record), indent=1) + "\n").encode())
    say(f"{part.name}: done, {record.minutes:g} min")
    return True


def _forget_older(part: Part, commit: str) -> None:
    """Delete what an interrupted run at another commit left behind."""
    begun = ROOT / "benchmarks" / "results" / "begun" / part.name
    if not part.keeps or (begun.exists() and begun.read_text() == commit):
        return
    kept = ROOT / part.keeps
    shutil.rmtree(kept) if kept.is_dir() else kept.unlink(missing_ok=True)
    begun.parent.mkdir(parents=True, exist_ok=True)
    begun.write_text(commit)


def committed() -> str:
    """The commit that is measured: figures of code that is nowhere are nobody's."""
    if _git("status", "--porcelain", "--", *SOURCES):
        raise SystemExit(
            f"commit the changes below {', '.join(SOURCES)} first: records name a commit"
        )
    return _git("rev-parse", "--short=7", "HEAD")


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise SystemExit(f"records name a commit, and git told none: {error}") from error
    return done.stdout.strip()


def run(part: Part, commit: str, say: Callable[[str], None]) -> Record:
    """One part, in a process of its own with one thread; what it prints is shown as it comes."""
    about, start = environment(), perf_counter()
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    command = [sys.executable, "-m", *shlex.split(part.command)]
    lines = []
    with subprocess.Popen(
        command, cwd=ROOT, env={**os.environ, **single}, stdout=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout or ():
            lines.append(line.rstrip())
            say(lines[-1])
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    machine = about["machine"]
    return Record(
        part.name,
        part.command,
        __version__,
        commit,
        about["started"],
        f"{machine['cores']} cores, {machine['cpu']}, load {machine['load_before']} at its start",
        round((perf_counter() - start) / 60.0, 1),
        "\n".join(lines) + "\n",
    )


_MARKED = re.compile(r"<!-- record ([\w-]+)(?:: ([^>]*?))? -->\n.*?<!-- /record -->", re.S)


def filled(text: str, folder: Path = FOLDER) -> str:
    """A page with the present records between its marks."""

    def block(found: re.Match[str]) -> str:
        record = read(found[1], folder)
        inside = "" if record is None else f"\n{record.block(found[2])}\n\n"
        head = found[0].split("\n", 1)[0]
        return f"{head}\n{inside}<!-- /record -->"

    return _MARKED.sub(block, text)


def fill() -> None:
    """All pages, and the README."""
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            write_file(page, new.encode())
