"""Problems that others solve from the files alone have the optimum that their comment proves."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cvxpy as cp
import highspy
import numpy as np
import pytest
import scipy.sparse as sp
from benchmarks.bench.cbf import read_cbf

from cvxlimit import solve
from cvxlimit.cli.main import run
from cvxlimit.masonry import builtin_scene

OPTIMUM = re.compile(r"between (\S+) and (\S+); load factor = (\S+) x objective")
LOOSE = 1e-6
"""Relative, of a solver that asks 1e-8 of residuals."""


def proved(comments: str, found: float) -> float:
    """The load factor of an objective that lies in the proved interval."""
    low, high, unit = map(float, OPTIMUM.search(comments).groups())  # type: ignore[union-attr]
    assert low - LOOSE * abs(low) <= found <= high + LOOSE * abs(high)
    return unit * found


@pytest.mark.parametrize(
    ("scene", "model", "surface"),
    [("arch", "auto", "conic"), ("single-block", "full", "conic"), ("stack", "full", "parabolic")],
)
def test_a_cone_program_is_read_back_and_solved_by_another_solver(
    scene: str, model: str, surface: Any, tmp_path: Path
) -> None:
    path = tmp_path / "problem.cbf"
    command = ["export-problem", scene, "--format", "CBF", "--surface", surface, "--model", model]
    assert run([*command, "--output", str(path)]) == 0
    read = read_cbf(path)
    x, at, constraints = cp.Variable(len(read.cost)), 0, []
    for kind, size in read.cones:
        part = read.matrix[at : at + size] @ x + read.offset[at : at + size]
        made = {
            "L=": part == 0,
            "L+": part >= 0,
            "Q": cp.SOC(part[0], part[1:]) if size > 1 else None,
        }
        constraints.append(made[kind])
        at += size
    problem = cp.Problem(cp.Minimize(read.cost @ x), constraints)
    problem.solve(solver=cp.SCS, eps_abs=1e-9, eps_rel=1e-9, max_iters=100_000)
    factor = proved(" ".join(read.comments), problem.value)
    assert factor == pytest.approx(solve(builtin_scene(scene), surface).load_factor, rel=LOOSE)


def test_facets_are_read_and_solved_by_highs(tmp_path: Path) -> None:
    path = tmp_path / "problem.mps"
    command = ["export-problem", "ferris-tin-loi-1", "--format", "mps", "--surface", "octagon"]
    assert run([*command, "--output", str(path)]) == 0
    highs = highspy.Highs()
    highs.setOptionValue("output_flag", False)
    assert highs.readModel(str(path)) != highspy.HighsStatus.kError  # it warns of entries of 1e-17
    highs.run()
    found = highs.getInfo().objective_function_value
    assert proved(path.read_text("utf-8"), found) == pytest.approx(0.642859, rel=1e-5)


def test_arrays_are_those_of_the_cone_program(tmp_path: Path) -> None:
    for form in ("npz", "cbf"):
        command = ["export-problem", "tuff-wall", "--format", form, "--output"]
        assert run([*command, str(tmp_path / f"problem.{form}")]) == 0
    read = read_cbf(tmp_path / "problem.cbf")
    with np.load(tmp_path / "problem.npz") as arrays:
        matrix = sp.csc_array(
            (arrays["data"], arrays["indices"], arrays["indptr"]), arrays["shape"]
        )
        assert abs(matrix + read.matrix).max() == 0.0
        assert np.array_equal(arrays["b"], read.offset)
        assert np.array_equal(arrays["c"], read.cost)
        assert [size for kind, size in read.cones if kind == "Q"] == arrays["cones"].tolist()


def test_refusals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out")
    assert run(["export-problem", "arch", "--format", "lp", "--output", out]) == 2
    assert "must be one of cbf, mps, npz, got 'lp'" in capsys.readouterr().err
    assert run(["export-problem", "tuff-wall", "--format", "mps", "--output", out]) == 2
    assert "choose --surface octagon" in capsys.readouterr().err
    assert not Path(out).exists()
