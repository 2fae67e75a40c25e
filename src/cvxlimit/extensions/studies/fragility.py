"""How many draws of a sweep fall under a demand, and how far that can be trusted."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.base.checks import finite_vector, members, ratio
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.plotting.look import saved
from cvxlimit.plotting.registry import figures
from cvxlimit.plotting.style import Style
from cvxlimit.solution import Status

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, eq=False)
class Fragility:
    """Of how many draws the load factor lies below each demand; see :func:`fragility`.

    Attributes
    ----------
    demands : (n,)
        Multiples of the live load.
    draws : int
        Number of draws.
    surely, perhaps : (n,)
        Draws that fall for certain, and those that may: bounds on how many fall.
    lower, upper : (n,)
        Confidence interval of the probability that a draw falls.
    confidence : float
    """

    demands: FloatArray
    draws: int
    surely: IntArray
    perhaps: IntArray
    lower: FloatArray
    upper: FloatArray
    confidence: float

    def to_dataframe(self) -> DataFrame:
        """A row for each demand: ``demand``, ``surely``, ``perhaps``, the shares of the draws that
        these are (``share_lower``, ``share_upper``), and the interval, ``lower`` and ``upper``.

        Raises
        ------
        ModelError
            If pandas is not installed.
        """
        pandas = needed("pandas", "frames", "tables")
        shares = {
            "share_lower": self.surely / self.draws, "share_upper": self.perhaps / self.draws,
        }  # fmt: skip
        counts = {"demand": self.demands, "surely": self.surely, "perhaps": self.perhaps}
        table: DataFrame = pandas.DataFrame(
            {**counts, **shares, "lower": self.lower, "upper": self.upper}
        )
        table.attrs = {"draws": self.draws, "confidence": self.confidence}
        return table

    def plot(self, file: str | os.PathLike[str] | None = None, **options: Any) -> Any:
        """A chart of shares over demands with the interval; the figure, or the file's path.

        ``options`` are those of all charts: ``figsize`` in inches, ``title``, ``ax``, ``legend``.
        """
        chart = figures("sheet").Sheet.of((6.4, 3.8), **options)
        axes, order = chart.axes, np.argsort(self.demands)
        at, lower, upper, surely, perhaps = (
            each[order]
            for each in (self.demands, self.lower, self.upper, self.surely, self.perhaps)
        )
        label = f"{100 * self.confidence:g} % confidence"
        axes.fill_between(at, lower, upper, color=Style.blue, alpha=0.18, lw=0, label=label)
        curves = [
            (perhaps, Style.blue, "draws that may fall"),
            (surely, Style.brown, "that surely fall"),
        ]
        if (surely == perhaps).all():
            curves = [(perhaps, Style.blue, "draws that fall")]
        for count, colour, name in curves:
            axes.plot(at, count / self.draws, ".-", color=colour, lw=1.2, ms=4, label=name)
        axes.set(xlabel="load factor demanded", ylabel="probability of collapse", ylim=(0, 1))
        chart.write(f"{self.draws} draws")
        return chart.figure if file is None else saved(chart.figure, file, options)

    def __repr__(self) -> str:
        return f"Fragility({len(self.demands)} demands, {self.draws} draws)"


def fragility(sweep: DataFrame, demands: ArrayLike, confidence: float = 0.95) -> Fragility:
    """The share of random draws whose load factor lies below each demand, with its interval.

    A draw falls for certain where its upper bound is below the demand, and may fall unless its
    lower bound reaches it; so a bracket that holds the demand, a row without bounds or
    with an error, and a ``least_factor``, below which a structure may fall as well, count on both
    sides. A dead load that cannot stand falls under every demand, a live load that does no harm
    under none.

    The interval is Clopper and Pearson's, :func:`scipy.stats.binomtest` with ``method="exact"``:
    from the lower end for those that surely fall to the upper end for those that may. It holds
    with the confidence asked for whatever the probability is; Wilson's does so on average only,
    and falls short where few draws fall, which is where a fragility is read.

    Parameters
    ----------
    sweep : DataFrame
        What :func:`cvxlimit.sweep` returned for independent draws, as from
        :func:`~cvxlimit.studies.draws`; every row counts alike.
    demands : (n,), or one
        Multiples of the live load, not negative.
    confidence : float
        Of the interval at each demand, above 0 and below 1.

    Raises
    ------
    InputError
        For a table that is none of a sweep, has no row, or was interrupted, whose rows are not a
        random choice of the draws; and for demands that are negative or not finite.
    ModelError
        For a confidence that is not between 0 and 1.

    Example
    -------
    >>> from scipy import stats
    >>> from cvxlimit import builtin_scene, sweep
    >>> from cvxlimit.studies import draws
    >>> drawn = draws({"friction": stats.uniform(0.2, 0.4)}, 20, seed=1)
    >>> table = sweep(builtin_scene("single-block"), drawn, progress=False)
    >>> found = fragility(table, [0.25, 0.35])
    >>> found.perhaps.tolist(), found.lower.round(2).tolist(), found.upper.round(2).tolist()
    ([3, 5], [0.03, 0.09], [0.38, 0.49])
    """
    low, high = _bounds(sweep)
    at = _demands(demands)
    number, sure = len(low), ratio(confidence, "confidence")
    surely = (high < at[:, None]).sum(axis=1)
    perhaps = (low < at[:, None]).sum(axis=1)
    ends = {
        k: binomtest(int(k), number).proportion_ci(sure, method="exact")
        for k in np.union1d(surely, perhaps)
    }
    lower = np.array([ends[k].low for k in surely])
    upper = np.array([ends[k].high for k in perhaps])
    return Fragility(at, number, surely, perhaps, lower, upper, sure)


def _bounds(table: DataFrame) -> tuple[FloatArray, FloatArray]:
    """Bounds on the load factor of every row, infinite where it has none."""
    missing = [n for n in ("lower", "upper", "status") if n not in getattr(table, "columns", ())]
    if missing or not len(table):
        what = f"column {missing[0]!r}" if missing else "row"
        raise InputError(f"a fragility needs the table that sweep returns: it has no {what}")
    if table.attrs.get("is_interrupted"):
        raise InputError(
            f"the sweep was interrupted after {len(table)} of {table.attrs['variations']} rows, "
            "which are no random choice of the draws: finish it first"
        )
    status = table["status"].to_numpy(dtype=object)
    low, high = (table[name].to_numpy(dtype=float, copy=True) for name in ("lower", "upper"))
    low[np.isnan(low)], high[np.isnan(high)] = -np.inf, np.inf
    if "least_factor" in table.columns:
        low[table["least_factor"].notna()] = -np.inf
    low[status == str(Status.LIVE_LOAD_HARMLESS)] = np.inf
    high[status == str(Status.DEAD_LOAD_UNSTABLE)] = -np.inf
    return low, high


def _demands(given: ArrayLike) -> FloatArray:
    wanted = np.atleast_1d(members(given, (int, float, np.number), "demands must be numbers"))
    at = finite_vector(wanted, len(wanted), "demands")
    if not len(at) or at.min() < 0.0:
        raise InputError(
            "demands must be multiples of the live load, at least one and none negative, got "
            f"{at.tolist()}"
        )
    return at
