"""Speed against accuracy: ``python -m benchmarks run`` runs the suite, draws its charts.

One case per file in ``cases/``; methods come from :mod:`cvxlimit.compare.registry`, and what a
user would write without the package from :mod:`benchmarks.baselines`.
"""
