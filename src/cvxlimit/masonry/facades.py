"""Walls with returns: facades with openings and lintels, corners of houses, brick panels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

import cvxlimit.masonry.sizes as sizes
from cvxlimit.base.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry.sizes import LEAST_BOND, Size, Span, is_negligible
from cvxlimit.scene import Load, Scene


@dataclass(frozen=True)
class Opening:
    """A door or window in a wall, and the lintel over it.

    Attributes
    ----------
    start : float
        From the wall's start (x = 0 in a front, y = 0 in a return) to the nearer jamb, m.
    width : float
        Clear width, m.
    sill : int
        Number of courses below it: 0 for a door.
    courses : int
        Its height in courses.

    Example
    -------
    >>> Opening(start=0.8, width=0.8, sill=3, courses=4)
    Opening(start=0.8, width=0.8, sill=3, courses=4)
    """

    start: float
    width: float
    sill: int
    courses: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", positive(self.start, "start of an opening"))
        object.__setattr__(self, "width", positive(self.width, "width of an opening"))
        sizes.count(self.sill, "sill of an opening", least=0)
        sizes.count(self.courses, "courses of an opening")


def facade(
    length: float,
    courses: int,
    openings: Sequence[Opening] = (),
    *,
    left_return: float = 0.0,
    right_return: float = 0.0,
    left_openings: Sequence[Opening] = (),
    right_openings: Sequence[Opening] = (),
    unit: Size = (0.4, 0.2, 0.2),
    bearing: float | None = None,
    lintel_courses: int = 1,
    ground_cuts: Sequence[float] | float = (),
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "facade",
) -> Scene:
    r"""A front along x with openings, lintels and returns along y, on a fixed ground::

          elevation (x, z)                       plan (x, y)

        +---+---+---+---+---+---+             +---+             +---+
        +-+-+-------------+-+-+-+             |   | left        |   | right
        |   |   lintel    |   | |             |   | return      |   | return
        +-+-+             +-+-+-+             |   |             |   |
        | | |   opening   | |   |           y +---+-------------+---+
        +-+-+             +-+-+-+           ^ |   |    front        |
        |   +---+---+---+-+   | | sill      | +---+-----------------+
        +---+---+---+---+---+---+           +--> x    | pushed along -y

    Walls are laid in running bond. Front and returns take turns at the corners: in even courses
    (from 0) the front runs through, in odd ones the returns. Pieces shorter than a quarter of a
    unit are not laid; their neighbour is cut longer. One lintel lies over each opening, on the
    jambs to both sides. Blocks are named ``f<course>.<place>`` (front), ``l...`` and ``r...``
    (returns), from 1, lintels ``f.lintel<opening>`` and so on.

    Parameters
    ----------
    length : float
        Of the front, outside to outside, m.
    courses : int
        Number of courses.
    openings, left_openings, right_openings : sequence of Opening
        In the front and in the returns.
    left_return, right_return : float
        Length of the return at x = 0 and at x = ``length``, from the front's outer face (y = 0),
        m; 0 for none.
    unit : (float, float, float)
        Length, thickness and height of a block, m. A return's lie along y.
    bearing : float, optional
        Length of a lintel on each jamb, m; half a unit unless given.
    lintel_courses : int
        Height of the lintels in courses.
    ground_cuts : float, or sequence of float
        Places along x, m, at which the ground is cut into supports ``ground1``, ``ground2`` ...
        from the left, so that one of them can settle; one ``ground`` unless given.
    density, friction, live, name
        As for :func:`~cvxlimit.masonry.wall`, but pushed out of the front's plane,
        away from the returns (-y), unless ``live`` is given.

    Raises
    ------
    InputError
        For sizes that are not positive, walls too short for their corners, openings that overlap
        or, with their lintels, do not fit into their wall, or cuts that do not ascend within it.

    Example
    -------
    >>> window = Opening(start=0.6, width=0.8, sill=1, courses=2)
    >>> scene = facade(2.0, 5, [window], left_return=1.0)
    >>> [block.id for block in scene.blocks if "lintel" in block.id]
    ['f.lintel1']
    """
    size, rows = sizes.size_of(unit, "the unit"), sizes.count(courses, "courses")
    weight = positive(density, "density of the facade")
    reach = size[0] / 2.0 if bearing is None else positive(bearing, "bearing")
    high = sizes.count(lintel_courses, "lintel_courses")
    every = (openings, "front"), (left_openings, "left return"), (right_openings, "right return")
    gaps = [tuple(_gaps(each, what, reach, high)) for each, what in every]
    walls = _walls(("length", "unit"), length, (left_return, right_return), size, gaps)
    for wall in walls:
        wall.check(rows)
    blocks = [block for wall in walls for block in wall.blocks(rows, size, weight)]
    fixed = sizes.grounds_below(blocks, size[2], ground_cuts)
    return sizes.scene_of([*fixed, *blocks], sizes.ACROSS, live, friction, name)


def house_corner(
    front: float = 2.4,
    side: float = 2.0,
    *,
    storeys: int = 2,
    storey_courses: int = 7,
    window_width: float = 0.6,
    window_courses: int = 3,
    sill: int = 2,
    unit: Size = (0.4, 0.2, 0.2),
    density: float = 20.0,
    friction: float = DEFAULT_FRICTION,
    live: Load | None = None,
    name: str = "house-corner",
) -> Scene:
    """Two walls of a house that meet in a corner, one window in each of them on every storey.

    The front stands along x, the side along y from x = 0; windows are in the middle of both, with a
    lintel over each. A :func:`facade` with one return; parameters not named here are as there.

    Parameters
    ----------
    front, side : float
        Lengths of the two walls, outside to outside, m.
    storeys, storey_courses : int
        Number of storeys, and of courses in each.
    window_width : float
        Clear width of every window, m.
    window_courses, sill : int
        Height of the windows, and of the wall below them in every storey, in courses.

    Raises
    ------
    InputError
        As :func:`facade`; also for windows that do not fit into a storey with their lintels.

    Example
    -------
    >>> scene = house_corner(storeys=1)
    >>> [block.id for block in scene.blocks if "lintel" in block.id]
    ['f.lintel1', 'l.lintel1']
    """
    floors, high = sizes.count(storeys, "storeys"), sizes.count(storey_courses, "storey_courses")
    below, tall = sizes.count(sill, "sill", least=0), sizes.count(window_courses, "window_courses")
    if below + tall + 1 > high:
        raise InputError(
            f"storey_courses must be at least {below + tall + 1} for sill, window and lintel, "
            f"got {high}"
        )
    sills = [floor * high + below for floor in range(floors)]
    windows = []
    for length, what in ((front, "front"), (side, "side")):
        clear, whole = positive(window_width, "window_width"), positive(length, what)
        if is_negligible(whole - clear, whole):
            raise InputError(f"{what} must be longer than window_width, {clear:g}, got {whole:g}")
        windows.append([Opening((whole - clear) / 2.0, clear, at, tall) for at in sills])
    return facade(
        front, floors * high, windows[0], left_return=side, left_openings=windows[1],
        unit=unit, density=density, friction=friction, live=live, name=name,
    )  # fmt: skip


def panel(
    front: float,
    courses: int,
    *,
    left_return: float = 0.0,
    right_return: float = 0.0,
    brick: Size = (0.08, 0.04, 0.03),
    density: float = 27.3,
    friction: float = DEFAULT_FRICTION,
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
    size, rows = sizes.size_of(brick, "the brick"), sizes.count(courses, "courses")
    weight = positive(density, "density of the panel")
    walls = _walls(("front", "brick"), front, (left_return, right_return), size, [()] * 3)
    blocks: list[Block] = []
    for row in range(rows):
        for wall in walls:
            is_half = wall.prefix == "f" and row % 2 == 1 and not wall.inset[0]
            bricks = _bricks(wall.span(row), size[0], size[0] / (2.0 if is_half else 1.0))
            blocks += wall.course(row, bricks, size[2], weight)
    return sizes.scene_of(blocks, sizes.ACROSS, live, friction, name, ground=size[2])


@dataclass(frozen=True)
class _Gap:
    """What takes the place of units in a wall: an opening, by its number, or its lintel. ``rows``
    are its courses, ``span`` is from where to where it reaches along the wall."""

    number: int
    rows: range
    span: Span
    is_lintel: bool


def _gaps(
    openings: Sequence[Opening], what: str, bearing: float, lintel_courses: int
) -> Iterator[_Gap]:
    """Openings and lintels of a wall that refusals call ``what``."""
    for number, each in enumerate(openings, start=1):
        if not isinstance(each, Opening):
            raise InputError(f"opening {number} of the {what} must be an Opening, got {each!r}")
        top, end = each.sill + each.courses, each.start + each.width
        yield _Gap(number, range(each.sill, top), (each.start, end), False)
        over = each.start - bearing, end + bearing
        yield _Gap(number, range(top, top + lintel_courses), over, True)


@dataclass(frozen=True)
class _Wall:
    """One wall. In every other course, from course ``gives_way`` (0 or 1) on, its ends are shorter
    by ``inset`` (length), where other walls pass through."""

    prefix: str
    what: str
    length: float
    along: int
    across: Span
    inset: Span
    gives_way: int
    gaps: tuple[_Gap, ...]

    @property
    def clear(self) -> Span:
        """The wall from end to end between other walls."""
        return self.inset[0], self.length - self.inset[1]

    def check(self, rows: int) -> None:
        """Refuse openings that reach out of the wall, or into each other, with their lintels."""
        slack = 1e-9 * self.length  # rounding of sums of sizes, far below any joint
        for gap in self.gaps:
            (low, high), opening = gap.span, f"opening {gap.number} of the {self.what}"
            if low < self.clear[0] - slack or high > self.clear[1] + slack:
                raise InputError(
                    f"{opening} reaches from {low:g} to {high:g} with its lintel, but the wall is "
                    f"free from {self.clear[0]:g} to {self.clear[1]:g} only: move it or make it "
                    "narrower"
                )
            if gap.rows.stop > rows:
                raise InputError(
                    f"{opening} needs {gap.rows.stop} courses with its lintel, but the wall has "
                    f"{rows}"
                )
        for one, other in combinations(self.gaps, 2):
            both = range(max(one.rows.start, other.rows.start), min(one.rows.stop, other.rows.stop))
            apart = max(one.span[0], other.span[0]) >= min(one.span[1], other.span[1]) - slack
            if both and not apart:
                raise InputError(
                    f"openings {one.number} and {other.number} of the {self.what} overlap with "
                    f"their lintels in course {both[0] + 1}: move them apart"
                )

    def span(self, row: int) -> Span:
        """Returns where (from, to) a course of the wall lies."""
        return self.clear if row % 2 == self.gives_way else (0.0, self.length)

    def course(
        self, row: int, pieces: Iterable[Span], height: float, density: float
    ) -> Iterator[Block]:
        name, levels = f"{self.prefix}{row + 1}.", (row * height, (row + 1) * height)
        return sizes.laid(name, pieces, self.along, self.across, levels, density)

    def blocks(self, rows: int, size: Size, density: float) -> Iterator[Block]:
        length, _, height = size
        for row in range(rows):
            shift = length / 2.0 if row % 2 == self.gives_way else 0.0
            taken = [gap.span for gap in self.gaps if row in gap.rows]
            solid = _between(self.span(row), taken, length)
            pieces = [piece for span in solid for piece in _pieces(span, shift, length)]
            yield from self.course(row, pieces, height, density)
        for gap in self.gaps:
            if gap.is_lintel:
                name = f"{self.prefix}.lintel{gap.number}"
                levels = gap.rows.start * height, gap.rows.stop * height
                yield sizes.brick(name, gap.span, self.along, self.across, levels, density)


def _walls(
    words: tuple[str, str],
    length: float,
    returns: Span,
    size: Size,
    gaps: Sequence[tuple[_Gap, ...]],
) -> list[_Wall]:
    """Front and returns, with the ``gaps`` of each; ``words`` are what refusals call the front's
    length and a block."""
    thick, front = size[1], positive(length, words[0])
    lengths = [
        0.0 if value == 0.0 else positive(value, f"{side}_return")
        for value, side in zip(returns, ("left", "right"), strict=True)
    ]
    inset = (thick if lengths[0] else 0.0, thick if lengths[1] else 0.0)
    if is_negligible(front - sum(inset), size[0]):
        raise InputError(
            f"{words[0]} must be longer than the thickness of its returns, {sum(inset):g}, got "
            f"{front:g}"
        )
    walls = [_Wall("f", "front", front, 0, (0.0, thick), inset, 1, gaps[0])]
    places = ("l", "left", 0.0), ("r", "right", front - thick)
    for (prefix, side, x), reach, held in zip(places, lengths, gaps[1:], strict=True):
        if not reach and held:
            raise InputError(f"{side}_openings need a {side}_return, which has no length")
        if not reach:
            continue
        if is_negligible(reach - thick, thick):
            raise InputError(
                f"{side}_return must be longer than the {words[1]}'s thickness, {thick:g}, got "
                f"{reach:g}; use 0 for no return"
            )
        across, what = (x, x + thick), f"{side} return"
        walls.append(_Wall(prefix, what, reach, 1, across, (thick, 0.0), 0, held))
    return walls


def _between(whole: Span, gaps: Sequence[Span], unit: float) -> list[Span]:
    """Returns what is left of ``whole`` between gaps, without negligible parts."""
    ends = [whole[0], *(end for gap in sorted(gaps) for end in gap), whole[1]]
    parts = zip(ends[::2], ends[1::2], strict=True)
    return [(low, high) for low, high in parts if not is_negligible(high - low, unit)]


def _pieces(span: Span, shift: float, unit: float) -> Iterator[Span]:
    """Yields units with joints at ``shift`` plus multiples of ``unit``, none close to the span's
    ends: the neighbour of a piece that short is cut longer."""
    nearest = LEAST_BOND * unit * (1.0 - 1e-9)  # a quarter that is laid in full is laid
    first = np.ceil((span[0] + nearest - shift) / unit)
    last = np.floor((span[1] - nearest - shift) / unit)
    joints = shift + unit * np.arange(first, last + 1.0)
    yield from pairwise([span[0], *joints.tolist(), span[1]])


def _bricks(span: Span, length: float, first: float) -> Iterator[Span]:
    """Yields bricks of a course: one of length ``first``, whole ones, and a cut one at the end."""
    (start, end), laid, place = span, span[0], 0
    while not is_negligible(end - laid, length):
        following = start + first + place * length
        if is_negligible(end - following, length):
            following = end
        yield laid, following
        laid, place = following, place + 1
