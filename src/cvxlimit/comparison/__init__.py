"""Speed against accuracy: a registry of methods, isolated runs, references, charts.

:func:`cvxlimit.compare.compare` is the front door for a user's own scene; ``benchmarks/`` runs the
same methods over scenes of growing size. To add a method, write a line into
:func:`~cvxlimit.comparison.registry.registry`.
"""
