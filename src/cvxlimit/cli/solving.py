"""``cvxlimit solve``: the collapse load factor of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import ResultFile
from cvxlimit.cli.outputs import ExitCode
from cvxlimit.cli.solutions import Files, deliver
from cvxlimit.errors import ModelError
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.interaction.readings.named import MOMENTS
from cvxlimit.methods.solving import solve
from cvxlimit.methods.table import TABLE, words
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

Job = Callable[[], int]

EXIT_CODES = (
    "Exit code: 0 solved; 2 bad input; 3 no answer exists (the dead load cannot stand, or the "
    "live load does no harm); 4 not converged, or not certified to the tolerance."
)
"""Shown below the command's help."""


@dataclass(frozen=True)
class Order:
    """What ``cvxlimit solve`` was asked to do."""

    scene: str
    surface: str
    method: str | None
    interaction: str | None
    moments: str | None
    torsion_shear: str | None
    flow: str | None
    tolerance: float | None
    files: Files
    model: str
    branching_seconds: float | None = None
    workers: int = 1

    @property
    def rule(self) -> str | Certified | None:
        """The method by name, or with what was asked for it."""
        if self.branching_seconds is None and self.workers == 1:
            return self.method
        if Certified.name not in (self.method, self.interaction):
            raise ModelError("--branching-seconds and --workers go with --method certified")
        return Certified(branching_seconds=self.branching_seconds, workers=self.workers)

    @property
    def older(self) -> str | None:
        """The interaction, unless :attr:`rule` says it."""
        return self.interaction if isinstance(self.rule, str | None) else None


def solve_command(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="Scene file, or name of a built-in scene. A built-in name wins over a file of "
            "that name: write ./NAME for the file.",
            show_default=False,
        ),
    ],
    surface: Annotated[
        str,
        typer.Option(
            metavar="conic|parabolic|octagon|K-gon",
            help="Yield surface: the exact cone; torsion and shear on a parabola nearer the exact "
            "limit, at the same price; the paper's 8 facets, or any K, as in 16-gon. "
            "Facets are on the unsafe side; octagon-inscribed or 16-gon-inscribed on the safe one.",
        ),
    ] = "conic",
    method: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(TABLE),
            help="; ".join(f"{name}: {row.line}" for name, row in TABLE.items())
            + ". Unless given: convex.",
            show_default=False,
        ),
    ] = None,
    interaction: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(words("interaction")),
            help="Older spelling of --method fixed-point and --method certified.",
            show_default=False,
        ),
    ] = None,
    moments: Annotated[
        str | None,
        typer.Option(
            show_default=False,
            metavar="|".join(MOMENTS),
            help="How the interaction adds moments: every sign on its own, the safe reading; "
            "static torsion about the pressure centre, without or with the paper's Eq. 27; or the "
            "paper's own reading, which depends on the contacts' axes. For methods with "
            "interaction only; unless given: independent.",
        ),
    ] = None,
    torsion_shear: Annotated[
        str | None,
        typer.Option(
            "--torsion-shear",
            metavar="|".join(words("torsion_shear")),
            help="Older spelling of --surface parabolic and --method exact.",
            show_default=False,
        ),
    ] = None,
    flow: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(words("flow")),
            help="Older spelling of --method zero-dilatancy and --method gilbert.",
            show_default=False,
        ),
    ] = None,
    json: ResultFile = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.png|.html|.vtu",
            help="Draw the mechanism: a picture, an interactive page, or files for ParaView.",
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.csv|.obj|.glb",
            help="Write the contacts with their forces (CSV), or the blocks, for other programs.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            metavar="WIDTH",
            help="Asked width of the bracket, relative to its larger bound; the fixed point stops "
            "at a change of this size. Unless given: 1e-5 without interaction, 1e-4 for the fixed "
            "point, 1e-3 for exact torsion-shear; the certified method goes as far as it can, and "
            "0.05 counts as good.",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            metavar="|".join(MODELS),
            help="How much model: no more than the scene needs, all of it, or the least that is "
            "valid whether it pays or not. The bounds are those of the full scene in any case; "
            "cvxlimit explain SCENE says what is left out.",
        ),
    ] = "auto",
    branching_seconds: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="Time for branch and bound, which narrows the certified interaction's bracket. "
            "Unless given: 60 where a tolerance is asked for, or a scene has few contacts.",
            show_default=False,
        ),
    ] = None,
    workers: Annotated[
        int, typer.Option(metavar="N", help="Processes that branch and bound uses.")
    ] = 1,
) -> Job:
    """Find the collapse load factor of a scene, with a bracket recomputed outside the solver."""
    order = Order(
        scene, surface, method, interaction, moments, torsion_shear, flow, tolerance,
        Files(json, plot, export), model, branching_seconds, workers,
    )  # fmt: skip
    return partial(_solve_job, order)


def _solve_job(order: Order) -> ExitCode:
    order.files.check(order.scene)
    scene, solution = interruptible(lambda tell: _solved(scene_named(order.scene), order, tell))
    return deliver(scene, order.scene, solution, order.files, order.tolerance)


def _solved(scene: Scene, order: Order, tell: Tell) -> tuple[Scene, Solution]:
    return scene, solve(
        scene,
        order.surface,
        method=order.rule,
        interaction=order.older,
        moments=order.moments,
        torsion_shear=order.torsion_shear,
        flow=order.flow,
        tolerance=order.tolerance,
        progress=tell,
        model=order.model,
    )
