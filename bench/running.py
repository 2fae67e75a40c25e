"""Tools on cases: runs, one row at a time, and the table of what they answered."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from bench.case import HOME, Case, cases
from cvxlimit.files import write_file

RESULTS = HOME / "results.jsonl"
PAGE = HOME.parent / "docs" / "evidence" / "bench.md"
START, END = "<!-- table -->\n", "<!-- end -->\n"
CLOSE = 1e-5
"""Relative distance from the bracket that rounding and a solver's default tolerance explain."""

Row = dict[str, Any]
Tell = Callable[[str], object]


def tools() -> dict[str, dict[str, Any]]:
    """Commands and models by name: ``bench/tools.json``."""
    found: dict[str, dict[str, Any]] = json.loads((HOME / "tools.json").read_text("utf-8"))
    return found


def rows() -> list[Row]:
    """All that were kept; of several for one tool and scene the last counts."""
    if not RESULTS.exists():
        return []
    read = [json.loads(line) for line in RESULTS.read_text("utf-8").splitlines()]
    return list({(row["tool"], row["scene"]): row for row in read}.values())


def run(tool: str, pattern: str, seconds: float, tell: Tell) -> None:
    """Tools whose name matches on cases whose name matches; what stands is not run again.

    An environment variable names the Python of a tool that has an environment of its own:
    ``CRA_PYTHON``.
    """
    done = {(row["tool"], row["scene"], row["sha256"]) for row in rows()}
    chosen = {name: made for name, made in tools().items() if fnmatchcase(name, tool)}
    if not chosen:
        raise SystemExit(f"no tool is called {tool!r}; bench/tools.json has {', '.join(tools())}")
    for name, made in chosen.items():
        try:
            command = [p.format(python=sys.executable, **os.environ) for p in made["command"]]
        except KeyError as missing:
            tell(f"{name}: left out, set {missing.args[0]} to the Python of its environment")
            continue
        wanted = {}
        for each in cases(pattern):
            for role, scene in each.record()["scenes"].items():
                row = {"tool": name, "case": each.name, "scene": each.scene_name(role),
                       "sha256": scene["sha256"]}  # fmt: skip
                if (name, row["scene"], row["sha256"]) not in done:
                    wanted[each.scene_file(role)] = row
        for file, found in answers(command, list(wanted), seconds):
            row = {**wanted[file], **found}
            with RESULTS.open("a", encoding="utf-8") as kept:
                kept.write(json.dumps(row) + "\n")
            tell(f"{name:22} {row['scene']:30} {said(row)}")


def answers(command: list[str], scenes: list[Path], seconds: float) -> Iterator[tuple[Path, Row]]:
    """One process for many scenes; a new one after a crash or a lack of time: refusals both."""
    path = os.pathsep.join([str(HOME.parent), os.environ.get("PYTHONPATH", "")])
    while scenes:
        with tempfile.TemporaryDirectory() as folder:
            results = [Path(folder) / f"{i}.json" for i in range(len(scenes))]
            pairs = [str(file) for pair in zip(scenes, results, strict=True) for file in pair]
            errors = Path(folder) / "errors"
            with errors.open("wb") as stderr:
                process = subprocess.Popen(
                    [*command, *pairs], cwd=HOME.parent, env={**os.environ, "PYTHONPATH": path},
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


def verdict(row: Mapping[str, Any], each: Case, record: Mapping[str, Any], model: str) -> str:
    """Inside the proved bracket, or how far off; right or wrong where it stands or falls."""
    if row["answer"] == "refused":
        return "-"
    bracket = record["brackets"].get(model)
    if bracket is None or bracket["lower"] is None:
        return "not proved"
    factor = row.get("load_factor")
    role = row["scene"].removeprefix(each.name).lstrip(".")
    if role:
        falls = row["answer"] == "falls" or (factor is not None and factor < 0.0)
        return "right" if falls == (role == "falls") else "WRONG"
    if factor is None:
        return "right" if row["answer"] == "stands" else "WRONG"
    found = factor * each.quantity.factor
    reach = row.get("reach", 0.0) * each.quantity.factor
    outside = max(bracket["lower"] - found, found - bracket["upper"], 0.0) - reach
    off = outside / max(abs(bracket["upper"]), 1e-300)
    return "inside" if off <= CLOSE else f"{off:.0e} off"


def judged(pattern: str) -> Iterator[tuple[Case, str, dict[str, tuple[Row, str]]]]:
    """Cases and scenes, with row and verdict by tool."""
    kept, models = rows(), {name: made["model"] for name, made in tools().items()}
    for each in cases(pattern):
        record = each.record()
        for role in each.roles:
            mine = {
                row["tool"]: (row, verdict(row, each, record, models[row["tool"]]))
                for row in kept if row["scene"] == each.scene_name(role) and row["tool"] in models
            }  # fmt: skip
            yield each, each.scene_name(role), mine


def table(pattern: str, is_written: bool, tell: Tell) -> None:
    """Brackets and answers in Markdown."""
    names = list(tools())
    head = ["scene", "contacts", "proved (conic)", *names]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    counts: dict[str, dict[str, int]] = {name: {} for name in names}
    for each, scene, answers in judged(pattern):
        record = each.record()
        role = scene.removeprefix(each.name).lstrip(".")
        cells = [scene, str(record["scenes"][role]["contacts"]), shown(record, role)]
        for name in names:
            if name not in answers:
                cells.append("")
                continue
            row, mark = answers[name]
            kind = mark if mark in ("inside", "right", "-") else "off"
            counts[name][kind] = counts[name].get(kind, 0) + 1
            took = "" if row["seconds"] is None else f", {row['seconds']:.2g} s"
            word = "refused" if mark == "-" else f"{said(row)}, {mark}"
            cells.append(word + took)
        lines.append("| " + " | ".join(cells) + " |")
    sums = [
        f"{name}: {c.get('inside', 0)} inside, {c.get('right', 0)} right on standing or falling, "
        f"{c.get('off', 0)} off, {c.get('-', 0)} refused"
        for name, c in counts.items()
    ]
    text = "\n".join([*(f"- {line}" for line in sums), "", *lines]) + "\n"
    tell(text)
    if is_written:
        before, rest = PAGE.read_text("utf-8").split(START)
        written = before + START + "\n" + text + "\n" + END + rest.split(END)[1]
        write_file(PAGE, written.encode("utf-8"))


def shown(record: Mapping[str, Any], role: str) -> str:
    """The bracket of the cone, short."""
    bracket = record["brackets"].get("conic")
    if bracket is None or bracket["lower"] is None:
        return ""
    if role:
        return str(role)
    low, high = bracket["lower"], bracket["upper"]
    return f"{low:.6g}" if abs(high - low) <= 2e-6 * abs(high) else f"{low:.5g} to {high:.5g}"
