"""Studies of many scenes: sweeps over parameters, random draws, load domains, vehicles.

Its doors are ``cvxlimit.commands`` (``sweep``, ``domain``, ``envelope``), ``cvxlimit.readings`` and
``cvxlimit.proofs``; its public names are those of :mod:`cvxlimit.studies`. To read:
``variations.py``, what is varied; ``rows.py``, one row; ``patched.py``, rows that share a problem;
``identity.py`` and ``store.py``, what is kept; ``sweeping.py``, the call, which hands the core's
search (``base/search.py``) its queue; ``domains``, all load vectors that a structure carries;
``envelopes.py``, a vehicle at every position; ``command.py`` and ``crossing.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.commands": {
        "sweep": "cvxlimit.extensions.studies.command:SweepCommand",
        "envelope": "cvxlimit.extensions.studies.crossing:EnvelopeCommand",
        "domain": "cvxlimit.extensions.studies.domains.command:DomainCommand",
    },
    "cvxlimit.documents": {"domain": "cvxlimit.extensions.studies.domains.document:DOMAIN"},
    "cvxlimit.proofs": {
        "cvxlimit-domain": "cvxlimit.extensions.studies.domains.proving:prove_domain",
        "cvxlimit-sweep": "cvxlimit.extensions.studies.proving:prove_sweep",
    },
    "cvxlimit.readings": {
        "scene_explore": "cvxlimit.extensions.studies.domains.exploring:explore",
    },
}
