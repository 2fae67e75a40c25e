"""Pictures of mechanisms: PNG, an interactive page, and files for ParaView.

Only the PNG needs Matplotlib (the extra ``plot``); it is imported when it is used. Nothing here
needs a display, OpenGL or a network.
"""

from __future__ import annotations

import os
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from cvxlimit.checks import of_type
from cvxlimit.errors import InputError, ModelError
from cvxlimit.files import write_file
from cvxlimit.plotting.annotations import refused
from cvxlimit.plotting.look import title
from cvxlimit.plotting.movement import ContactKind, ContactMotion, Motion, motion
from cvxlimit.plotting.vtu import vtu_files
from cvxlimit.plotting.webpage import Page, page, scene_page
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

if TYPE_CHECKING:
    from cvxlimit.plotting.drawing import SceneFigure

__all__ = [
    "ContactKind", "ContactMotion", "Motion", "Page", "figure", "motion", "page", "plot",
    "plot_scene", "refused", "scene_figure", "scene_page", "title",
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


def plot_scene(
    scene: Scene, path: str | os.PathLike[str], refusal: InputError | None = None
) -> tuple[Path, ...]:
    """Draw a scene before it is solved: blocks, supports, joints, loads and near misses.

    Joints are told apart by how they lie to the dead load: bed, head and sloping. A scene that is
    refused can be drawn too: pass the error as ``refusal``, or let it be found here; the blocks to
    blame are red, the places ringed, the message is on the picture.

    ==========  ================================================================================
    ``.png``    picture
    ``.html``   interactive page: names and numbers under the pointer, a view into the joints
    ==========  ================================================================================

    Raises
    ------
    InputError
        For another suffix or a folder that cannot be written to.
    ModelError
        If a PNG is asked for and Matplotlib is not installed.

    Example
    -------
    >>> import tempfile
    >>> from cvxlimit.masonry import builtin_scene
    >>> path = Path(tempfile.mkdtemp()) / "arch.html"
    >>> [p.name for p in plot_scene(builtin_scene("arch"), path)]
    ['arch.html']
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix == ".png":
        content = scene_figure(scene, refusal=refusal)._repr_png_()
    elif suffix == ".html":
        content = scene_page(scene, refusal).encode("utf-8")
    else:
        raise InputError(
            f"cannot tell what to draw from {target.name!r}: give a name that ends in .png or .html"
        )
    write_file(target, content)
    return (target,)


def scene_figure(
    scene: Scene,
    viewer: tuple[float, float, float] | None = None,
    refusal: InputError | None = None,
) -> SceneFigure:
    """The picture of a scene as a Matplotlib figure; see :func:`plot_scene` and :func:`figure`."""
    return _drawing().scene_figure(scene, viewer, refusal or refused(scene))


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
    return _drawing().figure(scene, solution, viewer)


def _drawing() -> ModuleType:
    try:
        from cvxlimit.plotting import drawing
    except ImportError as error:
        raise ModelError(
            'pictures need Matplotlib: pip install "cvxlimit[plot]" '
            "(.html and .vtu work without it)"
        ) from error
    return drawing


def _png(scene: Scene, solution: Solution) -> bytes:
    return figure(scene, solution)._repr_png_()
