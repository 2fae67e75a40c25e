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

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from cvxlimit.base.checks import of_type, positive
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.between import configuration_at
from cvxlimit.extensions.paths.checked import CodeCheck, Limit
from cvxlimit.extensions.paths.oscillator import OF_PATH, Oscillator, check_push, oscillators
from cvxlimit.extensions.paths.path import Path
from cvxlimit.scene import METRES, Scene, Units
from cvxlimit.scene.units import G

RECORDS = 7
"""Different records whose mean effect a check by time histories takes, after NTC 2018, 7.3.5."""


def code_check(
    path: Path, confidence_factor: float = 1.35, g: float = G,
    groups: Iterable[Iterable[str]] = (), local_failure: float | None = None, q: float = 2.0,
    motions: Sequence[Any] = (), own_inertia: bool = False,
) -> CodeCheck:  # fmt: skip
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
    # that slides away has no end, any other that does refuses the check.
    runs = [run for run in (path.halved, path) if run is not None]
    sliding = [run for run in runs if run.slides_away]
    refused = sliding[0].headline if sliding else ""
    if path.status == "not-decided" or path.control_stays:
        refused = path.headline
    if path.other_flow is not None:
        runs.append(path.other_flow)
    ends = [] if refused else _ends(path, runs)
    run = ends[0].run if ends else path
    # Limit states: shares of d0, or what fails before, in whichever run that is.
    failures = [(at, what, end) for end in ends for at, what in _failures(end.run, local_failure)]
    limits = list[Limit]()
    for share, period in ((0.4, 1.68), (0.6, 1.56)):
        if not ends:  # refused
            break
        of_d0 = f"{share:g} d0{_interval(path, ends, share * per_control)}"
        reached = (share * ends[0].displacement, of_d0, ends[0])
        at, basis, end = min([reached, *failures], key=lambda each: each[0])
        if end.run is not run:
            basis += f", {end.name}"
        at_limit = configuration_at(end.run, at)
        d, a = float(per_control * at), float(per_factor * at_limit.load_factor)
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
        per_control * run.displacement, per_factor * run.load_factor, run.pieces,
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
    path: Path, runs: Sequence[Path], ends: Sequence[_End], begins: Sequence[Oscillator],
    own_inertia: bool,
) -> tuple[str, ...]:  # fmt: skip
    """What is to say of the path, of the run that is checked, and of the mechanism at rest."""
    run = ends[0].run if ends else path
    notes = [*dict.fromkeys([*run.notes, *path.notes])]  # each once
    if ends and path.slides:
        notes.insert(0, f"on the path {path.headline}")
    if ends and len(runs) > 1:
        checked, lost = f"the check is of the run {ends[0].name}", len(runs) - len(ends)
        if len(ends) > 1:
            checked += f": the least d0 of {len(ends)}"
        if lost:
            checked += "; 1 has no d0" if lost == 1 else f"; {lost} have no d0"
        notes.append(checked)
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
        name = "with half the step"
        if run is path:
            name = "with the whole step"
        elif run is path.other_flow:
            name = "by the other flow rule"
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
    snaps = [(k, "a snap") for _, k in path.pieces[:-1]]
    torn = [(k, what) for k, what in enumerate(path.failed) if what]
    failures = [
        (path.displacement[k - 1], f"{what} costs more than half of it")
        for k, what in [*snaps, *torn]
        if path.load_factor[k - 1] - path.load_factor[k] > half
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
    missing = RECORDS - len(different)
    if missing > 0:
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
