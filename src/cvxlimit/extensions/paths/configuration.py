"""One configuration of a path: displaced blocks, the points where they touch, and forces there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.extensions.paths.bars import Bars
from cvxlimit.extensions.paths.moving import held_scene, moved_scene
from cvxlimit.extensions.paths.pairs import CLOSED, Pose
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import Bracket

Flow = Literal["associated", "zero-dilatancy"]


@dataclass(frozen=True, eq=False)
class Points:
    """The k points at which blocks of a configuration touch or are about to.

    Attributes
    ----------
    a, b : (k,) array of int
        Blocks, as numbers in ``scene.blocks``; forces act on b, their opposites on a.
    at : (k, 3) array
        Places, in the scene's unit of length.
    axes : (k, 3, 3) array
        Rows t1, t2, n of a right-handed frame; n points from a into b.
    gap : (k,) array
        Distance along n; negative where blocks are in each other.
    slip : (k, 2) array
        Of b against a along t1 and t2 since the step's start, where the point was closed then.
    friction : (k,) array
    cohesion : (k,) array
        Shear that a point bears besides friction (force).
    least, most : (k,) array
        Bounds of a point's compression; 0 and infinite but for ties and reactions. That of a tie is
        its tension, along a normal from b to a.
    is_bar : (k,) array of bool
        Of ties and reactions, whose gap is how far they are short of their seat
        (:mod:`cvxlimit.extensions.paths.bars`).
    """

    a: IntArray
    b: IntArray
    at: FloatArray
    axes: FloatArray
    gap: FloatArray
    slip: FloatArray
    friction: FloatArray
    cohesion: FloatArray = None  # type: ignore[assignment]  # none, at any number of points
    most: FloatArray = None  # type: ignore[assignment]
    least: FloatArray = None  # type: ignore[assignment]
    is_bar: BoolArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        none = ("cohesion", 0.0), ("most", np.inf), ("least", 0.0), ("is_bar", False)
        for name, value in none:
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.full(len(self.gap), value))

    def __len__(self) -> int:
        return len(self.gap)

    @property
    def distance(self) -> FloatArray:
        """Gap less friction times slip (k,): what a point has to close, opened by its own slip."""
        return np.asarray(self.gap - self.friction * np.linalg.norm(self.slip, axis=1))

    def apart(self, flow: Flow) -> FloatArray:
        """What has to close (k,): gaps, less what slip opens with dilatancy."""
        return self.distance if flow == "associated" else self.gap

    def lost(self, forces: FloatArray, flow: Flow = "zero-dilatancy") -> float:
        """What forces (k, 3) lack of friction by the ``flow`` rule, a work: compressions across
        gaps, and friction that does not oppose the whole slip. Never negative, zero for a
        solution."""
        n, slid = self.chosen(forces), np.linalg.norm(self.slip, axis=1)
        lost = n * self.apart(flow) + self.friction * n * slid
        lost = lost + (forces[:, 1:] * self.slip).sum(axis=1)
        if self.is_bound:  # cohesion that slips, and bars that give way at less than they bear
            more = np.where(np.isfinite(self.most), self.most - self.least, 0.0)
            yields = more * np.maximum(-self.gap, 0.0)
            lost = lost + self.cohesion * slid + yields
        return float(np.abs(lost).sum())

    def chosen(self, forces: FloatArray) -> FloatArray:
        """What equilibrium chooses of compressions (k,): all but the least ones, which are
        loads."""
        return np.asarray(forces[:, 0] - self.least)

    @property
    def is_bound(self) -> bool:
        """Whether any point has cohesion, or is of a tie or a reaction."""
        return bool((self.cohesion > 0.0).any() or self.is_bar.any())

    @property
    def unbound(self) -> Points:
        """Those that bear any compression, with friction alone."""
        plain = self.take(np.isinf(self.most))
        return replace(plain, cohesion=np.zeros(len(plain)))

    @property
    def depth(self) -> float:
        """How deep blocks are in each other at most."""
        return float(-self.gap[np.isinf(self.most)].min(initial=0.0))

    def closed(self, flow: Flow, least: float) -> Points:
        """Those whose gap, less friction times slip where that is what joints open by, is no more
        than ``least``."""
        return self.take(self.apart(flow) <= least)

    def bearing_gap(self, forces: FloatArray, flow: Flow = "zero-dilatancy") -> float:
        """The widest gap across which forces (k, 3) bear, less what slip opens by the rule."""
        n = self.chosen(forces)
        bears = n > CLOSED * n.max(initial=0.0)
        return float(self.apart(flow)[bears].max(initial=0.0))

    def take(self, which: NDArray[Any]) -> Points:
        """Some of the points, by number or by a truth value for each."""
        return Points(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def beside(self, other: Points) -> Points:
        """These, and others after them."""
        names = self.__dataclass_fields__
        return Points(*(np.concatenate([getattr(self, x), getattr(other, x)]) for x in names))


@dataclass(frozen=True, eq=False)
class Configuration:
    """Displaced blocks in equilibrium, the forces at their points, and the bracket.

    Attributes
    ----------
    start : Scene
        The scene that the path began with.
    w : float
        Mean displacement of the live load, in the scene's unit of length.
    load_factor : float
    displacements : mapping of block id to (6,) array
        Of every free block: translation of its centroid and rotation vector (radians), from where
        it was at first.
    points : Points
    forces : (k, 3) array
        Compression n and friction v1, v2 along t1 and t2 at every point, on block b.
    bracket : Bracket or None
        Of the largest load factor of this configuration, with friction at its closed points; None
        where none was asked for.
    widest_gap : float
        The widest gap, less friction times slip, among points that count as closed.
    residual : float
        How far the last iterate would still move a point, over the typical contact size; of one
        that is followed what equilibrium lacks at most, over the dead load.
    iterates : int
        Iterates that found it.
    loss : float
        Without dilatancy or followed, what friction lacks of acting against the whole slip of the
        last step at closed joints, as a share of the step's work at the first load factor; 0 for a
        solution.
    largest : Bracket or None
        Where supports move: of the largest reaction along their motion. The least one is
        ``bracket`` with its sign turned, see ``Path.reactions``.
    is_followed : bool
        True where no iterates came to rest and an explicit step went on: forces are within
        friction, equilibrium lacks ``residual`` and friction ``loss``. There is a bracket where
        joints are closed but for what linearised steps leave.
    """

    start: Scene
    w: float
    load_factor: float
    displacements: Mapping[str, FloatArray]
    points: Points
    forces: FloatArray
    bracket: Bracket | None = None
    widest_gap: float = 0.0
    residual: float = 0.0
    iterates: int = 0
    loss: float = 0.0
    is_followed: bool = False
    largest: Bracket | None = None

    def bearing_gap(self, flow: Flow) -> float:
        """The gap up to which points count as closed in any case: where blocks slide without
        opening or are followed, the widest across which forces bear."""
        is_exact = flow == "associated" and not self.is_followed
        return 0.0 if is_exact else self.points.bearing_gap(self.forces, flow)

    @cached_property
    def pose(self) -> Pose:
        """Where all blocks are."""
        free = self.start.free
        ways = np.array([self.displacements[self.start.blocks[i].id] for i in free])
        return Pose.first(self.start).moved(free, ways)

    def scene(self) -> Scene:
        """The scene with moved blocks, and point loads, pressures, ties and reactions that moved
        with them. It has neither ties that are slack or gone nor the cohesion of joints that have
        moved, and of reactions that push short of their seats no more than the least force."""
        p, near = self.points, CLOSED * self.start.contacts.typical_size
        seated = p.take(p.is_bar & (p.gap <= near))
        at, n, _ = Bars(self.start).at(self.pose)
        own, every = (
            np.concatenate([x / near, way / CLOSED], axis=1)
            for x, way in ((seated.at, seated.axes[:, 2]), (at, n))
        )
        is_seated = [bool((np.abs(own - row).max(axis=1) <= 1.0).any()) for row in every]
        glued = np.stack([p.a, p.b], axis=1)[p.cohesion > 0.0]
        return held_scene(moved_scene(self.start, self.displacements), self.start, is_seated, glued)
