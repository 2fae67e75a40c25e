"""Sweeps and random draws: closed forms, and nothing lost on the way."""

from __future__ import annotations

import sys
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from cvxlimit import Block, Load, Scene, builtin_scene, solve, sweep
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError, ModelError
from cvxlimit.extensions.studies.rows import Structures
from cvxlimit.io import export, import_geometry
from cvxlimit.studies import draws, read_sweep, varied

LENGTH, HEIGHT = 1.0, 2.0


def stone(friction: float = 0.9, height: float = HEIGHT, **more) -> Scene:
    """A block on the ground, pushed along x: rocks at length / height, slides at friction."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    block = Block.box("stone", (0, 0, 0), (LENGTH, 0.5, height), density=20.0)
    push = Load(acceleration=(1, 0, 0))
    return Scene([ground, block], ["ground"], push, friction=friction, name="stone", **more)


def plain(friction: float) -> Scene:
    return stone(friction)


def quiet(*given, **options) -> pd.DataFrame:
    return sweep(*given, progress=False, **options)


def without_times(table: pd.DataFrame) -> pd.DataFrame:
    return table.drop(columns="seconds")


class TestVaried:
    def test_friction_and_rocking(self) -> None:
        table = quiet(stone(), {"friction": [0.2, 0.4, 0.6, 0.8]})
        assert table["load_factor"].to_list() == pytest.approx([0.2, 0.4, 0.5, 0.5], rel=1e-5)
        assert (table["lower"] <= table["load_factor"]).all()
        assert (table["gap"] < 1e-5).all()
        assert set(table["status"]) == {"certified"}

    def test_tilt(self) -> None:
        """About the foot: (L cos t - H sin t) = alpha H, the live load staying with the ground."""
        degrees = [0.0, 5.0, 10.0]
        t = np.radians(degrees)
        expected = (LENGTH * np.cos(t) - HEIGHT * np.sin(t)) / HEIGHT
        found = quiet(stone(), {"tilt": degrees})["load_factor"]
        assert found.to_list() == pytest.approx(expected.tolist(), rel=1e-5)

    def test_direction(self) -> None:
        """Pushed across its width of 0.5 it rocks at 0.25; the other way round at 0.5."""
        found = quiet(stone(), {"direction": [0, 90, 180, -90]})["load_factor"]
        assert found.to_list() == pytest.approx([0.5, 0.25, 0.5, 0.25], rel=1e-5)

    def test_size_matters_with_cohesion(self) -> None:
        """Sliding at friction + cohesion x area / weight, and weight per area grows with size."""
        scene = stone(friction=0.1, height=0.5, cohesion=1.0)
        found = quiet(scene, {"size": [1.0, 2.0, 4.0]})["load_factor"]
        expected = [0.1 + 1.0 / (20.0 * 0.5 * size) for size in (1.0, 2.0, 4.0)]
        assert found.to_list() == pytest.approx(expected, rel=1e-5)

    def test_density_scales_forces_not_factors(self) -> None:
        heavy = varied(stone(), density=2.0)
        assert heavy.total_weight == pytest.approx(2 * stone().total_weight)
        assert solve(heavy).load_factor == pytest.approx(0.5, rel=1e-5)

    def test_contacts_are_kept_unless_the_size_changes(self) -> None:
        scene = stone()
        len(scene.contacts)
        for changes in ({"friction": 0.3}, {"density": 2.0}, {"tilt": 3.0}, {"direction": 5.0}):
            assert "_detection" in vars(varied(scene, **changes))
        assert "_detection" not in vars(varied(scene, size=2.0))

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"friction": -0.1}, "friction of the scene must be finite and not negative"),
            ({"density": 0.0}, "factor on all densities must be above 0"),
            ({"size": -1.0}, "size, a factor on all lengths, must be above 0"),
            ({"tilt": float("nan")}, "tilt must be finite"),
            ({"direction": "x"}, "direction must be 1 numbers"),
        ],
    )
    def test_what_cannot_be(self, changes: dict, message: str) -> None:
        with pytest.raises(InputError, match=message):
            varied(stone(), **changes)

    def test_nothing_to_tilt_or_turn(self) -> None:
        pulled = stone().with_live(Load(forces={"stone": (1, 0, 0, 0, 0, 0)}))
        with pytest.raises(InputError, match="no horizontal acceleration in its live load"):
            varied(pulled, tilt=1.0)
        with pytest.raises(InputError, match="direction turns the live load's acceleration"):
            varied(pulled, direction=1.0)


class TestTable:
    @pytest.mark.exhaustive
    def test_it_is_what_single_calls_give(self) -> None:
        """With structures shared, or anew for every call: the same problem, both proved."""
        grid = {"friction": [0.35, 0.5, 0.65], "direction": [0.0, 30.0]}
        table = quiet(builtin_scene("tuff-wall"), grid)
        for row in table.itertuples():
            scene = varied(
                builtin_scene("tuff-wall"), friction=row.friction, direction=row.direction
            )
            solution = solve(scene)
            assert row.lower <= solution.upper
            assert solution.lower <= row.upper
            assert row.load_factor == pytest.approx(solution.load_factor, rel=1e-5)
            assert row.status == solution.status == "certified"

    def test_friction_of_their_own_and_cohesion_are_not_lost(self) -> None:
        rough = stone(height=0.5, contact_friction={("ground", "stone"): 0.35})
        found = quiet(rough, {"friction": [0.1, 0.2]})["load_factor"]
        assert found.to_list() == pytest.approx([0.35, 0.35], rel=1e-5)
        glued = quiet(stone(height=0.5), {"friction": [0.1, 0.3], "cohesion": [0.0, 1.0]})
        assert glued["load_factor"].to_list() == pytest.approx([0.1, 0.2, 0.3, 0.4], rel=1e-5)

    def test_geometries_are_searched_once(self, monkeypatch) -> None:
        from cvxlimit.scene import scene as module

        calls = []
        detect = module.detect
        monkeypatch.setattr(module, "detect", lambda *given: calls.append(1) or detect(*given))
        quiet(stone, {"height": [1.0, 2.0], "friction": [0.3, 0.4, 0.5]})
        assert len(calls) == 2

    def test_shared_mechanics_are_those_of_the_scene(self) -> None:
        known = Structures()
        known.mechanics(stone(0.9))
        shared = known.mechanics(stone(0.3))
        assert shared.contacts.friction.tolist() == [0.3]
        assert shared.scene.friction == 0.3
        assert known.mechanics(stone(0.3, height=1.0)).contacts.area[0] == pytest.approx(0.5)

    def test_scenes_of_another_geometry_do_not_share(self) -> None:
        with pytest.raises(InputError, match="differ in their blocks, supports"):
            stone(height=1.0).sharing_contacts_of(stone())

    def test_failures_are_rows_and_the_others_go_on(self) -> None:
        def odd(friction: float, height: float) -> Scene:
            if height > 5.0:
                raise ZeroDivisionError("no such stone")
            return stone(friction, height)

        table = quiet(odd, {"friction": [-0.1, 0.3], "height": [2.0, 9.0]})
        assert table["error"].tolist() == [
            "friction of the scene must be finite and not negative, got -0.1",
            "ZeroDivisionError: no such stone",
            "",
            "ZeroDivisionError: no such stone",
        ]
        assert table["load_factor"].isna().tolist() == [True, True, False, True]
        assert table["load_factor"][2] == pytest.approx(0.3, rel=1e-5)

    def test_no_answer_is_a_status_not_an_error(self) -> None:
        table = quiet(stone(), {"tilt": [0.0, 40.0]})
        assert table["status"].tolist() == ["certified", "dead load cannot stand"]
        assert table["error"].tolist() == ["", ""]

    def test_options_for_all_and_options_in_the_grid(self) -> None:
        table = quiet(
            builtin_scene("tuff-wall"),
            {"surface": ["conic", "octagon", "octagon-inscribed"]},
            tolerance=1e-4,
        )
        conic, outside, inside = table["load_factor"]
        assert inside < conic < outside
        assert table.attrs["options"] == "tolerance=0.0001"

    def test_measures_are_columns(self) -> None:
        table = quiet(
            stone(),
            {"friction": [0.3, 0.9]},
            measure=lambda s: {"state": s.to_dataframe()["state"].iloc[0]},
        )
        assert table["state"].tolist() == ["slides", "opens"]

    def test_grids_of_every_kind(self) -> None:
        rows = [{"friction": 0.3, "tilt": 0}, {"friction": 0.4, "tilt": 0}]
        grids = [rows, pd.DataFrame(rows, index=[7, 8]), {"friction": (0.3, 0.4), "tilt": 0}]
        tables = [quiet(stone(), grid) for grid in grids]
        assert all(without_times(t).equals(without_times(tables[0])) for t in tables)

    def test_a_variation_that_comes_twice_is_there_twice(self) -> None:
        assert len(quiet(stone(), {"friction": [0.3, 0.3]})) == 2

    @pytest.mark.parametrize(
        ("scenes", "grid", "options", "kind", "message"),
        [
            (
                stone(),
                {"frction": [1]},
                {},
                InputError,
                r"no parameter 'frction' \(did you mean 'friction'\?\); its parameters are",
            ),
            (plain, {"mu": [1]}, {}, InputError, "'plain' has no parameter 'mu'; .*are friction"),
            (plain, {"surface": ["conic"]}, {}, InputError, "missing a required argument: 'frict"),
            (
                stone(),
                {"friction": [0.5, "a"]},
                {},
                InputError,
                "friction must be a number, got 'a'",
            ),
            (stone(), {"surface": ["octogon"]}, {}, ModelError, "surface must be .*'octogon'"),
            (stone(), {"method": ["certifed"]}, {}, ModelError, "one of convex.*got 'certifed'"),
            (
                stone(),
                {"ladder": ["MOSEC"]},
                {},
                ModelError,
                "no solver 'MOSEC'; did you mean MOSEK",
            ),
            (stone(), {"tilt": [1]}, {"ladder": "MOSEC"}, ModelError, "did you mean MOSEK"),
            (stone(), {"friction": []}, {}, InputError, "'friction' has no values"),
            (stone(), {}, {}, InputError, "the grid has no variation"),
            (stone(), 5, {}, InputError, "grid must be a mapping"),
            (stone(), [{"tilt": 1}, {"size": 1}], {}, InputError, "the same parameters"),
            (stone(), {"tilt": [1]}, {"surfce": 1}, ModelError, "solve has no option 'surfce'"),
            (stone(), {"tilt": [1]}, {"executor": 2}, InputError, "executor must be a concurrent"),
            (stone(), {"tilt": [1]}, {"measure": 2}, ModelError, "measure must be a function"),
            ("arch", {"tilt": [1]}, {}, InputError, "scenes must be a Scene or a function"),
            (lambda seconds: stone(), {"seconds": [1]}, {}, InputError, "must not be called 'sec"),
        ],
    )
    def test_refusals(self, scenes, grid, options, kind, message) -> None:
        with pytest.raises(kind, match=message):
            quiet(scenes, grid, **options)


class TestStore:
    GRID = {"friction": [0.2, 0.3, 0.4], "height": [1.0, 2.0]}  # noqa: RUF012

    def test_what_is_stored_is_not_solved_again(self, tmp_path: Path, monkeypatch) -> None:
        from cvxlimit.extensions.studies import rows

        calls, answer = [], rows._answer

        def answered(known, scene, options):
            calls.append((scene.friction, scene.blocks[1].vertices[:, 2].max()))
            return answer(known, scene, options)

        monkeypatch.setattr(rows, "_answer", answered)
        counted = stone
        first = quiet(counted, self.GRID, path=tmp_path / "s")
        assert len(calls) == 6
        assert quiet(counted, self.GRID, path=tmp_path / "s").equals(first)
        assert len(calls) == 6
        larger = {"friction": [0.2, 0.3, 0.4, 0.5], "height": [1, 2]}
        assert len(quiet(counted, larger, path=tmp_path / "s")) == 8
        assert calls[6:] == [(0.5, 1), (0.5, 2)]
        assert len(read_sweep(tmp_path / "s")) == 8

    def test_pandas_reads_the_folder(self, tmp_path: Path) -> None:
        table = quiet(stone(), {"friction": [0.2, 0.3]}, path=tmp_path / "s")
        found = pd.read_parquet(tmp_path / "s").sort_values("friction", ignore_index=True)
        assert found["load_factor"].equals(table["load_factor"])

    def test_interrupted_it_keeps_what_was_done(self, tmp_path: Path) -> None:
        broken = [True]

        def interrupted(friction: float, height: float) -> Scene:
            if friction == 0.4 and broken[0]:
                raise KeyboardInterrupt
            return stone(friction, height)

        table = quiet(interrupted, self.GRID, path=tmp_path / "s")
        assert table.attrs["is_interrupted"]
        assert table["friction"].tolist() == [0.2, 0.2, 0.3, 0.3]
        assert read_sweep(tmp_path / "s")["load_factor"].equals(table["load_factor"])
        broken[0] = False
        whole = quiet(interrupted, self.GRID, path=tmp_path / "s")
        assert not whole.attrs["is_interrupted"]
        assert whole.iloc[:4].equals(table)
        assert len(whole) == 6

    def test_another_sweep_is_not_mixed_in(self, tmp_path: Path) -> None:
        quiet(stone(), {"friction": [0.2]}, path=tmp_path / "s")
        with pytest.raises(InputError, match="holds a sweep of another scene"):
            quiet(stone(height=1.5), {"friction": [0.2]}, path=tmp_path / "s")
        with pytest.raises(InputError, match="holds a sweep of another options"):
            quiet(stone(), {"friction": [0.2]}, path=tmp_path / "s", surface="octagon")
        (tmp_path / "t").mkdir()
        (tmp_path / "t" / "thesis.txt").write_text("mine")
        with pytest.raises(InputError, match="holds something else than a sweep"):
            quiet(stone(), {"friction": [0.2]}, path=tmp_path / "t")
        with pytest.raises(InputError, match="holds no sweep"):
            read_sweep(tmp_path / "t")

    def test_what_parquet_cannot_hold_is_refused_before_solving(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="only numbers and texts can be stored"):
            quiet(stone(), {"live": [Load(acceleration=(1, 0, 0))]}, path=tmp_path / "s")
        assert len(quiet(stone(), {"live": [Load(acceleration=(1, 0, 0))]})) == 1

    def test_missing_pyarrow_names_the_command(self, tmp_path: Path, monkeypatch) -> None:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
        with pytest.raises(ModelError, match=r'need pyarrow: pip install "cvxlimit\[frames\]"'):
            quiet(stone(), {"friction": [0.2]}, path=tmp_path / "s")


class TestProcesses:
    def test_the_same_table_with_a_function_of_this_test(self) -> None:
        """By value: the function below exists nowhere but in this call."""
        grid = {"friction": [0.2, 0.3, 0.4, -1.0], "height": [1.0, 2.0]}
        scenes = lambda friction, height: stone(friction, height)  # noqa: E731
        here = without_times(quiet(scenes, grid))
        with ProcessPoolExecutor(2) as pool:
            assert without_times(quiet(scenes, grid, executor=pool)).equals(here)

    @pytest.mark.filterwarnings("ignore")  # of distributed, tornado and asyncio, about themselves
    def test_the_same_table_from_a_cluster(self) -> None:
        """Workers are threads here; processes, one of them killed: test_killed_worker.py."""
        distributed = pytest.importorskip("distributed")
        grid = {"friction": [0.2, 0.3, -1.0], "tilt": [0.0, 5.0]}
        here = without_times(quiet(stone(), grid))
        local = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
        )
        with local, distributed.Client(local) as client:
            assert without_times(quiet(stone(), grid, executor=client)).equals(here)

    def test_a_process_that_dies_leaves_what_was_stored(self, tmp_path: Path) -> None:
        class Dying(Executor):
            """Solves two tasks, then breaks like a pool whose process was killed."""

            done = 0

            def submit(self, work, /, *given, **more):
                future: Future = Future()
                self.done += 1
                if self.done > 2:
                    future.set_exception(BrokenProcessPool("a process was killed"))
                else:
                    future.set_result(work(*given))
                return future

        grid = {"friction": [0.2, 0.3, 0.4, 0.5]}
        with pytest.raises(ModelError, match="what is stored in a path is kept"):
            quiet(stone(), grid, executor=Dying(), path=tmp_path / "s")
        assert len(read_sweep(tmp_path / "s")) == 2
        assert len(quiet(stone(), grid, path=tmp_path / "s")) == 4

    def test_what_cannot_travel_is_said(self) -> None:
        import threading

        lock = threading.Lock()
        with ProcessPoolExecutor(1) as pool, pytest.raises(ModelError, match="cannot be sent"):
            quiet(lambda friction: lock and stone(friction), {"friction": [0.2]}, executor=pool)


class TestDraws:
    def test_the_same_for_the_same_seed_whatever_else_is_drawn(self) -> None:
        normal = stats.norm(0.7, 0.05)
        one = draws({"friction": normal}, 50, seed=3)
        two = draws({"density": stats.uniform(0.9, 0.2), "friction": normal}, 50, seed=3)
        assert one["friction"].equals(two["friction"])
        assert not one["friction"].equals(draws({"friction": normal}, 50, seed=4)["friction"])

    def test_they_follow_the_distribution(self) -> None:
        drawn = draws({"friction": stats.norm(0.7, 0.05)}, 2000, seed=1)["friction"]
        assert stats.kstest(drawn, stats.norm(0.7, 0.05).cdf).pvalue > 1e-3

    def test_functions_and_lists(self) -> None:
        table = draws({"seed": lambda rng, n: rng.integers(9, size=n), "bond": ["a", "b"]}, 40, 1)
        assert set(table["bond"]) == {"a", "b"}
        assert table["seed"].between(0, 8).all()

    @pytest.mark.parametrize("wrong", [0.7, "normal", lambda rng, n: [1.0], None])
    def test_no_distribution(self, wrong) -> None:
        with pytest.raises(InputError, match="'friction'"):
            draws({"friction": wrong}, 10, seed=1)


def test_a_wall_of_ones_own_in_eight_lines(tmp_path: Path, monkeypatch) -> None:
    """From import to a certified factor and a mechanism to turn."""
    script = """\
import cvxlimit
from cvxlimit.masonry import running_bond, wall
mine = wall(running_bond(3, 4), unit=(0.4, 0.2, 0.2), density=20.0, friction=0.6)
solution = cvxlimit.solve(mine)
solution.plot("page", "wall.html")
"""
    assert len(script.splitlines()) <= 8
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(script, names)  # as a user would run it
    assert names["solution"].status == "certified"
    assert "21 of 31 moving joints slide" in names["solution"].note
    assert "requestAnimationFrame" in (tmp_path / "wall.html").read_text("utf-8")


class TestImported:
    """A block from a file of triangles, its numbers rounded: what is drawn at random is known."""

    @staticmethod
    def written(path: Path, height: float) -> Path:
        export(stone(height=height), path)
        lines = []
        for line in path.read_text("utf-8").splitlines():
            kind, *words = line.split() or [""]
            if kind == "v":
                lines.append("v " + " ".join(f"{float(w):.4f}" for w in words))
            elif kind == "f":
                lines += [f"f {words[0]} {b} {c}" for b, c in pairwise(words[1:])]
            else:
                lines.append(line)
        path.write_text("\n".join(lines), "utf-8")
        return path

    @staticmethod
    def read(path: Path, friction: float = 0.9, density: float = 20.0) -> Scene:
        return import_geometry(
            path, length_unit="m", up="z", density=density, friction=friction, supports="ground",
            live=(1, 0, 0),
        ).scene  # fmt: skip

    def test_friction_density_and_size_of_an_imported_mesh(self, tmp_path: Path) -> None:
        scene = self.read(self.written(tmp_path / "stone.obj", HEIGHT))
        assert len(scene.blocks[-1].faces) == 12  # triangles, two to a side
        unknown = {
            "friction": stats.uniform(0.2, 0.6),
            "density": stats.lognorm(0.1),
            "size": stats.uniform(0.5, 1.0),
        }
        sample = draws(unknown, 12, seed=4)
        table = quiet(scene, sample)
        expected = np.minimum(sample["friction"], LENGTH / HEIGHT)
        assert table["load_factor"].to_numpy() == pytest.approx(expected.to_numpy(), rel=1e-5)
        assert (table["status"] == "certified").all()

    def test_geometry_drawn_at_random_through_files(self, tmp_path: Path) -> None:
        def measured(friction: float, height: float) -> Scene:
            return self.read(self.written(tmp_path / f"{height:.6f}.obj", height), friction)

        sample = draws({"friction": stats.uniform(0.3, 0.4), "height": stats.norm(2, 0.2)}, 8, 7)
        table = quiet(measured, sample)
        height = sample["height"].round(4)  # as in the file
        expected = np.minimum(sample["friction"], LENGTH / height)
        assert table["load_factor"].to_numpy() == pytest.approx(expected.to_numpy(), rel=1e-5)


class TestCommand:
    """cvxlimit sweep: the table of :func:`sweep`, exit codes as for solve."""

    def test_all_solved_stored_and_not_solved_again(self, tmp_path: Path, capsys) -> None:
        given = ["sweep", "single-block", "--vary", "friction=0.2:0.6:3", "--vary", "tilt=0,5"]
        folder = tmp_path / "rows"
        assert run([*given, "--output", str(folder)]) == 0
        out = capsys.readouterr().out
        assert f"6 variations: 6 certified; all rows in {folder}" in out
        stored = read_sweep(folder)
        here = quiet(builtin_scene("single-block"), {"friction": [0.2, 0.4, 0.6], "tilt": [0, 5]})
        assert stored["load_factor"].to_numpy() == pytest.approx(here["load_factor"].to_numpy())
        before = sorted(folder.glob("*.parquet"))
        assert run([*given, "--output", str(folder)]) == 0
        assert f"all rows in {folder}, where 6 of 6 were found" in capsys.readouterr().out
        assert sorted(folder.glob("*.parquet")) == before  # nothing was added

    def test_values_that_differ_are_printed_apart_and_sliding_has_a_column(self, capsys) -> None:
        """A block slides, with a share of dilatancy of 1, or rocks: then there is no column."""
        given = "friction=0.2,0.2000000001"
        assert run(["sweep", "single-block", "--vary", given]) == 0
        head, *rows = capsys.readouterr().out.splitlines()[:3]
        assert [row.split()[0] for row in rows] == ["0.2", "0.2000000001"]
        at = head.index("dilatancy")
        assert {float(row[at : at + 9]) for row in rows} == {1.0}
        assert run(["sweep", "single-block", "--vary", "friction=0.6,0.7"]) == 0
        assert "dilatancy" not in capsys.readouterr().out
        table = quiet(builtin_scene("single-block"), {"friction": [0.2, 0.6]})
        assert table["dilatancy"].tolist() == pytest.approx([1.0, 0.0], abs=1e-5)
        assert max(map(len, table["note"])) < 200

    def test_failures_are_rows_and_the_code_says_so(self, capsys) -> None:
        code = run(["sweep", "single-block", "--vary", "friction=0.5,-1"])
        said = capsys.readouterr()
        assert code == 4
        assert "2 variations: 1 certified, 1 failed" in said.out
        assert said.err.startswith(
            "cvxlimit: 1 of 2 variations have no certified answer; the first"
        )
        assert said.err.count("\n") == 1

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            (["--vary", "frction=1"], "no parameter 'frction' (did you mean 'friction'?)"),
            (["--vary", "friction=a,b"], "friction must be a number, got 'a'"),
            (["--vary", "ladder=MOSEC"], "there is no solver 'MOSEC'; did you mean MOSEK"),
            (["--vary", "surface=conic", "--surface", "octagon"], "--surface and --vary surface"),
            (["--vary", "friction"], "NAME=VALUES is meant"),
            (["--vary", "friction=0:1"], "FIRST:LAST:NUMBER is meant"),
            (
                ["--vary", "tilt=1", "--vary", "tilt=2"],
                "'tilt' is given already: give it once; NAME=VALUES",
            ),
            (["--vary", "tilt=1", "--workers", "0"], "--workers must be"),
            ([], "Missing option"),
        ],
    )
    def test_refusals(self, options: list[str], message: str, capsys) -> None:
        assert run(["sweep", "single-block", *options]) == 2
        said = capsys.readouterr().err
        assert message in said
        assert said.count("\n") == 1
