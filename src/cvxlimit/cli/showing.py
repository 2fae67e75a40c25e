"""``cvxlimit show``: a picture of a scene before it is solved, refused ones included."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import argument, option, taking
from cvxlimit.cli.outputs import SCENE_PICTURES, ExitCode, check_outputs, check_picture
from cvxlimit.cli.report import count, facts, show, warn_of_near_misses
from cvxlimit.errors import InputError
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting import plot_scene, refused
from cvxlimit.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What ``cvxlimit show`` is to draw, and where."""

    scene: str = argument()
    plot: Path | None = option("OUT.png|.html", "Picture, or page to turn and point at.")


@taking(Drawing)
def show_command(asked: Drawing) -> ExitCode:
    """Draw a scene before it is solved: blocks, supports, joints, loads, near misses.

    A scene whose geometry is refused is drawn with the blocks to blame in red.
    """
    name, plot = asked.scene, asked.plot
    if plot is None:
        raise InputError("give --plot OUT.png or OUT.html: where to draw")
    check_outputs({"--plot": plot}, {} if name in BUILTIN else {os.fspath(name): "the scene"})
    check_picture(plot, SCENE_PICTURES)

    def checked(tell: Tell) -> tuple[Scene, InputError | None]:
        scene = scene_named(name)
        tell("finding contacts")
        return scene, refused(scene)

    scene, refusal = interruptible(checked)
    written = [("written", str(path)) for path in plot_scene(scene, plot, refusal)]
    blocks = f"{count(len(scene.free), 'free block')}, {count(len(scene.supports), 'support')}"
    contacts = "" if refusal else f" x {count(len(scene.contacts), 'contact')}"
    show(facts([("scene", scene.name), ("size", blocks + contacts), *written]))
    if refusal is not None:
        raise refusal
    warn_of_near_misses(scene)
    return ExitCode.SOLVED
