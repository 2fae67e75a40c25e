"""What is stored is known by what it is: no folder answers for another structure."""

from __future__ import annotations

import importlib
import json
import linecache
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cvxlimit import Block, Certified, Load, Method, Scene, builtin_scene, sweep
from cvxlimit.errors import InputError, ModelError
from cvxlimit.extensions.studies import rows as rows_module
from cvxlimit.extensions.studies.identity import digest
from cvxlimit.masonry import arch
from cvxlimit.solution import Status
from cvxlimit.studies import read_sweep
from cvxlimit.surfaces import Condition, Norm, Rocking
from cvxlimit.surfaces.cones import Conic
from helpers import Share

FRICTION = {"friction": [0.3, 0.4]}


def quiet(*given: Any, **options: Any) -> pd.DataFrame:
    return sweep(*given, progress=False, **options)


def stone(friction: float = 0.9, height: float = 2.0, density: float = 20.0) -> Scene:
    ground = Block.box("ground", (-5, -5, -1), (5, 5, 0))
    block = Block.box("stone", (0, 0, 0), (1, 0.5, height), density)
    return Scene([ground, block], ["ground"], Load(acceleration=(1, 0, 0)), friction=friction)


class Weighed(Share):
    """The same share, in the weight of the norm."""

    def conditions(self, contacts):
        slip = Norm({"V1": 1}, {"V2": 1}, weight=1.0 / self.share)
        return [Condition([slip], {"N": contacts.friction})]


class Blunt(Conic):
    """A cone of one's own: the circle, with its reach."""

    def __init__(self, reach: float) -> None:
        object.__setattr__(self, "reach", reach)

    def gauge_of(self, rows):
        return super().gauge_of(rows) / self.reach

    def polar_gauge_of(self, rows):
        return super().polar_gauge_of(rows) * self.reach

    def rows_of(self, size):
        linear, cone = super().rows_of(size)
        return linear, cone * np.append(self.reach, np.ones(size))


def defined(source: str, name: str) -> Callable[..., Any]:
    """A function as a notebook defines it: its source is in no file."""
    names: dict[str, Any] = {"stone": stone, "__name__": "__main__"}
    exec(source, names)
    found: Callable[..., Any] = names[name]
    return found


EDITED = [
    defined(f"def build(friction):\n    return stone({share} * friction)", "build")
    for share in (1.0, 0.5)
]


def scaled(share: float) -> Callable[[float], Scene]:
    def build(friction: float) -> Scene:
        return stone(share * friction)

    return build


PAIRS: dict[str, tuple[Any, Any]] = {
    "an edited function": (EDITED[0], EDITED[1]),
    "a lambda": (lambda friction: stone(friction), lambda friction: stone(0.5 * friction)),
    "a closure": (scaled(1.0), scaled(0.5)),
    "a partial function": (
        partial(lambda friction, share: stone(share * friction), share=1.0),
        partial(lambda friction, share: stone(share * friction), share=0.5),
    ),
    "geometry": (lambda friction: stone(friction), lambda friction: stone(friction, height=8.0)),
    "density": (
        lambda friction: stone(friction).with_cohesion(2.0),
        lambda friction: stone(friction, density=40.0).with_cohesion(2.0),
    ),
    "strength": (
        lambda friction: stone(friction),
        lambda friction: stone(friction).with_joints(contact_friction={("ground", "stone"): 0.1}),
    ),
}


@pytest.mark.parametrize("what", PAIRS)
@pytest.mark.exhaustive_cases("geometry", "density")
def test_another_structure_of_the_same_name(what: str, tmp_path: Path) -> None:
    folder = tmp_path / "rows"
    for build in (*PAIRS[what], PAIRS[what][0]):
        expected = quiet(build, FRICTION)["load_factor"].to_numpy()
        found = quiet(build, FRICTION, path=folder)["load_factor"].to_numpy()
        assert found == pytest.approx(expected, rel=1e-6)
        assert read_sweep(folder)["load_factor"].to_numpy() == pytest.approx(expected, rel=1e-6)
    assert len(read_sweep(folder, every=True)) == 4


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ([Rocking(), Share(1.0)], [Rocking(), Share(0.5)]),
        ([Rocking(), Weighed(1.0)], [Rocking(), Weighed(0.5)]),
    ],
)
def test_surfaces_are_their_numbers(first, second, tmp_path: Path) -> None:
    """A stone slides at the share of its friction."""
    for surface, share in ((first, 1.0), (second, 0.5), (first, 1.0)):
        table = quiet(lambda friction: stone(friction), FRICTION, surface=surface)
        found = quiet(stone, FRICTION, surface=surface, path=tmp_path / type(second[1]).__name__)
        assert found["load_factor"].to_numpy() == pytest.approx(table["load_factor"].to_numpy())
        assert table["load_factor"].to_numpy() == pytest.approx([0.3 * share, 0.4 * share])


def test_cones_are_their_content() -> None:
    assert digest(Blunt(1.0), "cone") == digest(Blunt(1.0), "cone")
    assert digest(Blunt(1.0), "cone") != digest(Blunt(0.9), "cone")


def test_a_partial_function_of_the_package(tmp_path: Path) -> None:
    found = [
        quiet(partial(arch, thickness_ratio=ratio), {"friction": [0.6]}, path=tmp_path / "s")
        for ratio in (0.15, 0.2)
    ]
    exact = [quiet(arch, {"thickness_ratio": [ratio], "friction": [0.6]}) for ratio in (0.15, 0.2)]
    for table, other in zip(found, exact, strict=True):
        assert table["load_factor"][0] == pytest.approx(other["load_factor"][0], rel=1e-6)
    assert found[0]["load_factor"][0] != pytest.approx(found[1]["load_factor"][0], rel=0.1)


@pytest.mark.parametrize("change", ["columns", "numbers", "a global"])
def test_measures_are_their_code(change: str, tmp_path: Path) -> None:
    text = "def measured(s):\n    return {'a': LEAST * s.blocks}\nLEAST = 1"
    other = {
        "columns": text.replace("'a'", "'b'"),
        "numbers": text.replace("s.blocks", "s.blocks * 3"),
        "a global": text.replace("LEAST = 1", "LEAST = 2"),
    }[change]
    for source in (text, other, text):
        measure = defined(source, "measured")
        table = quiet(stone, FRICTION, measure=measure, path=tmp_path / "s")
        expected = quiet(stone, FRICTION, measure=measure)
        columns = [name for name in expected.columns if name != "seconds"]
        assert list(table.columns) == list(expected.columns)
        pd.testing.assert_frame_equal(table[columns], expected[columns], check_dtype=False)


@pytest.mark.parametrize(
    "options",
    [
        {"surface": "octagon"}, {"tolerance": 1e-3}, {"model": "full"}, {"method": "certified"},
        {"method": "certified", "moments": "signed"}, {"method": Certified(budget=1.0)},
        {"ladder": ["CLARABEL"]},
    ],
)  # fmt: skip
def test_every_setting_counts(options: dict[str, Any]) -> None:
    plain = rows_module.Study(stone).to_be_stored().asked
    assert rows_module.Study(stone, options).to_be_stored().asked != plain
    assert rows_module.Study(stone, {"surface": "conic"}).to_be_stored().asked == plain


def test_a_version_counts(monkeypatch) -> None:
    from cvxlimit.extensions.studies import identity

    before = identity.row_identity("", stone(), {})
    monkeypatch.setattr(identity, "__version__", "0.0.1")
    assert identity.row_identity("", stone(), {}) != before


class Kept(Method):
    """A method of one's own with a state that nobody can read."""

    name = "kept"

    def __init__(self) -> None:
        object.__setattr__(self, "lock", threading.Lock())

    def steps(self, run):
        yield
        return Status.NOT_CERTIFIED


def remembering() -> Callable[..., Any]:
    lines = open(os.devnull)  # noqa: SIM115
    return lambda s: {"a": lines.name}


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"method": Kept()}, "option 'method' cannot be stored: it rests on a _thread.lock"),
        ({"measure": remembering()}, "measure cannot be stored: it rests on a _io.TextIOWrapper"),
        ({"measure": (lambda x: lambda s: {"a": next(x)})(i for i in range(9))},
         "measure cannot be stored: it rests on a generator"),
    ],
)  # fmt: skip
def test_what_cannot_be_told_apart_is_refused(options, what: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=what) as caught:
        quiet(stone, FRICTION, path=tmp_path / "s", **options)
    assert "run without a path" in str(caught.value)
    assert not (tmp_path / "s").exists()


MINE = """
from dataclasses import dataclass
from functools import partial
import numpy as np
LEAST = {"x", "y", "z"}
@dataclass(frozen=True)
class Made:
    share: float = 0.5
    def twice(self):
        return {"a", "b"} | LEAST, np.mean(self.share)
def outer(share):
    return lambda s: {"a": Made(share).twice(), "b": {"x", "y"}}
VALUE = [outer(0.5), Made, Made(0.3), partial(outer, share=1.0), np.eye(3), LEAST, Made().twice]
"""


def test_a_digest_is_the_same_in_another_process(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "mine_of_the_test.py").write_text(MINE, "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    here = digest(importlib.import_module("mine_of_the_test").VALUE, "value")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from mine_of_the_test import VALUE\n"
        "from cvxlimit.extensions.studies.identity import digest\n"
        "sys.stdout.write(digest(VALUE, 'value'))"
    )
    env = {**os.environ, "PYTHONHASHSEED": "7"}
    there = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, env=env)
    assert there.stdout.decode() == here


def test_a_module_of_ones_own_counts_with_its_text(tmp_path: Path, monkeypatch) -> None:
    """What a function calls may be elsewhere: a module that is edited makes it another one."""
    monkeypatch.syspath_prepend(tmp_path)
    found, file = set(), tmp_path / "helper_of_the_test.py"
    for number in (1, 2):
        file.write_text(f"def two():\n    return {number}\n", "utf-8")
        shutil.rmtree(tmp_path / "__pycache__", ignore_errors=True)
        sys.modules.pop(file.stem, None)
        importlib.invalidate_caches()
        source = f"import {file.stem} as helper\ndef f(s):\n    return {{'a': helper.two()}}"
        found.add(digest(defined(source, "f"), "measure"))
    assert len(found) == 2


def test_names_places_and_comments_do_not_count() -> None:
    first = defined("def f(s):\n    return {'a': 1}", "f")
    second = defined("# edited\n\n\ndef f(s):\n    return {'a': 1}  # more", "f")
    linecache.clearcache()
    assert digest(first, "f") == digest(second, "f")


# The folder


def numbered(folder: Path) -> list[Path]:
    return sorted(folder.glob("part-*.parquet"))


@pytest.mark.parametrize("about", ["no version", "another version", "an older name"])
def test_folders_of_other_versions_are_refused(about: str, tmp_path: Path) -> None:
    folder = tmp_path / "s"
    quiet(stone, FRICTION, path=folder)
    note = folder / "_sweep.json"
    said = json.loads(note.read_text("utf-8"))
    said.pop("version") if about == "no version" else said.update(version="0.1.0")
    note.write_text(json.dumps(said), "utf-8")
    if about == "an older name":
        note.rename(folder / "sweep.json")
    with pytest.raises(InputError, match=r"holds rows of .* take another folder, or delete this"):
        quiet(stone, FRICTION, path=folder)
    assert read_sweep(folder)["friction"].tolist() == FRICTION["friction"]


def spoiled(folder: Path, how: str) -> Path:
    part, note = numbered(folder)[0], folder / "_sweep.json"
    if how == "half a part":
        part.write_bytes(part.read_bytes()[:200])
    elif how == "an empty part":
        part.write_bytes(b"")
    elif how == "another table":
        pd.DataFrame({"x": [1]}).to_parquet(part)
    elif how == "a list":
        note.write_text("[1, 2]", "utf-8")
        return note
    elif how == "half a note":
        note.write_text(note.read_text("utf-8")[:20], "utf-8")
        return note
    else:
        note.write_bytes(b"\xff\xfe")
        return note
    return part


@pytest.mark.parametrize(
    "how",
    ["half a part", "an empty part", "another table", "a list", "half a note", "no text at all"],
)
def test_what_is_damaged_is_named_with_the_cure(how: str, tmp_path: Path, capsys) -> None:
    from cvxlimit.cli.main import run

    folder, given = tmp_path / "s", ["sweep", "single-block", "--vary", "friction=0.3,0.4"]
    assert run([*given, "--output", str(folder)]) == 0
    damaged = spoiled(folder, how)
    again = partial(quiet, builtin_scene("single-block"), FRICTION, path=folder, surface="conic")
    for use in (partial(read_sweep, folder), again):
        with pytest.raises(InputError) as caught:
            use()
        assert str(damaged) in str(caught.value)
        assert "delete" in str(caught.value)
    capsys.readouterr()
    assert run([*given, "--output", str(folder)]) == 2
    said = capsys.readouterr().err
    assert damaged.name in said
    assert "internal error" not in said
    if damaged.suffix == ".parquet":  # the cure
        damaged.unlink()
        assert len(again()) == 2


def test_leftovers_of_a_killed_process_do_no_harm(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    folder.mkdir()
    for name in (".cvxlimit-1234.tmp", "_proof-000000-abc.parquet"):
        (folder / name).write_bytes(b"half")
    assert len(quiet(stone, FRICTION, path=folder)) == 2
    assert quiet(stone, FRICTION, path=folder).attrs["found"] == 2


def begun(folder: str, share: float) -> list[float]:
    while time.time() % 0.5 > 0.02:  # both at once
        pass
    found = quiet(partial(stone, height=2.0), {"friction": [share, 0.3]}, path=folder)
    return list(found["load_factor"])


def test_two_processes_start_a_folder_at_once(tmp_path: Path) -> None:
    with ProcessPoolExecutor(2) as pool:
        for trial in range(4):
            folder = str(tmp_path / f"s{trial}")
            tasks = [pool.submit(begun, folder, share) for share in (0.2, 0.1)]
            assert [task.result()[0] for task in tasks] == pytest.approx([0.2, 0.1], rel=1e-5)
            assert sorted(read_sweep(folder)["friction"]) == [0.1, 0.2, 0.3]
            assert not list(Path(folder).glob(".*"))


SWEPT = """\
import sys, time
from tests.extensions.studies.test_stored import quiet, stone
def slowly(friction):
    time.sleep(0.02)
    return stone(friction)
grid = {"friction": [0.1 + 0.01 * k for k in range(%d)]}
sys.stdout.write("begun\\n"); sys.stdout.flush()
table = quiet(slowly, grid, path=sys.argv[1])
sys.stdout.write(f"{len(table)} {table.attrs['found']}\\n")
"""


@pytest.mark.exhaustive
def test_killed_at_random_and_resumed(tmp_path: Path) -> None:
    """No kill leaves anything that the next call stumbles over, and rows stay right."""
    number, chance = 40, random.Random(4)
    root = str(Path(__file__).parents[3])
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([root, str(Path(root, "tests", "kit"))])}

    def started() -> subprocess.Popen[str]:
        command = [sys.executable, "-c", SWEPT % number, str(tmp_path / "s")]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env)

    for _ in range(6):
        process = started()
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        time.sleep(chance.uniform(0.0, 1.6))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
    last = started()
    said, _ = last.communicate(timeout=300)
    assert said.splitlines()[-1].split()[0] == str(number)
    assert last.returncode == 0
    table = read_sweep(tmp_path / "s").sort_values("friction")
    expected = np.minimum(table["friction"], 0.5)
    assert table["load_factor"].to_numpy() == pytest.approx(expected.to_numpy(), rel=1e-5)
    assert len(table) == number
