"""Derivatives of a load factor, from the forces and the mechanism that prove it, without a solve.

By the envelope theorem the forces x and the mechanism u of an optimum may be held constant while a
parameter p of the problem changes: with u scaled to live power 1,

    dalpha/dp = -u . d(A x + dead + alpha live)/dp - lam . dy(x)/dp.

The part of a contact is the derivative of one number, -(A'u) . x - lam . y(x), by the contact's own
properties. Central differences of this number are taken for all contacts at once; their rounding is
1e-11 of its terms, and they need nothing of a surface but its conditions.

====== ===================== ====================================================================
letter name                  meaning
====== ===================== ====================================================================
alpha  ``factor``            load factor
x      ``Proof.internal``    internal forces (p,): corner compressions, shears and torsion
x      ``Proof.forces``      the same as contact forces (n, 6), V1 V2 N M1 M2 MT, N > 0 pressed
u      ``Proof.rates``       rates (blocks, 6): velocity of the centroid and angular velocity
lam    ``Proof.multipliers`` multipliers >= 0 of the conditions y(x) <= 0
A                            equilibrium matrix: A x + dead + alpha live = 0
====== ===================== ====================================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import COLUMN, Contacts
from cvxlimit.geometry.facing import Reach, patches
from cvxlimit.geometry.mesh import volume_and_centroid
from cvxlimit.model.crushing import EffectiveRectangles, model_of
from cvxlimit.model.formulations import corner_compressions
from cvxlimit.model.mortar import without_tension
from cvxlimit.model.statics import Statics
from cvxlimit.proof.conditions import ConditionRows
from cvxlimit.proof.flow import FlowRule, corner_openings
from cvxlimit.results.corners import Follows, Shapes, followed, volume_slopes
from cvxlimit.results.movement import block_rates
from cvxlimit.results.uniqueness import others
from cvxlimit.results.utilisation import forces_of
from cvxlimit.scene import Load
from cvxlimit.solution import Solution
from cvxlimit.solution.kinematics import relative_rates, velocity_of
from cvxlimit.surfaces import YieldSurface

_STEP = 1e-5
"""Step of central differences, as a share of the value or of the contact's size: their error is its
square, 1e-10, and rounding gives as much."""

_NEARLY = 1e-4
"""Share of a contact's largest opening that counts as closed. Corners that open keep a compression
of about its square, which is rounding."""

_TRIAL = 1e-3
"""Change of forces, as a share of the largest, with which slopes are compared. A difference of
slopes below a hundredth of it is put down to rounding: that is the largest width of a bracket."""

_INSIDE = 1e-3
"""Factor on the step for contacts of several pieces, whose corners may lie on the hull's edges: the
step is then below the tolerance with which contacts are checked, and rounding still 1e-8."""

JOINTS = ("friction", "cohesion", "compressive_strength", "tensile_strength", "most")
"""The properties of contacts by which derivatives are taken, as contacts name them; ``"most"`` is
the bound of reactions and ties."""


@dataclass(frozen=True, eq=False)
class ByLoad:
    """The derivative of the load factor by one number of the loads.

    Attributes
    ----------
    case : str
        ``"dead"`` or ``"live"``.
    kind : str
        The argument of :class:`~cvxlimit.Load` that the number belongs to.
    block : str
        Id of the loaded block; empty for loads on all blocks.
    component : str
        Which number of that argument it is, ``"fx"`` for example.
    value : float
        The number itself, in the scene's units.
    derivative : float
        Change of the load factor per unit of it.
    """

    case: str
    kind: str
    block: str
    component: str
    value: float
    derivative: float


class Proof:
    """Forces and mechanism of a solution, and the number of the module's text at changed
    contacts."""

    def __init__(self, solution: Solution, surfaces: Sequence[YieldSurface]) -> None:
        self.scene, self.surfaces = solution.scene, surfaces
        scene, contacts = self.scene, self.scene.contacts
        # Rates of all blocks, zero for fixed ones, scaled to live power 1.
        rates = block_rates(scene, solution)
        self.rates = rates / float((rates[scene.free] * scene.live_forces).sum())
        pressed, pull = without_tension(contacts)
        forces = np.array(forces_of(scene, solution))
        relative = relative_rates(scene, self.rates)
        model = model_of(corner_compressions, pressed)
        flow = FlowRule(surfaces, model)
        self.multipliers = flow.shortfall(relative).multipliers
        forces[:, COLUMN["N"]] += pull
        # Internal forces that give the solution's contact forces.
        crushing = EffectiveRectangles.of(pressed)
        if not model.conditions or crushing is not None:
            stated = () if crushing is None else crushing.stated(forces)
            faces = forces[pressed.faces]
            self.internal = np.concatenate(
                [_corner_forces(pressed, forces, relative), *faces.T[[0, 1, 5]], *stated]
            )
        elif solution.internal is not None and len(solution.internal) == len(model.nonneg):
            self.internal = solution.internal
        else:
            raise InputError(
                f"the solution of {solution.scene_name!r} does not hold the pressures on joints "
                "that crush, on which derivatives rest: solve the scene anew"
            )
        self.forces = model.forces(self.internal)
        self.forces[:, COLUMN["N"]] -= pull

    @cached_property
    def shapes(self) -> Shapes:
        """The outlines of all contacts."""
        return Shapes.of(self.scene.contacts)

    @cached_property
    def followed(self) -> list[Follows]:
        """How the outlines follow the vertices of blocks."""
        blocks = self.scene.blocks
        table = patches(blocks, Reach.of(blocks, self.scene.joint_tolerance))
        return list(followed(self.shapes, blocks, table))

    def moving(self, contacts: Contacts) -> tuple[FloatArray, FloatArray]:
        """Returns the velocities of b against a at the contacts' origins, and their relative
        angular velocities, (n, 3) each."""
        a, b, rates = contacts.a, contacts.b, self.rates
        one, other = (velocity_of(self.scene, rates, contacts.origin, block) for block in (a, b))
        return other - one, rates[b, 3:] - rates[a, 3:]

    def at(self, contacts: Contacts) -> FloatArray:
        """Returns -(A'u) . x - lam . y(x) of every contact (n,), with the properties and the
        geometry of ``contacts`` in place of the scene's."""
        pressed, pull = without_tension(contacts)
        model = model_of(corner_compressions, pressed)
        forces = model.forces(self.internal)
        forces[:, COLUMN["N"]] -= pull
        # The first term: contact forces times relative rates at the contacts' origins.
        parts = [np.einsum("nik,nk->ni", contacts.axes, part) for part in self.moving(contacts)]
        result = -(forces * np.concatenate(parts, axis=1)).sum(axis=1)
        # The second: multipliers times the excess of each condition.
        strength = ConditionRows(self.surfaces, model)
        excess = strength.excess(self.internal)
        np.subtract.at(result, strength.resistance.contact, self.multipliers * excess)
        return result

    def elsewhere(self) -> tuple[bool, Proof]:
        """Returns whether there are other mechanisms, and a proof with slightly different forces
        that comply with this mechanism, the same ones if they are unique."""
        contacts = without_tension(self.scene.contacts)[0]
        strength = ConditionRows(self.surfaces, model_of(corner_compressions, contacts))
        rates = relative_rates(self.scene, self.rates)
        matrix = Statics.of(self.scene).matrix
        several, change = others(matrix, strength, self.internal, rates, self.multipliers)
        result = copy(self)
        result.internal = self.internal + _TRIAL * float(np.abs(self.forces[:, :3]).max()) * change
        return several, result


def _corner_forces(contacts: Contacts, forces: FloatArray, relative: FloatArray) -> FloatArray:
    """Returns compressions (m,) at the m corners of contacts that amount to N, M1 and M2.

    They press corners that do not open in the mechanism, as far as these suffice: a sequence of
    reweighted least-norm problems, which converges to a vertex of the corresponding linear program.
    """
    # The opening of each corner, as a share of the contact's largest.
    j, (x, y) = contacts.corner_contact, contacts.corner_xy.T
    opening = corner_openings(relative, contacts)
    opening = opening - contacts.corner_minimum(opening)[j]
    largest = -contacts.corner_minimum(-opening)[j]
    away = np.where(largest > 0.0, opening / np.where(largest > 0.0, largest, 1.0), 0.0)
    size = np.sqrt(contacts.area)[j]
    # Three equations for each contact, moments divided by its size.
    columns = np.stack([np.ones(len(x)), y / size, -x / size], axis=1)
    wanted = forces[:, 2:5] / np.sqrt(contacts.area)[:, None] ** [0, 1, 1]
    weight, compression = 1.0 / (away + _NEARLY), np.zeros(len(x))
    for last in (0, 0, 0, 0, 2):  # the last is refined, as its weights differ by many orders
        square = np.zeros((len(contacts), 3, 3))
        np.add.at(square, j, weight[:, None, None] * columns[:, :, None] * columns[:, None, :])
        inverse, compression = np.linalg.pinv(square, hermitian=True), np.zeros(len(x))
        for _ in range(1 + last):
            left = wanted.copy()
            np.subtract.at(left, j, compression[:, None] * columns)
            by = np.einsum("nik,nk->ni", inverse, left)
            compression = compression + weight * np.einsum("mi,mi->m", columns, by[j])
        weight = np.maximum(compression, 0.0) / (away + _NEARLY) + _NEARLY * weight.mean()
    return compression


def _by_joint(proof: Proof, name: str) -> FloatArray:
    """Returns the derivatives (n,) by property ``name`` of every contact: central differences, and
    forward ones from 0, below which there are no values."""
    contacts = proof.scene.contacts
    if name == "most":  # what is at its bound does that much power per unit where it closes
        closing = -contacts.sense * relative_rates(proof.scene, proof.rates)[:, COLUMN["N"]]
        return np.where(contacts.is_point, np.maximum(closing, 0.0), 0.0)
    value = getattr(contacts, name)
    unit = np.abs(proof.forces[:, :3]).max() / contacts.area
    step = _STEP * np.where((value > 0.0) & np.isfinite(value), value, unit)
    step = np.where(np.isfinite(value), step, 0.0)
    back = np.where(value > 0.0, -1.0, 0.0)

    def at(way: float | FloatArray) -> FloatArray:
        return proof.at(contacts.with_values(**{name: value + way * step}))

    if not step.any():
        return np.zeros(len(contacts))
    result = (at(1.0) - at(back)) / np.where(step > 0.0, (1.0 - back) * step, 1.0)
    return np.asarray(result)


def by_joints(proof: Proof, start: IntArray) -> tuple[dict[str, FloatArray], BoolArray]:
    """Returns derivatives through the contacts, and which vertices lie on edges of two blocks.

    The first is a mapping with the derivatives (n,) by each of :data:`JOINTS`, and by all vertices,
    (v, 3) under ``"vertices"``; the second is (v,). ``start`` (blocks + 1,) is the number of each
    block's first vertex.
    """
    contacts = proof.scene.contacts
    vertices, shared = np.zeros((start[-1], 3)), np.zeros(start[-1], dtype=bool)
    shapes = proof.shapes
    # By a shift of each outline point within the contact's plane: the first point of all contacts
    # at once, then the second and so on.
    by_point, counts = np.zeros_like(shapes.points), np.diff(shapes.start)
    step = _STEP * np.sqrt(contacts.area)
    step[list(shapes.pieces)] *= _INSIDE
    for k in range(int(counts.max(initial=0))):
        has = np.flatnonzero(counts > k)
        rows = shapes.start[has] + k
        for axis in range(2):
            shift = np.zeros_like(shapes.points)
            shift[rows, axis] = step[has]
            ends = [proof.at(shapes.moved(way * shift)) for way in (1.0, -1.0)]
            by_point[rows, axis] = ((ends[0] - ends[1]) / (2.0 * step))[has]
    # By a shift and a rotation of the whole contact, whose forces keep their components.
    force, moment = (
        np.einsum("nik,ni->nk", contacts.axes, part)
        for part in (proof.forces[:, :3], proof.forces[:, 3:])
    )
    shifting, turning = proof.moving(contacts)
    by_shift = -np.cross(force, turning)
    by_turn = -(np.cross(force, shifting) + np.cross(moment, turning))
    # Outline points, height and inclination of contacts follow the vertices of the blocks.
    for f in proof.followed:
        axes = contacts.axes[f.contact]
        own = slice(shapes.start[f.contact], shapes.start[f.contact + 1])
        flat = np.einsum("pvik,pi->vk", f.in_plane, by_point[own])
        lift = f.height * (by_shift[f.contact] @ axes[2])
        lift += np.cross(axes[2], f.tilt) @ by_turn[f.contact]
        at = start[f.block] + f.vertex
        vertices[at] += flat @ axes[:2] + lift[:, None] * axes[2]
        shared[at] |= f.shares
    return {name: _by_joint(proof, name) for name in JOINTS} | {"vertices": vertices}, shared


def add_bodies(proof: Proof, factor: float, vertices: FloatArray, start: IntArray) -> None:
    """Add to the derivatives by ``vertices`` (v, 3) what comes from the blocks' bodies.

    Volumes change weights, centroids change lever arms, and faces change pressures on them; point
    forces and pressures on given polygons stay where they are.
    """
    scene = proof.scene
    plain = [
        replace(load, growing=()).per_weight(scene.blocks) for load in (scene.dead, scene.live)
    ]
    times = (plain[0] + factor * plain[1])[:, :3]
    for i in scene.free.tolist():
        block, rates = scene.blocks[i], proof.rates[i]
        volume, centroid = volume_slopes(block)
        own = vertices[start[i] : start[i + 1]]
        own -= (block.density or 0.0) * volume * (times[i] @ rates[:3])
        central = block.weight * times[i]
        for load, by in ((scene.dead, 1.0), (scene.live, factor)):
            central = central + by * np.array(load.forces.get(block.id, np.zeros(6)))[:3]
            pressures = [p for p in load.pressures if p.block == block.id and p.corners is None]
            if pressures or load.growing:
                shaped = Load(pressures=pressures, growing=load.growing)
                own -= by * _by_shape(shaped, block, rates)
        own -= np.einsum("vcx,c->vx", centroid, np.cross(central, rates[3:]))


def _by_shape(load: Load, block: Block, rates: FloatArray) -> FloatArray:
    """Returns the derivatives (v, 3) of a load's power on one block by the block's vertices."""
    result, step = np.zeros_like(block.vertices), _STEP * block.size
    for at in np.ndindex(result.shape):
        ends = []
        for way in (step, -step):
            points = block.vertices.copy()
            points[at] += way
            volume, centroid = volume_and_centroid(points, block.faces)
            moved = replace(block, vertices=points, volume=volume, centroid=centroid)
            force = load.on([moved])[0]
            speed = rates[:3] + np.cross(rates[3:], centroid - block.centroid)
            ends.append(float(force[:3] @ speed + force[3:] @ rates[3:]))
        result[at] = (ends[0] - ends[1]) / (2.0 * step)
    return result


def by_loads(proof: Proof, factor: float) -> list[ByLoad]:
    """Returns the derivatives by every number that the dead and the live load are given by: less
    the power of what a unit more of it adds to the load."""
    scene, found = proof.scene, list[ByLoad]()
    place = {block.id: [i] for i, block in enumerate(scene.blocks)}
    for case, load, by in (("dead", scene.dead, 1.0), ("live", scene.live, factor)):
        for kind, block, names, values, units in _stated(load):
            rows = place[block] if block else scene.free.tolist()
            blocks, rates = [scene.blocks[i] for i in rows], proof.rates[rows]
            for name, value, unit in zip(names, values, units, strict=True):
                power = float((unit.on(blocks) * rates).sum())
                found.append(ByLoad(case, kind, block, name, float(value), -by * power))
    return found


def _stated(load: Load) -> Iterator[tuple[str, str, Sequence[str], Sequence[float], list[Load]]]:
    """Yields what a load is given by: kind, block or "" for all, names and values of the numbers,
    and the load that a unit more of each adds."""
    axes = [tuple(axis) for axis in np.eye(3).tolist()]
    for kind in ("gravity", "acceleration"):
        if (given := getattr(load, kind)) is not None:
            yield kind, "", "xyz", given, [Load(acceleration=axis) for axis in axes]
    for block, times in load.weights.items():
        yield "weights", block, "xyz", times, [Load(weights={block: axis}) for axis in axes]
    for block, force in load.forces.items():
        units = [Load(forces={block: tuple(unit)}) for unit in np.eye(6).tolist()]
        yield "forces", block, ("fx", "fy", "fz", "mx", "my", "mz"), force, units
    for p in load.points:
        pushed = [Load(points=[replace(p, force=axis)]) for axis in axes]
        turned = [Load(forces={p.block: (0, 0, 0, *np.cross(axis, p.force))}) for axis in axes]
        yield "points", p.block, ("fx", "fy", "fz", *"xyz"), (*p.force, *p.at), [*pushed, *turned]
    for q in load.pressures:
        names = ("pressure", "gradient.x", "gradient.y", "gradient.z")[: 1 if q.at is None else 4]
        units = [
            Load(pressures=[replace(q, pressure=unit[0], gradient=tuple(unit[1:]))])
            for unit in np.eye(4)[: len(names)].tolist()
        ]
        yield "pressures", q.block, names, (q.pressure, *q.gradient)[: len(names)], units
    for g in load.growing:
        units = [Load(growing=[replace(g, acceleration=axis)]) for axis in axes]
        yield "growing", "", "xyz", g.acceleration, units
