"""One question to a structure: how far do loads reach in a direction? Answered with proof.

A solver maximises d @ p over load factors p and contact forces within all surfaces that balance the
dead load and p times the live loads. Nothing of its answer is believed (:class:`Raw`):

- its forces are put into equilibrium, and mixed with those of a state strictly inside until they
  are within all surfaces: that makes a *point* p which is carried;
- its mechanism u is opened until the flow rule allows it. No loads can do more power on it than
  contacts dissipate: p @ (live @ u) <= dissipation(u) - dead @ u is a *half-space* that holds all;
- forces that carry p without the dead load, within the surfaces' cones of recession, make a *ray*:
  any multiple of it is carried besides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from cvxlimit.base.arrays import EPSILON, ROUNDING, SMALL, FloatArray
from cvxlimit.extensions.studies.domains.images import LoadMirror, Raw, load_mirrors
from cvxlimit.extensions.studies.domains.polytopes import FLAT
from cvxlimit.extensions.studies.domains.reach import Reach
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.aside import SOLVERS_ASIDE
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.driver import BOUNDLESS, Run, packed
from cvxlimit.model.assemblage import Reduction
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import LargestFactor, largest_self_stress
from cvxlimit.model.statics import DOF, Scaling
from cvxlimit.proof.admissible import carried_exactly
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.strength import Strength
from cvxlimit.proving.again import evidence_of
from cvxlimit.reductions.choice import Reductions
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Load, combined
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import REFERENCE, Bracket
from cvxlimit.surfaces.coulomb import needed_surfaces

_MIXED = (1.0, 0.7548776662466927, 0.5698402909980532)
"""Shares in which loads stand together for all where symmetry is asked for: 1, 1 / p and 1 / p^2 of
the plastic number p (p^3 = p + 1), so that no two of their sums are equal by chance."""


@dataclass(frozen=True, eq=False)
class Support:
    """The result of one direction: loads that are carried, and a half-space that holds all.

    Attributes
    ----------
    direction : (k,)
        In which the loads were made as large as they can be.
    point : (k,) or None
        Load factors that are carried beside the dead load; None if there was nothing to show it.
    ray : (k,) or None
        Load factors of which any multiple is carried besides, whatever else is.
    normal : (k,), offset : float
        All load factors p that are carried have normal @ p <= offset; zero and infinite where no
        mechanism shows it.
    point_is_proved, half_space_is_proved : bool
        True if they need no assumption, up to rounding.
    is_mirrored : bool
        True for the mirror image of another, which was checked anew but not solved for.
    loaded : (k,)
        Load factors that make the live load of ``solution``.
    solution : Solution or None
        With the forces and the mechanism.
    rates : (free blocks, 6) or None
        The mechanism behind the half-space, where ``solution`` has none: beside a ray, or where its
        live load does no power on it.
    """

    direction: FloatArray
    point: FloatArray | None
    ray: FloatArray | None
    normal: FloatArray
    offset: float
    point_is_proved: bool = False
    half_space_is_proved: bool = False
    is_mirrored: bool = False
    loaded: FloatArray | None = None
    solution: Solution | None = field(default=None, repr=False)
    rates: FloatArray | None = field(default=None, repr=False)


class Structure:
    """A scene under several live loads, of which it is asked how far they reach.

    Load factors are multiples of ``units`` in here: the dead load over each live load.

    Parameters
    ----------
    scene : Scene
    loads : sequence of Load
    surface, ladder, model
        As for :func:`cvxlimit.solve`.
    tolerance : float
        Relative gap that is asked for.
    """

    def __init__(
        self, scene: Scene, loads: Sequence[Load], surface: Any, ladder: Any, model: Any,
        tolerance: float,
    ) -> None:  # fmt: skip
        self.loads, self.tolerance = tuple(loads), max(1e-5, 0.01 * tolerance)
        scene = scene.with_live(combined(loads, np.array(_MIXED[: len(loads)])))
        self.run = Run(scene, surface, ladder=ladder, model=model)
        self.surfaces = needed_surfaces(self.run.surfaces)
        free = [self.run.scene.blocks[i] for i in self.run.scene.free]
        forces = np.stack([load.on(free).ravel() for load in loads], axis=1)
        whole, length = self.run.assemblage, self.run.scaling.length
        self.dead = whole.statics.dead
        scalings = [
            Scaling.under(length, self.dead.reshape(-1, DOF), f.reshape(-1, DOF)) for f in forces.T
        ]
        self.units = np.array([each.ratio for each in scalings])
        self.forces = forces * self.units
        mixed = self.forces @ np.array(_MIXED[: len(loads)])
        found = Reductions.of(
            whole.under(self.dead, mixed), self.surfaces, self.run.formulation, model
        )
        self.assemblage, self.reduction = found.assemblage, found.best()
        self.run.reductions = self.reduction.names
        self.certifier = Certifier(self.assemblage, self.surfaces, self.run.formulation)
        self.centre = np.zeros(len(loads))
        sizes, ways = np.linalg.svd(self.forces, full_matrices=False)[1:]
        self.idle = ways[sizes <= 1e-12 * sizes.max()]  # sums of loads of which rounding is left
        self._has_reference: bool | None = None  # not known yet
        self._field_was_sought = False
        self._problems: dict[float | None, tuple[Reach, LimitProgram]] = {}
        self._proved: WeakKeyDictionary[Raw, Support] = WeakKeyDictionary()

    def acting(self, direction: FloatArray) -> FloatArray:
        """Returns the direction without sums of loads that are no load at all."""
        return direction - self.idle.T @ (self.idle @ direction)

    # What solvers say

    def raw(self, direction: FloatArray, window: float, dead: float | None = 1.0) -> Iterator[Raw]:
        """Answers of one solver after another."""
        reach, problem = self._problem(dead)
        reach.weights.value, reach.window.value = direction, window
        ladder = self.run.ladder or problem.ladder(self.tolerance)
        for settings in ladder[:SOLVERS_ASIDE]:
            state = self.run.solve(problem.run, settings)
            self.run.note(replace(state, load_factor=None), settings)
            given = self.certifier.given(state)
            if state.forces is None or given is None or not state.own:
                if state.outcome.claims_no_optimum:
                    return
                continue
            yield Raw(
                direction, self.acting(state.own["factors"]), state.forces, given,
                state.mechanism, dead == 0.0, self.run.history[-1],
            )  # fmt: skip

    def answers(
        self, direction: FloatArray, window: float, along_rays: float = -np.inf
    ) -> list[Raw]:
        """What there is to say about a direction: as a rule one answer, which is tight.

        Where the window stops loads, it is asked whether any multiple is carried, and asked first
        where rays are known that go ``along_rays`` in this direction: one that goes farther is
        enough. Where nothing is carried, the answer has the mechanism that shows it.
        """
        if along_rays > -FLAT:
            rays = list(islice(self.raw(direction, 1.0, 0.0), 1))
            if any(raw.factors @ direction > along_rays + FLAT for raw in rays):
                return rays
        found: list[Raw] = []
        for raw in self.raw(direction, window):
            found = [raw]
            if self._is_tight(raw):
                break
        if not found:
            return list(islice(self.raw(direction, BOUNDLESS, None), 1))
        if np.abs(found[0].factors).max() < (1.0 - SMALL) * window:
            return found
        rays = list(islice(self.raw(direction, 1.0, 0.0), 1))
        if window < BOUNDLESS and not any(raw.factors @ direction > FLAT for raw in rays):
            return [*rays, *self.answers(direction, BOUNDLESS)]
        return [*rays, *found]

    def _is_tight(self, raw: Raw) -> bool:
        if not self.seek_reference() and not self.centre.any():
            return raw.iterate.status == "optimal"
        made = self.proved(raw)
        if made.point is None:
            return False
        room = made.offset - float(made.normal @ made.point)
        return room <= self.tolerance * max(abs(made.offset), SMALL * self._size(made.normal))

    def _size(self, normal: FloatArray) -> float:
        return float(np.linalg.norm(normal * self.units))

    def _problem(self, dead: float | None) -> tuple[Reach, LimitProgram]:
        if dead not in self._problems:
            reach = Reach(self.forces, dead)
            surfaces, formulation = self.surfaces, self.run.formulation
            reduction: Reduction | None = self.reduction
            if dead == 0.0:
                surfaces, formulation = self.certifier.strength.recession()
                reduction = reduction if formulation is self.run.formulation else None
            problem = LimitProgram(
                self.assemblage, surfaces, formulation=formulation, reduction=reduction, goal=reach
            )
            self._problems[dead] = reach, problem
        return self._problems[dead]

    def said(self, s: Support) -> Raw | None:
        """Returns what a solver may have said that made a support, of which nothing is believed;
        None if there are no forces of these contacts."""
        solution, run = s.solution, self.run
        if solution is None or solution.forces is None or s.loaded is None:
            return None
        if solution.forces.shape != (len(run.contacts), 6):
            return None
        by = evidence_of(solution, run)
        given = forces = np.array(by.forces)
        rates = by.rates
        is_lost = rates is None and solution.mechanism is not None
        rates = s.rates if solution.mechanism is None else rates
        if is_lost or (rates is not None and len(rates) != len(run.given.free)):
            return None
        if self.certifier.strength.is_internal:
            if solution.internal is None:
                return None
            given = solution.internal
        about = s.loaded / self.units
        factors = about * (solution.load_factor or 0.0)
        if s.ray is not None:  # a ray has no load factor: as much as its forces carry
            load = self.forces @ about
            taken = self.assemblage.statics.matrix @ forces.ravel()
            factors = about * max(-float(taken @ load) / float(load @ load), 0.0)
        return Raw(s.direction / self.units, factors, forces, given, rates, s.ray is not None,
                   solution.history[-1], s.is_mirrored)  # fmt: skip

    # What is proved of it

    def seek_reference(self) -> bool:
        """Returns whether a state strictly inside is known that carries the dead load alone. Where
        none is, the first call lets solvers seek one, and the certifier keeps what they find."""
        if self._has_reference is None:
            is_known = self.certifier.references.easy_dead_state is not None
            self._has_reference = is_known or (bool(self.dead.any()) and self._find_reference())
        return self._has_reference

    def _find_reference(self) -> bool:
        """Gives the certifier a state that carries the dead load alone, if a solver finds some."""
        formulation = self.run.formulation
        problem = LimitProgram(
            self.assemblage.alone(self.dead), self.surfaces, formulation=formulation,
            reduction=self.reduction, goal=LargestFactor(most=1.0),
        )  # fmt: skip
        for settings in (self.run.ladder or problem.ladder())[:2]:
            state = self.run.solve(problem.run, settings)
            given = self.certifier.given(state)
            share = state.load_factor or 0.0
            is_carried = given is not None and share > 0.5
            if is_carried and self.certifier.offer_dead_state(np.asarray(given) / share):
                return True
        return False

    def refer_to(self, answers: Sequence[Raw]) -> bool:
        """Take the mean of answers as the reference if nothing is known to carry the dead load
        alone; true if that changes what is proved."""
        if self.seek_reference() or not answers:
            return False
        centre = np.mean([raw.factors for raw in answers], axis=0)
        moved = self.assemblage.under(self.dead + self.forces @ centre, self.certifier.statics.live)
        certifier = Certifier(moved, self.surfaces, self.run.formulation)
        if not certifier.offer_dead_state(np.mean([raw.given for raw in answers], axis=0)):
            return False
        self.certifier, self.centre = certifier, centre
        self._proved.clear()
        return True

    def proved(self, raw: Raw) -> Support:
        """What holds whatever the solver meant."""
        if raw not in self._proved:
            self._proved[raw] = self._checked(raw)
        return self._proved[raw]

    def _checked(self, raw: Raw) -> Support:
        point, point_is_proved, ray = None, False, None
        if raw.is_ray:
            ray = self._ray(raw)
        else:
            point, point_is_proved = self._point(raw)
        normal, offset, half_space_is_proved = self.half_space(raw)
        # The same as a bracket of the load that these factors make.
        size = float(np.abs(raw.factors).max())
        loaded = raw.factors / size if size > FLAT else raw.direction / np.abs(raw.direction).max()
        lower, push = -np.inf, float(normal @ loaded)
        if point is not None:
            lower = float(point @ loaded) / float(loaded @ loaded)
        upper = offset / push if push > ROUNDING else np.inf
        bracket = Bracket(lower, upper, point_is_proved, half_space_is_proved, least=FLAT)
        factor = size if size > FLAT else 0.0
        solution = self._solution(raw, loaded, factor, None if ray is not None else bracket)
        lacks_rates = solution.mechanism is None and np.isfinite(offset)
        return Support(
            direction=raw.direction * self.units,
            point=None if point is None else point * self.units,
            ray=None if ray is None else ray * self.units,
            normal=normal / self.units,
            offset=offset,
            point_is_proved=point_is_proved,
            half_space_is_proved=half_space_is_proved,
            is_mirrored=raw.is_mirrored,
            loaded=loaded * self.units,
            solution=solution,
            rates=raw.mechanism if lacks_rates else None,
        )

    def _towards(self, step: FloatArray) -> Certifier:
        """The certifier for a live load of these factors; reference states are kept."""
        result = copy(self.certifier)
        statics = result.statics
        result.assemblage = result.assemblage.under(statics.dead, self.forces @ step)
        result.statics = result.assemblage.statics
        return result

    def _point(self, raw: Raw) -> tuple[FloatArray | None, bool]:
        step = raw.factors - self.centre
        if not np.abs(self.forces @ step).max() > 0.0:
            return None, False
        is_needed = self.certifier.references.dead_state is None  # for the size of rates
        found = self._towards(step).certificate(
            raw.given, 1.0, raw.mechanism if is_needed else None
        )
        if not found.lower > 0.0:
            return None, False
        return self.centre + min(found.lower, 1.0) * step, found.lower_is_proved

    def _ray(self, raw: Raw) -> FloatArray | None:
        load = self.forces @ raw.factors
        surfaces, formulation = self.certifier.strength.recession()
        strength = Strength(self.assemblage.under(load, load), surfaces, formulation)
        exact = carried_exactly(strength, raw.given)
        return None if exact is None else raw.factors / np.abs(raw.factors).max()

    def half_space(self, raw: Raw) -> tuple[FloatArray, float, bool]:
        """What a mechanism proves: loads do no more power on it than contacts can take up.

        Where contacts lack opening that no field of rates can give them, the power of forces no
        larger than a reference is added, and that is an assumption.
        """
        none = np.zeros(len(self.units)), np.inf, False
        certifier = self.certifier
        if raw.mechanism is None or not np.isfinite(raw.mechanism).all():
            return none
        if not self._field_was_sought and certifier.references.opening_field is None:
            self._seek_field()
        opened = certifier.opened(raw.mechanism)
        motion, speed = opened.rates.ravel(), np.abs(opened.rates).ravel()
        normal = self.forces.T @ motion
        offset = opened.dissipation - float(self.dead @ motion)
        # The powers below are rounded as the sum of their sizes is.
        size = float(np.abs(self.dead) @ speed) + abs(opened.dissipation)
        size += float((np.abs(self.forces).T @ speed) @ np.maximum(np.abs(raw.factors), 1.0))
        length = float(np.linalg.norm(normal))
        if offset < -BOUNDLESS * length - ROUNDING * size and opened.is_allowed:
            return np.zeros(len(self.units)), -1.0, True  # nothing at all is carried
        if not (np.isfinite(offset) and length > ROUNDING * size):
            return none
        offset += EPSILON * size
        if not opened.is_allowed:
            largest = float(np.abs(raw.forces).max(initial=0.0))
            acting = float(np.abs(self.dead + self.forces @ raw.factors).sum())
            offset += opened.missing * REFERENCE * max(acting, largest)
        return normal / length, offset / length, opened.is_allowed

    def _seek_field(self) -> None:
        """Gives the certifier rates that open all contacts, if a solver finds some."""
        self._field_was_sought = True
        problem = LimitProgram(
            self.assemblage, self.surfaces, goal=largest_self_stress, reduction=self.reduction
        )
        for settings in problem.ladder()[:2]:
            state = self.run.solve(problem.run, settings)
            if state.mechanism is not None and self.certifier.offer_opening_field(state.mechanism):
                return

    def _solution(
        self, raw: Raw, loaded: FloatArray, factor: float, bracket: Bracket | None
    ) -> Solution:
        """Returns an answer as the solution under the load that the factors ``loaded`` make, of
        which it carries ``factor``; without a ``bracket`` it is unbounded."""
        run = self.run.auxiliary_run(self.run.assemblage.under(self.dead, self.forces @ loaded))
        run.given = self.run.given.with_live(combined(self.loads, self.units * loaded))
        run.history, asked = [raw.iterate], Convex(self.tolerance)
        internal = raw.given if self.certifier.strength.is_internal else None
        if bracket is None:
            run.best = Answer(None, Bracket(), raw.forces, None, internal=internal)
            return packed(asked, run, Status.UNBOUNDED)
        mechanism = None
        if raw.mechanism is not None and np.isfinite(bracket.upper):
            power = float(self.forces @ loaded @ raw.mechanism.ravel())
            mechanism = raw.mechanism / power if power > 0.0 else None
        run.best = Answer(factor, bracket, raw.forces, mechanism, internal=internal)
        good = bracket.is_within(self.tolerance)
        return packed(asked, run, Status.CERTIFIED if good else Status.NOT_CERTIFIED)

    @cached_property
    def mirrors(self) -> list[LoadMirror]:
        """Mirror planes that carry the loads into each other; none if the model is kept whole."""
        crushes = np.isfinite(self.assemblage.contacts.compressive_strength).any()
        if crushes or self.run.model == "full":
            return []
        quiet = self.assemblage.statics.under(self.dead, np.zeros_like(self.dead))
        return load_mirrors(quiet, self.forces, self.surfaces)
