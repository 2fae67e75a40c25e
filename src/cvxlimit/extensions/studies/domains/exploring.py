"""Exploring a structure in a notebook: its load domain, and the mechanism under a load point."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Mapping
from itertools import count
from typing import Any

import numpy as np

from cvxlimit.base.checks import finite_vector, is_number
from cvxlimit.base.extras import needed
from cvxlimit.errors import CvxlimitError, InputError, ModelError
from cvxlimit.extensions.studies.domains.search import load_domain, named_loads
from cvxlimit.extensions.studies.variations import Family
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.methods.solving import solve
from cvxlimit.plotting.look import DIGITS
from cvxlimit.plotting.notebook import card, falling
from cvxlimit.plotting.pictures.webpage import asset
from cvxlimit.scene import Scene, check_scene
from cvxlimit.scene.loads import Load, combined
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import Bracket

REACH = 3.0
"""Of the frame over the load point as it stands first: a domain may go on for tens of times as far
along a load that holds joints together, and what falls would be a dot in it."""


class Explorer:
    """What a notebook shows: a domain, a load point, and the mechanism under it.

    Parameters
    ----------
    scenes : Scene or callable
        A scene, varied by the parameters of :func:`~cvxlimit.studies.varied`; or a function of
        parameters of its own.
    loads : mapping of str to Load, or None
        Two, as for :func:`~cvxlimit.studies.load_domain`.
    tolerance : float
        Of the domain, which is drawn anew whenever a parameter changes.
    options
        ``surface`` and ``model``, as for :func:`cvxlimit.solve`.
    ranges : mapping of str to tuple
        Parameters with a slider: least and largest value, and where it stands in the beginning.
    """

    def __init__(
        self, scenes: Scene | Callable[..., Scene], loads: Any, tolerance: float,
        options: Mapping[str, Any], ranges: Mapping[str, Any],
    ) -> None:  # fmt: skip
        self.family, self.tolerance, self.options = Family(scenes), tolerance, dict(options)
        self._answers = count()
        self.family.check(ranges)
        self.sliders = {name: _range(self.family, name, given) for name, given in ranges.items()}
        self.values = {name: start for name, (_, _, start) in self.sliders.items()}
        self.loads = named_loads(loads)
        self.scene = self.family.scene(self.values)
        if len(self.loads) != 2:
            raise InputError(f"two loads can be explored, got {len(self.loads)}")
        self.domain = self._enclosed()
        most = self.domain.load_factor(self.domain.units * (1.0, 0.5)).upper
        far = most if np.isfinite(most) and most > 0.0 else 1.0
        self.point = 0.8 * min(far, 1.0) * self.domain.units * (1.0, 0.5)
        reach = REACH * np.abs(self.point / self.domain.units).max() * self.domain.units
        self.frame = np.stack([-reach, reach])
        self.state = self._under_point()

    def _enclosed(self) -> Any:
        return load_domain(
            self.scene, self.loads, self.tolerance, progress=False, most_solves=60, **self.options
        )

    def move(self, point: Any) -> dict[str, Any]:
        """The load point elsewhere: nothing is solved."""
        self.point = np.asarray(finite_vector(point, 2, "point of the load domain"))
        self.state = self._under_point()
        return self.state

    def change(self, values: Mapping[str, float]) -> Iterator[dict[str, Any]]:
        """Other parameters: the mechanism under the point first, by one solve, then the domain."""
        self.values = {**self.values, **values}
        try:
            self.scene = self.family.scene(self.values)
            if not self.point.any():  # no load, of which there is no factor
                self.domain = self._enclosed()
                yield self.move(self.point)
                return
            load = combined(list(self.loads.values()), self.point)
            solution = solve(self.scene.with_live(load), **self.options)
            self.state = self._state(solution.bracket, solution, str(solution.status), False)
            yield self.state
            self.domain = self._enclosed()
            self.state = self._state(solution.bracket, solution, str(solution.status))
        except Exception as error:  # of a user's function too: the page waits for an answer
            kind = "" if isinstance(error, CvxlimitError) else f"{type(error).__name__}: "
            told = {"text": f"{kind}{error}", "picture": "", "is_last": True}
            self.state = {**self.state, **told, "answer": next(self._answers)}
        yield self.state

    def _under_point(self) -> dict[str, Any]:
        """The mechanism whose half-space the point's loads reach first as they grow."""
        domain, found = self.domain, None
        bounding = [s for s in domain.supports if np.isfinite(s.offset)]
        speed = np.array([s.normal @ self.point for s in bounding])
        if (speed > 0.0).any():
            room = np.array([s.offset for s in bounding])
            times = np.where(speed > 0.0, room / np.where(speed > 0.0, speed, 1.0), np.inf)
            found = bounding[int(times.argmin())].solution
        bracket = domain.load_factor(self.point) if self.point.any() else Bracket()
        return self._state(bracket, found, str(domain.contains(self.point)))

    def _state(
        self, bracket: Bracket, solution: Solution | None, said: str, is_last: bool = True
    ) -> dict[str, Any]:
        inside, outside = self.domain.shapes(self.frame)
        names = self.domain.names
        times = "any number" if bracket.lower == np.inf else bracket.shown(DIGITS)
        at = ", ".join(f"{name} {x:.4g}" for name, x in zip(names, self.point, strict=True))
        return {
            "inside": inside.tolist(), "outside": outside.tolist(),
            "box": self.frame.tolist(), "names": list(names), "is_last": is_last,
            "text": f"{at}: {said}; such loads can be multiplied by {times}",
            "picture": self._picture(solution),
            "answer": next(self._answers),  # so that a page is told of two that are alike
        }  # fmt: skip

    def _picture(self, solution: Solution | None) -> str:
        try:
            return base64.b64encode(falling(self.scene, solution)).decode("ascii")
        except (InputError, ModelError):  # a picture is not worth losing the figures
            return ""

    def _repr_html_(self) -> str:
        image = base64.b64decode(self.state["picture"]) or None
        values = ((name, f"{value:g}") for name, value in self.values.items())
        text = iter([("load point", self.state["text"]), *values])
        return self.domain._repr_html_() + card(self.scene.name, text, image)


def explore(
    scenes: Scene | Callable[..., Scene],
    loads: Mapping[str, Load] | None = None,
    tolerance: float = 0.03,
    *,
    surface: Any = "conic",
    model: str = "auto",
    **ranges: tuple[float, ...],
) -> Any:
    """A structure to explore in a notebook: drag the load point over its load domain, move
    parameters by sliders, and see mechanism and bracket follow.

    Parameters
    ----------
    scenes : Scene or callable
        A scene, whose sliders are parameters of :func:`varied`; or a function from parameters of
        its own, such as a thickness, to a scene.
    loads : mapping of str to Load, or None
        Two; pushes along x and y unless given.
    tolerance : float
        Largest gap of the domain, which is enclosed anew whenever a slider moves.
    surface, model
        As for :func:`cvxlimit.solve`.
    ranges : (least, largest) or (least, largest, first value)
        Sliders by the parameter's name; friction between half of a scene's and twice that unless
        given.

    Returns
    -------
    AnyWidget or Explorer
        Without anywidget (the extra ``notebook``) a picture that stands still.

    Raises
    ------
    InputError
        For ranges that are none, parameters that do not exist, three loads.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> shown = explore(builtin_scene("stack"), friction=(0.3, 0.9))
    """
    if not callable(scenes):
        check_scene(scenes)
    if not ranges and isinstance(scenes, Scene):
        ranges = {"friction": (0.5 * scenes.friction, 2.0 * scenes.friction or 1.0)}
    options = {"surface": surface, "model": model}
    explorer = Explorer(scenes, loads, tolerance, options, ranges)
    try:
        needed("anywidget", "notebook", "widgets")
    except ModelError:
        return explorer
    return widget(explorer)


def widget(explorer: Explorer) -> Any:
    anywidget, traits = (needed(m, "notebook", "widgets") for m in ("anywidget", "traitlets"))
    made = type("Exploring", (anywidget.AnyWidget,), {
        "_esm": asset("ticks.js") + asset("explore.js", __package__),
        "__module__": __name__,
        **{name: kind().tag(sync=True) for name, kind in (
            ("point", traits.List), ("values", traits.Dict), ("state", traits.Dict),
            ("sliders", traits.List),
        )},
    })(
        point=explorer.point.tolist(), values=explorer.values, state=explorer.state,
        sliders=[{"name": name, "low": low, "high": high}
                 for name, (low, high, _) in explorer.sliders.items()],
    )  # fmt: skip

    def moved(change: Any) -> None:
        made.state = explorer.move(change["new"])

    def changed(change: Any) -> None:
        for state in explorer.change(change["new"]):
            made.state = state

    made.observe(moved, "point")
    made.observe(changed, "values")
    return made


def _range(family: Family, name: str, given: Any) -> tuple[float, float, float]:
    """Ends of a slider, and where it stands first: as the scene has it, or the function."""
    numbers = tuple(given) if isinstance(given, (tuple, list)) else ()
    is_known = len(numbers) in (2, 3) and all(is_number(x) and np.isfinite(x) for x in numbers)
    if not is_known or numbers[0] >= numbers[1]:
        raise InputError(
            f"range of {name!r} must be a least and a larger number, got {given!r:.60}: write "
            f"{name}=(0.3, 0.9)"
        )
    usual = family.parameters[name].default
    if isinstance(family.source, Scene) and name in PROPERTIES:
        usual = getattr(family.source, name)
    first = numbers[2] if len(numbers) == 3 else usual
    low, high = float(numbers[0]), float(numbers[1])
    is_usable = is_number(first) and np.isfinite(first)
    return low, high, float(np.clip(first, low, high)) if is_usable else 0.5 * (low + high)
