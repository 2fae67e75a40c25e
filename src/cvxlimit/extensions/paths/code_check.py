"""The displacement check of a local mechanism on its path: Circolare 7/2019, C8.7.1.

The formulas are a transcription, and have to be compared with the code in force.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import first_twice, of_type, positive
from cvxlimit.base.doors import attached
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.configuration import Configuration
from cvxlimit.extensions.paths.following import configuration_at
from cvxlimit.extensions.paths.path import Path
from cvxlimit.geometry.mesh import second_moments
from cvxlimit.scene import METRES, Scene, Units
from cvxlimit.solution.kinematics import VISIBLE, corner_speeds

SOURCE = "after Circolare 7/2019, C8.7.1: a transcription, to be compared with the code in force"

RECORDS = 7
"""Different records whose mean effect a check by time histories takes, after NTC 2018, 7.3.5."""

_OF_DISPLACEMENT = ("d0", "d_SLV", "T_SLV", "d_SLC", "T_SLC")

_LEVEL = 1e-6
"""Share of the live load that may act along gravity: a direction in a scene file has seven digits
or more."""


@dataclass(frozen=True)
class Limit:
    """The structure at a limit state: SLV (life safety) or SLC (collapse).

    Attributes
    ----------
    displacement, acceleration : float
        Spectral, on the capacity curve, in the scene's unit of length and in that over s2.
    period : float
        In s, at which the displacement spectrum is read.
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
    weight : float
        Of the blocks that move in the mechanism.
    e_star : float
        Share of their mass that takes part.
    a0_star : float
        Spectral acceleration that sets the mechanism in motion.
    displacement, acceleration : (steps + 1,) array
        The capacity curve, spectral.
    pieces : tuple of (int, int)
        Rows of the curve, from and to, between which the structure does not jump.
    d0, ends : float, str
        Spectral displacement at which the acceleration is zero, and why it is; NaN where
        ``refused``.
    slv, slc : Limit or None
        Both limit states; also ``d_SLV``, ``T_SLV``, ``d_SLC``, ``T_SLC``, which are NaN without.
    refused : str
        Of a path whose load factor stays level because joints slide: why it has no displacements to
        check, and ``a0_star`` alone holds. Empty of others.
    histories : (float or None, str) or None
        Mean of the largest displacements in time, and what is to say of it; None if not asked.
    notes : tuple of str
        Those of the path: where joints slide, its load factors depend on the step; and which step
        the check is of.

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
    weight: float
    e_star: float
    a0_star: float
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
            ("sum P", self.weight, self.units.force, "weight of the blocks that move"),
            ("e*", self.e_star, "", "(sum P dx)^2 / (sum P sum P dx^2)"),
            ("a0*", self.a0_star, a, "alpha_0 g / (e* FC)"),
            ("a SLD", self.a0_star, a, "linear check: most that is allowed at SLD"),
            ("a SLV", self.q * self.a0_star, a, f"linear check: q a SLD, q = {self.q:g}"),
        ]
        if self.histories is not None:
            rows.append(("d, in time", self.histories[0], length, self.histories[1]))
        if self.refused:
            return [*rows, (", ".join(_OF_DISPLACEMENT), None, "", self.refused)]
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
    g: float = 9.81,
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
        Under a horizontal acceleration, to a load factor of zero; the check is of its run with half
        the step where there is one that got as far. Its control point is the code's
        point C; without one it is the mean displacement of the live load, which is that of the
        centre of mass.
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
    if path.initial is None:
        raise InputError(
            f"the code check is of a mechanism at rest, and the path of {scene.name!r} starts "
            "displaced: follow the structure as it was before"
        )
    factor, metre = positive(confidence_factor, "confidence factor"), METRES.get(scene.units.length)
    if metre is None:
        raise InputError(
            f"the code check needs lengths that can be converted ({', '.join(METRES)}), got unit "
            f"{scene.units.length!r}: scene.in_units converts a scene before it is followed"
        )
    gravity = positive(g, "g") / metre
    along, size = _push(scene)
    weight, rate, spread = _moving(path, along, groups)
    total, first = weight.sum(), weight @ rate
    second = weight @ rate**2 + own_inertia * spread
    over = path.load_factor[0] / (path.initial.load_factor or np.inf) - 1.0
    whole, (path, notes) = path, _finer(path)
    refused = next((x.headline for x in (whole, path) if x.slides_away), "")
    if path.slides and not refused:
        notes = (f"on the path {path.headline}", *notes)
    if own_inertia:
        notes = (*notes, "e* is over the bodies, which turn, and not of weights at their centroids")
    if abs(over) >= 0.0005:  # which shows as 0.1 %
        notes += (f"friction acts at points, which changes a0* by {over:+.1%} against solve's",)
    e_star = first**2 / (total * second)
    spectral = float(second / (_at_control(path, along) * first))  # over the control point's
    times = size * gravity / (e_star * factor)  # acceleration over the load factor
    d0, ends = (np.nan, "") if refused else _end(path)

    def with_interval(what: str, share: float) -> str:
        return ", ".join(filter(None, (what, whole.interval(share * spectral))))

    half = 0.5 * path.load_factor.max()
    named = [*((k, "a snap") for _, k in path.pieces[:-1]), *enumerate(path.failed)]
    failures = [
        (path.displacement[k - 1], f"{what} costs more than half of it")
        for k, what in named
        if what and path.load_factor[k - 1] - path.load_factor[k] > half
    ]
    if local_failure is not None:
        failures.append((positive(local_failure, "local failure"), "the local failure given"))

    def limit(share: float, period: float) -> Limit:
        at, basis = min([(share * d0, with_interval(f"{share:g} d0", share)), *failures])
        found = configuration_at(path, at)
        a, d = times * found.load_factor, spectral * at
        return Limit(float(d), float(a), float(period * np.pi * np.sqrt(d / a)), basis, found)

    slv, slc = (None, None) if refused else (limit(0.4, 1.68), limit(0.6, 1.56))
    return CodeCheck(
        scene.name, scene.units, factor, gravity, positive(q, "q"), float(total), float(e_star),
        float(times * path.load_factor[0]), spectral * path.displacement,
        times * path.load_factor, path.pieces, float(spectral * d0), with_interval(ends, 1.0),
        slv, slc, notes, refused,
        _in_time(path, motions, np.nan if slv is None else float(slv.displacement / spectral)),
    )  # fmt: skip


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


def _finer(path: Path) -> tuple[Path, tuple[str, ...]]:
    """The run with half the step, if it got to its end, and notes that say which it is."""
    if (fine := path.halved) is None:
        return path, path.notes
    if np.isfinite(fine.d0) or fine.status == "falls":
        return fine, (*path.notes, "the check is of the run with half the step")
    return path, (*path.notes, "the check is not of the run with half the step: that ends before")


def _push(scene: Scene) -> tuple[FloatArray, float]:
    """Direction and size of the live load: a horizontal acceleration, in multiples of gravity."""
    live, down = scene.live, scene.dead.gravity
    parts = (live.gravity, live.forces, live.points, live.pressures, live.weights, live.growing)
    push = np.array(live.acceleration or (0.0, 0.0, 0.0))
    size = float(np.linalg.norm(push))
    if any(parts) or down is None or not size > 0.0 or abs(push @ down) > _LEVEL * size:
        raise InputError(
            "the code check is of weights that are pushed sideways: the live load of scene "
            f"{scene.name!r} must be a horizontal acceleration and nothing else, and its dead "
            f"load have a gravity, got {live!r:.80}"
        )
    return push / size, size


def _moving(
    path: Path, along: FloatArray, groups: Iterable[Iterable[str]]
) -> tuple[FloatArray, FloatArray, float]:
    """Weights of blocks and groups that move in the initial mechanism, and their rates; and what
    the sum of weights times squared rates lacks of that over the bodies themselves."""
    scene, found = path.scene, (path.initial and path.initial.mechanism) or {}
    free = [scene.blocks[i] for i in scene.free]
    rates = np.array([found.get(block.id, np.zeros(6)) for block in scene.blocks])
    speed = corner_speeds(scene, rates)[scene.free]
    weight, rates = np.array([block.weight for block in free]), rates[scene.free]
    names = [[*group] for group in groups]
    place = {block.id: i for i, block in enumerate(free)}
    for name in (every := [name for group in names for name in group]):
        if name not in place:
            raise InputError(f"groups name {name!r}, which is no free block of {scene.name!r}")
    if (twice := first_twice(every)) is not None:
        raise InputError(f"block {twice!r} is in two groups: name it once")
    parts = [[place[name] for name in group] for group in names if group]
    for own in parts:
        at = np.array([free[i].centroid - free[own[0]].centroid for i in own])
        lead, turned = rates[own[0]], rates[own, 3:] - rates[own[0], 3:]
        off = np.linalg.norm(rates[own, :3] - lead[:3] - np.cross(lead[3:], at), axis=1)
        off += np.linalg.norm(turned, axis=1) * [free[i].size for i in own]
        if (worst := float(off.max())) > VISIBLE * speed.max():
            raise InputError(
                f"blocks {free[own[0]].id!r} and {free[own[int(off.argmax())]].id!r} of a group do "
                f"not move as one in the initial mechanism: they part by {worst / speed.max():.1%} "
                "of its fastest corner; leave one out"
            )
    parts += [[i] for name, i in place.items() if name not in every]
    parts = [own for own in parts if speed[own].max() > VISIBLE * speed.max()]
    together = np.array([weight[own].sum() for own in parts])
    pushed = np.array([weight[own] @ rates[own, :3] @ along for own in parts])
    # over a body (dx + q . r)^2, q = along x rotation; and its blocks about their group's centroid
    over = 0.0
    for i in (i for own in parts for i in own):
        q, arms = np.cross(along, rates[i, 3:]), free[i].vertices - free[i].centroid
        over += weight[i] / free[i].volume * float(q @ second_moments(arms, free[i].faces) @ q)
        over += weight[i] * float(rates[i, :3] @ along) ** 2
    return together, pushed / together, over - float(pushed @ (pushed / together))


def _at_control(path: Path, along: FloatArray) -> float:
    """Rate of what the path measures as its displacement, in the initial mechanism."""
    scene, found = path.scene, (path.initial and path.initial.mechanism) or {}
    if path.control is None:
        push = [scene.blocks[i].weight * found[scene.blocks[i].id][:3] @ along for i in scene.free]
        return float(sum(push) / scene.total_weight)
    block, direction = path.control
    rate = float(found[block][:3] @ direction / np.linalg.norm(direction))
    if not rate > 0.0:
        raise InputError(
            f"control block {block!r} does not move along {direction} in the initial mechanism: "
            "follow the path with another control"
        )
    return rate


def _end(path: Path) -> tuple[float, str]:
    """Displacement at which nothing is carried any more, and why."""
    if np.isfinite(path.d0):
        return path.d0, "where the acceleration is zero"
    if path.status == "falls":
        return float(path.displacement[-1]), "where no equilibrium follows and it falls"
    raise InputError(
        f"the code check needs a path to a load factor of zero, and this one ends at "
        f"{path.load_factor[-1]:.4g} ({path.status}: {path.reason}): follow it until 0"
    )
