"""Problems for those who write solvers: one archive, with checksums and proved optima.

Structures of 20 to 100,000 contacts, and small ones of the stability bench on which solvers were
seen to fail. Every problem stands in it as a cone program (CBF) and, with octagons, as a linear one
(MPS); ``index.csv`` has sizes, the interval that holds the optimum, and how long ours took.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from time import process_time
from typing import Any

import highspy
from benchmarks.cases.panel import build as panel_of
from benchmarks.stability.families import sample, samples

from cvxlimit import Scene, builtin_scene
from cvxlimit.cli.exporting import problem_of
from cvxlimit.errors import CvxlimitError
from cvxlimit.masonry import arch, running_bond, wall
from cvxlimit.solvers.exporting import write_program

Tell = Callable[[str], object]

GROWING: dict[int, Callable[[], Scene]] = {
    21: arch,
    146: lambda: builtin_scene("tuff-wall"),
    500: lambda: panel_of(500),
    888: lambda: builtin_scene("s12-panel"),
    1906: lambda: builtin_scene("s10-panel"),
    5000: lambda: panel_of(5000),
    6868: lambda: wall(running_bond(34, 68), name="wall-34"),
    16452: lambda: panel_of(16452),
    41000: lambda: wall(running_bond(83, 166), name="wall-83"),
    99588: lambda: wall(running_bond(129, 258), name="wall-129"),
}
"""Scenes by about how many contacts they have."""

COLUMNS = (
    "problem", "format", "contacts", "variables", "rows", "cones", "optimum", "seconds", "sha256",
)  # fmt: skip

_OPTIMUM = re.compile(r"between (\S+) and (\S+);")


def scenes(most: int, hard: int) -> Iterator[Scene]:
    """Growing ones up to ``most`` contacts, then ``hard`` small ones, families in turn."""
    yield from (build() for size, build in GROWING.items() if size <= most)
    for family, seed, scale in samples(hard):
        yield sample(family, seed, scale).scene


def write(output: Path, most: int, hard: int, tell: Tell) -> None:
    """The archive, file by file; ``OUT.zip.sha256`` beside it has its own checksum."""
    rows: list[dict[str, Any]] = []
    with zipfile.ZipFile(output, "w") as archive, tempfile.TemporaryDirectory() as folder:
        for scene in scenes(most, hard):
            for form, surface in (("cbf", "conic"), ("mps", "octagon")):
                name = scene.name.replace(" ", "-")
                path, start = Path(folder) / f"{name}.{form}", process_time()
                try:
                    problem, remarks = problem_of(scene, surface)
                except CvxlimitError as error:
                    tell(f"{scene.name}: left out, {error}")
                    continue
                seconds = process_time() - start
                write_program(problem, path, form, name, remarks)
                content = path.read_bytes()
                path.unlink()
                add(archive, path.name, content)
                height, width = problem.matrix.shape
                found = _OPTIMUM.search(remarks[1])
                optimum = f"{found[1]} {found[2]}" if found else remarks[1].split(";")[0]
                rows.append({
                    "problem": path.name, "format": form, "contacts": len(scene.contacts),
                    "variables": width, "rows": height, "cones": len(problem.cones),
                    "optimum": optimum, "seconds": f"{seconds:.3g}",
                    "sha256": hashlib.sha256(content).hexdigest(),
                })  # fmt: skip
                tell(f"{path.name}: {len(scene.contacts):,} contacts, {optimum}, {seconds:.2g} s")
        table = io.StringIO(newline="")
        writer = csv.DictWriter(table, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
        add(archive, "index.csv", table.getvalue().encode("utf-8"))
        sums = "".join(f"{row['sha256']}  {row['problem']}\n" for row in rows)
        add(archive, "SHA256SUMS", sums.encode("utf-8"))
    digest = hashlib.sha256(output.read_bytes()).hexdigest()
    Path(f"{output}.sha256").write_text(f"{digest}  {output.name}\n", encoding="utf-8")
    tell(f"{output}: {len(rows)} problems, sha256 {digest}")


def add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    """With a date of its own, so that the same problems make the same archive."""
    entry = zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(entry, content)


def solve_with_highs(archive: Path, tell: Tell, seconds: float = 60.0) -> dict[str, int]:
    """HiGHS on every MPS file, from the files alone: how many end inside the proved interval."""
    counts: dict[str, int] = {}
    with zipfile.ZipFile(archive) as files, tempfile.TemporaryDirectory() as folder:
        lines = files.read("SHA256SUMS").decode("utf-8").splitlines()
        sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
        rows = list(csv.DictReader(io.StringIO(files.read("index.csv").decode("utf-8"))))
        for row in rows:
            content = files.read(row["problem"])
            if hashlib.sha256(content).hexdigest() != sums[row["problem"]]:
                raise SystemExit(f"{row['problem']}: the checksum is another")
            if row["format"] != "mps":
                continue
            path = Path(folder) / row["problem"]
            path.write_bytes(content)
            found, status = highs_on(path, seconds)
            said = verdict(row["optimum"], found, status)
            counts[said] = counts.get(said, 0) + 1
            tell(f"{row['problem']}: {status}, {found}, {said}; proved {row['optimum']}")
    tell(", ".join(f"{number} {said}" for said, number in counts.items()))
    return counts


def highs_on(path: Path, seconds: float) -> tuple[float | None, str]:
    """Objective and status."""
    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    highs.setOptionValue("time_limit", seconds)
    highs.readModel(str(path))
    highs.run()
    status = highs.modelStatusToString(highs.getModelStatus())
    return (highs.getInfo().objective_function_value if status == "Optimal" else None), status


def verdict(optimum: str, found: float | None, status: str) -> str:
    """Inside the interval to 1e-6 of it, or what else."""
    if not optimum[0].isdigit() and optimum[0] != "-":
        return "without an optimum, as proved" if found is None else "wrong"
    if found is None:
        return "without an answer"
    low, high = map(float, optimum.split())
    reach = 1e-6 * max(abs(low), abs(high))
    return "inside" if low - reach <= found <= high + reach else "wrong"
