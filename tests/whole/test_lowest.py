"""The lowest versions that .ci/run tests are those that pyproject.toml states."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def script():
    spec = importlib.util.spec_from_file_location("lowest", ROOT / ".ci" / "lowest.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_requirement_has_its_bound(script):
    project = """
        [project]
        name = "house"
        dependencies = ["brick>=2.1,<3", "mortar [lime] >=1"]
        [project.optional-dependencies]
        all = ["house[roof]", "roof[tiles]>=0.5.2"]
        """
    assert list(script.lowest(project)) == ["brick==2.1", "mortar==1", "roof==0.5.2"]


def test_a_requirement_without_one_is_named(script):
    with pytest.raises(SystemExit, match="brick has no lower bound"):
        list(script.lowest('project = {name = "house", dependencies = ["brick"]}'))


def test_this_project_has_them_all(script):
    bounds = dict(line.split("==") for line in script.lowest(script.PROJECT.read_text("utf-8")))
    assert {"numpy", "cvxpy", "matplotlib", "pytest"} <= set(bounds)
