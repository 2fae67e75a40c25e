"""Walls laid in courses, regular and random ones, and blocks piled on one another."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

import numpy as np

from cvxlimit.base.checks import finite_vector, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry.sizes import (
    ALONG,
    Size,
    brick,
    count,
    ground_below,
    laid,
    scene_of,
    size_of,
)
from cvxlimit.scene import Load, Scene

Course = Sequence[float]

SIDES = ("start", "end")
"""Where a wall may have a rigid side support: its end face at x = 0, or the one at full length."""


def running_bond(whole_units: int, courses: int, first: str = "whole") -> list[list[float]]:
    """Courses of a running bond: whole units, and half units at both ends of every other course.

    Parameters
    ----------
    whole_units, courses : int
        Length of the wall in units, and number of courses.
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
    friction: float = DEFAULT_FRICTION,
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
        Coulomb coefficient of all joints.
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
    return scene_of((*fixed, *blocks), ALONG, live, friction, name)


def _laid_blocks(courses: Sequence[Course], size: Size, density: float) -> Iterator[Block]:
    if not len(courses):
        raise InputError("the wall has no courses: give at least one list of block lengths")
    length, thickness, height = size
    for row, course in enumerate(courses):
        lengths = _checked_course(row, course)
        ends = np.cumsum(np.abs(lengths)) * length
        starts = np.concatenate([[0.0], ends[:-1]])
        solid = np.stack([starts, ends], axis=1)[lengths > 0.0].tolist()
        levels = (row * height, (row + 1) * height)
        yield from laid(f"b{row + 1}.", solid, 0, (0.0, thickness), levels, density)


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


SIZES = ((2, 3), (2, 4), (2, 5), (3, 3), (3, 4), (3, 5), (4, 3), (4, 4))
"""Whole units and courses: 14 to 46 contacts, with a side support or without."""

FRICTION = (0.2, 0.9)
"""Range of the coefficient of friction."""

_JITTER = 0.2
"""Head joints and course heights vary by this share of a unit, up and down, so that joints of
following courses stay a tenth of a unit apart: bonded, though badly."""


def random_wall(
    seed: int,
    *,
    unit: Size = (0.4, 0.2, 0.2),
    density: float = 20.0,
    sizes: Sequence[tuple[int, int]] = SIZES,
) -> Scene:
    """An irregular running-bond wall with a random size, bond, friction and load direction.

    Courses differ in height, head joints are moved at random about those of a running bond; half
    of the walls lean on a rigid support at their start. The live load pushes in any direction of
    space, in multiples of the weight; one that presses the wall down does no harm. The same seed
    gives the same wall. Blocks are named as in :func:`~cvxlimit.masonry.wall`. Each rests with its
    whole lower face on the course below, so the wall carries its own weight.

    Parameters
    ----------
    seed : int
        0 or more.
    unit : (float, float, float)
        Mean length, thickness and mean height of a block, m.
    density : float
        Weight per volume, kN/m3.
    sizes : sequence of (int, int)
        Whole units and courses, one of which is drawn; 14 to 46 contacts unless others are given.

    Raises
    ------
    InputError
        If the seed is not a whole number of 0 or more, or a size is not positive.

    Example
    -------
    >>> scene = random_wall(7)
    >>> scene.name, len(scene.free), len(scene.contacts)
    ('random-wall-7', 18, 42)
    """
    rng = np.random.default_rng(count(seed, "seed", least=0))
    length, thickness, height = size_of(unit, "the unit")
    weight = positive(density, "density of the wall")
    units, courses = sizes[int(rng.integers(len(sizes)))]
    heights = height * rng.uniform(1.0 - _JITTER, 1.0 + _JITTER, courses)
    levels = np.concatenate([[0.0], np.cumsum(heights)])
    blocks: list[Block] = []
    for row, span in enumerate(pairwise(levels.tolist())):
        inner = np.arange(1, units) if row % 2 == 0 else np.arange(units) + 0.5
        joints = length * (inner + rng.uniform(-_JITTER, _JITTER, len(inner)))
        ends = [0.0, *joints.tolist(), units * length]
        blocks += laid(f"b{row + 1}.", pairwise(ends), 0, (0.0, thickness), span, weight)
    fixed = [ground_below(blocks, depth=height)]
    if rng.random() < 0.5:
        fixed.append(_side_support("start", blocks, (length, thickness, height)))
    direction = rng.normal(size=3)
    push = Load(acceleration=tuple(direction / np.linalg.norm(direction)))
    friction = float(rng.uniform(*FRICTION))
    return scene_of((*fixed, *blocks), push, None, friction, f"random-wall-{seed}")


def stack(
    blocks: int = 5,
    size: Size = (0.5, 0.5, 0.25),
    *,
    shift: tuple[float, float] = (0.0, 0.0),
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "stack",
) -> Scene:
    """Equal blocks piled on one another on a fixed ground whose top is z = 0.

    Blocks are named ``b1``, ``b2`` ... from the bottom.

    Parameters
    ----------
    blocks : int
        How many.
    size : (float, float, float)
        Length (x), thickness (y) and height (z) of each block, m.
    shift : (float, float)
        Offset in x and y of every block from the one below, m: a leaning stack.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`.

    Raises
    ------
    InputError
        For sizes that are not positive, or a shift so large that blocks do not touch (found
        with the contacts).

    Example
    -------
    >>> scene = stack(3, size=(1.0, 1.0, 0.5))
    >>> scene.contacts.names
    ('ground-b1', 'b1-b2', 'b2-b3')
    """
    length, thickness, height = size_of(size, "the block")
    dx, dy = finite_vector(shift, 2, "shift")
    weight = positive(density, "density of the stack")
    pile = []
    for i in range(count(blocks, "blocks")):
        x, y = (i * dx, i * dx + length), (i * dy, i * dy + thickness)
        pile.append(brick(f"b{i + 1}", x, 0, y, (i * height, (i + 1) * height), weight))
    ground = ground_below(pile[:1], depth=height)
    return scene_of((ground, *pile), ALONG, live, friction, name)


def single_block(
    size: Size = (0.4, 0.4, 1.0),
    *,
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "single-block",
) -> Scene:
    """One block on a fixed ground: the smallest scene, with a load factor in closed form.

    Pushed along x, it rocks at length / height or slides at ``friction``, whichever is less.
    Parameters, units and errors as in :func:`stack`.

    Example
    -------
    >>> single_block(size=(0.3, 0.3, 0.9)).contacts.names
    ('ground-b1',)
    """
    return stack(1, size, density=density, friction=friction, live=live, name=name)
