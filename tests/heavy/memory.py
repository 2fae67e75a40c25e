"""Memory stays flat over 1,000 solves (a minute): ``pytest tests/heavy/memory.py``.

After 100 solves everything that is kept is there; what 900 more add is less than 1 kB each. Seen:
a few MB in all, from allocators that do not give pages back.
"""

from __future__ import annotations

from cvxlimit import solve
from cvxlimit.masonry import random_wall


def resident() -> float:
    """Resident memory of this process, MB (Linux)."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


def test_a_thousand_solves_leave_nothing_behind() -> None:
    scenes = [random_wall(seed) for seed in range(10)]
    for k in range(100):
        solve(scenes[k % 10])
    before = resident()
    for k in range(900):
        solve(scenes[k % 10])
    assert resident() - before < 15.0
