"""Which blocks a scene refuses: names used twice, supports that are none, nothing that is free."""

from __future__ import annotations

from collections.abc import Sequence

from cvxlimit.base.checks import first_twice, meant
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block


def check_supported(blocks: Sequence[Block], supports: Sequence[str], name: str) -> None:
    """Refuse blocks and supports, of the scene with this name, that do not go together."""
    known = set(ids := [block.id for block in blocks])
    if (twice := first_twice(ids)) is not None:
        raise InputError(f"block id {twice!r} is used twice: ids must be unique")
    for key in supports:
        if key not in known:
            cure = meant(key, known) or "add it to the blocks"
            raise InputError(f"support {key!r} is not a block of the scene; {cure}")
    if (twice := first_twice(supports)) is not None:
        raise InputError(f"support {twice!r} is listed twice")
    free = [block for block in blocks if block.id not in supports]
    if not free:
        raise InputError(
            f"scene {name!r} has no free block: at least one block must not be a support"
        )
    for block in free:
        if block.density is None:
            raise InputError(
                f"free block {block.id!r} has no density; give its weight "
                "per volume, or name the block among the supports"
                + ("" if supports else ", of which the scene has none")
            )
