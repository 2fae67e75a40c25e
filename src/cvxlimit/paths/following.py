"""The path of a structure in finite displacements: steps of the live load's mean displacement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from cvxlimit.paths.path import Path
from cvxlimit.scene import Scene


def pushover(
    scene: Scene,
    step: float | None = None,
    until: float = 0.0,
    flow: Literal["associated"] = "associated",
    control: tuple[str, Sequence[float]] | None = None,
    certify: Literal["all", "last", "none"] = "all",
    reach: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> Path:
    """The path of a structure after its collapse load factor."""
    raise NotImplementedError
