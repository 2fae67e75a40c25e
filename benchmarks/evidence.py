"""Every measured figure of the documentation: the records of all experiments, and the pages.

``python -m benchmarks all`` makes the record of each :class:`~benchmarks.experiment.Part` at one
commit, keeps what was printed in ``docs/evidence/records``, and puts that between the marks of the
pages: ``<!-- record NAME -->`` for all of it, ``<!-- record NAME: TITLE -->`` for what stands below
the heading ``### TITLE``. Where all of it is from stands once on a page, below the last block, or
alone under ``<!-- record NAME: stamp -->``.
"""

from __future__ import annotations

import json
import os
import re
import shlex
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
        """Markdown for a page: tables as they are, other lines as text."""
        lines = [line for line in self.section(title).splitlines() if line.strip()]
        runs = [(is_row, "\n".join(run)) for is_row, run in groupby(lines, _is_row)]
        return "\n\n".join(text if is_row else f"```text\n{text}\n```" for is_row, text in runs)

    @property
    def stamp(self) -> str:
        """Where all of it is from: stands once on a page, below the last block."""
        day = f"{datetime.fromisoformat(self.measured):%d %B %Y}".lstrip("0")
        return (
            f"*`python -m {self.command}`: {max(self.minutes, 1):.0f} min with cvxlimit "
            f"{self.version} at {self.commit} on {day}; {self.machine}.*"
        )


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
    try:
        record = run(part, commit, lambda line: say(f"{part.name}: {line}"))
    except subprocess.CalledProcessError as error:
        say(f"{part.name}: failed with exit code {error.returncode}")
        return False
    write_file(FOLDER / f"{part.name}.json", (json.dumps(asdict(record), indent=1) + "\n").encode())
    say(f"{part.name}: done, {record.minutes:g} min")
    return True


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

    last = {found[1]: found.start() for found in _MARKED.finditer(text)}

    def block(found: re.Match[str]) -> str:
        record, head = read(found[1], folder), found[0].split("\n", 1)[0]
        if record is None:
            return f"{head}\n<!-- /record -->"
        shown = [] if found[2] == "stamp" else [record.block(found[2])]
        shown += [record.stamp] if last[found[1]] == found.start() else []
        return "\n\n".join([head, *shown, "<!-- /record -->"])

    return _MARKED.sub(block, text)


def fill() -> None:
    """All pages, and the README."""
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            write_file(page, new.encode())
