"""The version of this package, and those of whatever computed an answer."""

from collections.abc import Iterable

__version__ = "0.2.0.dev0"

_DISTRIBUTIONS = {
    "COPT": "coptpy",
    "GLOP": "ortools",
    "GLPK": "cvxopt",
    "GLPK_MI": "cvxopt",
    "GUROBI": "gurobipy",
    "HIGHS": "highspy",
    "PDLP": "ortools",
    "RESCALED": "clarabel",
    "SCIP": "pyscipopt",
}
"""Distributions of solvers, by CVXPY's name, that are not called like the solver."""


def versions(solvers: Iterable[str]) -> dict[str, str]:
    """Versions by distribution: cvxlimit, CVXPY and ``solvers``, which are named as CVXPY does.

    BLOCKWISE is part of cvxlimit. What is not installed as a distribution is ``"unknown"``.

    >>> list(versions(["HIGHS", "CLARABEL", "BLOCKWISE"]))
    ['cvxlimit', 'cvxpy', 'blockwise', 'clarabel', 'highspy']
    """
    from importlib.metadata import PackageNotFoundError, version  # 20 ms that --help can do without

    found = {"cvxlimit": __version__}
    names = sorted({_DISTRIBUTIONS.get(name, name.lower()) for name in solvers})
    for name in ("cvxpy", *names):
        try:
            found[name] = __version__ if name == "blockwise" else version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
