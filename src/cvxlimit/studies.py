"""Studies of many scenes: sweeps over parameters, random draws, load domains.

:func:`sweep` solves all variations of a structure in one call and returns a table; :func:`draws`
draws variations at random, and :func:`fragility` counts how many of them fall.
:func:`load_domain` encloses all load vectors that a structure carries, :func:`envelope` solves for
a vehicle at every position. What they return is a table or has one, ``to_dataframe()``.
:func:`prove` checks what was stored from the forces and mechanisms in it.
"""

from cvxlimit.extensions import studies as _extension  # noqa: F401 - which is told if missing
from cvxlimit.extensions.studies.domains.comparing import DomainComparison, compare_domains
from cvxlimit.extensions.studies.domains.document import read_domain, write_domain
from cvxlimit.extensions.studies.domains.domain import LoadDomain
from cvxlimit.extensions.studies.domains.search import load_domain
from cvxlimit.extensions.studies.domains.supports import Support
from cvxlimit.extensions.studies.envelopes import Envelope, Vehicle, envelope
from cvxlimit.extensions.studies.fragility import Fragility, fragility
from cvxlimit.extensions.studies.store import read_sweep
from cvxlimit.extensions.studies.sweeping import sweep
from cvxlimit.extensions.studies.variations import draws, varied
from cvxlimit.proof.checks import Check
from cvxlimit.proving.prove import Proof, prove

__all__ = [
    "Check", "DomainComparison", "Envelope", "Fragility", "LoadDomain", "Proof", "Support",
    "Vehicle", "compare_domains", "draws", "envelope", "fragility", "load_domain", "prove",
    "read_domain", "read_sweep", "sweep", "varied", "write_domain",
]  # fmt: skip
