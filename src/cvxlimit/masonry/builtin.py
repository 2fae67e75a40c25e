"""The built-in scenes, by name. To add one, write a line into ``_SCENES``: nothing else changes.

A scene whose shape the generators cannot make gets its own generator module next to this one.
How the layouts of panels S12 and S10 were inferred: ``docs/evidence/paper.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from cvxlimit.base.checks import meant
from cvxlimit.errors import InputError
from cvxlimit.masonry.arches import arch, arch_on_piers
from cvxlimit.masonry.buttresses import flying_buttress
from cvxlimit.masonry.facades import Opening, facade, house_corner, panel
from cvxlimit.masonry.retaining import dam, retaining_wall
from cvxlimit.masonry.vaults import barrel_vault, dome
from cvxlimit.masonry.walls import running_bond, single_block, stack, wall
from cvxlimit.scene import Load, Scene


@dataclass(frozen=True)
class BuiltinScene:
    """A named scene: call it to build it anew; ``description`` is its line in ``cvxlimit
    scenes``."""

    description: str
    build: Callable[[], Scene]

    def __call__(self) -> Scene:
        return self.build()


WINDOW_WALL = (
    (1, 1, 1, 1),
    (0.5, 1, 1, 1, 0.5),
    (1, 1, 1, 1),
    (0.5, 1, -1, 1, 0.5),
    (1, 0.5, -1, 0.5, 1),
    (0.5, 1, -1, 1, 0.5),
    (1, 0.5, -1, 0.5, 1),
    (0.5, 1, -1, 1, 0.5),
    (1, 1, 1, 1),
    (0.5, 1, 1, 1, 0.5),
    (1, 1, 1, 1),
)
"""Courses of Ferris & Tin-Loi's third wall, bottom first, with a window five courses high."""


def _tuff_wall() -> Scene:
    return wall(
        running_bond(4, 12),
        unit=(0.1, 0.1, 0.05),
        density=12.1,
        friction=0.51,
        side_supports=("start",),
        live=Load(acceleration=(0.0, 1.0, 0.0)),
    )


def _facade() -> Scene:
    door = Opening(start=0.6, width=0.8, sill=0, courses=6)
    window = Opening(start=2.2, width=0.8, sill=3, courses=3)
    return facade(3.6, 10, [door, window], left_return=1.4, right_return=1.0)


_SCENES: dict[str, tuple[str, Callable[[], Scene]]] = {
    "single-block": (
        "one block pushed along x: rocks at length / height = 0.4 (closed form)",
        single_block,
    ),
    "stack": ("five blocks piled up, pushed along x", lambda: stack(friction=0.6)),
    "ferris-tin-loi-1": (
        "Ferris & Tin-Loi 2001, wall 1: 6 courses, pushed in its plane, 0.642859",
        lambda: wall(running_bond(5, 6, first="half"), friction=0.65),
    ),
    "ferris-tin-loi-2": (
        "Ferris & Tin-Loi 2001, wall 2: 10 courses, pushed in its plane, 0.579999",
        lambda: wall(running_bond(5, 10, first="half"), friction=0.65),
    ),
    "ferris-tin-loi-3": (
        "Ferris & Tin-Loi 2001, wall 3: a window, pushed in its plane, 0.403694",
        lambda: wall(WINDOW_WALL, friction=0.65),
    ),
    "arch": (
        "semicircular arch of 20 voussoirs, thickness 0.15 of the mean radius, pushed along x",
        arch,
    ),
    "tuff-wall": ("tuff wall held at one end, pushed out of its plane", _tuff_wall),
    "s12-panel": (
        "panel S12 of Portioli et al. 2013, one return, layout inferred, pushed out of plane",
        lambda: panel(0.76, 19, left_return=0.56, friction=0.7),
    ),
    "s10-panel": (
        "panel S10 of Portioli et al. 2013, two returns, layout inferred, pushed out of plane",
        lambda: panel(0.96, 27, left_return=0.52, right_return=0.52, friction=0.7),
    ),
    "facade": ("front with a door, a window and two returns, pushed out of its plane", _facade),
    "house-corner": (
        "two walls of a two-storey house with windows, the front pushed out of its plane",
        house_corner,
    ),
    "arch-on-piers": (
        "semicircular arch on two piers of four blocks, pushed along x",
        arch_on_piers,
    ),
    "flying-buttress": (
        "flyer between a pier and a wall; the load factor is the wall's thrust in kN",
        flying_buttress,
    ),
    "barrel-vault": ("semicircular vault of 12 rows in running bond, pushed across", barrel_vault),
    "dome": ("hemispherical dome of 96 blocks with an oculus, pushed along x", dome),
    "retaining-wall": (
        "dry-stone retaining wall; the load factor is on the earth's pressure",
        retaining_wall,
    ),
    "retaining-wall-shaken": (
        "the same under its earth, pushed along x",
        lambda: retaining_wall(live=Load(acceleration=(1.0, 0.0, 0.0))),
    ),
    "dam": ("masonry dam with uplift; the load factor is on the water's weight", dam),
}


def _named(name: str, build: Callable[[], Scene]) -> Callable[[], Scene]:
    return lambda: build().with_name(name)


BUILTIN: Mapping[str, BuiltinScene] = MappingProxyType(
    {name: BuiltinScene(text, _named(name, build)) for name, (text, build) in _SCENES.items()}
)
"""All built-in scenes by name, in the order in which ``cvxlimit scenes`` lists them."""


def builtin_scene(name: str) -> Scene:
    """The built-in scene called ``name``.

    Raises
    ------
    InputError
        If there is none; the message lists the names.

    Example
    -------
    >>> scene = builtin_scene("tuff-wall")
    >>> len(scene.free), len(scene.contacts)
    (54, 146)
    """
    if name not in BUILTIN:
        raise InputError(
            f"there is no built-in scene {name!r}; choose one of {', '.join(BUILTIN)}"
            + meant(name, BUILTIN, before="; ")
        )
    return BUILTIN[name]()
