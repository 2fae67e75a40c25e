"""Imports with one flaw each, made at random: the right answer, or a refusal or remark by name."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cut_edges import WAYS as WAYS_TO_CUT
from cut_edges import WRITTEN, Arch, cut
from cvxlimit import Status, solve
from cvxlimit.errors import InputError
from cvxlimit.io import import_geometry
from flawed_imports import (
    FLAWS,
    FORMS,
    MESH_FLAWS,
    Case,
    Tower,
    near_of,
    tolerance_named,
    tower,
    written,
)
from gltf_files import WAYS

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
    case = {**FLAWS, **WAYS}[flaw](made, rng)
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


@pytest.mark.parametrize("flaw", [*FLAWS, *WAYS])
def test_one_of_each_kind(flaw: str, tmp_path: Path) -> None:
    check(flaw, 1, tmp_path)


@pytest.mark.exhaustive
@pytest.mark.parametrize("flaw", [*FLAWS, *WAYS])
def test_many_of_each_kind(flaw: str, tmp_path: Path) -> None:
    for seed in range(2, 22):
        check(flaw, seed, tmp_path)


def check_form(name: str, flaw: str, seed: int, folder: Path) -> None:
    """Right, or refused in a sentence of the block's own: never an internal error, never silent."""
    rng = np.random.default_rng(seed)
    made = tower(rng)
    case = Case(name, FORMS[name](MESH_FLAWS[flaw](made, rng)), None)
    factor, said = answered(written(case, folder), made, case)
    if factor is None:
        assert "report" not in said
        assert re.search("block|joint|face", said), said
        if flaw in ("copied", "layer"):
            assert "are the same body twice" in said
        else:
            assert flaw == "rough", said  # all others are mended
    else:
        assert factor == pytest.approx(made.factor, rel=near_of(flaw, name, made)), said


@pytest.mark.parametrize("name", FORMS)
def test_a_flaw_in_each_format(name: str, tmp_path: Path) -> None:
    for k, flaw in enumerate(MESH_FLAWS):
        if k % len(FORMS) == [*FORMS].index(name):
            check_form(name, flaw, 1, tmp_path)


@pytest.mark.exhaustive
@pytest.mark.parametrize("flaw", MESH_FLAWS)
@pytest.mark.parametrize("name", FORMS)
def test_fifty_flaws_in_each_format(name: str, flaw: str, tmp_path: Path) -> None:
    for seed in range(2, 9):
        check_form(name, flaw, seed, tmp_path)


def check_cut(name: str, way: str, seed: int, folder: Path) -> None:
    """As many stones as were written, and their answer."""
    rng = np.random.default_rng(seed)
    arch = Arch(rng)
    chosen = range(len(arch.meshes)) if seed % 2 else [int(rng.integers(len(arch.meshes)))]
    meshes = [cut(mesh, way if i in chosen else "whole", rng) for i, mesh in enumerate(arch.meshes)]
    (folder / name).write_bytes(WRITTEN[name](meshes))
    scene = import_geometry(
        folder / name, length_unit="m", up="z", density=20.0, friction=arch.friction,
        live=arch.live, supports="lowest",
    ).scene  # fmt: skip
    assert len(scene.blocks) == len(arch.meshes)
    right = solve(arch.scene).load_factor
    assert solve(scene).load_factor == pytest.approx(right, rel=NEAR[name])


NEAR = {"a.stl": 1e-4, "text.stl": 1e-4, "a.glb": 1e-4, "a.ply": 1e-6, "a.obj": 1e-6, "a.off": 1e-6}
"""Single precision and seven digits move corners 20 m from the origin by a micrometre."""


@pytest.mark.parametrize("name", WRITTEN)
@pytest.mark.exhaustive_cases("a.stl", "a.ply", "a.off", "text.stl")
def test_an_edge_that_one_face_is_cut_at(name: str, tmp_path: Path) -> None:
    for seed, way in enumerate(WAYS_TO_CUT):
        check_cut(name, way, seed, tmp_path)


@pytest.mark.exhaustive
@pytest.mark.parametrize("way", WAYS_TO_CUT)
@pytest.mark.parametrize("name", WRITTEN)
def test_many_edges_that_one_face_is_cut_at(name: str, way: str, tmp_path: Path) -> None:
    for seed in range(5, 7):
        check_cut(name, way, seed, tmp_path)
