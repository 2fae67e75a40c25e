"""The methods of the atlas: surfaces, formulations and solvers, and the literal transcription.

Two kinds: *raw* ones believe the solver's status, as one does who writes down the problem and calls
``solve``; *checked* ones are ours with one solver, whose answer has to pass the certificate.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from benchmarks.baselines import program, written
from benchmarks.stability.families.sample import FALLS, HARMLESS
from benchmarks.stability.outcomes import Claim, claim_of
from benchmarks.stability.truths import arm
from cvxlimit.errors import CvxlimitError
from cvxlimit.methods.solving import solve
from cvxlimit.model.formulations import corner_compressions, resultants, vertex_forces
from cvxlimit.scene import Scene
from cvxlimit.solvers import installed
from cvxlimit.surfaces import Rocking


@dataclass(frozen=True)
class Method:
    """A method: a name, what it solves, and how it answers.

    ``surface`` names the model whose load factor it claims: claims are held against references of
    that model only.
    """

    name: str
    surface: str
    claims: Callable[[Scene], Claim]


_CLAIMS = {"infeasible": FALLS, "unbounded": HARMLESS}
"""What CVXPY's status says about a limit problem: no forces at all, or no limit to the load."""


def literal_problem(scene: Scene, surface: str) -> cp.Problem:
    """The paper's problem as one writes it down, in the user's units."""
    data = program(scene)
    arms = [arm(data.contacts.corners_of(j)) for j in range(len(data.contacts))]
    return written(data, np.array(arms), surface)


def believed(problem: cp.Problem, solver: str) -> Claim:
    """A solver's own word about a problem, with the settings CVXPY gives it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            problem.solve(solver=solver)
        except (cp.SolverError, ValueError, ArithmeticError, KeyError, RuntimeError) as error:
            return Claim(None, type(error).__name__)
    status = str(problem.status)
    if status == "optimal":
        return Claim(float(problem.value), status)
    return Claim(_CLAIMS.get(status), status)


def _literal(surface: str, solver: str) -> Method:
    def claims(scene: Scene) -> Claim:
        return believed(literal_problem(scene, surface), solver)

    return Method(f"raw/{surface}/{solver}", surface, claims)


FORMULATIONS = {
    "corners": corner_compressions,
    "resultants": resultants,
    "vertex forces": vertex_forces,
}


def _checked(surface: str, formulation: str, solver: str) -> Method:
    def claims(scene: Scene) -> Claim:
        own = [Rocking()] if formulation == "vertex forces" else surface
        try:
            return claim_of(
                solve(scene, own, formulation=FORMULATIONS[formulation], ladder=[solver])
            )
        except CvxlimitError as error:
            return Claim(None, type(error).__name__)

    model = formulation if formulation == "vertex forces" else surface
    return Method(f"checked/{model}/{formulation}/{solver}", model, claims)


CONIC, LINEAR = ("CLARABEL", "SCS", "CVXOPT", "QOCO"), ("HIGHS", "GLPK", "SCIPY", "OSQP")


def methods() -> list[Method]:
    """All of them, as far as their solvers are installed."""
    have = [s for s in (*CONIC, *LINEAR) if s in installed()]
    result = [_literal("octagon", s) for s in have]
    result += [_literal("conic", s) for s in have if s in CONIC]
    result += [_checked("conic", "corners", s) for s in (*have[:4], "BLOCKWISE")]
    result += [_checked("octagon", "corners", s) for s in (*have, "BLOCKWISE") if s != "OSQP"]
    result += [_checked("conic", "resultants", s) for s in have if s in CONIC]
    result += [_checked("conic", "vertex forces", s) for s in ("CLARABEL", "QOCO", "SCS")]
    return result
