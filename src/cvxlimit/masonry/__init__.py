"""Generators of masonry scenes, and the built-in scenes.

Each generator takes sizes in the user's units (m and kN by default) and returns a
:class:`~cvxlimit.scene.Scene`:

- walls: :func:`wall` with :func:`running_bond`, :func:`rubble_wall`, :func:`panel`,
  :func:`facade` with :class:`Opening`, :func:`house_corner`, :func:`random_wall`;
- arches: :func:`arch`, :func:`arch_on_piers`, :func:`flying_buttress`;
- bridges: :func:`bridge` with :class:`Arch`;
- walls that hold back earth or water: :func:`retaining_wall`, :func:`dam`;
- vaults: :func:`barrel_vault`, :func:`dome`;
- :func:`stack` and :func:`single_block`.

Named scenes live in :mod:`cvxlimit.masonry.builtin`: that is where to add the next one.
"""

from cvxlimit.masonry.arches import arch, arch_on_piers
from cvxlimit.masonry.bridges import Arch, bridge
from cvxlimit.masonry.builtin import BUILTIN, BuiltinScene, builtin_scene
from cvxlimit.masonry.buttresses import flying_buttress
from cvxlimit.masonry.facades import Opening, facade, house_corner, panel
from cvxlimit.masonry.retaining import dam, retaining_wall
from cvxlimit.masonry.vaults import barrel_vault, dome
from cvxlimit.masonry.walls import (
    random_wall,
    rubble_wall,
    running_bond,
    single_block,
    stack,
    wall,
)

__all__ = [
    "BUILTIN",
    "Arch",
    "BuiltinScene",
    "Opening",
    "arch",
    "arch_on_piers",
    "barrel_vault",
    "bridge",
    "builtin_scene",
    "dam",
    "dome",
    "facade",
    "flying_buttress",
    "house_corner",
    "panel",
    "random_wall",
    "retaining_wall",
    "rubble_wall",
    "running_bond",
    "single_block",
    "stack",
    "wall",
]
