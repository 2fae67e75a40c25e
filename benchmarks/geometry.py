"""``python -m benchmarks.geometry FOLDER``: import and solve every geometry file of a folder.

One table: blocks, contacts, repairs, near misses, load factor, bracket and seconds, or the reason
of a refusal. Options state what files do not say; ``--supports-of NAME=ID,ID`` overrides
``--supports`` for one file. ``--pictures FOLDER`` draws every scene, refused ones too, and the
mechanisms.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from rich.console import Console

from cvxlimit import Scene, solve
from cvxlimit.errors import CvxlimitError, InputError
from cvxlimit.io import import_geometry
from cvxlimit.io.geometry.importing import LOWEST, READERS
from cvxlimit.plotting import plot, plot_scene

console = Console(highlight=False, soft_wrap=True)


@dataclass
class Row:
    """What is told about one file."""

    file: str
    blocks: str = ""
    supports: str = ""
    contacts: str = ""
    repairs: str = ""
    near_misses: str = ""
    factor: str = ""
    bracket: str = ""
    reading_s: str = ""
    joints_s: str = ""
    solving_s: str = ""
    result: str = ""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run every file and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.geometry", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--up", default="z")
    parser.add_argument("--length-unit", default="m")
    parser.add_argument("--density", type=float, default=20.0)
    parser.add_argument("--friction", type=float, default=0.7)
    parser.add_argument("--live", default="1,0,0")
    parser.add_argument("--supports", default=LOWEST)
    parser.add_argument("--supports-of", action="append", default=[], metavar="NAME=ID,ID")
    parser.add_argument("--joint-tolerance", type=float)
    parser.add_argument("--pictures", type=Path)
    options = parser.parse_args(arguments)
    own = dict(entry.split("=", 1) for entry in options.supports_of)
    names = [field.name.replace("_", " ") for field in fields(Row)]
    _tell(names)
    _tell(["---"] * len(names))
    for path in sorted(options.folder.iterdir()):
        if path.suffix.lower() in READERS:
            _tell(astuple(_row(path, options, own.get(path.stem, options.supports))))


def _row(path: Path, options: argparse.Namespace, supports: str) -> Row:
    row = Row(path.name)
    started = time.perf_counter()
    try:
        scene = import_geometry(
            path,
            length_unit=options.length_unit,
            up=options.up,
            density=options.density,
            friction=options.friction,
            live=[float(x) for x in options.live.split(",")],
            supports=supports if supports == LOWEST else supports.split(","),
            joint_tolerance=options.joint_tolerance,
        ).scene
        row.reading_s = f"{time.perf_counter() - started:.2f}"
        _look(scene, row, options.pictures)
        _solve(scene, row, options.pictures)
    except CvxlimitError as error:
        row.result = f"refused: {error}"
    return row


def _look(scene: Scene, row: Row, pictures: Path | None) -> None:
    row.blocks, row.supports = str(len(scene.blocks)), str(len(scene.supports))
    times = Counter[str]()
    for block in scene.blocks:
        for repair in block.repairs:
            times[repair.kind] += repair.count
    row.repairs = ", ".join(f"{count} {kind}" for kind, count in times.items()) or "none"
    started = time.perf_counter()
    refusal: InputError | None = None
    try:
        row.contacts, row.near_misses = str(len(scene.contacts)), str(len(scene.near_misses))
    except InputError as error:
        refusal = error
    row.joints_s = f"{time.perf_counter() - started:.2f}"
    if pictures is not None:
        for suffix in (".png", ".html"):
            plot_scene(scene, pictures / f"{row.file}{suffix}", refusal)
    if refusal is not None:
        raise refusal


def _solve(scene: Scene, row: Row, pictures: Path | None) -> None:
    started = time.perf_counter()
    solution = solve(scene)
    row.solving_s = f"{time.perf_counter() - started:.2f}"
    row.result = str(solution.status)
    if solution.load_factor is not None:
        row.factor = f"{solution.load_factor:.6g}"
        row.bracket = str(solution.bracket)  # rounded outward
    elif solution.note:
        row.result += f": {solution.note}"
    if pictures is not None:
        for suffix in (".png", ".html"):
            plot(scene, solution, pictures / f"{row.file}-solved{suffix}")


def _tell(cells: Sequence[str]) -> None:
    console.print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
