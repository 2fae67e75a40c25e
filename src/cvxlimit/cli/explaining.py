"""``cvxlimit explain``: how much model a scene gets, which solver, how long it will take."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated

import typer
from rich.text import Text

from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import SceneName, SurfaceName
from cvxlimit.cli.outputs import ExitCode
from cvxlimit.cli.report import show
from cvxlimit.io.fields import one_line
from cvxlimit.reductions.choice import MODELS
from cvxlimit.reductions.explaining import explain


def explain_command(
    scene: SceneName,
    surface: SurfaceName = "conic",
    model: Annotated[
        str, typer.Option(metavar="|".join(MODELS), help="How much model, as for solve.")
    ] = "auto",
) -> Callable[[], int]:
    """Say how much model a scene gets, which solver, and how long it will take; solve nothing."""
    return partial(_explain_job, scene, surface, model)


def _explain_job(scene: str, surface: str, model: str) -> ExitCode:
    title, *lines = str(explain(scene_named(scene), surface, model=model)).splitlines()
    show(Text("\n".join([one_line(title), *lines])))
    return ExitCode.SOLVED
