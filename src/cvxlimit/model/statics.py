"""Equilibrium of the free blocks (Eq. 6 and 7), and the scaling of the whole problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from cvxlimit.arrays import FloatArray, IntArray
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COMPONENTS, Contacts
from cvxlimit.scene import Scene


@dataclass(frozen=True)
class _Numbers:
    """What each number is for, and where it was measured."""

    balanced: float = 1e-11
    """Residual of a block that counts as rounding, as a share of the forces acting on it."""
    smallest: float = 1e-100
    """Smallest total load: squares of smaller ones underflow."""
    zero: float = 1e-06
    """Load factors near 0 are measured by this share of :attr:`Scaling.ratio`."""


_N = _Numbers()


DOF = 6
"""Rows per free block: fx, fy, fz, mx, my, mz at its centroid."""


def equilibrium_matrix(
    contacts: Contacts, centroids: FloatArray, row_of_block: IntArray
) -> sp.csr_array:
    """A (6 free blocks, 6 contacts) of Eq. 7: A x + f = 0 for contact forces x and loads f.

    ``centroids`` (blocks, 3) of all blocks; ``row_of_block`` (blocks,) numbers the free ones
    from 0 and is -1 for supports. Contact forces act on block b, their opposites on block a.
    """
    free = int(row_of_block.max()) + 1
    sides = [
        _side(contacts, contacts.b, +1.0, centroids, row_of_block),
        _side(contacts, contacts.a, -1.0, centroids, row_of_block),
    ]
    rows, columns, blocks = (np.concatenate([side[i] for side in sides]) for i in range(3))
    order = np.lexsort((columns, rows))
    start = np.searchsorted(rows[order], np.arange(free + 1))
    shape = (DOF * free, len(COMPONENTS) * len(contacts))
    matrix = sp.bsr_array((blocks[order], columns[order], start), shape=shape).tocsr()
    matrix.eliminate_zeros()
    return matrix


def _side(
    contacts: Contacts, block: IntArray, sign: float, centroids: FloatArray, number: IntArray
) -> tuple[IntArray, IntArray, FloatArray]:
    held = np.flatnonzero(number[block] >= 0)
    frame = sign * np.swapaxes(contacts.axes[held], 1, 2)
    arm = contacts.origin[held] - centroids[block[held]]
    entries = np.zeros((len(held), DOF, len(COMPONENTS)))
    entries[:, :3, :3] = entries[:, 3:, 3:] = frame
    entries[:, 3:, :3] = np.cross(arm[:, :, None], frame, axis=1)
    return number[block[held]], held, entries


@dataclass(frozen=True, eq=False)
class Statics:
    """Equilibrium data of a scene in one consistent set of units.

    ``matrix`` is A; ``dead`` and ``live`` are load vectors (6 free blocks,); see
    :func:`equilibrium_matrix`. ``guides`` are directions (3,) of free blocks, by row, that can only
    move along them: what acts on such a block in other ways is taken up by its guide.
    """

    contacts: Contacts
    centroids: FloatArray
    row_of_block: IntArray
    dead: FloatArray
    live: FloatArray
    guides: Mapping[int, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("dead", "live"):
            if self.guides:
                object.__setattr__(self, name, self.guided @ getattr(self, name))

    @cached_property
    def guided(self) -> sp.csr_array:
        """Projection (6 free blocks, 6 free blocks) of rates on those that guides allow."""
        blocks = [np.eye(DOF)] * (int(self.row_of_block.max()) + 1)
        for row, direction in self.guides.items():
            blocks[row] = np.zeros((DOF, DOF))
            blocks[row][:3, :3] = np.outer(direction, direction)
        return sp.csr_array(sp.block_diag([*map(sp.csr_array, blocks)], format="csr"))

    @classmethod
    def of(cls, scene: Scene) -> Statics:
        """Equilibrium in the scene's own units."""
        number = np.full(len(scene.blocks), -1)
        number[scene.free] = np.arange(len(scene.free))
        return cls(
            contacts=scene.contacts,
            centroids=np.array([b.centroid for b in scene.blocks]),
            row_of_block=number,
            dead=scene.dead_forces.ravel(),
            live=scene.live_forces.ravel(),
        )

    def under(self, dead: FloatArray, live: FloatArray) -> Statics:
        """The same under other loads (6 free blocks,); the matrix is kept."""
        other = replace(self, dead=dead, live=live)
        other.__dict__["matrix"] = self.matrix
        return other

    @cached_property
    def matrix(self) -> sp.csr_array:
        """A of Eq. 7."""
        whole = equilibrium_matrix(self.contacts, self.centroids, self.row_of_block)
        return (self.guided @ whole).tocsr() if self.guides else whole

    def residual(self, forces: FloatArray, load_factor: float) -> FloatArray:
        """A x + f_dead + alpha f_live, (free blocks, 6)."""
        result = self.matrix @ forces.ravel() + self.dead + load_factor * self.live
        return np.asarray(result).reshape(-1, DOF)

    def is_balanced(self, forces: FloatArray, load_factor: float, length: float) -> bool:
        """True if no block's residual exceeds rounding of the forces that act on it.

        Not of the total load: that would let a block of a millionth of the weight go unbalanced.
        """
        rest = block_sizes(self.residual(forces, load_factor), length)
        size = self.acting(forces, load_factor, length)
        return bool(np.isfinite(size).all() and (rest <= _N.balanced * size).all())

    def acting(self, forces: FloatArray, load_factor: float, length: float) -> FloatArray:
        """Sum of the sizes of all forces and loads that act on each free block, (blocks,)."""
        total = abs(self.matrix) @ np.abs(forces).ravel()
        total += np.abs(self.dead) + np.abs(load_factor * self.live)
        return block_sizes(total.reshape(-1, DOF), length)

    def rate_of_the_lightest(self, length: float) -> float:
        """Rate at which the free block with the least live load alone has live power 1.

        A mechanism found by rounding may not move that block at all, where the exact one moves
        nothing else: then its own rates say nothing about those that are possible.
        """
        size = block_sizes(self.live.reshape(-1, DOF), length)
        return float(1.0 / size[size > 0.0].min(initial=np.inf))

    def relative_rates(self, mechanism: FloatArray) -> FloatArray:
        """A^T u: relative displacement rates (contacts, 6) of Eq. 2 for block rates (free, 6)."""
        return np.asarray(self.matrix.T @ mechanism.ravel()).reshape(-1, len(COMPONENTS))


def block_sizes(generalised: FloatArray, length: float) -> FloatArray:
    """Size (blocks,) of generalised forces (blocks, 6), moments over ``length``."""
    moments = np.linalg.norm(generalised[:, 3:], axis=1)
    result: FloatArray = np.linalg.norm(generalised[:, :3], axis=1) + moments / length
    return result


@dataclass(frozen=True)
class Scaling:
    """Units inside the solver, and the way back: everything that scales does it here.

    The force unit is the total dead load, not a block's weight: with the mean weight as unit,
    solvers returned load factors wrong by 5 to 20 % on scenes of 2,000 blocks and more, at
    "optimal" status, small residuals and no duality gap. The live load has its own unit, so
    that the scaled load factor does not depend on how the user normalised it.

    Attributes
    ----------
    force, length, live : float
        One unit of the scaled problem, in the user's units.
    ratio : float
        Dead load of the blocks that carry live load, over the live load: a natural size of load
        factors. With all blocks' dead load a pebble beside a boulder would have a huge one.
    """

    force: float
    length: float
    live: float
    ratio: float

    @classmethod
    def of(cls, scene: Scene) -> Scaling:
        """Total dead load, typical contact size, total live load.

        Raises
        ------
        InputError
            If a load is so small that its square is lost in rounding.
        """
        length = scene.contacts.typical_size
        for what, forces in (("live", scene.live_forces), ("dead", scene.dead_forces)):
            if np.any(forces) and not _total(forces, length) > _N.smallest:
                raise InputError(
                    f"the {what} load of scene {scene.name!r} is below {_N.smallest:g} in all: "
                    "choose smaller units of force or a larger density"
                )
        return cls.under(length, scene.dead_forces, scene.live_forces)

    @classmethod
    def under(cls, length: float, dead: FloatArray, live: FloatArray) -> Scaling:
        """For loads (free blocks, 6), with a unit of length."""
        total, push = _total(dead, length), _total(live, length)
        force = total if total > 0.0 else push
        loaded = _total(dead[np.any(live, axis=1)], length)
        return cls(force, length, push, (loaded or force) / push if push > 0.0 else 1.0)

    def apply(self, statics: Statics) -> Statics:
        """The scaled copy; forces, lengths and load factor of order one."""
        rows = np.tile([1.0, 1.0, 1.0] + [self.length] * 3, len(statics.dead) // DOF)
        return Statics(
            contacts=statics.contacts.scaled(1.0 / self.length),
            centroids=statics.centroids / self.length,
            row_of_block=statics.row_of_block,
            dead=statics.dead / (self.force * rows),
            live=statics.live / (self.live * rows),
            guides=statics.guides,
        )

    def load_factor(self, scaled: float) -> float:
        """Load factor in the user's sense."""
        return scaled * self.force / self.live

    @property
    def least(self) -> float:
        """Size by which brackets that hold zero are measured: a millionth of the ratio."""
        return _N.zero * self.ratio

    def unit(self, *load_factors: float) -> float:
        """What errors of load factors are measured by: the largest, or a millionth of the ratio.

        >>> Scaling(force=100.0, length=1.0, live=10.0, ratio=10.0).unit(-0.5, 0.2)
        0.5
        """
        return max(*map(abs, load_factors), self.least)

    def forces(self, scaled: FloatArray) -> FloatArray:
        """Contact forces (contacts, 6) in the user's units."""
        return scaled * self.force * np.array([1.0, 1.0, 1.0] + [self.length] * 3)

    def mechanism(self, scaled: FloatArray) -> FloatArray:
        """Block rates (free, 6); live power 1 stays 1."""
        return scaled / (self.live * np.array([1.0, 1.0, 1.0] + [self.length] * 3))


def _total(loads: FloatArray, length: float) -> float:
    forces = np.linalg.norm(loads[:, :3], axis=1).sum()
    moments = np.linalg.norm(loads[:, 3:], axis=1).sum()
    return float(forces + moments / length)
