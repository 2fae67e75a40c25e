"""The paper's iteration under every reading of Eq. 30, beside certified brackets.

Every run of :func:`runs` is a row of the file ``--out`` as soon as it is done, and what this code
measured there is not run again: tables and the picture are made from all of them. ``--kept FILE``
prints the rows of a file that any version measured, and says which.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from benchmarks.charts import LETTERS, figure_of, save
from benchmarks.experiment import Head, Lines, Part, Title, experiment
from benchmarks.rows import Measured, Row
from benchmarks.scenes import scene_of as by_name
from cvxlimit import Scene, solve
from cvxlimit.errors import CvxlimitError
from cvxlimit.extensions.interaction.certified import Certified
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.named import MOMENTS, Paper
from cvxlimit.solution.bracket import Bracket, known
from cvxlimit.solvers import settings_for

STORE = Path("benchmarks/results/interaction.jsonl")

AXES = tuple(Paper((one, two)) for one in (1, -1) for two in (1, -1))
"""The paper's reading with the four choices of signs of the contacts' axes."""

READINGS: dict[str, Moments] = {**MOMENTS, **{reading.name: reading for reading in AXES}}
CONVENTIONS = ("independent", "signed", "paper")
"""The readings whose brackets are certified on all scenes."""

WALLS = tuple(f"random-wall-{seed}" for seed in (1, 2, 3, 5, 7, 8, 11, 12, 13, 16))
"""Irregular walls of 14 to 46 contacts whose live load does harm."""

PAPER: dict[str, tuple[str, float | None, float | None, float]] = {
    "s12-panel": ("S12 (Table 8)", 0.137, 0.129, 33.7),
    "s10-panel": ("S10 (Table 10)", 0.215, 0.213, 60.8),
    "tuff-wall": ("tuff wall (Table 5)", None, None, 0.05),
}
"""The paper's name, its last factor, the experiment's, and the minutes that its last iterate
took."""

ORDERS = {"tuff-wall": 12, "s12-panel": 6, "s10-panel": 3}
"""In how many orders of the blocks the paper's own reading is run, on the octagon as there."""

CHANGES: tuple[dict[str, Any], ...] = (
    *({"epsilon": epsilon} for epsilon in (1e-3, 1e-2, 1e-1)),
    *({"weight": weight} for weight in (0.0, 0.5, 0.95)),
    {"epsilon": 1e-2, "regularisation": 1e-3}, {"solver": "QOCO"},
)  # fmt: skip
"""Settings other than the defaults, one at a time. With a ``regularisation`` forces are those of
least norm, so that neither rounding nor the solver picks them."""


CLOSED = 1e-4
"""Relative width of a bracket that is a number to four digits; the paper's change in Eq. 43."""


@dataclass(frozen=True)
class Experiment:
    """One run: a part of the page, a scene, a reading, what is asked and the iteration's settings.

    ``kind`` is "fixed-point", "certified", or "first" for the convex problem without interaction,
    the measure of time. ``order`` is the seed of a permutation of the blocks, -1 leaves them.
    """

    part: str
    scene: str
    moments: str
    kind: str = "fixed-point"
    surface: str = "conic"
    weight: float = 0.8
    epsilon: float = 0.0
    solver: str = ""
    order: int = -1
    regularisation: float = 0.0

    @property
    def key(self) -> str:
        """Tells experiments apart."""
        return "|".join(f"{value}" for value in vars(self).values())

    @property
    def setting(self) -> str:
        """What is not as by default."""
        if self.solver:
            return f"solver {self.solver}"
        if self.weight != Experiment.weight:
            return f"beta {self.weight:g}"
        least = ", least forces" if self.regularisation else ""
        return f"epsilon {self.epsilon:g}{least}" if self.epsilon else "as it is"


Pair = tuple[Experiment, Row]
"""A run and what came of it: status, load factor, bounds, CPU seconds, contacts, iterates."""


@experiment(Part(30, "--out docs/evidence/interaction.jsonl --docs docs/evidence"))
def interaction(
    scenes: Sequence[str] = (), each: float = 600.0, out: Path = STORE,
    docs: Path | None = None, kept: Path | None = None,
) -> Lines:  # fmt: skip
    """The paper's iteration, its readings, and certified brackets; so many seconds for each run."""
    rows, every = Measured(kept or out, "key", kept=kept is not None), list(runs())
    every = [e for e in every if not scenes or e.scene in scenes]
    if kept is not None:
        yield rows.said()
    for wanted in every if kept is None else ():
        if {"key": wanted.key} not in rows:
            rows.add({"key": wanted.key, "result": run(wanted, each)})
    pairs = [(e, row["result"]) for e in every if (row := rows.get({"key": e.key}))]
    for title, table in TABLES.items():
        yield Title(title)
        yield from table(pairs)
    if docs is not None:
        save(histories(pairs), docs / "interaction.png")


def runs() -> Iterator[Experiment]:
    """All of them, part by part."""
    for scene in PAPER:  # Tables 8 and 10 and the tuff wall, under every reading
        for reading in (*AXES, *(m for m in MOMENTS.values() if m.name != "paper")):
            yield Experiment("tables", scene, reading.name, surface="octagon")
    # certified brackets and the paper's iteration beside them, on the exact cone
    for scene in dict.fromkeys((*ORDERS, *WALLS, *BUILTIN)):
        yield Experiment("brackets", scene, "none", "first")
        for moments in CONVENTIONS:
            yield Experiment("brackets", scene, moments, "certified")
            yield Experiment("brackets", scene, moments)
    for reading in (*AXES[1:], MOMENTS["signed-torsion-bending"]):
        yield Experiment("brackets", "tuff-wall", reading.name, "certified")
    for scene, orders in ORDERS.items():  # what the paper's reading depends on
        of_paper = Experiment("settings", scene, "paper", surface="octagon")
        yield of_paper
        others = CHANGES if scene == "tuff-wall" else CHANGES[:-2]  # minutes each on panels
        yield from (replace(of_paper, **change) for change in others)
        yield from (replace(of_paper, part="orders", order=order) for order in range(orders))
    yield Experiment("settings", "tuff-wall", "paper", surface="octagon", solver="HIGHS")


def scene_of(e: Experiment) -> Scene:
    """The scene, with its blocks in the order asked for."""
    scene = by_name(e.scene)
    if e.order < 0:
        return scene
    blocks = np.array(scene.blocks, dtype=object)
    shuffled = np.random.default_rng(e.order).permutation(blocks)
    return replace(scene, blocks=tuple(shuffled))


def run(e: Experiment, seconds: float) -> Row:
    """Run; after ``seconds`` of CPU time it is interrupted, and keeps nothing but the reason."""
    scene, start = scene_of(e), process_time()
    about = {"contacts": len(scene.contacts)}

    def progress(_: str) -> None:
        if process_time() - start > seconds:
            raise KeyboardInterrupt

    moments = READINGS.get(e.moments, "independent")
    methods = {
        "certified": Certified(moments=moments),
        "fixed-point": FixedPoint(
            e.weight, epsilon=e.epsilon, regularisation=e.regularisation, moments=moments
        ),
    }  # fmt: skip
    # HiGHS's interior point and then a corner of the optimal face, as the paper's Mosek has it
    highs = settings_for("HIGHS", None, "HIGHS ipm", solver="ipm")
    ladder = [highs if e.solver == "HIGHS" else e.solver] if e.solver else None
    try:
        found = solve(scene, e.surface, methods.get(e.kind), ladder=ladder, progress=progress)
    except (KeyboardInterrupt, CvxlimitError) as error:
        return {**about, "status": str(error) or f"stopped after {seconds:.0f} s of CPU"}
    factors = [_short(entry.load_factor) for entry in found.history]
    last = factors[-1] if factors and e.kind == "fixed-point" else found.load_factor
    numbers = {
        "load_factor": last, "lower": known(found.lower),
        "upper": known(found.upper), "seconds": process_time() - start,
    }  # fmt: skip
    short = {name: _short(number) for name, number in numbers.items()}
    went = found.iteration
    band = [] if went is None else [_short(went.lowest), _short(went.highest)]
    return {**about, "status": str(found.status), **short, "factors": factors, "band": band}


def _short(number: float | None) -> float | None:
    """Seven digits are enough for tables and pictures."""
    return None if number is None else float(f"{number:.7g}")


def _of(pairs: Iterable[Pair], part: str, **wanted: object) -> list[Pair]:
    """Runs of a part that came to an end."""
    return [
        (e, r) for e, r in pairs
        if e.part == part and r.get("load_factor") is not None
        and all(getattr(e, name) == value for name, value in wanted.items())
    ]  # fmt: skip


def four(value: float) -> str:
    """Four digits, and zero without a sign.

    >>> four(-1e-9), four(0.13)
    ('0.0000', '0.1300')
    """
    return f"{round(value, 4) + 0.0:.4f}"


def _range(values: Sequence[float]) -> str:
    if not values:
        return "-"
    low, high = four(min(values)), four(max(values))
    return low if low == high else f"{low} to {high}"


def _bracket(pairs: Sequence[Pair], scene: str, moments: str) -> Bracket | None:
    found = _of(pairs, "brackets", scene=scene, moments=moments, kind="certified")
    return _of_row(found[0][1]) if found else None


def _of_row(row: Row) -> Bracket | None:
    ends = row.get("lower"), row.get("upper")
    return None if None in ends else Bracket(*ends)  # type: ignore[arg-type]


def _shown(bracket: Bracket | None) -> str:
    return "-" if bracket is None else f"[{bracket.lower:.4f}, {bracket.upper:.4f}]"


def _percent(value: float, of: float) -> str:
    return f"{100.0 * (value / of - 1.0):+.1f} %"


def end(row: Row) -> float:
    """The load factor at which the paper would stop, or of the last iterate."""
    met = met_after(row["factors"])
    return float(row["load_factor"] if met is None else row["factors"][met - 1])


def stopped(row: Row) -> str:
    """What ended the iteration for the paper: its criterion, or our 60 solves, or a cycle."""
    met, solves = met_after(row["factors"]), len(row["factors"])
    if met is not None:
        return f"Eq. 43 after {met}"
    if row["status"] == "not converged":
        return f"{solves} solves"
    return f"{row['status']} after {solves}"


def _ending(row: Row) -> str:
    """Load factor at the end, and what ended it."""
    return f"{four(end(row))}, {stopped(row)}"


def met_after(factors: Sequence[float | None]) -> int | None:
    """Solves until the load factor first changed by no more than the paper's 1e-4 (Eq. 43)."""
    for number, (before, factor) in enumerate(pairwise(factors), 2):
        if None not in (before, factor) and abs(factor - before) <= CLOSED * abs(factor):  # type: ignore[arg-type, operator]
            return number
    return None


def readings(pairs: Sequence[Pair]) -> Lines:
    """Tables 8 and 10 and the tuff wall under every reading."""
    yield Head("scene", "reading", "second", "last", "over the paper's", "stopped by", "band",
               "certified, cone")  # fmt: skip
    for scene, (title, last, test, _) in PAPER.items():
        if last is not None:
            yield (f"**{title}**", "the paper; experiment", "", f"**{last}**; **{test}**",
                   "", "", "", "")  # fmt: skip
        for e, r in _of(pairs, "tables", scene=scene):
            yield (
                scene if last is None else "", e.moments, four(r["factors"][1]),
                four(end(r)), "" if last is None else _percent(end(r), last), stopped(r),
                _range(r["band"]), _shown(_bracket(pairs, scene, e.moments)),
            )  # fmt: skip


def spread(pairs: Sequence[Pair]) -> Lines:
    """The paper's last figures against its reading: one choice of axes, all, orders, settings."""
    yield Head("panel", "where the iteration ends", "over the paper's last", "load factors",
               "of how many, by Eq. 43")  # fmt: skip
    for scene, (title, last, test, _) in PAPER.items():
        tables = _of(pairs, "tables", scene=scene)
        if last is None or test is None:
            continue
        groups = {
            "its reading": [r for e, r in tables if e.moments == "paper"],
            "all four choices of axes": [r for e, r in tables if e.moments.startswith("paper")],
            "blocks in other orders": [r for _, r in _of(pairs, "orders", scene=scene)],
            "other settings": [r for e, r in _of(pairs, "settings", scene=scene)
                               if e.setting != "as it is"],
        }  # fmt: skip
        for what, rows in groups.items():
            if ends := [end(row) for row in rows]:
                apart = dict.fromkeys(_percent(each, last) for each in (min(ends), max(ends)))
                met = sum(met_after(row["factors"]) is not None for row in rows)
                yield title, what, " to ".join(apart), _range(ends), f"{met} of {len(rows)}"
        if bracket := _bracket(pairs, scene, "independent"):
            apart = " to ".join(_percent(each, test) for each in (bracket.lower, bracket.upper))
            yield (title, "independent signs, certified", f"{apart} of the experiment",
                   _shown(bracket), "")  # fmt: skip


def last(pairs: Sequence[Pair]) -> Lines:
    """Tables 5, 8 and 10 and Fig. 21: last iterates of the paper's reading, and brackets."""
    yield Head("", "the paper's last", "experiment", "cvxlimit", "stopped by", "band", "s")
    for scene, (title, published, test, minutes) in PAPER.items():
        took = f"{minutes:.0f} min" if minutes >= 1.0 else f"{60.0 * minutes:.0f} s"
        told = ["not in the text" if v is None else f"{v:.3f}" for v in (published, test)]
        for e, r in _of(pairs, "tables", scene=scene):
            if e.moments.startswith("paper"):
                own = e.moments == "paper"
                heads = (title, f"{told[0]}, {took}", told[1]) if own else (e.moments, "", "")
                yield (*heads, four(end(r)), stopped(r), _range(r["band"]),
                       f"{r['seconds']:.0f}")  # fmt: skip
        for moments in ("paper", "independent", "signed"):
            for _, r in _of(pairs, "brackets", scene=scene, moments=moments, kind="certified"):
                yield (f"certified, {moments}", "", "", _shown(_of_row(r)), "", "",
                       f"{r['seconds']:.0f}")  # fmt: skip


def settings(pairs: Sequence[Pair]) -> Lines:
    """Where the paper's reading goes on the octagon, by epsilon, weight and solver."""
    cells: dict[str, dict[str, str]] = {}
    for e, r in _of(pairs, "settings"):
        cells.setdefault(e.setting, {})[e.scene] = f"{_ending(r)}; {_range(r['band'])}"
    yield Head("setting", *ORDERS)
    for setting, row in cells.items():
        yield setting, *(row.get(scene, "-") for scene in ORDERS)


def brackets(pairs: Sequence[Pair]) -> Lines:
    """Width and time of brackets of built-in scenes, and where the iteration ends beside them; what
    is one number to four digits by both is left out."""
    yield Head("scene", "reading", "certified", "width", "CPU s", "first solves",
               "paper's iteration", "from the bracket")  # fmt: skip
    first = {e.scene: r["seconds"] for e, r in _of(pairs, "brackets", kind="first")}
    iterations = {(e.scene, e.moments): r for e, r in _of(pairs, "brackets", kind="fixed-point")}
    for e, r in _of(pairs, "brackets", kind="certified"):
        other, bracket = iterations.get((e.scene, e.moments)), _of_row(r)
        ended = None if other is None else end(other)
        if e.scene in WALLS or agree(ended, bracket):
            continue
        yield (
            e.scene, e.moments, _shown(bracket),
            "-" if bracket is None else f"{100.0 * bracket.width:.2g} %", f"{r['seconds']:.1f}",
            f"{r['seconds'] / first[e.scene]:.0f}" if first.get(e.scene) else "-",
            "-" if other is None else _ending(other), beside(ended, bracket),
        )  # fmt: skip


def agree(factor: float | None, bracket: Bracket | None) -> bool:
    """Whether a bracket is one number to four digits, and this one."""
    if bracket is None or factor is None:
        return False
    apart = max(bracket.upper - bracket.lower, abs(factor - bracket.upper))
    return apart <= CLOSED * abs(bracket.upper)


def beside(factor: float | None, bracket: Bracket | None) -> str:
    """How far a load factor is outside the bracket, of its nearer end."""
    if factor is None or bracket is None or not bracket.lower > 0.0:
        return "-"
    if factor < bracket.lower:
        return _percent(factor, bracket.lower)
    return _percent(factor, bracket.upper) if factor > bracket.upper else "inside"


def summary(pairs: Sequence[Pair]) -> Lines:
    """How wide brackets are, by reading, and how many iterations end inside: walls and built-in
    scenes."""
    yield Head("reading", "scenes", "brackets", "median width", "widest", "within 1 %",
               "iterations that end inside")  # fmt: skip
    ends = {(e.scene, e.moments): end(r)
            for e, r in _of(pairs, "brackets", kind="fixed-point")}  # fmt: skip
    for moments in CONVENTIONS:
        every = _of(pairs, "brackets", moments=moments, kind="certified")
        for what, is_wall in (("random walls", True), ("built-in scenes", False)):
            own = {
                e.scene: b for e, r in every if (e.scene in WALLS) is is_wall and (b := _of_row(r))
            }
            widths = [100.0 * bracket.width for bracket in own.values()]
            ended = [(ends.get((scene, moments)), bracket) for scene, bracket in own.items()]
            inside = sum(agree(*pair) or beside(*pair) == "inside" for pair in ended)
            if widths:
                yield (moments, what, len(widths), f"{np.median(widths):.2g} %",
                       f"{max(widths):.1f} %", sum(w <= 1.0 for w in widths), inside)  # fmt: skip


TABLES = {
    "readings": readings, "spread": spread, "last": last, "paper-settings": settings,
    "brackets": brackets, "summary": summary,
}  # fmt: skip
"""By their headings."""

COLOURS = {
    "independent": "tab:blue", "signed": "tab:orange", "signed-torsion-bending": "tab:red",
    **dict(zip((a.name for a in AXES), ("#1b7837", "#5aae61", "#a6dba0", "#762a83"), strict=True)),
}  # fmt: skip


def histories(pairs: Sequence[Pair]) -> Figure:
    """Iterates under the readings, beside certified brackets."""
    figure = figure_of(8.0)
    grid = figure.subplots(len(PAPER), 3, sharey="row")
    columns = (("independent",), ("signed", "signed-torsion-bending"), tuple(a.name for a in AXES))
    keys: dict[str, Any] = {}
    for row, (scene, (_, last_one, test, _)) in zip(grid, PAPER.items(), strict=True):
        for ax, names in zip(row, columns, strict=True):
            what = "paper, all axes" if len(names) == 4 else names[0]
            ax.set_title(f"{scene}, {what}", fontsize=10)
            for name in names:
                _draw(ax, pairs, scene, name)
            for at, style, label in (
                (last_one, "--", "the paper's last"),
                (test, ":", "experiment"),
            ):
                if at is not None:
                    ax.axhline(at, color="k", ls=style, lw=1, label=label)
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
            handles, labels = ax.get_legend_handles_labels()
            keys |= {
                label: keys.get(label, handle)
                for label, handle in zip(labels, handles, strict=True)
            }
        first = (r["factors"][0] or 0.0 for _, r in _of(pairs, "tables", scene=scene))
        row[0].set_ylim(0.0, 1.35 * max(first, default=0.4))
        row[0].set_ylabel("load factor")
    for ax in grid[-1]:
        ax.set_xlabel("iteration", fontsize=LETTERS)
    figure.legend(keys.values(), keys.keys(), loc="outside lower center", ncols=3, frameon=False,
                  fontsize=LETTERS)  # fmt: skip
    return figure


def _draw(ax: Axes, pairs: Sequence[Pair], scene: str, moments: str) -> None:
    colour = COLOURS[moments]
    for _, r in _of(pairs, "tables", scene=scene, moments=moments):
        factors = [np.nan if f is None else f for f in r["factors"]]
        ax.plot(np.arange(1, len(factors) + 1), factors, ".-", lw=1, c=colour, label=moments)
    if bracket := _bracket(pairs, scene, moments):
        ends = bracket.lower, bracket.upper
        ax.axhspan(*ends, color=colour, alpha=0.3, lw=1.5, label="certified (cone)")
