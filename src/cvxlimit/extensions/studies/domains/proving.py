"""A load domain proved again: every point, ray and half-space, from what its solutions hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cvxlimit.extensions.studies.domains.document import DOMAIN
from cvxlimit.extensions.studies.domains.domain import WINDOW, LoadDomain
from cvxlimit.extensions.studies.domains.images import Raw
from cvxlimit.extensions.studies.domains.search import METHODS, Search, Study, status_of
from cvxlimit.extensions.studies.domains.supports import Support
from cvxlimit.io.scenes import scene_digest
from cvxlimit.methods.answer import Answer
from cvxlimit.proof.checks import RESIDUAL, SLACK, Check, follows, unseen, unseen_fields
from cvxlimit.proving.derived import derived_checks, words_of_method
from cvxlimit.proving.prove import Proof, Scenes, scene_of
from cvxlimit.proving.solutions import known_or_asked, solution_checks
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import combined
from cvxlimit.solution import LOAD_FACTOR, Solution, Status
from cvxlimit.surfaces.coulomb import surfaces_named, words_of


class DomainAgain:
    """A domain, and the search that it would be of, without any question."""

    def __init__(self, domain: LoadDomain, scene: Scene, own: Mapping[str, Any]) -> None:
        self.domain, self.scene, self.own = domain, scene, own
        named = own["surface"] or surfaces_named(*words_of(domain.surface).values())
        self.surface = known_or_asked(named, domain.scene_name, "surface", domain.surface)
        options = {"surface": self.surface, "ladder": None, "model": "auto"}
        if own["moments"] is not None:
            options["moments"] = own["moments"]
        loads = tuple(domain.loads.values())
        study = Study(scene, loads, domain.method, domain.tolerance, 16, options)
        self.structure = study.structure
        self.search = Search(study, domain, None, lambda _: None)

    def checks(self) -> Iterator[Check]:
        domain, units = self.domain, self.structure.units
        if domain.method not in METHODS:
            yield Check(f"method {domain.method!r}", False, f"none of {', '.join(METHODS)}")
            return
        if not np.allclose(units, domain.units, rtol=SLACK, atol=0.0):
            yield Check("units of load factors", False, f"of this scene they are {units.tolist()}")
            return
        if domain.is_convex != (domain.method in ("convex", "exact")):
            yield Check("convexity", False, f"method {domain.method!r} says otherwise")
        found = self._supports() if domain.method == "convex" else self._solutions()
        yield from _counted(list(found))
        if domain.is_convex and not domain.is_empty:
            yield Check(f"gap of {domain.gap_said}", True, "by points and half-spaces")
        status, claim = status_of(domain), f"status {str(domain.status)!r}"
        told = f"{domain.tolerance:g} asked for"
        if domain.status is Status.INTERRUPTED and not status.is_good:
            yield unseen(claim, told)
        else:
            is_met = domain.status is status
            yield follows(claim, is_met, told if is_met else f"{told}: it is {str(status)!r}")
        seen = {"surface", "method", "loads", "units", "supports", "status", "tolerance"}
        seen |= {"is_convex", "scene_digest", "scene_name"}
        if domain.scene_name != self.scene.name:
            yield unseen("scene", f"of that name, {domain.scene_name!r}")
        yield from unseen_fields(domain, seen)
        if not domain.scene_digest:
            yield unseen("scene_digest", "the file has none")
        yield unseen("direction, is_mirrored")

    def _supports(self) -> Iterator[Check]:
        structure, supports = self.structure, self.domain.supports
        raws = [structure.said(s) for s in supports]
        if not structure.has_reference:
            known = [raw for raw in raws if raw is not None and not raw.is_ray]
            structure.refer_to([r for r in known if np.abs(r.factors).max() < 0.5 * WINDOW])
        for i, (s, raw) in enumerate(zip(supports, raws, strict=True)):
            if raw is None:
                yield from self._without_forces(i, s)
                continue
            again = structure.proved(raw)
            yield from self._compared(i, s, again)
            yield from self._own(i, s, raw, again)

    def _compared(self, i: int, s: Support, again: Support) -> Iterator[Check]:
        units = self.structure.units
        for name in ("point", "ray"):
            held, found = getattr(s, name), getattr(again, name)
            if held is None:
                continue
            is_near = found is not None and _is_near(held / units, found / units)
            if name == "point" and not is_near and self._is_centre(held):
                yield Check(f"point {i}", True)
                continue
            holds = name == "ray" or again.point_is_proved or not s.point_is_proved
            shows = "none" if found is None else np.round(found, 6).tolist()
            yield Check(f"{name} {i}", is_near and holds,
                        "" if is_near and holds else f"the forces show {shows}")  # fmt: skip
        if np.isfinite(s.offset):
            mine = np.append(s.normal * units, s.offset)
            other = np.append(again.normal * units, again.offset)
            is_near = bool(np.isfinite(other).all()) and _is_near(mine, other)
            holds = is_near and (again.half_space_is_proved or not s.half_space_is_proved)
            yield Check(f"half-space {i}", holds, "" if holds else
                        "the mechanism shows another one, or none")  # fmt: skip

    def _own(self, i: int, s: Support, raw: Raw, again: Support) -> Iterator[Check]:
        """That forces as they are held carry the loads, and the solution's own bracket."""
        structure = self.structure
        load = structure.forces @ raw.factors + (0.0 if raw.is_ray else structure.dead)
        taken = structure.assemblage.statics.matrix @ raw.forces.ravel()
        left, size = np.abs(taken + load).max(), np.abs(load).max()
        rests_on_forces = s.point is not None or s.ray is not None
        if rests_on_forces and not left <= RESIDUAL * max(size, np.abs(structure.dead).max()):
            off = left / max(size, 1e-300)
            yield Check(f"forces {i}", False, f"they miss equilibrium by {off:.1e}")
        held, found = s.solution, again.solution
        if held is None or found is None or s.loaded is None:
            return
        if not rests_on_forces:
            yield unseen("load_factor", "of answers that carry nothing")
        at = self.scene.with_live(combined(list(self.domain.loads.values()), s.loaded))
        for check in (*self._asked(held, at), *self._beside(held, found, raw)):
            claim = check.claim if check.is_met else f"{check.claim} of {i}"
            yield replace(check, claim=claim, found="" if check.is_met else check.found)
        for end in ("lower", "upper"):
            first, second = getattr(held, end), getattr(found, end)
            if end == "lower" and again.point is None:  # that of the dead load alone, see above
                continue
            if first != second and not _is_near(np.array([first]), np.array([second])):
                yield Check(f"{end} bound of {i}", False, f"{second:.7g} is shown")

    def _beside(self, held: Solution, found: Solution, raw: Raw) -> Iterator[Check]:
        """What a solution says beside its numbers."""
        if held.bracket.least != found.bracket.least:
            yield Check(f"least size {held.bracket.least:.7g} of the bracket", False)
        if (held.load_factor is None) != (found.load_factor is None):
            yield Check("load factor", False, f"{found.load_factor} is shown")
        structure, scene = self.structure, found.scene
        live = structure.run.assemblage.under(structure.dead, scene.live_forces.ravel())
        run = structure.run.auxiliary_run(live)
        run.given = scene
        mechanism = None if held.mechanism is None else raw.mechanism
        answer = Answer(found.load_factor, forces=held.forces, mechanism=mechanism)
        if structure.certifier.strength.is_internal:
            answer = replace(answer, internal=held.internal)
        yield from derived_checks(held, run, answer)

    def _asked(self, held: Solution, scene: Scene) -> Iterator[Check]:
        """That a solution is of the question that the domain is of."""
        domain = self.domain
        asked: dict[str, Any] = words_of(domain.surface) | words_of_method(domain.method)
        asked |= {"quantity": LOAD_FACTOR, "blocks": len(scene.free)}
        if held.scene_digest:
            asked |= {"scene_digest": scene_digest(scene)}
        for name, value in asked.items():
            if (own := getattr(held, name)) != value:
                yield Check(f"{name} {own!r}", False, f"the domain has {value!r}")

    def _without_forces(self, i: int, s: Support) -> Iterator[Check]:
        """Loads whose sum is none; the dead load alone, if a state that carries it is known."""
        structure, units = self.structure, self.structure.units
        if s.ray is not None:
            load = structure.forces @ (s.ray / units)
            is_met = bool(np.abs(load).max() <= SLACK * np.abs(structure.forces).max())
            yield Check(f"ray {i}", is_met, "" if is_met else "there are no forces that carry it")
        if s.point is not None:
            is_met = self._is_centre(s.point)
            yield Check(f"point {i}", is_met, "" if is_met else "there are no forces that carry it")
        if np.isfinite(s.offset):
            yield Check(f"half-space {i}", False, "there is no mechanism that shows it")

    def _is_centre(self, point: Any) -> bool:
        """True for the loads that a state strictly inside all surfaces carries."""
        has_state = self.structure.certifier.witnesses.dead_state is not None
        return has_state and _is_near(point / self.structure.units, self.structure.centre)

    def _solutions(self) -> Iterator[Check]:
        """Each direction with a solution of its own."""
        domain, loads = self.domain, list(self.domain.loads.values())
        seen = dict[int, list[Check]]()
        for i, s in enumerate(domain.supports):
            solution = s.solution
            if solution is None or s.loaded is None:
                yield Check(f"point {i}", False, "there is no solution that shows it")
                continue
            key, at = id(solution), self.scene.with_live(combined(loads, s.loaded))
            if key not in seen:
                surface = None if self.own["surface"] is None else self.surface
                own = {**self.own, "surface": surface}
                seen[key] = solution_checks(solution, at, **own)
            for check in seen[key]:
                is_counted = check.kind == "proved" or not check.is_met
                claim = f"{check.claim} of {i}" if is_counted else check.claim
                yield replace(check, claim=claim, found=check.found if is_counted else "")
            yield from (replace(c, claim=f"{c.claim} of {i}") for c in self._asked(solution, at))
            made = list(self.search._of_solution(s.direction / domain.units, solution))
            if np.isfinite(s.offset):
                yield from (
                    c for c in self._compared(i, s, made[0]) if c.claim.startswith("half-space")
                )
            if s.point is not None:
                points = [m.point for m in made if m.point is not None]
                is_met = any(_is_near(s.point / domain.units, p / domain.units) for p in points)
                yield Check(f"point {i}", is_met, "" if is_met else "its solution shows another")


def _is_near(first: Any, second: Any) -> bool:
    scale = max(1.0, float(np.abs(first).max(initial=0.0)))
    return bool(np.abs(first - second).max(initial=0.0) <= SLACK * scale)


def _counted(checks: Sequence[Check]) -> Iterator[Check]:
    """Those that are met as numbers of a kind, the others one by one."""
    kinds = dict[str, int]()
    for check in checks:
        if check.is_met and check.kind == "proved":
            kind = check.claim.rsplit(" ", 1)[0].split(" ")[0]
            kinds[kind] = kinds.get(kind, 0) + 1
        else:
            yield check
    for kind, number in kinds.items():
        yield Check(f"{number} {kind}{'s' * (number != 1)}", True)


def prove_domain(what: Any, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """A load domain, or what a file of one holds; see :func:`cvxlimit.prove`."""
    domain = what if isinstance(what, LoadDomain) else DOMAIN.from_dict(what)
    given = scene_of(domain.scene_name, domain.scene_digest, scene, {"dead"})
    checks = DomainAgain(domain, given, own).checks()
    return Proof(f"load domain of {domain.scene_name!r}", tuple(checks))
