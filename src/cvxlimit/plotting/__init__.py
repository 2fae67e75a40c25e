"""Pictures of mechanisms: PNG, an interactive page, and files for ParaView.

Only the PNG needs Matplotlib (the extra ``plot``); it is imported when it is used. Nothing here
needs a display, OpenGL or a network.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from cvxlimit.checks import of_type
from cvxlimit.errors import InputError, ModelError
from cvxlimit.files import write_file
from cvxlimit.plotting.look import title
from cvxlimit.plotting.movement import ContactKind, ContactMotion, Motion, motion
from cvxlimit.plotting.vtu import vtu_files
from cvxlimit.plotting.webpage import Page, page
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

if TYPE_CHECKING:
    from cvxlimit.plotting.drawing import SceneFigure

__all__ = [
    "ContactKind", "ContactMotion", "Motion", "Page", "figure", "motion", "page", "plot", "title",
]  # fmt: skip


def plot(scene: Scene, solution: Solution, path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Draw the mechanism of ``solution`` into a file; the suffix of ``path`` says which kind.

    ==========  ================================================================================
    ``.png``    picture: deformed blocks by speed, contacts that open, slide or twist
    ``.html``   interactive page in one file, for any browser, works offline
    ``.vtu``    blocks for ParaView, and beside them ``<name>-contacts.vtu`` with the contacts
    ==========  ================================================================================

    A solution without a mechanism is drawn undeformed, its status in the title.

    Returns
    -------
    tuple of Path
        The files written. Each appears complete or not at all.

    Raises
    ------
    InputError
        For another suffix, a folder that cannot be written to, or a solution of another scene.
    ModelError
        If a PNG is asked for and Matplotlib is not installed.

    Example
    -------
    >>> import numpy as np, tempfile
    >>> from cvxlimit.bracket import Bracket
    >>> from cvxlimit.geometry.blocks import Block
    >>> from cvxlimit.scene import Load, Scene
    >>> from cvxlimit.solution import Solution, Status
    >>> ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    >>> tower = Block.box("tower", (0, 0, 0), (1, 1, 4), density=20.0)
    >>> scene = Scene([ground, tower], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.7)
    >>> rocking = {"tower": np.array([2.0, 0.0, 0.5, 0.0, 1.0, 0.0])}
    >>> solution = Solution("tower", "conic", "none", "signed", 1, 1, 0.25, Bracket(0.25, 0.25),
    ...                     Status.CERTIFIED, (), {}, mechanism=rocking)
    >>> [p.name for p in plot(scene, solution, Path(tempfile.mkdtemp()) / "tower.vtu")]
    ['tower.vtu', 'tower-contacts.vtu']
    """
    target = Path(of_type(path, (str, os.PathLike), "path must name a file", "write 'wall.png'"))
    suffix = target.suffix.lower()
    if suffix == ".png":
        files = {target: _png(scene, solution)}
    elif suffix == ".html":
        files = {target: page(scene, solution).encode("utf-8")}
    elif suffix == ".vtu":
        blocks, contacts = vtu_files(scene, solution)
        files = {target: blocks, target.with_name(f"{target.stem}-contacts.vtu"): contacts}
    else:
        raise InputError(
            f"cannot tell what to plot from {target.name!r}: give a name that ends in "
            ".png, .html or .vtu"
        )
    for name, content in files.items():
        write_file(name, content)
    return tuple(files)


def figure(
    scene: Scene, solution: Solution, viewer: tuple[float, float, float] | None = None
) -> SceneFigure:
    """The picture as a Matplotlib figure, for notebooks and for changes of one's own.

    ``viewer`` is the direction from the scene towards the viewer, chosen from the movement if
    None. Notebooks show the figure when it ends a cell.

    Raises
    ------
    InputError
        If the solution belongs to another scene, or ``viewer`` is not a direction.
    ModelError
        If Matplotlib is not installed.
    """
    try:
        from cvxlimit.plotting import drawing
    except ImportError as error:
        raise ModelError(
            'pictures need Matplotlib: pip install "cvxlimit[plot]" '
            "(.html and .vtu work without it)"
        ) from error
    return drawing.figure(scene, solution, viewer)


def _png(scene: Scene, solution: Solution) -> bytes:
    return figure(scene, solution)._repr_png_()
