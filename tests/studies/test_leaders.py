"""Large grids: where the solver starts tells nothing about what rows say."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from cvxlimit import builtin_scene, sweep
from cvxlimit.solvers import settings_for
from cvxlimit.solvers.interior.iteration import Point
from cvxlimit.studies import draws
from cvxlimit.studies.leaders import Leaders
from cvxlimit.studies.rows import Structures, Study

SCENE = builtin_scene("arch")
LADDER = [settings_for("BLOCKWISE", 3e-6)]  # so loose that brackets show where it started
ROWS = [
    {"friction": friction, "direction": direction}
    for friction in np.linspace(0.4, 0.8, 8).tolist()
    for direction in (0.0, 10.0, 20.0, 30.0, 40.0)
]
SAMPLE = ROWS[3::7]


def swept(rows: list[dict[str, float]], **options) -> pd.DataFrame:
    table = sweep(SCENE, rows, progress=False, ladder=LADDER, **options)
    return table.drop(columns="seconds")


def some(rows: list[dict[str, float]]) -> pd.DataFrame:
    """Some rows of the large grid, as any worker that gets them would solve them."""
    study, known = Study(SCENE, {"ladder": LADDER}).led(ROWS), Structures()
    assert study.leaders is not None
    table = pd.DataFrame([{**row, **study.row(row, known)} for row in rows])
    assert known.is_led
    return table.drop(columns="seconds")


def assert_alike(found: pd.DataFrame, alone: pd.DataFrame) -> None:
    """Both certified to 1e-5: of two brackets of one number each holds a part of the other."""
    assert (found["status"] == "certified").all()
    assert (found["lower"] <= alone["upper"]).all()
    assert (alone["lower"] <= found["upper"]).all()
    assert found["load_factor"].to_list() == pytest.approx(alone["load_factor"].to_list(), rel=1e-5)


def assert_same(found: pd.DataFrame, other: pd.DataFrame) -> None:
    """From the same start: rounding, which hangs on where arrays lie in memory, changed one row in
    five by more than 1e-9 and one of forty by up to 4e-8, never half of them; with leaders of each
    worker's own all rows changed, in the median by 2e-7."""
    assert_alike(found, other)
    figures = ["load_factor", "lower", "upper"]
    change = np.abs(found[figures].to_numpy() / other[figures].to_numpy() - 1.0)
    assert np.median(change.max(axis=1)) <= 1e-8


def test_rows_of_a_large_grid_are_those_of_small_ones() -> None:
    """Fewer than 40 rows start cold."""
    assert_alike(some(SAMPLE), swept(SAMPLE))


def test_rows_do_not_depend_on_those_before() -> None:
    """Whatever the worker solved before: nothing, or others in another order."""
    together = some(SAMPLE)
    assert_same(some(SAMPLE[2:5]), together[2:5].reset_index(drop=True))
    assert_same(some(SAMPLE[::-1]), together[::-1].reset_index(drop=True))


@pytest.mark.exhaustive
def test_neither_processes_nor_stored_rows_matter(tmp_path) -> None:
    here = swept(ROWS)
    with ProcessPoolExecutor(2) as pool:
        assert_same(swept(ROWS, executor=pool), here)
    swept(ROWS, path=tmp_path / "s")
    for part in sorted((tmp_path / "s").glob("part-*.parquet"))[1:]:
        part.unlink()
    assert_same(swept(ROWS, path=tmp_path / "s"), here)
    assert_alike(here, pd.concat([swept(ROWS[:20]), swept(ROWS[20:])], ignore_index=True))


@pytest.mark.exhaustive
@pytest.mark.parametrize("wrong", ["noise", "nan", "huge", "another scene's"])
def test_wrong_starts_cost_time_never_truth(wrong: str, monkeypatch) -> None:
    mean, noise = Point.mean, np.random.default_rng(0)

    def spoilt(points, weights):
        at = mean(points, weights)
        parts = {
            "noise": lambda v: np.abs(v).mean() * noise.standard_normal(len(v)),
            "nan": lambda v: np.where(np.arange(len(v)) == 1, np.nan, v),
            "huge": lambda v: 1e12 * v,
            "another scene's": lambda v: v[:-1],
        }
        return Point(*(parts[wrong](v) for v in (at.x, at.y, at.z, at.s)))

    monkeypatch.setattr(Point, "mean", spoilt)
    assert_alike(some(SAMPLE), swept(SAMPLE))


def test_leaders_that_fail_fail_alone() -> None:
    """The corners of a grid lead, and frictions below zero there are refused."""
    rows = [{**row, "friction": row["friction"] if row["friction"] > 0.4 else -0.1} for row in ROWS]
    study = Study(SCENE, {"ladder": LADDER}).led(rows)
    assert study.leaders is not None
    assert min(row["friction"] for row in study.leaders.rows) < 0.0
    known, good = Structures(), rows[6::8]
    refused = study.row(rows[0], known)["error"]
    assert refused == "friction of the scene must be finite and not negative, got -0.1"
    assert_alike(pd.DataFrame([study.row(row, known) for row in good]), swept(good))


class TestLeaders:
    def test_they_follow_from_the_grid_not_from_its_order(self) -> None:
        leaders, others = Leaders.of(ROWS), Leaders.of(ROWS[::-1])
        assert leaders is not None
        assert others is not None
        assert leaders.rows == others.rows
        places = [leaders.place(row) for row in leaders.rows]
        assert np.array_equal(places, leaders.places)
        assert np.min(leaders.places) == 0.0
        assert np.max(leaders.places) == 1.0

    def test_none_of_draws_texts_and_small_grids(self) -> None:
        uniform = {"friction": stats.uniform(0.4, 0.4), "tilt": stats.uniform(0.0, 3.0)}
        assert Leaders.of(draws(uniform, 100, seed=1).to_dict("records")) is None
        assert Leaders.of([{"friction": 0.01 * i, "live": None} for i in range(60)]) is None
        assert Leaders.of([{"friction": float("nan"), "tilt": i} for i in range(60)]) is None
        assert Leaders.of(ROWS[:39]) is None
        assert Leaders.of(ROWS[:1] * 50) is not None

    def test_only_where_all_variations_are_one_convex_problem(self) -> None:
        sizes = [{"size": 1.0 + 0.1 * i} for i in range(50)]
        assert Study(SCENE).led(sizes).leaders is None
        assert Study(SCENE, {"method": "fixed-point"}).led(ROWS).leaders is None
        assert Study(lambda friction, direction: SCENE).led(ROWS).leaders is None
        assert Study(SCENE, {"tolerance": 1e-4}).led(ROWS).leaders is not None
