"""Ties: members between two blocks that bear tension up to a yield force, and nothing else.

A tie is a contact on a point of its line: no friction, no compressive strength to speak of, and a
tensile strength that adds up to its yield force.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector, meant, of_type, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import Contacts


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
            point = finite_vector(getattr(self, name), 3, f"{name} of {where}")
            object.__setattr__(self, name, tuple(point.tolist()))
        force = positive(self.yield_force, f"yield_force of {where}")
        object.__setattr__(self, "yield_force", force)
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


def check_ties(ties: Sequence[Tie], blocks: Collection[str], supports: Collection[str]) -> None:
    """Refuse ties of blocks that are not there, and ties between two supports."""
    for tie in ties:
        for key in (tie.a, tie.b):
            if key not in blocks:
                cure = meant(key, blocks) or "add it to the blocks"
                raise InputError(f"tie {tie.a!r}-{tie.b!r}: there is no block {key!r}; {cure}")
        if tie.a in supports and tie.b in supports:
            raise InputError(f"tie {tie.a!r}-{tie.b!r} joins two supports, which do not move")


def with_ties(contacts: Contacts, ties: Sequence[Tie]) -> Contacts:
    """Contacts followed by one for each tie; blocks are known by name."""
    if not ties:
        return contacts
    k = len(ties)
    size = contacts.typical_size if len(contacts) else np.median([tie.length for tie in ties])
    side = 1e-6 * size  # it resists its yield force times half of that in bending
    square = 0.5 * side * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    start, end = (np.array([getattr(tie, name) for tie in ties]) for name in ("start", "end"))
    place = {key: i for i, key in enumerate(contacts.block_ids)}
    strength = np.array([tie.yield_force for tie in ties]) / side**2
    bars = Contacts(
        names=tuple(
            f"tie {tie.a}-{tie.b}" + (f" ({i})" if i else "") for i, tie in enumerate(ties)
        ),
        block_ids=contacts.block_ids,
        a=np.array([place[tie.a] for tie in ties]),
        b=np.array([place[tie.b] for tie in ties]),
        origin=0.5 * (start + end),
        axes=np.array([_frame(line) for line in end - start]),
        corner_start=4 * np.arange(k + 1),
        corner_xy=np.tile(square, (k, 1)),
        sides=np.full((k, 2), side),
        area=np.full(k, side**2),
        friction=np.zeros(k),
        compressive_strength=1e-9 * strength,
        tensile_strength=strength,
    )
    return Contacts.joined([contacts, bars])


def _frame(line: FloatArray) -> FloatArray:
    normal = line / np.linalg.norm(line)
    across = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    first = across / np.linalg.norm(across)
    return np.array([first, np.cross(normal, first), normal])
