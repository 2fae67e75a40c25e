"""What SCENE on the command line means: a built-in name or a file."""

from __future__ import annotations

import difflib
import os
from pathlib import Path

from cvxlimit.errors import InputError
from cvxlimit.io import read_scene
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.scene import Scene


def scene_named(name: str) -> Scene:
    """The scene of a built-in name, which wins, or of a file.

    Raises
    ------
    InputError
        If there is neither, or the file is no valid scene.
    """
    if name in BUILTIN:
        return builtin_scene(name)
    looks_like_file = Path(name).suffix or Path(name).name != name
    if looks_like_file or os.path.exists(name):
        return read_scene(name)
    close = difflib.get_close_matches(name, BUILTIN, n=1)
    cure = f"did you mean {close[0]!r}?" if close else "cvxlimit scenes lists the built-in ones"
    raise InputError(f"there is no built-in scene and no file {name!r}; {cure}")
