"""Sweeps whose rows enclose each other: no row contradicts a solve of its own."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvxlimit import Scene, builtin_scene, sweep
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError, ModelError
from cvxlimit.studies import read_sweep
from cvxlimit.surfaces import Rocking, Sliding
from helpers import scenes

FRICTION = np.linspace(0.2, 0.8, 13).round(3).tolist()


def swept(scene: Scene, grid: Any, **options: Any) -> pd.DataFrame:
    return sweep(scene, grid, progress=False, **options)


def assert_agree(table: pd.DataFrame, apart: pd.DataFrame) -> None:
    """Brackets of the same rows overlap; 1e-8 is put down to rounding."""
    both = table["lower"].notna() & apart["lower"].notna()
    table, apart = table[both], apart[both]
    spare = 1e-8 * np.maximum(table["upper"].abs(), 1e-3)
    assert (table["lower"] <= apart["upper"] + spare).all()
    assert (apart["lower"] <= table["upper"] + spare).all()


def test_beyond_the_friction_at_which_it_rocks_nothing_is_solved() -> None:
    """A block of 1 x 2.5 rocks at 0.4 and slides below that: 0.2, 0.25 .. 0.4 differ."""
    table = swept(builtin_scene("single-block"), {"friction": FRICTION}, transfer=0.01)
    exact = np.minimum(FRICTION, 0.4)
    assert (table["lower"] <= exact * (1 + 1e-9)).all()
    assert (table["upper"] >= exact * (1 - 1e-9)).all()
    assert (table["gap"] <= 0.01).all()
    assert set(table["status"]) == {"certified"}
    bounded = table[table["basis"] == "bounded"]
    assert len(bounded) >= 5
    assert bounded["friction"].min() > 0.4
    assert bounded["seconds"].sum() == 0.0
    assert bounded["note"].str.contains("lower bound from friction").all()


@pytest.mark.exhaustive
def test_friction_cohesion_and_other_parameters() -> None:
    """A grid in which some rows are neither below nor above each other."""
    grid = {"cohesion": [0.0, 5.0, 50.0], "friction": FRICTION[::3], "tilt": [0.0, 3.0]}
    scene = builtin_scene("arch")
    table, apart = swept(scene, grid, transfer=0.02), swept(scene, grid)
    assert_agree(table, apart)
    assert table["friction"].tolist() == apart["friction"].tolist()
    assert (table["basis"] == "bounded").sum() >= 8
    assert "basis" not in apart.columns


@pytest.mark.parametrize("surface", ["octagon", "octagon-inscribed", "parabolic"])
def test_surfaces(surface: str) -> None:
    scene, grid = builtin_scene("stack"), {"friction": FRICTION[::2]}
    table = swept(scene, grid, surface=surface, transfer=0.05)
    assert_agree(table, swept(scene, grid, surface=surface))
    assert (table["basis"] == "bounded").any()


def test_strengths_with_tension() -> None:
    """Mortar of 1 x 2.5: tension and cohesion are transferred, friction is not."""
    scene = builtin_scene("single-block").with_cohesion(40.0)
    grid = {"tensile_strength": [0.0, 1.0, 1.01, 1.02], "friction": [0.5, 0.6]}
    table, apart = swept(scene, grid, transfer=0.05), swept(scene, grid)
    assert_agree(table, apart)
    bounded = table[table["basis"] == "bounded"]
    assert len(bounded)
    assert not bounded["note"].str.contains("friction").any()


@pytest.mark.exhaustive
def test_crushing_is_transferred() -> None:
    grid = {"compressive_strength": [500.0, 1000.0, 2000.0, 4000.0]}
    scene = builtin_scene("single-block")
    table, apart = swept(scene, grid, transfer=0.1), swept(scene, grid)
    assert_agree(table, apart)
    assert (table["basis"] == "bounded").any()


def test_stored_rows_are_gone_on_from(tmp_path: Path) -> None:
    scene, folder = builtin_scene("single-block"), tmp_path / "s"
    every = {"friction": FRICTION[::2]}
    part = swept(scene, {"friction": FRICTION[::6]}, transfer=0.01, path=folder)
    table = swept(scene, every, transfer=0.01, path=folder)
    seconds = table.set_index("friction")["seconds"]
    assert part["seconds"].tolist() == seconds.loc[FRICTION[::6]].tolist()
    assert_agree(table, swept(scene, every))
    assert set(read_sweep(folder)["basis"]) == {"solved", "bounded"}
    again = swept(scene, every, transfer=0.01, path=folder)
    assert again["seconds"].tolist() == table["seconds"].tolist()
    with pytest.raises(InputError, match="another options"):
        swept(scene, every, path=folder)


def test_interrupted_rows_are_gone_on_from(tmp_path: Path) -> None:
    lines: list[str] = []

    def stop(line: str) -> None:
        lines.append(line)
        if len(lines) == 3:
            raise KeyboardInterrupt

    scene, grid = builtin_scene("single-block"), {"friction": FRICTION}
    first = sweep(scene, grid, transfer=0.01, path=tmp_path / "s", progress=stop)
    assert first.attrs["is_interrupted"]
    table = swept(scene, grid, transfer=0.01, path=tmp_path / "s")
    assert len(table) == len(FRICTION)
    assert_agree(table, swept(scene, grid))


def test_over_processes() -> None:
    scene, grid = builtin_scene("single-block"), {"friction": FRICTION}
    with ProcessPoolExecutor(2) as pool:
        table = swept(scene, grid, executor=pool, transfer=0.01)
    assert table["basis"].tolist() == swept(scene, grid, transfer=0.01)["basis"].tolist()


@pytest.mark.parametrize(
    ("grid", "options", "message"),
    [
        ({"tilt": [0, 1]}, {}, "but what is varied is tilt"),
        ({"friction": [0.5, 0.6], "tensile_strength": [0.1]}, {"method": "exact"}, "got 'exact'"),
        ({"friction": [0.5]}, {"flow": "zero-dilatancy"}, "got 'zero-dilatancy'"),
        ({"friction": [0.5], "method": ["convex", "certified"]}, {}, "got 'certified'"),
        ({"friction": [0.5]}, {"surface": [Rocking(), type("Own", (Sliding,), {})()]}, "own"),
        ({"friction": [0.5]}, {"transfer": 2.0}, "transfer"),
        ({"friction": [0.5]}, {"transfer": "wide"}, "transfer"),
        ({"friction": [0.5]}, {"measure": len}, "leave out transfer"),
    ],
)
def test_what_is_not_transferred(
    grid: dict[str, Any], options: dict[str, Any], message: str, tmp_path: Path
) -> None:
    scene, path = builtin_scene("single-block"), tmp_path / "rows"
    with pytest.raises(ModelError, match=message):
        swept(scene, grid, path=path, **{"transfer": 0.01, **options})
    assert not path.exists()  # the same folder is free for a sweep without transfer


def test_functions_are_not_known_to_grow_with_friction() -> None:
    with pytest.raises(ModelError, match="varied by its own parameters"):
        swept(lambda friction: builtin_scene("stack"), {"friction": [0.5]}, transfer=0.01)


def test_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    given = ["sweep", "single-block", "--vary", "friction=0.5:0.8:4", "--transfer", "0.01"]
    assert run(given) == 0
    assert "2 of them bounded by others, not solved" in capsys.readouterr().out


@pytest.mark.exhaustive
@settings(max_examples=150, deadline=None)
@given(scenes(), st.integers(0, 10**6))
def test_no_contradiction(scene: Scene, seed: int) -> None:
    """Piles, walls, arches and panels, whether they stand or not."""
    source = np.random.default_rng(seed)
    friction = source.uniform(0.1, 0.9, 5).tolist()
    grid = {"friction": friction, "cohesion": [0.0, float(source.uniform(0, 2))]}
    assert_agree(swept(scene, grid, transfer=0.2), swept(scene, grid))
