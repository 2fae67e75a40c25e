"""The public names of the package, and the versions that answers carry."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import pytest

import cvxlimit
from cvxlimit import Certified, FixedPoint, builtin_scene, solve
from cvxlimit.solvers import SolverSettings, versions
from helpers import COMPILED

SOURCE = Path(cvxlimit.__file__)
PACKAGE = {"cvxlimit": cvxlimit.__version__, "cvxpy": version("cvxpy")}
SCS = SolverSettings("SCS", {"eps_abs": 1e-6, "eps_rel": 1e-6}, "my own label, loose")


def test_version_is_one_that_installers_can_order() -> None:
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.dev\d+|rc\d+)?", cvxlimit.__version__)


@pytest.mark.parametrize("name", cvxlimit.__all__)
def test_public_names_can_be_had(name: str) -> None:
    assert getattr(cvxlimit, name) is not None
    assert name in dir(cvxlimit)


def test_type_checkers_see_the_same_names_from_the_same_modules() -> None:
    seen = {}
    for node in ast.parse(SOURCE.with_suffix(".pyi").read_text("utf-8")).body:
        assert isinstance(node, ast.ImportFrom)
        (alias,) = node.names
        home = import_module("." * node.level + (node.module or ""), "cvxlimit")
        seen[alias.name] = getattr(home, alias.name)
        assert alias.asname == alias.name
    assert seen.keys() == set(cvxlimit.__all__)
    assert all(getattr(cvxlimit, name) is value for name, value in seen.items())


def test_unknown_names_are_refused_as_by_any_module() -> None:
    with pytest.raises(AttributeError, match="module 'cvxlimit' has no attribute 'sovle'"):
        cvxlimit.sovle  # type: ignore[attr-defined]  # noqa: B018


def test_modules_do_not_hide_behind_functions() -> None:
    """In a process of its own, where nothing has been imported yet."""
    pytest.importorskip("cvxlimit.extensions.studies")
    code = "import cvxlimit; cvxlimit.compare.Model; cvxlimit.solve; import cvxlimit.io as io; io"
    subprocess.run([sys.executable, "-c", code], check=True)
    with pytest.raises(ImportError):
        import_module("cvxlimit.solve")


@pytest.mark.parametrize(
    ("options", "solvers"),
    [
        ({"ladder": [SolverSettings("CLARABEL")]}, {"clarabel"}),
        ({"ladder": [SCS], "tolerance": 0.1}, {"scs"}),
        pytest.param({"ladder": [SolverSettings("BLOCKWISE")]}, {"blockwise"}, marks=COMPILED),
        ({"method": FixedPoint(max_iterations=2)}, set()),
        ({"method": Certified(solves=2, branching_seconds=1.0)}, {"clarabel"}),
    ],
    ids=["one", "labelled", "our own", "fixed point", "certified"],
)
def test_answers_carry_the_versions_of_all_solvers_that_ran(
    options: dict[str, object], solvers: set[str]
) -> None:
    """Where none is asked for, those that the history names."""
    solution = solve(builtin_scene("stack"), **options)  # type: ignore[arg-type]
    found = solution.versions
    solvers = solvers or {each.solver.split()[0].lower() for each in solution.history}
    own = {"blockwise": cvxlimit.__version__}
    assert found == PACKAGE | {name: own.get(name) or version(name) for name in solvers}


def test_solvers_by_another_name_and_those_that_are_not_there() -> None:
    assert versions(["HIGHS"]) == PACKAGE | {"highspy": version("highspy")}
    assert versions(["NO_SUCH"]) == PACKAGE | {"no_such": "unknown"}
