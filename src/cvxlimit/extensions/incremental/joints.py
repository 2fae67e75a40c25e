"""Blocks on elastic joints: what moves, where joints bear, and what they answer.

A joint moves by m = G d, the motion of its second block against its first, as the joint sees it: d
are the displacements of both. At each of its points it opens by a row of B m and slips by the
others. All joints have as many points as the one with the most, those too many without stiffness,
so that one array holds all.

=======  ========================================  =================
letter   what it is                                shape
=======  ========================================  =================
C, P     joints; points of each
q, m, s  ways to move of a block; of a joint; in   6, 6, 2; in a
         which it slips                            plane 3, 3, 1
G        motion of a joint, of its two blocks'     (C, m, 2 q)
B        slips and opening at its points, of that  (C, (s + 1) P, m)
kn, ks   stiffness of points                       (C, P)
=======  ========================================  =================

Forces are counted in ``force``, displacements in what a joint of mean area gives under it, turns
times ``size``: so the stiffness of joints is in no number, and drops out of all answers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.extensions.incremental.placing import merged, points_of
from cvxlimit.model.statics import DOF
from cvxlimit.reductions.planar import Plane
from cvxlimit.scene import Scene
from cvxlimit.solvers.compiled import CHOLESKY
from cvxlimit.solvers.sparse import Solve, Supernodal, elimination_order

FLOATING = 1e-8
"""Stiffness of the ground to which every block is tied besides, over that of a joint of mean area:
blocks that nothing presses have a place with it, and it is left out of all forces. Larger ones slow
Newton's method down, smaller ones are lost in the rounding of a factorisation."""


@dataclass(frozen=True, eq=False)
class Memory:
    """What points have gone through: plastic slips (C, s, P), plastic shortening (C, P), and where
    cohesion still holds (C, P)."""

    slipped: FloatArray
    shortened: FloatArray
    intact: BoolArray


@dataclass(frozen=True, eq=False)
class State:
    """What points bear: gaps, compressions N (C, P), shears T (C, s, P), the ``limit`` of these
    (C, P), and which of them slide or yield.

    ``elastic`` (C, s, P) is the slip but for its plastic part, ``along`` its direction, turned
    round, and ``scale`` (C, P) the limit over the shear without one.
    """

    gap: FloatArray
    N: FloatArray
    elastic: FloatArray
    T: FloatArray
    along: FloatArray
    scale: FloatArray
    limit: FloatArray
    slides: BoolArray
    yields: BoolArray


class Joints:
    """The joints of a scene, all at once.

    Parameters
    ----------
    scene : Scene
    plane : Plane or None
        That of a planar scene, whose blocks then move in three ways.
    ratio : float
        Shear stiffness over normal stiffness.

    Attributes
    ----------
    contacts, number, mean_area : Contacts, int, float
        Those of the scene, how many they are, and the mean area of those that are faces.
    plane, ratio, ways, slips : Plane or None, float, int, int
        As given, and q and s above.
    at, share : array (C, P, 2), in a plane (C, P, 1); array (C, P)
        Places of points on their joint, and their parts of its area: 0 where there is no point.
    kn, ks, softness : arrays (C, P)
        Stiffness, and 1 / kn: 0 where there is no point.
    mu, cohesion, low, high : arrays (C, P)
        Friction, cohesion, and the least and largest N; finite above where stone crushes.
    crushes, draws : boolean arrays (C, P)
        Points with a largest N, and with a least one below zero.
    ends : array (C, 2)
        Numbers of a joint's two blocks among the free ones; -1 for a support.
    G, B : arrays
        See above.
    turn : array (6, 3)
        The three motions in the plane of a planar scene; others have none.
    dead, live : arrays
        Loads, one number for each way in which a free block moves.
    dead_forces : array (free blocks, 3)
        Dead loads without their moments.
    size, force : float
        Units of length and force.
    pattern : Pattern
        Where the blocks of joints are in the matrix of all.
    """

    def __init__(self, scene: Scene, plane: Plane | None, ratio: float) -> None:
        contacts = self.contacts = scene.contacts
        self.plane, count = plane, len(scene.free)
        self.size = float(np.median([scene.blocks[i].size for i in scene.free]))
        self.dead_forces = scene.dead_forces[:, :3]
        dead = np.abs(self.dead_forces).sum()
        self.force = float(dead or np.abs(scene.live_forces[:, :3]).sum()) / count
        self.ratio, self.number = ratio, len(contacts)
        self._points()
        self._motions(scene)
        self.pattern = Pattern(self.ends, count, self.ways)
        self.dead_forces = self.dead_forces / self.force
        down = np.repeat([1.0, 1.0 / self.size], 3) / self.force
        dead, live = (
            (load * down) @ self.turn if plane is not None else load * down
            for load in (scene.dead_forces, scene.live_forces)
        )
        self.dead, self.live = dead.ravel(), live.ravel()

    def _points(self) -> None:
        """Places, shares and strengths of points, joint by joint."""
        contacts, plane = self.contacts, self.plane
        found = []
        for j in range(self.number):
            at, share = points_of(contacts, j)
            if plane is not None:
                at, share = merged((at @ plane.along[j])[:, None], share)
            found.append((at, share))
        most = max(len(share) for _, share in found)
        self.at = np.zeros((self.number, most, 1 if plane is not None else 2))
        share = self.share = np.zeros((self.number, most))
        for j, (at, own) in enumerate(found):
            self.at[j, : len(own)], share[j, : len(own)] = at, own
        faces = contacts.faces
        mean = float(contacts.area[faces].mean()) if len(faces) else float(contacts.area.mean())
        area = contacts.area[:, None] * share
        self.kn, self.mean_area = area / mean, mean
        self.ks = self.ratio * self.kn
        self.softness = np.divide(1.0, self.kn, out=np.zeros_like(area), where=area > 0.0)
        is_point = contacts.is_point
        self.mu = np.where(is_point, 0.0, contacts.friction)[:, None] * np.ones_like(share)
        self.cohesion = contacts.cohesion[:, None] * area / self.force
        with np.errstate(invalid="ignore"):
            crushing = np.where(area > 0.0, contacts.compressive_strength[:, None] * area, 0.0)
        signed = contacts.sense[:, None] * np.stack([contacts.least, contacts.most], 1)
        low, high = signed.min(axis=1), signed.max(axis=1)
        self.low = np.where(is_point, low, 0.0)[:, None] * np.sign(share) / self.force
        high = np.where(is_point, high, np.inf)[:, None]
        self.high = np.minimum(np.where(share > 0.0, high, 0.0), crushing) / self.force
        # points that keep what they have been shortened by: all whose force ends at a strength
        self.crushes, self.draws = np.isfinite(self.high) & (self.high > 0.0), self.low < 0.0

    def _motions(self, scene: Scene) -> None:
        """Motions of joints by blocks' (G), and of points by joints' (B)."""
        contacts, size = self.contacts, self.size
        n, row = self.number, np.full(len(scene.blocks), -1)
        row[scene.free] = np.arange(len(scene.free))
        G, axes = np.zeros((n, 6, 12)), np.asarray(contacts.axes)
        centroid = np.array([block.centroid for block in scene.blocks])
        for side, (sign, block) in enumerate(((-1.0, contacts.a), (1.0, contacts.b))):
            arm, k = contacts.origin - centroid[block], 6 * side
            G[:, :3, k : k + 3] = sign * axes
            G[:, :3, k + 3 : k + 6] = sign * np.cross(arm[:, None], axes) / size
            G[:, 3:, k + 3 : k + 6] = sign * axes / size
        self.ends = np.stack([row[contacts.a], row[contacts.b]], axis=1)
        P = self.share.shape[1]
        one, zero = np.ones((n, P)), np.zeros((n, P))
        if self.plane is None:
            x, y = self.at[:, :, 0], self.at[:, :, 1]
            rows = [
                [one, zero, zero, zero, zero, -y],
                [zero, one, zero, zero, zero, x],
                [zero, zero, one, y, -x, zero],
            ]
            self.ways, self.slips, self.G = DOF, 2, G
        else:  # motions in the plane, turns about its normal
            normal = self.plane.normal
            first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
            first /= np.linalg.norm(first)
            self.turn = np.zeros((6, 3))
            self.turn[:3, 0], self.turn[:3, 1] = first, np.cross(normal, first)
            self.turn[3:, 2] = normal
            seen = np.zeros((n, 3, 6))
            seen[:, 0, :2], seen[:, 1, 2] = self.plane.along, 1.0
            seen[:, 2, 3:5] = self.plane.across
            both = np.zeros((12, 6))
            both[:6, :3] = both[6:, 3:] = self.turn
            rows = [[one, zero, zero], [zero, one, -self.at[:, :, 0]]]
            self.ways, self.slips, self.G = 3, 1, seen @ G @ both
        stacked = np.stack([np.stack(row, axis=-1) for row in rows], axis=1)
        self.B = np.ascontiguousarray(stacked.reshape(n, -1, self.ways))

    def untouched(self) -> Memory:
        n, P = self.share.shape
        return Memory(np.zeros((n, self.slips, P)), np.zeros((n, P)), self.cohesion > 0.0)

    def motions(self, d: FloatArray) -> FloatArray:
        """Slips and openings (C, s + 1, P) at displacements d."""
        m = self.G @ self.pattern.gathered(d)[:, :, None]
        return (self.B @ m).reshape(self.number, self.slips + 1, -1)

    def factorised(self, state: State, is_held: bool, drag: float = 0.0) -> Solve:
        """Solver of what joints resist from a state on, with a drag of blocks besides; with
        friction held it is symmetric."""
        return self.pattern.factorised(self.tangent(state, is_held), FLOATING + drag, is_held)

    def energy(self, state: State) -> float:
        """What it takes to bring joints to a state with friction held: squares, and Huber's
        function."""
        pressed, shear = -self.kn * state.gap, self.ks * np.sqrt((state.elastic**2).sum(axis=1))
        least = np.minimum(state.limit, shear)
        normal = state.N * (pressed - state.N / 2.0) * self.softness
        return float((normal + least * (shear - least / 2.0) * self.softness / self.ratio).sum())

    def forces(self, state: State) -> FloatArray:
        """Contact forces (C, 6) in the scene's units."""
        stress = np.concatenate([state.T, state.N[:, None]], axis=1).reshape(self.number, 1, -1)
        local = self.force * (stress @ self.B)[:, 0]
        if self.plane is None:
            return local
        result = np.zeros((self.number, 6))
        result[:, :2] = local[:, :1] * self.plane.along
        result[:, 2] = local[:, 1]
        result[:, 3:5] = local[:, 2:] * self.plane.across
        return result

    def rates(self, d: FloatArray) -> FloatArray:
        """Displacements (free blocks, 6), of which one has live power 1 in the scene's units."""
        power = self.force * float(self.live @ d)
        moved = (d / power).reshape(-1, self.ways)
        full = moved if self.plane is None else moved @ self.turn.T
        return full * np.repeat([1.0, 1.0 / self.size], 3)

    def state(
        self, d: FloatArray, gaps: FloatArray, memory: Memory, held: FloatArray | None = None
    ) -> State:
        """What points bear at displacements d; friction is ``held`` (C, P), or goes with N."""
        moved = self.motions(d)
        gap = moved[:, -1] + gaps[:, None] + memory.shortened
        pressed = -self.kn * gap
        N = np.clip(pressed, self.low, self.high)
        yields = (pressed < self.low) | (pressed > self.high)
        elastic = moved[:, :-1] - memory.slipped
        trial = -self.ks[:, None] * elastic
        size = np.sqrt((trial**2).sum(axis=1)) if self.slips > 1 else np.abs(trial[:, 0])
        size = np.maximum(size, 1e-200)
        r = self.limit(N, memory) if held is None else held
        slides = size > r
        T = trial * np.where(slides, r / size, 1.0)[:, None]
        return State(gap, N, elastic, T, trial / size[:, None], r / size, r, slides, yields)

    def opening(self, d: FloatArray, gaps: FloatArray) -> tuple[State, FloatArray]:
        """What points bear at displacements d where those that slide open by mu times their slip:
        the nearest forces within friction; and what these resist together with their blocks, (C,
        2 q, 2 q).

        A point with gap g and slip e (s,), in all ``size`` = |e|, bears N = -kn g and T = -ks e
        where ks |e| <= mu N. Else it slides by l <= |e|, opens by mu l, and bears mu N against e:

            N = kn (mu l - g),  mu N = ks (|e| - l),  hence  N = c (mu |e| - g)

        with c = kn / (1 + mu^2 kn / ks). Its tangent, with t = -e / |e| (``along``) and dg and de
        rows of B, is

            -dN = c (dg + mu t . de),  -dT = (mu N / |e|) (I - t t') de + mu t (-dN),

        and -dN = kn dg, -dT = ks de where it sticks; c is zero where N is at an end (``yields``).
        """
        moved = self.motions(d)
        gap, elastic = moved[:, -1] + gaps[:, None], moved[:, :-1]
        size = np.maximum(np.sqrt((elastic**2).sum(axis=1)), 1e-200)
        mu, ks = self.mu, self.ks
        slides = ks * size > mu * np.maximum(-self.kn * gap, 0.0)
        c = np.where(slides, self.kn / (1.0 + mu**2 / self.ratio), self.kn)
        pressed = c * (np.where(slides, mu * size, 0.0) - gap)
        N = np.clip(pressed, self.low, self.high)
        yields = (pressed < self.low) | (pressed > self.high)
        along = -elastic / size[:, None]
        T = np.where(slides, mu * np.maximum(N, 0.0), ks * size)[:, None] * along
        # The tangent: ``resisted`` is -dN, ``slid`` t . de.
        n, s, m = self.number, self.slips, self.ways
        B = self.B.reshape(n, s + 1, -1, m)
        c = np.where(yields, 0.0, c)
        resisted = c[:, :, None] * B[:, s]
        slid = sum(along[:, i][:, :, None] * B[:, i] for i in range(s))
        resisted = resisted + np.where(slides, mu * c, 0.0)[:, :, None] * slid
        turn = np.where(slides, mu * np.maximum(N, 0.0) / size, ks)
        changed = np.empty_like(B)
        changed[:, s] = resisted
        for i in range(s):
            e = along[:, i][:, :, None]
            across = B[:, i] - np.where(slides[:, :, None], e * slid, 0.0)
            sliding = np.where(slides, mu, 0.0)[:, :, None] * e * resisted
            changed[:, i] = turn[:, :, None] * across + sliding
        K = np.swapaxes(self.B, 1, 2) @ changed.reshape(n, -1, m)
        state = State(gap, N, elastic, T, along, np.ones_like(N), mu * N, slides, yields)
        return state, np.swapaxes(self.G, 1, 2) @ (K @ self.G)

    def opened_energy(self, state: State) -> float:
        """What it takes to bring joints to a state of :meth:`opening`."""
        work = -state.N * state.gap - (state.T * state.elastic).sum(axis=1)
        kept = (state.N**2 + (state.T**2).sum(axis=1) / self.ratio) * self.softness / 2.0
        return float((work - kept).sum())

    def settled(self, state: State) -> Memory:
        """The memory with which a state of :meth:`opening` is one of joints that do not open as
        they slide."""
        slipped = state.elastic + state.T * (self.softness / self.ratio)[:, None]
        shortened = np.where(state.N > 0.0, -state.N * self.softness - state.gap, 0.0)
        return replace(self.untouched(), slipped=slipped, shortened=shortened)

    def limit(self, N: FloatArray, memory: Memory) -> FloatArray:
        """Largest shear (C, P) under compressions N."""
        return self.mu * np.maximum(N, 0.0) + np.where(memory.intact, self.cohesion, 0.0)

    def load(self, state: State) -> FloatArray:
        """What the joints do to the blocks, one number for each way in which these move."""
        stress = np.concatenate([state.T, state.N[:, None]], axis=1).reshape(self.number, 1, -1)
        return self.pattern.added(((stress @ self.B) @ self.G)[:, 0])

    def tangent(self, state: State, is_held: bool) -> FloatArray:
        """What the blocks of each joint resist, (C, 2 q, 2 q).

        Points bear T = r t where they slide, with t = -e / |e| (``along``) of their elastic slip e
        and r = mu N + cohesion, unless r is held. So with dg and de rows of B

            -dN = kN dg,  -dT = f (I - t t') de + mu kN t dg,  f = r / |e|,

        without the last part where r is held, and -dT = ks de where they stick. kN is kn, but zero
        where N is at an end (``yields``).
        """
        n, s, m = self.number, self.slips, self.ways
        B = self.B.reshape(n, s + 1, -1, m)
        kN = np.where(state.yields, 0.0, self.kn)
        e, slides = state.along, state.slides
        f = self.ks * np.where(slides, state.scale, 1.0)
        changed = np.empty_like(B)
        changed[:, s] = kN[:, :, None] * B[:, s]
        g = np.where(slides, f, 0.0)
        for i in range(s):
            along = (f - g * e[:, i] ** 2)[:, :, None] * B[:, i]
            for k in range(s):
                if k != i:
                    along -= (g * e[:, i] * e[:, k])[:, :, None] * B[:, k]
            if not is_held:
                along += np.where(slides, self.mu * e[:, i] * kN, 0.0)[:, :, None] * B[:, s]
            changed[:, i] = along
        K = np.swapaxes(self.B, 1, 2) @ changed.reshape(n, -1, m)
        return np.swapaxes(self.G, 1, 2) @ (K @ self.G)

    def after(self, state: State, memory: Memory) -> Memory:
        """The memory once a state is reached."""
        back = state.elastic + state.T * (self.softness / self.ratio)[:, None]
        slipped = memory.slipped + np.where(state.slides[:, None], back, 0.0)
        beyond = -state.gap - state.N * self.softness
        crushed = self.crushes & (beyond > 0.0) & (state.N > 0.0)
        drawn = self.draws & (beyond < 0.0)
        shortened = memory.shortened + np.where(crushed | drawn, beyond, 0.0)
        return Memory(slipped, shortened, memory.intact & ~self.broken(state, memory))

    @staticmethod
    def broken(state: State, memory: Memory) -> BoolArray:
        """Where cohesion held and does not any more (C, P): points that slide or open."""
        return memory.intact & (state.slides | (state.gap > 0.0))


class Pattern:
    """Where what joints resist goes in the matrix of all blocks, in the order of elimination."""

    def __init__(self, ends: IntArray, count: int, ways: int) -> None:
        both = ends[(ends >= 0).all(axis=1)]
        links = np.concatenate([both, both[:, ::-1]])
        graph = sp.coo_array((np.ones(len(links)), links.T), shape=(count, count)).tocsr()
        # Blocks in the order of elimination, and the row of every motion in it: supports have none.
        order = elimination_order(sp.csr_array(graph + sp.eye_array(count)))
        rank = np.argsort(order)
        self.size, self.ways = ways * count, ways
        self.order = (order[:, None] * ways + np.arange(ways)).ravel()
        placed = np.where(ends >= 0, rank[np.maximum(ends, 0)], -1)
        dof = ways * placed[:, :, None] + np.arange(ways)
        self.has = np.broadcast_to((ends >= 0)[:, :, None], dof.shape).reshape(len(ends), -1)
        dof = np.where(self.has, dof.reshape(len(ends), -1), 0)
        kept = self.has[:, :, None] & self.has[:, None, :]
        self.kept = np.flatnonzero(kept.ravel())
        # Compressed columns, and where in them each entry of a joint's matrix is added.
        row = np.broadcast_to(dof[:, :, None], kept.shape)[kept]
        column = np.broadcast_to(dof[:, None, :], kept.shape)[kept]
        key = column.astype(np.int64) * self.size + row
        diagonal = np.arange(self.size, dtype=np.int64) * (self.size + 1)
        unique, where = np.unique(np.concatenate([key, diagonal]), return_inverse=True)
        self.where, self.diagonal = where[: len(key)], where[len(key) :]
        self.entries = len(unique)
        self.indices = (unique % self.size).astype(np.int32)
        columns = unique // self.size
        self.indptr = np.searchsorted(columns, np.arange(self.size + 1)).astype(np.int32)
        self.is_lower = self.indices >= columns
        # The same motions in the order of the blocks, as displacements and loads have it.
        natural = ways * np.maximum(ends, 0)[:, :, None] + np.arange(ways)
        self.dof = np.where(self.has, natural.reshape(len(ends), -1), 0)
        self.own = self.dof[self.has]

    @cached_property
    def cholesky(self) -> Supernodal | None:
        if CHOLESKY is None:
            return None
        kept = np.concatenate([[0], np.cumsum(self.is_lower)])
        return Supernodal(self.indices[self.is_lower], kept[self.indptr])

    def factorised(self, blocks: FloatArray, shift: float, is_symmetric: bool) -> Solve:
        data = np.bincount(self.where, blocks.ravel()[self.kept], self.entries).astype(float)
        data[self.diagonal] += shift
        solve = self._solver(data, is_symmetric)

        def solved(right: FloatArray) -> FloatArray:
            result = np.empty_like(right)
            result[self.order] = solve(right[self.order])
            return result

        return solved

    def _solver(self, data: FloatArray, is_symmetric: bool) -> Any:
        if is_symmetric and self.cholesky is not None:
            try:
                return self.cholesky.factorise(data[self.is_lower])
            except ArithmeticError:
                pass
        shape = (self.size, self.size)
        matrix = sp.csc_array((data, self.indices, self.indptr), shape=shape)
        options = {"SymmetricMode": True, "Equil": False}
        try:
            lu = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.01, options=options)
        except RuntimeError:  # exactly singular: no direction
            return lambda right: np.full_like(right, np.nan)
        return lu.solve

    def gathered(self, d: FloatArray) -> FloatArray:
        """Displacements (C, 2 q) of the two blocks of each joint; zero for supports."""
        return np.where(self.has, d[self.dof], 0.0)

    def added(self, v: FloatArray) -> FloatArray:
        """Sums of (C, 2 q) over joints, one number for each way in which a free block moves."""
        return np.bincount(self.own, v[self.has], self.size).astype(float)
