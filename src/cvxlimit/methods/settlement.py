"""Settlement: the least and the largest reaction of supports that move, and its mechanism.

Supports that move in proportion to given rates w (6 per support) are taken as blocks without weight
on a guide: together they have one degree of freedom, and their reaction R is the one generalised
force along w that holds them. Forces that carry the dead load with all supports in place have some
reaction R0, which is possible. From there a push of one along w is the live load of a limit
problem of the guided scene, with s = 1 for the least reaction and s = -1 for the largest:

    max alpha   subject to   A x + f_dead + (s alpha - R0) w / (w . w) = 0,   R = R0 - s alpha.

Its mechanism is that of the settlement, and its bracket that of the reaction.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import EPSILON, FloatArray
from cvxlimit.base.progressbar import Progress
from cvxlimit.errors import InputError, ModelError
from cvxlimit.methods.convex import Convex, ConvexSearch
from cvxlimit.methods.driver import Run, drive, packed
from cvxlimit.methods.solving import check
from cvxlimit.model.assemblage import Assemblage, Balance
from cvxlimit.model.statics import DOF, Scaling, Statics
from cvxlimit.scene import Scene, check_scene
from cvxlimit.scene.loads import Load
from cvxlimit.scene.settling import SupportMotion, check_motions
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import TOLERANCE, Bracket
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import SurfaceName

_LEAST, _LARGEST = "least", "largest"


@dataclass(frozen=True, eq=False)
class SupportReaction:
    """What moving supports carry.

    Attributes
    ----------
    value : float or None
        Force with which the supports resist being moved along the direction: positive where they
        are pushed that way. For a rotation without a direction it is their moment about its axis;
        with both, the work per length of the translation. None where there is none.
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
    support: str | Sequence[str] | SupportMotion | Sequence[SupportMotion] | None = None,
    direction: ArrayLike | None = None,
    which: str = _LEAST,
    surface: SurfaceName | Cone | Sequence[YieldSurface] = "conic",
    tolerance: float = TOLERANCE,
    progress: Progress = None,
    *,
    rotation: ArrayLike = (0.0, 0.0, 0.0),
    about: ArrayLike | None = None,
) -> SupportReaction:
    """Least or largest reaction of supports that move in a given way, under the dead load.

    They are taken as blocks that a guide lets move in this way only, all by the same amount. The
    least reaction is what remains of it while they settle; the largest what pushes them back.

    Parameters
    ----------
    scene : Scene
        Its live load does not matter.
    support : str, sequence of str, SupportMotion, sequence of SupportMotion, optional
        Ids of the supports that move as one rigid body; or motions, of several such bodies that
        move in proportion. Unless given, the scene's own (``scene.settling``). Contacts between
        supports do not count.
    direction : (3,)
        Of the movement; its length does not matter. With a rotation, the movement of ``about``.
    which : {"least", "largest"}
    surface, tolerance, progress
        As for :func:`cvxlimit.solve`; the tolerance is relative to the distance between the
        reaction and a possible one.
    rotation, about : (3,), optional
        As for :class:`~cvxlimit.SupportMotion`.

    Raises
    ------
    InputError
        If there is no such support, or no motion.
    ModelError
        For contacts with strengths, and reactions that push at least so much.

    Example
    -------
    >>> from cvxlimit import Block
    >>> piers = [Block.box(f"p{i}", (x, 0, -1), (x + 0.2, 1, 0)) for i, x in enumerate((0, 0.8))]
    >>> beam = Block.box("beam", (0, 0, 0), (1, 1, 0.2), density=10.0)
    >>> scene = Scene([*piers, beam], ["p0", "p1"], Load(acceleration=(1, 0, 0)))
    >>> round(settlement(scene, "p1", (0, 0, -1)).value, 6)  # turns about the edge of p0
    0.75

    The pier turns about its inner edge; at most half of the beam's weight acts at its outer one:

    >>> turned = settlement(scene, "p1", which="largest", rotation=(0, 1, 0), about=(0.8, 0, 0))
    >>> round(turned.value, 6)
    0.2
    """
    check_scene(scene)
    if which not in (_LEAST, _LARGEST):
        raise ModelError(f"which must be least or largest, got {which!r}")
    motions = _motions(scene, support, direction, rotation, about)
    run, method = Run(scene, surface, progress=progress), Convex(tolerance)
    check("settlement", run, ("cohesion", "reactions"))
    search = ConvexSearch(run, "full")
    falls = search.dead_load_is_unstable()
    state = None if falls else search.certifier.references.dead_state
    kind = "reaction" if any(motions[0].direction) else "moment"
    quantity = quantity_of(which, kind, (name for each in motions for name in each.supports))
    if state is None:
        if not falls:
            run.remarks = ["with all supports in place, whether the dead load stands is open"]
        status = Status.DEAD_LOAD_UNSTABLE if falls else Status.NOT_CERTIFIED
        solution = replace(packed(method, run, status), quantity=quantity)
        return SupportReaction(None, solution.bracket, solution)
    sign = 1.0 if which == _LEAST else -1.0
    rates = _rates(scene, motions)
    aside, possible = guided(scene, rates, sign, state)
    solution = drive(method, Run(aside, surface, progress=progress))
    solution = replace(solution, solved_scene=scene, quantity=quantity)
    return _reaction(solution, rates, possible, sign)


def _motions(
    scene: Scene, support: Any, direction: Any, rotation: ArrayLike, about: ArrayLike | None
) -> tuple[SupportMotion, ...]:
    """One motion of the ids given, or those given, or the scene's own; checked."""
    if isinstance(support, SupportMotion):
        support = [support]
    listed = (support,) if isinstance(support, str) else support
    motions = tuple(scene.settling if support is None else listed)
    if not motions:
        raise InputError(
            f"scene {scene.name!r} says nothing of supports that move: name one of "
            f"{', '.join(scene.supports)}, and its direction"
        )
    if not all(isinstance(each, SupportMotion) for each in motions):
        way = (0.0, 0.0, 0.0) if direction is None else direction
        motions = (SupportMotion(motions, way, rotation, about),)  # type: ignore[arg-type]
    elif direction is not None or about is not None or np.any(rotation):
        raise InputError("direction, rotation and about are the motions' own: leave them out")
    check_motions(motions, scene.supports, scene.name)
    return motions


def _reaction(
    solution: Solution, motion: Mapping[str, FloatArray], possible: float, sign: float
) -> SupportReaction:
    """Returns the reaction that the limit problem's solution stands for, R = R0 - s alpha, with its
    bracket turned round accordingly, and the rates of the moving supports in the mechanism."""
    bracket = (solution.bracket.turned if sign > 0.0 else solution.bracket).shifted(possible)
    value = None if solution.load_factor is None else possible - sign * solution.load_factor
    if solution.mechanism is not None:  # rounding apart, supports move along the guide only
        rates = dict(solution.mechanism)
        by = sum(float(way @ rates[name]) for name, way in motion.items())
        by /= sum(float(way @ way) for way in motion.values())
        rates |= {name: by * way for name, way in motion.items()}
        solution = replace(solution, mechanism=rates)
    return SupportReaction(value, bracket, replace(solution, load_factor=value, bracket=bracket))


def _rates(scene: Scene, motions: Sequence[SupportMotion]) -> dict[str, FloatArray]:
    """Returns the rates w (6,) of every support that moves, in the unit of the first motion."""
    block, size = {block.id: block for block in scene.blocks}, motions[0].size
    return {x: each.rates(block[x]) / size for each in motions for x in each.supports}


def quantity_of(which: str, kind: str, supports: Iterable[str]) -> str:
    """What a load factor is that is a reaction: ``"least reaction of a, b"``, ``kind`` being a
    ``"reaction"`` or a ``"moment"``, of the ``supports`` in the order of their motions."""
    return f"{which} {kind} of {', '.join(supports)}"


def guided(
    scene: Scene, rates: Mapping[str, FloatArray], sign: float, state: FloatArray
) -> tuple[Assemblage, float]:
    """The scene with supports on a guide that leaves them their ``rates`` alone, pushed with
    ``sign`` from the reaction R0 that the ``state`` (n, 6) has, contact forces that carry the dead
    load with all supports in place; and that reaction."""
    place = {block.id: i for i, block in enumerate(scene.blocks)}
    whole = sum(float(way @ way) for way in rates.values())  # w . w
    # These supports as free blocks, and the push as live load, which does work 1 on w.
    blocks = list(scene.blocks)
    for name in rates:
        block = blocks[place[name]]
        weight = EPSILON * scene.total_weight / (len(rates) * block.volume)
        blocks[place[name]] = replace(block, density=weight)
    others = tuple(key for key in scene.supports if key not in rates)
    push = Load(forces={name: tuple(sign * way / whole) for name, way in rates.items()})
    free = scene._copy(blocks=tuple(blocks), supports=others, live=push, settling=())
    # The reaction R0: the work of the state's forces on w.
    statics = Statics.of(free)
    every = np.zeros((len(free.free), DOF))
    for name, way in rates.items():
        every[statics.row_of_block[place[name]]] = way
    possible = float(every.ravel() @ (statics.matrix @ state.ravel()))
    # R0 as a dead load that holds the supports; a guide leaves them the motion along w alone.
    own = {key: force for key, force in scene.dead.forces.items() if key not in rates}
    held = {name: tuple(-possible * way / whole) for name, way in rates.items()}
    free = free.with_dead(replace(scene.dead, forces=own | held))
    statics = Statics.of(free).guided(every)
    return Assemblage(free, statics, Scaling.of(free), Balance.of(statics)), possible
