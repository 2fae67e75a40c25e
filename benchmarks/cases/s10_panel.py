"""The S10-class panel: two returns, 663 blocks, 1,902 contacts."""

from benchmarks.cases import Case
from cvxlimit.masonry import builtin_scene
from cvxlimit.scene import Scene


def build(contacts: int) -> Scene:
    """There is one size only."""
    return builtin_scene("s10-panel")


CASE = Case("s10-panel", "S10-class panel", build, sizes=(1_902,), study=(1_902,))
