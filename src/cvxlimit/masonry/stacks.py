"""One block, or blocks piled on one another."""

from __future__ import annotations

from cvxlimit.checks import finite_vector, positive
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry.sizes import Size, count, ground_below, scene_of, size_of
from cvxlimit.scene import Load, Scene


def stack(
    blocks: int = 5,
    size: Size = (0.5, 0.5, 0.25),
    *,
    shift: tuple[float, float] = (0.0, 0.0),
    density: float = 20.0,
    friction: float = 0.6,
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
    pile = [
        Block.box(
            f"b{i + 1}",
            (i * dx, i * dy, i * height),
            (i * dx + length, i * dy + thickness, (i + 1) * height),
            weight,
        )
        for i in range(count(blocks, "blocks"))
    ]
    return scene_of(
        (ground_below(pile[:1], depth=height), *pile), (1.0, 0.0, 0.0), live, friction, name
    )


def single_block(
    size: Size = (0.4, 0.4, 1.0),
    *,
    density: float = 20.0,
    friction: float = 0.7,
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
