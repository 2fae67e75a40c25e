"""The tables of docs/evidence/interaction.md and paper.md, from results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

import numpy as np

from benchmarks.experiment import Head, Lines
from benchmarks.experiments.interaction.runs import (
    AXES,
    DEFAULTS,
    FIRST,
    Pair,
    Result,
    setting,
)

PAPER = {
    "s12-panel": ("S12 (Table 8)", 0.186, 0.137, 0.129),
    "s10-panel": ("S10 (Table 10)", 0.262, 0.215, 0.213),
    "tuff-wall": ("tuff wall (Table 5)", None, None, None),
}
"""The paper's name, first and last factor, and the experiment's."""

MINUTES = {"s12-panel": "34 min", "s10-panel": "61 min", "tuff-wall": "3 s"}
"""What the paper's last iterates took it."""

SETTLED = 3
"""Iterates from this one on count for the range in which an iteration wanders."""


def _of(pairs: Iterable[Pair], part: str, **wanted: object) -> list[Pair]:
    return [
        (e, r)
        for e, r in pairs
        if e.part == part and all(getattr(e, name) == value for name, value in wanted.items())
    ]


def _table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> Lines:
    yield Head(*head)
    yield from map(tuple, rows)


def _number(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _later(result: Result) -> list[float]:
    return [f for f in result.factors[SETTLED - 1 :] if f is not None]


def _range(values: Sequence[float]) -> str:
    if not values:
        return "-"
    low, high = f"{min(values):.4f}", f"{max(values):.4f}"
    return low if low == high else f"{low} to {high}"


def _bracket(pairs: Sequence[Pair], scene: str, moments: str) -> Result | None:
    found = _of(pairs, "brackets", scene=scene, moments=moments, kind="certified")
    return found[0][1] if found and found[0][1].upper is not None else None


def _inside(result: Result | None) -> str:
    if result is None or result.upper is None:
        return "-"
    return f"[{_number(result.lower)}, {_number(result.upper)}]"


def readings(pairs: Sequence[Pair]) -> Lines:
    """Tables 8 and 10 and the tuff wall under every reading."""
    head = ("scene", "reading", "first", "second", "third", "later", "last", "certified, cone")
    rows = []
    for scene, (title, first, last, experiment) in PAPER.items():
        if first is not None:
            told = f"**{_number(last, 3)}**"
            rows.append((f"**{title}**", "the paper", f"**{first}**", "", "", "", told, ""))
            rows.append(("", "experiment", "", "", "", "", f"**{_number(experiment, 3)}**", ""))
        for e, r in _of(pairs, "tables", scene=scene):
            some = [*r.factors[:3], None, None, None][:3]
            bracket = _inside(_bracket(pairs, scene, e.moments))
            last_one = f"{_number(r.load_factor)} after {len(r.factors)}, {r.status}"
            figures = (*(_number(f) for f in some), _range(_later(r)), last_one, bracket)
            rows.append((scene if first is None else "", e.moments, *figures))
    yield from _table(head, rows)


def spread(pairs: Sequence[Pair]) -> Lines:
    """The paper's column against its reading: one choice of axes, all four, orders, settings."""
    names = [reading.name for reading in AXES]
    yield Head("panel", "from the third iterate on", "over the paper's last", "load factors")
    for scene, (title, _, last, experiment) in PAPER.items():
        runs = {e.moments: r for e, r in _of(pairs, "tables", scene=scene)}
        if last is None or "paper" not in runs:
            continue
        values = {
            "its reading": _later(runs["paper"]),
            "all four choices of axes": [f for n in names if n in runs for f in _later(runs[n])],
            "blocks in other orders": _later_of(paper_orders_of(pairs, scene)),
            "other settings": _later_of(paper_settings_of(pairs, scene)),
        }
        for what, factors in values.items():
            if factors:
                apart = f"{_percent(min(factors), last)} to {_percent(max(factors), last)}"
                yield title, what, apart, _range(factors)
        independent = _bracket(pairs, scene, "independent")
        if independent is not None and independent.lower is not None and experiment is not None:
            low, high = independent.lower, independent.upper or independent.lower
            apart = f"{_percent(low, experiment)} to {_percent(high, experiment)} of the experiment"
            yield title, "independent signs, certified", apart, _inside(independent)


def _later_of(pairs: Sequence[Pair]) -> list[float]:
    return [f for _, r in pairs for f in _later(r)]


def _percent(value: float, of: float) -> str:
    return f"{100.0 * (value / of - 1.0):+.1f} %"


def settings(pairs: Sequence[Pair]) -> Lines:
    """Iterations and ends, by epsilon, weight and solver, on the cone."""
    yield from _by_setting(_of(pairs, "settings", surface="conic"))


def paper_settings(pairs: Sequence[Pair]) -> Lines:
    """The same for the paper's reading on the octagon: the tuff wall and both panels."""
    yield from _by_setting(_of(pairs, "settings", surface="octagon"))


def paper_settings_of(pairs: Sequence[Pair], scene: str) -> list[Pair]:
    """Runs of the paper's reading with settings other than the paper's."""
    chosen = _of(pairs, "settings", scene=scene, moments="paper", surface="octagon")
    return [(e, r) for e, r in chosen if setting(e) != DEFAULTS]


def last(pairs: Sequence[Pair]) -> Lines:
    """Tables 5, 8 and 10 and Fig. 21: last iterates of the paper's reading, and brackets."""
    rows = []
    for scene, (title, _, published, experiment) in PAPER.items():
        runs = _of(pairs, "tables", scene=scene, moments="paper")
        rows += [
            (
                title,
                f"{_told(published)}, {MINUTES[scene]}",
                _told(experiment),
                f"{_range(_later(r))}, {_number(r.load_factor)} after {r.solves}",
                f"{r.seconds:.0f}",
            )
            for _, r in runs
        ]
        for moments in ("paper", "independent", "signed"):
            found = _of(pairs, "brackets", scene=scene, moments=moments, kind="certified")
            rows += [
                (f"certified, {moments}", "", "", _inside(r), f"{r.seconds:.0f}") for _, r in found
            ]
    yield from _table(("", "the paper's last", "experiment", "cvxlimit", "s"), rows)


def _told(value: float | None) -> str:
    return "not in the text" if value is None else f"{value:.3f}"


def paper_orders_of(pairs: Sequence[Pair], scene: str) -> list[Pair]:
    """Runs of the paper's reading and settings with the blocks in other orders."""
    chosen = _of(pairs, "orders", scene=scene, moments="paper", surface="octagon")
    return [(e, r) for e, r in chosen if setting(e) == DEFAULTS]


def _by_setting(chosen: Sequence[Pair]) -> Lines:
    scenes = list(dict.fromkeys(e.scene for e, _ in chosen))
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for e, r in chosen:
        cells.setdefault((e.moments, setting(e)), {})[e.scene] = _ending(r)
    rows = [
        (moments, changed, *(row.get(scene, "-") for scene in scenes))
        for (moments, changed), row in cells.items()
    ]
    yield from _table(("reading", "setting", *scenes), rows)


def _ending(r: Result) -> str:
    """The end of an iteration that settled, the range and the paper's end of one that did not."""
    if r.load_factor is None:
        return r.status
    if r.status == "converged":
        return f"{r.load_factor:.4f} after {r.solves}"
    later = [f for f in r.factors[len(r.factors) // 2 :] if f is not None]
    met = met_after(r)
    return _range(later) + ("" if met is None else f", Eq. 43 after {met}")


def met_after(r: Result) -> int | None:
    """Solves until the load factor first changed by no more than the paper's 1e-4 (Eq. 43)."""
    for number, (before, factor) in enumerate(pairwise(r.factors), 2):
        if before is not None and factor is not None and abs(factor - before) <= 1e-4 * abs(factor):
            return number
    return None


def orders(pairs: Sequence[Pair]) -> Lines:
    """Ends of the iteration with the blocks in other orders."""
    groups: dict[tuple[str, ...], list[Result]] = {}
    for e, r in _of(pairs, "orders"):
        groups.setdefault((e.scene, e.moments, e.surface, setting(e)), []).append(r)
    rows = []
    for group, runs in groups.items():
        ends = [r.load_factor for r in runs if r.load_factor is not None]
        later = [f for r in runs for f in _later(r)]
        met = [n for r in runs if (n := met_after(r)) is not None]
        counted = f"{len(met)} of {len(runs)}"
        if met:
            counted += f", after {min(met)} to {max(met)}"
        most = str(max(r.solves for r in runs))
        rows.append((*group, str(len(runs)), _range(later), _range(ends), most, counted))
    head = (
        "scene", "reading", "surface", "setting", "orders", "from the third on", "last", "at most",
        "Eq. 43",
    )  # fmt: skip
    yield from _table(head, rows)


def brackets(pairs: Sequence[Pair]) -> Lines:
    """Width and time of brackets, and where the iteration ends beside them; what is one number to
    four digits by both is left out."""
    rows = []
    head = (
        "scene", "contacts", "reading", "certified", "width", "CPU s", "first solves",
        "paper's iteration", "CPU s", "from the bracket",
    )  # fmt: skip
    chosen = _of(pairs, "brackets")
    first = {e.scene: r.seconds for e, r in chosen if e.kind == FIRST}
    iterations = {(e.scene, e.moments): r for e, r in chosen if e.kind == "fixed-point"}
    for e, r in chosen:
        other = iterations.get((e.scene, e.moments))
        if e.kind != "certified" or (other is not None and _agree(r, other)):
            continue
        solves = f"{r.seconds / first[e.scene]:.0f}" if first.get(e.scene) else "-"
        rows.append(
            (
                e.scene,
                str(r.contacts),
                e.moments,
                _inside(r) if r.upper is not None else r.status,
                _width(r),
                f"{r.seconds:.1f}",
                solves,
                "-" if other is None else _ending(other),
                "-" if other is None else f"{other.seconds:.1f}",
                "-" if other is None else _beside(other, r),
            )
        )
    yield from _table(head, rows)


_CLOSED = 1e-4
"""Relative width of a bracket that is a number to four digits."""


def _agree(bracket: Result, iteration: Result) -> bool:
    """Whether the bracket is one number to four digits, and where the iteration ends."""
    if bracket.lower is None or bracket.upper is None or iteration.load_factor is None:
        return False
    apart = max(bracket.upper - bracket.lower, abs(iteration.load_factor - bracket.upper))
    return apart <= _CLOSED * abs(bracket.upper)


def _width(r: Result) -> str:
    if r.lower is None or not r.upper:
        return "-"
    width = 100.0 * (r.upper - r.lower) / r.upper
    return f"{width:.2g} %" if width < 10.0 else f"{width:.0f} %"


def _beside(iteration: Result, bracket: Result) -> str:
    """How far the last iterate is outside the bracket, of its nearer end."""
    factor, low, high = iteration.load_factor, bracket.lower, bracket.upper
    if factor is None or low is None or high is None or not low > 0.0:
        return "-"
    if factor < low:
        return _percent(factor, low)
    return _percent(factor, high) if factor > high else "inside"


def summary(pairs: Sequence[Pair]) -> Lines:
    """How wide brackets are, by reading: walls and built-in scenes."""
    yield Head("reading", "scenes", "number", "brackets", "median width", "widest", "within 1 %")
    for moments in ("independent", "signed", "paper"):
        every = _of(pairs, "brackets", moments=moments, kind="certified")
        for what, is_wall in (("random walls", True), ("built-in scenes", False)):
            own = [r for e, r in every if e.scene.startswith("random") is is_wall]
            widths = [100.0 * (r.upper - r.lower) / r.upper for r in own
                      if r.lower is not None and r.upper]  # fmt: skip
            if widths:
                yield (moments, what, len(own), len(widths), f"{np.median(widths):.2g} %",
                       f"{max(widths):.1f} %", sum(w <= 1.0 for w in widths))  # fmt: skip


TABLES: dict[str, Callable[[Sequence[Pair]], Lines]] = {
    "readings": readings,
    "spread": spread,
    "last": last,
    "settings": settings,
    "paper-settings": paper_settings,
    "orders": orders,
    "brackets": brackets,
    "summary": summary,
}
"""By their headings."""
