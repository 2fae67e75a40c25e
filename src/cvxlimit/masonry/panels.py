"""Brick panels with zero, one or two returns: the S10 and S12 shapes of pushed-over panels."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import cvxlimit.masonry.sizes as sizes
from cvxlimit.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry.sizes import Size, Span, is_negligible
from cvxlimit.scene import Load, Scene


def panel(
    front: float,
    courses: int,
    *,
    left_return: float = 0.0,
    right_return: float = 0.0,
    brick: Size = (0.08, 0.04, 0.03),
    density: float = 27.3,
    friction: float = 0.7,
    live: Load | None = None,
    name: str = "panel",
) -> Scene:
    """A front wall along x with returns along y at its ends, on a fixed ground (top at z = 0).

    Front and returns take turns at the corners: in even courses (from 0) the front runs through
    and the returns start behind it; in odd courses the returns run through and the front is
    shortened by the brick's thickness. Bricks are laid from the start of each run and the last
    one is cut to fit. Without a left return the front's odd courses start with half a brick.
    Bricks are named ``f<course>.<place>`` (front), ``l...`` and ``r...`` (returns), from 1.

    Parameters
    ----------
    front : float
        Length of the front, outside to outside, m.
    courses : int
        Number of courses.
    left_return, right_return : float
        Length of the return at x = 0 and at x = ``front``, from the front's outer face (y = 0),
        m; 0 for none.
    brick : (float, float, float)
        Length, thickness and height, m. A return's bricks lie along y.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`, but pushed out of the front's plane,
        away from the returns (-y), unless ``live`` is given.

    Raises
    ------
    InputError
        For sizes that are not positive, or a front or return too short for its corners.

    Example
    -------
    >>> scene = panel(0.24, 2, left_return=0.16)
    >>> [block.id for block in scene.blocks]
    ['ground', 'f1.1', 'f1.2', 'f1.3', 'l1.1', 'l1.2', 'f2.1', 'f2.2', 'f2.3', 'l2.1', 'l2.2']
    """
    size = sizes.size_of(brick, "the brick")
    rows = sizes.count(courses, "courses")
    weight = positive(density, "density of the panel")
    returns = {"l": _return_length(left_return, "left_return", size[1]),
               "r": _return_length(right_return, "right_return", size[1])}  # fmt: skip
    corners = sum(length > 0.0 for length in returns.values())
    width = positive(front, "front")
    if is_negligible(width - corners * size[1], size[0]):
        raise InputError(
            f"front must be longer than the thickness of its {corners} return(s), "
            f"{corners * size[1]:g}, got {width:g}"
        )
    courses_laid = (_course(row, width, returns, size, weight) for row in range(rows))
    blocks = list(chain.from_iterable(courses_laid))
    ground = sizes.ground_below(blocks, depth=size[2])
    return sizes.scene_of((ground, *blocks), sizes.ACROSS, live, friction, name)


def _return_length(value: float, what: str, thickness: float) -> float:
    if value == 0.0:
        return 0.0
    length = positive(value, what)
    if is_negligible(length - thickness, thickness):
        raise InputError(
            f"{what} must be longer than the brick's thickness, {thickness:g}, got {length:g}; "
            "use 0 for no return"
        )
    return length


def _course(
    row: int, front: float, returns: dict[str, float], size: Size, density: float
) -> Iterator[Block]:
    length, thickness, height = size
    levels = row * height, (row + 1) * height
    through = row % 2 == 0
    inset = {side: 0.0 if through or not returns[side] else thickness for side in "lr"}
    first = length if through or returns["l"] else length / 2.0
    run = _bricks(inset["l"], front - inset["r"], length, first)
    yield from sizes.laid(f"f{row + 1}.", run, 0, (0.0, thickness), levels, density)
    for side, x in (("l", 0.0), ("r", front - thickness)):
        if returns[side]:
            run = _bricks(thickness if through else 0.0, returns[side], length, length)
            yield from sizes.laid(f"{side}{row + 1}.", run, 1, (x, x + thickness), levels, density)


def _bricks(start: float, end: float, length: float, first: float) -> Iterator[Span]:
    """Bricks from ``start`` to ``end``: one of length ``first``, whole ones, a cut one."""
    laid, place = start, 0
    while not is_negligible(end - laid, length):
        following = start + first + place * length
        if is_negligible(end - following, length):
            following = end
        yield laid, following
        laid, place = following, place + 1
