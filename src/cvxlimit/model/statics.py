"""Equilibrium of the free blocks (Eq. 6 and 7), and the scaling of the whole problem."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter

import numpy as np
import scipy.sparse as sp

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COMPONENTS, Contacts
from cvxlimit.scene import Scene

BALANCED = 1e-11
"""Residual of a block that counts as rounding, as a share of the forces acting on it; also what two
sides of a mirror differ by, of scenes turned at random 3e-13 at most."""

SMALLEST = 1e-100
"""Smallest total load: squares of smaller ones underflow."""

ZERO = 1e-6
"""Load factors near 0, and gaps there, are measured by this share of :attr:`Scaling.ratio`."""

DOF = 6
"""Rows per free block: fx, fy, fz, mx, my, mz at its centroid."""


@dataclass(frozen=True, eq=False)
class Statics:
    """Equilibrium data of a scene in one consistent set of units.

    ``dead`` and ``live`` are load vectors (6 free blocks,); ``row_of_block`` numbers free blocks
    from 0. ``guide`` projects rates on those that :meth:`guided` allows.
    """

    contacts: Contacts
    centroids: FloatArray
    row_of_block: IntArray
    dead: FloatArray
    live: FloatArray
    guide: sp.csr_array | None = None

    def guided(self, rates: FloatArray) -> Statics:
        """The same where free blocks that have ``rates`` (free blocks, 6) other than zero can move
        by a multiple of these only, all by the same: what acts on them in other ways is taken up
        by their guide."""
        motion = sp.csr_array(rates.reshape(-1, 1))
        free = sp.diags_array(np.repeat((rates == 0.0).all(axis=1), DOF).astype(float))
        guide = sp.csr_array(free + motion @ motion.T / float((rates**2).sum()))
        dead, live = (np.asarray(guide @ load) for load in (self.dead, self.live))
        return replace(self, dead=dead, live=live, guide=guide)

    @classmethod
    def of(cls, scene: Scene) -> Statics:
        number = np.full(len(scene.blocks), -1)
        number[scene.free] = np.arange(len(scene.free))
        return cls(
            contacts=scene.contacts,
            centroids=np.array([*map(attrgetter("centroid"), scene.blocks)]),
            row_of_block=number,
            dead=scene.dead_forces.ravel(),
            live=scene.live_forces.ravel(),
        )

    def under(self, dead: FloatArray, live: FloatArray) -> Statics:
        other = replace(self, dead=dead, live=live)
        other.__dict__["matrix"] = self.matrix
        return other

    @cached_property
    def matrix(self) -> sp.csr_array:
        """A (6 free blocks, 6 contacts) of Eq. 7: A x + f = 0 for loads f and contact forces x,
        which act on block b, their opposites on a."""
        contacts, free, n = self.contacts, int(self.row_of_block.max()) + 1, len(self.contacts)
        # both ends of every contact that are on free blocks
        block, columns = np.append(contacts.b, contacts.a), np.tile(np.arange(n), 2)
        held = np.flatnonzero(self.row_of_block[block] >= 0)
        block, columns, rows = block[held], columns[held], self.row_of_block[block[held]]
        # what forces along the contact's axes are to the block: themselves, and moments by arms
        sign = np.where(held < n, 1.0, -1.0)[:, None, None]
        frame = sign * np.swapaxes(contacts.axes[columns], 1, 2)
        arm = contacts.origin[columns] - self.centroids[block]
        blocks = np.zeros((len(held), DOF, len(COMPONENTS)))
        blocks[:, :3, :3] = blocks[:, 3:, 3:] = frame
        blocks[:, 3:, :3] = np.cross(arm[:, :, None], frame, axis=1)
        order = np.lexsort((columns, rows))
        start = np.searchsorted(rows[order], np.arange(free + 1))
        shape = (DOF * free, len(COMPONENTS) * n)
        matrix = sp.bsr_array((blocks[order], columns[order], start), shape=shape).tocsr()
        matrix.eliminate_zeros()
        return matrix if self.guide is None else (self.guide @ matrix).tocsr()

    @cached_property
    def transposed(self) -> sp.csc_array:
        return self.matrix.T

    @cached_property
    def sizes(self) -> sp.csr_array:
        """The absolute values of A."""
        return abs(self.matrix)

    def residual(self, forces: FloatArray, load_factor: float) -> FloatArray:
        """A x + f_dead + alpha f_live, (free blocks, 6)."""
        result = self.matrix @ forces.ravel() + self.dead + load_factor * self.live
        return np.asarray(result).reshape(-1, DOF)

    def is_balanced(self, forces: FloatArray, load_factor: float, length: float) -> bool:
        """True if no block's residual exceeds rounding of the forces that act on it: of the total
        load it would let a block of a millionth of the weight go unbalanced."""
        rest = block_sizes(self.residual(forces, load_factor), length)
        size = self.acting(forces, load_factor, length)
        return bool(np.isfinite(size).all() and (rest <= BALANCED * size).all())

    def acting(self, forces: FloatArray, load_factor: float, length: float) -> FloatArray:
        """Sum of the sizes of all forces and loads that act on each free block, (blocks,)."""
        total = self.sizes @ np.abs(forces).ravel()
        total += np.abs(self.dead) + np.abs(load_factor * self.live)
        return block_sizes(total.reshape(-1, DOF), length)

    def rate_of_the_lightest(self, length: float) -> float:
        """Rate at which the free block with the least live load alone has live power 1: a mechanism
        found by rounding may not move that block at all, where the exact one moves nothing else.
        """
        size = block_sizes(self.live.reshape(-1, DOF), length)
        return float(1.0 / size[size > 0.0].min(initial=np.inf))

    def relative_rates(self, mechanism: FloatArray) -> FloatArray:
        """A^T u: relative displacement rates (contacts, 6) of Eq. 2 for block rates (free, 6)."""
        return np.asarray(self.transposed @ mechanism.ravel()).reshape(-1, len(COMPONENTS))


def block_sizes(generalised: FloatArray, length: float) -> FloatArray:
    """Size (blocks,) of generalised forces (blocks, 6), moments over ``length``."""
    forces, moments = generalised[:, :3], generalised[:, 3:]
    # norm(axis=1) takes twice the time
    sizes = np.sqrt(np.einsum("ij,ij->i", forces, forces))
    return np.asarray(sizes + np.sqrt(np.einsum("ij,ij->i", moments, moments)) / length)


@dataclass(frozen=True)
class Scaling:
    """Units inside the solver, in the user's, and the way back.

    The force unit is the total dead load: with the mean weight of blocks, solvers returned load
    factors wrong by 5 to 20 % on scenes of 2,000 blocks and more, at "optimal" status and without a
    duality gap. The live load has a unit of its own, however the user normalised it. ``ratio``, the
    dead load of blocks that carry live load over that, is a natural size of load factors.
    """

    force: float
    length: float
    live: float
    ratio: float

    @classmethod
    def of(cls, scene: Scene) -> Scaling:
        """Total dead load, typical contact size, total live load."""
        length = scene.contacts.typical_size
        for what, forces in (("live", scene.live_forces), ("dead", scene.dead_forces)):
            if np.any(forces) and not block_sizes(forces, length).sum() > SMALLEST:
                raise InputError(
                    f"the {what} load of scene {scene.name!r} is below {SMALLEST:g} in all: "
                    "choose smaller units of force or a larger density"
                )
        return cls.under(length, scene.dead_forces, scene.live_forces)

    @classmethod
    def under(cls, length: float, dead: FloatArray, live: FloatArray) -> Scaling:
        each, push = block_sizes(dead, length), float(block_sizes(live, length).sum())
        force = float(each.sum()) or push
        loaded = float(each[np.any(live, axis=1)].sum()) or force
        return cls(force, length, push, loaded / push if push > 0.0 else 1.0)

    def apply(self, statics: Statics) -> Statics:
        rows = np.tile(np.repeat([1.0, self.length], 3), len(statics.dead) // DOF)
        guide = statics.guide
        if guide is not None:
            guide = sp.csr_array(sp.diags_array(1.0 / rows) @ guide @ sp.diags_array(rows))
        return replace(
            statics,
            guide=guide,
            contacts=statics.contacts.scaled(1.0 / self.length),
            centroids=statics.centroids / self.length,
            dead=statics.dead / (self.force * rows),
            live=statics.live / (self.live * rows),
        )

    def load_factor(self, scaled: float) -> float:
        return scaled * self.force / self.live

    @property
    def least(self) -> float:
        """Size by which brackets that hold zero are measured."""
        return ZERO * self.ratio

    def unit(self, *load_factors: float) -> float:
        """What errors of load factors are measured by: the largest, or :attr:`least`."""
        return max(*map(abs, load_factors), self.least)

    def forces(self, scaled: FloatArray) -> FloatArray:
        return scaled * self.force * np.repeat([1.0, self.length], 3)

    def mechanism(self, scaled: FloatArray) -> FloatArray:
        return scaled / (self.live * np.repeat([1.0, self.length], 3))
