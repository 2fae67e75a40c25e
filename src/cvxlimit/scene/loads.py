"""Load cases: own weight, accelerations, forces at centroids and at points, pressure on faces."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray, IntArray, RemadeFromFields
from cvxlimit.base.checks import finite_vector, members, of_type
from cvxlimit.base.markup import html_table
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import area_vectors, fan, polygon_vectors

Vector = tuple[float, ...]
T = TypeVar("T")

FACING = np.cos(np.radians(10.0))
"""A pressure acts on the faces whose normal lies within 10 degrees of the one given.

Sides of bricks, voussoirs and vault stones are 60 degrees and more apart; the triangles and warped
quads that stand for one curved or rounded face differ by a few."""

REACH = 1.01
"""A point load acts no farther from its block's centroid than the farthest corner times this.

Coordinates rounded to a hundredth of the block still pass; a point in other units does not. The
bound is a sphere, so that a scene which passes also passes after any rotation."""


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
        _set(self, "at", _vector(self.at, 3, f"point {what}"))
        _set(self, "force", _vector(self.force, 3, f"force {what}"))


@dataclass(frozen=True)
class Pressure:
    """A uniform pressure on the faces of a block that look in one direction.

    Attributes
    ----------
    block : str
        Id of the block.
    normal : (3,)
        Where the loaded faces look, out of the block; any length but zero. All faces whose outward
        normal lies within 10 degrees of it are loaded, wholly.
    pressure : float
        Force per area; positive presses on the block (against ``normal``), negative pulls.

    Raises
    ------
    InputError
        If ``normal`` is zero, or a number is not finite.

    Example
    -------
    Wind of 0.8 kN/m2 on the side of a block that looks towards -y:

    >>> Pressure("b1", normal=(0, -1, 0), pressure=0.8).normal
    (0.0, -1.0, 0.0)
    """

    block: str
    normal: Vector
    pressure: float

    def __post_init__(self) -> None:
        what = f"of the pressure on block {self.block!r}"
        normal = finite_vector(self.normal, 3, f"normal {what}")
        length = float(np.linalg.norm(normal))
        if not 0.0 < length < np.inf:
            raise InputError(f"normal {what} must be a direction, got {normal.tolist()}")
        _set(self, "normal", tuple((normal / length).tolist()))
        _set(self, "pressure", finite_vector([self.pressure], 1, f"value {what}").tolist()[0])


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

    def __post_init__(self) -> None:
        for name in ("gravity", "acceleration"):
            value = getattr(self, name)
            if value is not None:
                _set(self, name, _vector(value, 3, name))
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
            checked = {key: _vector(v, length, f"{what} {key!r}") for key, v in given.items()}
            _set(self, name, MappingProxyType(checked))
        for name, kind in (("points", PointForce), ("pressures", Pressure)):
            what = f"{name} of a load must be {kind.__name__} objects"
            _set(self, name, members(getattr(self, name) or (), kind, what))

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
            elif each.name in ("points", "pressures"):
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

    def on(self, blocks: Iterable[Block]) -> FloatArray:
        """Generalised forces (n, 6) on ``blocks``, about their centroids; see :meth:`actions`."""
        known = list(blocks)
        what = self.actions(known)
        result = np.zeros((len(known), 6))
        arms = what.at - np.array([b.centroid for b in known]).reshape(-1, 3)[what.block]
        turning = what.moment + np.cross(arms, what.force)
        np.add.at(result, what.block, np.concatenate([what.force, turning], axis=1))
        return result

    def actions(self, blocks: Iterable[Block]) -> Actions:
        """Every single force that the load puts on ``blocks``; entries for others are left out.

        Raises
        ------
        InputError
            If a point load acts far off its block, or a block has no face for its pressure.
        """
        known = list(blocks)
        index = {block.id: i for i, block in enumerate(known)}
        parts = [self._body_forces(known)]
        for key, force in self.forces.items():
            if key in index:
                at = known[index[key]].centroid
                parts.append(_action(index[key], at, force[:3], force[3:]))
        parts += [
            _point_action(index[p.block], known[index[p.block]], p)
            for p in self.points
            if p.block in index
        ]
        parts += [
            _pressure_action(index[p.block], known[index[p.block]], p)
            for p in self.pressures
            if p.block in index
        ]
        names = ("block", "at", "force", "moment")
        return Actions(*(np.concatenate([getattr(x, name) for x in parts]) for name in names))

    def _body_forces(self, blocks: Sequence[Block]) -> Actions:
        times = np.zeros((len(blocks), 3))
        for part in (self.gravity, self.acceleration):
            times += 0.0 if part is None else np.array(part)
        if self.weights:
            times += [self.weights.get(block.id, (0.0, 0.0, 0.0)) for block in blocks]
        force = np.array([b.weight for b in blocks])[:, None] * times
        at = np.array([b.centroid for b in blocks]).reshape(-1, 3)
        return Actions(np.arange(len(blocks)), at, force, np.zeros_like(force))

    def moved(self, rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> Load:
        """The load after x -> rotation @ x + translation of the scene; ``rotation`` is (3, 3)."""
        turn, shift = np.asarray(rotation, dtype=float), np.asarray(translation, dtype=float)

        def turned(vector: Vector) -> Vector:
            return tuple((np.reshape(vector, (-1, 3)) @ turn.T).ravel().tolist())

        return Load(
            None if self.gravity is None else turned(self.gravity),
            None if self.acceleration is None else turned(self.acceleration),
            {key: turned(force) for key, force in self.forces.items()},
            [replace(p, at=tuple(turn @ p.at + shift), force=turned(p.force)) for p in self.points],
            [replace(p, normal=turned(p.normal)) for p in self.pressures],
            {key: turned(times) for key, times in self.weights.items()},
        )

    def scaled(self, length: float, force: float) -> Load:
        """The load in other units: lengths times ``length``, forces times ``force``.

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
            pressures=[replace(p, pressure=p.pressure * force / length**2) for p in self.pressures],
        )


def combined(loads: Sequence[Load], factors: ArrayLike) -> Load:
    """The sum of loads, each times its factor.

    >>> combined([Load(acceleration=(1, 0, 0)), Load(acceleration=(0, 1, 0))], [2, 3]).acceleration
    (2.0, 3.0, 0.0)
    """
    force, times = dict[str, FloatArray](), dict[str, FloatArray]()
    acceleration, points, pressures = np.zeros(3), [], []
    for load, factor in zip(loads, np.asarray(factors, dtype=float).tolist(), strict=True):
        for part in (load.gravity, load.acceleration):
            acceleration += factor * np.array(part or (0.0, 0.0, 0.0))
        for total, own in ((force, load.forces), (times, load.weights)):
            for block, value in own.items():
                total[block] = total.get(block, 0.0) + factor * np.array(value)
        points += [replace(p, force=tuple(factor * np.array(p.force))) for p in load.points]
        pressures += [replace(p, pressure=factor * p.pressure) for p in load.pressures]
    given = tuple(acceleration) if acceleration.any() else None
    return Load(None, given, force, points, pressures, times)  # type: ignore[arg-type]


def _point_action(i: int, block: Block, point: PointForce) -> Actions:
    distance = float(np.linalg.norm(point.at - block.centroid))
    reach = float(np.linalg.norm(block.vertices - block.centroid, axis=1).max())
    if distance > REACH * reach:
        raise InputError(
            f"a point load on block {block.id!r} acts at {list(point.at)}, {distance:g} from the "
            f"block's centroid, whose farthest corner is {reach:g} away: give a point of the block"
        )
    return _action(i, np.array(point.at), point.force, (0.0, 0.0, 0.0))


def _pressure_action(i: int, block: Block, load: Pressure) -> Actions:
    corners, owner = fan(block.vertices, block.faces)
    normals = area_vectors(block.vertices, block.faces)
    towards = normals @ np.array(load.normal) / np.linalg.norm(normals, axis=1)
    if towards.max() < FACING:
        nearest = normals[int(towards.argmax())]
        nearest = nearest / np.linalg.norm(nearest) + 0.0
        raise InputError(
            f"block {block.id!r} has no face that looks along {np.round(load.normal, 4).tolist()}, "
            f"where its pressure should act; the nearest one looks along "
            f"{np.round(nearest, 4).tolist()}"
        )
    chosen = (towards >= FACING)[owner]
    vectors, middles = polygon_vectors(corners[chosen]), corners[chosen].mean(axis=1)
    along = vectors @ np.array(load.normal)
    centre = (along[:, None] * middles).sum(axis=0) / along.sum()
    forces = -load.pressure * vectors
    moment = np.cross(middles - centre, forces).sum(axis=0)
    return _action(i, centre, forces.sum(axis=0), moment)


def _action(i: int, at: ArrayLike, force: ArrayLike, moment: ArrayLike) -> Actions:
    rows = [np.reshape(np.asarray(x, dtype=float), (1, 3)) for x in (at, force, moment)]
    return Actions(np.array([i]), *rows)


def _set(target: object, name: str, value: object) -> None:
    object.__setattr__(target, name, value)


def _vector(value: object, length: int, what: str) -> Vector:
    return tuple(finite_vector(value, length, what).tolist())


GRAVITY = Load(gravity=(0.0, 0.0, -1.0))
"""Dead load of most scenes: own weight along -z."""
