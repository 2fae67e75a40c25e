"""A path in words: what it says and what it does not, for reports, pictures and refusals."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from cvxlimit.extensions.paths.path import Path
from cvxlimit.solution.bracket import rounded_down, rounded_up

WITHIN = 0.02
"""What half the step may change of a load factor, over the first one: a fiftieth, which no check of
a displacement notices. More is said."""

PROVES = "a bracket proves what its configuration carries, not that the structure gets there"
"""What every table and picture of a path says."""


def headline(path: Path) -> str:
    """Returns ``path.headline``."""
    if path.motions:
        return _moving(path)
    unit, joints = path.scene.units.length, list(path.sliding_joints)
    moves = f"a load factor of {path.load_factor[0]:.5g} moves it"
    if path.status == "not-decided" and path.halved is not None:
        runs = (path, path.halved)
        ends = (f"{_end(run)} with steps of {run.step:.4g} {unit}" for run in runs)
        return f"{moves}, and how it ends is not decided: {' and '.join(ends)}"
    which = ", ".join(joints[:3]) + (f" and {len(joints) - 3} more" if joints[3:] else "")
    which = f"joint{'s' * (len(joints) != 1)} {which}".rstrip()
    # It slides away: the load factor stays level.
    if path.slides_away:
        slide = "slides" if len(joints) == 1 else "slide"
        begin, end = path.level
        at = f"{path.load_factor[np.searchsorted(path.w, end)]:.5g}"
        behind = f"; behind that {_end(path, True)}" * bool(end < path.w[-1])
        return (
            f"{moves}, and there is no d0: {which} {slide}, the load factor stays level at {at} "
            f"from w = {begin:.4g} to {end:.4g} {unit}, and such a path ends where what it slides "
            f"on was drawn to end, which is no capacity of displacement{behind}{_changed(path)}"
        )
    if path.control_stays and path.control is not None:
        (block, way), w = path.control, f"w comes to {path.w[-1]:.4g} {unit}"
        return f"no d0: the control, block {block!r}, does not move along {way}, though {w}"
    # Where it ends, and what that rests on.
    low, high = (f"{d0:.4g}" for d0 in path.d0_interval)
    said = f"zero at d0 = {low}" + (f" to {high}" if low != high else "") + f" {unit}"
    if np.isnan(path.d0_interval[0]):
        said = f"no d0: it ends at a load factor of {path.load_factor[-1]:.4g}"
    if len(path) == 1:
        return said
    followed = f"; {path.followed}" * bool(path.followed)
    if not path.slides:
        return f"{said}: blocks rock, and no joint slides from step to step{followed}"
    return (
        f"{said}, and {100.0 * path.slip_share:.0f} % of the displacement in joints is slip "
        f"({which}): it depends on {path.varies_by}, and is no bound{_changed(path)}{followed}"
    )


def _changed(path: Path) -> str:
    """What half the step changes, in words, if that is more than it may be."""
    if not abs(path.change) > WITHIN:
        return ""
    what = "the reaction" if path.motions else "the load factor"
    of = "the weight" if path.motions else "the first"
    return f"; half the step changes {what} on the way by up to {path.change:+.1%} of {of}"


def _moving(path: Path) -> str:
    """What the path of supports that move says."""
    unit, _, force = path.units
    low, high = path.largest_movement
    far = f"{low:.6g} {unit}" if np.isinf(high) else f"between {low:.6g} and {high:.6g} {unit}"
    names = path.motions[0].supports
    who = f"support{'s' * (len(names) > 1)} {', '.join(names)}"
    who += ", and others in proportion," * (len(path.motions) > 1)
    moves = "move" if len(names) > 1 else "moves"
    first, last = (f"{-alpha:.5g}" for alpha in path.load_factor[[0, -1]])
    if path.status == "not-decided" and path.halved is not None:
        half = path.halved
        ends = f"{path.w[-1]:.4g} {unit} and with half the steps at {half.w[-1]:.4g} {unit}"
        end = f"how far {who} can move is not decided: it ends at {ends} ({half.status})"
    elif path.status != "falls":
        how = ", as was asked for" if path.status == "zero" else f" at least ({path.status})"
        end = f"{who} {moves} by {low:.6g} {unit}{how}"
    else:
        end = f"{who} {moves} by {far} until no forces carry the dead load"
    wide = opened(path.openings(-1), 3)
    gap = f"; open are then {wide} ({path.scene.units.length})" * bool(wide)
    slip = f"; joints slide ({', '.join([*path.sliding_joints][:3])})" * bool(path.slides)
    way = f"the reaction along the motion goes from {first} to {last} {force}"
    return f"{end}: {way}{gap}{slip}{_changed(path)}"


def motions(path: Path) -> str:
    """Which supports move, and how, for a movement w of the first of them."""
    length, size = path.scene.units.length, path.motions[0].size

    def written(numbers: Iterable[float], unit: float = 1.0) -> str:
        return f"({', '.join(f'{x / unit:.6g}' for x in numbers)})"

    said = []
    for each in path.motions:
        how = [f"by w {written(each.direction, size)}"] * any(each.direction)
        if each.about is not None and any(each.rotation):
            turn, about = written(each.rotation, size), written(each.about)
            how += [f"turns by w {turn} about {about} {length}"]
        said.append(f"{', '.join(each.supports)} {' and '.join(how)}")
    return "; ".join(said)


def opened(joints: Mapping[str, float], most: int | None = None) -> str:
    """Open joints with their widths, in words; the widest ``most`` of them."""
    each = [f"{name} {wide:.3g}" for name, wide in joints.items()]
    more = f" and {len(each) - most} more" if most is not None and len(each) > most else ""
    return ", ".join(each[:most]) + more


def reactions(path: Path, i: int) -> str:
    """Both reactions of supports that move at configuration ``i``, with their bounds."""
    rows = path.reactions[i].reshape(2, 2)
    least, largest = (f"[{rounded_down(low)}, {rounded_up(high)}]" for low, high in rows)
    return f"least in {least}, largest in {largest} {path.units.push}"


def _end(run: Path, is_behind: bool = False) -> str:
    """How a run ends, in words; of one that slides away only that, unless what ``is_behind`` is
    asked for."""
    unit = run.scene.units.length
    if run.slides_away and not is_behind:
        low, high = run.level
        return f"it slides at a level load factor from w = {low:.4g} to {high:.4g} {unit}"
    if run.load_factor[-1] <= run.until + run.zero:
        return f"it comes to {run.until:g} at {run.displacement[-1]:.4g} {unit}"
    ends = {"falls": "it falls", "blocked": "nothing moves on", "slides": "it slides on"}
    what = ends.get(run.status, "it is broken off")
    factor = f"{run.load_factor[-1]:.4g}"
    return f"{what} at {run.displacement[-1]:.4g} {unit}, at a load factor of {factor}"


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


def below(path: Path) -> str:
    """What the brackets of a path are of that its load factors are not; empty where these lie in
    them."""
    count = sum(path.below)
    if not count:
        return ""
    return (
        f"{count} of {len(path)} load factors lie below their bracket, which is of the most that "
        "the configuration carries by associated friction; the path's own forces are in "
        "equilibrium at less, as their friction opposes the slip of the step"
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
    way = f"{path.displacement[-1]:.5g} {path.units.displacement}"
    of = "the live load (mean)" if path.control is None else f"block {path.control[0]}"
    if path.motions:
        of = "the supports" if path.control is None else of
        yield "motion", motions(path)
        yield "reactions at first", reactions(path, 0)
        yield "reactions at the end", reactions(path, -1)
        for i in (int(np.abs(path.w - 0.5 * path.w[-1]).argmin()), -1):
            yield f"open at {path.w[i]:.5g} {path.units.w}", opened(path.openings(i), 6) or "none"
    else:
        yield "load factor", f"{first} with friction at points, {last} where the path ends"
    yield "displacement", f"of {of}: {way} where it ends, after {len(path) - 1} steps"
    if path.reason != path.headline:
        yield "ends", path.reason
    if path.snaps:
        yield "snaps", f"{len(path.snaps)}: the structure jumps there"
    yield from (("note", note) for note in path.notes)
    if said := below(path):
        yield "brackets", said
    yield "rests on", PROVES
