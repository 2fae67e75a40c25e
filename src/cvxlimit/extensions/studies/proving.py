"""Sweeps proved again: rows, and the results they come from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cvxlimit.errors import CvxlimitError, InputError
from cvxlimit.extensions.studies.rows import FIGURES, RESULTS, results_of
from cvxlimit.extensions.studies.rows import Study as Rows
from cvxlimit.extensions.studies.store import (
    IDENTITY,
    KEY,
    about_sweep,
    key_of,
    proofs_of,
    read_sweep,
)
from cvxlimit.io.fields import parsed, refusals
from cvxlimit.io.results import result_from_dict
from cvxlimit.io.scenes import scene_digest, scene_from_dict
from cvxlimit.proof.checks import Check, unseen
from cvxlimit.proving.derived import words_of_method
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.proving.solutions import solution_checks
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.surfaces.coulomb import surfaces_of, words_of


def prove_sweep(folder: Path, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """Every row that the folder of a sweep holds; see :func:`cvxlimit.prove`."""
    return Proof(f"sweep in {folder}", tuple(_rows(folder, scene, own)))


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
        scene_of(own_base.name, scene_digest(own_base), base, BOTH_CASES)
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
        solution = result_from_dict(parsed(str(text).encode()))
        study = Rows(base)
        of_scene, options = study.split(parameters)
        scene = study.family.scene(of_scene)
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
