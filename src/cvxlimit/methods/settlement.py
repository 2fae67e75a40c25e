"""Settlement: the least and the largest reaction of a support that moves, and its mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector
from cvxlimit.errors import InputError, ModelError
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.convex_search import TOLERANCE, ConvexSearch
from cvxlimit.methods.driver import Progress, Run, drive, packed
from cvxlimit.methods.table import check
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.scene import Scene, check_scene
from cvxlimit.scene.loads import Load
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import Bracket
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import SurfaceName

_NO_WEIGHT = 1e-14
"""Weight of the moving support over that of all blocks: its own does not count."""

_LEAST, _LARGEST = "least", "largest"


@dataclass(frozen=True, eq=False)
class Reaction:
    """What a moving support carries.

    Attributes
    ----------
    value : float or None
        Force with which the support resists being moved along the direction: positive where it is
        pushed that way. None where there is none.
    bracket : Bracket
        Of the value, recomputed outside the solver.
    solution : Solution
        The same with forces, mechanism, status and history: its ``load_factor`` and bracket are the
        reaction's, its ``quantity`` says so. The history's load factors are those of the limit
        problem behind it: changes of the reaction from one that is possible.
    """

    value: float | None
    bracket: Bracket
    solution: Solution


def settlement(
    scene: Scene,
    support: str,
    direction: ArrayLike,
    which: str = _LEAST,
    surface: SurfaceName | Cone | Sequence[YieldSurface] = "conic",
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
) -> Reaction:
    """Least or largest reaction of a support that moves along a direction, under the dead load.

    The support is taken as a block that its guide lets move along the direction only. The least
    reaction is what remains of it while it settles; the largest what pushes it back.

    Parameters
    ----------
    scene : Scene
        Its live load does not matter.
    support : str
        Id of the support that moves; its contacts with other supports do not count.
    direction : (3,)
        Of the movement; its length does not matter.
    which : {"least", "largest"}
    surface, tolerance, progress
        As for :func:`cvxlimit.solve`; the tolerance is relative to the distance between the
        reaction and a possible one.

    Raises
    ------
    InputError
        If there is no such support, or the direction is none.
    ModelError
        For ties and contacts with strengths.

    Example
    -------
    >>> from cvxlimit import Block
    >>> piers = [Block.box(f"p{i}", (x, 0, -1), (x + 0.2, 1, 0)) for i, x in enumerate((0, 0.8))]
    >>> beam = Block.box("beam", (0, 0, 0), (1, 1, 0.2), density=10.0)
    >>> scene = Scene([*piers, beam], ["p0", "p1"], Load(acceleration=(1, 0, 0)))
    >>> round(settlement(scene, "p1", (0, 0, -1)).value, 6)  # turns about the edge of p0
    0.75
    """
    check_scene(scene)
    if which not in (_LEAST, _LARGEST):
        raise ModelError(f"which must be least or largest, got {which!r}")
    if support not in scene.supports:
        raise InputError(
            f"{support!r} is no support of scene {scene.name!r}: {', '.join(scene.supports)} are"
        )
    vector = finite_vector(direction, 3, "direction of the settlement")
    if not np.any(vector):
        raise InputError("direction of the settlement must not be zero")
    along = vector / np.linalg.norm(vector)
    run, method = Run(scene, surface, progress=progress), Convex(tolerance)
    check("settlement", run, ("cohesion",))
    search = ConvexSearch(run, "full")
    falls = search.dead_load_falls()
    state = None if falls else search.certifier.witnesses.dead_state
    quantity = f"{which} reaction of {support}"
    if state is None:
        if not falls:
            run.remarks = ["with all supports in place, whether the dead load stands is open"]
        status = Status.DEAD_LOAD_UNSTABLE if falls else Status.NOT_CERTIFIED
        solution = replace(packed(method, run, status), quantity=quantity)
        return Reaction(None, solution.bracket, solution)
    sign = 1.0 if which == _LEAST else -1.0
    guided, possible = _guided(scene, support, along, sign, state)
    solution = drive(method, Run(guided, surface, progress=progress))
    solution = replace(solution, solved_scene=scene, quantity=quantity)
    return _reaction(solution, support, along, possible, sign)


def _reaction(
    solution: Solution, support: str, along: FloatArray, possible: float, sign: float
) -> Reaction:
    found = solution.bracket
    low, high = possible - sign * found.upper, possible - sign * found.lower
    proofs = (found.upper_is_proved, found.lower_is_proved)
    if sign < 0.0:
        low, high, proofs = high, low, proofs[::-1]
    bracket = Bracket(low, high, *proofs, found.least)
    factor = solution.load_factor
    value = None if factor is None else possible - sign * factor
    if solution.mechanism is not None:
        rates = dict(solution.mechanism)
        rates[support] = np.append(along * (along @ rates[support][:3]), np.zeros(3))
        solution = replace(solution, mechanism=rates)
    return Reaction(value, bracket, replace(solution, load_factor=value, bracket=bracket))


def _guided(
    scene: Scene, support: str, along: FloatArray, sign: float, state: FloatArray
) -> tuple[Assemblage, float]:
    at = [block.id for block in scene.blocks].index(support)
    weight = _NO_WEIGHT * scene.total_weight / scene.blocks[at].volume
    blocks = tuple(replace(b, density=weight) if b.id == support else b for b in scene.blocks)
    others = tuple(key for key in scene.supports if key != support)
    push = Load(forces={support: (*(sign * along), 0.0, 0.0, 0.0)})
    free = scene._copy(blocks=blocks, supports=others, live=push)
    statics = Statics.of(free)
    row = int(statics.row_of_block[at])
    pushed = (statics.matrix @ state.ravel()).reshape(-1, DOF)[row, :3]
    possible = float(pushed @ along)
    own = {key: force for key, force in scene.dead.forces.items() if key != support}
    held = replace(scene.dead, forces={**own, support: (*(-possible * along), 0.0, 0.0, 0.0)})
    free = free.with_dead(held)
    statics = Statics.of(free).guided(row, along)
    return Assemblage(free, statics, Scaling.of(free), Balance.of(statics)), possible
