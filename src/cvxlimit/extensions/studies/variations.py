"""Variations of a scene: changes of its usual parameters, grids of values, and random draws."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from inspect import Parameter, Signature, signature
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from cvxlimit.base.checks import count, finite_vector, meant, positive
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.scene import Scene, check_scene
from cvxlimit.scene.loads import Load

if TYPE_CHECKING:
    from pandas import DataFrame

Values: TypeAlias = "Iterable[Any] | float | str"
Grid: TypeAlias = "Mapping[str, Values] | Sequence[Mapping[str, Any]] | DataFrame"


def varied(
    scene: Scene,
    *,
    density: float = 1.0,
    size: float = 1.0,
    tilt: float = 0.0,
    direction: float = 0.0,
    live: Load | None = None,
    dead: Load | None = None,
    **joints: float | None,
) -> Scene:
    """Returns a scene with some of its parameters changed; contacts are kept unless its size
    changes.

    Parameters
    ----------
    scene : Scene
    density : float
        Factor on the weight per volume of every block.
    size : float
        Factor on all lengths. Densities and strengths stay, so weights grow with its cube; so do
        forces that are given as such.
    tilt : float
        Degrees by which the ground leans: gravity then pulls towards the live load as well, with
        the sine of the angle.
    direction : float
        Degrees by which the live load is turned about the vertical, from x towards y.
    live, dead : Load or None
        Other loads; they are tilted and turned like the scene's own.
    friction, cohesion, compressive_strength, tensile_strength : float or None
        New values of all contacts without their own; None keeps the scene's.

    Raises
    ------
    InputError
        If a value is out of its range; for a tilt of a scene without gravity or with a live load
        that has no horizontal acceleration, and for a direction without acceleration.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> block = builtin_scene("single-block")
    >>> varied(block, direction=90.0).live.acceleration[1]
    1.0
    """
    check_scene(scene)
    result = scene if density == 1.0 else scene.with_density(density)
    result = result.with_joints(**joints) if joints else result
    result = result if live is None else result.with_live(live)
    result = result if dead is None else result.with_dead(dead)
    if direction != 0.0:
        result = result.with_live(_turned(result.live, direction))
    if tilt != 0.0:
        result = result.with_dead(_tilted(result, tilt))
    return result if size == 1.0 else _resized(result, size)


def _taken() -> Signature:
    """Returns the signature of :func:`varied` with the joints' properties spelled out."""
    first, *others = signature(varied).parameters.values()
    joints = (Parameter(name, Parameter.KEYWORD_ONLY, default=None) for name in PROPERTIES)
    return Signature([first, *joints, *others[:-1]])


varied.__signature__ = _taken()  # type: ignore[attr-defined]


@dataclass(frozen=True)
class Family:
    """Scenes by parameters: those of :func:`varied` on one ``source``, or of a function that
    returns scenes."""

    source: Scene | Callable[..., Scene]

    @property
    def parameters(self) -> dict[str, Parameter]:
        """By name, as the function takes them."""
        if not isinstance(self.source, Scene):
            return dict(signature(self.source).parameters)
        return {k: v for k, v in signature(varied).parameters.items() if k != "scene"}

    def check(self, given: Iterable[str], others: Iterable[str] = ()) -> None:
        """Raises InputError if no scene has parameters of these names, or lacks one. ``others`` may
        be meant."""
        own, source = self.parameters, self.source
        try:
            Signature(list(own.values())).bind(**dict.fromkeys(given))
        except TypeError as error:
            who = f"function {getattr(source, '__name__', 'of scenes')!r}"
            if isinstance(source, Scene):
                who = f"scene {source.name!r}"
            why = f"cannot be called: {error}"
            if unknown := [name for name in given if name not in own]:
                near = meant(unknown[-1], [*own, *others])
                why = f"has no parameter {unknown[-1]!r}" + (f" ({near})" if near else "")
            also = ", and options of solve may be varied as well" if others else ""
            raise InputError(f"{who} {why}; its parameters are {', '.join(own)}{also}") from error

    def scene(self, parameters: Mapping[str, Any]) -> Scene:
        """Returns the scene of these parameters."""
        if isinstance(self.source, Scene):
            _ = self.source.geometry, self.source.dead_forces  # copies that have the same keep them
            return varied(self.source, **parameters)
        scene = self.source(**parameters)
        check_scene(scene)
        return scene


def _resized(scene: Scene, size: float) -> Scene:
    """Returns the scene with all lengths multiplied by ``size``, its strengths as they were."""
    factor = positive(size, "size, a factor on all lengths,")
    larger = scene.in_units(scene.units, factor, factor**3)
    return replace(larger, **scene.joint_values)


def _turned(live: Load, degrees: float) -> Load:
    """Returns the live load with accelerations turned by ``degrees`` about the vertical."""
    if live.acceleration is None and not live.growing:
        raise InputError(
            "direction turns the live load's acceleration, but it has none: vary live itself"
        )
    angle = np.radians(finite_vector([degrees], 1, "direction")[0])
    c, s = np.cos(angle), np.sin(angle)

    def turned(push: tuple[float, ...]) -> tuple[float, ...]:
        x, y, z = push
        return tuple((np.round([c * x - s * y, s * x + c * y, z], 15) + 0.0).tolist())

    return replace(
        live,
        acceleration=None if live.acceleration is None else turned(live.acceleration),
        growing=[replace(g, acceleration=turned(g.acceleration)) for g in live.growing],
    )


def _tilted(scene: Scene, degrees: float) -> Load:
    """Returns the dead load with gravity leaning by ``degrees`` towards the live load."""
    angle = np.radians(finite_vector([degrees], 1, "tilt")[0])
    down, push = scene.dead.gravity, scene.live.acceleration
    # The live load's part across gravity is the direction in which the ground leans.
    level = np.zeros(3)
    if down is not None and push is not None:
        level = np.array(push) - np.dot(push, down) * np.array(down)
    length = float(np.linalg.norm(level))
    if not length > 0.0:
        raise InputError(
            f"tilt leans gravity towards the live load, but scene {scene.name!r} has no gravity in "
            "its dead load or no horizontal acceleration in its live load: vary dead itself"
        )
    leaning = np.cos(angle) * np.array(down) + np.sin(angle) * level / length
    return replace(scene.dead, gravity=tuple((leaning / np.linalg.norm(leaning)).tolist()))


def variations_of(grid: Grid) -> DataFrame:
    """Returns the table with one variation of ``grid`` per row; raises InputError if it has
    none."""
    pandas = needed("pandas", "frames", "sweeps")
    if isinstance(grid, pandas.DataFrame):
        table = grid.reset_index(drop=True)
    elif isinstance(grid, Mapping):
        values = [_values(name, given) for name, given in grid.items()]
        table = pandas.DataFrame(list(product(*values)), columns=list(grid))
    elif isinstance(grid, Sequence) and all(isinstance(row, Mapping) for row in grid):
        names = [tuple(row) for row in grid]
        for row in names:
            if set(row) != set(names[0]):
                raise InputError(
                    f"all variations must have the same parameters, got {list(names[0])} and "
                    f"{list(row)}"
                )
        table = pandas.DataFrame(list(grid))
    else:
        raise InputError(
            f"grid must be a mapping of names to values, rows, or a table, got {grid!r:.60}: "
            "write {'friction': [0.5, 0.6, 0.7]}"
        )
    if not len(table) or not len(table.columns):
        raise InputError("the grid has no variation: give every parameter at least one value")
    if not all(isinstance(name, str) for name in table.columns):
        raise InputError(f"parameters must be named by texts, got {list(table.columns)}")
    result: DataFrame = table
    return result


def _values(name: str, given: Any) -> list[Any]:
    """Returns the values of a parameter as a list; a single value is a list of one."""
    if isinstance(given, (str, bytes, Mapping)) or not isinstance(given, Iterable):
        return [given]
    values = list(given)
    if not values:
        raise InputError(f"parameter {name!r} has no values; give it at least one")
    return values


def draws(distributions: Mapping[str, Any], number: int, seed: int) -> DataFrame:
    """Returns independent random draws of parameters, as a grid for :func:`cvxlimit.sweep`.

    Parameters
    ----------
    distributions : mapping of str to distribution
        What has ``rvs``, as the distributions of :mod:`scipy.stats`; or a function of a NumPy
        generator and a number of draws; or a list, of which one value is drawn each time.
    number : int
        Number of draws, at least 1.
    seed : int
        The same seed gives the same draws; a parameter's do not depend on the others.

    Raises
    ------
    InputError
        For anything else as a distribution, or draws that are not finite.
    ModelError
        If pandas is not installed, or the number is below 1.

    Example
    -------
    >>> from scipy import stats
    >>> table = draws({"friction": stats.uniform(0.5, 0.2), "bond": ["good", "bad"]}, 100, seed=1)
    >>> len(table), bool(table["friction"].between(0.5, 0.7).all())
    (100, True)
    """
    pandas = needed("pandas", "frames", "random draws")
    wanted = count(number, 1, "number of draws")
    columns: dict[str, Any] = {}
    for name, distribution in distributions.items():
        source = np.random.default_rng([count(seed, 0, "seed"), *name.encode()])
        columns[name] = _drawn(name, distribution, wanted, source)
    result: DataFrame = pandas.DataFrame(columns)
    return result


def _drawn(name: str, distribution: Any, number: int, source: np.random.Generator) -> Any:
    """Returns ``number`` draws from one parameter's distribution."""
    drawn: Any
    if hasattr(distribution, "rvs"):
        drawn = distribution.rvs(size=number, random_state=source)
    elif callable(distribution):
        drawn = distribution(source, number)
    elif isinstance(distribution, Sequence) and not isinstance(distribution, str):
        return [distribution[i] for i in source.integers(len(distribution), size=number)]
    else:
        raise InputError(
            f"parameter {name!r} must have a distribution of scipy.stats, a function or a list, "
            f"got {distribution!r:.60}"
        )
    values = np.asarray(drawn)
    if values.shape != (number,) or (
        np.issubdtype(values.dtype, np.number) and not np.isfinite(values).all()
    ):
        raise InputError(
            f"draws of {name!r} must be {number} finite values, got shape {values.shape}"
        )
    return values
