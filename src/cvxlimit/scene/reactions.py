"""Forces between bounds: reactions that push (soil, struts, backing, anchors), and ties that pull.

A reaction of size r along a direction d, at a point that moves with its block, is one unknown with
two bounds, least <= r <= most. It acts on a block, and its opposite on another one or on the
ground. Among contacts it is a point: a compression with nothing else, r = sense N.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray
from cvxlimit.base.checks import finite_vector, is_number, meant, of_type, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.mesh import plane_axes
from cvxlimit.scene.pressures import set_field, vector


@dataclass(frozen=True)
class Reaction:
    """A force on a block, of a size that equilibrium chooses between two bounds.

    Soil that resists, at most by its passive pressure times the area it acts on; a strut; an anchor
    that is tightened (``least`` above 0); a dowel (``least`` below 0). It keeps its direction.

    Attributes
    ----------
    block : str
        Id of the block that is pushed.
    at : (3,)
        Point of the block at which it acts.
    direction : (3,)
        Of the force on the block; only its direction counts.
    most, least : float
        Bounds of the force's size: least <= r <= most. ``most`` may be infinite: a prop.
    on : str or None
        Id of the block that pushes, and on which the opposite acts; None for the ground.

    Raises
    ------
    InputError
        For bounds that are no numbers or exclude each other, and for a direction of zero.

    Example
    -------
    >>> Reaction("b1", (0, 0, 1), (2, 0, 0), 12.0).direction
    (1.0, 0.0, 0.0)
    """

    block: str
    at: tuple[float, ...]
    direction: tuple[float, ...]
    most: float
    least: float = 0.0
    on: str | None = None

    def __post_init__(self) -> None:
        where = self._name
        of_type(self.block, str, f"block of {where} must be the id of a block")
        if self.on is not None:
            of_type(self.on, str, f"on of {where} must be the id of a block, or None")
        set_field(self, "at", vector(self.at, f"at of {where}"))
        direction = finite_vector(self.direction, 3, f"direction of {where}")
        size = float(np.linalg.norm(direction))
        if not size > 0.0:
            raise InputError(f"direction of {where} must not be zero: say where it pushes")
        if abs(size - 1.0) > ROUNDING:  # else a file's reader would change the last digit
            direction = direction / size
        set_field(self, "direction", tuple(direction.tolist()))
        for name in ("most", "least"):
            value = getattr(self, name)
            if not (is_number(value) and (np.isfinite(value) or (name, value) == ("most", np.inf))):
                raise InputError(f"{name} of {where} must be a number (a force), got {value!r}")
            set_field(self, name, float(value))
        if self.least > self.most:
            raise InputError(
                f"least of {where} must not be above its most, got {self.least:g} and "
                f"{self.most:g}: exchange them, or turn its direction round"
            )
        if self.most == self.least == 0.0:
            raise InputError(f"{where} has no force: give it a most above 0, or leave it out")
        if self.block == self.on:
            raise InputError(f"{where} acts between a block and itself: name two blocks")

    @property
    def _name(self) -> str:
        return f"reaction on {self.block!r}" + (f" from {self.on!r}" if self.on else "")

    def moved(self, rotation: FloatArray, translation: FloatArray) -> Reaction:
        """After x -> rotation @ x + translation."""
        at, direction = rotation @ self.at + translation, rotation @ self.direction
        return replace(self, at=tuple(at), direction=tuple(direction))

    def scaled(self, length: float, force: float) -> Reaction:
        """Returns the reaction in other units."""
        at = tuple(length * np.array(self.at))
        return replace(self, at=at, most=force * self.most, least=force * self.least)


@dataclass(frozen=True)
class Tie:
    """A straight tie between two blocks, or a block and a support.

    Attributes
    ----------
    a, b : str
        Ids of the blocks.
    start, end : (3,)
        Its anchors, moving with block a and with block b.
    yield_force : float

    Example
    -------
    >>> Tie("left", "right", (0, 0, 1), (4, 0, 1), 12.0).length
    4.0
    """

    a: str
    b: str
    start: tuple[float, ...]
    end: tuple[float, ...]
    yield_force: float

    def __post_init__(self) -> None:
        where = f"tie {self.a!r}-{self.b!r}"
        for name in ("a", "b"):
            of_type(getattr(self, name), str, f"{name} of {where} must be the id of a block")
        for name in ("start", "end"):
            set_field(self, name, vector(getattr(self, name), f"{name} of {where}"))
        set_field(self, "yield_force", positive(self.yield_force, f"yield_force of {where}"))
        if self.a == self.b:
            raise InputError(f"{where} joins a block to itself: name two blocks")
        if not self.length > 0.0:
            raise InputError(f"{where} has no length: its anchors must differ")

    @property
    def length(self) -> float:
        """Distance between the anchors."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    def moved(self, rotation: FloatArray, translation: FloatArray) -> Tie:
        """After x -> rotation @ x + translation."""
        start, end = (tuple(rotation @ p + translation) for p in (self.start, self.end))
        return replace(self, start=start, end=end)

    def scaled(self, length: float, force: float) -> Tie:
        """Returns the tie in other units."""
        start, end = (tuple(length * np.array(p)) for p in (self.start, self.end))
        return replace(self, start=start, end=end, yield_force=force * self.yield_force)


def check_reactions(
    ties: Sequence[Tie], reactions: Sequence[Reaction], blocks: Collection[str],
    supports: Collection[str],
) -> None:  # fmt: skip
    """Refuse those of blocks that are not there, and those between two supports."""
    named = [(f"tie {tie.a!r}-{tie.b!r}", [tie.a, tie.b]) for tie in ties]
    named += [(r._name, [r.block] if r.on is None else [r.block, r.on]) for r in reactions]
    for what, keys in named:
        for key in keys:
            if key not in blocks:
                cure = meant(key, blocks) or "add it to the blocks"
                raise InputError(f"{what}: there is no block {key!r}; {cure}")
        if all(key in supports for key in keys):
            raise InputError(
                f"{what} joins two supports, which do not move"
                if len(keys) == 2
                else f"{what} pushes a support, which does not move: name a free block"
            )


@dataclass(frozen=True)
class _Point:
    """A contact that is a point: its name, block b on which ``sense * size`` acts along ``line``,
    the other block a, None for the ground."""

    name: str
    a: str | None
    b: str
    at: FloatArray
    line: FloatArray
    least: float
    most: float
    sense: float


def _points(ties: Sequence[Tie], reactions: Sequence[Reaction]) -> Iterator[_Point]:
    for i, tie in enumerate(ties):
        start, end = np.array(tie.start), np.array(tie.end)
        name = f"tie {tie.a}-{tie.b}" + (f" ({i})" if i else "")
        line = end - start
        yield _Point(name, tie.a, tie.b, 0.5 * (start + end), line, 0.0, tie.yield_force, -1.0)
    for i, each in enumerate(reactions):
        name = f"reaction {each.on or 'ground'}-{each.block}" + (f" ({i})" if i else "")
        at, line = np.array(each.at), np.array(each.direction)
        for sense, least, most in _senses(each):
            pull = " pull" if sense < 0.0 < each.most else ""
            yield _Point(name + pull, each.on, each.block, at, line, least, most, sense)


def _senses(reaction: Reaction) -> Iterator[tuple[float, float, float]]:
    """The sense and bounds of a reaction's points: one that pushes, one that pulls, or both."""
    if reaction.most > 0.0:
        yield 1.0, max(reaction.least, 0.0), reaction.most
    if reaction.least < 0.0:
        yield -1.0, max(-reaction.most, 0.0), -reaction.least


def places(reactions: Sequence[Reaction]) -> list[tuple[int, float]]:
    """Returns which reaction each of their points is of, and its sense, in the contacts' order."""
    return [(i, sense) for i, each in enumerate(reactions) for sense, _, _ in _senses(each)]


def with_reactions(
    contacts: Contacts, ties: Sequence[Tie], reactions: Sequence[Reaction],
    supports: Sequence[str], size: float,
) -> Contacts:  # fmt: skip
    """Contacts followed by a point for each tie and each reaction, and by two for a reaction that
    may push and pull; blocks are known by name, and the first support stands for the ground.
    ``size`` is that of blocks, where there are no other contacts."""
    points = [*_points(ties, reactions)]
    if not points:
        return contacts
    if not supports and (held := [point.name for point in points if point.a is None]):
        raise InputError(f"{held[0]!r} needs a ground that stays: name the block that pushes in on")
    place, k = {key: i for i, key in enumerate(contacts.block_ids)}, len(points)
    lines = [point.line / np.linalg.norm(point.line) for point in points]
    bars = Contacts(
        names=tuple(point.name for point in points),
        block_ids=contacts.block_ids,
        a=np.array([place[point.a or supports[0]] for point in points]),
        b=np.array([place[point.b] for point in points]),
        origin=np.array([point.at for point in points]),
        axes=np.array([[*plane_axes(line), line] for line in lines]),
        corner_start=np.arange(k + 1),
        corner_xy=np.zeros((k, 2)),
        sides=np.full((k, 2), np.nan),
        area=np.full(k, (contacts.typical_size if len(contacts) else size) ** 2),
        friction=np.zeros(k),
        least=np.array([point.least for point in points]),
        most=np.array([point.most for point in points]),
        sense=np.array([point.sense for point in points]),
    )
    return Contacts.joined([contacts, bars])
