"""One verb for results, load domains, paths and sweeps: do they hold the proof of what they say?"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

from cvxlimit.errors import CvxlimitError, InputError
from cvxlimit.io.fields import file_prefix, read_document, refusals, shown
from cvxlimit.io.paths import PATH
from cvxlimit.io.results import result_from_dict
from cvxlimit.io.scenes import scene_digest, scene_from_dict
from cvxlimit.masonry import BUILTIN, builtin_scene
from cvxlimit.methods.checks import Check, Kind, unseen
from cvxlimit.methods.derived import words_of_method
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
from cvxlimit.studies.rows import FIGURES, RESULTS, results_of
from cvxlimit.studies.rows import Study as Rows
from cvxlimit.studies.store import (
    IDENTITY,
    KEY,
    about_sweep,
    key_of,
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
    >>> proof.is_proved, len(proof.of("proved")), proof.of("not looked at")[0].claim
    (True, 3, 'history')
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
    anew, and one that comes out otherwise, by more than 1e-7 of it, is not proved. Nor is a status,
    a unit or a share of dilatancy that does not follow from these; what is not looked at, notes and
    times for example, is named (:meth:`Proof.of`). No load factor is sought by a solver, but for
    the brackets of a path, whose displacements are what is believed.

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
    checks, own = [*path_checks(path)], path.initial and path.initial.scene_digest
    if own and own != scene_digest(path.scene):
        checks.append(Check("initial: scene_digest", False, "it is of another scene"))
    return Proof(f"path of scene {path.scene.name!r}", tuple(checks))


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
            if about.get("scene") != f"{own_base.name} {scene_digest(own_base)}":
                yield Check(f"scene {about.get('scene')!s:.60}", False, "the base is another one")
    base = scenes or own_base
    if isinstance(base, Scene) and own_base is not None:
        _scene_of(own_base.name, scene_digest(own_base), base, _ALL)
    if base is None:
        raise InputError(
            f"{folder}: a function built the scenes of this sweep ({about.get('scene')!s:.80}), "
            "and the folder does not hold them: prove(folder, function)"
        )
    every, proofs = read_sweep(folder, every=True), proofs_of(folder)
    rows = every.drop_duplicates(KEY, keep="last").to_dict("records")
    good, failed, unknown = 0, 0, dict[str, Check]()
    for row in rows:
        if lost := [c for c in (KEY, IDENTITY, *RESULTS) if not _is_held(row.get(c), c in FIGURES)]:
            raise InputError(
                f"{folder}: {_called(row)} lacks the column {lost[0]!r}: delete the part that "
                "holds it, and the same call solves its rows again"
            )
        checks = [*_row(row, proofs, base, own)]
        missing = [c for c in checks if not c.is_met]
        failed += bool(row["error"]) and not missing
        good += not row["error"] and not missing
        unknown |= {c.claim: c for c in checks if c.is_met and c.kind == "not looked at"}
        for check in missing:
            yield replace(check, claim=f"{_called(row)}, {check.claim}")
    if orphans := len(proofs.keys() - set(every[IDENTITY])):
        yield Check(_rows_said(orphans), False, "results are held, and no rows of them")
    if good:
        yield Check(f"{_rows_said(good)} with their brackets", True)
    if failed:
        yield unseen(f"{_rows_said(failed)} more that say why they have no result")
    yield from unknown.values()
    yield unseen("version, options")


def _rows_said(number: int) -> str:
    return f"{number} row{'s' * (number != 1)}"


def _is_held(value: Any, is_figure: bool) -> bool:
    """False where a row has no entry: NaN is a figure, and no text."""
    return value is not None and (is_figure or value == value)


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
    parameters = _parameters(row)
    asked = {name: row[name] for name in [*row][: [*row].index("load_factor")]} | parameters
    asked = {k: x if x == x else None for k, x in asked.items() if k not in (KEY, IDENTITY)}
    if row[KEY] not in (key_of(parameters), key_of(asked)):
        yield Check(f"{KEY} {row[KEY]!r}", False, "it is the name of other parameters")
    text = proofs.get(row[IDENTITY])
    if row["error"]:
        if text is not None or any(row[name] == row[name] for name in FIGURES) or row["status"]:
            yield Check(f"error {row['error']!r:.60}", False, "there is a result beside it")
        return
    if text is None:
        yield Check("bracket", False, "the folder holds no forces and no mechanism of it")
        return
    try:
        solution = result_from_dict(_json(text))
        scenes, options = Rows(base).split(parameters)
        scene = varied(base, **scenes) if isinstance(base, Scene) else base(**scenes)
        if solution.scene_digest != scene_digest(scene):
            yield Check("scene", False, "what is held is of another scene than its parameters make")
            return
        for name, held in results_of(solution).items():
            if row[name] != held and (row[name] == row[name] or held == held):
                yield Check(f"{name} {row[name]!r:.60}", False, f"its result says {held!r:.60}")
        yield from _options(options, solution)
        checks = solution_checks(solution, scene, **own)
        yield from checks
        # a note, which nobody looks at, is that of the result
        yield from map(unseen, {*row} - {KEY, IDENTITY, *parameters, *asked, *results_of(solution)})
    except CvxlimitError as error:
        yield Check("bracket", False, str(error))


def _options(options: Mapping[str, Any], solution: Solution) -> Iterator[Check]:
    """Options that were varied, as far as results name them."""
    said = dict[str, Any]()
    if isinstance(options.get("surface"), str):
        said |= words_of(surfaces_of(options["surface"])[1])
    if options.get("moments") is not None and solution.interaction != "none":
        said["moments"] = str(options["moments"])
    if options.get("tolerance") is not None:
        said["tolerance"] = options["tolerance"]
    if isinstance(options.get("method"), str):
        said |= words_of_method(options["method"])
    for name, value in said.items():
        held = getattr(solution, name)
        if value != held:
            yield Check(f"{name} {value!r}", False, f"its result says {held!r}")
    yield from map(unseen, options.keys() - {"surface", "moments", "tolerance", "method"})


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
