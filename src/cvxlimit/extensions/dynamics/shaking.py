"""A scene shaken by its ground: run in MuJoCo at two steps and two stiffnesses of contacts."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector, of_type, positive
from cvxlimit.base.doors import attached
from cvxlimit.base.extras import needed
from cvxlimit.base.progressbar import LOG, Progress, heard_by
from cvxlimit.errors import InputError, ModelError
from cvxlimit.extensions.dynamics.history import Ending, Motion, TimeHistory
from cvxlimit.extensions.dynamics.mjcf import metres, mjcf
from cvxlimit.extensions.dynamics.record import Record
from cvxlimit.results.movement import checked_control
from cvxlimit.scene import Scene
from cvxlimit.scene.scene import check_scene
from cvxlimit.scene.units import G

STEP = 3e-3
"""The longer step, over the time in which the smallest block falls by half its size (the root of
size over g): about 1 ms for a block of 1 m."""

SOFT = 6.0
"""Longer steps in the time constant of the softer contacts; the stiffer ones have half of it, and
so four times the stiffness. MuJoCo needs two steps at least."""

ROUNDS = 30.0
"""How long blocks may go on moving after the record, in times that a block of the structure's size
needs to fall by half of it."""

OFF = 0.1
"""Share of a block's way to and fro by which its displacement at the end may be off: this is a sum
of slips in both directions, each with an error of its own. On 41 blocks that slide under one sine,
whose way is known, the best run was off by up to 0.056 of it
(``tests/extensions/dynamics/test_shaking.py``)."""


@dataclass(frozen=True)
class Spread:
    """A number in all runs: that of the shortest step and stiffest contacts, and how far the runs
    spread. It does not enclose the truth: all runs may be off to one side."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """The spread of the runs' values, the best run's last."""
        return cls(values[-1], min(values), max(values))

    def __str__(self) -> str:
        return f"{self.value:.4g} (runs spread from {self.low:.4g} to {self.high:.4g})"


@dataclass(frozen=True, eq=False)
class Shaking:
    """What :func:`shake` returns: the same motion in four runs, and how they end.

    Attributes
    ----------
    scene : Scene
    record : Record
    direction : (3,) array
        Unit vector along which the ground accelerates.
    histories : tuple of TimeHistory
        Four: steps long and short, each with soft and stiff contacts; the last one is the best.
    control : (block id, direction) or None
        Whose displacement is told; None: the largest of all blocks at each time.
    """

    scene: Scene
    record: Record
    direction: FloatArray
    histories: tuple[TimeHistory, ...]
    control: tuple[str, tuple[float, ...]] | None = None

    @property
    def ending(self) -> Ending | None:
        """``falls`` or ``stands`` where all runs do; ``moves`` where none falls and one still
        moves; None where some fall and others do not."""
        endings = {each.ending for each in self.histories}
        if "falls" in endings:
            return "falls" if len(endings) == 1 else None
        return "moves" if "moves" in endings else "stands"

    @property
    def falls(self) -> bool | None:
        """Whether it falls; None where runs do not agree, or blocks still move."""
        return self.ending == "falls" if self.ending in ("falls", "stands") else None

    def displacement(self, history: TimeHistory) -> FloatArray:
        """Displacement (k,) of a run over its times, of the control or the largest of all."""
        moved = history.displacements[:, :, :3]
        if self.control is None:
            return np.linalg.norm(moved, axis=2).max(axis=1)
        name, direction = self.control
        row = [self.scene.blocks[i].id for i in self.scene.free].index(name)
        return np.asarray(moved[:, row] @ np.array(direction) / np.linalg.norm(direction))

    @cached_property
    def peak(self) -> Spread:
        """Largest displacement on the way, of its own sign where there is a control."""
        series = [self.displacement(each) for each in self.histories]
        return Spread.of([float(x[np.abs(x).argmax()]) for x in series])

    @cached_property
    def residual(self) -> Spread:
        """Displacement at the end; where blocks fall, at the moment when they count as fallen. It
        may be off by :attr:`residual_off`, however little the runs spread."""
        return Spread.of([float(self.displacement(each)[-1]) for each in self.histories])

    @property
    def residual_off(self) -> float:
        """By how much the displacement at the end may be off: a tenth of the way to and fro."""
        return OFF * float(np.abs(np.diff(self.displacement(self.histories[-1]))).sum())

    @property
    def headline(self) -> str:
        """How it ended and how far it went, in one sentence."""
        unit, count = self.scene.units.length, len(self.histories)
        if self.ending is None:
            every = [each.ending for each in self.histories]
            known = [end for end in ("falls", "stands", "moves") if end in every]
            words = ", ".join(f"{end} in {every.count(end)}" for end in known)
            return (
                f"not decided: of {count} runs, it {words}; peak {self.peak} {unit}: steps and "
                "stiffnesses of contacts decide, so that the record is at the limit"
            )
        if self.ending == "falls":
            times = Spread.of([float(x.times[-1]) for x in self.histories])
            blocks = ", ".join(dict.fromkeys(b for x in self.histories for b in x.fallen))
            return f"falls in all {count} runs, after {times} s, first {blocks}"
        if self.ending == "moves":
            return (
                f"falls in none of {count} runs, and still moves at the end, peak {self.peak} "
                f"{unit}: a longer time after the record tells how it comes to rest"
            )
        return (
            f"stands in all {count} runs: it moved by {self.peak} {unit} at most, and is "
            f"{self.residual.value:.4g} {unit} off in the end, give or take {self.residual_off:.2g}"
        )

    def __repr__(self) -> str:
        return f"Shaking({self.scene.name!r}, {self.record.name!r}: {self.headline})"

    def configuration(self, time: float | None = None) -> dict[str, FloatArray]:
        """Displacements (6,) of the free blocks by id in the best run, at the time nearest to
        ``time`` (s), or at its end."""
        best = self.histories[-1]
        at = -1 if time is None else int(np.abs(best.times - time).argmin())
        ids = [self.scene.blocks[i].id for i in self.scene.free]
        return dict(zip(ids, best.displacements[at], strict=True))

    def plot(
        self, kind: str = "curve", path: str | os.PathLike[str] | None = None, **options: Any
    ) -> Any:
        """Draw it; with ``path``, into a file.

        Parameters
        ----------
        kind : "curve", "film" or "frame"
            Displacement over time with all runs (``.png``, ``.svg``, ``.pdf``); the best run in
            motion, as the ground sees it (``.gif``, ``.mp4``); one moment of it, the end unless
            ``time=`` names another.
        path : path or None
        options
            Those of :func:`cvxlimit.plotting.picture`; ``viewer`` of film and frame.

        Raises
        ------
        InputError
            For another kind or suffix.
        ModelError
            If Matplotlib is not installed.
        """
        return attached("shaking_plot")(self, kind, path, options)

    def animate(self, path: str | os.PathLike[str] | None = None, **options: Any) -> Any:
        """The film of :meth:`plot`."""
        return self.plot("film", path, **options)

    def to_dataframe(self) -> Any:
        """One row for each time of each run, as a pandas DataFrame: step, time constant, time and
        displacement."""
        pandas = needed("pandas", "frames", "tables")
        tables = []
        for each in self.histories:
            columns = {
                "step (s)": each.step,
                "time constant (s)": each.time_constant,
                "time (s)": each.times,
                f"displacement ({self.scene.units.length})": self.displacement(each),
            }
            tables.append(pandas.DataFrame(columns))
        return pandas.concat(tables, ignore_index=True)


def shake(
    scene: Scene,
    record: Record,
    direction: Sequence[float] | None = None,
    *,
    after: float | None = None,
    start: Mapping[str, Sequence[float]] | None = None,
    control: tuple[str, Sequence[float]] | None = None,
    step: float | None = None,
    every: float | None = None,
    g: float = G,
    progress: Progress = None,
) -> Shaking:
    """The motion of a scene whose ground accelerates: does it fall, and how far does it go.

    MuJoCo moves the blocks: rigid, with dry friction, and contacts that are slightly soft and do
    not rebound. Everything is seen from the ground, all of whose points move alike; its
    acceleration is a second gravity, which is exact. All is run at two steps and at two stiffnesses
    of contacts, and the result says how all of them end. Periods and damping of an elastic wall
    are not in it. Nothing here is proved.

    Parameters
    ----------
    scene : Scene
        Its dead load acts; the live load gives the direction only.
    record : Record
        See :func:`pulse` and :func:`read_record`.
    direction : (3,) or None
        Along which the ground accelerates; None: against the live load's acceleration, so that
        blocks are pushed along it first.
    after : float or None
        How long (s) blocks may move after the record; it ends sooner where all are at rest, or one
        has fallen. None: thirty times the root of the structure's size over g.
    start : mapping of block id to (6,) or None
        Displacements with which it starts: translation of the centroid, and rotation vector.
    control : (block id, direction) or None
        Whose displacement is told; None: the largest of all centroids.
    step : float or None
        The longer step (s); the other has half of it. None: 0.003 of the root of the smallest free
        block's size over g.
    every : float or None
        Time (s) between two displacements that are kept; None: twenty of the longer steps.
    g : float
        Acceleration of gravity (m/s2) that makes masses of weights.
    progress : bool, callable or None
        Called with a line of text for every run; True writes it on stderr.

    Raises
    ------
    ModelError
        If MuJoCo is not installed; for units that cannot be converted, and for cohesion, strengths,
        ties, reactions and pressures.
    InputError
        For a bad record, direction, start or control; blocks that are deep in each other; blocks
        with too many notches.
    SolverError
        If a run diverges.

    Example
    -------
    A block that a pulse of 0.4 s pushes along its bed, which should slide by 1.0464 m:

    >>> from cvxlimit import Block, Load, Scene, pulse, shake
    >>> ground = Block.box("ground", (-1, -1, -1), (4, 2, 0))
    >>> block = Block.box("block", (0, 0, 0), (1, 1, 0.2), density=20.0)
    >>> scene = Scene([ground, block], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.3)
    >>> shaking = shake(scene, pulse("rectangle", 0.8, 0.4))  # doctest: +SKIP
    >>> shaking.falls, round(shaking.residual.value, 3)  # doctest: +SKIP
    (False, 1.046)
    """
    # What is asked, in metres and seconds. Times that are not given follow from those in which the
    # smallest free block, and a block as large as all of them together, fall by half their size.
    check_scene(scene)
    of_type(record, Record, "record must be a Record", 'pulse("sine", 0.5, 1.0) makes one')
    about = None if control is None else checked_control(scene, control)
    length, g = metres(scene), positive(g, "g")
    along = _direction(scene, direction)
    free = [scene.blocks[i] for i in scene.free]
    points = length * np.concatenate([block.vertices for block in free])
    span = float(np.linalg.norm(np.ptp(points, axis=0)))
    fall = float(np.sqrt(length * min(block.size for block in free) / g))
    longer = STEP * fall if step is None else positive(step, "step")
    later = ROUNDS * float(np.sqrt(span / g)) if after is None else positive(after, "after")
    until = record.duration + later
    interval = 20 * longer if every is None else positive(every, "every")
    kept = max(1, round(interval / longer))  # of so many of the longer steps one is kept
    # Four runs of one model: long and short steps, each with soft and stiff contacts.
    mujoco, tell = needed("mujoco", "dynamics", "motions in time"), heard_by(progress)
    histories = list[TimeHistory]()
    with _warnings_in_the_log(mujoco):
        model = mujoco.MjModel.from_xml_string(mjcf(scene, g))
        gravity = np.array(model.opt.gravity)
        for parts in (1, 2):
            for soft in (SOFT, 0.5 * SOFT):
                tell(f"run {len(histories) + 1} of 4, step {longer / parts:.2g} s")
                model.opt.timestep, model.opt.gravity[:] = longer / parts, gravity
                for solref in (model.geom_solref, model.pair_solref):
                    solref[:, 0] = soft * longer
                motion = Motion(mujoco, model, scene, length, start)
                histories.append(motion.run(record, along, until, parts * kept, fall, g))
    return Shaking(scene, record, along, tuple(histories), about)


@contextmanager
def _warnings_in_the_log(mujoco: Any) -> Iterator[None]:
    """What MuJoCo warns of goes to the log, and not on the screen and into a file of its own: a run
    that diverges is refused by :class:`Motion`."""
    kept = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: LOG.info("MuJoCo: %s", text))
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(kept)


def _direction(scene: Scene, given: Sequence[float] | None) -> FloatArray:
    """The unit vector (3,) along which the ground accelerates: as given, or against the live load's
    acceleration."""
    if given is None:
        live = scene.live.acceleration
        if live is None or not np.any(live):
            raise ModelError(
                f"the live load of scene {scene.name!r} has no acceleration that gives a "
                "direction: say along which the ground accelerates, as direction=(1, 0, 0)"
            )
        given = [-x for x in live]
    vector = finite_vector(given, 3, "direction of the ground's acceleration")
    size = float(np.linalg.norm(vector))
    if not size > 0.0:
        raise InputError("direction of the ground's acceleration must not be zero")
    return np.asarray(vector / size)
