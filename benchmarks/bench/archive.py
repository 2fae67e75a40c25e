"""Problems for those who write solvers: one archive, with checksums and proved optima.

Structures of 20 to 100,000 contacts, and small ones of the stability bench, whose families are each
after one way in which limit analysis is hard. Every problem stands in it as a cone program (CBF)
and, with octagons, as a linear one (MPS); ``index.csv`` has sizes, the interval that holds the
optimum, and how long ours took.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
import zipfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from time import process_time

from benchmarks.rows import Row, Rows
from benchmarks.scenes import scene_of
from benchmarks.stability.families import sample, samples
from cvxlimit import Scene
from cvxlimit.cli.exporting import problem_of
from cvxlimit.errors import CvxlimitError
from cvxlimit.solvers.writing import write_program

GROWING = {
    21: "arch", 146: "tuff-wall", 500: "panel-500", 888: "s12-panel", 1906: "s10-panel",
    5000: "panel-5000", 6868: "wall-34", 16452: "panel-16452", 41000: "wall-83", 99588: "wall-129",
}  # fmt: skip
"""Scenes by about how many contacts they have."""

MISSED = {
    "frictions": (
        1, 2, 8, 12, 18, 20, 27, 29, 30, 33, 34, 35, 37, 39, 40, 41, 42, 46, 77, 82, 86, 92, 93, 97,
        98, 100, 106, 110, 112, 140, 144,
    ),
    "wedges": (8, 47, 49, 119, 132, 136, 139, 143),
}  # fmt: skip
"""Families and seeds of the stability bench, of 490 tried, whose files Clarabel 0.11.1 or HiGHS
1.15.1 at their defaults answered outside the proved interval, or not in a minute."""

COLUMNS = (
    "problem", "group", "format", "contacts", "variables", "rows", "cones", "optimum", "seconds",
    "sha256",
)  # fmt: skip

FORMS = (("cbf", "conic"), ("mps", "octagon"))
"""Formats, and the friction each is of."""

_OPTIMUM = re.compile(r"between (\S+) and (\S+);")


def scenes(most: int, hard: int) -> Iterator[tuple[str, Scene]]:
    """Growing ones up to ``most`` contacts, then ``hard`` small ones: missed ones, then families
    in turn."""
    for name in (name for size, name in GROWING.items() if size <= most):
        scene = scene_of(name)
        yield "growing", scene.with_name(name) if name.startswith("wall") else scene
    for family, seed in islice(_hard(hard), hard):
        yield "hard", sample(family, seed).scene


def _hard(number: int) -> Iterator[tuple[str, int]]:
    for family, seeds in MISSED.items():
        yield from ((family, seed) for seed in seeds)
    for family, seed, _ in samples(number):
        if seed not in MISSED.get(family, ()):
            yield family, seed


def write(file: Path, most: int = 100_000, hard: int = 100) -> Iterator[str]:
    """Problems for those who write solvers: of at most so many contacts, so many hard small ones.

    ``OUT.zip.sha256`` beside it has its own checksum.

    Problems are kept in the folder ``OUT`` beside it, and what stands there is not solved again.
    """
    folder = file.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    kept, rows = Rows(folder / "index.jsonl", "problem"), []
    for group, scene in scenes(most, hard):
        names = [{"problem": f"{scene.name.replace(' ', '-')}.{form}"} for form, _ in FORMS]
        if not all(name in kept for name in names):
            for row in exported(scene, folder):
                kept.add({"group": group, **row})
                yield "{problem}: {contacts} contacts, {optimum}, {seconds} s".format(**row)
        found = [row for name in names if (row := kept.get(name))]
        rows += [row for row in found if row["sha256"]]
    with zipfile.ZipFile(file, "w") as archive:
        for row in rows:
            add(archive, row["problem"], (folder / row["problem"]).read_bytes())
        table = io.StringIO(newline="")
        writer = csv.DictWriter(table, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
        add(archive, "index.csv", table.getvalue().encode("utf-8"))
        sums = "".join(f"{row['sha256']}  {row['problem']}\n" for row in rows)
        add(archive, "SHA256SUMS", sums.encode("utf-8"))
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    Path(f"{file}.sha256").write_text(f"{digest}  {file.name}\n", encoding="utf-8")
    yield f"{file}: {len(rows)} problems, sha256 {digest}"


def exported(scene: Scene, folder: Path) -> Iterator[Row]:
    """Both files of a scene and their rows of the index; one that is left out has no checksum.

    A program without cones, which planar scenes have, is linear as it is.
    """
    found, seconds = None, 0.0
    for form, surface in FORMS:
        path = folder / f"{scene.name.replace(' ', '-')}.{form}"
        row = {"problem": path.name, "format": form, "contacts": len(scene.contacts)}
        try:
            if found is None or found[0].cones:
                start = process_time()
                found = problem_of(scene, surface)
                seconds = process_time() - start
            problem, remarks = found
            write_program(problem, path, form, path.stem, remarks)
        except CvxlimitError as error:
            yield {**row, "optimum": f"left out, {error}", "seconds": "", "sha256": ""}
            continue
        height, width = problem.matrix.shape
        proved = _OPTIMUM.search(remarks[1])
        yield {
            **row, "variables": width, "rows": height, "cones": len(problem.cones),
            "optimum": f"{proved[1]} {proved[2]}" if proved else remarks[1].split(";")[0],
            "seconds": f"{seconds:.3g}",
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        }  # fmt: skip


def add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    """With a date of its own, so that the same problems make the same archive."""
    entry = zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(entry, content)
