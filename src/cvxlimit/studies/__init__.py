"""Studies of many scenes: sweeps over parameters, random draws, fragility curves.

:func:`sweep` solves all variations of a structure in one call and returns a table;
:func:`fragility` makes a curve with a confidence band of one whose parameters were drawn at random.
:func:`load_domain` encloses all load vectors that a structure carries.
"""

from cvxlimit.studies.domains.comparing import DomainComparison, compare_domains
from cvxlimit.studies.domains.document import read_domain, write_domain
from cvxlimit.studies.domains.domain import LoadDomain
from cvxlimit.studies.domains.exploring import explore
from cvxlimit.studies.domains.search import load_domain
from cvxlimit.studies.domains.supports import Support
from cvxlimit.studies.fragility import Fragility, fragility
from cvxlimit.studies.store import read_sweep
from cvxlimit.studies.sweeping import sweep
from cvxlimit.studies.variations import draws, varied

__all__ = [
    "DomainComparison", "Fragility", "LoadDomain", "Support", "compare_domains", "draws",
    "explore", "fragility", "load_domain", "read_domain", "read_sweep", "sweep", "varied",
    "write_domain",
]  # fmt: skip
