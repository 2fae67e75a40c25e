"""A load domain proved again: every point, ray and half-space, from what its solutions hold.

Forces in equilibrium with loads p, inside all surfaces, show that p is carried; a mechanism u shows
that all loads that are carried have p . (f_live . u) <= what contacts take up - f_dead . u. So each
support of the domain is made anew from the forces and the mechanism of its solution, and held
against the one made: its point, its ray, its half-space, and what its solution says of itself.
What holds of the domain as a whole, its gap and its status, follows from these.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.studies.domains.document import DOMAIN
from cvxlimit.extensions.studies.domains.domain import LoadDomain
from cvxlimit.extensions.studies.domains.images import Raw
from cvxlimit.extensions.studies.domains.search import NEAR, Search, Study, status_of
from cvxlimit.extensions.studies.domains.supports import Support
from cvxlimit.io.scenes import scene_digest
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, compared, follows, proved, unseen
from cvxlimit.proving.claims import asked_checks, bound_checks, derived_checks
from cvxlimit.proving.prove import Proof, Scenes, scene_of
from cvxlimit.proving.solutions import solution_checks, surface_meant
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import combined
from cvxlimit.solution import LOAD_FACTOR, Solution, Status
from cvxlimit.surfaces.coulomb import words_of

_CLAIMED = {
    "surface", "method", "loads", "supports", "status", "tolerance", "scene_digest", "scene_name"
}  # fmt: skip
"""What is asked, what proves the rest, and what has a claim of its own."""


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
        surface = surface_meant(domain, own["surface"])
        options = {"surface": surface, "ladder": None, "model": "auto"}
        if own["moments"] is not None:
            options["moments"] = own["moments"]
        loads = tuple(domain.loads.values())
        study = Study(scene, loads, domain.method, domain.tolerance, 16, options)
        self.structure = study.structure
        self.search = Search(study, domain, None, lambda _: None)

    def checks(self) -> Iterator[Check]:
        domain, number = self.domain, Counter[str]()
        # The supports: what is proved of them is counted, what is not is told one by one.
        claims = self._supports() if domain.method == "convex" else self._solutions()
        for i, s in enumerate(domain.supports):
            for check in claims(s):
                if not check.is_met:
                    yield replace(check, claim=f"{check.claim} of {i}")
                elif check.kind == "proved":
                    number[re.sub(r" -?\d.*", "", check.claim)] += 1
                else:
                    yield replace(check, found="")
        for kind, many in number.items():
            is_sentence = kind.startswith("the ")  # as that of a dead load that cannot stand
            counted = f"{many} {kind}{'s' * (many != 1)}"
            yield Check(f"{kind} ({many} times)" if is_sentence else counted, True)
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
        is_convex = domain.method in ("convex", "exact")
        yield from compared(
            domain, {"units": self.structure.units, "is_convex": is_convex}, _CLAIMED
        )
        if domain.scene_name != self.scene.name:
            yield unseen("scene", f"of that name, {domain.scene_name!r}")
        if not domain.scene_digest:
            yield unseen("scene_digest", "the file has none")
        yield unseen("direction, is_mirrored")
        yield unseen("loads", f"that they are called {', '.join(domain.loads)}")

    # Without interaction: forces and mechanisms are checked in all directions of loads at once

    def _supports(self) -> Callable[[Support], Iterator[Check]]:
        structure = self.structure
        raws = {id(s): structure.said(s) for s in self.domain.supports}
        known = [raw for raw in raws.values() if raw is not None and not raw.is_ray]
        structure.refer_to([raw for raw in known if np.abs(raw.factors).max() < NEAR])
        return lambda s: self._support(s, raws[id(s)])

    def _support(self, s: Support, raw: Raw | None) -> Iterator[Check]:
        """The claims of a support, against the one that ``raw`` makes."""
        structure, held = self.structure, s.solution
        made = self._without_forces(s) if raw is None else structure.proved(raw)
        found, is_bare = made.solution, made.point is None
        if is_bare and structure.certifier.references.dead_state is not None:
            centre = structure.centre * structure.units
            made = replace(made, point=centre, point_is_proved=True)
        yield from self._compared(s, made)
        rests_on_forces = s.point is not None or s.ray is not None
        if raw is not None and rests_on_forces:
            # forces as they are held carry the loads
            load = structure.forces @ raw.factors + (0.0 if raw.is_ray else structure.dead)
            left = np.abs(structure.assemblage.statics.matrix @ raw.forces.ravel() + load).max()
            left /= max(np.abs(load).max(), np.abs(structure.dead).max())
            if not left <= RESIDUAL:
                yield Check("forces", False, f"they miss equilibrium by {left:.1e}")
        if held is None or found is None:
            return
        # what the solution says of itself
        if not rests_on_forces:
            yield unseen("load_factor", "of answers that carry nothing")
        is_met = (held.load_factor is None) == (found.load_factor is None)
        is_met &= held.bracket.least == found.bracket.least
        yield follows("load factor, least size", is_met, f"it is {found!r}")
        bracket = found.bracket
        if is_bare:  # the lower bound is that of the dead load alone, see above
            bracket = replace(bracket, lower=held.lower, lower_is_proved=True)
        yield from bound_checks(held, bracket, 1.0)
        yield from self._asked(held, self._loaded(s))
        yield from derived_checks(held, found)

    def _without_forces(self, s: Support) -> Support:
        """What needs no forces: loads whose sum is none are a ray."""
        ray, forces = s.ray, self.structure.forces
        load = 0.0 if ray is None else forces @ (ray / self.structure.units)
        is_none = np.abs(load).max() <= SLACK * np.abs(forces).max()
        return Support(s.direction, None, ray if is_none else None, np.zeros_like(s.normal), np.inf)

    # Otherwise: each direction has a solution of its own

    def _solutions(self) -> Callable[[Support], Iterator[Check]]:
        known = dict[int, list[Check]]()

        def claims(s: Support) -> Iterator[Check]:
            solution = s.solution
            if solution is None or s.loaded is None:
                yield Check("point", False, "there is no solution that shows it")
                return
            at = self._loaded(s)
            if id(solution) not in known:
                known[id(solution)] = solution_checks(solution, at, **self.own)
            yield from known[id(solution)]
            yield from self._asked(solution, at)
            yield unseen("solution.tolerance")
            # of several members each has a point of its own
            units = self.domain.units
            made = [*self.search._of_solution(s.direction / units, solution)]
            near = [m for m in made if s.point is None or _is_near(s.point, m.point, units)]
            yield from self._compared(s, (near or made)[0])

        return claims

    # What both have

    def _loaded(self, s: Support) -> Scene:
        """The scene under the live load that a support's solution is of."""
        loads = list(self.domain.loads.values())
        return self.scene.with_live(combined(loads, np.asarray(s.loaded)))

    def _asked(self, held: Solution, scene: Scene) -> Iterator[Check]:
        """That a solution is of the question that the domain is of."""
        asked: dict[str, Any] = {"quantity": LOAD_FACTOR, "blocks": len(scene.free)}
        if held.tolerance is not None and self.domain.method == "convex":
            asked["tolerance"] = self.structure.tolerance
        if held.scene_digest:
            asked["scene_digest"] = scene_digest(scene)
        words = words_of(self.structure.run.surfaces, self.domain.surface)
        return asked_checks(held, words, self.domain.method, **asked)

    def _compared(self, s: Support, made: Support) -> Iterator[Check]:
        """The point, the ray and the half-space of a support against those made anew."""
        units = self.structure.units
        shows = None if made.point is None else np.round(made.point, 6).tolist()
        if s.point is not None:
            holds = made.point_is_proved == s.point_is_proved
            is_met = holds and _is_near(s.point, made.point, units)
            yield proved("point", is_met, f"the forces show {shows}")
        if s.ray is not None:
            yield proved("ray", _is_near(s.ray, made.ray, units), f"the forces show {made.ray}")
        if np.isfinite(s.offset):
            own, other = (np.append(x.normal * units, x.offset) for x in (s, made))
            holds = made.half_space_is_proved == s.half_space_is_proved
            is_met = holds and _is_near(own, other)
            yield proved("half-space", is_met, "the mechanism shows another one, or none")


def _is_near(own: FloatArray, other: FloatArray | None, units: Any = 1.0) -> bool:
    """Whether two vectors are the same, as multiples of ``units``."""
    if other is None or not np.isfinite(other).all():
        return False
    scale = max(1.0, float(np.abs(own / units).max(initial=0.0)))
    return bool(np.abs((own - other) / units).max(initial=0.0) <= SLACK * scale)
