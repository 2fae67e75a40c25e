"""Every notebook runs from top to bottom, ends in an assertion and was saved with its outputs."""

from __future__ import annotations

import copy
import importlib.util
import itertools
from pathlib import Path

import pytest

from exhaustive import mostly_slow

nbformat = pytest.importorskip("nbformat")
pytest.importorskip("nbclient")

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
LARGEST = 400_000
"""Bytes: outputs are kept so that they can be read without running, but small."""

WANTED = {
    "change_the_problem", "imported_vault", "linearised_against_conic", "load_domains",
    "panels_of_the_paper", "speed_and_accuracy", "sweep", "tuff_wall", "yield_surfaces",
    "what_decides", "your_own_surface", "zero_dilatancy",
}  # fmt: skip


def execute():
    spec = importlib.util.spec_from_file_location("execute", FOLDER / "execute.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def kinds(notebook):
    """What every cell shows: kinds of output, whatever the figures in it.

    Printed lines arrive in one piece or in several, as it happens; what goes to stderr, such as
    what a scheduler has to say of a busy machine, does not count.
    """
    shown = [
        [
            (output.output_type, *sorted(output.get("data", ())))
            for output in cell.outputs
            if output.get("name") != "stderr"
        ]
        for cell in code_cells(notebook)
    ]
    return [[kind for kind, _ in itertools.groupby(cell)] for cell in shown]


def test_there_is_one_on_every_subject():
    assert not WANTED - {path.stem for path in NOTEBOOKS}


@pytest.mark.parametrize(
    "path",
    mostly_slow(NOTEBOOKS, [path for path in NOTEBOOKS if path.stem == "your_own_surface"]),
    ids=lambda path: path.stem,
)
def test_notebook_runs_and_shows_what_it_was_saved_with(path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "")  # as execute.run sets it, for this test only
    monkeypatch.setenv("PYDEVD_DISABLE_FILE_VALIDATION", "1")
    saved = nbformat.read(path, as_version=4)
    notebook = copy.deepcopy(saved)
    execute().run(notebook)
    assert kinds(notebook) == kinds(saved)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_short_saved_with_outputs_and_ends_in_an_assertion(path):
    notebook = nbformat.read(path, as_version=4)
    cells = code_cells(notebook)
    assert "assert " in cells[-1].source
    assert len(cells) <= 12
    outputs = [output for cell in cells for output in cell.outputs]
    assert len(outputs) >= 2
    assert not any(output.output_type in ("error", "stderr") for output in outputs)
    assert path.stat().st_size < LARGEST
