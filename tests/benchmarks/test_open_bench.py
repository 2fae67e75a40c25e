"""The open bench: every record against its schema, its source, its scene and its values."""

from __future__ import annotations

import hashlib
import json
import sys
import zipfile
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from benchmarks.__main__ import main as benchmarks
from benchmarks.baselines import V1, V2, N, ScipyLinprog, program
from benchmarks.bench import archive, case, outside, prove, running
from benchmarks.bench.case import HOME, ROOT, STATES, cases, described, holds
from benchmarks.stability.truths import rocking

from cvxlimit import Status, solve
from cvxlimit.masonry import single_block

CASES = {each.name: each for each in cases()}
SCHEMA = json.loads((HOME / "record.schema.json").read_text("utf-8"))
CHOSEN = "block-[rcs][orl][cui]*s"
QUICK = ("block-rocks", "stack-leans", "semicircle-thickness-40", "bond-upright-loaded", "locked-1")
CLOSE = 1e-6
"""Of a block's weight: the certificate's own corrections of kept forces are smaller."""
ALIKE = 1e-9
"""Relative: what rounding may change in a closed form."""


def test_there_are_enough_cases_and_files_of_no_other() -> None:
    assert len(CASES) >= 40
    kept = {path.name for path in (HOME / "scenes").glob("*.json")}
    assert kept == {each.scene_file(role).name for each in CASES.values() for role in each.roles}


@pytest.mark.parametrize("name", CASES)
def test_record(name: str) -> None:
    """Schema; scene file and its checksum; sources as they stand; sentences; values in brackets."""
    record = CASES[name].record()
    jsonschema.validate(record, SCHEMA)
    parameter = record["quantity"]["parameter"]
    assert set(record["scenes"]) == ({""} if parameter is None else set(parameter))
    for scene in record["scenes"].values():
        content = (ROOT / scene["file"]).read_bytes()
        assert hashlib.sha256(content).hexdigest() == scene["sha256"]
    assert list(record["brackets"]) == record["models"], "python -m benchmarks bench prove"
    assert record["values"] or record["note"]
    for value in record["values"]:
        told = {key: said for key, said in value.items() if key != "interval"}
        assert value == described(**{**told, "source": value["source"]["key"]})
        bracket = record["brackets"][value["model"]]
        if value["discrepancy"] == "agrees":
            assert holds(value, bracket), (value["text"], bracket)
        else:
            assert value["why"].endswith("."), value["text"]
        if value["kind"] == "test" and value["discrepancy"] == "missing physics":
            assert bracket["upper"] < value["interval"][0], "no tension, and yet above the test"


@pytest.mark.parametrize("name", CASES)
def test_brackets_of_one_case_are_in_order(name: str) -> None:
    """More strength, no lower factor: the safe reading below the cone, that below the octagon."""
    brackets = CASES[name].record()["brackets"]
    for low, high in (
        ("independent", "conic"), ("independent", "signed"), ("independent", "paper"),
        ("conic", "octagon"), ("conic", "parabolic"), ("conic", "exact"),
    ):  # fmt: skip
        if low in brackets and high in brackets:
            lower, upper = brackets[low]["lower"], brackets[high]["upper"]
            assert lower is None or upper is None or lower <= upper * (1 + 1e-9)


def test_a_case_is_added_and_proved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the README does it: a scene, and a value with its source."""
    for folder in ("SCENES", "RECORDS"):
        monkeypatch.setattr(case, folder, tmp_path / folder.lower())
        (tmp_path / folder.lower()).mkdir()
    value = {"text": "0.05", "source": "statics"}
    title = "block of friction 0.05: slides at mu"
    added = case.add("block-on-ice", title, single_block(friction=0.05), [value])
    assert [each.name for each in cases()] == ["block-on-ice"]
    assert len(list(prove.all_of("*", "conic"))) == 1
    record = added.record()
    jsonschema.validate(record, SCHEMA)
    assert holds(record["values"][0], record["brackets"]["conic"])


@pytest.mark.parametrize("name", QUICK)
def test_brackets_are_proved_again(name: str) -> None:
    """Anew and as kept they meet."""
    each = CASES[name]
    kept, anew = each.record()["brackets"]["conic"], prove.proved(each, "conic")
    assert anew["lower"] is not None
    assert anew["lower"] <= kept["upper"]
    assert kept["lower"] <= anew["upper"]


def test_least_thickness_is_proved_from_both_sides() -> None:
    each = CASES["semicircle-thickness-40"]
    assert solve(each.read("falls")).status is Status.DEAD_LOAD_UNSTABLE
    assert solve(each.read("stands")).lower > 0.0


@pytest.mark.parametrize("path", sorted(STATES.glob("*.npz")), ids=lambda path: path.stem)
def test_best_states_carry_what_their_records_say(path: Path) -> None:
    """Equilibrium at the lower bound, pressure centres inside, and no more than Coulomb's shear."""
    name, model = path.stem.rsplit(".", 1)
    each = CASES[name]
    with np.load(path) as kept:
        forces, factor = kept["forces"], float(kept["load_factor"])
    bracket = each.record()["brackets"][model]
    assert bracket["lower"] * (1 - 1e-9) <= each.factor * factor <= bracket["upper"]
    data = program(each.read())
    contacts, few = data.contacts, CLOSE * np.abs(data.dead).max()
    left = data.equilibrium @ forces.ravel() + data.dead + factor * data.live
    assert np.abs(left).max() <= few
    shear = np.hypot(forces[:, V1], forces[:, V2])
    assert (shear - contacts.friction * forces[:, N]).max() <= few
    assert max((rocking(contacts, j) @ f).max() for j, f in enumerate(forces)) <= few


def test_tools_answer_and_a_refusal_is_an_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plain cone on two cases, resumed; then a scene that it cannot read."""
    monkeypatch.setattr(running, "RESULTS", tmp_path / "results.jsonl")
    told: list[str] = []
    for _ in range(2):
        told += running.run("plain CVXPY", CHOSEN)
    rows = {row["case"]: row for row in running.rows()}
    assert len(told) == len(rows) == 3
    assert rows["block-rocks"]["load_factor"] == pytest.approx(0.2, rel=1e-5)
    assert rows["block-crushes"]["answer"] == "refused"
    assert "compressive_strength" in rows["block-crushes"]["reason"]
    marks = {
        each.name: mark
        for each, _, _, answers in running.judged(CHOSEN)
        for _, mark in answers.values()
    }
    assert marks == {"block-rocks": "inside", "block-slides": "inside", "block-crushes": "-"}


def test_a_runner_that_crashes_or_takes_too_long_is_a_row(tmp_path: Path) -> None:
    """And the scenes after it are asked again."""
    scenes = [tmp_path / "one", tmp_path / "two"]
    crash, sleep = "raise OSError('gone')", "import time; time.sleep(60)"
    found = list(running.answers([sys.executable, "-c", crash], scenes, 30.0))
    assert [scene for scene, _ in found] == scenes
    assert {row["reason"] for _, row in found} == {"OSError: gone"}
    ((_, row),) = running.answers([sys.executable, "-c", sleep], scenes[:1], 0.5)
    assert row["reason"] == "no answer in 0.5 s"


def test_archive_has_checksums_and_is_solved_from_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "problems.zip"
    list(archive.write(path, most=150, hard=1))
    monkeypatch.setattr(outside, "ANSWERS", tmp_path / "answers.jsonl")
    answers = [row for row, is_new in outside.answers(path, 60.0) if is_new]
    assert {outside.verdict(row) for row in answers if row["group"] == "growing"} == {"inside"}
    assert [row["group"] for row in answers].count("hard") == 2
    assert {row["solver"] for row in answers} == {"HiGHS", "Clarabel"}
    assert [row for row, _ in outside.answers(path, 60.0)] == answers
    assert "| arch.cbf | 21 |" in "".join(outside.solve(path))
    said = Path(f"{path}.sha256").read_text("utf-8").split()[0]
    assert hashlib.sha256(path.read_bytes()).hexdigest() == said
    with zipfile.ZipFile(path) as files:
        assert {"index.csv", "SHA256SUMS", "arch.cbf", "arch.mps"} <= set(files.namelist())
        first = files.read("arch.cbf")
    list(archive.write(path, most=25, hard=0))
    with zipfile.ZipFile(path) as files:
        assert files.read("arch.mps").startswith(b"* cvxlimit")
        assert files.read("arch.cbf").splitlines()[2:] == first.splitlines()[2:]


@pytest.mark.parametrize(
    ("optimum", "objective", "status", "said"),
    [
        ("-0.25 -0.24", -0.25, "Optimal", "inside"),
        ("-0.25 -0.24", -0.23, "Solved", "wrong"),
        ("-0.25 -0.24", -0.23, "AlmostSolved", "inaccurate, as it says"),
        ("-0.25 -0.24", None, "PrimalInfeasible", "wrong"),
        ("-0.25 -0.24", None, "Time limit reached", "without an answer"),
        ("no optimum: live load does no harm", None, "DualInfeasible", "inside"),
        ("no optimum: live load does no harm", None, "Time limit reached", "without an answer"),
        ("no optimum: live load does no harm", -1e9, "Optimal", "wrong"),
    ],
)
def test_what_other_solvers_say(
    optimum: str, objective: float | None, status: str, said: str
) -> None:
    row = {"optimum": optimum, "objective": objective, "status": status}
    assert outside.verdict(row) == said


def test_octagons_about_cones_reach_from_the_cone_to_the_one_through_their_corners() -> None:
    """A block that slides: between mu and mu / cos(22.5 degrees)."""
    found = prove.proved(CASES["block-slides-askew"], "vertex-octagon")
    assert found["lower"] == pytest.approx(0.3, rel=ALIKE)
    assert found["upper"] == pytest.approx(0.3 / np.cos(np.pi / 8), rel=ALIKE)


def test_a_tool_does_not_tell_what_is_nearer_than_its_reach() -> None:
    each = CASES["semicircle-thickness-40"]
    bracket = each.record()["brackets"]["vertex-octagon"]
    marks = [running.verdict({"answer": "stands"}, each, "falls", bracket, r) for r in (0.0, 0.01)]
    assert marks == ["WRONG", "too near to tell"]


def test_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert benchmarks(["bench", "list", "--case", "overhang-*"]) == 0
    assert "overhang-harmonic-4" in capsys.readouterr().out


def test_digits_say_how_far_a_value_is_trusted() -> None:
    value = described("0.643", "hybridfem")
    assert value["interval"] == pytest.approx([0.6425, 0.6435])


@pytest.mark.parametrize("name", ["toppling-slope", "toppling-slope-rough"])
def test_the_rock_slope_in_units_of_its_own_weight_by_another_program(name: str) -> None:
    """In kN and m HiGHS calls 0.0966684 optimal for 0.0967613, or gives no answer."""
    scene = CASES[name].read()
    weight = float(np.abs(scene.dead_forces).sum())
    found = ScipyLinprog().measure(scene.in_units(scene.units, 0.1, 1.0 / weight))
    bracket = CASES[name].record()["brackets"]["octagon"]
    assert found.load_factor == pytest.approx(bracket["lower"], rel=1e-7)  # its own tolerance
