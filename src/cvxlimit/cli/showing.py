"""``cvxlimit show``: a picture of a scene before it is solved, refused ones included."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import SceneName
from cvxlimit.cli.outputs import SCENE_PICTURES, ExitCode, check_outputs, check_picture
from cvxlimit.cli.report import count, facts, show, warn_of_near_misses
from cvxlimit.io.fields import one_line
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting import plot_scene, refused

Job = Callable[[], int]


def show_command(
    scene: SceneName,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="OUT.png|.html", help="Picture, or page to turn and point at."),
    ] = None,
) -> Job:
    """Draw a scene before it is solved: blocks, supports, joints, loads, near misses.

    A scene whose geometry is refused is drawn with the blocks to blame in red.
    """
    if plot is None:
        raise typer.BadParameter("give --plot OUT.png or OUT.html: where to draw")
    return partial(_show_job, scene, plot)


def _show_job(name: str, plot: Path) -> ExitCode:
    check_outputs({"--plot": plot}, {} if name in BUILTIN else {os.fspath(name): "the scene"})
    check_picture(plot, SCENE_PICTURES)
    scene = scene_named(name)
    refusal = refused(scene)
    written = [str(path) for path in plot_scene(scene, plot, refusal)]
    blocks = f"{count(len(scene.free), 'free block')}, {count(len(scene.supports), 'support')}"
    contacts = "" if refusal else f" x {count(len(scene.contacts), 'contact')}"
    rows = [("scene", scene.name), ("size", blocks + contacts)]
    rows += [("written", file) for file in written]
    show(facts([(key, one_line(fact)) for key, fact in rows]))
    if refusal is not None:
        raise refusal
    warn_of_near_misses(scene)
    return ExitCode.SOLVED
