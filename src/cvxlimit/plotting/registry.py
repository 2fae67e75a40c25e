"""The pictures there are: a function with a decorator is one."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from cvxlimit.base.doors import Door
from cvxlimit.base.extras import needed
from cvxlimit.plotting.contents import Drawing

if TYPE_CHECKING:
    from cvxlimit.plotting.sheet import SceneFigure

P = ParamSpec("P")
T = TypeVar("T")

PICTURES = Door("cvxlimit.pictures")
"""Functions from a solution to something with ``save(path)``, by the name of the picture; those of
other distributions are found when they are asked for."""


def listed(make: Callable[P, T]) -> Callable[P, T]:
    """A function from a solution to something with ``save(path)``, as a picture of its name."""
    PICTURES[make.__name__] = make
    return make


def picture(make: Callable[P, Drawing]) -> Callable[P, SceneFigure]:
    """A function from a solution to a :class:`Drawing`, as a picture of its name.

    It returns a figure then, and ``solution.plot`` knows it; its parameters besides the solution
    are options there. Every picture also takes

    ``ax``
        Matplotlib axes to draw into, with the title above and the legend below; their figure, whose
        layout becomes the constrained one if it has none, is returned.
    ``figsize``
        Width and height in inches, such as ``(3.4, 3.0)`` for a journal's column; by itself a
        figure is as large as its scene needs, or as ``rcParams["figure.figsize"]`` says where that
        was changed. Letters follow ``rcParams["font.size"]``.
    ``title``
        Another text; with ``""`` neither title nor caption.
    ``legend``
        ``False`` leaves it out.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.plotting import Drawing, camera_for, motion
    >>> @picture
    ... def falling(solution, *, viewer=None):
    ...     '''How it falls, without any words.'''
    ...     scene = solution.scene
    ...     moving = motion(scene, solution)
    ...     return Drawing(scene, moving, camera_for(scene, moving, viewer))
    >>> type(solve(builtin_scene("single-block")).plot("falling")).__name__
    'SceneFigure'
    >>> del PICTURES["falling"]
    """

    own = inspect.signature(make)
    common = [p for p in _COMMON if p.name not in own.parameters]

    @wraps(make)
    def made(*args: P.args, **options: P.kwargs) -> SceneFigure:
        given = {p.name: options.pop(p.name) for p in common if p.name in options}
        drawing = make(*args, **options)  # refuses other names
        figure: SceneFigure = figures().drawn(drawing, **given)
        return figure

    parameters = [*own.parameters.values(), *common]
    signature = own.replace(parameters=parameters, return_annotation="SceneFigure")
    made.__signature__ = signature  # type: ignore[attr-defined]
    return listed(made)


_COMMON = [
    inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=value, annotation=kind)
    for name, value, kind in (
        ("ax", None, "Axes | None"),
        ("figsize", None, "tuple[float, float] | None"),
        ("title", None, "str | None"),
        ("legend", True, "bool"),
    )
]
"""What :func:`picture` adds to the parameters of every picture."""


def figures(module: str = "drawing") -> ModuleType:
    """What draws with Matplotlib, imported when it is used; refused if that is not installed."""
    needed("matplotlib", "plot", "pictures (but for .html)")
    return import_module(f"cvxlimit.plotting.{module}")
