"""The pair of problems on displaced blocks: points with gaps, and slips since a step began.

Between points with gap g and slip tau an increment d of the displacements, on which the live load
does the work Delta, makes of both what opening o and slip s of the points add. With forces n, v

    Phi(x, d) = sum n (g + o) + mu n |tau + s| + v . (tau + s)

is the loss of :mod:`.pair`, never negative, and zero where d is one without dilatancy. Prices are
gaps that are wider by mu |tau + s|; friction held is |v| <= mu n' at the last forces' n'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, ratio
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.dilatancy.pair import ladder
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import ForceModel, compressions_at, friction_at
from cvxlimit.model.goals import Stated
from cvxlimit.model.problem import LimitProblem
from cvxlimit.model.statics import DOF
from cvxlimit.scene import Scene
from cvxlimit.solvers import LimitState
from cvxlimit.surfaces import Rocking
from cvxlimit.surfaces.base import CONSTANT, product, times


@dataclass(frozen=True, eq=False)
class Increment:
    """Forces at k points, an increment of the displacements, and what they lose.

    Attributes
    ----------
    load_factor : float
    forces : (k, 3) array
        V1, V2 and N at the points, along the axes of their contacts.
    displacement : (free blocks, 6) array
        Translations and rotations, on which the live load does the work asked for.
    moved : (k, 3) array
        Slip and opening that they add at the points.
    loss : float
        Phi, a work: what is missing of a solution. Forces are in equilibrium and within friction;
        displacements overrun no point, to the tolerance of solvers.
    """

    load_factor: float
    forces: FloatArray
    displacement: FloatArray
    moved: FloatArray
    loss: float


def increment(
    scene: Scene | Assemblage,
    push: float,
    gap: FloatArray,
    slip: FloatArray,
    tolerance: float = 1e-6,
    pairs: int = 20,
) -> Increment:
    """Forces and displacements without dilatancy of a configuration, and their loss.

    Parameters
    ----------
    scene : Scene or Assemblage
        Blocks and loads where they are now. Points are the corners of its contacts, in their order;
        a contact of one corner is a point. Friction acts at every point by itself; there is no
        cohesion.
    push : float
        Work, above 0, that the live load has yet to do: a force times a length.
    gap : (k,) array
        Distances by which points are open; negative where they are overrun.
    slip : (k, 2) array
        Of block b against block a since the step began, along both axes of the contact.
    tolerance : float
        Loss at which it ends, over the work ``push`` times the load factor, or of the gaps' size.
    pairs : int
        Most pairs of problems; the loss never rises from one to the next.

    Raises
    ------
    ModelError
        For a push that is not positive, arrays of another shape, and where a problem has no answer:
        no such increment exists, or nothing bounds the load factor.

    Example
    -------
    A block that slides on the ground: it does not open, and the load factor is that of friction.

    >>> from cvxlimit.masonry import single_block
    >>> scene = single_block((1.0, 1.0, 0.5), friction=0.6)
    >>> found = increment(scene, 1.0, np.zeros(4), np.zeros((4, 2)))
    >>> round(found.load_factor, 5), bool(abs(found.moved[:, 2]).max() < 1e-6)
    (0.6, True)
    """
    ratio(tolerance, "tolerance")
    count(pairs, 1, "pairs")
    body = Assemblage.of(scene)
    k = len(body.contacts.corner_contact)
    if not (np.isfinite(push) and push > 0.0):
        raise ModelError(f"push must be a number above 0, got {push!r}")
    for name, given, shape in (("gap", gap, (k,)), ("slip", slip, (k, 2))):
        if np.shape(given) != shape:
            raise ModelError(f"{name} must have shape {shape}, got {np.shape(given)}")
    friction = body.contacts.friction[body.contacts.corner_contact]
    unit, length = body.scaling.force, body.scaling.length
    wider, held = cp.Parameter(k, value=np.zeros(k)), cp.Parameter(k, value=np.zeros(k))

    def stated(found: Stated, price: Any) -> Any:
        work = body.scaling.load_factor(1.0) * push / (unit * length) * found.factor
        given = (("n", price), *((f"v{i + 1}", slip[:, i] / length) for i in (0, 1)))
        return work - sum(np.ones(k) @ times(lack, found.forces[name]) for name, lack in given)

    def model(contacts: Contacts, resistance: dict[str, Any]) -> ForceModel:
        at, xy = contacts.corner_contact, contacts.corner_xy
        parts, coulomb = friction_at(at, xy, resistance)
        return ForceModel(contacts, [compressions_at(at, xy), *parts], [coulomb])

    def solved(problem: LimitProblem) -> tuple[LimitState, FloatArray, FloatArray]:
        for settings in ladder(0.01 * tolerance):
            state = problem.run(settings)
            if state.mechanism is not None and state.internal is not None:
                moves = state.mechanism * (body.scaling.live * length)
                return state, state.internal.reshape(3, k).T[:, [1, 2, 0]], moves
        raise ModelError(f"no increment without dilatancy: {state.outcome.status}")

    coulomb = LimitProblem(
        body, [Rocking()], formulation=lambda c: model(c, {"n": friction}),
        goal=lambda found: stated(found, wider),
    )  # fmt: skip
    tresca = LimitProblem(
        body, [Rocking()], formulation=lambda c: model(c, {CONSTANT: product(friction, held)}),
        goal=lambda found: stated(found, gap / length),
    )  # fmt: skip
    at_points = tresca.model.resultant_map
    best: Increment | None = None
    # As if every point slid as far as the load goes: without, blocks that wedge each other have no
    # load factor, since their slip would have to open what cannot open.
    live = np.linalg.norm(body.statics.live.reshape(-1, DOF)[:, :3], axis=1).sum()
    slides = np.linalg.norm(slip, axis=1) + (push / live if live > 0.0 else 0.0)
    for _ in range(pairs):
        wider.value = (gap + friction * slides) / length
        state, forces, _ = solved(coulomb)
        compression = np.maximum(forces[:, 2], 0.0)
        held.value = compression
        _, _, moves = solved(tresca)
        rates = body.statics.relative_rates(moves).ravel()
        moved = (at_points.T @ rates).reshape(3, k).T[:, [1, 2, 0]]
        slides, opens = np.linalg.norm(slip + moved[:, :2], axis=1), gap + moved[:, 2]
        lost = forces[:, 2] * opens + friction * compression * slides
        lost += (forces[:, :2] * (slip + moved[:, :2])).sum(axis=1)
        factor, loss = float(state.load_factor or 0.0), float(np.abs(lost).sum())
        if best is None or loss < best.loss:
            best = Increment(factor, forces, moves, moved, loss)
        if loss <= tolerance * max(abs(factor) * push, float(np.abs(gap) @ compression)):
            break
    assert best is not None
    return best
