"""The pictures there are: a function with a decorator is one."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from cvxlimit.extras import needed
from cvxlimit.plotting.contents import Drawing

if TYPE_CHECKING:
    from cvxlimit.plotting.drawing import SceneFigure

P = ParamSpec("P")
T = TypeVar("T")

PICTURES: dict[str, Callable[..., Any]] = {}
"""Functions from a solution to something with ``save(path)``, by the name of the picture."""


def listed(make: Callable[P, T]) -> Callable[P, T]:
    """A function from a solution to something with ``save(path)``, as a picture of its name."""
    PICTURES[make.__name__] = make
    return make


def picture(make: Callable[P, Drawing]) -> Callable[P, SceneFigure]:
    """A function from a solution to a :class:`Drawing`, as a picture of its name.

    It returns a figure then, and ``solution.plot`` knows it; its parameters besides the solution
    are options there.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.plotting import Drawing, camera_for, motion
    >>> @picture
    ... def falling(solution, *, viewer=None):
    ...     '''How it falls, without any words.'''
    ...     scene = solution.drawn_scene
    ...     moving = motion(scene, solution)
    ...     return Drawing(scene, moving, camera_for(scene, moving, viewer))
    >>> type(solve(builtin_scene("single-block")).plot("falling")).__name__
    'SceneFigure'
    >>> del PICTURES["falling"]
    """

    @wraps(make)
    def made(*args: P.args, **options: P.kwargs) -> SceneFigure:
        figure: SceneFigure = figures().drawn(make(*args, **options))
        return figure

    signature = inspect.signature(make).replace(return_annotation="SceneFigure")
    made.__signature__ = signature  # type: ignore[attr-defined]
    return listed(made)


def figures() -> ModuleType:
    """What draws with Matplotlib, imported when it is used; refused if that is not installed."""
    needed("matplotlib", "plot", "pictures (but for .html and .vtu)")
    return import_module("cvxlimit.plotting.drawing")
