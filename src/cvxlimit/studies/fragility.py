"""Fragility curves: how likely a structure of uncertain properties is to fall under a demand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from cvxlimit.arrays import FloatArray
from cvxlimit.checks import ratio
from cvxlimit.errors import InputError
from cvxlimit.extras import needed
from cvxlimit.solution import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True, eq=False)
class Fragility:
    """Probability that the load factor is below a demand, with a band that holds it.

    The band holds two uncertainties: the number of draws (Clopper and Pearson's interval,
    pointwise) and the brackets, so that draws whose load factor is not known widen it.

    Attributes
    ----------
    demand, probability, lower, upper : (k,) arrays
        The curve and its band.
    capacities : (draws,) array
        Load factors, sorted; those that are not known are left out, the dead load that cannot
        stand counts as 0, and a live load that does no harm as infinite.
    draws : int
    confidence : float
        Of the band.
    name : str
        Of the structure.

    Example
    -------
    >>> curve = fragility(np.linspace(0.1, 0.2, 100), demand=[0.15])
    >>> [round(float(x), 2) for x in curve.at(0.15)]
    [0.5, 0.4, 0.6]
    """

    demand: FloatArray
    probability: FloatArray
    lower: FloatArray
    upper: FloatArray
    capacities: FloatArray
    draws: int
    confidence: float
    name: str = ""
    _bounds: tuple[FloatArray, FloatArray] = (np.empty(0), np.empty(0))

    def at(self, demand: float) -> tuple[float, float, float]:
        """Probability of collapse under a demand, and the ends of its band."""
        found = _curve(np.array([float(demand)]), self.capacities, *self._bounds, self.confidence)
        return float(found[0][0]), float(found[1][0]), float(found[2][0])

    @property
    def median(self) -> float:
        """Load factor that half of the draws reach."""
        return float(np.median(self.capacities))

    @property
    def dispersion(self) -> float:
        """Standard deviation of the load factor's logarithm: beta of a lognormal curve.

        NaN if some draws have no finite load factor above zero.
        """
        usable = bool(np.isfinite(self.capacities).all() and (self.capacities > 0.0).all())
        return float(np.std(np.log(self.capacities), ddof=1)) if usable else float("nan")

    def to_dataframe(self) -> DataFrame:
        """Columns ``demand``, ``probability``, ``lower`` and ``upper``.

        Raises
        ------
        ModelError
            If pandas is not installed.
        """
        pandas = needed("pandas", "frames", "tables")
        columns = ("demand", "probability", "lower", "upper")
        table: DataFrame = pandas.DataFrame({name: getattr(self, name) for name in columns})
        table.attrs = {"scene": self.name, "draws": self.draws, "confidence": self.confidence}
        return table

    def plot(
        self, ax: Axes | None = None, reference: float | None = None, **options: Any
    ) -> Figure:
        """The curve with its band, into ``ax`` or a figure of its own; not shown by itself.

        ``reference`` is a load factor to mark: that of an experiment. ``figsize``, ``title`` and
        ``legend`` are those of :func:`cvxlimit.plotting.picture`.

        Raises
        ------
        ModelError
            If Matplotlib is not installed.
        """
        from cvxlimit.plotting import draw_fragility

        return draw_fragility(self, ax, reference, **options)

    def __repr__(self) -> str:
        return (
            f"Fragility({self.name!r}: {self.draws} draws, median load factor {self.median:.4g}, "
            f"dispersion {self.dispersion:.3g})"
        )


def fragility(
    results: DataFrame | ArrayLike,
    demand: ArrayLike | None = None,
    *,
    confidence: float = 0.95,
) -> Fragility:
    """A fragility curve from the table of a sweep over random draws.

    Parameters
    ----------
    results : DataFrame or (n,) array
        What :func:`cvxlimit.sweep` returned for :func:`~cvxlimit.studies.draws`; or load factors.
    demand : (k,) or None
        Load factors at which the probability is asked for, as multiples of the weight if the live
        load is an acceleration; None spreads 201 over the range of the results.
    confidence : float
        Of the band, between 0 and 1.

    Raises
    ------
    InputError
        If there are no results, or no load factor among them is finite.
    ModelError
        If the confidence is not between 0 and 1.

    Example
    -------
    >>> from scipy import stats
    >>> from cvxlimit import builtin_scene, fragility, sweep
    >>> from cvxlimit.studies import draws
    >>> drawn = draws({"friction": stats.uniform(0.2, 0.4)}, 20, seed=1)
    >>> curve = fragility(sweep(builtin_scene("single-block"), drawn, progress=False))
    >>> curve.draws, bool(curve.at(0.3)[0] < curve.at(0.39)[0])
    (20, True)
    """
    ratio(confidence, "confidence of the band")
    factors, low, high, name = _results(results)
    known = np.sort(factors[~np.isnan(factors)])
    if not np.isfinite(known).any():
        raise InputError("no result has a finite load factor: there is no curve to draw")
    at = _demands(demand, known[np.isfinite(known)])
    curve = _curve(at, known, np.sort(low), np.sort(high), confidence)
    return Fragility(
        at, *curve, known, len(factors), confidence, name, (np.sort(low), np.sort(high))
    )


def _demands(demand: ArrayLike | None, finite: FloatArray) -> FloatArray:
    if demand is None:
        margin = 0.1 * float(np.ptp(finite)) or 0.1 * float(np.abs(finite).max())
        return np.linspace(max(finite.min() - margin, 0.0), finite.max() + margin, 201)
    given = np.atleast_1d(np.asarray(demand, dtype=float))
    if given.ndim != 1 or not np.isfinite(given).all():
        raise InputError(f"demand must be finite load factors, got {demand!r:.60}")
    return np.sort(given)


def _results(results: Any) -> tuple[FloatArray, FloatArray, FloatArray, str]:
    if not hasattr(results, "columns"):
        factors = np.asarray(results, dtype=float).ravel()
        if not len(factors):
            raise InputError("there are no results to make a curve of")
        unknown = np.isnan(factors)
        low, high = np.where(unknown, -np.inf, factors), np.where(unknown, np.inf, factors)
        return factors, low, high, ""
    missing = {"load_factor", "lower", "upper", "status"} - set(results.columns)
    if missing:
        raise InputError(
            f"results must be the table of a sweep, but lack column {sorted(missing)[0]!r}"
        )
    if not len(results):
        raise InputError("there are no results to make a curve of")
    factors, low, high = (
        results[column].to_numpy(dtype=float, na_value=np.nan, copy=True)
        for column in ("load_factor", "lower", "upper")
    )
    low, high = np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)
    for status, value in (
        (Status.DEAD_LOAD_UNSTABLE, 0.0),
        (Status.LIVE_LOAD_HARMLESS, np.inf),
    ):
        rows = (results["status"] == str(status)).to_numpy(dtype=bool)
        factors[rows] = low[rows] = high[rows] = value
    return factors, low, high, str(results.attrs.get("scene", "")).split(" ")[0]


def _curve(
    demand: FloatArray, known: FloatArray, low: FloatArray, high: FloatArray, confidence: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    probability = np.searchsorted(known, demand, side="left") / len(known)
    n, tail = len(low), 0.5 * (1.0 - confidence)
    surely = np.searchsorted(high, demand, side="left")
    perhaps = np.searchsorted(low, demand, side="left")
    lower = np.where(surely > 0, stats.beta.ppf(tail, surely, n - surely + 1), 0.0)
    upper = np.where(perhaps < n, stats.beta.ppf(1.0 - tail, perhaps + 1, n - perhaps), 1.0)
    return probability, lower, upper
