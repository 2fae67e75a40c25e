"""Motions of supports: which move together, where to, and how they turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import first_twice, members
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.scene.pressures import Vector, set_field, vector


@dataclass(frozen=True)
class SupportMotion:
    """Supports that move as one rigid body: by a translation, a rotation, or both at once.

    Attributes
    ----------
    supports : sequence of str
        Ids; a single one may stand alone.
    direction : (3,)
        Translation, of the point ``about`` if there is a rotation.
    rotation : (3,)
        Rotation vector: its direction is the axis, right-handed; radians, in proportion to the
        translation's lengths.
    about : (3,) or None
        A point of the axis; needed with a rotation.

    Raises
    ------
    InputError
        If nothing moves, a support is named twice, ``about`` is missing, or a number is not finite.

    Example
    -------
    >>> turning = SupportMotion("pier", rotation=(0, 1, 0), about=(2.0, 0, 0))
    >>> turning.supports, turning.size
    (('pier',), 1.0)
    """

    supports: tuple[str, ...]
    direction: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0)
    about: Vector | None = None

    def __post_init__(self) -> None:
        names = members(self.supports, str, "supports that move must be ids", "write ['p1', 'p2']")
        set_field(self, "supports", names)
        who = f"of the motion of {', '.join(map(repr, names))}"
        if not names or (twice := first_twice(names)) is not None:
            what = f"{twice!r} twice" if names else "none"
            raise InputError(f"a motion names the supports that move, each once, got {what}")
        for name in ("direction", "rotation", "about"):
            if (value := getattr(self, name)) is not None:
                set_field(self, name, vector(value, f"{name} {who}"))
        if not self.size > 0.0:
            raise InputError(f"direction {who} must not be zero, unless it has a rotation")
        if any(self.rotation) and self.about is None:
            raise InputError(f"about {who} is missing: give a point of the axis of its rotation")

    @property
    def size(self) -> float:
        """Length of the direction, or the angle of a rotation without one."""
        return float(np.linalg.norm(self.direction) or np.linalg.norm(self.rotation))

    def rates(self, block: Block) -> FloatArray:
        """Translation of a block's centroid and rotation (6,), as they are given."""
        arm = block.centroid - np.array(self.about or block.centroid)
        turn = np.array(self.rotation)
        return np.concatenate([np.array(self.direction) + np.cross(turn, arm), turn])

    def moved(self, rotation: FloatArray, translation: FloatArray) -> SupportMotion:
        """After x -> rotation @ x + translation."""
        about = None if self.about is None else rotation @ self.about + translation
        ways = (rotation @ self.direction, rotation @ self.rotation)
        return SupportMotion(self.supports, *ways, about)  # type: ignore[arg-type]

    def scaled(self, length: float) -> SupportMotion:
        """Returns the motion with lengths in another unit."""
        about = None if self.about is None else tuple(length * np.array(self.about))
        return replace(self, direction=tuple(length * np.array(self.direction)), about=about)


def check_motions(motions: Sequence[SupportMotion], supports: Sequence[str], scene: str) -> None:
    """Refuse motions of blocks that are no supports, and two of the same one."""
    names = [name for motion in motions for name in motion.supports]
    for name in names:
        if name not in supports:
            raise InputError(
                f"{name!r} is no support of scene {scene!r}: {', '.join(supports)} are"
            )
    if (twice := first_twice(names)) is not None:
        raise InputError(f"support {twice!r} has two motions: give one")
