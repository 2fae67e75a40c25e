"""An S12-class panel: one return, 313 blocks, 886 contacts. There the octagon is 1.4 % off.

Close to the paper's specimen, which is the built-in ``s12-panel``; kept because every figure on
speed was measured on it.
"""

from benchmarks.cases import Case
from cvxlimit.masonry import panel
from cvxlimit.scene import Scene


def build(contacts: int = 886) -> Scene:
    """There is one size only."""
    return panel(0.80, 19, left_return=0.52, name="s12-class")


CASE = Case("s12-class", "S12-class panel", build, sizes=(886,), study=(886,))
