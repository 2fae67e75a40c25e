"""Walls laid in courses, of equal stones and of rubble, and blocks piled on one another."""

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
    LEAST_BOND,
    Size,
    Span,
    brick,
    count,
    drawn_joints,
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
    fixed = _held(blocks, size, side_supports)
    return scene_of((*fixed, *blocks), ALONG, live, friction, name)


def _held(blocks: Sequence[Block], size: Size, sides: Collection[str]) -> list[Block]:
    """Ground and side supports of a wall of blocks of about this size."""
    ends = [_side_support(side, blocks, size) for side in _checked_sides(sides)]
    return [ground_below(blocks, depth=size[2]), *ends]


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
    sides = ("start",) if rng.random() < 0.5 else ()
    fixed = _held(blocks, (length, thickness, height), sides)
    direction = rng.normal(size=3)
    push = Load(acceleration=tuple(direction / np.linalg.norm(direction)))
    friction = float(rng.uniform(*FRICTION))
    return scene_of((*fixed, *blocks), push, None, friction, f"random-wall-{seed}")


def rubble_wall(
    length: float,
    height: float,
    thickness: float = 0.5,
    *,
    seed: int,
    widths: Span = (0.2, 0.6),
    heights: Span = (0.15, 0.3),
    bond: float = LEAST_BOND,
    through: int = 1,
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    side_supports: Collection[str] = (),
    live: Load | None = None,
    name: str = "rubble-wall",
) -> Scene:
    """A wall of irregular stones in level courses along x, on a fixed ground whose top is z = 0.

    Heights of courses and widths of stones are drawn evenly from their ranges, as far as the wall's
    size and the bond leave room: no place is drawn from which the course cannot be ended.
    The last stone of a course takes what is left; stones at both ends may be cut to half the least
    width. Blocks are named ``b<course>.<place>`` from 1 at the bottom left; in two leaves
    ``f...`` is the one at y = 0, ``r...`` the other.

    Parameters
    ----------
    length, height, thickness : float
        Of the wall, along x, z and y, m.
    seed : int
        0 or more; the same seed gives the same wall.
    widths, heights : (float, float)
        Least and most of a stone's width along x, and of a course's height, m.
    bond : float
        Least distance between head joints of courses on one another, as a share of the mean of
        ``widths``: above 0, at most 0.5. Those of leaves side by side keep half of it.
    through : int
        Every how many courses, from the first, stones go through the whole thickness: 1 for all.
        Between them are two leaves, each half as thick and drawn on its own.
    density, friction, side_supports, live, name
        As for :func:`~cvxlimit.masonry.wall`.

    Raises
    ------
    InputError
        For sizes that are not positive, a range whose least is above its most, and for a wall that
        no courses or stones of these ranges fill in this bond.

    Example
    -------
    >>> scene = rubble_wall(2.0, 1.0, seed=1)
    >>> round(sum(scene.blocks[i].volume for i in scene.free), 12)
    1.0
    """
    long, high, thick = size_of((length, height, thickness), "the wall")
    across, tall = _range(widths, "widths"), _range(heights, "heights")
    weight, share = positive(density, "density of the wall"), positive(bond, "bond")
    if share > 0.5:
        raise InputError(f"bond must be at most 0.5, half the mean width, got {share:g}")
    rng, every = np.random.default_rng(count(seed, "seed", least=0)), count(through, "through")
    mean = 0.5 * sum(across)
    levels = drawn_joints(rng, high, tall, tall[0])
    if levels is None:
        raise InputError(
            f"no number of courses of {tall[0]:g} to {tall[1]:g} is {high:g} high: change height "
            "or heights"
        )
    courses = _bonded(rng, len(levels) - 1, every, long, across, share * mean)
    blocks: list[Block] = []
    for row, course in enumerate(courses):
        halves = {"b": (0.0, thick), "f": (0.0, 0.5 * thick), "r": (0.5 * thick, thick)}
        for leaf, ends in course.items():
            span = levels[row], levels[row + 1]
            blocks += laid(f"{leaf}{row + 1}.", pairwise(ends), 0, halves[leaf], span, weight)
    fixed = _held(blocks, (mean, thick, 0.5 * sum(tall)), side_supports)
    return scene_of((*fixed, *blocks), ALONG, live, friction, name)


def _range(value: Span, what: str) -> Span:
    least, most = finite_vector(value, 2, f"{what} (least, most)").tolist()
    if positive(least, f"the least of {what}") > most:
        raise InputError(
            f"{what} must be (least, most), got ({least:g}, {most:g}): turn them round"
        )
    return least, most


_TRIES = 100
"""Courses that may fail to bond before a wall is refused: each failure draws the one below anew, so
that a bond which one course in two can take fails here once in 1e30 walls."""


def _bonded(
    rng: np.random.Generator, rows: int, through: int, length: float, widths: Span, apart: float
) -> list[dict[str, list[float]]]:
    """Joints of every leaf of every course, at least so far ``apart`` from those they touch."""
    courses: list[dict[str, list[float]]] = []
    tries = 0
    while len(courses) < rows:
        below = courses[-1] if courses else {}
        course: dict[str, list[float]] = {}
        for leaf in "b" if len(courses) % through == 0 else "fr":
            stands_on = below.values() if leaf == "b" else [below.get(leaf) or below.get("b", [])]
            zones = [(y - apart, y + apart) for joints in stands_on for y in joints[1:-1]]
            beside = (y for joints in course.values() for y in joints[1:-1])
            zones += [(y - 0.5 * apart, y + 0.5 * apart) for y in beside]
            ends = drawn_joints(rng, length, widths, 0.5 * widths[0], zones)
            if ends is not None:
                course[leaf] = ends
            elif tries == _TRIES or not courses:
                size = f"{widths[0]:g} to {widths[1]:g} wide"
                if not courses:
                    raise InputError(
                        f"no number of stones {size} is {length:g} long: change length or widths"
                    )
                raise InputError(
                    f"course {len(courses) + 1} of stones {size} found no bond of {apart:g} in "
                    f"{length:g} of length, in {tries} tries: lower bond or widen widths"
                )
            else:
                tries += 1
                courses.pop()
                break
        else:
            courses.append(course)
    return courses


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
