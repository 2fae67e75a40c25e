"""Which bodies of geometry files are fixed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.extensions.importing.sheets import is_sheet
from cvxlimit.io.fields import shown
from cvxlimit.scene.doubts import LOWEST_WITHIN

LOWEST = "lowest"
"""Word that asks for the lowest blocks as supports."""


def supports_of(
    bodies: Sequence[Body], asked: str | Sequence[str] | None, up: FloatArray, notes: list[str]
) -> set[str]:
    """Names of the fixed bodies: those asked for, else those that the files mark, else sheets.

    ``asked`` are names, :data:`LOWEST` or None; ``up`` (3,) points up along an axis. What users
    should check is added to ``notes``. Raises InputError where nothing says what is fixed, and for
    names that no body has.
    """
    marked = {body.name for body in bodies if body.is_support}
    sheets = {body.name for body in bodies if is_sheet(body)}
    if asked == LOWEST:
        chosen = _lowest(bodies, up, notes)
    elif asked is not None or marked:
        chosen = marked if asked is None else _named(asked, bodies)
        _note_lower_block(bodies, chosen, up, notes)
    elif sheets:
        chosen = sheets
    else:
        raise InputError(
            'no file marks supports: say which blocks are fixed (supports="lowest" or '
            'supports=["ID", ...])'
        )
    if marked and chosen != marked:
        notes.append(f"{len(marked)} supports marked in the files give way to those asked for")
    return chosen


def _note_lower_block(
    bodies: Sequence[Body], fixed: set[str], up: FloatArray, notes: list[str]
) -> None:
    """Adds a note where a free block reaches lower than every support that is named or marked."""
    heights = {body.name: body.vertices @ up for body in bodies if len(body.vertices)}
    feet = {name: float(height.min()) for name, height in heights.items()}
    lowest = min(feet, key=feet.__getitem__)
    high = max(float(height.max()) for height in heights.values())
    # NaN, without a note, where no support has vertices.
    foot = min((feet[name] for name in feet if name in fixed), default=np.nan)
    depth, height = foot - feet[lowest], high - feet[lowest]
    if lowest not in fixed and depth > LOWEST_WITHIN * height:
        notes.append(
            f"no support is as low as block {shown(lowest)}, which is free: check supports and up"
        )


def refuse_all_lowest(bodies: Sequence[Body], fixed: set[str], up: FloatArray) -> None:
    """Raises InputError where all blocks are lowest, and so fixed: then a wall lies on its side, as
    another axis points up. ``bodies`` are those that have become blocks."""
    heights = [body.vertices @ up for body in bodies if body.name in fixed]
    flat = LOWEST_WITHIN * np.ptp(np.concatenate(heights))
    if len(heights) == len(bodies) > 1 and min(float(np.ptp(h)) for h in heights) > flat:
        axis = "xyz"[int(np.argmax(np.abs(up)))]
        raise InputError(
            f"all {len(bodies)} blocks are lowest along {axis}, so that none is left to move: if "
            f'another axis points up say so (up="{"y" if axis == "z" else "z"}"), or name supports'
        )


def _named(asked: str | Sequence[str], bodies: Sequence[Body]) -> set[str]:
    """The names asked for, each of which must be a body's."""
    names = [asked] if isinstance(asked, str) else list(asked)
    known = {body.name for body in bodies}
    for name in names:
        if name not in known:
            some = ", ".join(map(shown, sorted(known)[:5]))
            more = " ..." if len(known) > 5 else ""
            raise InputError(f"support {shown(name)} is not a block; the blocks are {some}{more}")
    return set(names)


def _lowest(bodies: Sequence[Body], up: FloatArray, notes: list[str]) -> set[str]:
    """The lowest bodies, or the sheets among them, and not the stones that stand on these; with a
    note unless a sheet or one body is the ground under all others."""
    heights = [body.vertices @ up for body in bodies]
    feet = np.array([h.min() if len(h) else np.nan for h in heights])
    bottom = float(np.nanmin(feet))
    height = max(float(h.max()) for h in heights if len(h)) - bottom
    lowest = feet <= bottom + LOWEST_WITHIN * height
    chosen = [body for body, is_low in zip(bodies, lowest.tolist(), strict=True) if is_low]
    sheets = {body.name for body in chosen if is_sheet(body)}
    if sheets:
        return sheets
    carried = [body for body in bodies if body not in chosen and len(body.vertices)]
    if not (len(chosen) == 1 and carried and _is_ground(chosen[0], carried, up)):
        names = ", ".join(shown(body.name) for body in chosen[:8])
        more = f" and {len(chosen) - 8} more" if len(chosen) > 8 else ""
        what = "is a stone" if len(chosen) == 1 else "are stones"
        notes.append(
            f"lowest, and so fixed: {names}{more}, which {what} of the structure itself, as the "
            "files have no ground under all others; name other supports if these are to move"
        )
    return {body.name for body in chosen}


def _is_ground(body: Body, others: Sequence[Body], up: FloatArray) -> bool:
    """True for a body that reaches under all others on every side."""
    plan = [k for k in range(3) if not up[k]]
    points = np.concatenate([other.vertices for other in others])[:, plan]
    own = body.vertices[:, plan]
    return bool((own.min(0) <= points.min(0)).all() and (own.max(0) >= points.max(0)).all())
