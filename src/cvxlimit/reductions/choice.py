"""The choice of a model: which reductions of a scene are valid, and the reduced model.

There are three: parts without live load, one half of a symmetric scene, and a planar scene in its
plane. Each says which forces are unknown, what they make of the forces of all contacts, and which
ways blocks may move; together they are one :class:`~cvxlimit.model.assemblage.Reduction`.

Supports part a scene: blocks that are linked through contacts with free blocks only stand or fall
together. A part without live load carries its dead load at every load factor in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cvxlimit.base.arrays import ROUNDING, BoolArray, FloatArray, IntArray
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.model.assemblage import Assemblage, Balance, Reduction
from cvxlimit.model.crushing import EffectiveRectangles, is_weak
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.reductions.mirror import Mirror, find_mirror
from cvxlimit.reductions.planar import InPlane, Plane, find_plane
from cvxlimit.surfaces import YieldSurface

ModelName = Literal["auto", "full", "least"]
MODELS: tuple[str, ...] = get_args(ModelName)
"""How much model: what the scene needs where that pays, all of it, or as little as is valid."""

PLANAR_FROM = 330
"""Contacts from which one convex problem is solved sooner in the plane of a planar scene, for what
finding it costs: its 1,000 variables are enough for the blockwise solver then. In space, walls,
arches and piles of 20 to 300 contacts took 0.7 to 1.2 times as long as in the plane, and of 370
to 5,000 1.1 to 3.9 times (docs/evidence/models.md). Methods that solve many problems gain at any
size, and look for it always."""

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
        planar_from: int = 0,
    ) -> Reductions:
        """Returns the reductions that are valid and pay, or all that are valid for
        ``model="least"``; a plane pays from so many contacts on as ``planar_from`` says. There are
        none for ``"full"``, for formulations of one's own, for contacts that crush and are no
        rectangles, whose conditions are on forces of their own, and for guided blocks, which need
        not move in the plane or like their mirror image.
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
        plane, is_flat = None, bool(least <= ROUNDING * most)
        is_small = model != "least" and len(statics.contacts) < planar_from
        if is_flat and not is_small:
            plane = find_plane(statics, surfaces)
        # a mirror costs time to find, and of a flat scene its own plane is one
        mirror = None
        if model == "least" or (
            len(statics.contacts) >= _LEAST_MIRRORED and not (is_flat and is_small)
        ):
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
            kept=np.flatnonzero(kept),
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
