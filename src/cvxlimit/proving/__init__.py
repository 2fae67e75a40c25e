"""Results, domains, paths and sweeps, proved again.

To read: ``prove.py``, the call and its door; ``solutions.py``, a result; ``derived.py``, what it
says beside its bounds. Extensions prove their formats by these: ``paths``, ``studies``.
"""
