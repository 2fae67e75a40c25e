"""The way from rest as pictures: load factor over displacement, where joints slide and open first,
and where draws of beds end."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.plotting.contents import Bar, Viewer, at_rest
from cvxlimit.plotting.look import printable
from cvxlimit.plotting.pictures.utilisation import joint_areas
from cvxlimit.plotting.registry import figures
from cvxlimit.plotting.style import Style
from cvxlimit.solution import FromRest, Solution
from cvxlimit.solution.bracket import rounded, rounded_up


def curve(solution: Solution, **options: Any) -> Any:
    """A figure of load factor over displacement on the way from rest, below the proved limit of
    joints that open as they slide; ends with other stiffness and with beds that are not true stand
    on its right edge. Lines in the lower half count, on the right scale, joints that slide and
    are open; a mark on the curve shows where a first one does, if not from rest on.

    ``options`` are those of every picture (:func:`cvxlimit.plotting.picture`).

    Raises
    ------
    InputError
        For the answer of another method.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> found = solve(builtin_scene("single-block"), method="incremental")
    >>> type(found.plot("curve", figsize=(3.4, 3.0))).__name__
    'SceneFigure'
    """
    way, chart = _way_of(solution), figures("sheet").Sheet.of((6.4, 4.6), **options)
    axes, steps = chart.axes, way.steps
    x, y = (np.array([getattr(s, name) for s in steps]) for name in ("displacement", "load_factor"))
    axes.plot(x, y, ".-", color=Style.blue, ms=4, label="from rest")
    if way.limit is not None:
        axes.axhline(way.limit, color=Style.violet, ls="--", lw=1.0, label=_limit(way.limit))
    for trials, mark, size, colour, label in (
        (way.spread, "_", 9, Style.green, "end with other stiffness or half the step"),
        (way.draws, "x", 5, Style.brown, "end with beds that are not true"),
    ):
        ends = [trial.load_factor for trial in trials if trial.load_factor is not None]
        if ends:
            axes.plot([x.max()] * len(ends), ends, mark, color=colour, ms=size, label=label)
    most, counts = 1, axes.twinx()
    for name, what, colour, mark in (
        ("sliding", "slide", Style.amber, "o"), ("open", "are open", Style.red, "D")
    ):  # fmt: skip
        number = np.array([getattr(step, name) for step in steps])
        most, first = max(most, int(number.max())), np.flatnonzero(number)
        counts.plot(x, number, color=colour, lw=1.0, drawstyle="steps-post")
        axes.plot([], [], color=colour, lw=1.0, label=f"joints that {what} (right)")
        if first.size and first[0] > 0:
            look = {"ms": 7, "mfc": "none", "mew": 1.5, "color": colour, "zorder": 4}
            axes.plot(x[first[0]], y[first[0]], mark, **look, label=f"first joints {what}")
    # A plateau is up to a thousand times as long as the elastic part, which is linear here.
    axes.set_xscale("symlog", linthresh=1.0)
    ticker = needed("matplotlib.ticker", "plot", "pictures")
    axes.xaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set(xlim=(0.0, 1.2 * max(1.0, x.max())), ylim=(min(0.0, axes.get_ylim()[0]), None),
             ylabel="load factor")  # fmt: skip
    counts.set_ylim(0.0, 2.0 * most)  # the lower half, where few curves have their plateau
    counts.yaxis.set_major_locator(ticker.MaxNLocator(6, integer=True))
    counts.set_ylabel("joints", fontsize=chart.letters(10.0))
    counts.tick_params(labelsize=chart.letters(9.0))
    label = "displacement of the live load (1: elastic at the end's load factor)"
    lines = figures("sheet").lines_of(label, chart.letters(10.0), 0.75 * chart.width)
    axes.set_xlabel("\n".join(lines))
    chart.write(_title(solution, way.end))
    return chart.figure


def onset(
    solution: Solution, *, what: Literal["either", "sliding", "opening"] = "either",
    viewer: Viewer = None, **options: Any,
) -> Any:  # fmt: skip
    """A figure of where joints slide and open first: their areas from light (at rest) to dark (at
    the load factor reached), grey where they never did. A joint counts once any point of it does.

    ``what`` chooses one of both, ``viewer`` the direction from which the structure is seen;
    ``options`` are those of every picture (:func:`cvxlimit.plotting.picture`).

    Raises
    ------
    InputError
        For the answer of another method, and one that was read from a file.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> found = solve(builtin_scene("single-block"), method="incremental")
    >>> type(found.plot("onset", figsize=(3.4, 3.0))).__name__
    'SceneFigure'
    """
    way, verbs = _way_of(solution), {"sliding": "slide", "opening": "open"}
    if way.slipped is None or way.opened is None:
        raise InputError(f"{solution!r} was read from a file, which has no joints: solve it again")
    kinds = {"sliding": way.slipped, "opening": way.opened}
    if what not in (*kinds, "either"):
        raise InputError(f"what must be one of either, sliding, opening, got {what!r}")
    chosen = [what] if what in kinds else [*kinds]
    first = np.fmin.reduce([kinds[name] for name in chosen])
    begin = " or ".join(verbs[name] for name in chosen)
    top = max(step.load_factor for step in way.steps)
    share = np.clip(first / top if top > 0.0 else first, 0.0, 1.0)
    keys = [(Style.idle, f"joints that never {begin}")] if np.isnan(share).any() else []
    drawing = at_rest(
        solution, viewer, f"where joints {begin} first on the way from rest",
        decals=list(joint_areas(solution.scene, share, both=False)), keys=keys, glass=True,
        bar=Bar(Style.use, f"load factor at which joints {begin}, over the one reached"),
    )  # fmt: skip
    return figures().drawn(drawing, **options)


def bedding(solution: Solution, **options: Any) -> Any:
    """A figure of where the way ends on beds that are not true: the share of draws that end at a
    load factor or below, beside the end on true beds and the proved limit; below it why draws have
    none.

    ``options`` are those of every picture (:func:`cvxlimit.plotting.picture`).

    Raises
    ------
    InputError
        For the answer of another method, without draws, or if no draw ended.

    Example
    -------
    >>> from cvxlimit import Incremental, builtin_scene, solve
    >>> rough = Incremental(spread=False, bedding=1.0, draws=3)
    >>> found = solve(builtin_scene("single-block"), method=rough)
    >>> type(found.plot("bedding", figsize=(3.4, 3.0))).__name__
    'SceneFigure'
    """
    way = _way_of(solution)
    ends = np.sort([trial.load_factor for trial in way.draws if trial.load_factor is not None])
    if way.bedding is None or not way.draws:
        raise InputError(
            f"bedding is a picture of draws, and {solution!r} has none: bedding=30.0, or "
            "--bedding 30, asks for them"
        )
    if not ends.size:
        raise InputError(f"no draw of {solution!r} ended in a load factor: {way.lost_text}")
    chart = figures("sheet").Sheet.of((6.4, 4.4), **options)
    axes, share = chart.axes, np.arange(1, len(ends) + 1) / len(way.draws)
    label = f"{len(ends)} of {len(way.draws)} draws, beds untrue by {way.bedding:g}"
    axes.step([ends[0], *ends], [0.0, *share], ".-", where="post", color=Style.blue, ms=5,
              label=label)  # fmt: skip
    if way.limit is not None:
        axes.axvline(way.limit, color=Style.violet, ls="--", lw=1.0, label=_limit(way.limit))
    if solution.load_factor is not None:
        true = f"{rounded(solution.load_factor, 4)}, with true beds"
        axes.axvline(solution.load_factor, color=Style.green, lw=2.4, zorder=1, label=true)
    axes.set(xlabel="load factor reached from rest", ylabel="share of draws that end so low",
             ylim=(0.0, 1.03))  # fmt: skip
    low, high = axes.dataLim.intervalx
    beside = max(0.08 * (high - low), 0.02 * abs(high))  # where all ends are one, too
    axes.set_xlim(low - beside, high + beside)
    axes.xaxis.set_major_locator(needed("matplotlib.ticker", "plot", "pictures").MaxNLocator(6))
    lost = f"no load factor: {way.lost_text}" if way.lost_text else ""
    chart.write(_title(solution, "draws of beds"), lost)
    return chart.figure


def _way_of(solution: Solution) -> FromRest:
    if solution.from_rest is None or not solution.from_rest.steps:
        raise InputError(
            f"this is a picture of the way from rest, got {solution!r}: "
            "solve(scene, method='incremental') makes one"
        )
    return solution.from_rest


def _title(solution: Solution, what: str) -> str:
    number = "" if solution.load_factor is None else f" {rounded(solution.load_factor, 4)}"
    return f"{printable(solution.scene_name)}, from rest{number}: {what}"


def _limit(limit: float) -> str:
    return f"{rounded_up(limit, 4)}, proved, if joints open as they slide"
