"""A load domain proved again: every point, ray and half-space, from what its solutions hold.

Forces in equilibrium with loads p, inside all surfaces, show that p is carried; a mechanism u shows
that all loads that are carried have p . (f_live . u) <= what contacts take up - f_dead . u. So each
support of the domain is made anew from the forces and the mechanism of its solution, and held
against the one made: its point, its ray, its half-space, and what its solution says of itself.
What holds of the domain as a whole, its gap and its status, follows from these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.studies.domains.document import DOMAIN
from cvxlimit.extensions.studies.domains.domain import LoadDomain
from cvxlimit.extensions.studies.domains.images import Raw
from cvxlimit.extensions.studies.domains.search import METHODS, NEAR, Search, Study, status_of
from cvxlimit.extensions.studies.domains.supports import Support
from cvxlimit.io.scenes import scene_digest
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, follows, proved, unseen, unseen_fields
from cvxlimit.proving.derived import asked_checks, bound_checks, derived_checks, words_of_method
from cvxlimit.proving.prove import Proof, Scenes, scene_of
from cvxlimit.proving.solutions import known_or_asked, solution_checks
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import combined
from cvxlimit.solution import LOAD_FACTOR, Solution, Status
from cvxlimit.surfaces.coulomb import surfaces_named, words_of

_LOOKED_AT = (
    "surface", "method", "loads", "units", "supports", "status", "tolerance", "is_convex",
    "scene_digest", "scene_name",
)  # fmt: skip


def prove_domain(what: Any, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """A load domain, or what a file of one holds; see :func:`cvxlimit.prove`."""
    domain = what if isinstance(what, LoadDomain) else DOMAIN.from_dict(what)
    given = scene_of(domain.scene_name, domain.scene_digest, scene, {"dead"})
    checks = DomainAgain(domain, given, own).checks()
    return Proof(f"load domain of {domain.scene_name!r}", tuple(checks))


class DomainAgain:
    """A domain, and the search that it would be of, without any question."""

    def __init__(self, domain: LoadDomain, scene: Scene, own: Mapping[str, Any]) -> None:
        self.domain, self.scene, self.own = domain, scene, own
        named = own["surface"] or surfaces_named(*words_of(domain.surface).values())
        surface = known_or_asked(named, domain.scene_name, "surface", domain.surface)
        options = {"surface": surface, "ladder": None, "model": "auto"}
        if own["moments"] is not None:
            options["moments"] = own["moments"]
        loads = tuple(domain.loads.values())
        study = Study(scene, loads, domain.method, domain.tolerance, 16, options)
        self.structure = study.structure
        self.search = Search(study, domain, None, lambda _: None)

    def checks(self) -> Iterator[Check]:
        domain, units = self.domain, self.structure.units
        # What nothing else means anything without.
        if domain.method not in METHODS:
            yield Check(f"method {domain.method!r}", False, f"none of {', '.join(METHODS)}")
            return
        if not np.allclose(units, domain.units, rtol=SLACK, atol=0.0):
            yield Check("units of load factors", False, f"of this scene they are {units.tolist()}")
            return
        if domain.is_convex != (domain.method in ("convex", "exact")):
            yield Check("convexity", False, f"method {domain.method!r} says otherwise")
        # The supports: those that are proved are counted, the others are told one by one.
        number = Counter[str]()
        for check in self._supports() if domain.method == "convex" else self._solutions():
            if check.is_met and check.kind == "proved":
                number[check.claim.split(" ")[0]] += 1
            else:
                yield check
        for kind, many in number.items():
            yield Check(f"{many} {kind}{'s' * (many != 1)}", True)
        # What follows from them, and what was not looked at.
        if domain.is_convex and not domain.is_empty:
            yield Check(f"gap of {domain.gap_said}", True, "by points and half-spaces")
        status, claim = status_of(domain), f"status {str(domain.status)!r}"
        told = f"{domain.tolerance:g} asked for"
        if domain.status is Status.INTERRUPTED and not status.is_good:
            yield unseen(claim, told)
        else:
            but = f"{told}: it is {str(status)!r}"
            yield follows(claim, domain.status is status, but, told)
        if domain.scene_name != self.scene.name:
            yield unseen("scene", f"of that name, {domain.scene_name!r}")
        yield from unseen_fields(domain, _LOOKED_AT)
        if not domain.scene_digest:
            yield unseen("scene_digest", "the file has none")
        yield unseen("direction, is_mirrored")

    # Without interaction: forces and mechanisms are checked in all directions of loads at once

    def _supports(self) -> Iterator[Check]:
        structure, supports = self.structure, self.domain.supports
        raws = [structure.said(s) for s in supports]
        known = [raw for raw in raws if raw is not None and not raw.is_ray]
        structure.refer_to([raw for raw in known if np.abs(raw.factors).max() < NEAR])
        for i, (s, raw) in enumerate(zip(supports, raws, strict=True)):
            again = self._without_forces(s) if raw is None else structure.proved(raw)
            if again.point is None and structure.certifier.witnesses.dead_state is not None:
                centre = structure.centre * structure.units
                yield from self._compared(i, s, replace(again, point=centre, point_is_proved=True))
            else:
                yield from self._compared(i, s, again)
            if raw is not None:
                yield from self._own(i, s, raw, again)

    def _without_forces(self, s: Support) -> Support:
        """What needs no forces: loads whose sum is none are a ray."""
        ray = s.ray
        if ray is not None:
            load = self.structure.forces @ (ray / self.structure.units)
            if np.abs(load).max() > SLACK * np.abs(self.structure.forces).max():
                ray = None
        return Support(s.direction, None, ray, np.zeros_like(s.normal), np.inf)

    def _own(self, i: int, s: Support, raw: Raw, again: Support) -> Iterator[Check]:
        """That forces as they are held carry the loads, and what the solution says of itself."""
        structure, held, found = self.structure, s.solution, again.solution
        load = structure.forces @ raw.factors + (0.0 if raw.is_ray else structure.dead)
        taken = structure.assemblage.statics.matrix @ raw.forces.ravel()
        left, size = np.abs(taken + load).max(), np.abs(load).max()
        rests_on_forces = s.point is not None or s.ray is not None
        if rests_on_forces and not left <= RESIDUAL * max(size, np.abs(structure.dead).max()):
            off = left / max(size, 1e-300)
            yield Check(f"forces {i}", False, f"they miss equilibrium by {off:.1e}")
        if held is None or found is None:
            return
        if not rests_on_forces:
            yield unseen("load_factor", "of answers that carry nothing")
        if (held.load_factor is None) != (found.load_factor is None):
            yield Check(f"load factor of {i}", False, f"{found.load_factor} is shown")
        bracket = found.bracket
        if again.point is None:  # the lower bound is that of the dead load alone, see above
            bracket = replace(bracket, lower=held.lower, lower_is_proved=True)
        if held.bracket.least != bracket.least:
            but = f"it is {bracket.least:.7g}"
            yield Check(f"least size {held.bracket.least:.7g} of {i}", False, but)
        for check in bound_checks(held, bracket, 1.0):
            if not check.is_met:
                yield replace(check, claim=f"{check.claim} of {i}")
        for check in (*self._asked(held, self._loaded(s)), *derived_checks(held, found)):
            claim = check.claim if check.is_met else f"{check.claim} of {i}"
            yield replace(check, claim=claim, found="" if check.is_met else check.found)

    # Otherwise: each direction has a solution of its own

    def _solutions(self) -> Iterator[Check]:
        domain, units = self.domain, self.domain.units
        known = dict[int, list[Check]]()
        for i, s in enumerate(domain.supports):
            solution = s.solution
            if solution is None or s.loaded is None:
                yield Check(f"point {i}", False, "there is no solution that shows it")
                continue
            at = self._loaded(s)
            if id(solution) not in known:
                known[id(solution)] = solution_checks(solution, at, **self.own)
            for check in known[id(solution)]:
                is_counted = check.kind == "proved" or not check.is_met
                claim = f"{check.claim} of {i}" if is_counted else check.claim
                yield replace(check, claim=claim, found=check.found if is_counted else "")
            for check in self._asked(solution, at):
                yield replace(check, claim=f"{check.claim} of {i}")
            # of several members each has a point of its own
            made = [*self.search._of_solution(s.direction / units, solution)]
            near = [m for m in made if s.point is None or _is_near(s.point, m.point, units)]
            yield from self._compared(i, s, (near or made)[0])

    # What both have

    def _loaded(self, s: Support) -> Scene:
        """The scene under the live load that a support's solution is of."""
        loads = list(self.domain.loads.values())
        return self.scene.with_live(combined(loads, np.asarray(s.loaded)))

    def _asked(self, held: Solution, scene: Scene) -> Iterator[Check]:
        """That a solution is of the question that the domain is of."""
        asked: dict[str, Any] = words_of(self.domain.surface) | words_of_method(self.domain.method)
        asked |= {"quantity": LOAD_FACTOR, "blocks": len(scene.free)}
        if held.scene_digest:
            asked["scene_digest"] = scene_digest(scene)
        return asked_checks(held, asked, "a solution says")

    def _compared(self, i: int, s: Support, again: Support) -> Iterator[Check]:
        """The point, the ray and the half-space of a support against those made anew."""
        units = self.structure.units
        shows = None if again.point is None else np.round(again.point, 6).tolist()
        if s.point is not None:
            holds = again.point_is_proved or not s.point_is_proved
            is_met = holds and _is_near(s.point, again.point, units)
            yield proved(f"point {i}", is_met, f"the forces show {shows}")
        if s.ray is not None:
            is_met = _is_near(s.ray, again.ray, units)
            yield proved(f"ray {i}", is_met, f"the forces show {again.ray}")
        if np.isfinite(s.offset):
            own, other = (np.append(x.normal * units, x.offset) for x in (s, again))
            holds = again.half_space_is_proved or not s.half_space_is_proved
            is_met = holds and _is_near(own, other)
            yield proved(f"half-space {i}", is_met, "the mechanism shows another one, or none")


def _is_near(own: FloatArray, other: FloatArray | None, units: Any = 1.0) -> bool:
    """Whether two vectors are the same, as multiples of ``units``."""
    if other is None or not np.isfinite(other).all():
        return False
    scale = max(1.0, float(np.abs(own / units).max(initial=0.0)))
    return bool(np.abs((own - other) / units).max(initial=0.0) <= SLACK * scale)
