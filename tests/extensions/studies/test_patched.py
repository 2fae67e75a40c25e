"""Rows of one structure are one problem with other numbers: what they say is what separate solves
say, whoever solved which before."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvxlimit import Load, Scene, builtin_scene, prove, solve, sweep
from cvxlimit.extensions.studies.patched import nearest_first
from cvxlimit.masonry import panel, single_block
from cvxlimit.studies import varied
from helpers import scenes


def rows_of(seed: int, number: int = 4) -> list[dict[str, float]]:
    """Strengths, among them none and infinite ones, weights and directions, in no order."""
    rng = np.random.default_rng(seed)
    return [
        {
            "friction": float(rng.uniform(0.2, 0.9)),
            "cohesion": float(rng.choice([0.0, rng.uniform(0.5, 5.0)])),
            "compressive_strength": float(rng.choice([np.inf, rng.uniform(200.0, 2000.0)])),
            "density": float(rng.uniform(0.5, 2.0)),
            "direction": float(rng.uniform(0.0, 360.0)),
        }
        for _ in range(number)
    ]


def overlaps(found: pd.DataFrame, other: pd.DataFrame) -> None:
    """Of two brackets of one number each holds a part of the other; widths are what was asked."""
    assert found["status"].to_list() == other["status"].to_list()
    assert (found["error"] == other["error"]).all()
    known = (found["status"] == "certified").to_numpy()
    found, other = found[known], other[known]
    assert (found["lower"] <= other["upper"]).all()
    assert (other["lower"] <= found["upper"]).all()
    for each in (found, other):
        assert (each["gap"] <= 1e-5).all()


def alone(scene: Scene, rows: list[dict[str, Any]], **options: Any) -> pd.DataFrame:
    def answers() -> Iterator[dict[str, Any]]:
        for row in rows:
            own = solve(varied(scene, **row), **options)
            yield {"lower": own.lower, "upper": own.upper, "gap": own.gap,
                   "status": str(own.status), "error": ""}  # fmt: skip

    return pd.DataFrame(answers())


@settings(max_examples=4)
@given(scenes(), st.integers(0, 2**32 - 1))
def test_rows_are_what_separate_solves_are(scene: Scene, seed: int) -> None:
    rows = rows_of(seed)
    found = sweep(scene, rows, progress=False)
    overlaps(found, alone(scene, rows))
    order = np.random.default_rng(seed).permutation(len(rows))
    other = sweep(scene, [rows[i] for i in order], progress=False)
    overlaps(other, found.iloc[order].reset_index(drop=True))


@pytest.mark.parametrize("surface", ["octagon", "parabolic", "16-gon-inscribed"])
def test_surfaces(surface: str) -> None:
    scene, rows = panel(0.2, 2), rows_of(1, 3)
    overlaps(
        sweep(scene, rows, surface=surface, progress=False), alone(scene, rows, surface=surface)
    )


def test_loads_given_as_such_and_friction_of_its_own() -> None:
    """Of a stone on the ground, by hand: friction times the load on the joint, over the push."""
    scene = single_block(friction=0.3)
    block = scene.blocks[scene.free[0]]
    pressed = Load(forces={block.id: (0.0, 0.0, -2.0 * block.weight, 0.0, 0.0, 0.0)})
    pushes = [Load(acceleration=(a, 0.0, 0.0)) for a in (1.0, 2.0)]
    found = sweep(scene, {"dead": [scene.dead, pressed], "live": pushes}, progress=False)
    assert found["load_factor"].to_list() == pytest.approx([0.3, 0.15, 0.6, 0.3], rel=1e-5)


@pytest.mark.exhaustive
def test_neither_processes_nor_stored_rows_matter(tmp_path: Path) -> None:
    """Two workers, and a folder that was interrupted; every stored row is proved from its forces
    and mechanism."""
    scene, rows = builtin_scene("tuff-wall"), rows_of(7, 16)
    here = sweep(scene, rows, progress=False)
    overlaps(here, alone(scene, rows))
    with ProcessPoolExecutor(2) as pool:
        overlaps(sweep(scene, rows, executor=pool, progress=False), here)
        folder = tmp_path / "s"
        sweep(scene, rows[:10], path=folder, progress=False)
        whole = sweep(scene, rows, path=folder, executor=pool, progress=False)
    assert whole.attrs["found"] == 10
    overlaps(whole, here)
    assert prove(folder).is_proved


class TestOrder:
    def test_draws_follow_the_shorter_way(self) -> None:
        """Of numbers along a line it is the line."""
        values = np.random.default_rng(3).uniform(size=50).tolist()
        found = nearest_first({str(i): {"friction": v} for i, v in enumerate(values)})
        assert [values[int(name)] for name in found] == sorted(values)

    def test_grids_stay(self) -> None:
        rows = {f"{f}, {d}": {"friction": f, "direction": d} for f in range(5) for d in range(4)}
        assert nearest_first(rows) == list(rows)

    @given(
        st.lists(
            st.fixed_dictionaries(
                {"a": st.one_of(st.floats(allow_nan=False), st.text(), st.none()),
                 "b": st.integers(-3, 3)}
            ),
            max_size=30,
        )
    )  # fmt: skip
    def test_every_row_once(self, rows: list[dict[str, Any]]) -> None:
        names = {str(i): row for i, row in enumerate(rows)}
        assert sorted(nearest_first(names)) == sorted(names)
