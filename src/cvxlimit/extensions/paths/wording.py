"""A path in words: what it says and what it does not, for reports, pictures and refusals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cvxlimit.extensions.paths.path import Path

PROVES = "a bracket proves what its configuration carries, not that the structure gets there"
"""What every table and picture of a path says."""


def headline(path: Path) -> str:
    """Returns ``path.headline``."""
    unit, joints = path.scene.units.length, list(path.sliding_joints)
    which = ", ".join(joints[:3]) + (f" and {len(joints) - 3} more" if joints[3:] else "")
    which = f"joint{'s' * (len(joints) != 1)} {which}".rstrip()
    # It slides away: the load factor stays level.
    if path.slides_away:
        slide = "slides" if len(joints) == 1 else "slide"
        return (
            f"a load factor of {path.load_factor[0]:.5g} moves it, and there is no d0: {which} "
            f"{slide}, the load factor stays level, and such a path ends where a support was "
            "drawn to end, which is no capacity of displacement"
        )
    # Where it ends, and what that rests on.
    low, high = (f"{d0:.4g}" for d0 in path.d0_interval)
    end = f"zero at d0 = {low}" + (f" to {high}" if low != high else "") + f" {unit}"
    if np.isnan(path.d0_interval[0]):
        end = f"no d0: it ends at a load factor of {path.load_factor[-1]:.4g}"
    if len(path) == 1:
        return end
    followed = f"; {path.followed}" * bool(path.followed)
    if not path.slides:
        return f"{end}: blocks rock, and no joint slides from step to step{followed}"
    return (
        f"{end}, and {100.0 * path.slip_share:.0f} % of the displacement in joints is slip "
        f"({which}): it depends on {path.varies_by}, and is no bound{followed}"
    )


def followed(path: Path) -> str:
    """Returns ``path.followed``."""
    found = [each for each in path if each.is_followed]
    if not found:
        return ""
    bare = sum(each.bracket is None for each in found)
    return (
        f"{len(found)} of {len(path)} configurations are followed by explicit steps, since no "
        f"iterates came to rest: equilibrium lacks up to {max(x.residual for x in found):.0e} "
        "of the dead load, and d0 and load factors are an interval over step and flow"
        + f"; no bracket is proved for {bare} of them"
        * bool(bare)
    )


def interval(path: Path) -> str:
    """Returns ``path.interval()``."""
    low, high = (f"{d0:.4g}" for d0 in path.d0_interval)
    if np.isnan(path.d0_interval[0]) or not (path.followed or low != high):
        return ""
    return f"{low} to {high} by {path.varies_by}"


def facts(path: Path) -> Iterator[tuple[str, str]]:
    """Yields ``path.facts()``."""
    which = "the path of this model: joints rock and do not slide"
    if path.slides:
        is_limit = path.flow == "associated"
        which = "an upper limit" if is_limit else "one of several possible paths"
        which += ": joints slide on the way, so that the curve depends on the step"
    if path.followed and not path.slides_away:
        which = "an interval over step and flow: no iterates came to rest on the way"
    yield "in words", which
    first, last = (f"{path.load_factor[k]:.5g}" for k in (0, -1))
    way = f"{path.displacement[-1]:.5g} {path.scene.units.length}"
    of = "the live load (mean)" if path.control is None else f"block {path.control[0]}"
    yield "load factor", f"{first} with friction at points, {last} where the path ends"
    yield "displacement", f"of {of}: {way} where it ends, after {len(path) - 1} steps"
    if path.reason != path.headline:
        yield "ends", path.reason
    if path.snaps:
        yield "snaps", f"{len(path.snaps)}: the structure jumps there"
    yield from (("note", note) for note in path.notes)
    yield "rests on", PROVES
