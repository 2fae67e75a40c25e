"""``cvxlimit compare``: time and true error of several models on one scene."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rich.text import Text

from cvxlimit.cli.interrupting import Tell, interruptible, with_result
from cvxlimit.cli.options import EFFORT, OUTPUT, argument, command_of, option
from cvxlimit.cli.report import ExitCode, check_outputs, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.compare.comparison import Comparison, compare
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting.look import IMAGES


@dataclass(frozen=True, kw_only=True)
class Contest:
    """What ``cvxlimit compare`` is to run."""

    scene: str = argument()
    models: list[str] | None = option(
        "NAMES",
        "Models, several with commas or several times, with * and ?: cvxlimit (the default), "
        "16-gon and other surfaces, certified/independent/*, or "
        "surface/formulation/solver/tolerance as in conic/corners/*, 16-gon/* ... Unless given: "
        "surfaces, solvers and tolerances that come with the package.",
        None,
        "--models",
    )
    facets: str | None = option(
        "K,K", "Polygons with so many facets beside the cone, outside and inside: 4,8,16,32."
    )
    csv: Path | None = option("FILE", "Write all columns to this CSV file.", group=OUTPUT)
    plot: Path | None = option("FILE", "Draw time against error (.png, .svg, .pdf).", group=OUTPUT)
    repeat: int = option("N", "Runs per model, of which medians are shown; 3 unless given.", 3,
                         group=EFFORT)  # fmt: skip


@command_of(Contest)
def compare_command(asked: Contest) -> ExitCode:
    """Measure time and true error of several models on one scene, in turns."""
    inputs = {} if asked.scene in BUILTIN else {asked.scene: "the scene"}
    check_outputs({"--csv": asked.csv, "--plot": asked.plot}, inputs, plot=IMAGES)
    names = [name.strip() for text in asked.models or () for name in text.split(",")]

    try:
        facets = [int(k) for k in asked.facets.split(",")] if asked.facets else None
    except ValueError as error:
        raise InputError(f"--facets must be numbers, as in 4,8,16, got {asked.facets!r}") from error

    def compared(tell: Tell) -> Comparison:
        scene = scene_named(asked.scene)
        return compare(
            scene, names or None, facets=facets, repeat=asked.repeat, progress=with_result(tell)
        )

    found = interruptible(compared)
    show(Text(found.table()))
    if asked.csv is not None:
        found.to_csv(asked.csv)
    if asked.plot is not None:
        (found.plot_facets() if facets else found.plot()).savefig(asked.plot)
    if found.is_interrupted:
        return refuse(ExitCode.NOT_GOOD_ENOUGH, f"interrupted after {len(found.rows)} models")
    return ExitCode.SOLVED
