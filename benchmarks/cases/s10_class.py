"""An S10-class panel: two returns, 663 blocks, 1,902 contacts. There rocking decides.

As many blocks and contacts as the paper's specimen, which is the built-in ``s10-panel``; kept
because every figure on speed was measured on it.
"""

from benchmarks.cases import Case
from cvxlimit.masonry import panel
from cvxlimit.scene import Scene


def build(contacts: int = 1_902) -> Scene:
    """There is one size only."""
    return panel(0.88, 34, left_return=0.36, right_return=0.36, name="s10-class")


CASE = Case("s10-class", "S10-class panel", build, sizes=(1_902,), study=(1_902,))
