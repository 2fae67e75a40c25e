"""Tools on cases: runs, one row at a time, and the table of what they answered."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from benchmarks.bench.case import HOME, ROOT, Case, cases
from benchmarks.experiment import table as table_of
from benchmarks.rows import Row, Rows
from cvxlimit.base.files import write_file

RESULTS = HOME / "results.jsonl"
PAGE = ROOT / "docs" / "evidence" / "bench.md"
CLOSE = 1e-5
"""Relative distance from the bracket that rounding and a solver's default tolerance explain."""


def tools() -> dict[str, dict[str, Any]]:
    """Commands and models by name: ``benchmarks/tools.json``."""
    found: dict[str, dict[str, Any]] = json.loads((HOME / "tools.json").read_text("utf-8"))
    return found


def rows() -> Rows:
    """All answers that were kept; of several for one tool and scene the last counts."""
    return Rows(RESULTS, "tool", "scene")


def run(tool: str = "*", case: str = "*", seconds: float = 60.0) -> Iterator[str]:
    """Tools on cases, one row at a time, so many seconds each; rows that stand are kept.

    An environment variable names the Python of a tool that has an environment of its own:
    ``CRA_PYTHON``.
    """
    kept = rows()
    chosen = {name: made for name, made in tools().items() if fnmatchcase(name, tool)}
    if not chosen:
        raise SystemExit(f"no tool is called {tool!r}; tools.json has {', '.join(tools())}")
    for name, made in chosen.items():
        try:
            command = [p.format(python=sys.executable, **os.environ) for p in made["command"]]
        except KeyError as missing:
            yield f"{name}: left out, set {missing.args[0]} to the Python of its environment"
            continue
        wanted = {}
        for each in cases(case):
            for role, scene in each.record()["scenes"].items():
                row = {"tool": name, "case": each.name, "scene": each.scene_name(role),
                       "sha256": scene["sha256"]}  # fmt: skip
                if (before := kept.get(row)) is None or before["sha256"] != row["sha256"]:
                    wanted[each.scene_file(role)] = row
        for file, found in answers(command, list(wanted), seconds):
            row = {**wanted[file], **found}
            kept.add(row)
            yield f"{name:22} {row['scene']:30} {said(row)}"


def answers(command: list[str], scenes: list[Path], seconds: float) -> Iterator[tuple[Path, Row]]:
    """One process for many scenes; a new one after a crash or a lack of time: refusals both."""
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    while scenes:
        with tempfile.TemporaryDirectory() as folder:
            results = [Path(folder) / f"{i}.json" for i in range(len(scenes))]
            pairs = [str(file) for pair in zip(scenes, results, strict=True) for file in pair]
            errors = Path(folder) / "errors"
            with errors.open("wb") as stderr:
                process = subprocess.Popen(
                    [*command, *pairs], cwd=ROOT, env={**os.environ, "PYTHONPATH": path},
                    stdout=subprocess.DEVNULL, stderr=stderr,
                )  # fmt: skip
            try:
                for scene, result in zip(scenes, results, strict=True):
                    reason = waited(process, result, seconds)
                    scenes = scenes[1:]
                    if reason is None:
                        row: Row = json.loads(result.read_text("utf-8"))
                        del row["format"], row["version"]
                        yield scene, row
                        continue
                    last = errors.read_text("utf-8", "replace").strip().splitlines()[-1:]
                    yield scene, {"answer": "refused", "reason": reason or " ".join(last)[:160],
                                  "seconds": seconds if reason else None}  # fmt: skip
                    break
            finally:
                process.kill()
                process.wait()


def waited(process: subprocess.Popen[bytes], result: Path, seconds: float) -> str | None:
    """None once the result is there; why not, or "" if the process ended without it."""
    end = time.monotonic() + seconds
    while not result.exists():
        if process.poll() is not None:
            return None if result.exists() else ""
        if time.monotonic() > end:
            return f"no answer in {seconds:g} s"
        time.sleep(0.01)
    return None


def said(row: Mapping[str, Any]) -> str:
    """An answer in words."""
    if row["answer"] == "load factor":
        reach = f" ± {row['reach']:.2g}" if row.get("reach") else ""
        return f"{row['load_factor']:.6g}{reach}"
    return f"{row['answer']}: {row['reason']}" if row.get("reason") else str(row["answer"])


def verdict(row: Row, each: Case, role: str, bracket: Row | None, own_reach: float) -> str:
    """Inside the proved bracket, or how far off; right or wrong where it stands or falls.

    A tool that can tell loads apart to ``own_reach`` only cannot tell parameters that are nearer.
    """
    if row["answer"] == "refused":
        return "-"
    if bracket is None or bracket["lower"] is None:
        return "not proved"
    factor = row.get("load_factor")
    if role:
        falls = row["answer"] == "falls" or (factor is not None and factor < 0.0)
        if falls == (role == "falls"):
            return "right"
        is_near = bracket["upper"] - bracket["lower"] <= own_reach * bracket["upper"]
        return "too near to tell" if is_near else "WRONG"
    if row["answer"] == "no limit" and bracket["upper"] is None:
        return "inside"
    if factor is None:
        return "right" if row["answer"] == "stands" else "WRONG"
    found = factor * each.factor
    upper = math.inf if bracket["upper"] is None else bracket["upper"]
    reach = max(row.get("reach", 0.0) * each.factor, own_reach * abs(found))
    outside = max(bracket["lower"] - found, found - upper, 0.0) - reach
    off = outside / max(abs(bracket["lower"]), 1e-300)
    return "inside" if off <= CLOSE else f"{off:.0e} off"


Answers = dict[str, tuple[Row, str]]
"""Rows and verdicts by tool."""


def judged(pattern: str) -> Iterator[tuple[Case, str, Row, Answers]]:
    """Cases, roles of their scenes and records, with what every tool answered."""
    kept = rows()
    for each in cases(pattern):
        record = each.record()
        for role in each.roles:
            answers = {}
            for name, made in tools().items():
                row = kept.get({"tool": name, "scene": each.scene_name(role)})
                if row is not None:
                    bracket = record["brackets"].get(made["model"])
                    mark = verdict(row, each, role, bracket, made.get("reach", 0.0))
                    answers[name] = row, mark
            yield each, role, record, answers


MARKS = {
    "inside": "inside", "right": "right on standing or falling", "off": "off",
    "too near to tell": "too near to tell", "not proved": "not proved", "-": "refused",
}  # fmt: skip
"""Kinds of verdicts, and what a sum of them is called."""

GOOD = ("inside", "right", "-")


def table(case: str = "*", write: bool = False, all: bool = False) -> Iterator[str]:
    """What the tools answered, beside the proof: all, or what is off; write: into the docs."""
    counts: dict[str, Counter[str]] = {name: Counter() for name in tools()}
    lines = []
    for each, role, record, answers in judged(case):
        about = each.scene_name(role), f"{record['scenes'][role]['contacts']:,}"
        for name, (row, mark) in answers.items():
            counts[name][mark if mark in MARKS else "off"] += 1
            if all or mark not in GOOD:
                took = "" if row["seconds"] is None else f"{row['seconds']:.2g}"
                word = "refused" if mark == "-" else mark
                lines.append((*about, shown(record, role), name, said(row), word, took))
    sums = [[name, *(c[k] or "" for k in MARKS)] for name, c in counts.items()]
    head = ["scene", "contacts", "proved (conic)", "program", "its answer", "verdict", "s"]
    text = f"{table_of(['program', *MARKS.values()], sums)}\n\n{table_of(head, lines)}\n"
    yield text
    if write:
        into_page("table", text)


def into_page(name: str, text: str) -> None:
    """In the place of what stands in the docs between the comments of that name."""
    start, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    before, rest = PAGE.read_text("utf-8").split(start)
    write_file(PAGE, f"{before}{start}\n{text}\n{end}{rest.split(end)[1]}".encode())


def shown(record: Mapping[str, Any], role: str) -> str:
    """The bracket of the cone, short; of a parameter what its scene is proved to do."""
    bracket = record["brackets"]["conic"]
    if bracket["lower"] is None:
        return ""
    if role:
        return role
    low, high = bracket["lower"], bracket["upper"]
    return f"{low:.6g}" if abs(high - low) <= 2e-6 * abs(high) else f"{low:.5g} to {high:.5g}"
