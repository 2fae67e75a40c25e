"""Charts of studies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cvxlimit.plotting.registry import figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CURVE, _MARK = "#134b73", "#c2571a"


def draw_fragility(
    curve: Any, ax: Axes | None = None, reference: float | None = None, **options: Any
) -> Figure:
    """Probability of collapse against load factor, with its band; into ``ax`` or a new figure.

    ``curve`` is a :class:`cvxlimit.studies.Fragility`, ``reference`` a load factor to mark;
    ``figsize``, ``title`` and ``legend`` are those of :func:`picture`.
    """
    chart = figures("chart").Chart.of({"ax": ax, **options}, (6.4, 4.2))
    axes = chart.axes
    band = f"{100 * curve.confidence:g} % confidence"
    axes.fill_between(
        curve.demand, curve.lower, curve.upper, color=_CURVE, alpha=0.18, lw=0, label=band
    )
    axes.plot(
        curve.demand, curve.probability, color=_CURVE, lw=1.8, label=f"{curve.draws} random draws"
    )
    if reference is not None:
        axes.axvline(reference, color=_MARK, lw=1.4, ls="--", label=f"reference {reference:g}")
    axes.set(
        xlabel="load factor demanded",
        ylabel="probability of collapse",
        ylim=(0.0, 1.0),
        xlim=(curve.demand[0], curve.demand[-1]),
    )
    axes.grid(alpha=0.3, lw=0.5)
    chart.write(f"{curve.name}: fragility" if curve.name else "fragility")
    chart.write_legend()
    figure: Figure = chart.figure
    return figure
