"""Pictures of scenes, mechanisms and results: one function each, none of which shows by itself.

``mechanism``, ``cracks``, ``forces``, ``thrust``, ``utilisation`` and ``exploded`` return a
Matplotlib figure, ``animation`` frames that go into a GIF or MP4, ``page`` an interactive page,
``to_pyvista`` meshes. Figures need Matplotlib (the extra ``plot``), which is imported when it is
used. Nothing here needs a display, OpenGL or a network.
"""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from cvxlimit.checks import of_type
from cvxlimit.errors import InputError, ModelError
from cvxlimit.files import write_file
from cvxlimit.plotting.annotations import refused
from cvxlimit.plotting.look import title
from cvxlimit.plotting.meshes import to_pyvista
from cvxlimit.plotting.movement import ContactKind, ContactMotion, Motion, motion
from cvxlimit.plotting.vtu import vtu_files
from cvxlimit.plotting.webpage import Page, page, scene_page
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

if TYPE_CHECKING:
    from cvxlimit.plotting.animating import Animation as Animation
    from cvxlimit.plotting.animating import animation as animation
    from cvxlimit.plotting.charts import draw_fragility as draw_fragility
    from cvxlimit.plotting.drawing import SceneFigure as SceneFigure
    from cvxlimit.plotting.results import cracks as cracks
    from cvxlimit.plotting.results import exploded as exploded
    from cvxlimit.plotting.results import forces as forces
    from cvxlimit.plotting.results import mechanism as mechanism
    from cvxlimit.plotting.results import thrust as thrust
    from cvxlimit.plotting.results import utilisation as utilisation

_DRAWN = {
    "Animation": "animating",
    "SceneFigure": "drawing",
    "animation": "animating",
    "cracks": "results",
    "draw_fragility": "charts",
    "exploded": "results",
    "forces": "results",
    "mechanism": "results",
    "thrust": "results",
    "utilisation": "results",
}
"""The module of every name that needs Matplotlib; above once more, for type checkers."""

__all__ = [
    "Animation", "ContactKind", "ContactMotion", "Motion", "Page", "SceneFigure", "animation",
    "cracks", "draw_fragility", "exploded", "figure", "forces", "mechanism", "motion", "page",
    "picture_of", "plot", "plot_scene", "refused", "scene_figure", "scene_page", "thrust", "title",
    "to_pyvista", "utilisation",
]  # fmt: skip

IMAGES = (".png", ".svg", ".pdf")
"""Files of figures. In SVG and PDF the painted blocks are an image; everything else is lines."""


if not TYPE_CHECKING:  # to type checkers it would make any name an attribute

    def __getattr__(name: str) -> Any:
        if name not in _DRAWN:
            raise AttributeError(f"module 'cvxlimit.plotting' has no attribute {name!r}")
        return getattr(_module(_DRAWN[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def picture_of(
    solution: Solution, kind: str, path: str | os.PathLike[str] | None = None, **options: Any
) -> Any:
    """The picture of a solution by its kind, or its file; see :meth:`Solution.plot`.

    Raises
    ------
    InputError
        For another kind, or a suffix that does not go with it.
    """
    kinds = ("mechanism", "forces", "thrust", "utilisation", "cracks", "exploded", "animation")
    if kind == "page":
        made: Any = page(solution.drawn_scene, solution)
    elif kind in kinds:
        if path is not None and Path(path).suffix.lower() in (".html", ".vtu") and not options:
            return plot(solution.drawn_scene, solution, path)[0]
        made = getattr(_module(_DRAWN[kind]), kind)(solution, **options)
    else:
        raise InputError(f"there is no picture {kind!r}: choose one of {', '.join(kinds)}, page")
    if path is None:
        return made
    if kind == "animation":
        return made.save(path)
    return _written(made, Path(path), (".html",) if kind == "page" else IMAGES)


def _written(made: Any, target: Path, suffixes: tuple[str, ...]) -> Path:
    suffix = target.suffix.lower()
    if suffix not in suffixes:
        raise InputError(
            f"cannot tell what to draw from {target.name!r}: give a name that ends in "
            f"{' or '.join(suffixes)}"
        )
    if suffix == ".html":
        write_file(target, made.encode("utf-8"))
    else:
        write_file(target, made.file(suffix.removeprefix(".")))
    return target


def plot(scene: Scene, solution: Solution, path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Draw the mechanism of ``solution`` into a file; the suffix of ``path`` says which kind.

    ==========  ================================================================================
    ``.png``    picture: deformed blocks by speed, contacts that open, slide or twist; also
                ``.svg`` and ``.pdf``
    ``.gif``    the same in motion; also ``.mp4``
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
    if suffix in IMAGES:
        files = {target: figure(scene, solution).file(suffix.removeprefix("."))}
    elif suffix in (".gif", ".mp4"):
        return (_module("animating").animation(solution.of(scene)).save(target),)
    elif suffix == ".html":
        files = {target: page(scene, solution).encode("utf-8")}
    elif suffix == ".vtu":
        blocks, contacts = vtu_files(scene, solution)
        files = {target: blocks, target.with_name(f"{target.stem}-contacts.vtu"): contacts}
    else:
        raise InputError(
            f"cannot tell what to plot from {target.name!r}: give a name that ends in "
            ".png, .html or .vtu (also .svg, .pdf, .gif, .mp4)"
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
    found: SceneFigure = _module("drawing").scene_figure(scene, viewer, refusal or refused(scene))
    return found


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
    found: SceneFigure = _module("results").mechanism_of(scene, solution, viewer=viewer)
    return found


def _module(name: str) -> ModuleType:
    try:
        return import_module(f"cvxlimit.plotting.{name}")
    except ImportError as error:
        raise ModelError(
            'pictures need Matplotlib: pip install "cvxlimit[plot]" '
            "(.html and .vtu work without it)"
        ) from error
