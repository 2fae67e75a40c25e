"""Results, domains, paths and sweeps, proved again.

To read: ``prove.py``, the call and its door; ``solutions.py``, a result; ``again.py``, its bounds
from forces and mechanism; ``claims.py``, what it says against these. The walk over what is held is
:func:`cvxlimit.proof.checks.compared`. Extensions prove their formats by these: ``paths``,
``studies``.
"""
