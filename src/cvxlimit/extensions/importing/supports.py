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
    """Names of the fixed bodies: those asked for, or else those that the files mark."""
    marked = {body.name for body in bodies if body.is_support}
    sheets = {body.name for body in bodies if is_sheet(body)}
    if asked is None:
        if sheets and not marked:
            return sheets
        if marked:
            _tell_of_lower(bodies, marked, up, notes)
        else:
            raise InputError(
                'no file marks supports: say which blocks are fixed (supports="lowest" or '
                'supports=["ID", ...])'
            )
        return marked
    chosen = _lowest(bodies, up, notes) if asked == LOWEST else set(_ids(asked, bodies))
    if asked != LOWEST:
        _tell_of_lower(bodies, chosen, up, notes)
    if marked and chosen != marked:
        notes.append(f"{len(marked)} supports marked in the files give way to those asked for")
    return chosen


def _tell_of_lower(
    bodies: Sequence[Body], fixed: set[str], up: FloatArray, notes: list[str]
) -> None:
    """A word where free blocks reach lower than every support that is named or marked."""
    heights = {b.name: b.vertices @ up for b in bodies if len(b.vertices)}
    foot = min((float(h.min()) for name, h in heights.items() if name in fixed), default=np.nan)
    lowest = min(heights, key=lambda name: float(heights[name].min()))
    low = float(heights[lowest].min())
    high = max(float(h.max()) for h in heights.values())
    if lowest not in fixed and foot - low > LOWEST_WITHIN * (high - low):
        notes.append(
            f"no support is as low as block {shown(lowest)}, which is free: check supports and up"
        )


def refuse_all_lowest(bodies: Sequence[Body], fixed: set[str], up: FloatArray) -> None:
    """Walls that lie on a side have all their stones lowest; of bodies that have become blocks."""
    heights = [body.vertices @ up for body in bodies if body.name in fixed]
    flat = LOWEST_WITHIN * np.ptp(np.concatenate(heights))
    if len(heights) == len(bodies) > 1 and min(float(np.ptp(h)) for h in heights) > flat:
        axis = "xyz"[int(np.argmax(np.abs(up)))]
        raise InputError(
            f"all {len(bodies)} blocks are lowest along {axis}, so that none is left to move: if "
            f'another axis points up say so (up="{"y" if axis == "z" else "z"}"), or name supports'
        )


def _ids(asked: str | Sequence[str], bodies: Sequence[Body]) -> list[str]:
    names = [asked] if isinstance(asked, str) else list(asked)
    known = {body.name for body in bodies}
    for name in names:
        if name not in known:
            some = ", ".join(map(shown, sorted(known)[:5]))
            more = " ..." if len(known) > 5 else ""
            raise InputError(f"support {shown(name)} is not a block; the blocks are {some}{more}")
    return names


def _lowest(bodies: Sequence[Body], up: FloatArray, notes: list[str]) -> set[str]:
    heights = [body.vertices @ up for body in bodies]
    feet = np.array([h.min() if len(h) else np.nan for h in heights])
    bottom = float(np.nanmin(feet))
    height = max(float(h.max()) for h in heights if len(h)) - bottom
    lowest = feet <= bottom + LOWEST_WITHIN * height
    chosen = [body for body, is_low in zip(bodies, lowest.tolist(), strict=True) if is_low]
    if sheets := {body.name for body in chosen if is_sheet(body)}:
        return sheets  # and not the stones that stand on them
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
