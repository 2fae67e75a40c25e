"""Studies of many scenes: sweeps over parameters, random draws, fragility curves.

:func:`sweep` solves all variations of a structure in one call and returns a table;
:func:`fragility` makes a curve with a confidence band of one whose parameters were drawn at random.
"""

from cvxlimit.studies.fragility import Fragility, fragility
from cvxlimit.studies.store import read_sweep
from cvxlimit.studies.sweeping import sweep
from cvxlimit.studies.variations import draws, varied

__all__ = ["Fragility", "draws", "fragility", "read_sweep", "sweep", "varied"]
