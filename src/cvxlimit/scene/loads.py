"""Load cases: self-weight, accelerations, forces at centroids and at points, pressure on faces."""

from __future__ import annotations

import reprlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray, IntArray, RemadeFromFields
from cvxlimit.base.checks import meant, members, of_type
from cvxlimit.base.markup import html_table
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import second_moments
from cvxlimit.scene.pressures import REACH, Pressure, Vector, set_field, vector


@dataclass(frozen=True)
class PointForce:
    """A force at a point of a block; its moment about the centroid follows.

    Attributes
    ----------
    block : str
        Id of the block.
    at : (3,)
        Point of the block, in the scene's coordinates.
    force : (3,)
        fx, fy, fz in the scene's force unit.

    Raises
    ------
    InputError
        If ``at`` or ``force`` is not three finite numbers.

    Example
    -------
    >>> PointForce("keystone", at=(0, 0, 2.5), force=(0, 0, -10)).force
    (0.0, 0.0, -10.0)
    """

    block: str
    at: Vector
    force: Vector

    def __post_init__(self) -> None:
        what = f"of the point load on block {self.block!r}"
        set_field(self, "at", vector(self.at, f"point {what}"))
        set_field(self, "force", vector(self.force, f"force {what}"))

    def resultant(self, block: Block) -> tuple[Vector, Vector, Vector]:
        """Returns the point, the force and the moment there, which is none, (3,) each.

        Raises
        ------
        InputError
            If the point is far off the block.
        """
        distance = float(np.linalg.norm(self.at - block.centroid))
        reach = float(np.linalg.norm(block.vertices - block.centroid, axis=1).max())
        if distance > REACH * reach:
            raise InputError(
                f"a point load on block {block.id!r} acts at {list(self.at)}, {distance:g} from "
                f"the block's centroid, whose farthest corner is {reach:g} away: give a point of "
                "the block"
            )
        return self.at, self.force, (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class GrowingAcceleration:
    """Inertia that grows linearly: from nothing at one point to an acceleration at another.

    Attributes
    ----------
    acceleration : (3,)
        In multiples of gravity, at ``top``.
    base, top : (3,)
        The acceleration is constant on planes across the line from base to top, none at base, and
        grows beyond top.

    Raises
    ------
    InputError
        If a number is not finite, or both points are one.

    Example
    -------
    The push of a wall's first mode, 4 m high:

    >>> growing = GrowingAcceleration((1, 0, 0), base=(0, 0, 0), top=(0, 0, 4))
    >>> tower = Block.box("tower", (0, 0, 0), (1, 1, 4), density=20.0)  # of weight 80
    >>> Load(growing=[growing]).on([tower]).round(6).tolist()  # at two thirds of the height
    [[40.0, 0.0, 0.0, 0.0, 26.666667, 0.0]]
    """

    acceleration: Vector
    base: Vector
    top: Vector

    def __post_init__(self) -> None:
        for each in fields(self):
            what = f"{each.name} of a growing acceleration"
            set_field(self, each.name, vector(getattr(self, each.name), what))
        if self.base == self.top:
            raise InputError(
                f"base and top of a growing acceleration are both {list(self.base)}: give the "
                "point without acceleration as base, and one where it is whole as top"
            )

    def per_weight(self, block: Block) -> FloatArray:
        """Force and moment (6,) about the block's centroid, for its weight of 1."""
        rise = np.subtract(self.top, self.base)
        slope = rise / (rise @ rise)
        arms = second_moments(block.vertices - block.centroid, block.faces) @ slope / block.volume
        force = float(slope @ (block.centroid - self.base)) * np.array(self.acceleration)
        return np.concatenate([force, np.cross(arms, self.acceleration)])


@dataclass(frozen=True, eq=False)
class Actions:
    """Single actions of a load: the block's index (k,), points, forces and moments there (k, 3)."""

    block: IntArray
    at: FloatArray
    force: FloatArray
    moment: FloatArray


@dataclass(frozen=True)
class Load(RemadeFromFields):
    """A load case, dead or live: the sum of everything that is given.

    Attributes
    ----------
    gravity : (3,) or None
        Unit vector; every free block is pulled along it by its own weight.
    acceleration : (3,) or None
        In multiples of gravity: the force on each free block is its weight times this vector.
    forces : mapping of block id to (6,)
        fx, fy, fz, mx, my, mz at the block's centroid, in the scene's units.
    points : sequence of PointForce
        Forces at points of blocks.
    pressures : sequence of Pressure
        Pressures on faces of blocks.
    weights : mapping of block id to (3,)
        Own weight of selected blocks: the force on the block is its weight times this vector.
    growing : sequence of GrowingAcceleration
        Accelerations that grow linearly, with height for example.

    Raises
    ------
    InputError
        If a number is not finite, gravity is no unit vector, or an entry is of another kind.

    Example
    -------
    >>> Load(acceleration=(0, 1, 0)).acceleration
    (0.0, 1.0, 0.0)

    A force of 3 at the edge of a unit cube, half its side above and beside the centroid:

    >>> cube = Block.box("cube", (0, 0, 0), (1, 1, 1), density=20.0)
    >>> Load(points=[PointForce("cube", (1, 0.5, 1), (3, 0, 0))]).on([cube]).tolist()
    [[3.0, 0.0, 0.0, 0.0, 1.5, 0.0]]
    """

    gravity: Vector | None = None
    acceleration: Vector | None = None
    forces: Mapping[str, Vector] = field(default_factory=dict)
    points: Sequence[PointForce] = ()
    pressures: Sequence[Pressure] = ()
    weights: Mapping[str, Vector] = field(default_factory=dict)
    growing: Sequence[GrowingAcceleration] = ()

    def __post_init__(self) -> None:
        for name in ("gravity", "acceleration"):
            value = getattr(self, name)
            if value is not None:
                set_field(self, name, vector(value, name))
        if self.gravity is not None and not np.isclose(
            np.linalg.norm(self.gravity), 1.0, atol=1e-6
        ):
            raise InputError(
                f"gravity must be a unit vector, got {list(self.gravity)}: density is already "
                "weight per volume; use acceleration for multiples of the weight"
            )
        for name, example, what in (
            ("forces", "(fx, fy, fz, mx, my, mz)", "force on block"),
            ("weights", "(0, 0, -1)", "multiple of the weight of block"),
        ):
            given = {} if getattr(self, name) is None else getattr(self, name)
            of_type(given, Mapping, f"{name} must be a mapping", f"write {{'b1': {example}}}")
            length = example.count(",") + 1
            checked = {key: vector(v, f"{what} {key!r}", length) for key, v in given.items()}
            set_field(self, name, MappingProxyType(checked))
        for name, kind in _LISTED.items():
            what = f"{name} of a load must be {kind.__name__} objects"
            set_field(self, name, members(getattr(self, name) or (), kind, what))

    def __repr__(self) -> str:
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        plain = ((k, dict(v) if isinstance(v, Mapping) else v) for k, v in values.items() if v)
        return f"Load({', '.join(f'{name}={reprlib.repr(value)}' for name, value in plain)})"

    def _repr_html_(self) -> str:
        rows: list[tuple[str, str]] = []
        for each in fields(self):
            value = getattr(self, each.name)
            if isinstance(value, Mapping):
                rows += [(f"{each.name} {block!r}", str(v)) for block, v in value.items()]
            elif each.name in _LISTED:
                rows += [(each.name, str(v)) for v in value]
            elif value is not None:
                rows.append((each.name, str(value)))
        return html_table("Load", ("what", "how much"), rows)

    @property
    def named(self) -> Iterator[str]:
        """Ids of all blocks that the load names, some perhaps more than once."""
        yield from self.forces
        yield from self.weights
        yield from (point.block for point in self.points)
        yield from (pressure.block for pressure in self.pressures)

    def check_blocks(self, case: str, blocks: Collection[str], supports: Collection[str]) -> None:
        """Raises InputError if the load, called ``case``, names a support or no block of the
        scene."""
        for key in self.named:
            if key not in blocks:
                cure = meant(key, blocks) or "name one of its blocks"
                raise InputError(
                    f"the {case} load names block {key!r}, which is not in the scene; {cure}"
                )
            if key in supports:
                raise InputError(
                    f"the {case} load acts on block {key!r}, which is a support and cannot move"
                )

    def on(self, blocks: Iterable[Block]) -> FloatArray:
        """Returns forces and moments (n, 6) on n ``blocks``, fx fy fz mx my mz about their
        centroids."""
        loaded = list(blocks)
        what = self.actions(loaded)
        result = np.zeros((len(loaded), 6))
        arms = what.at - np.array([b.centroid for b in loaded]).reshape(-1, 3)[what.block]
        turning = what.moment + np.cross(arms, what.force)
        np.add.at(result, what.block, np.concatenate([what.force, turning], axis=1))
        return result

    def actions(self, blocks: Iterable[Block]) -> Actions:
        """Returns every single force of the load on ``blocks``; those on other blocks are left out.

        Raises
        ------
        InputError
            If a point load acts far off its block, or a block has no face for its pressure.
        """
        loaded = list(blocks)
        index = {block.id: i for i, block in enumerate(loaded)}
        # Multiples of weights at all centroids, then forces at some, point loads and pressures.
        weights = np.array([block.weight for block in loaded])[:, None] * self.per_weight(loaded)
        all_of_them = [np.reshape([block.centroid for block in loaded], (-1, 3)),
                       weights[:, :3], weights[:, 3:]]  # fmt: skip
        placed: Sequence[PointForce | Pressure] = (*self.points, *self.pressures)
        rows: list[tuple[Any, ...]] = [
            (index[key], loaded[index[key]].centroid, force[:3], force[3:])
            for key, force in self.forces.items()
            if key in index
        ]
        rows += [
            (index[each.block], *each.resultant(loaded[index[each.block]]))
            for each in placed
            if each.block in index
        ]
        single = (np.reshape([row[k] for row in rows], (-1, 3)) for k in (1, 2, 3))
        return Actions(
            np.array([*range(len(loaded)), *(row[0] for row in rows)], dtype=np.int64),
            *(np.concatenate(both) for both in zip(all_of_them, single, strict=True)),
        )

    def per_weight(self, blocks: Sequence[Block]) -> FloatArray:
        """Returns forces and moments (n, 6) about the centroids per unit of each block's weight, of
        the parts of the load that are multiples of weights."""
        times = np.zeros((len(blocks), 6))
        for part in (self.gravity, self.acceleration):
            times[:, :3] += 0.0 if part is None else np.array(part)
        for i, block in enumerate(blocks):
            times[i, :3] += self.weights.get(block.id, (0.0, 0.0, 0.0))
            for each in self.growing:
                times[i] += each.per_weight(block)
        return times

    def moved(self, rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> Load:
        """Returns the load moved with the scene by x -> rotation @ x + translation; ``rotation`` is
        (3, 3)."""
        turn, shift = np.asarray(rotation, dtype=float), np.asarray(translation, dtype=float)

        def turned(vector: Vector) -> Vector:
            return tuple((np.reshape(vector, (-1, 3)) @ turn.T).ravel().tolist())

        return Load(
            None if self.gravity is None else turned(self.gravity),
            None if self.acceleration is None else turned(self.acceleration),
            {key: turned(force) for key, force in self.forces.items()},
            [replace(p, at=tuple(turn @ p.at + shift), force=turned(p.force)) for p in self.points],
            [p.moved(turn, shift) for p in self.pressures],
            {key: turned(times) for key, times in self.weights.items()},
            [
                GrowingAcceleration(
                    turned(g.acceleration), turn @ g.base + shift, turn @ g.top + shift
                )
                for g in self.growing
            ],
        )

    def scaled(self, length: float, force: float) -> Load:
        """Returns the load in other units: lengths times ``length``, forces times ``force``.

        Multiples of the weight stay as they are.
        """

        def times(vector: Vector, *factors: float) -> Vector:
            return tuple((np.repeat(factors, 3) * vector).tolist())

        return replace(
            self,
            forces={key: times(f, force, force * length) for key, f in self.forces.items()},
            points=[
                replace(p, at=times(p.at, length), force=times(p.force, force)) for p in self.points
            ],
            pressures=[p.scaled(length, force) for p in self.pressures],
            growing=[
                replace(g, base=times(g.base, length), top=times(g.top, length))
                for g in self.growing
            ],
        )


def combined(loads: Sequence[Load], factors: ArrayLike) -> Load:
    """Returns the sum of ``loads``, each times its factor.

    >>> combined([Load(acceleration=(1, 0, 0)), Load(acceleration=(0, 1, 0))], [2, 3]).acceleration
    (2.0, 3.0, 0.0)
    """
    force, times = dict[str, FloatArray](), dict[str, FloatArray]()
    acceleration, points, pressures, growing = np.zeros(3), [], [], []
    for load, factor in zip(loads, np.asarray(factors, dtype=float).tolist(), strict=True):
        for part in (load.gravity, load.acceleration):
            acceleration += factor * np.array(part or (0.0, 0.0, 0.0))
        for total, own in ((force, load.forces), (times, load.weights)):
            for block, value in own.items():
                total[block] = total.get(block, 0.0) + factor * np.array(value)
        points += [replace(p, force=tuple(factor * np.array(p.force))) for p in load.points]
        pressures += [p.times(factor) for p in load.pressures]
        growing += [
            replace(g, acceleration=tuple(factor * np.array(g.acceleration))) for g in load.growing
        ]
    total_acceleration = tuple(acceleration) if acceleration.any() else None
    return Load(None, total_acceleration, force, points, pressures, times, growing)  # type: ignore[arg-type]


_LISTED = {"points": PointForce, "pressures": Pressure, "growing": GrowingAcceleration}
"""Fields of a load that are sequences, with the class of their entries."""

GRAVITY = Load(gravity=(0.0, 0.0, -1.0))
"""Dead load of most scenes: self-weight along -z."""
