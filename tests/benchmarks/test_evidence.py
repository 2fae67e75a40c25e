"""Measured figures on the pages: they are those of the records, and no others."""

from __future__ import annotations

import json
import os
import random
import re
import shlex
import shutil
import subprocess
from dataclasses import asdict
from datetime import date
from decimal import Decimal, InvalidOperation
from pathlib import Path

import pytest
from benchmarks import evidence
from benchmarks.evidence import Record, filled, parts, read, run
from benchmarks.experiment import Part, experiments

from cvxlimit import __version__

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(
    [DOCS.parent / "README.md", *(p for p in DOCS.rglob("*.md") if "_made" not in p.parts)]
)
PARTS = parts()
MARK = re.compile(r"<!-- record ([\w-]+)")

MADE = {"bench.md", "interaction.md", "paper.md"}
"""Pages whose figures others hold: the open bench, whose command writes its tables, and published
values recomputed by ``tests/whole/test_published.py``."""

COMMAND = re.compile(r"python -m benchmarks(?! (?:bench|list|all)\b)([^`\n]*)")

CODE = re.compile(r"<!-- record .*?<!-- /record -->|```.*?```|`[^`]*`|\$[^$]*\$", re.S)
"""What is no prose."""

STAMP = re.compile(r"\b(?:at|are of) ([0-9a-f]{7})(?: on|,)")
"""The commit in the words of a record, and of the open bench."""

TIMES = {"s", "ms", "seconds", "time", "minutes", "CPU", "MB", "GB", "compile", "solve"}
"""Words in the head of a column that say so."""

FROM_TESTS = {
    "3.11": "the least version of Python, pyproject.toml",
    "1.85": "torsion with all friction at the corners, tests/whole/test_users_code.py",
    "0.38260": "c_T of a unit square, (sqrt(2) + asinh(1)) / 6",
    "1.0464 0.5107": "Newmark's slips in m, tests/extensions/dynamics/test_shaking.py",
    "0.568 1.542 0.306 0.0754 0.0114 0.0144 0.056": "slips to and fro under a sine; "
    "tests/extensions/dynamics/test_shaking.py",
    "1.0643": "Housner's fourth impact in s, tests/extensions/dynamics/test_shaking.py",
    "0.475 0.480 0.485 9.81": "what topples a slender block, in g; "
    "tests/extensions/dynamics/test_shaking.py",
}
"""Figures of pages that something else holds."""

RECORD = Record(
    "speed", "benchmarks.speed", __version__, "1a2b3c4", "2026-11-22T10:00:00+00:00", "2 cores",
    3.0, "### walls\n| wall | s |\n|---|---|\n| 1 | 0.423056 |\nthree lines\n### arches\n12.5 ms\n",
)  # fmt: skip


def commands() -> list[str]:
    """What pages and notebooks ask experiments, continued lines joined."""
    pages = [DOCS.parent / "CONTRIBUTING.md", *PAGES]
    texts = [page.read_text("utf-8").replace("\\\n", " ") for page in pages]
    for notebook in (DOCS.parent / "notebooks").glob("*.ipynb"):
        cells = json.loads(notebook.read_text("utf-8"))["cells"]
        texts += ["".join(cell["source"]) for cell in cells]
    return sorted({line for text in texts for line in COMMAND.findall(text)})


@pytest.mark.parametrize("line", commands())
def test_options_that_pages_name_exist(line: str) -> None:
    run, *words = shlex.split(line, comments=True)
    assert run == "run"
    experiments()[words[0]].parser().parse_args(words[1:])


def marks(page: Path) -> list[str]:
    return MARK.findall(page.read_text("utf-8"))


@pytest.mark.parametrize("page", [p for p in PAGES if marks(p)], ids=lambda p: p.name)
def test_a_page_shows_the_present_records(page: Path) -> None:
    text = page.read_text("utf-8")
    assert filled(text) == text, "python -m benchmarks all puts the records into the pages"


@pytest.mark.parametrize("name", sorted({name for page in PAGES for name in marks(page)}))
def test_a_record_is_of_this_minor_version_and_of_the_command_that_is_named(name: str) -> None:
    (part,) = (part for part in PARTS if part.name == name)
    record = read(name)
    assert record is not None, f"python -m benchmarks all --parts {name}"
    assert record.command == part.command
    assert record.version.split(".")[:2] == __version__.split(".")[:2]


def test_stamps_name_commits_that_exist() -> None:
    """A figure of code that is nowhere is nobody's."""
    git = ["git", "-C", str(DOCS.parent)]
    told = subprocess.run([*git, "rev-parse", "--is-shallow-repository"], capture_output=True)
    if told.stdout.strip() != b"false":
        pytest.skip("no history here: a source distribution, or a shallow clone")
    stamps = {stamp for page in PAGES for stamp in STAMP.findall(page.read_text("utf-8"))}
    stamps |= {read(path.stem).commit for path in evidence.FOLDER.glob("*.json")}
    asked = "".join(f"{stamp}^{{commit}}\n" for stamp in sorted(stamps))
    found = subprocess.run([*git, "cat-file", "--batch-check"], input=asked.encode(),
                           capture_output=True, check=True).stdout.decode()  # fmt: skip
    missing = [line.split("^")[0] for line in found.splitlines() if line.endswith("missing")]
    assert not missing, f"measure anew what is stamped {', '.join(missing)}"


@pytest.mark.exhaustive
def test_twelve_figures_drawn_at_random_hold() -> None:
    """Figures of four digits or more that are no times, from records that take two minutes at
    most, measured again. Another draw every day; ``CVXLIMIT_DRAW=TEXT`` draws by a text."""
    seed = os.environ.get("CVXLIMIT_DRAW", date.today().isoformat())
    short = [p for p in PARTS if (record := read(p.name)) is not None and record.minutes <= 2.0]
    known = {part: lasting(read(part.name).output) for part in short}
    drawn = random.Random(seed).sample([(p, at) for p in short for at in known[p]], 12)
    parts = dict(drawn)  # each once
    again = {part: lasting(run(part, "", lambda _: None).output) for part in parts}
    wrong = [
        f"{part.name}, {' / '.join(map(str, at))}: {known[part][at]}, now {again[part].get(at)}"
        for part, at in drawn
        if not alike(known[part][at], again[part].get(at, []))
    ]
    assert not wrong, f"drawn by {seed!r}: " + "; ".join(wrong)


def lasting(output: str) -> dict[tuple[str, str, int], list[Decimal]]:
    """Figures of four digits or more by first cell, column and number of the row, without times
    and memory, which are others every time."""
    found, head = {}, [""]
    for i, line in enumerate(output.splitlines()):
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.startswith("|") or set(line) <= set("|- "):
            continue
        is_head = output.splitlines()[i + 1 : i + 2] == ["|" + "---|" * len(cells)]
        head = cells if is_head else head
        for column, cell in zip(head, cells, strict=True):
            exact = [Decimal(word) for word in re.findall(r"-?\d+\.\d+(?![\de])", cell)
                     if len(word.replace(".", "").lstrip("-0")) >= 4]  # fmt: skip
            if exact and not is_head and not TIMES & set(re.findall(r"\w+", column)):
                found[cells[0], column, i] = exact
    return found


def alike(one: list[Decimal], other: list[Decimal]) -> bool:
    """To a unit of the last digit: another processor rounds otherwise."""
    return len(one) == len(other) and all(
        abs(a - b) <= Decimal((0, (1,), a.as_tuple().exponent))
        for a, b in zip(one, other, strict=True)
    )


def test_every_record_belongs_to_a_part() -> None:
    assert {path.stem for path in evidence.FOLDER.glob("*.json")} <= {part.name for part in PARTS}


@pytest.mark.parametrize(
    "page",
    [p for p in PAGES if p.parent.name == "evidence" and p.name not in MADE],
    ids=lambda p: p.name,
)
def test_figures_in_the_text_stand_in_a_record_of_the_page(page: Path) -> None:
    """Of three or more digits: fewer are settings and round words."""
    text = page.read_text("utf-8")
    measured = [
        number
        for name in marks(page)
        if (record := read(name)) is not None
        for number in numbers(record.output)
    ]
    loose = [quoted for quoted in figures(CODE.sub("", text)) if not stands(quoted, measured)]
    assert not loose, f"no record of this page holds {', '.join(loose)}"


@pytest.mark.parametrize(
    "page",
    [p for p in PAGES if p.parent.name not in ("evidence", "api")],
    ids=lambda p: p.name,
)
def test_figures_of_other_pages_are_printed_there_or_stand_among_the_evidence(page: Path) -> None:
    """What code on a page prints is compared by ``test_readme.py`` and its like."""
    text = page.read_text("utf-8")
    sources = ["".join(CODE.findall(text)), " ".join(FROM_TESTS)]
    sources += [other.read_text("utf-8") for other in PAGES if other.parent.name == "evidence"]
    known = [number for source in sources for number in numbers(source)]
    loose = [quoted for quoted in figures(CODE.sub("", text)) if not stands(quoted, known)]
    assert not loose, f"nothing prints or holds {', '.join(loose)}"


def figures(text: str) -> list[str]:
    """Decimal figures with three or more significant digits."""
    found = re.findall(r"(?<![\w.,-])\d+\.\d+(?![\d.]*\w)", text)
    return [number for number in found if len(number.replace(".", "").lstrip("0")) >= 3]


def numbers(text: str) -> list[Decimal]:
    found = []
    for word in re.findall(r"\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?", text):
        try:
            found.append(Decimal(word.replace(",", "")))
        except InvalidOperation:
            continue
    return found


def stands(quoted: str, measured: list[Decimal]) -> bool:
    """Rounded to the digits that are quoted, one of the measured numbers is this one."""
    value = Decimal(quoted)
    return any(
        abs(number - value) <= Decimal((0, (5,), value.as_tuple().exponent - 1))
        for number in measured
    )


def test_a_block_shows_tables_text_and_where_it_is_from() -> None:
    block = RECORD.block("walls")
    assert "| 1 | 0.423056 |" in block
    assert "```text\nthree lines\n```" in block
    assert "12.5" not in block
    assert RECORD.stamp.startswith("*`python -m benchmarks.speed`: 3 min")
    assert "at 1a2b3c4 on 22 November 2026; 2 cores" in RECORD.stamp
    with pytest.raises(ValueError, match="no heading 'domes'"):
        RECORD.block("domes")


def test_what_stands_between_the_marks_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "speed.json").write_text(json.dumps(asdict(RECORD)))
    mark = "<!-- record speed: arches -->\nold 9.99\n<!-- /record -->\n"
    page = f"a\n{mark}{mark}b\n"
    made = filled(page, tmp_path)
    assert made.count("python -m") == 1
    assert "12.5 ms" in made
    assert "9.99" not in made
    assert made.startswith("a\n<!-- record speed: arches -->\n")
    assert made.endswith("<!-- /record -->\nb\n")
    assert filled(made, tmp_path) == made


def test_figures_are_held_against_records() -> None:
    """0.4231 is 0.423056 to four digits, and 0.4230 is not; 12.5 stands there, 12.6 does not."""
    measured = numbers(RECORD.output)
    assert figures("about 0.4231, 12.5 ms, 1 %, 0.05, 2.0") == ["0.4231", "12.5"]
    assert [stands(quoted, measured) for quoted in ("0.4231", "0.4230", "12.5", "12.6")] == [
        True, False, True, False,
    ]  # fmt: skip


def test_a_command_that_fails_leaves_no_record(monkeypatch: pytest.MonkeyPatch) -> None:
    failing = Part(1, "--nothing", "failing", experiment="small")
    monkeypatch.setattr(evidence.sys, "executable", shutil.which("false"))
    with pytest.raises(evidence.subprocess.CalledProcessError):
        run(failing, "1a2b3c4", lambda line: None)


def test_a_record_holds_what_its_command_printed() -> None:
    record = run(
        Part(1, "--scenes stack --repeat 1", experiment="small"), "1a2b3c4", lambda _: None
    )
    assert record.output.splitlines()[2].startswith("| stack | 5 |")
    assert (record.commit, record.version) == ("1a2b3c4", __version__)
