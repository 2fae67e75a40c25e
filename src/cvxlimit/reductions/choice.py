"""The choice of a model: which reductions of a scene are valid, the reduced model, and ``explain``.

Supports part a scene: blocks that are linked through contacts with free blocks only stand or fall
together. A part without live load carries its dead load at every load factor in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.base.checks import check_choice, ratio
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.model.assemblage import Assemblage, Balance, Reduction
from cvxlimit.model.crushing import EffectiveRectangles
from cvxlimit.model.formulations import Formulation, corner_compressions, is_weak
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.mirror import Mirror, find_mirror
from cvxlimit.reductions.planar import InPlane, Plane, find_plane
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solvers import Shape
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import SurfaceName, needed_surfaces, surfaces_of

ModelName = Literal["auto", "full", "least"]
MODELS: tuple[str, ...] = get_args(ModelName)
"""How much model: what the scene needs where that pays, all of it, or as little as is valid."""

_LEAST_MIRRORED = 150
"""Contacts from which one half of a symmetric scene pays, for what finding it costs."""


@dataclass(frozen=True, eq=False)
class Reductions:
    """The reductions that are valid for a scene under given surfaces.

    ``plane`` and ``mirror`` are None where the scene is not planar or symmetric. ``loaded``
    (free blocks,) is True for blocks in parts with live load, and None if all parts have some.
    """

    assemblage: Assemblage
    formulation: Formulation = corner_compressions
    plane: Plane | None = None
    mirror: Mirror | None = None
    loaded: BoolArray | None = None

    @classmethod
    def of(
        cls,
        assemblage: Assemblage,
        surfaces: Sequence[YieldSurface],
        formulation: Formulation = corner_compressions,
        model: str = "auto",
    ) -> Reductions:
        """Returns the reductions that are valid and pay, or all that are valid for
        ``model="least"``. There are none for ``"full"``, for formulations of one's own, for
        contacts that crush and are no rectangles, whose conditions are on forces of their own, and
        for guided blocks, which need not move in the plane or like their mirror image.
        """
        contacts, is_guided = assemblage.contacts, assemblage.statics.guide is not None
        if model == "full" or formulation is not corner_compressions or is_guided:
            return cls(assemblage, formulation)
        if is_weak(contacts).any() and EffectiveRectangles.of(contacts) is None:
            return cls(assemblage, formulation)
        # a plane is only looked for where normals of contacts and forces span no more than one
        statics, spread = assemblage.statics, np.zeros((3, 3))
        dead, live = (load.reshape(-1, DOF)[:, :3] for load in (statics.dead, statics.live))
        for vectors in (statics.contacts.axes[:, 2], dead, live):
            spread += vectors.T @ vectors / (vectors**2).max(initial=1e-300)
        least, _, most = np.linalg.eigvalsh(spread)
        plane = find_plane(statics, surfaces) if least <= ROUNDING * most else None
        # a mirror costs time to find
        mirror = None
        if model == "least" or len(statics.contacts) >= _LEAST_MIRRORED:
            mirror = find_mirror(statics, surfaces, None if plane is None else plane.normal)
        # forces of a planar scene are balanced within its plane
        if plane is not None:
            blocks = len(statics.dead) // DOF
            ways = _rates(blocks, plane.normal, None, np.arange(blocks))
            unlimited = plane.contacts.with_values(compressive_strength=np.inf)
            balance = Balance(statics, plane.model(unlimited), ways)
            assemblage = replace(assemblage, balance=balance)
        loaded = loaded_blocks(statics)
        return cls(assemblage, formulation, plane, mirror, None if loaded.all() else loaded)

    def steps(self, dead_state: FloatArray | None) -> Iterator[Reduction]:
        """Yields the full model, and the models with one reduction more at a time."""
        step = replace(self, plane=None, mirror=None, loaded=None)
        yield step.best()
        for name in ("loaded", "mirror", "plane"):
            if getattr(self, name) is not None and not (name == "loaded" and dead_state is None):
                step = replace(step, **{name: getattr(self, name)})
                yield step.best(dead_state)

    def best(self, dead_state: FloatArray | None = None) -> Reduction:
        """Returns the smallest model. Parts without live load are left out only if forces (n, 6)
        that carry the dead load show that they stand."""
        statics, plane, mirror = self.assemblage.statics, self.plane, self.mirror
        full = Reduction.none(statics, self.formulation)
        blocks = None if dead_state is None else self.loaded
        found = {"parts": blocks, "symmetry": mirror, "planar": plane}
        names = tuple(name for name, part in found.items() if part is not None)
        if not names:
            return full
        kept = np.ones(len(statics.contacts), dtype=bool)
        moving = np.ones(len(statics.dead) // DOF, dtype=bool)
        given_forces = None
        if blocks is not None and dead_state is not None:
            kept, moving = contacts_of(statics, blocks), blocks
            given_forces = np.where(kept[:, None], 0.0, dead_state)
        if mirror is not None:
            kept = kept & (np.arange(len(kept)) <= mirror.contacts)
        is_whole = bool(kept.all())
        across = None if plane is None else plane.normal
        rates = self.assemblage.balance.rates if plane is not None else None
        if rates is None or mirror is not None or not moving.all():
            rates = _rates(len(moving), across, mirror, np.flatnonzero(moving))
        return replace(
            full,
            names=names,
            contacts=full.contacts if is_whole else full.contacts.take(np.flatnonzero(kept)),
            forces=None if is_whole else _forces(mirror, kept),
            rates=rates,
            formulation=self.formulation if plane is None else InPlane(plane.taking(kept)),
            given_forces=given_forces,
        )


def _forces(mirror: Mirror | None, kept: BoolArray) -> sp.csr_array:
    """Returns the matrix that gives the forces (6 n,) of all contacts from those of ``kept``
    ones."""
    width = len(COMPONENTS)
    whole = sp.eye_array(width * len(kept), format="csc") if mirror is None else mirror.forces
    return whole[:, np.flatnonzero(np.repeat(kept, width))].tocsr()


def _rates(
    blocks: int, across: FloatArray | None, mirror: Mirror | None, moving: IntArray
) -> sp.csr_array:
    ways = _ways(across, None if mirror is None else mirror.normal)
    if mirror is None:  # as sp.kron would have it, in a twentieth of its time
        way, part = np.nonzero(ways)
        row = len(ways) * np.arange(len(moving))[:, None] + way
        at = row.ravel(), (DOF * moving[:, None] + part).ravel()
        shape = len(ways) * len(moving), DOF * blocks
        return sp.csr_array((np.tile(ways[way, part], len(moving)), at), shape=shape)
    each = sp.eye_array(blocks, format="csr")
    partner, image = mirror.blocks, ways @ mirror.reflection
    first, own = moving[moving < partner[moving]], moving[moving == partner[moving]]
    symmetric = ways[np.abs(image - ways).max(axis=1) < 1e-9]
    pairs = sp.kron(each[first], sp.csr_array(ways)) + sp.kron(
        each[partner[first]], sp.csr_array(image)
    )
    return sp.vstack([pairs, sp.kron(each[own], sp.csr_array(symmetric))], format="csr")


def _ways(across: FloatArray | None, mirror: FloatArray | None) -> FloatArray:
    """Returns the ways (k, 6) in which a block may move, one per row: along and about the axes of a
    frame that has both normals among them; only those within the plane with normal ``across``."""
    normals = [normal for normal in (mirror, across) if normal is not None]
    if not normals:
        return np.eye(DOF)
    first, other = normals[0], normals[-1]
    if len(normals) == 1:
        other = np.cross(first, np.eye(3)[np.argmin(np.abs(first))])
        other /= np.linalg.norm(other)
    frame = np.stack([first, other, np.cross(first, other)])
    ways = np.asarray(np.kron(np.eye(2), frame), dtype=np.float64)
    if across is None:
        return ways
    is_across = np.abs(frame @ across) > 0.5
    return ways[np.append(~is_across, is_across)]


def loaded_blocks(statics: Statics) -> BoolArray:
    """Returns which free blocks are in a part with live load."""
    is_live = np.any(statics.live.reshape(-1, DOF), axis=1)
    if is_live.all():
        return is_live
    number = statics.row_of_block
    a, b = number[statics.contacts.a], number[statics.contacts.b]
    linked = (a >= 0) & (b >= 0)
    shape = (len(is_live), len(is_live))
    graph = sp.coo_array((np.ones(linked.sum()), (a[linked], b[linked])), shape=shape)
    part = connected_components(graph, directed=False)[1]
    return np.asarray(np.isin(part, part[is_live]))


def contacts_of(statics: Statics, blocks: BoolArray) -> BoolArray:
    """Returns which contacts (n,) touch one of the free blocks for which ``blocks`` is True."""
    member = np.append(blocks, False)
    number, contacts = statics.row_of_block, statics.contacts
    return np.asarray(member[number[contacts.a]] | member[number[contacts.b]])


PACES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "exact": (2e-5, 2.2),
        "fixed-point": (2.5e-4, 1.85),
        "certified": (5e-2, 1.0),
        "zero-dilatancy": (3e-3, 1.3),
    }
)
"""CPU seconds by method: the first times contacts to the power of the second, within a factor of
some five (docs/evidence/speed.md#other-methods). Planar scenes take a third or less. Those of zero
dilatancy are of one search."""

BUDGET = 300
"""Problems that a search without dilatancy solves."""

SEARCHES = 5
"""As many of them at most unless asked for more, each with a seed of its own."""

SEARCH_SECONDS = 40.0
"""Seconds that all of them together may take, as far as can be told; one is made in any case."""


def searches_in_time(contacts: int, is_plane: bool) -> int:
    """Returns how many searches without dilatancy are made of a scene unless a number is asked for:
    as many as fit the time, which depends on its size alone, not on the machine."""
    return int(np.clip(SEARCH_SECONDS / _pace("zero-dilatancy", contacts, is_plane), 1, SEARCHES))


def _pace(method: str, contacts: int, is_plane: bool) -> float:
    """Returns the CPU seconds that :data:`PACES` expects."""
    rate, power = PACES[method]
    return float(rate * contacts**power / (3 if is_plane else 1))


MEANING: Mapping[str, str] = MappingProxyType(
    {
        "parts": "parts without live load are left out: they stand",
        "symmetry": "one half of a symmetric scene",
        "planar": "three degrees of freedom per block, three forces per contact",
    }
)
"""What reductions are, by name."""


@dataclass(frozen=True)
class Explanation:
    """What :func:`explain` has found out.

    ``blocks`` are free ones; ``sizes`` those of the full model and after each reduction, in order;
    ``seconds`` are those of one idle core, to a factor of two or so; ``methods`` those of the other
    methods, to a factor of five or so. ``told`` is what detection leaves out or simplifies, and
    ``searches`` how many are made for members without dilatancy.
    """

    scene_name: str
    blocks: int
    contacts: int
    sizes: Mapping[str, Shape]
    solver: str
    reason: str
    seconds: float
    methods: Mapping[str, float] = field(default_factory=dict)
    told: tuple[str, ...] = ()
    searches: int = 1

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name} {s.variables} variables" for name, s in self.sizes.items())
        return f"Explanation({self.scene_name!r}: {sizes}, {self.solver}, {self.seconds:.1g} s)"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"

    def __str__(self) -> str:
        lines = [f"{self.scene_name}: {self.blocks} free blocks x {self.contacts} contacts"]
        head = ("model", "variables", "equations", "rows", "cones")
        lines.append("".join(f"{name:>11}" if i else f"{name:<10}" for i, name in enumerate(head)))
        for name, s in self.sizes.items():
            numbers = (s.variables, s.equations, s.rows, s.cones)
            lines.append(f"{name:<10}" + "".join(f"{number:>11}" for number in numbers))
        lines += [f"{name}: {MEANING[name]}" for name in self.sizes if name in MEANING]
        lines.append(f"solver: {self.solver}, because {self.reason}")
        lines.append(f"expected time: {duration(self.seconds)} to solve, on one idle core")
        of = f"{self.searches} searches of" if self.searches > 1 else "one search of"
        many = {"zero-dilatancy": f" for {of} {BUDGET} solves (--searches, --budget)"}
        others = [f"{name} {duration(s)}{many.get(name, '')}" for name, s in self.methods.items()]
        lines += [f"other methods, roughly: {', '.join(others)}"] * bool(others)
        lines += [f"geometry: {said}" for said in self.told]
        return "\n".join(lines)


def expected_seconds(contacts: int, is_plane: bool) -> dict[str, float]:
    """Seconds that methods beside the convex one are expected to take, by name; without dilatancy
    those of all searches."""
    seconds = {name: _pace(name, contacts, is_plane) for name in PACES}
    seconds["zero-dilatancy"] *= searches_in_time(contacts, is_plane)
    return seconds


def duration(seconds: float) -> str:
    """An expected time in words.

    >>> duration(0.02), duration(8.3), duration(400.0)
    ('less than 0.1 s', 'about 8 s', '7 min')
    """
    if seconds < 0.1:
        return "less than 0.1 s"
    return f"about {float(f'{seconds:.1g}'):g} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def explain(
    scene: Scene,
    surface: SurfaceName | Cone | Sequence[YieldSurface] = "conic",
    *,
    tolerance: float = 1e-5,
    model: ModelName = "auto",
) -> Explanation:
    """Model size, solver and expected time of ``solve`` without interaction, with reasons, and
    expected times of the other methods; nothing is solved.

    Raises
    ------
    InputError, ModelError
        As :func:`cvxlimit.solve`.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> found = explain(builtin_scene("arch"))
    >>> {name: size.variables for name, size in found.sizes.items()}
    {'full': 169, 'planar': 64}
    """
    check_scene(scene)
    ratio(tolerance, "tolerance")
    check_choice("model", model, MODELS)
    surfaces = needed_surfaces(surfaces_of(surface)[0])
    found = Reductions.of(Assemblage.of(scene), surfaces, model=model)
    state = Certifier(found.assemblage, surfaces).witnesses.easy_dead_state
    problems = {
        ("full", *step.names)[-1]: LimitProgram(found.assemblage, surfaces, reduction=step)
        for step in found.steps(state)
    }
    *_, last = problems.values()
    sizes = {name: problem.shape for name, problem in problems.items()}
    first = last.ladder(tolerance)[0]
    pace, growth = first.row.pace
    size = len(scene.contacts), found.plane is not None
    return Explanation(
        scene.name,
        len(scene.free),
        len(scene.contacts),
        sizes,
        str(first),
        _reason(first.name, last.shape),
        float(pace * last.shape.variables**growth),
        expected_seconds(*size),
        scene.told,
        searches_in_time(*size),
    )  # fmt: skip


def _reason(solver: str, shape: Shape) -> str:
    kind = {
        "conic": "the problem has second-order cones",
        "facets": "the problem is linear with many facets",
        "lean": "the problem is linear with few rows",
    }[shape.kind]
    size = "large" if solver == "BLOCKWISE" else "not so large that the blockwise solver pays"
    return f"{kind} and is {size} ({shape.variables:,} variables)"
