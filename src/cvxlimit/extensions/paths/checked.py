"""What a code says of a local mechanism: the result of :func:`cvxlimit.code_check`."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import attached
from cvxlimit.base.extras import needed
from cvxlimit.extensions.paths.configuration import Configuration
from cvxlimit.extensions.paths.oscillator import Oscillator
from cvxlimit.scene import Units

SOURCE = "after Circolare 7/2019, C8.7.1: a transcription, to be compared with the code in force"


@dataclass(frozen=True)
class Limit:
    """The structure at a limit state: SLV (life safety) or SLC (collapse).

    Attributes
    ----------
    displacement, acceleration : float
        Spectral, on the capacity curve, in the scene's unit of length and in that over s2.
    period : float
        In s, at which the displacement spectrum is read; infinite where no acceleration is left.
    basis : str
        What decides about the displacement.
    configuration : Configuration
        The structure there, with its bracket: on the path, or found between two steps of it; the
        later one of the two where a snap is between them, or iterates do not settle.
    """

    displacement: float
    acceleration: float
    period: float
    basis: str
    configuration: Configuration


@dataclass(frozen=True, eq=False)
class CodeCheck:
    """What a code says of a local mechanism, from its path.

    Lengths are in the scene's unit, accelerations in that over s2, periods in s.

    Attributes
    ----------
    scene_name : str
    units : Units
    confidence_factor, g, q : float
    mechanisms : tuple of Oscillator
        Of the mechanism by which the path begins; where they differ, of that of
        :func:`cvxlimit.solve` as well, and of what only slides if its a0* is the least. The least
        a0* is first, and ``alpha_0``, ``weight`` (of the blocks that move), ``e_star`` (share of
        their mass that takes part) and ``a0_star`` (spectral acceleration that sets it in motion)
        are of this one.
    displacement, acceleration : (steps + 1,) array
        The capacity curve, spectral.
    pieces : tuple of (int, int)
        Rows of the curve, from and to, between which the structure does not jump.
    d0, ends : float, str
        Spectral displacement at which the acceleration is zero, the least of all runs of the path,
        and why it is, with the interval of the runs; NaN where ``refused``.
    slv, slc : Limit or None
        Both limit states; also ``d_SLV``, ``T_SLV``, ``d_SLC``, ``T_SLC``, which are NaN without.
    refused : str
        Of a path whose load factor stays level because joints slide, or that is
        ``"not-decided"``: why it has no displacements to check, and ``a0_star`` alone holds. Empty
        of others.
    histories : (float or None, str) or None
        Mean of the largest displacements in time, and what is to say of it; None if not asked.
    notes : tuple of str
        Those of the path: where joints slide, its load factors depend on the step; and which run
        of it the check is of.

    Example
    -------
    >>> from cvxlimit import builtin_scene, code_check, pushover
    >>> check = code_check(pushover(builtin_scene("single-block")), confidence_factor=1.0)
    >>> round(check.e_star, 6), round(check.d0, 4), round(check.T_SLV, 4)
    (1.0, 0.2, 0.9969)
    """

    scene_name: str
    units: Units
    confidence_factor: float
    g: float
    q: float
    mechanisms: tuple[Oscillator, ...]
    displacement: FloatArray
    acceleration: FloatArray
    pieces: tuple[tuple[int, int], ...]
    d0: float
    ends: str
    slv: Limit | None
    slc: Limit | None
    notes: tuple[str, ...] = ()
    refused: str = ""
    histories: tuple[float | None, str] | None = None

    @property
    def alpha_0(self) -> float:
        """Load factor that sets the mechanism with the least a0* in motion."""
        return self.mechanisms[0].alpha

    @property
    def weight(self) -> float:
        """Of the blocks that move in it."""
        return self.mechanisms[0].weight

    @property
    def e_star(self) -> float:
        """Share of their mass that takes part."""
        return self.mechanisms[0].e_star

    @property
    def a0_star(self) -> float:
        """Spectral acceleration that sets it in motion."""
        return self._a0(self.mechanisms[0])

    def _a0(self, mechanism: Oscillator) -> float:
        return mechanism.share * self.g / self.confidence_factor

    @property
    def d_SLV(self) -> float:  # noqa: N802  # the code's own names
        """Spectral displacement at SLV."""
        return self.slv.displacement if self.slv else float("nan")

    @property
    def d_SLC(self) -> float:  # noqa: N802
        """Spectral displacement at SLC."""
        return self.slc.displacement if self.slc else float("nan")

    @property
    def T_SLV(self) -> float:  # noqa: N802
        """Period at SLV."""
        return self.slv.period if self.slv else float("nan")

    @property
    def T_SLC(self) -> float:  # noqa: N802
        """Period at SLC."""
        return self.slc.period if self.slc else float("nan")

    @property
    def rows(self) -> list[tuple[str, float | None, str, str]]:
        """Symbol, value, unit and meaning of every quantity, as a report lists them; None for those
        that are refused."""
        length, a = self.units.length, f"{self.units.length}/s2"
        rows: list[tuple[str, float | None, str, str]] = [
            ("FC", self.confidence_factor, "", "confidence factor"),
            ("g", self.g, a, "gravity"),
        ]
        for i, each in enumerate(self.mechanisms, 1):
            of = "" if len(self.mechanisms) == 1 else f", {each.of}"
            k = "" if i == 1 else f" ({i})"
            rows += [
                (f"alpha_0{k}", each.alpha, "", f"load factor that sets it in motion{of}"),
                (f"sum P{k}", each.weight, self.units.force, "weight of the blocks that move"),
                (f"e*{k}", each.e_star, "", "(sum P dx)^2 / (sum P sum P dx^2)"),
                (f"a0*{k}", self._a0(each), a, "alpha_0 g / (e* FC)"),
            ]
        rows += [
            ("a SLD", self.a0_star, a, "linear check: most that is allowed at SLD"),
            ("a SLV", self.q * self.a0_star, a, f"linear check: q a SLD, q = {self.q:g}"),
        ]
        if self.histories is not None:
            rows.append(("d, in time", self.histories[0], length, self.histories[1]))
        if self.refused:
            return [*rows, ("d0, d_SLV, T_SLV, d_SLC, T_SLC", None, "", self.refused)]
        rows.append(("d0", self.d0, length, self.ends))
        for name, limit, share in (("SLV", self.slv, 1.68), ("SLC", self.slc, 1.56)):
            if limit is not None:
                period = f"{share} pi sqrt(d_{name} / a(d_{name}))"
                rows += [
                    (f"d_{name}", limit.displacement, length, limit.basis),
                    (f"a(d_{name})", limit.acceleration, a, "of the capacity curve"),
                    (f"T_{name}", limit.period, "s", period),
                ]
        return rows

    def to_dataframe(self) -> Any:
        """The report as a table: ``quantity``, ``value``, ``unit``, ``meaning``.

        Raises
        ------
        ModelError
            If pandas is not installed.
        """
        pandas = needed("pandas", "frames", "tables")
        table = pandas.DataFrame(self.rows, columns=["quantity", "value", "unit", "meaning"])
        table.attrs = {"scene": self.scene_name, "source": SOURCE}
        return table

    @property
    def caveats(self) -> tuple[str, ...]:
        """What whoever uses the numbers has to know, a sentence each."""
        kind = "displacements are spectral, of the equivalent oscillator: not those of the path"
        return (*self.notes, SOURCE) if self.refused else (kind, *self.notes, SOURCE)

    def __str__(self) -> str:
        rows = [
            (name, "none" if value is None else f"{value:.6g} {unit}", said)
            for name, value, unit, said in self.rows
        ]
        wide = [max(len(row[k]) for row in rows) for k in (0, 1)]
        lines = (f"{a:{wide[0]}}  {b:{wide[1]}}  {c}" for a, b, c in rows)
        return "\n".join([f"code check of {self.scene_name!r}", *lines, *self.caveats])

    def plot(self, path: str | os.PathLike[str] | None = None, **options: Any) -> Any:
        """The capacity curve with both limit states; with ``path``, a file.

        ``options`` are ``ax``, ``figsize``, ``title`` and ``legend`` of
        :func:`cvxlimit.plotting.picture`.

        Raises
        ------
        ModelError
            If Matplotlib is not installed.
        """
        return attached("check_plot")(self, path, options)
