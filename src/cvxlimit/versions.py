"""The version of this package, and those of whatever computed an answer."""

from collections.abc import Iterable
from functools import cache

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
    names = sorted({_DISTRIBUTIONS.get(name, name.lower()) for name in solvers})
    return {"cvxlimit": __version__} | {name: _version(name) for name in ("cvxpy", *names)}


@cache  # reading it takes 1 ms, and a sweep asks for every row
def _version(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # 20 ms that --help can do without

    try:
        return __version__ if name == "blockwise" else version(name)
    except PackageNotFoundError:
        return "unknown"
