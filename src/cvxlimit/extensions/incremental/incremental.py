"""From rest to collapse: the load factor that blocks on elastic joints reach.

Joints are elastic until they open or slide, sliding opens none, displacements are small. The dead
load comes first, then the live load grows by its displacement. Forces at rest are unique then, and
so, nearly, is the way: one number, without a bound. The stages are

1. whether the dead load stands, and the proved limit if joints open as they slide (core);
2. the way from rest (:mod:`.ascent`), every state of which is checked here in NumPy;
3. where it ends with other stiffness ratios and half the step, where that is cheap;
4. where it ends with beds that are not true, where ``bedding`` asks for that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import count, not_negative, positive, ratio
from cvxlimit.base.search import processes, searched
from cvxlimit.errors import ModelError
from cvxlimit.extensions.incremental.ascent import ENDLESS, Ascent, Reached
from cvxlimit.extensions.incremental.joints import Joints
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.convex import standing
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.reductions.planar import Plane, find_plane
from cvxlimit.scene import Scene
from cvxlimit.solution import FromRest, Iterate, Status, Step, Trial
from cvxlimit.solution.bracket import rounded

SPREAD = 2_500
"""Points of joints up to which the spread is asked for by default: three more ways, which take a
second or so then."""

RATIOS = (0.1, 1.0)
"""Stiffness ratios of the spread: from rough beds, which give way along themselves, to smooth ones
on soft mortar."""


@dataclass(frozen=True)
class Incremental(Method):
    """The load factor reached from rest, by rigid blocks on elastic joints that slide and open.

    Attributes
    ----------
    ratio : float
        Shear stiffness of joints over their normal stiffness; the size of either matters to no
        load factor. 0.4 is that of two elastic half-spaces of Poisson's ratio 0.2 to 0.3, within
        its roundness; the spread says what others make of it.
    tolerance : float
        What may still be to come where the curve counts as level, over the load factor.
    max_steps : int
        Steps of the live load.
    spread : bool or None
        Whether other ratios and half the step are tried as well; None where that is cheap.
    bedding : float or None
        Typical initial gap of joints (the standard deviation of normal ones) whose beds are not
        true, over the mean elastic shortening under the dead load, or in the scene's length where a
        stiffness is given. None for true beds.
    stiffness : float or None
        Normal stiffness of joints, force per area and length.
    draws : int
        How many times gaps are drawn.
    seed : int
        Of the first draw; the following ones have the following seeds.
    workers : int
        Processes for draws.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> found = solve(builtin_scene("tuff-wall"), method=Incremental(spread=False))
    >>> round(found.load_factor, 5), str(found.status)
    (0.16667, 'reached from rest')
    """

    name = "incremental"
    answers = "from rest to collapse on elastic joints: the load factor reached, no bound"
    axis = "flow"
    surfaces, reduces = ("conic",), False
    takes = ("reactions", "cohesion", "strength")

    ratio: float = 0.4
    tolerance: float = 5e-3
    max_steps: int = 150
    spread: bool | None = None
    bedding: float | None = None
    stiffness: float | None = None
    draws: int = 20
    seed: int = 0
    workers: int = 1

    def __post_init__(self) -> None:
        positive(self.ratio, "ratio")
        ratio(self.tolerance, "tolerance")
        if self.bedding is not None:
            not_negative(self.bedding, "bedding")
        if self.stiffness is not None:
            positive(self.stiffness, "stiffness")
            if self.bedding is None:
                raise ModelError(
                    f"stiffness {self.stiffness:g} does nothing without bedding, whose length it "
                    "is for: leave it out, or give bedding"
                )
        for name, least in (("max_steps", 1), ("draws", 1), ("seed", 0), ("workers", 1)):
            count(getattr(self, name), least, name)

    def steps(self, run: Run) -> Steps:
        _refuse(run)
        search = standing(run, run.model)
        if search is None:
            return Status.DEAD_LOAD_UNSTABLE
        # The proved limit of friction that opens joints, which says how large a step may be.
        yield from search.steps()
        aside, scaling = search.run, run.scaling
        bound = aside.best.bracket
        limit = bound.upper if bound.upper_is_proved and np.isfinite(bound.upper) else None
        run.history += [
            replace(iterate, solver=f"{iterate.solver}, associated friction", lower=None)
            for iterate in aside.history
        ]
        scale = limit if limit is not None and limit > 0.0 else scaling.ratio
        plane = None
        if run.model != "full":
            plane = find_plane(run.assemblage.statics, run.surfaces)
            run.reductions = ("planar",) if plane is not None else ()
        ways = Ways(self, run.given, plane, scale, ENDLESS * scaling.ratio)
        # The way itself; whatever has been reached is kept if it is interrupted.
        ascent, told = ways.ascent(), _Told(run, ways.joints, limit)
        for state in ascent.run():
            told.add(state)
            run.tell(f"step {len(ascent.curve) - 1}: load factor {rounded(state.place.alpha, 5)}")
            yield
        status = told.finish(ascent, self.tolerance)
        yield
        if status is not Status.REACHED:
            return status
        is_cheap = ways.joints.share.size <= SPREAD
        for what, changed in self._others() if self.spread or is_cheap else ():
            if self.spread is not False:
                told.others.append(ways.trial(what, **changed))
                told.report()
                yield
        if self.spread is None and not is_cheap:
            run.remarks.append(
                f"other ratios and half the step were left out for the size: {_SPREAD_TOLD}"
            )
        yield from self._drawn(run, ways, told)
        told.report()
        return status

    def _others(self) -> Iterator[tuple[str, dict[str, float]]]:
        for other in RATIOS:
            if other != self.ratio:
                yield f"ratio {other:g}", {"ratio": other}
        yield "half the step", {"share": 0.5 * Ascent.share}

    def _drawn(self, run: Run, ways: Ways, told: _Told) -> Steps:
        """Adds ways with beds that are not true, each from a seed of its own."""
        if self.bedding is None:
            return Status.REACHED
        told.bedding = self.bedding
        seeds = iter(range(self.seed, self.seed + self.draws))
        with processes(self.workers) as pool:
            for seed, trial in searched(ways, lambda: next(seeds, None), pool):
                told.drawn[seed] = trial
                run.tell(f"bedding: draw {len(told.drawn)} of {self.draws}, {trial.end}")
                told.report()
                yield
        return Status.REACHED


_SPREAD_TOLD = "spread=True (--spread) asks for them"


def _refuse(run: Run) -> None:
    """Refuses what elastic joints are not stated for here, and says why."""
    if found := run.contacts.first_of("tensile_strength", "least"):
        raise ModelError(
            "method 'incremental' knows no mortar that bears tension, which breaks at once, and no "
            f"reactions that push at least so much, got {found}: leave tensile_strength out, and "
            "give the least of a reaction as a point load"
        )


class Ways:
    """Ways from rest of one scene, which other processes may be sent: called with a seed, it draws
    gaps and goes one."""

    def __init__(
        self, rule: Incremental, scene: Scene, plane: Plane | None, scale: float, endless: float
    ) -> None:
        self.rule, self.scene, self.plane = rule, scene, plane
        self.scale, self.endless = scale, endless
        self.joints = Joints(scene, plane, rule.ratio)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "joints"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.joints = Joints(self.scene, self.plane, self.rule.ratio)

    def ascent(
        self, ratio: float | None = None, share: float = Ascent.share,
        gaps: FloatArray | None = None,
    ) -> Ascent:  # fmt: skip
        joints = self.joints if ratio is None else Joints(self.scene, self.plane, ratio)
        most = round(self.rule.max_steps * Ascent.share / share)
        return Ascent(
            joints, self.scale, self.endless, share, self.rule.tolerance, most, gaps
        )  # fmt: skip

    def trial(self, what: str, **changed: Any) -> Trial:
        """Goes a way, and says where it ended."""
        ascent = self.ascent(**changed)
        for _ in ascent.run():
            pass
        has_end = ascent.end == "plateau"
        factor = ascent.top.place.alpha if has_end else None
        return Trial(what, factor, "level" if has_end else ENDS[ascent.end])

    def __call__(self, seed: int) -> Trial:
        rule, joints = self.rule, self.joints
        unit = float(np.abs(joints.dead_forces).sum() / joints.kn.sum())
        if rule.stiffness is not None:  # the scene's length, in what a mean joint gives
            unit = rule.stiffness * joints.mean_area / joints.force
        normal = np.random.default_rng(seed).standard_normal(joints.number)
        return self.trial(f"seed {seed}", gaps=(rule.bedding or 0.0) * unit * normal)


ENDS = {
    "rest": "no state at rest found",
    "lost": "no state further on found",
    "steps": "still rising at the last step",
    "endless": "without limit",
}
"""Ends without a number, in words that can be counted."""


class _Told:
    """What is told of a way so far, in the answer of its run."""

    def __init__(self, run: Run, joints: Joints, limit: float | None) -> None:
        self.run, self.joints, self.limit = run, joints, limit
        self.reached: list[Reached] = []
        self.checked: list[Step] = []
        self.others: list[Trial] = []
        self.drawn: dict[int, Trial] = {}
        self.bedding: float | None = None
        self.end = "under way"
        self.to_come: float | None = None
        self.memory = joints.untouched()
        self.compliance = 1.0
        self.first = np.full((2, joints.number), np.nan)

    def add(self, reached: Reached) -> None:
        """Checks a state, and makes it the answer if it carries most."""
        place = reached.place
        self.reached.append(reached)
        self.checked.append(self._step(reached))
        self.memory = self.joints.after(place.state, place.memory)
        figures = self.checked[-1]
        self.run.history.append(
            Iterate(
                place.alpha,
                0.0,
                "elastic joints",
                "balanced",
                equilibrium_residual=figures.equilibrium,
                yield_excess=figures.yield_excess,
            )
        )
        self.report()

    def _step(self, reached: Reached) -> Step:
        """Keeps which joints have begun to slide and open, and returns what NumPy says of a state:
        forces against loads, shear against friction, slip against shear."""
        joints, run, place = self.joints, self.run, reached.place
        state, forces = place.state, joints.forces(place.state)
        statics, length = run.assemblage.statics, run.scaling.length
        rest = statics.residual(forces, place.alpha)
        acting = statics.acting(forces, place.alpha, length)
        lacking = np.abs(rest[:, :3]).max(axis=1) + np.abs(rest[:, 3:]).max(axis=1) / length
        shear = np.sqrt((state.T**2).sum(axis=1))
        excess = shear - joints.limit(state.N, place.memory)
        begun = np.stack([
            (state.slides & (shear > 0.0)).any(axis=1),
            ((state.gap > 0.0) & (joints.share > 0.0)).any(axis=1),
        ])  # fmt: skip
        self.first[np.isnan(self.first) & begun] = place.alpha
        slip = joints.after(state, place.memory).slipped - place.memory.slipped
        size = np.sqrt((slip**2).sum(axis=1))
        spent, most = -(slip * state.T).sum(), (size * shear).sum()
        return Step(
            displacement=reached.w,
            load_factor=place.alpha,
            sliding=int(begun[0].sum()),
            open=int(begun[1].sum()),
            equilibrium=float((lacking / np.maximum(acting, 1e-300)).max()),
            yield_excess=max(float(excess.max()), 0.0) / max(float(np.abs(state.N).sum()), 1e-300),
            against=float((most - spent) / most) if most > 0.0 else 0.0,
            forces=forces,
        )

    def finish(self, ascent: Ascent, tolerance: float) -> Status:
        """Says how the way ended, and returns the status."""
        self.compliance, self.to_come = ascent.slope, ascent.to_come
        if ascent.end == "rest":
            self.run.remarks = [
                "no state under the dead load alone was found in which joints slide without "
                "opening, though with opening ones it stands"
            ]
            return Status.NOT_REACHED
        if ascent.end == "endless":
            self.report()
            return Status.ENDLESS
        top, last = ascent.top.place.alpha, ascent.curve[-1].place.alpha
        self.end = ENDS.get(ascent.end, "level")
        if ascent.end == "plateau" and last < top - tolerance * abs(top):
            self.end = f"the curve falls, to {rounded(last, 4)} at its end"
        elif self.to_come is not None and self.to_come > top:
            more = 100.0 * (self.to_come - top) / abs(top)
            if more >= 0.01:
                self.end += f"; about {more:.1g} % may be to come, if compressions stay as they are"
        self.report()
        return Status.REACHED if ascent.end == "plateau" else Status.NOT_REACHED

    def report(self) -> None:
        """Writes the answer as it is now."""
        top = max(self.reached, key=lambda each: each.place.alpha)
        last, mechanism = self.reached[-1], None
        if float(self.joints.live @ (last.place.d - last.before)) > 0.0:
            mechanism = self.joints.rates(last.place.d - last.before)
        per = self.compliance * abs(top.place.alpha)
        steps = tuple(
            replace(step, displacement=step.displacement / per if per > 0.0 else 0.0)
            for step in self.checked
        )
        way = FromRest(
            self.end, self.to_come, self.limit, steps, tuple(self.others), self.bedding,
            tuple(self.drawn[seed] for seed in sorted(self.drawn)), *self.first,
        )  # fmt: skip
        forces = self.checked[self.reached.index(top)].forces
        self.run.best = Answer(
            max(top.place.alpha, 0.0), forces=forces, mechanism=mechanism, from_rest=way
        )
