"""Studies of many scenes or models: sweeps over parameters, random draws, load domains, vehicles,
speed against accuracy.

Its doors are ``cvxlimit.commands`` (``sweep``, ``domain``, ``envelope``, ``compare``),
``cvxlimit.documents`` and ``cvxlimit.proofs``; its public names are those of
:mod:`cvxlimit.studies` and :mod:`cvxlimit.compare`. To read:
``variations.py``, what is varied; ``rows.py``, one row; ``patched.py``, rows that share a problem;
``identity.py`` and ``store.py``, what is kept; ``sweeping.py``, the call, which hands the core's
search (``base/search.py``) its queue; ``fragility.py``, how many draws fall;
``domains``, all load vectors that a structure carries; ``envelopes.py``, a vehicle at every
position; ``models.py``, ``comparison.py`` and
``chart.py``, time against true error; ``command.py``,
``crossing.py`` and ``comparing.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.commands": {
        "compare": "cvxlimit.extensions.studies.comparing:CompareCommand",
        "sweep": "cvxlimit.extensions.studies.command:SweepCommand",
        "envelope": "cvxlimit.extensions.studies.crossing:EnvelopeCommand",
        "domain": "cvxlimit.extensions.studies.domains.command:DomainCommand",
    },
    "cvxlimit.documents": {"domain": "cvxlimit.extensions.studies.domains.document:DOMAIN"},
    "cvxlimit.proofs": {
        "cvxlimit-domain": "cvxlimit.extensions.studies.domains.proving:prove_domain",
        "cvxlimit-sweep": "cvxlimit.extensions.studies.proving:prove_sweep",
    },
}
