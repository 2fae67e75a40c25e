"""What ``cvxlimit explain`` shows."""

from __future__ import annotations

from rich.text import Text

from cvxlimit.io.fields import one_line
from cvxlimit.reductions.explaining import explain
from cvxlimit.scene import Scene


def explanation(scene: Scene, surface: str, model: str) -> Text:
    """Sizes of the models, the solver and why, and the expected time, line by line."""
    found = explain(scene, surface, model=model)
    title, *lines = str(found).splitlines()
    return Text("\n".join([one_line(title), *lines]))
