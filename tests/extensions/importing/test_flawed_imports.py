"""Imports with one flaw each, made at random: the right answer, or a refusal or remark by name."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvxlimit import Status, solve
from cvxlimit.errors import InputError
from cvxlimit.io import import_geometry
from flawed_imports import FLAWS, Case, Tower, tolerance_named, tower, written

pytest.importorskip("trimesh")


def answered(path: Path, made: Tower, case: Case, **more: Any) -> tuple[float | None, str]:
    """The load factor (None without one), and all that was said on the way."""
    asked: dict[str, Any] = {
        "length_unit": "m", "up": "z", "density": 20.0, "friction": made.friction,
        "supports": "lowest", "live": (1, 0, 0), **case.asked, **more,
    }  # fmt: skip
    try:
        found = import_geometry(path, **asked)
        said = "; ".join((*found.notes, *found.scene.told))
    except InputError as error:
        return None, str(error)
    solution = solve(found.scene)
    assert solution.status in (Status.CERTIFIED, Status.DEAD_LOAD_UNSTABLE)
    return solution.load_factor, f"{said}; {solution.note}"


def check(flaw: str, seed: int, folder: Path) -> None:
    rng = np.random.default_rng(seed)
    made = tower(rng)
    case = FLAWS[flaw](made, rng)
    path = written(case, folder)
    factor, said = answered(path, made, case)
    for words in case.words:
        assert re.search(words, said), said
    if case.factor is None:
        assert factor is None or case.told
        return
    if factor is None and case.retried:
        enough = tolerance_named(said)
        assert enough is not None, said
        factor, said = answered(path, made, case, joint_tolerance=enough)
    assert factor == pytest.approx(case.factor, rel=case.near), said


@pytest.mark.parametrize("flaw", FLAWS)
def test_one_of_each_kind(flaw: str, tmp_path: Path) -> None:
    check(flaw, 1, tmp_path)


@pytest.mark.exhaustive
@pytest.mark.parametrize("flaw", FLAWS)
def test_many_of_each_kind(flaw: str, tmp_path: Path) -> None:
    for seed in range(2, 22):
        check(flaw, seed, tmp_path)
