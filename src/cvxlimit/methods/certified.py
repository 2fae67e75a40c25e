"""The certified answer with interaction: a bracket proved from below and from above.

The condition of Eq. 30 is not convex, so no single convex problem gives the collapse load factor.
Forces that satisfy it exactly bound the factor from below (:mod:`inner`), a mechanism checked
against the convex hull of every contact's true states bounds it from above (:mod:`hull`), and on
scenes of a few contacts branch and bound closes what is left (:mod:`branching`).
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvxlimit.checks import count, not_negative, ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.analysis import ROUNDING, Clock, Progress, by_block
from cvxlimit.methods.interaction.branching import branch_and_bound
from cvxlimit.methods.interaction.hull import GlobalBound, global_upper_bound
from cvxlimit.methods.interaction.inner import InnerIterate, InnerMethod, InnerSettings
from cvxlimit.methods.interaction.lower_bound import ACCEPTED, LowerBound, LowerBounds
from cvxlimit.model.statics import Scaling
from cvxlimit.scene import Load, Scene
from cvxlimit.solution import Iterate, Solution, Status
from cvxlimit.solvers import OPTIONS, SolverSettings, default_ladder
from cvxlimit.surfaces.cones import Cone, Conic

FloatArray = NDArray[np.float64]

GOOD = 0.05
"""Relative width of the bracket that counts as an answer where no tolerance is asked for."""

_OUTER_TOLERANCE = 1e-4
"""Copies are added to contacts until that could lower the upper bound by no more than this."""

_QUICK = SolverSettings(
    "CLARABEL",
    {**OPTIONS["CLARABEL"], **dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-8)},
    "CLARABEL 1e-08",
)
"""Enough for a bound that is certified anyway, and an eighth faster."""


@dataclass(frozen=True)
class Certified:
    """Settings of the certified method.

    Attributes
    ----------
    tolerance : float or None
        Relative width of the bracket at which to stop. None narrows it as far as the other
        settings allow, and calls a bracket within 5 % certified.
    starts : tuple of {"relaxation", "middle"} or None
        Where the safe steps begin: at the forces of the relaxation from above, or at the middle
        of all contacts. The problem has local optima, so several starts help: with independent
        signs the tuff wall ends at 0.2579 from the relaxation and 0.2610 from the middle, S12 at
        0.12576 and 0.12562. None is both for independent signs, and for signed moments the
        relaxation, which was better on all built-in panels (tuff 0.3628 against 0.3602).
    solves : int
        Convex problems per start, at most.
    branching_contacts : int
        Scenes with no more contacts than this go on to branch and bound.
    branching_seconds : float
        Time for that.

    Example
    -------
    >>> Certified(tolerance=0.01).solves
    24
    """

    tolerance: float | None = None
    starts: tuple[str, ...] | None = None
    solves: int = 24
    branching_contacts: int = 6
    branching_seconds: float = 60.0

    def __post_init__(self) -> None:
        if isinstance(self.starts, str):
            object.__setattr__(self, "starts", (self.starts,))
        known = ("middle", "relaxation")
        if self.starts is not None and not (
            isinstance(self.starts, Sequence)
            and self.starts
            and all(start in known for start in self.starts)
        ):
            raise ModelError(
                f"starts must be 'middle' or 'relaxation', at least one, got {self.starts!r}"
            )
        if self.tolerance is not None:
            ratio(self.tolerance, "tolerance")
        count(self.solves, 1, "solves")
        count(self.branching_contacts, 0, "branching_contacts")
        not_negative(self.branching_seconds, "branching_seconds")


def run_certified(
    scene: Scene,
    cone: Cone,
    moments: str,
    rule: Certified,
    ladder: Sequence[SolverSettings] | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Bracket the load factor with interaction; see the module and :class:`Certified`.

    ``load_factor`` and ``forces`` of the solution are those behind the lower bound, ``mechanism``
    that of the upper one; the history has both bounds as they stood after every solve.

    Raises
    ------
    ModelError
        For faceted surfaces: the bounds are for the true condition, whose cone is circular.
    """
    if not isinstance(cone, Conic):
        raise ModelError(
            f"the certified interaction bounds the true condition, not its {cone}: "
            "use surface 'conic', or the fixed point for facets"
        )
    return _Bracket(scene, moments, rule, ladder, progress or (lambda message: None)).solution()


class _Bracket:
    """The bracket so far, and who holds its two ends."""

    def __init__(
        self,
        scene: Scene,
        moments: str,
        rule: Certified,
        ladder: Sequence[SolverSettings] | None,
        tell: Progress,
    ) -> None:
        self.scene, self.moments, self.rule, self.ladder = scene, moments, rule, ladder
        self.tell = tell
        self.clock = Clock()
        start = time.perf_counter()
        self.contacts = scene.contacts
        self.clock.measure("detect", start)
        self.scaling = Scaling.of(scene)
        self.history: list[Iterate] = []
        self.lower, self.upper = -np.inf, np.inf
        self.load_factor = -np.inf
        self.lower_is_proved = self.upper_is_proved = False
        self.forces: FloatArray | None = None
        self.mechanism: FloatArray | None = None
        self.reason = ""

    def solution(self) -> Solution:
        outer = self._bound_from_above()
        if outer.mechanism is None or outer.upper < 0.0:
            falling = self._dead_load_mechanism()
            if falling is not None:
                self.mechanism = falling
                return self._packed(Status.DEAD_LOAD_UNSTABLE)
        if outer.mechanism is not None:
            self._bound_from_below(outer)
            self._branch()
        elif (forces := self._forces_for_live_load_alone()) is not None:
            self.forces = forces
            return self._packed(Status.LIVE_LOAD_HARMLESS)
        good = self._width() <= (self.rule.tolerance or GOOD) and not self._contradicts()
        return self._packed(Status.CERTIFIED if good else Status.NOT_CERTIFIED)

    def _bound_from_above(self) -> GlobalBound:
        outer = global_upper_bound(
            self.scene, self.moments, self._outer_tolerance(), self._outer_ladder(), self.tell
        )
        for phase in ("compile", "solve", "certify"):
            self.clock.seconds[phase] += outer.seconds[phase]
        for iterate in outer.history:
            self.upper = min(self.upper, np.inf if iterate.upper is None else iterate.upper)
            self._note(iterate)
        self.upper, self.upper_is_proved = outer.upper, outer.is_proved
        self.mechanism = outer.mechanism
        return outer

    def _outer_ladder(self) -> tuple[SolverSettings, ...]:
        """A quick rung and the first regular ones: what they leave is far below the gap."""
        return tuple(self.ladder or (_QUICK, *default_ladder()[:2]))

    def _outer_tolerance(self) -> float:
        """Where a wide bracket is asked for, half of it is left to the safe steps."""
        return max(_OUTER_TOLERANCE, 0.5 * (self.rule.tolerance or 0.0))

    def _bound_from_below(self, outer: GlobalBound) -> None:
        start = time.perf_counter()
        settings = InnerSettings(most=self.rule.solves)
        method = InnerMethod(self.scene, self.moments, settings, self.ladder)
        self.clock.measure("compile", start)
        both = ("relaxation", "middle")
        for name in self.rule.starts or (both if self.moments == "independent" else both[:1]):
            self.reason = "no further progress from these starts"
            at = outer.forces if name == "relaxation" else None
            for iterate in self._timed(method.iterates(at)):
                self._take(iterate, name)
                if self._width() <= (self.rule.tolerance or 0.0):
                    self.reason = "the tolerance is met"
                    return

    def _timed(self, iterates: Iterator[InnerIterate]) -> Iterator[InnerIterate]:
        """Books each iterate's time: compile and solve as reported, the rest as certifying."""
        while True:
            start = time.perf_counter()
            iterate = next(iterates, None)
            if iterate is None:
                return
            outcome = iterate.state.outcome
            self.clock.seconds["compile"] += outcome.compile_seconds
            self.clock.seconds["solve"] += outcome.solve_seconds
            rest = time.perf_counter() - start - outcome.compile_seconds - outcome.solve_seconds
            self.clock.seconds["certify"] += max(rest, 0.0)
            yield iterate

    def _take(self, iterate: InnerIterate, start: str) -> None:
        bound = iterate.bound
        if bound is not None and bound.is_accepted and bound.value > self.lower:
            self._raise(bound)
        self._note(
            Iterate(
                load_factor=iterate.state.load_factor,
                seconds=iterate.state.outcome.compile_seconds + iterate.state.outcome.solve_seconds,
                solver=f"{iterate.solver}, {iterate.kind} step from the {start}",
                status=iterate.state.outcome.status,
                equilibrium_residual=None if bound is None else _known(bound.residual),
                yield_excess=None if bound is None else _known(bound.excess),
            )
        )

    def _raise(self, bound: LowerBound) -> None:
        self.lower, self.load_factor, self.forces = bound.value, bound.load_factor, bound.forces
        self.lower_is_proved = bound.is_proved

    def _branch(self) -> None:
        """Branch and bound on small scenes, where it closes the bracket."""
        asked = self.rule.tolerance or 1e-4
        if len(self.contacts) > self.rule.branching_contacts or self._width() <= asked:
            return
        start = time.perf_counter()
        found = branch_and_bound(
            self.scene, self.moments, asked, seconds=self.rule.branching_seconds, progress=self.tell
        )
        self.clock.measure("solve", start)
        if found.forces is not None:
            bound = LowerBounds(self.scene, self.moments).of(found.forces, found.lower)
            if bound.value > self.lower:
                self._raise(bound)
        if found.upper < self.upper:
            self.upper, self.mechanism = found.upper, found.mechanism
            self.upper_is_proved = found.is_proved
        self.reason = f"branch and bound, {found.solves} problems"
        for iterate in found.history:
            self._note(replace(iterate, solver=f"{iterate.solver}, branch and bound"))

    def _dead_load_mechanism(self) -> FloatArray | None:
        """A mechanism that proves that no true states carry the dead load, or None.

        By homogeneity a load alone is carried as a whole or not at all; taken as live load it has
        a load factor of at most zero, or without bound.
        """
        if not np.any(self.scene.dead_forces):
            return None
        alone = self.scene.with_live(self.scene.dead).with_dead(Load())
        outer = global_upper_bound(alone, self.moments, settings=self._outer_ladder())
        return outer.mechanism if outer.upper < 0.5 else None

    def _forces_for_live_load_alone(self) -> FloatArray | None:
        """Forces (contacts, 6) that carry the live load alone, strictly inside Eq. 30, or None.

        Eq. 30 is homogeneous: with them, every load factor beyond some finite one is carried.
        """
        alone = self.scene.with_dead(self.scene.live)
        return next(iter(LowerBounds(alone, self.moments).reserves), None)

    def _width(self) -> float:
        if not (np.isfinite(self.lower) and np.isfinite(self.upper)):
            return np.inf
        if self.lower > 0.0:
            return (self.upper - self.lower) / max(self.upper, self.lower)
        return (self.upper - self.lower) / self.scaling.unit(self.lower, self.upper)

    def _contradicts(self) -> bool:
        """Lower bound above the upper one by more than rounding."""
        return self._width() < -ROUNDING

    def _note(self, iterate: Iterate) -> None:
        self.history.append(replace(iterate, lower=_known(self.lower), upper=_known(self.upper)))
        low, high = (f"{v:.6f}" if np.isfinite(v) else "?" for v in (self.lower, self.upper))
        self.tell(f"solve {len(self.history)}: load factor in [{low}, {high}]")

    def _packed(self, status: Status) -> Solution:
        has_answer = status.has_answer and self.forces is not None
        return Solution(
            scene=self.scene.name,
            surface="conic",
            interaction="certified",
            moments=self.moments,
            blocks=len(self.scene.free),
            contacts=len(self.contacts),
            load_factor=self._known_factor() if has_answer else None,
            lower=self.lower if status.has_answer else -np.inf,
            upper=self.upper if status.has_answer else np.inf,
            status=status,
            history=tuple(self.history),
            seconds=self.clock.report(),
            forces=self.forces,
            mechanism=by_block(self.scene, self.mechanism),
            note=self._basis() if status.has_answer else status.advice,
        )

    def _known_factor(self) -> float:
        """That of the forces; where bounds are lowered by an estimate it may miss the bracket."""
        return float(np.clip(self.load_factor, self.lower, max(self.lower, self.upper)))

    def _basis(self) -> str:
        if not np.isfinite(self.lower):
            lower = "no forces were found that satisfy Eq. 30"
        elif self.lower_is_proved:
            lower = "lower bound proved: its forces satisfy Eq. 30 to rounding"
        else:
            lower = (
                f"lower bound: its forces satisfy Eq. 30 to {ACCEPTED:.0e} of the total load, and "
                "what that is worth is taken off if no rate exceeds ten times the lightest block's"
            )
        upper = (
            "upper bound proved against the hull of all true states"
            if self.upper_is_proved
            else "upper bound if no contact force exceeds ten times the total load or the largest "
            "one found"
        )
        parts = [lower, upper, self.reason]
        if self._contradicts():
            parts.insert(0, "the bounds contradict each other, so an assumption behind them fails")
        if not self.contacts.is_rectangle.all():
            parts.append("contacts that are not rectangles: lower bound on inscribed rectangles")
        return "; ".join(part for part in parts if part)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
