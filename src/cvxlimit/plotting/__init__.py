"""Pictures of scenes, mechanisms and results: one function each, none of which shows by itself.

A picture of a solution is a function with the decorator :func:`picture`, in a module of
``cvxlimit.plotting.pictures`` or in a program of one's own; :data:`PICTURES` has all by name, which
``solution.plot(name)`` takes. Most return a Matplotlib figure; ``animation`` frames that go into a
GIF or MP4, ``page`` an interactive page; ``to_pyvista`` returns meshes. Figures need Matplotlib
(the extra ``plot``), which is imported when it is used. Nothing here needs a display, OpenGL or a
network.
"""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

from cvxlimit.base.checks import of_type
from cvxlimit.base.files import write_file
from cvxlimit.errors import InputError
from cvxlimit.plotting import pictures
from cvxlimit.plotting.annotations import refused
from cvxlimit.plotting.contents import Bar, Drawing, Lines, Viewer, camera_for, scene_drawing
from cvxlimit.plotting.look import IMAGES, of_kind, saved, title, with_suffix
from cvxlimit.plotting.pictures.animation import Animation, animation
from cvxlimit.plotting.pictures.exploded import exploded
from cvxlimit.plotting.pictures.forces import forces, thrust
from cvxlimit.plotting.pictures.mechanism import cracks, mechanism, mechanism_of
from cvxlimit.plotting.pictures.utilisation import utilisation
from cvxlimit.plotting.pictures.webpage import Page, page, scene_page
from cvxlimit.plotting.registry import PICTURES, figures, picture
from cvxlimit.plotting.vtu import to_pyvista, vtu_files
from cvxlimit.results.movement import Motion, motion
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solution.kinematics import ContactKind, ContactMotion

if TYPE_CHECKING:
    from cvxlimit.plotting.sheet import SceneFigure as SceneFigure

__all__ = [
    "PICTURES", "Animation", "Bar", "ContactKind", "ContactMotion", "Drawing", "Lines", "Motion",
    "Page", "SceneFigure", "animation", "camera_for", "cracks", "exploded",
    "figure", "forces", "mechanism", "motion", "page", "picture", "picture_of", "plot",
    "plot_scene", "refused", "scene_figure", "scene_page", "thrust", "title", "to_pyvista",
    "utilisation",
]  # fmt: skip

for _module in iter_modules(pictures.__path__):  # one that is put there needs no line here
    import_module(f"{pictures.__name__}.{_module.name}")
for _name in PICTURES.keys() - set(__all__):
    globals()[_name] = PICTURES[_name]
    __all__ += [_name]


if not TYPE_CHECKING:  # to type checkers it would make any name an attribute

    def __getattr__(name: str) -> Any:
        if name == "SceneFigure":  # a Matplotlib figure
            return figures("sheet").SceneFigure
        raise AttributeError(f"module 'cvxlimit.plotting' has no attribute {name!r}")


def picture_of(
    solution: Solution, kind: str, path: str | os.PathLike[str] | None = None, **options: Any
) -> Any:
    """The picture of a solution by its kind, or its file; see :meth:`Solution.plot`."""
    is_mechanism = kind == "mechanism" and not options  # which has files of more kinds
    if is_mechanism and path is not None and Path(path).suffix.lower() in (".html", ".vtu"):
        return plot(solution.scene, solution, path)[0]
    return of_kind("a solution", PICTURES, kind, solution, path, options)


def plot(scene: Scene, solution: Solution, path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """Draw the mechanism of ``solution`` into a file; a solution without one is drawn undeformed.

    The suffix of ``path`` says what: ``.png``, ``.svg``, ``.pdf`` a picture (blocks by speed,
    contacts that open, slide or twist); ``.gif``, ``.mp4`` the same in motion; ``.html`` an
    interactive page in one file that works offline; ``.vtu`` blocks for ParaView, with the contacts
    beside them in ``<name>-contacts.vtu``.

    Returns
    -------
    tuple of Path
        The files written. Each appears complete or not at all.

    Raises
    ------
    InputError
        For another suffix, a folder that cannot be written to, or a solution of another scene.
    ModelError
        If a picture is asked for and Matplotlib is not installed, or a ``.vtu`` without PyVista
        (the extra ``pyvista``).

    Example
    -------
    >>> import tempfile
    >>> from cvxlimit import builtin_scene, solve
    >>> scene = builtin_scene("single-block")
    >>> [p.name for p in plot(scene, solve(scene), Path(tempfile.mkdtemp()) / "block.vtu")]
    ['block.vtu', 'block-contacts.vtu']
    """
    target = Path(of_type(path, (str, os.PathLike), "path must name a file", "write 'wall.png'"))
    suffix = target.suffix.lower()
    if suffix in IMAGES:
        return (figure(scene, solution).save(target),)
    if suffix in (".gif", ".mp4"):
        return (animation(solution.of(scene)).save(target),)
    if suffix == ".html":
        return (page(scene, solution).save(target),)
    if suffix != ".vtu":
        raise InputError(
            f"cannot tell what to plot from {target.name!r}: give a name that ends in "
            ".png, .html or .vtu (also .svg, .pdf, .gif, .mp4)"
        )
    names = target, target.with_name(f"{target.stem}-contacts.vtu")
    for name, content in zip(names, vtu_files(scene, solution), strict=True):
        write_file(name, content)
    return names


def plot_scene(
    scene: Scene,
    path: str | os.PathLike[str],
    refusal: InputError | None = None,
    **options: Any,
) -> tuple[Path, ...]:
    """Draw a scene before it is solved, as a picture (``.png``, ``.svg``, ``.pdf``) or an
    interactive page (``.html``).

    Blocks, supports, joints (bed, head and sloping, to the dead load), loads and near misses. A
    scene that is refused can be drawn too: pass the error as ``refusal``, or let it be found here;
    the blocks to blame are red, the places ringed, the message is on the picture. ``options`` of a
    picture are those of :func:`scene_figure`. Errors as for :func:`plot`.

    Example
    -------
    >>> import tempfile
    >>> from cvxlimit.masonry import builtin_scene
    >>> path = Path(tempfile.mkdtemp()) / "arch.html"
    >>> [p.name for p in plot_scene(builtin_scene("arch"), path)]
    ['arch.html']
    """
    target = with_suffix(path, (*IMAGES, ".html"))
    if target.suffix.lower() in IMAGES:
        return (saved(scene_figure(scene, refusal=refusal, **options), target, options),)
    if options:
        raise InputError(f"a page has no {min(options)}: leave it out, or name a .png")
    return (scene_page(scene, refusal).save(target),)


def scene_figure(
    scene: Scene, viewer: Viewer = None, refusal: InputError | None = None, **options: Any
) -> SceneFigure:
    """The picture of a scene as a Matplotlib figure; see :func:`plot_scene`.

    ``viewer`` is the direction from the scene towards the viewer; ``ax``, ``figsize``, ``title``
    and ``legend`` are those of :func:`picture`.
    """
    drawing = scene_drawing(scene, viewer, refusal or refused(scene))
    found: SceneFigure = figures().drawn(drawing, **options)
    return found


def figure(scene: Scene, solution: Solution, viewer: Viewer = None, **options: Any) -> SceneFigure:
    """The picture of :func:`plot` as a Matplotlib figure, which notebooks show when it ends a cell.
    ``viewer`` is the direction from the scene towards the viewer, chosen from the movement if
    None; ``ax``, ``figsize``, ``title`` and ``legend`` are those of :func:`picture`."""
    found: SceneFigure = figures().drawn(mechanism_of(scene, solution, viewer=viewer), **options)
    return found
