"""Sweeps proved again: rows, and the results they come from.

A row says what was varied, and what its result says. So its scene is built anew from its
parameters; the result that the folder holds has to be of that scene, and what the row says has to
be what the result says; and the result is proved as any other. Rows that say why they have no
result claim nothing.
"""

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
from cvxlimit.proof.checks import Check, compared, unseen
from cvxlimit.proving.claims import asked_checks
from cvxlimit.proving.prove import BOTH_CASES, Proof, Scenes, scene_of
from cvxlimit.proving.solutions import solution_checks
from cvxlimit.scene import Scene
from cvxlimit.surfaces.coulomb import surfaces_of, words_of

_NAMED = {"surface", "method", "moments", "tolerance"}
"""Options that results name."""


def prove_sweep(folder: Path, scene: Scenes | None, own: Mapping[str, Any]) -> Proof:
    """Every row that the folder of a sweep holds; see :func:`cvxlimit.prove`."""
    return Proof(f"sweep in {folder}", tuple(_checks(folder, scene, own)))


def _checks(folder: Path, scenes: Scenes | None, own: Mapping[str, Any]) -> Iterator[Check]:
    """Which scenes the rows are of, and then row by row."""
    about, base = about_sweep(folder), scenes
    if isinstance(about.get("base"), dict):
        with refusals(f"{folder}: "):
            held = scene_from_dict(about["base"])
        if about.get("scene") != f"{held.name} {scene_digest(held)}":
            yield Check(f"scene {about.get('scene')!s:.60}", False, "the base is another one")
        if isinstance(scenes, Scene):
            scene_of(held.name, scene_digest(held), scenes, BOTH_CASES)
        base = scenes or held
    if base is None:
        raise InputError(
            f"{folder}: a function built the scenes of this sweep ({about.get('scene')!s:.80}), "
            "and the folder does not hold them: prove(folder, function)"
        )
    every, proofs = read_sweep(folder, every=True), proofs_of(folder)
    good, failed, unknown = 0, 0, dict[str, Check]()
    for row in every.drop_duplicates(KEY, keep="last").to_dict("records"):
        # what was varied stands between the row's names and its results
        names = [*row]
        names = names[: names.index("load_factor")] if "load_factor" in row else names
        varied = {name: row[name] for name in names if name not in (KEY, IDENTITY)}
        varied = {name: value if value == value else None for name, value in varied.items()}
        told = [f"{name} {value}" for name, value in varied.items() if value is not None]
        called = "row " + ", ".join(told)
        for name in (KEY, IDENTITY, *RESULTS):
            # NaN is a figure, and no text
            if row.get(name) is None or (name not in FIGURES and row[name] != row[name]):
                raise InputError(
                    f"{folder}: {called} lacks the column {name!r}: delete the part that "
                    "holds it, and the same call solves its rows again"
                )
        checks = [*_row(row, varied, proofs.get(row[IDENTITY]), base, own)]
        missing = [c for c in checks if not c.is_met]
        good += not (missing or row["error"])
        failed += bool(row["error"]) and not missing
        unknown |= {c.claim: c for c in checks if c.is_met and c.kind == "not looked at"}
        yield from (replace(check, claim=f"{called}, {check.claim}") for check in missing)
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


def _row(
    row: Mapping[str, Any], varied: Mapping[str, Any], text: str | None, base: Scenes,
    own: Mapping[str, Any],
) -> Iterator[Check]:  # fmt: skip
    """The claims of one row, whose result is held as ``text``."""
    # Its name is that of its parameters, where one may have been varied to none.
    parameters = {name: value for name, value in varied.items() if value is not None}
    if row[KEY] not in (key_of(parameters), key_of(varied)):
        yield Check(f"{KEY} {row[KEY]!r}", False, "it is the name of other parameters")
    if row["error"]:
        if text is not None or any(row[name] == row[name] for name in FIGURES) or row["status"]:
            yield Check(f"error {row['error']!r:.60}", False, "there is a result beside it")
        return
    if text is None:
        yield Check("bracket", False, "the folder holds no forces and no mechanism of it")
        return
    # Its scene is that of the result, which says the same, and is proved.
    try:
        solution = result_from_dict(parsed(str(text).encode()))
        study = Rows(base)
        of_scene, options = study.split(parameters)
        scene = study.family.scene(of_scene)
        if solution.scene_digest != scene_digest(scene):
            yield Check("scene", False, "what is held is of another scene than its parameters make")
            return
        results = results_of(solution)
        yield from compared({name: row.get(name) for name in results}, results, near=0.0)
        # what was asked, as far as results name it
        asked = {name: options[name] for name in options.keys() & _NAMED}
        yield from map(unseen, options.keys() - _NAMED)
        surface = words_of(*surfaces_of(asked.pop("surface"))) if "surface" in asked else {}
        if solution.interaction == "none":
            asked.pop("moments", None)
        yield from asked_checks(solution, surface, **asked)
        yield from solution_checks(solution, scene, **own)
        yield from map(unseen, {*row} - {KEY, IDENTITY, *varied, *results})
    except CvxlimitError as error:
        yield Check("bracket", False, str(error))
