"""Derivatives of a load factor by everything that it depends on; :mod:`.derivatives` computes
them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray
from cvxlimit.base.checks import check_known
from cvxlimit.base.doors import attached
from cvxlimit.base.markup import html_table
from cvxlimit.errors import InputError
from cvxlimit.methods.solving import solve
from cvxlimit.model.statics import ZERO
from cvxlimit.results.derivatives import (
    JOINTS,
    ByLoad,
    Proof,
    add_bodies,
    by_joints,
    by_loads,
)
from cvxlimit.results.utilisation import solved_with
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, Solution
from cvxlimit.solution.bracket import TOLERANCE, rounded_up
from cvxlimit.surfaces import YieldSurface

if TYPE_CHECKING:
    from pandas import DataFrame

NOTHING = ZERO
"""Share of a load factor below which a change is not mentioned."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of a load factor by everything that it depends on, as
    :meth:`cvxlimit.Solution.sensitivity` returns them.

    All are changes of the load factor per unit of the quantity, in the scene's units.

    Attributes
    ----------
    solution : Solution
        The solution whose load factor is meant.
    friction, cohesion, compressive_strength, tensile_strength : (n,)
        By the property of every contact; 0 for strengths that are infinite.
    most : (n,)
        By the upper bound of every reaction and tie; 0 for other contacts.
    weight : (free blocks,)
        By the weight of every free block, which acts at its centroid.
    dead, live : (free blocks, 6)
        By additional forces fx fy fz and moments mx my mz at the centroids; those of the live load
        are meant at load factor 1.
    vertices : mapping of block id to (v, 3)
        By the position of every vertex, with all that follows from it: joints, volume, weight at
        constant density, centroid, faces under pressure. Where edges of two blocks coincide the
        joint ends at the one that lies farther in: either vertex alone has the mean of both
        one-sided slopes, and vertices that move together have the sum.
    shared : mapping of block id to (v,) booleans
        Vertices on such edges.
    loads : tuple of ByLoad
        By every number with which the loads are stated.
    one_sided : mapping of name to booleans
        For ``"friction"`` and the other joint values (n,), and for ``"vertices"`` (all of them, in
        order): which slopes differ upwards and downwards, because the forces or the mechanism are
        not unique. The value here then lies between the two, and :meth:`both_sides` returns both.
    has_other_mechanisms : bool
        True if the forces allow more than one mechanism: then every slope may be one-sided.

    Example
    -------
    A block of 1 x 1 x 2.5 tips: its width and height matter, friction and weight do not:

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
    most: FloatArray
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
        return "\n".join(f"{name}: {text}" for name, text in self.rows)

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
        """The most important derivatives, as pairs of a name and a text: the change for one per
        cent of friction and other values, everywhere and where it is largest, and for moves of
        blocks."""
        scene, rows = self.solution.scene, list[tuple[str, str]]()
        names = dict.fromkeys(JOINTS, scene.contacts.names)
        names["weight"] = tuple(scene.blocks[i].id for i in scene.free)
        for what, own in names.items():
            by = self.elasticity(what) if self.factor else np.zeros(len(own))
            if np.abs(by).max(initial=0.0) > NOTHING:
                total = by.sum() if abs(by.sum()) > NOTHING * np.abs(by).sum() else 0.0
                label = "reactions at most" if what == "most" else what.replace("_", " ")
                rows.append((label, f"load factor {total:+.3g} % for 1 % more "
                              "everywhere; "
                              f"{_most(by, own, '%')}"))  # fmt: skip
        size, ids = np.linalg.norm(self.moves, axis=1), [block.id for block in scene.blocks]
        if size.max() > 0.0:
            rows.append(("moves", f"{_most(size, ids, '')} per {scene.units.length}"))
        return [*rows, ("derivatives", self.note)]

    @property
    def is_proved(self) -> bool:
        """True if the solution is certified, with a bracket."""
        return self.solution.status.is_good and self.solution.bracket.has_both

    @property
    def note(self) -> str:
        """A sentence that says what the derivatives are based on."""
        if not self.is_proved:
            return (
                f"the load factor is {self.solution.status}, and so its derivatives are those of "
                "forces and rates that prove nothing"
            )
        width = rounded_up(self.solution.gap, 2)
        basis = f"from forces and mechanism that enclose the load factor to {width} of it"
        if self.has_other_mechanisms:
            return f"{basis}; other mechanisms have the same one, so that slopes may be one-sided"
        count = sum(int(flags.sum()) for flags in self.one_sided.values())
        if count:
            return (
                f"{basis}; {count} of them differ for an increase and a decrease, since "
                "equilibrium can shift forces between joints: the effect of one joint lies between"
            )
        return basis

    def both_sides(self, change: Callable[[float], Scene], step: float) -> tuple[float, float]:
        """Returns the slopes downwards and upwards, from two more solves, where they differ.

        Parameters
        ----------
        change : callable
            Returns the scene with something changed by a number, for example
            ``lambda d: scene.with_friction(0.5 + d)``.
        step : float
            The change on either side: the slopes are those of chords.

        Example
        -------
        Below a friction of 0.4 the block slides, and above it the block tips:

        >>> from cvxlimit import builtin_scene, solve
        >>> scene = builtin_scene("single-block").with_friction(0.4)
        >>> found = solve(scene).sensitivity()
        >>> sides = found.both_sides(lambda d: scene.with_friction(0.4 + d), 0.01)
        >>> [round(x, 3) + 0.0 for x in sides]
        [1.0, 0.0]
        """
        surfaces: Any = self.solution.surfaces or self.solution.surface
        below, above = (solve(change(way * step), surfaces) for way in (-1, 1))
        at = [found.load_factor for found in (below, self.solution, above)]
        low, middle, high = (float("nan") if factor is None else factor for factor in at)
        return (middle - low) / step, (high - middle) / step

    @cached_property
    def moves(self) -> FloatArray:
        """Derivatives by a translation of every block (blocks, 3) in the scene's order, with its
        neighbours where they are: sums over its vertices, zero where these cancel but for
        rounding."""
        total = np.array([by.sum(axis=0) for by in self.vertices.values()])
        most = max(float(np.abs(by).sum(axis=0).max()) for by in self.vertices.values())
        return np.where(np.abs(total) > NOTHING * most, total, 0.0)

    def elasticity(self, of: str) -> FloatArray:
        """Returns per cent of the load factor per per cent of a quantity, in the quantity's shape.

        ``of`` is ``"friction"`` or another joint value, ``"weight"``, or ``"dead"`` and ``"live"``
        for the loads' forces.

        Raises
        ------
        InputError
            For any other quantity, and for a load factor of 0, of which there are no per cents.
        """
        scene, factor = self.solution.scene, self.solution.load_factor
        values = {name: getattr(scene.contacts, name) for name in JOINTS}
        values["weight"] = np.array([scene.blocks[i].weight for i in scene.free])
        values |= {"dead": scene.dead_forces, "live": scene.live_forces}
        check_known(of, values, "there is no elasticity of")
        if not factor:
            raise InputError("a load factor of 0 has no elasticity: take the derivatives")
        by = getattr(self, of)
        return np.asarray(by * np.where(by != 0.0, values[of], 0.0) / factor)

    def to_dataframe(self, what: str = "contacts") -> DataFrame:
        """Returns the derivatives as a table: ``"contacts"``, ``"blocks"``, ``"vertices"`` or
        ``"loads"``.

        ``table.attrs["units"]`` and ``table.attrs["description"]`` explain each column, and
        ``table.attrs["note"]`` says what the derivatives are based on.

        Raises
        ------
        InputError
            For any other name of a table.
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
    """Returns a text with the largest of some values, at most three, none below a tenth of the
    first."""
    order = np.argsort(-np.abs(values), kind="stable")[:3]
    chosen = [k for k in order.tolist() if abs(values[k]) >= 0.1 * abs(values[order[0]])]
    texts = [f"{names[k]} {values[k]:+.3g} {unit}".rstrip() for k in chosen]
    return f"most in {', '.join(texts)}"


def sensitivity(solution: Solution) -> Sensitivity:
    """Returns the derivatives of a solution; :meth:`cvxlimit.Solution.sensitivity` describes
    them."""
    proof = Proof(solution, _checked(solution))
    scene, factor = proof.scene, float(solution.load_factor or 0.0)
    start = np.cumsum([0, *(len(b.vertices) for b in scene.blocks)])
    # Through contacts; slopes that differ with other forces of the same mechanism are one-sided.
    by_contact, shared = by_joints(proof, start)
    several, other = proof.elsewhere()
    one_sided = {
        name: several | (np.abs(by - by_contact[name]) > TOLERANCE * np.abs(by_contact[name]).max())
        for name, by in by_joints(other, start)[0].items()
    }
    one_sided["vertices"] = one_sided["vertices"].any(axis=1)
    # Through the blocks' bodies and through the loads.
    dead, live = (load.per_weight(scene.blocks) for load in (scene.dead, scene.live))
    by_vertex = by_contact.pop("vertices")
    add_bodies(proof, factor, by_vertex, start)
    own, ids = proof.rates[scene.free], [block.id for block in scene.blocks]
    return Sensitivity(
        solution,
        **by_contact,
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
    """Returns the surfaces; raises InputError if the load factor is not the optimum of one convex
    problem."""
    why = ""
    if solution.interaction != "none":
        why = "with interaction the load factor is no optimum of one convex problem"
    elif solution.flow != "associated":
        why = "without dilatancy the load factor is one of a set, and no optimum"
    elif solution.torsion_shear == "exact":
        why = "the exact limit of torsion with shear is stated by no surface: take 'parabolic'"
    elif solution.quantity != LOAD_FACTOR:
        why = f"it is about the {solution.quantity}"
    elif own := solution.__dict__.get("own_limits"):
        why = f"it was solved with {own}, whose part is not counted"
    elif solution.load_factor is None or solution.forces is None or solution.mechanism is None:
        why = f"it has no load factor with forces and mechanism ({solution.status})"
    if why:
        raise InputError(f"the solution of {solution.scene_name!r} has no derivatives: {why}")
    return solved_with(solution)
