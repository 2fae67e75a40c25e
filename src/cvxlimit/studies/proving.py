"""One verb for results, load domains, paths and sweeps: do they hold the proof of what they say?"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from cvxlimit.errors import CvxlimitError, InputError
from cvxlimit.io.fields import file_prefix, read_document, refusals, shown
from cvxlimit.io.paths import PATH
from cvxlimit.io.results import result_from_dict
from cvxlimit.io.scenes import scene_digest, scene_from_dict
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.methods.checks import Check, Kind
from cvxlimit.methods.proving import solution_checks
from cvxlimit.model.formulations import Formulation, corner_compressions
from cvxlimit.paths.path import Path as Displacements
from cvxlimit.paths.proving import path_checks
from cvxlimit.readings.moments import Moments
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solution import Solution
from cvxlimit.studies.domains.document import DOMAIN
from cvxlimit.studies.domains.domain import LoadDomain
from cvxlimit.studies.domains.proving import DomainAgain
from cvxlimit.studies.rows import Study as Rows
from cvxlimit.studies.store import (
    IDENTITY,
    KEY,
    about_sweep,
    proofs_of,
    read_sweep,
)
from cvxlimit.studies.variations import varied
from cvxlimit.surfaces.coulomb import surfaces_of, words_of

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
        Every claim, with what it rests on, or why it is not proved; and what was not looked at.

    Example
    -------
    >>> from cvxlimit import builtin_scene, prove, solve
    >>> proof = prove(solve(builtin_scene("stack")))
    >>> proof.is_proved, len(proof.of("proved")), "note" in [c.claim for c in proof.of("not looked at")]
    (True, 3, True)
    """

    about: str
    checks: tuple[Check, ...]

    @property
    def is_proved(self) -> bool:
        """True if something is proved, and nothing that was looked at fails."""
        return bool(self.of("proved")) and all(check.is_met for check in self.checks)

    def of(self, kind: Kind) -> tuple[Check, ...]:
        """What is proved, what follows from that, or what was not looked at."""
        return tuple(check for check in self.checks if check.is_met and check.kind == kind)

    @property
    def missing(self) -> tuple[Check, ...]:
        """The claims that are not proved."""
        return tuple(check for check in self.checks if not check.is_met)

    @property
    def rows(self) -> list[str]:
        """A line for each claim that is proved, or is not, one for all that follow from these, and
        one for what was not looked at."""
        alone = [str(c) for c in self.checks if not c.is_met or c.kind == "proved"]
        for kind in get_args(Kind)[1:]:
            others = dict.fromkeys(
                f"{c.claim} ({c.found})" if c.found else c.claim for c in self.of(kind)
            )
            alone += [f"{kind}: {', '.join(others)}"] if others else []
        return alone

    def __str__(self) -> str:
        return "\n".join([self.about, *self.rows])


def prove(
    what: Solution | LoadDomain | Displacements | str | os.PathLike[str],
    scene: Scenes | None = None,
    *,
    surface: Any = None,
    moments: str | Moments | None = None,
    formulation: Formulation = corner_compressions,
) -> Proof:
    """Prove a result, a load domain, a path or a sweep again, from the forces and mechanisms that
    it holds.

    Nothing that it says is believed: load factors, bounds, points and half-spaces are computed
    anew, and one that comes out otherwise, by more than 1e-7 of it, is not proved. No load factor
    is sought by a solver, but for the brackets of a path, whose displacements are what is believed.

    Parameters
    ----------
    what : Solution, LoadDomain, Path or path of a file
        Or a result file, a domain file, a path file, the folder of a sweep.
    scene : Scene, callable or None
        Files hold a digest of their scene, and not the scene itself, but for those of paths. Needed
        unless ``what`` has it, it is a built-in scene, or a sweep that varies one scene; for a
        sweep over a function, that function.
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
    if isinstance(what, Displacements):
        return _path(what, scene)
    if os.path.isdir(what):
        return Proof(f"sweep in {os.fspath(what)}", tuple(_rows(Path(what), scene, own)))
    with refusals(file_prefix(what)):
        document = read_document(what)
        kind = document.get("format") if isinstance(document, dict) else None
        if kind == "cvxlimit-domain":
            return _domain(DOMAIN.from_dict(document), scene, own)
        if kind == "cvxlimit-result":
            return _result(result_from_dict(document), scene, own)
        if kind == "cvxlimit-path":
            return _path(PATH.from_dict(document), scene)
        raise InputError(
            "a result, a load domain, a path or the folder of a sweep can be proved, got format "
            f"{shown(kind)}: solve --json, domain --json, pushover --json and sweep --output write "
            "them"
        )


def _path(path: Displacements, scene: Scenes | None) -> Proof:
    if scene is not None:
        _scene_of(path.scene.name, scene_digest(path.scene), scene, _ALL)
    return Proof(f"path of scene {path.scene.name!r}", tuple(path_checks(path)))


def _result(solution: Solution, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    if scene is None and solution.solved_scene is not None:
        scene = solution.solved_scene
    given = _scene_of(solution.scene_name, solution.scene_digest, scene, _ALL)
    checks = solution_checks(solution, given, **own)
    return Proof(f"result of scene {solution.scene_name!r}", tuple(checks))


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
    given = _scene_of(domain.scene_name, domain.scene_digest, scene, {"dead"})
    return Proof(
        f"load domain of {domain.scene_name!r}", tuple(DomainAgain(domain, given, own).checks())
    )
