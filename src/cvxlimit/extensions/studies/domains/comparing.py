"""Load domains of one structure under several surfaces: what each costs and where it errs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.domain import WINDOW, LoadDomain
from cvxlimit.extensions.studies.domains.search import load_domain
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Load

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, eq=False)
class DomainComparison:
    """Load domains by surface; the first is what others are measured against.

    Attributes
    ----------
    domains : mapping of str to LoadDomain
    """

    domains: Mapping[str, LoadDomain]

    def to_dataframe(self) -> DataFrame:
        """A row per surface: speed against accuracy in all directions.

        ``seconds``, ``solves``, ``gap``; ``content`` is the mean of the areas (volumes) of hull and
        half-spaces over that of the first surface; ``error`` how far the load factor differs at
        most from that of the first, relative, in the direction ``worst ...``, and lies between
        ``error_lower`` and ``error_upper`` there.

        Raises
        ------
        ModelError
            If pandas is not installed.
        """
        pandas = needed("pandas", "frames", "tables")
        first = next(iter(self.domains.values()))
        rows = []
        for name, domain in self.domains.items():
            error, low, high, direction = _error(domain, first)
            worst = dict(zip((f"worst {n}" for n in first.names), direction, strict=True))
            rows.append(
                {
                    "surface": name, "seconds": domain.seconds, "solves": domain.solves,
                    "gap": domain.gap, "content": _content(domain) / _content(first),
                    "error": error, "error_lower": low, "error_upper": high, **worst,
                }
            )  # fmt: skip
        table: DataFrame = pandas.DataFrame(rows)
        return table

    def plot(self, path: str | None = None, **options: Any) -> Any:
        """All of them, nested; see :meth:`LoadDomain.plot`."""
        from cvxlimit.extensions.studies.domains.pictures import draw_domain

        return draw_domain(list(self.domains.values()), path, **options)

    def __repr__(self) -> str:
        each = (f"{name} {d.seconds:.1f} s" for name, d in self.domains.items())
        return f"DomainComparison({', '.join(each)})"


def compare_domains(
    scene: Scene,
    surfaces: Sequence[Any] = ("conic", "octagon", "octagon-inscribed"),
    loads: Mapping[str, Load] | Sequence[Load] | None = None,
    tolerance: float = 0.01,
    **options: Any,
) -> DomainComparison:
    """The load domain of a structure under each of several surfaces, and how they differ.

    Parameters
    ----------
    scene, loads, tolerance, options
        As for :func:`load_domain`.
    surfaces : sequence
        The first is what others are measured against; ``"exact"`` is the exact friction.

    Raises
    ------
    InputError
        If there is no surface, or one twice.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> found = compare_domains(builtin_scene("single-block"), ("conic", "octagon"), progress=False)
    >>> found.to_dataframe()["error"].round(3).tolist()
    [0.0, 0.0]
    """
    domains: dict[str, LoadDomain] = {}
    for surface in surfaces:
        kind = {"method": "exact"} if surface == "exact" else {"surface": surface}
        domain = load_domain(scene, loads, tolerance, **{**options, **kind})
        name = "exact" if surface == "exact" else domain.surface
        if name in domains:
            raise InputError(f"surface {name!r} is given twice: leave one out")
        domains[name] = domain
    if not domains:
        raise InputError("surfaces must name at least one surface: write ('conic', 'octagon')")
    return DomainComparison(domains)


def _content(domain: LoadDomain) -> float:
    """Mean of what hull and half-spaces hold, in natural units, within the window."""
    inner = domain.inner
    if inner is None or inner.is_flat:
        return float("nan")
    window = np.full(len(domain.units), WINDOW)
    outside = domain.outer.within(-window, window).corners(inner, domain.centre)
    inside = np.clip(inner.points, -window, window)
    try:
        return 0.5 * float(ConvexHull(inside).volume + ConvexHull(outside).volume)
    except QhullError:
        return float("nan")


def _error(domain: LoadDomain, first: LoadDomain) -> tuple[float, float, float, FloatArray]:
    """The largest relative difference, its bounds, and the direction that has it."""
    best = 0.0, 0.0, 0.0, np.zeros(len(domain.units))
    if domain is first:
        return best
    for direction in np.vstack([d.gaps()[0] * d.units for d in (domain, first)]):
        own, other = domain.load_factor(direction), first.load_factor(direction)
        if not (own.has_both and other.has_both and other.lower > 0.0):
            continue
        middle = (own.lower + own.upper) / (other.lower + other.upper) - 1.0
        if abs(middle) > abs(best[0]):
            ends = own.lower / other.upper - 1.0, own.upper / other.lower - 1.0
            unit = direction / np.abs(direction / domain.units).max()
            best = middle, *ends, unit
    return best
