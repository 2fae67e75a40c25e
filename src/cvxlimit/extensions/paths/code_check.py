"""The displacement check of a local mechanism on its path: Circolare 7/2019, C8.7.1.

1. The mechanism by which the path begins becomes an oscillator of one degree of freedom
   (:mod:`.oscillator`), and the path its capacity curve: spectral accelerations
   a = alpha g / (e* FC) over displacements d. Of several mechanisms that with the least a0* leads.
2. d0 is where nothing is carried any more: of all runs of the path, with the step, with half of it,
   by the other flow rule, the least.
3. The limit states SLV and SLC are at 0.4 d0 and 0.6 d0, or where something fails before in any
   of these runs; periods are 1.68 pi sqrt(d / a) and 1.56 pi sqrt(d / a).
4. Motions in time stand beside them, if there are any.

The formulas are a transcription, and have to be compared with the code in force.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import of_type, positive
from cvxlimit.base.doors import attached
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.configuration import Configuration
from cvxlimit.extensions.paths.following import configuration_at
from cvxlimit.extensions.paths.oscillator import OF_PATH, Oscillator, check_push, oscillators
from cvxlimit.extensions.paths.path import Path
from cvxlimit.scene import METRES, Scene, Units
from cvxlimit.scene.units import G

SOURCE = "after Circolare 7/2019, C8.7.1: a transcription, to be compared with the code in force"

RECORDS = 7
"""Different records whose mean effect a check by time histories takes, after NTC 2018, 7.3.5."""


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
        for i, each in enumerate(self.mechanisms):
            of = f", {each.of}" * (len(self.mechanisms) > 1)
            other = f" ({i + 1})" * (i > 0)
            rows += [
                (f"alpha_0{other}", each.alpha, "", f"load factor that sets it in motion{of}"),
                (f"sum P{other}", each.weight, self.units.force, "weight of the blocks that move"),
                (f"e*{other}", each.e_star, "", "(sum P dx)^2 / (sum P sum P dx^2)"),
                (f"a0*{other}", self._a0(each), a, "alpha_0 g / (e* FC)"),
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
        return (*[kind] * (not self.refused), *self.notes, SOURCE)

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


def code_check(
    path: Path,
    confidence_factor: float = 1.35,
    g: float = G,
    groups: Iterable[Iterable[str]] = (),
    local_failure: float | None = None,
    q: float = 2.0,
    motions: Sequence[Any] = (),
    own_inertia: bool = False,
) -> CodeCheck:
    """The displacement check of a local mechanism, after Circolare 7/2019, C8.7.1.

    With the weights P of the blocks that move, their horizontal rates dx in the initial mechanism,
    the load factors alpha of the path and the displacement d_C of its control point:
    e* = (sum P dx)^2 / (sum P sum P dx^2), a = alpha g / (e* FC) and
    d = d_C sum P dx^2 / (dx_C sum P dx). d_SLV is 0.4 d0 and d_SLC 0.6 d0, or where the structure
    fails locally before.

    Parameters
    ----------
    path : Path
        Under a horizontal acceleration, to a load factor of zero; the check is of the one of its
        runs (with half the step, by the other flow rule) that has the least d0. Its control point
        is the code's point C; without one it is the mean displacement of the live load, which is
        that of the centre of mass.
    confidence_factor : float
    g : float
        In m/s2, whatever the scene's unit of length is.
    groups : iterable of iterables of block ids
        Blocks that act as one, such as the courses of a monolith: they count as one weight at their
        common centroid.
    local_failure : float or None
        Displacement of the control point at which something fails before the mechanism does, such
        as a beam that slips off its seat. A snap, a tie that breaks and cohesion that is lost count
        as such failures by themselves if they cost more than half of the largest load factor.
    q : float
        Behaviour factor of the linear check at SLV.
    motions : sequence of Shaking
        What :func:`cvxlimit.shake` made of this scene with the control of the path, under seven
        different records or more: the mean of their largest displacements stands beside that of the
        control point at SLV. With fewer, or where one falls or is not decided, the row says what is
        missing. Whether the records' spectra are those of the site is not checked.
    own_inertia : bool
        False: every block or group is one weight at its centroid, as the code has it. True: dx is
        taken over the whole of each body, whose parts move by different amounts as it turns, so
        that neither courses nor groups change e*.

    Raises
    ------
    InputError
        For a path that ends before the load factor is zero or starts displaced, a live load that is
        no horizontal acceleration, a unit of length that cannot be converted, or groups that do not
        move as one.
    """
    scene = of_type(path, Path, "path must be a Path", "pushover(scene) makes one").scene
    factor, gravity = check_asked(scene, confidence_factor, g)
    # The oscillator: accelerations over load factors, displacements over those of the control.
    one, *others = oscillators(path, groups, own_inertia)
    least = sorted([one, *others], key=lambda each: each.share)
    if least[0].alpha <= 0.0:
        raise InputError(f"there is no a0* to check: {path.reason}")
    per_factor, per_control = one.push * gravity / (one.e_star * factor), one.per_control
    # Where the runs of the path end; the one that ends first is checked. One by the other flow rule
    # that slides away has no end.
    own = [run for run in (path.halved, path) if run is not None]
    refused = next((run.headline for run in own if run.slides_away), "")
    refused = path.headline if path.status == "not-decided" else refused
    runs = [*own, *([path.other_flow] if path.other_flow is not None else [])]
    ends = [] if refused else _ends(path, runs)
    run = ends[0].run if ends else path
    acceleration, displacement = per_factor * run.load_factor, per_control * run.displacement
    # Limit states: shares of d0, or what fails before, in whichever run that is.
    failures = [(at, what, end) for end in ends for at, what in _failures(end.run, local_failure)]
    limits = list[Limit]()
    for share, period in ((0.4, 1.68), (0.6, 1.56)) if ends else ():
        of_d0 = f"{share:g} d0{_interval(path, ends, share * per_control)}"
        reached = (share * ends[0].displacement, of_d0, ends[0])
        at, basis, end = min([reached, *failures], key=lambda each: each[0])
        at_limit = configuration_at(end.run, at)
        d, a = float(per_control * at), float(per_factor * at_limit.load_factor)
        basis += f", {end.name}" * (end.run is not run)
        found = float(replace(end.run, configurations=(at_limit,)).displacement[0])
        if found - at > 1e-6 * ends[0].displacement:
            basis += (
                f"; none is known to rest there: a is that of the next, {per_control * found:.4g}"
            )
        # What moves at any acceleration, as where nothing is left to hold it, has no period.
        t = period * np.pi * np.sqrt(d / a) if a > 0.0 else np.inf
        limits.append(Limit(d, a, float(t), basis, at_limit))
    slv, slc = limits or (None, None)
    return CodeCheck(
        scene.name, scene.units, factor, gravity, positive(q, "q"), tuple(least),
        displacement, acceleration, run.pieces,
        d0=float(per_control * ends[0].displacement) if ends else float("nan"),
        ends=ends[0].why + _interval(path, ends, per_control) if ends else "",
        slv=slv, slc=slc, notes=_notes(path, runs, ends, least, own_inertia), refused=refused,
        histories=_in_time(path, motions, slv.displacement / per_control if slv else np.nan),
    )  # fmt: skip


def check_asked(scene: Scene, confidence_factor: float = 1.35, g: float = G) -> tuple[float, float]:
    """The confidence factor, and gravity in the scene's unit of length over s2, of a scene whose
    path can be checked: what is asked before it is followed.

    Raises
    ------
    InputError
        For a live load that is no horizontal acceleration, a unit of length that cannot be
        converted, and numbers that are not positive.
    """
    check_push(scene)
    return positive(confidence_factor, "confidence factor"), _gravity(g, scene.units)


def _notes(
    path: Path,
    runs: Sequence[Path],
    ends: Sequence[_End],
    begins: Sequence[Oscillator],
    own_inertia: bool,
) -> tuple[str, ...]:
    """What is to say of the path, of the run that is checked, and of the mechanism at rest."""
    run = ends[0].run if ends else path
    notes = [*dict.fromkeys([*run.notes, *path.notes])]
    if ends and path.slides:
        notes.insert(0, f"on the path {path.headline}")
    if ends and len(runs) > 1:
        least = f": the least d0 of {len(ends)}" * (len(ends) > 1)
        lost = len(runs) - len(ends)
        short = f"; {lost} {'has' if lost == 1 else 'have'} no d0" * (lost > 0)
        notes.append(f"the check is of the run {ends[0].name}{least}{short}")
    notes += [run.reason for run in runs if len(run.displacement) < 2]
    if own_inertia:
        notes.append("e* is over the bodies, which turn, and not of weights at their centroids")
    lead, *others = begins
    for other in others:
        what = "another load factor" if lead.is_like(other) else "another mechanism"
        more = f"{other.share / lead.share - 1.0:+.1%} of a0*"
        notes.append(f"a0* is that {lead.of}; {what}, {other.of}, has {more}")
    if lead.of != OF_PATH:
        notes.append("the curve and its displacements are those of the path's own mechanism")
    return tuple(notes)


def _gravity(g: float, units: Units) -> float:
    """Gravity in the scene's unit of length over s2, from m/s2."""
    if units.length not in METRES:
        raise InputError(
            f"the code check needs lengths that can be converted ({', '.join(METRES)}), got unit "
            f"{units.length!r}: scene.in_units converts a scene before it is followed"
        )
    return positive(g, "g") / METRES[units.length]


class _End(NamedTuple):
    """The displacement at which a run carries nothing any more, why, and which run it is."""

    displacement: float
    why: str
    run: Path
    name: str


def _ends(path: Path, runs: Sequence[Path]) -> list[_End]:
    """Ends of the runs of a path that get there, the least displacement first; of those that are
    the same in four digits, as they are told, that of the finer run."""
    ends = list[_End]()
    for run in runs:
        name = "by the other flow rule" if run is path.other_flow else "with half the step"
        name = "with the whole step" if run is path else name
        if len(run.displacement) < 2:  # what carries nothing at rest has no path
            continue
        if np.isfinite(run.d0):
            ends.append(_End(run.d0, "where the acceleration is zero", run, name))
        elif run.status == "falls":
            why = "where no equilibrium follows and it falls"
            ends.append(_End(float(run.displacement[-1]), why, run, name))
    if not ends:
        raise InputError(
            f"the code check needs a path to a load factor of zero, and this one ends at "
            f"{path.load_factor[-1]:.4g} ({path.ending}: {path.reason}): follow it until 0"
        )
    return sorted(ends, key=lambda end: float(f"{end.displacement:.4g}"))


def _interval(path: Path, ends: Sequence[_End], times: float) -> str:
    """The least and the largest of the ends, ``times`` a factor, and what it is over; empty where
    there is one only, and where they are the same and no blocks were followed."""
    if len(ends) == 1:
        return ""
    low, high = (f"{times * end.displacement:.4g}" for end in (ends[0], ends[-1]))
    return f", {low} to {high} by {path.varies_by}" if low != high or path.followed else ""


def _failures(path: Path, given: float | None) -> list[tuple[float, str]]:
    """Displacements of the control point at which something fails, and what: the one ``given``, and
    snaps, ties that break and cohesion that is lost if they cost more than half of the largest load
    factor."""
    half = 0.5 * path.load_factor.max()
    named = [*((k, "a snap") for _, k in path.pieces[:-1]), *enumerate(path.failed)]
    failures = [
        (path.displacement[k - 1], f"{what} costs more than half of it")
        for k, what in named
        if what and path.load_factor[k - 1] - path.load_factor[k] > half
    ]
    if given is not None:
        failures.append((positive(given, "local failure"), "the local failure given"))
    return failures


def _in_time(path: Path, motions: Sequence[Any], allowed: float) -> tuple[float | None, str] | None:
    """Mean of the largest displacements under records, and what is to say of it; ``allowed`` is the
    control point's displacement at SLV."""
    if not motions:
        return None
    for each in motions:
        if getattr(each, "control", None) is None or path.control is None:
            raise InputError(
                "motions and path must have a control point, the same one: give control= to shake "
                "and to pushover"
            )
        if each.scene.name != path.scene.name or each.control != path.control:
            raise InputError(
                f"a motion is of scene {each.scene.name!r} with control {each.control}, and the "
                f"path of {path.scene.name!r} with {path.control}"
            )
    different = {(x.record.times.tobytes(), x.record.acceleration.tobytes()): x for x in motions}
    if (missing := RECORDS - len(different)) > 0:
        return None, f"{len(different)} different records of {RECORDS}: {missing} are missing"
    for said, is_so in (("it falls under", True), ("not decided under", None)):
        names = [x.record.name for x in different.values() if x.falls is is_so]
        if names:
            return None, f"no mean: {said} {len(names)} of {len(different)}, as {names[0]}"
    mean = float(np.mean([abs(x.peak.value) for x in different.values()]))
    within = "no d_SLV of a path to compare with"
    if np.isfinite(allowed):
        within = f"{'within' if mean <= allowed else 'beyond'} {allowed:.4g} of the control at SLV"
    return mean, f"mean of {len(different)} records (spectra not checked), {within}"
