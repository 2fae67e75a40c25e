"""Other people's solvers on the problems of an archive, from its files alone."""

from __future__ import annotations

import csv
import hashlib
import io
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import clarabel
import highspy
import scipy.sparse as sp

from benchmarks.bench.case import HOME
from benchmarks.bench.cbf import read_cbf
from benchmarks.bench.running import into_page
from benchmarks.experiment import table as table_of
from benchmarks.rows import Row, Rows

ANSWERS = HOME / "answers.jsonl"
LOOSE = 1e-6
"""Relative distance from the proved interval that a solver's default tolerance explains."""
NEAR_ZERO = 1e-8
"""The same where the optimum is about zero: what solvers ask of a gap."""

Found = tuple[float | None, str]
"""Objective and status."""


def highs(path: Path, seconds: float) -> Found:
    """Default settings."""
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("time_limit", seconds)
    solver.readModel(str(path))
    solver.run()
    status = solver.modelStatusToString(solver.getModelStatus())
    return (solver.getInfo().objective_function_value if status == "Optimal" else None), status


CONES = {
    "L=": clarabel.ZeroConeT, "L+": clarabel.NonnegativeConeT, "Q": clarabel.SecondOrderConeT,
}  # fmt: skip


def clarabel_on(path: Path, seconds: float) -> Found:
    """Default settings; the file through a reader that knows nothing of our writer."""
    read, settings = read_cbf(path), clarabel.DefaultSettings()
    settings.verbose, settings.time_limit = False, seconds
    free = sp.csc_matrix((len(read.cost), len(read.cost)))
    cones = [CONES[kind](size) for kind, size in read.cones]
    solution = clarabel.DefaultSolver(
        free, read.cost, sp.csc_matrix(-read.matrix), read.offset, cones, settings
    ).solve()
    status = str(solution.status)
    return (solution.obj_val if status in ("Solved", "AlmostSolved") else None), status


SOLVERS: dict[str, tuple[str, Callable[[Path, float], Found]]] = {
    "mps": ("HiGHS", highs), "cbf": ("Clarabel", clarabel_on),
}  # fmt: skip


def solve(file: Path, seconds: float = 60.0, write: bool = False) -> Iterator[str]:
    """Other solvers on an archive, from its files alone; write: into the docs."""
    found = []
    for row, is_new in answers(file, seconds):
        found.append(row)
        if is_new:
            said = f"{row['solver']} {row['status']}, {row['objective']}, {verdict(row)}"
            yield f"{row['problem']}: {said}; proved {row['optimum']}"
    yield (text := table(found))
    if write:
        into_page("answers", text)


def answers(archive: Path, seconds: float) -> Iterator[tuple[Row, bool]]:
    """A row for every problem, kept in ``answers.jsonl``, and whether it was not there yet."""
    kept = Rows(ANSWERS, "solver", "sha256")
    with zipfile.ZipFile(archive) as files, tempfile.TemporaryDirectory() as folder:
        lines = files.read("SHA256SUMS").decode("utf-8").splitlines()
        sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
        for row in csv.DictReader(io.StringIO(files.read("index.csv").decode("utf-8"))):
            content = files.read(row["problem"])
            if hashlib.sha256(content).hexdigest() != sums[row["problem"]]:
                raise SystemExit(f"{row['problem']}: the checksum is another")
            name, solver = SOLVERS[row["format"]]
            answer = kept.get({**row, "solver": name})
            if is_new := answer is None:
                path = Path(folder) / row["problem"]
                path.write_bytes(content)
                start = time.process_time()
                objective, status = solver(path, seconds)
                took = round(time.process_time() - start, 3)
                answer = {**row, "solver": name, "objective": objective, "status": status,
                          "took": took}  # fmt: skip
                path.unlink()
                kept.add(answer)
            yield answer, is_new


def verdict(row: Row) -> str:
    """Inside the proved interval, or what else: one of :data:`VERDICTS`."""
    optimum, objective, status = row["optimum"], row["objective"], row["status"].lower()
    is_proved_without = not optimum[0].isdigit() and optimum[0] != "-"
    if objective is None:
        says_without = "feasible" in status or "bounded" in status
        if not says_without:
            return "without an answer"
        return "inside" if is_proved_without else "wrong"
    if is_proved_without:
        return "wrong"
    low, high = map(float, optimum.split())
    reach = max(LOOSE * max(abs(low), abs(high)), NEAR_ZERO)
    if low - reach <= objective <= high + reach:
        return "inside"
    return "inaccurate, as it says" if "almost" in status else "wrong"


VERDICTS = ("inside", "inaccurate, as it says", "without an answer", "wrong")


def table(rows: list[Row]) -> str:
    """Structures one by one, hard small problems counted; Markdown."""
    head = ("problem", "contacts", "variables", "proved optimum", "ours, s", "solver", "its answer",
            "its s")  # fmt: skip
    large = [row for row in rows if row["group"] != "hard"]
    cells = []
    for row in large:
        answer = row["status"] if row["objective"] is None else f"{row['objective']:.9g}"
        sizes = (f"{int(row[name]):,}" for name in ("contacts", "variables"))
        cells.append((row["problem"], *sizes, ends(row["optimum"]), row["seconds"], row["solver"],
                      f"{answer}, {verdict(row)}", f"{row['took']:.3g}"))  # fmt: skip
    small = []
    for form, (solver, _) in SOLVERS.items():
        counts = Counter(
            verdict(row) for row in rows if row["group"] == "hard" and row["solver"] == solver
        )
        number = f"{sum(counts.values())} as {form.upper()}"
        small.append((number, solver, *(counts[said] for said in VERDICTS)))
    heads = ("hard small problems", "solver", *VERDICTS)
    return f"{table_of(head, cells)}\n\n{table_of(heads, small)}\n"


def ends(optimum: str) -> str:
    """An interval to the digits that its ends share, at most nine."""
    try:
        low, high = map(float, optimum.split())
    except ValueError:
        return optimum
    for digits in range(9, 1, -1):
        if f"{low:.{digits}g}" == f"{high:.{digits}g}":
            return f"{low:.{digits}g}"
    return f"{low:.9g} to {high:.9g}"
