"""What a load factor gains per unit of all that it rests on; see :mod:`.derivatives` for how."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray
from cvxlimit.base.attached import attached
from cvxlimit.base.checks import meant
from cvxlimit.base.markup import html_table
from cvxlimit.errors import InputError
from cvxlimit.readings.derivatives import (
    JOINTS,
    ByLoad,
    Proof,
    add_bodies,
    by_joints,
    by_loads,
)
from cvxlimit.readings.utilisation import solved_with
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, Solution
from cvxlimit.solution.bracket import TOLERANCE, rounded_up
from cvxlimit.surfaces import YieldSurface

if TYPE_CHECKING:
    from pandas import DataFrame

NOTHING = 1e-6
"""Of a load factor, what is not worth a word."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """What a load factor gains per unit of everything it rests on; made by
    :meth:`cvxlimit.Solution.sensitivity`.

    Attributes
    ----------
    solution : Solution
    friction, cohesion, compressive_strength, tensile_strength : (n,)
        By those of every contact; 0 by strengths that are infinite.
    weight : (free blocks,)
        By the weight of every free block, which acts at its centroid.
    dead, live : (free blocks, 6)
        By further forces and moments at the centroids, for load factor 1 of the live ones.
    vertices : mapping of block id to (v, 3)
        By the position of every vertex, with what hangs on it: joints, volume, weight at its
        density, centroid, faces under pressure. Where edges of two blocks coincide the joint ends
        at whichever is farther in: either vertex alone has the mean of both sides, and vertices
        that move together the sum.
    shared : mapping of block id to (v,) booleans
        Vertices on such edges.
    loads : tuple of ByLoad
        By every number that the loads are given by.
    one_sided : mapping of name to booleans
        Of ``"friction"``, the other joint values (n,), and ``"vertices"`` (all of them, in order):
        which slopes differ upwards and downwards, as forces that go with the mechanism are not
        unique, or mechanisms are not. What stands here then lies between the two, and
        :meth:`both_sides` has both.
    has_other_mechanisms : bool
        True if the forces allow more than one mechanism: then every slope may be one-sided.

    Example
    -------
    A block that tips, of 1 x 1 x 2.5: only its width and height count, and neither friction nor
    weight:

    >>> from cvxlimit import builtin_scene, solve
    >>> found = solve(builtin_scene("single-block")).sensitivity()
    >>> [abs(round(float(x[0]), 6)) for x in (found.friction, found.weight)]
    [0.0, 0.0]
    """

    solution: Solution
    friction: FloatArray
    cohesion: FloatArray
    compressive_strength: FloatArray
    tensile_strength: FloatArray
    weight: FloatArray
    dead: FloatArray
    live: FloatArray
    vertices: Mapping[str, FloatArray]
    shared: Mapping[str, BoolArray]
    loads: tuple[ByLoad, ...]
    one_sided: Mapping[str, BoolArray]
    has_other_mechanisms: bool

    def __repr__(self) -> str:
        return f"Sensitivity({self.solution.scene_name!r}: {self.note})"

    def __str__(self) -> str:
        return "\n".join(f"{name}: {said}" for name, said in self.rows)

    def _repr_html_(self) -> str:
        return html_table(
            f"Sensitivity of {self.solution.scene_name!r}", ("by", "change"), self.rows
        )

    @property
    def factor(self) -> float:
        """The load factor."""
        return float(self.solution.load_factor or 0.0)

    @property
    def rows(self) -> list[tuple[str, str]]:
        """The most important, as pairs of name and text: what a per cent of friction and other
        values changes, everywhere and where most, and a move of a stone."""
        scene, found = self.solution.scene, list[tuple[str, str]]()
        names = dict.fromkeys(JOINTS, scene.contacts.names)
        names["weight"] = tuple(scene.blocks[i].id for i in scene.free)
        for what, own in names.items():
            by = self.elasticity(what) if self.factor else np.zeros(len(own))
            if np.abs(by).max(initial=0.0) > NOTHING:
                total = by.sum() if abs(by.sum()) > NOTHING * np.abs(by).sum() else 0.0
                found.append((what.replace("_", " "), f"load factor {total:+.3g} % for 1 % more "
                              "everywhere; "
                              f"{_most(by, own, '%')}"))  # fmt: skip
        size, ids = np.linalg.norm(self.moves, axis=1), [block.id for block in scene.blocks]
        if size.max() > 0.0:
            found.append(("moves", f"{_most(size, ids, '')} per {scene.units.length}"))
        return [*found, ("derivatives", self.note)]

    @property
    def is_proved(self) -> bool:
        """True if the solution is certified, with a bracket."""
        return self.solution.status.is_good and self.solution.bracket.has_both

    @property
    def note(self) -> str:
        """What the derivatives rest on, in a sentence."""
        if not self.is_proved:
            return (
                f"the load factor is {self.solution.status}, and so its derivatives are those of "
                "forces and rates that prove nothing"
            )
        width = rounded_up(self.solution.gap, 2)
        said = f"from forces and mechanism that enclose the load factor to {width} of it"
        if self.has_other_mechanisms:
            return f"{said}; other mechanisms have the same one, so that slopes may be one-sided"
        count = sum(int(flags.sum()) for flags in self.one_sided.values())
        if count:
            return (
                f"{said}; {count} slopes differ upwards and downwards, as the forces are not "
                "unique: what is said of one joint lies between the two (both_sides has both)"
            )
        return said

    def both_sides(self, change: Callable[[float], Scene], step: float) -> tuple[float, float]:
        """Slopes downwards and upwards by two solves, where one is not enough.

        Parameters
        ----------
        change : callable
            The scene with something changed by a number, ``lambda d: scene.with_friction(0.5 + d)``
            for example.
        step : float
            By how much: the slopes are those of chords.

        Example
        -------
        Friction decides below 0.4, where the block slides, and above it tips:

        >>> from cvxlimit import builtin_scene, solve
        >>> scene = builtin_scene("single-block").with_friction(0.4)
        >>> found = solve(scene).sensitivity()
        >>> sides = found.both_sides(lambda d: scene.with_friction(0.4 + d), 0.01)
        >>> [round(x, 3) + 0.0 for x in sides]
        [1.0, 0.0]
        """
        solved: tuple[float, float] = attached("sensitivity_sides")(self, change, step)
        return solved

    @cached_property
    def moves(self) -> FloatArray:
        """The derivative by a move of every block (blocks, 3) in the scene's order, its neighbours
        where they were: the sums over its vertices. Where these cancel but for rounding, zero."""
        total = np.array([by.sum(axis=0) for by in self.vertices.values()])
        most = max(float(np.abs(by).sum(axis=0).max()) for by in self.vertices.values())
        return np.where(np.abs(total) > NOTHING * most, total, 0.0)

    def elasticity(self, of: str) -> FloatArray:
        """Per cent of the load factor per per cent of ``"friction"``, the other joint values,
        ``"weight"``, or ``"dead"`` and ``"live"`` forces: shaped as these.

        Raises
        ------
        InputError
            For anything else, and for a load factor of 0, of which there are no per cents.
        """
        scene, factor = self.solution.scene, self.solution.load_factor
        values = {name: getattr(scene.contacts, name) for name in JOINTS}
        values["weight"] = np.array([scene.blocks[i].weight for i in scene.free])
        values |= {"dead": scene.dead_forces, "live": scene.live_forces}
        if of not in values:
            raise InputError(
                f"there is no elasticity of {of!r}: choose one of {', '.join(values)}"
                + meant(of, values, before="; ")
            )
        if not factor:
            raise InputError("a load factor of 0 has no elasticity: take the derivatives")
        by = getattr(self, of)
        return np.asarray(by * np.where(by != 0.0, values[of], 0.0) / factor)

    def to_dataframe(self, what: str = "contacts") -> DataFrame:
        """The derivatives as a table: ``"contacts"``, ``"blocks"``, ``"vertices"`` or ``"loads"``.

        ``table.attrs["units"]`` and ``table.attrs["description"]`` say what each column is,
        ``table.attrs["note"]`` what the derivatives rest on.

        Raises
        ------
        InputError
            For another table.
        ModelError
            If pandas is not installed.

        Example
        -------
        >>> from cvxlimit import builtin_scene, solve
        >>> table = solve(builtin_scene("tuff-wall")).sensitivity().to_dataframe("contacts")
        >>> round(float(table["by_friction"].sum()), 4), table.attrs["units"]["by_cohesion"]
        (0.9816, 'm\u00b2/kN')
        """
        table: DataFrame = attached("sensitivity_table")(self, what)
        return table


def _most(values: FloatArray, names: Sequence[str], unit: str) -> str:
    """The largest of some values, three at most, none below a tenth of the first."""
    order = np.argsort(-np.abs(values), kind="stable")[:3]
    kept = [k for k in order.tolist() if abs(values[k]) >= 0.1 * abs(values[order[0]])]
    said = [f"{names[k]} {values[k]:+.3g} {unit}".rstrip() for k in kept]
    return f"most in {', '.join(said)}"


def sensitivity(solution: Solution) -> Sensitivity:
    """See :meth:`cvxlimit.Solution.sensitivity`."""
    proof = Proof(solution, _checked(solution))
    scene, factor = proof.scene, float(solution.load_factor or 0.0)
    start = np.cumsum([0, *(len(b.vertices) for b in scene.blocks)])
    found, shared = by_joints(proof, start)
    several, other = proof.elsewhere()
    one_sided = {
        name: several | (np.abs(by - found[name]) > TOLERANCE * np.abs(found[name]).max())
        for name, by in by_joints(other, start)[0].items()
    }
    one_sided["vertices"] = one_sided["vertices"].any(axis=1)
    dead, live = (load.per_weight(scene.blocks) for load in (scene.dead, scene.live))
    by_vertex = found.pop("vertices")
    add_bodies(proof, factor, by_vertex, start)
    own, ids = proof.rates[scene.free], [block.id for block in scene.blocks]
    return Sensitivity(
        solution,
        **found,
        weight=-((dead + factor * live)[scene.free] * own).sum(axis=1),
        dead=-own,
        live=-factor * own,
        vertices=dict(zip(ids, np.split(by_vertex, start[1:-1]), strict=True)),
        shared=dict(zip(ids, np.split(shared, start[1:-1]), strict=True)),
        loads=tuple(by_loads(proof, factor)),
        one_sided=one_sided,
        has_other_mechanisms=several,
    )


def _checked(solution: Solution) -> tuple[YieldSurface, ...]:
    """The surfaces; refused where the load factor is not the optimum of one convex problem."""
    why = ""
    if solution.interaction != "none":
        why = "with interaction the load factor is no optimum of one convex problem"
    elif solution.flow != "associated":
        why = "without dilatancy the load factor is one of a set, and no optimum"
    elif solution.torsion_shear == "exact":
        why = "the exact limit of torsion with shear is stated by no surface: take 'parabolic'"
    elif solution.quantity != LOAD_FACTOR:
        why = f"it is about the {solution.quantity}"
    elif "problem" in solution.__dict__ and solution.problem.has_own:
        why = f"it was solved with {solution.problem.said_own}, whose part is not counted"
    elif solution.load_factor is None or solution.forces is None or solution.mechanism is None:
        why = f"it has no load factor with forces and mechanism ({solution.status})"
    if why:
        raise InputError(f"the solution of {solution.scene_name!r} has no derivatives: {why}")
    return solved_with(solution)
