"""``cvxlimit settle``: the reaction of a support that moves, and the mechanism it moves with."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.outputs import PICTURES, ExitCode, check_outputs, check_picture
from cvxlimit.cli.report import show, summary
from cvxlimit.errors import InputError
from cvxlimit.io import write_result
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.settlement import settlement
from cvxlimit.plotting import plot

Job = Callable[[], int]


def settle_command(
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE", help="Scene file, or name of a built-in scene.", show_default=False
        ),
    ],
    support: Annotated[
        str, typer.Option(metavar="ID", help="The support that moves.", show_default=False)
    ],
    direction: Annotated[
        str,
        typer.Option(
            metavar="X,Y,Z",
            help="Where to, as in --direction=0,0,-1; its length does not matter.",
            show_default=False,
        ),
    ],
    which: Annotated[
        str,
        typer.Option(
            metavar="least|largest",
            help="The reaction that remains while the support gives way, or the one that pushes "
            "it back.",
        ),
    ] = "least",
    surface: Annotated[
        str, typer.Option(metavar="conic|octagon|K-gon", help="Yield surface, as for solve.")
    ] = "conic",
    json: Annotated[
        Path | None, typer.Option(metavar="OUT", help="Write the result to this JSON file.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="OUT.png|.html|.vtu", help="Draw the mechanism."),
    ] = None,
) -> Job:
    """Find the least or largest reaction of a support that moves, under the dead load alone."""
    return partial(_settle_job, scene, support, direction, which, surface, json, plot)


def _settle_job(
    name: str,
    support: str,
    direction: str,
    which: str,
    surface: str,
    json: Path | None,
    picture: Path | None,
) -> ExitCode:
    inputs = {} if name in BUILTIN else {name: "the scene"}
    check_outputs({"--json": json, "--plot": picture}, inputs)
    if picture is not None:
        check_picture(picture, PICTURES)
    scene = scene_named(name)
    reaction = settlement(scene, support, _vector(direction), which, surface)
    solution, written = reaction.solution, []
    if json is not None:
        write_result(solution, json)
        written.append(str(json))
    if picture is not None:
        written += [str(path) for path in plot(scene, solution, picture)]
    origin = "built-in" if name in BUILTIN else name
    show(summary(solution, origin, None, written))
    return ExitCode.SOLVED if solution.status.is_good else ExitCode.NOT_GOOD_ENOUGH


def _vector(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise InputError(
            f"--direction {text}: three numbers with commas are meant, as in 0,0,-1"
        ) from error
