"""Walls laid in courses, with openings: running bond or any list of block lengths."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from cvxlimit.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry.sizes import Size, count, ground_below, scene_of, size_of
from cvxlimit.scene import Load, Scene

Course = Sequence[float]

SIDES = ("start", "end")
"""Where a wall may have a rigid side support: its end face at x = 0, or the one at full length."""


def running_bond(whole_units: int, courses: int, first: str = "whole") -> list[list[float]]:
    """Courses of a running bond: whole units, and half units at both ends of every other course.

    Parameters
    ----------
    whole_units : int
        Length of the wall in units.
    courses : int
        Number of courses.
    first : "whole" or "half"
        Whether the bottom course starts with a whole or a half unit.

    Returns
    -------
    list of list of float
        Block lengths in units, bottom course first; input of :func:`wall`.

    Example
    -------
    >>> running_bond(3, 2)
    [[1.0, 1.0, 1.0], [0.5, 1.0, 1.0, 0.5]]
    """
    length, height = count(whole_units, "whole_units"), count(courses, "courses")
    if first not in ("whole", "half"):
        raise InputError(f"first must be 'whole' or 'half', got {first!r}")
    whole = [1.0] * length
    half = [0.5, *[1.0] * (length - 1), 0.5]
    pair = (whole, half) if first == "whole" else (half, whole)
    return [list(pair[i % 2]) for i in range(height)]


def wall(
    courses: Sequence[Course],
    unit: Size = (0.4, 0.2, 0.175),
    *,
    density: float = 20.0,
    friction: float = 0.65,
    side_supports: Collection[str] = (),
    live: Load | None = None,
    name: str = "wall",
) -> Scene:
    """A wall along x, one block thick, on a fixed ground whose top is z = 0.

    Blocks are named ``b<course>.<place>`` from 1 at the bottom left. Head joints touch and rub;
    blocks above an opening span it as they are laid.

    Parameters
    ----------
    courses : sequence of sequence of float
        Bottom first. Block lengths in multiples of the unit's length; a negative number is an
        opening of that length.
    unit : (float, float, float)
        Length (x), thickness (y) and height (z) of a block of length 1, in m.
    density : float
        Weight per volume, kN/m3.
    friction : float
        Coulomb coefficient of all joints; a :class:`Scene` of one's own has 0.6.
    side_supports : collection of "start", "end"
        Ends of the wall (x = 0; full length) that lean on a rigid support over the whole height.
    live : Load, optional
        Along +x (in the wall's plane) in multiples of the weight unless given.
    name : str
        Name of the scene.

    Raises
    ------
    InputError
        For sizes that are not positive, an empty course, a block of length 0, an unknown side,
        or a block that touches nothing (found with the contacts).

    Example
    -------
    >>> window = [[1, 1, 1], [1, -1, 1], [0.5, 1, 1, 0.5]]
    >>> scene = wall(window, unit=(0.2, 0.1, 0.1))
    >>> len(scene.free), len(scene.contacts)
    (9, 14)
    """
    size = size_of(unit, "the unit")
    weight = positive(density, "density of the wall")
    blocks = list(_laid_blocks(courses, size, weight))
    fixed = [ground_below(blocks, depth=size[2])]
    fixed += [_side_support(side, blocks, size) for side in _checked_sides(side_supports)]
    return scene_of((*fixed, *blocks), (1.0, 0.0, 0.0), live, friction, name)


def _laid_blocks(courses: Sequence[Course], size: Size, density: float) -> Iterator[Block]:
    if not len(courses):
        raise InputError("the wall has no courses: give at least one list of block lengths")
    length, thickness, height = size
    for row, course in enumerate(courses):
        lengths = _checked_course(row, course)
        ends = np.cumsum(np.abs(lengths)) * length
        starts = np.concatenate([[0.0], ends[:-1]])
        solid = lengths > 0.0
        for place, (x0, x1) in enumerate(zip(starts[solid], ends[solid], strict=True), start=1):
            yield Block.box(
                f"b{row + 1}.{place}",
                (x0, 0.0, row * height),
                (x1, thickness, (row + 1) * height),
                density,
            )


def _checked_course(row: int, course: Course) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    try:
        lengths = np.array([float(length) for length in course])
    except (TypeError, ValueError) as error:
        raise InputError(
            f"course {row + 1} of the wall must list block lengths, got {course!r}"
        ) from error
    if not np.isfinite(lengths).all() or (lengths == 0.0).any():
        raise InputError(
            f"course {row + 1} of the wall must list lengths that are finite and not 0 "
            f"(negative for openings), got {list(course)}"
        )
    if not (lengths > 0.0).any():
        raise InputError(f"course {row + 1} of the wall has no block, got {list(course)}")
    return lengths


def _checked_sides(sides: Collection[str]) -> list[str]:
    unknown = [side for side in sides if side not in SIDES]
    if unknown:
        raise InputError(f"side_supports may hold 'start' and 'end', got {unknown[0]!r}")
    return [side for side in SIDES if side in sides]


def _side_support(side: str, blocks: Sequence[Block], size: Size) -> Block:
    length, thickness, _ = size
    far = max(block.vertices[:, 0].max() for block in blocks)
    top = max(block.vertices[:, 2].max() for block in blocks)
    x0 = -length if side == "start" else far
    return Block.box(f"side-{side}", (x0, 0.0, 0.0), (x0 + length, thickness, top))
