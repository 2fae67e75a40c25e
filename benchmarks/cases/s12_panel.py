"""The S12-class panel: one return, 313 blocks, 886 contacts. There the octagon is 1.4 % off."""

from benchmarks.cases import Case
from cvxlimit.masonry import builtin_scene
from cvxlimit.scene import Scene


def build(contacts: int) -> Scene:
    """There is one size only."""
    return builtin_scene("s12-panel")


CASE = Case("s12-panel", "S12-class panel", build, sizes=(886,), study=(886,))
