"""One verb for results, load domains and sweeps: is what they say proved by what they hold?"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cvxlimit.errors import CvxlimitError, InputError
from cvxlimit.io.fields import file_prefix, read_document, refusals, shown
from cvxlimit.io.results import result_from_dict
from cvxlimit.io.scenes import scene_digest, scene_from_dict
from cvxlimit.loads import combined
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.methods.interaction.readings.moments import Moments
from cvxlimit.methods.proving import RESIDUAL, SLACK, Check, solution_checks
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Solution, Status
from cvxlimit.studies.domains.document import DOMAIN
from cvxlimit.studies.domains.domain import WINDOW, LoadDomain
from cvxlimit.studies.domains.images import Raw
from cvxlimit.studies.domains.search import Search, Study
from cvxlimit.studies.domains.supports import Support
from cvxlimit.studies.rows import Study as Rows
from cvxlimit.studies.store import (
    IDENTITY,
    KEY,
    about_sweep,
    proofs_of,
    read_sweep,
)
from cvxlimit.studies.variations import varied
from cvxlimit.surfaces.coulomb import surfaces_named, surfaces_of, words_of

Scenes = Scene | Callable[..., Scene]

_ALL = {"dead", "live"}


@dataclass(frozen=True)
class Proof:
    """What was claimed, and whether it is proved.

    Attributes
    ----------
    about : str
        What was looked at.
    checks : tuple of Check
        Every claim, with what it rests on, or why it is not proved.

    Example
    -------
    >>> from cvxlimit import builtin_scene, prove, solve
    >>> proof = prove(solve(builtin_scene("stack")))
    >>> proof.is_proved, len(proof.checks)
    (True, 3)
    """

    about: str
    checks: tuple[Check, ...]

    @property
    def is_proved(self) -> bool:
        """True if there is something that is claimed, and all of it is proved."""
        return bool(self.checks) and all(check.is_met for check in self.checks)

    @property
    def missing(self) -> tuple[Check, ...]:
        """The claims that are not proved."""
        return tuple(check for check in self.checks if not check.is_met)

    def __str__(self) -> str:
        return "\n".join([self.about, *map(str, self.checks)])


def prove(
    what: Solution | LoadDomain | str | os.PathLike[str],
    scene: Scenes | None = None,
    *,
    surface: Any = None,
    moments: str | Moments | None = None,
    formulation: Formulation = corner_compressions,
) -> Proof:
    """Prove a result, a load domain or a sweep again, from the forces and mechanisms that it holds.

    Nothing that it says is believed: load factors, bounds, points and half-spaces are computed
    anew, and one that comes out otherwise, by more than 1e-7 of it, is not proved. No load factor
    is sought by a solver.

    Parameters
    ----------
    what : Solution, LoadDomain or path
        Or a result file, a domain file, the folder of a sweep.
    scene : Scene, callable or None
        Files hold a digest of their scene, and not the scene itself. Needed unless ``what`` has it,
        it is a built-in scene, or a sweep that varies one scene; for a sweep over a function, that
        function.
    surface, moments, formulation
        As for :func:`cvxlimit.solve`, where they are one's own; others are named in what is held.

    Returns
    -------
    Proof

    Raises
    ------
    InputError
        If a file cannot be read or belongs to another scene, or if scene, surface or moments are
        needed and not given.

    Example
    -------
    >>> from dataclasses import replace
    >>> from cvxlimit import builtin_scene, prove, solve
    >>> solution = solve(builtin_scene("stack"))
    >>> changed = replace(solution, load_factor=1.1 * solution.load_factor)
    >>> prove(changed).is_proved
    False
    """
    own = {"surface": surface, "moments": moments, "formulation": formulation}
    if isinstance(what, Solution):
        return _result(what, scene, own)
    if isinstance(what, LoadDomain):
        return _domain(what, scene, own)
    if os.path.isdir(what):
        return Proof(f"sweep in {os.fspath(what)}", tuple(_rows(Path(what), scene, own)))
    with refusals(file_prefix(what)):
        document = read_document(what)
        kind = document.get("format") if isinstance(document, dict) else None
        if kind == "cvxlimit-domain":
            return _domain(DOMAIN.from_dict(document), scene, own)
        if kind == "cvxlimit-result":
            return _result(result_from_dict(document), scene, own)
        raise InputError(
            f"a result, a load domain or the folder of a sweep can be proved, got format "
            f"{shown(kind)}: solve --json, domain --json and sweep --output write them"
        )


def _result(solution: Solution, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    if scene is None and solution.solved_scene is not None:
        scene = solution.solved_scene
    given = _scene_of(solution.scene, solution.scene_digest, scene, _ALL)
    checks = solution_checks(solution, given, **own)
    return Proof(f"result of scene {solution.scene!r}", tuple(checks))


def _scene_of(name: str, digest: str, scene: Scenes | None, cases: set[str]) -> Scene:
    """The scene that something is of, which must be the one given."""
    if scene is None:
        if name not in BUILTIN:
            raise InputError(
                f"it does not hold its scene {name!r}, only a digest of it: give the scene "
                "(--scene FILE, or prove(..., scene))"
            )
        scene = builtin_scene(name)
    check_scene(scene)
    assert isinstance(scene, Scene)
    if digest and digest != scene_digest(scene, sorted(cases)):
        raise InputError(
            f"it is of another scene {name!r} than the one given, {scene.name!r}: their digests "
            "differ; give the scene that was solved"
        )
    return scene


# Sweeps


def _rows(folder: Path, scenes: Scenes | None, own: Mapping[str, Any]) -> Iterator[Check]:
    about = about_sweep(folder)
    own_base: Scene | None = None
    if isinstance(about.get("base"), dict):
        with refusals(f"{folder}: "):
            own_base = scene_from_dict(about["base"])
    base = scenes or own_base
    if isinstance(base, Scene) and own_base is not None:
        _scene_of(own_base.name, scene_digest(own_base), base, _ALL)
    if base is None:
        raise InputError(
            f"{folder}: a function built the scenes of this sweep ({about.get('scene')!s:.80}), "
            "and the folder does not hold them: prove(folder, function)"
        )
    rows, proofs = read_sweep(folder).to_dict("records"), proofs_of(folder)
    good = 0
    for row in rows:
        if row["error"]:
            continue
        missing = [c for c in _row(row, proofs, base, own) if not c.is_met]
        good += not missing
        for check in missing:
            yield Check(f"{_called(row)}, {check.claim}", False, check.found)
    failed = sum(bool(row["error"]) for row in rows)
    said = f"{failed} more say why they have none" if failed else ""
    if good:
        yield Check(f"{good} rows with their brackets", True, said)


def _called(row: Mapping[str, Any]) -> str:
    parameters = _parameters(row)
    return "row " + ", ".join(f"{name} {value}" for name, value in parameters.items())


def _parameters(row: Mapping[str, Any]) -> dict[str, Any]:
    """What was varied: it stands between the row's names and its results."""
    found = dict[str, Any]()
    for name, value in row.items():
        if name == "load_factor":
            break
        if name not in (KEY, IDENTITY) and value is not None and value == value:
            found[name] = value
    return found


def _row(
    row: Mapping[str, Any], proofs: Mapping[str, str], base: Scenes, own: Mapping[str, Any]
) -> Iterator[Check]:
    text = proofs.get(row.get(IDENTITY, ""))
    if text is None:
        yield Check("bracket", False, "the folder holds no forces and no mechanism of it")
        return
    try:
        solution = result_from_dict(_json(text))
        parameters, options = Rows(base).split(_parameters(row))
        scene = varied(base, **parameters) if isinstance(base, Scene) else base(**parameters)
        if solution.scene_digest != scene_digest(scene):
            yield Check("scene", False, "what is held is of another scene than its parameters make")
            return
        for name, held in (
            ("load_factor", solution.load_factor), ("lower", solution.lower),
            ("upper", solution.upper), ("gap", solution.gap), ("status", str(solution.status)),
        ):  # fmt: skip
            given = row[name]
            is_missing = held is None and given != given
            if given != held and not is_missing:
                yield Check(f"{name} {given!r}", False, f"its result says {held!r}")
        yield from _options(options, solution)
        yield from solution_checks(solution, scene, **own)
    except CvxlimitError as error:
        yield Check("bracket", False, str(error))


def _options(options: Mapping[str, Any], solution: Solution) -> Iterator[Check]:
    """Options that were varied, as far as results name them."""
    said = dict[str, Any]()
    if isinstance(options.get("surface"), str):
        said |= words_of(surfaces_of(options["surface"])[1])
    if options.get("moments") is not None and solution.interaction != "none":
        said["moments"] = str(options["moments"])
    for name, value in said.items():
        held = getattr(solution, name)
        if value != held:
            yield Check(f"{name} {value!r}", False, f"its result says {held!r}")


def _json(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError as error:
        raise InputError(f"the result that is held is no JSON: {error}") from error


# Load domains


def _domain(domain: LoadDomain, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    given = _scene_of(domain.scene, domain.scene_digest, scene, {"dead"})
    return Proof(f"load domain of {domain.scene!r}", tuple(_Domain(domain, given, own).checks()))


class _Domain:
    """A domain, and the search that it would be of, without any question."""

    def __init__(self, domain: LoadDomain, scene: Scene, own: Mapping[str, Any]) -> None:
        self.domain, self.scene, self.own = domain, scene, own
        surface: Any = own["surface"]
        if surface is None:
            surface = surfaces_named(domain.surface) or (
                surfaces_named("conic", domain.surface) if domain.surface == "parabolic" else None
            )
        if surface is None:
            raise InputError(
                f"the domain of {domain.scene!r} rests on surfaces of one's own "
                f"({domain.surface}), which no file holds: give them as surface=[...]"
            )
        self.surface = surface
        options = {"surface": surface, "ladder": None, "model": "auto"}
        if own["moments"] is not None:
            options["moments"] = own["moments"]
        loads = tuple(domain.loads.values())
        study = Study(scene, loads, domain.method, domain.tolerance, 16, options)
        self.structure = study.structure
        self.search = Search(study, domain, None, lambda _: None)

    def checks(self) -> Iterator[Check]:
        domain, units = self.domain, self.structure.units
        if not np.allclose(units, domain.units, rtol=SLACK, atol=0.0):
            yield Check("units of load factors", False, f"of this scene they are {units.tolist()}")
            return
        if domain.is_convex != (domain.method in ("convex", "exact")):
            yield Check("convexity", False, f"method {domain.method!r} says otherwise")
        found = self._supports() if domain.method == "convex" else self._solutions()
        yield from _counted(list(found))
        if domain.status is Status.CERTIFIED and domain.is_convex:
            is_met = domain.gap <= domain.tolerance
            yield Check(f"gap of {domain.gap_said}", is_met, "by points and half-spaces" if is_met
                        else f"certified means {domain.tolerance:g} at most")  # fmt: skip
        if domain.status is Status.DEAD_LOAD_UNSTABLE:
            yield Check("nothing is carried", domain.is_empty, "by a mechanism")

    def _supports(self) -> Iterator[Check]:
        structure, supports = self.structure, self.domain.supports
        raws = [self._raw(s) for s in supports]
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

    def _raw(self, s: Support) -> Raw | None:
        """What a solver may have said, of which nothing is believed."""
        solution, units = s.solution, self.structure.units
        if solution is None or solution.forces is None or s.loaded is None:
            return None
        contacts, blocks = len(self.structure.run.contacts), len(self.scene.free)
        rates = s.rates
        if solution.mechanism is not None:
            ids = [self.scene.blocks[i].id for i in self.scene.free]
            if set(ids) != set(solution.mechanism):
                return None
            rates = np.array([solution.mechanism[key] for key in ids])
        if solution.forces.shape != (contacts, 6) or (rates is not None and len(rates) != blocks):
            return None
        forces, about = np.array(solution.forces), s.loaded / units
        mortar = self.structure.run.mortar
        if mortar is not None:
            forces[:, 2] += mortar.pull
        given = forces
        if self.structure.certifier.strength.is_internal:
            if solution.internal is None:
                return None
            given = solution.internal
        factors = about * (solution.load_factor or 0.0)
        if s.ray is not None:
            load = self.structure.forces @ about
            taken = self.structure.assemblage.statics.matrix @ forces.ravel()
            factors = about * max(-float(taken @ load) / float(load @ load), 0.0)
        return Raw(s.direction / units, factors, forces, given, rates, s.ray is not None,
                   solution.history[-1], s.is_mirrored)  # fmt: skip

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
            yield Check(f"forces {i}", False, f"they miss equilibrium by {left / size:.1e}")
        held, found = s.solution, again.solution
        if held is None or found is None:
            return
        for end in ("lower", "upper"):
            first, second = getattr(held, end), getattr(found, end)
            if end == "lower" and again.point is None:  # that of the dead load alone, see above
                continue
            if first != second and not _is_near(np.array([first]), np.array([second])):
                yield Check(f"{end} bound of {i}", False, f"{second:.7g} is shown")

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
            key = id(solution)
            if key not in seen:
                at = self.scene.with_live(combined(loads, s.loaded))
                surface = None if self.own["surface"] is None else self.surface
                own = {**self.own, "surface": surface}
                seen[key] = solution_checks(solution, at, **own)
            yield from (Check(f"{c.claim} of {i}", c.is_met, c.found) for c in seen[key])
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
        if check.is_met:
            kind = check.claim.rsplit(" ", 1)[0].split(" ")[0]
            kinds[kind] = kinds.get(kind, 0) + 1
        else:
            yield check
    for kind, number in kinds.items():
        yield Check(f"{number} {kind}{'s' * (number != 1)}", True)
