"""Generators of masonry scenes, and the built-in scenes.

Each generator takes sizes in the user's units (m and kN by default) and returns a
:class:`~cvxlimit.scene.Scene`: :func:`wall` with :func:`running_bond`, :func:`panel`,
:func:`arch`, :func:`stack` and :func:`single_block`. Named scenes live in
:mod:`cvxlimit.masonry.builtin`: that is where to add the next one.
"""

from cvxlimit.masonry.arches import arch
from cvxlimit.masonry.builtin import BUILTIN, BuiltinScene, builtin_scene
from cvxlimit.masonry.panels import panel
from cvxlimit.masonry.stacks import single_block, stack
from cvxlimit.masonry.walls import running_bond, wall

__all__ = [
    "BUILTIN",
    "BuiltinScene",
    "arch",
    "builtin_scene",
    "panel",
    "running_bond",
    "single_block",
    "stack",
    "wall",
]
