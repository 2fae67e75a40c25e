"""What :func:`cvxlimit.pushover` returns: a path, and the configurations on it.

Here are its data and what follows from them: how far joints slide and turn, whether it slides away,
and where it ends. The sentences about it are in ``wording.py``.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import attached
from cvxlimit.extensions.paths.configuration import Configuration, Flow
from cvxlimit.extensions.paths.pairs import CLOSED
from cvxlimit.extensions.paths.supports import loads_of
from cvxlimit.scene import Scene
from cvxlimit.scene.settling import SupportMotion
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import Bracket

Ending = Literal[
    "zero", "falls", "blocked", "steps", "not-converged", "interrupted", "slides", "not-decided"
]

ZERO = 1e-8
"""Load factors below this share of the first are zero: a path ends as near to it as that."""

SLIDING = 1e-3
"""The same where joints slide: the curve depends on the step by more."""

SHOWN = 1e-7
"""Share of the first load factor that seven digits do not show: farther off its bracket a load
factor is seen to lie below it."""

LEVEL = 0.1
"""A path slides away where its load factor stays the same, to ``SLIDING``, for a tenth of the way
while joints slide by more than they turn. What rocks falls by a tenth of its load factor or so on a
tenth of the way; what slides without turning keeps it until a support ends."""


class PathUnits(NamedTuple):
    """Units of w, of the displacement and of the load factor: none, or that of a push."""

    w: str
    displacement: str
    push: str


class Work(NamedTuple):
    """The area under the curve, load factor times the live load's work, and the energy that the
    dead load has taken up on the way, which it equals while joints rock without sliding."""

    area: float
    potential: float

    @property
    def difference(self) -> float:
        """Area less potential, over the larger of both."""
        return (self.area - self.potential) / max(abs(self.area), abs(self.potential), 1e-300)


@dataclass(frozen=True, eq=False)
class Path:
    """Load factor against displacement, configuration by configuration.

    A bracket proves what its configuration carries, not that the structure gets there: where joints
    slide, that may be a little more than the load factor of the path.

    Attributes
    ----------
    initial : Solution or None
        What :func:`cvxlimit.solve` says of the scene as it is given. Its load factor differs from
        the path's first one, since the path has friction at points and not on whole contacts.
        None where the scene starts displaced.
    configurations : tuple of Configuration
        The first at w = 0; also ``path[3]``.
    status : str
        ``"zero"`` where the load factor asked for (0) is reached; ``"falls"`` where no equilibrium
        follows; ``"blocked"`` where nothing can move on; ``"steps"`` where the number of steps ran
        out; ``"slides"`` where joints slide at a level load factor for the contact size, or for a
        tenth of the way until the number of steps ran out; ``"not-converged"``;
        ``"interrupted"``; ``"not-decided"`` where the run with half the step ends otherwise
        (``halved.status``).
    reason : str
        The same in a sentence, with the names of blocks.
    flow : {"associated", "zero-dilatancy"}
        Flow rule by which joints slid in its steps.
    step : float
        Longest step of w.
    snaps : tuple of float
        Where no neighbouring equilibrium exists, and the structure jumps: w before the jump.
    work : Work or None
    slides : bool
        True if joints slid on the way: the curve then depends on the step.
    control : (block id, (3,) direction) or None
        Block whose centroid :attr:`displacement` follows, and along what; None is the mean of the
        live load, w.
    notes : tuple of str
        Sentences on what the path leaves out or assumes, as for joints that slid.
    halved : Path or None
        Of a path that slides, or whose blocks come back from where reactions gave way, with steps
        that the package chose: the same with each step in two.
    until : float
        Load factor that was asked for as its end; where supports move how far they were to, or 0.
    failures : tuple of (float, str)
        Joints that lost their cohesion and ties that broke: w before, and which.
    stretch : float
        Share of its length by which a tie could be stretched.
    other_flow : Path or None
        Of a path with configurations that are followed: the same by the other flow rule.
    motions : tuple of SupportMotion
        Of supports that move, under the dead load alone: w is how far the first of them has moved,
        or turned (radians) without a direction, and the load factor what has to push it there,
        which is less than no force where the structure pushes: see :attr:`reactions`.
    fallen : Configuration or None
        Of such a path the configuration behind its last one at which no forces carry the dead load,
        whatever the reaction, if that is proved.
    given : Scene or None
        Of such a path its scene, with all supports.
    """

    format: ClassVar[str] = "cvxlimit-path"

    initial: Solution | None
    configurations: tuple[Configuration, ...]
    status: Ending
    reason: str
    flow: Flow = "associated"
    step: float = 0.0
    snaps: tuple[float, ...] = ()
    work: Work | None = None
    slides: bool = False
    control: tuple[str, tuple[float, float, float]] | None = None
    notes: tuple[str, ...] = field(default=())
    halved: Path | None = None
    until: float = 0.0
    failures: tuple[tuple[float, str], ...] = ()
    stretch: float = 0.0
    other_flow: Path | None = None
    motions: tuple[SupportMotion, ...] = ()
    fallen: Configuration | None = None
    given: Scene | None = None

    def __len__(self) -> int:
        return len(self.configurations)

    def __getitem__(self, i: int) -> Configuration:
        return self.configurations[i]

    def __iter__(self) -> Iterator[Configuration]:
        return iter(self.configurations)

    def __repr__(self) -> str:
        first, last = self.load_factor[0], self.load_factor[-1]
        d0 = f", d0 {self.interval()}" if self.interval() else ""
        if self.slides_away:
            d0 = ", slides: no d0"
        return (
            f"Path({self.scene.name!r}: {len(self) - 1} steps, load factor {first:.5g} to "
            f"{last:.5g}, {self.ending}{d0})"
        )

    @property
    def scene(self) -> Scene:
        """The scene that the path began with, whose supports may move."""
        return self.given or self.start

    @property
    def start(self) -> Scene:
        """The same as it was followed: supports that move are free blocks, which are pushed."""
        return self.configurations[0].start

    @property
    def units(self) -> PathUnits:
        """Radians and moments where supports turn without a direction."""
        length, force = self.scene.units.length, self.scene.units.force
        is_turn = bool(self.motions) and not any(self.motions[0].direction)
        w, push = ("rad", f"{force} {length}") if is_turn else (length, force)
        return PathUnits(w, w if self.control is None else length, push if self.motions else "")

    @cached_property
    def w(self) -> FloatArray:
        """Mean displacement of the live load (steps + 1,)."""
        return np.array([c.w for c in self.configurations])

    @cached_property
    def load_factor(self) -> FloatArray:
        """(steps + 1,), the first that of the scene as given with friction at points."""
        return np.array([c.load_factor for c in self.configurations])

    @property
    def reactions(self) -> FloatArray:
        """Least and largest reaction along the motion of supports at every configuration, each as
        lower and upper bound (steps + 1, 4): positive where the structure pushes them on. NaN of
        what has no bracket."""
        none = Bracket(np.nan, np.nan)
        both = [(c.bracket or none, c.largest or none) for c in self]
        return np.array([(-one.upper, -one.lower, two.lower, two.upper) for one, two in both])

    @property
    def largest_movement(self) -> tuple[float, float]:
        """How far supports move until the structure falls: the last w that carries the dead load,
        and the first beyond it that is proved not to; infinite where none is."""
        return float(self.w[-1]), float("inf") if self.fallen is None else self.fallen.w

    @cached_property
    def displacement(self) -> FloatArray:
        """Of the control block's centroid along its direction (steps + 1,); w without one."""
        if self.control is None:
            return self.w
        block, direction = self.control
        along = np.asarray(direction, dtype=float)
        along = along / np.linalg.norm(along)
        return np.array([c.displacements[block][:3] @ along for c in self.configurations])

    @property
    def control_stays(self) -> bool:
        """True if the control block does not move along its direction while the structure does:
        displacements are all zero then, and measure nothing."""
        moved, w = (np.abs(way).max(initial=0.0) for way in (self.displacement, self.w))
        return bool(moved < SHOWN * w)

    def openings(self, i: int) -> dict[str, float]:
        """How far joints of the scene have opened at configuration ``i``, at their widest corner
        (length), by name, the widest first; without those that are closed."""
        contacts, pose = self.scene.contacts, self[i].pose
        owner, x = contacts.corner_contact, contacts.corner_points
        a, b = contacts.a[owner], contacts.b[owner]
        n = pose.turned(a, contacts.axes[owner, 2])
        wide = np.zeros(len(contacts))
        np.maximum.at(wide, owner, ((pose.placed(b, x) - pose.placed(a, x)) * n).sum(axis=1))
        near = CLOSED * contacts.typical_size
        order = [j for j in np.argsort(-wide, kind="stable").tolist() if wide[j] > near]
        return {contacts.names[j]: float(wide[j]) for j in order}

    @cached_property
    def in_joints(self) -> tuple[dict[str, tuple[float, float]], ...]:
        """How far joints that bear slide in each step (steps,), and how far they turn across the
        typical contact size, by both blocks' names."""
        size, still, steps = self.scene.contacts.typical_size, np.zeros(6), []
        names = [block.id for block in self.scene.blocks]
        for before, here in pairwise(self.configurations):
            points, n, step = here.points, here.forces[:, 0], dict[str, tuple[float, float]]()
            bears = (n > CLOSED * n.max(initial=0.0)) & ~points.is_bar
            moved = {name: d - before.displacements[name] for name, d in here.displacements.items()}
            for i in np.flatnonzero(bears).tolist():
                one, other = names[points.a[i]], names[points.b[i]]
                joint = f"{one!r}-{other!r}"
                # A joint slides as far as that of its points which slides farthest.
                slip = max(float(np.linalg.norm(points.slip[i])), step.get(joint, (0.0,))[0])
                turn = (moved.get(other, still) - moved.get(one, still))[3:]
                step[joint] = slip, float(np.linalg.norm(turn)) * size
            steps.append(step)
        return tuple(steps)

    @cached_property
    def _moved(self) -> FloatArray:
        """Slip and turn of all joints together, up to where nothing is carried any more
        (steps, 2)."""
        sums = [np.sum([*step.values()], axis=0) if step else (0.0, 0.0) for step in self.in_joints]
        return np.array(sums).reshape(-1, 2)[: self._last]

    @property
    def slip_share(self) -> float:
        """The share of slip in what joints slide and turn up to :attr:`d0` or the end: 0 of what
        only rocks, 1 of what only slides."""
        slip, turn = self._moved.sum(axis=0)
        return float(slip / (slip + turn)) if self.slides and slip > 0.0 else 0.0

    @cached_property
    def slides_away(self) -> bool:
        """True if the load factor stays level because joints slide: such a path has no d0, since it
        ends where what it slides on was drawn to end."""
        return not self.motions and self.level_for(LEVEL * self.w[self._last])

    def level_for(self, way: float) -> bool:
        """Whether the load factor is level for more than ``way`` of w while joints slide by more
        than they turn."""
        low, high = self.level
        return high - low > way

    @cached_property
    def level(self) -> tuple[float, float]:
        """From which w to which the load factor is level for longest while joints slide by more
        than they turn; twice 0 where it never is."""
        w, alpha = self.w[: self._last + 1], self.load_factor[: self._last + 1]
        best = 0.0, 0.0
        if not self.slides or len(w) < 2:
            return best
        slip, turn = self._moved.T
        unit, begin = SLIDING * abs(float(alpha[0])), 0
        # For every end the first row from which on it is level, and joints slide by more than turn.
        for end in range(1, len(w)):
            if not slip[end - 1] > turn[end - 1]:
                begin = end
            while np.ptp(alpha[begin : end + 1]) > unit:
                begin += 1
            if w[end] - w[begin] > best[1] - best[0]:
                best = float(w[begin]), float(w[end])
        return best

    @cached_property
    def sliding_joints(self) -> dict[str, float]:
        """How far joints have slid in all, by both blocks' names, the farthest first; without those
        that have slid less than a tenth as far as that, which sentences have no room for."""
        found: dict[str, float] = {}
        for step in self.in_joints:
            for name, (far, _) in step.items():
                found[name] = found.get(name, 0.0) + far
        order = sorted(found, key=lambda name: -found[name])
        return {name: found[name] for name in order if found[name] > 0.1 * found[order[0]] > 0.0}

    def ends_like(self, other: Path) -> bool:
        """Whether another run ends as this one: both slide away, or carry nothing any more, or stop
        for the same reason; one that falls carries nothing where the other one comes to zero, to a
        tenth of the way: the load factor may drop to zero in the last of its steps."""
        ends = self.displacement[self._last], other.displacement[other._last]
        is_near = abs(ends[1] - ends[0]) <= 0.1 * abs(ends[0])
        one, two = self._kind_of_end, other._kind_of_end
        return one == two or ({one, two} == {"zero", "falls"} and bool(is_near))

    @property
    def _kind_of_end(self) -> str:
        """Whether it slides away, or carries nothing any more, or else its status."""
        if self.slides_away:
            return "slides"
        return "zero" if self.load_factor[self._last] <= self.until + self.zero else self.status

    @property
    def followed(self) -> str:
        """How many configurations are followed and what these lack, in words; empty of none."""
        return attached("path_followed")(self)

    @cached_property
    def change(self) -> float:
        """What half the step changes most of load factors at the same w, over the first one; of the
        reactions of supports that move, over the weight. NaN without :attr:`halved`."""
        half = self.halved
        if half is None:
            return float("nan")
        reached = self.w[self.w <= half.w[-1]]
        change = np.interp(reached, half.w, half.load_factor) - self.load_factor[: len(reached)]
        unit = abs(float(self.load_factor[0]))
        if self.motions:
            unit = self.start.total_weight * loads_of(self.start, self.motions).pace
        return float(change[np.abs(change).argmax()]) / unit

    @property
    def ending(self) -> str:
        """The status in words: of a path that ends at another load factor than zero because that
        was asked for, ``"reached"``."""
        return "reached" if self.status == "zero" and self.until != 0.0 else self.status

    @property
    def varies_by(self) -> str:
        """What ``d0`` depends on where runs differ: the step, and the flow rule of what is
        followed."""
        return "step and flow" if self.followed else "the step"

    @property
    def headline(self) -> str:
        """What the path says in one sentence, and what it does not."""
        return attached("path_headline")(self)

    @property
    def below(self) -> list[bool]:
        """Which configurations (steps + 1,) carry more than the path's load factor: it lies below
        their bracket where joints slide without dilatancy, or blocks are followed. A reaction of
        supports that move lies between the least and the largest, and is none of them."""
        if self.motions:
            return [False] * len(self)
        near = SHOWN * abs(float(self.load_factor[0]))
        lower = [-np.inf if c.bracket is None else c.bracket.lower for c in self]
        return [bool(c.load_factor < end - near) for c, end in zip(self, lower, strict=True)]

    @property
    def zero(self) -> float:
        """Load factor up to which it counts as zero."""
        if self.motions:  # a reaction of any sign
            return -np.inf
        return (SLIDING if self.slides else ZERO) * abs(float(self.load_factor[0]))

    @property
    def _last(self) -> int:
        """Row where the load factor is first zero, or the last one."""
        is_zero = self.load_factor <= self.zero
        return int(is_zero.argmax()) if is_zero.any() else len(self) - 1

    @cached_property
    def d0(self) -> float:
        """Displacement at which the load factor is first zero; NaN where the path ends before, or
        :attr:`slides_away`, or :attr:`control_stays`. On the chord to the last one above zero where
        iterates between them did not settle."""
        if self.slides_away or self.control_stays:
            return float("nan")
        at, jumps = self._last, [start for start, _ in self.pieces]
        if not self.load_factor[at] <= self.zero:
            return float("nan")
        if at in jumps or self.load_factor[at] >= -self.zero:
            return float(self.displacement[at])
        two = [at, at - 1]
        return float(np.interp(0.0, self.load_factor[two], self.displacement[two]))

    @property
    def d0_interval(self) -> tuple[float, float]:
        """The least and the largest ``d0`` with the step, with half of it, and where blocks are
        followed by the other flow rule; NaN where none has one."""
        found = [self.d0, *(run.d0 for run in (self.halved, self.other_flow) if run is not None)]
        return float(np.fmin.reduce(found)), float(np.fmax.reduce(found))

    def interval(self) -> str:
        """Both ends of :attr:`d0_interval`, and what it is over; empty where nothing is followed
        and they are one, and without any."""
        return attached("path_interval")(self)

    @property
    def pieces(self) -> tuple[tuple[int, int], ...]:
        """Rows from and to, exclusive, between which the structure does not jump."""
        ends = [int(np.flatnonzero(self.w == w)[-1]) + 1 for w in self.snaps]
        return tuple(zip([0, *ends], [*ends, len(self)], strict=True))

    @property
    def failed(self) -> list[str]:
        """What has come apart since the row above, for each row: cohesion and ties."""
        after = np.append(np.nan, self.w[:-1])
        return [", ".join(what for at, what in self.failures if at == w) for w in after]

    def with_control(self, control: tuple[str, tuple[float, float, float]] | None) -> Path:
        """The path, and its further runs, with the displacement of another ``control``."""
        runs = [run and replace(run, control=control) for run in (self.halved, self.other_flow)]
        return replace(self, control=control, halved=runs[0], other_flow=runs[1])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the path with its scene to a JSON file, complete or not at all;
        :func:`cvxlimit.io.read_path` reads it, and :func:`cvxlimit.prove` proves it again.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        attached("path_save")(self, path)

    def plot(
        self, kind: str = "curve", path: str | os.PathLike[str] | None = None, **options: Any
    ) -> Any:
        """Draw the path: a figure, a film or a page; with ``path``, a file.

        Parameters
        ----------
        kind : "curve", "film" or "page"
            The load factor over the displacement with the brackets, and snaps as drops; the
            structure in motion; both on a page with a slider over the configurations.
        path : path or None
            ``.png``, ``.svg`` or ``.pdf`` of the curve, ``.gif`` or ``.mp4`` of the film, ``.html``
            of the page.
        options
            ``ax``, ``figsize``, ``title`` and ``legend`` of the curve, see
            :func:`cvxlimit.plotting.picture`; ``viewer`` of the film.

        Raises
        ------
        InputError
            For another kind or suffix.
        ModelError
            If Matplotlib is not installed, which pages do not need.
        """
        return attached("path_plot")(self, kind, path, options)

    def animate(self, path: str | os.PathLike[str] | None = None, **options: Any) -> Any:
        """The film of :meth:`plot`: every configuration as it is, from rest to the end and back."""
        return self.plot("film", path, **options)

    def facts(self) -> Iterator[tuple[str, str]]:
        """What a report says of it, beside its curve."""
        return attached("path_facts")(self)

    def to_dataframe(self) -> Any:
        """One row for each configuration, as a pandas DataFrame."""
        return attached("path_table")(self)


def other_than(flow: Flow) -> Flow:
    """Returns the other flow rule."""
    return "zero-dilatancy" if flow == "associated" else "associated"
