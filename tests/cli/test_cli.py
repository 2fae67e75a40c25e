"""The command line: exit codes, one-line errors, what is shown, files that appear or do not."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import stat
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cvxlimit
from cvxlimit import (
    Block,
    Load,
    Scene,
    Solution,
    Status,
    Vehicle,
    builtin_scene,
    envelope,
    passive,
    solve,
)
from cvxlimit.cli import main as cli
from cvxlimit.cli import report, solving
from cvxlimit.cli.options import Command, typer_command
from cvxlimit.cli.shell import show
from cvxlimit.errors import ModelError, SolverError
from cvxlimit.io import read_result, read_scene, write_scene
from cvxlimit.masonry import BUILTIN, Arch, bridge
from cvxlimit.methods.settlement import settlement
from cvxlimit.methods.solving import TABLE
from cvxlimit.plotting import PICTURES
from cvxlimit.readings.named import MOMENTS
from cvxlimit.solution.bracket import Bracket
from helpers import assert_certified
from malformed_scenes import MALFORMED

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run in an empty folder; returns exit code, stdout and stderr."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.delenv("CVXLIMIT_DEBUG", raising=False)

    def call(*arguments: str) -> tuple[int, str, str]:
        code = cli.run(arguments)
        captured = capsys.readouterr()
        return int(code), captured.out, captured.err

    return call


def assert_refused(outcome: tuple[int, str, str], phrase: str, code: int = 2) -> None:
    """One clear line on stderr, nothing on stdout, no file left behind."""
    assert outcome[0] == code, outcome
    assert outcome[1] == ""
    assert re.fullmatch(r"cvxlimit: [^\n]+\n", outcome[2]), outcome[2]
    assert outcome[2][:-1].isprintable()
    assert phrase in outcome[2]
    assert "Traceback" not in outcome[2]
    assert not list(Path().iterdir())


def without_times(text: str) -> str:
    return re.sub(r"\d+\.\d{3}(?!\d)", "T", text)


def tower(live: tuple[float, float, float] = (1, 0, 0), shift: float = 0.0) -> Scene:
    """A block on the ground, moved sideways over its edge if ``shift`` is large."""
    ground = Block.box("ground", (-1, -1, -1), (1, 2, 0))
    block = Block.box("tower [red]", (shift, 0, 0), (shift + 1, 1, 4), density=20.0)
    return Scene([ground, block], ["ground"], Load(acceleration=live), name="tower [bold]")


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "cvxlimit", *arguments]


# --- solved -------------------------------------------------------------------------------------


def test_solved_scene(run: Run) -> None:
    code, brief, err = run("solve", "tuff-wall")
    assert code == 0
    assert err == ""
    rows = dict(re.split(r"\s{2,}", line, maxsplit=1) for line in brief.splitlines())
    assert list(rows) == ["load factor", "sliding", "report"]
    shown, inside, ended = re.split(r"\s{2,}", rows["load factor"])
    assert float(shown) == pytest.approx(0.423056, abs=5e-6)
    assert ended == "certified"
    out = run("solve", "tuff-wall", "-v")[1]
    assert out.startswith(brief)
    lines = out.partition("\n\n")[2].partition("\n\n")[0].splitlines()
    rows = dict(re.split(r"\s{2,}", line, maxsplit=1) for line in lines)
    assert rows["scene"] == "tuff-wall (built-in)"
    assert rows["size"] == "54 free blocks x 146 contacts"
    assert "proved" in rows["basis"]
    assert re.search(r"[A-Z]+.* \(\d+ solves?\)$", rows["solver"])
    assert re.findall(r"[a-z]+(?= \d)", rows["time in s"])[-1] == "total"
    ends = re.match(r"\[(\S+), (\S+)\], relative width (\S+)$", rows["bracket"])
    assert ends is not None
    assert float(ends[1]) <= float(shown) <= float(ends[2])
    assert rows["bracket"].startswith(inside)
    assert float(ends[3]) <= 1e-5


def test_summary_is_deterministic_apart_from_times(run: Run) -> None:
    first, second = (run("solve", "arch", "--surface", "octagon", "-v")[1] for _ in range(2))
    assert without_times(first) == without_times(second)
    assert "model        octagon surface\n" in first


def test_result_file_is_the_solution(run: Run) -> None:
    code, out, _ = run("solve", "stack", "--json", "out.json")
    result = read_result("out.json")
    scene = builtin_scene("stack")
    assert code == 0
    assert "written      out.json\n" in out
    assert (result.scene_name, result.status) == ("stack", Status.CERTIFIED)
    assert (result.blocks, result.contacts) == (5, 5)
    assert result.forces is not None
    assert result.mechanism is not None
    assert result.forces.shape == (len(scene.contacts), 6)
    assert list(result.mechanism) == [scene.blocks[i].id for i in scene.free]
    work = sum(
        float(force @ result.mechanism[scene.blocks[i].id])
        for i, force in zip(scene.free, scene.live_forces, strict=True)
    )
    assert work == pytest.approx(1.0, abs=1e-9)
    shown = re.search(r"load factor  (\S+)", out)
    assert shown is not None
    assert float(shown[1]) == pytest.approx(result.load_factor, rel=1e-6)


def test_a_result_file_on_stdout_is_all_that_is_there(run: Run) -> None:
    code, out, err = run("solve", "stack", "--json", "-")
    Path("out.json").write_text(out, "utf-8")
    assert (code, read_result("out.json").scene_name) == (0, "stack")
    assert "]  certified\n" in err
    assert not Path("-").exists()


def test_one_solver_by_name(run: Run) -> None:
    code, out, _ = run("solve", "stack", "--solver", "clarabel", "-v")
    assert code == 0
    assert re.search(r"^solver +CLARABEL \(", out, re.MULTILINE)


def test_an_unknown_solver(run: Run) -> None:
    outcome = run("solve", "stack", "--solver", "CLARABLE")
    assert_refused(outcome, "there is no solver 'CLARABLE'; did you mean CLARABEL")


def test_what_a_solver_prints_is_no_part_of_the_result(capfd: pytest.CaptureFixture[str]) -> None:
    """HiGHS introduces itself on stdout from native code."""
    assert cli.run(["solve", "arch", "--solver", "HIGHS", "--json", "-"]) == 0
    assert json.loads(capfd.readouterr().out)["scene"] == "arch"


def test_nor_is_what_one_prints_while_supports_settle(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Native code writes to the stream's number, past Python."""

    def talking(*args: Any, **kwargs: Any) -> Any:
        os.write(1, b"a solver introduces itself\n")
        return settlement(*args, **kwargs)

    monkeypatch.setattr(solving, "settlement", talking)
    asked = ["settle", "s10-panel", "--support", "ground", "--direction=0,0,-1", "--json", "-"]
    assert cli.run(asked) == 0
    printed = capfd.readouterr()
    assert json.loads(printed.out)["scene"] == "s10-panel"
    assert "a solver introduces itself" in printed.err


def test_result_file_equals_what_solve_returned(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    returned: list[Solution] = []
    solve = solving.solve

    def keep(*args: object, **kwargs: object) -> Solution:
        returned.append(solve(*args, **kwargs))  # type: ignore[arg-type]
        return returned[-1]

    monkeypatch.setattr(solving, "solve", keep)
    run("solve", "single-block", "--json", "out.json")
    expected, result = returned[0], read_result("out.json")
    for name in (
        "scene_name", "surface", "load_factor", "lower", "upper", "status", "history", "note",
        "versions",
    ):  # fmt: skip
        assert getattr(result, name) == getattr(expected, name), name
    assert dict(result.seconds) == dict(expected.seconds)
    np.testing.assert_array_equal(result.forces, expected.forces)
    assert result.mechanism is not None
    assert expected.mechanism is not None
    for block, rates in expected.mechanism.items():
        np.testing.assert_array_equal(result.mechanism[block], rates)


@pytest.mark.parametrize(
    ("name", "start", "files"),
    [
        ("m.png", b"\x89PNG\r\n", ["m.png"]),
        ("m.html", b"<!", ["m.html"]),
        ("m.vtu", b"<?xml", ["m.vtu", "m-contacts.vtu"]),
        ("M.PNG", b"\x89PNG\r\n", ["M.PNG"]),
    ],
)
def test_pictures(run: Run, name: str, start: bytes, files: list[str]) -> None:
    code, out, _ = run("solve", "single-block", "--plot", name)
    assert code == 0
    assert Path(name).read_bytes().lower().startswith(start.lower())
    assert sorted(p.name for p in Path().iterdir()) == sorted(files)
    assert [line.split()[1] for line in out.splitlines() if line.startswith("written")] == files


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--surface 16-gon", {"surface": "16-gon"}),
        ("--method fixed-point --moments signed --surface octagon",
         {"interaction": "fixed-point", "moments": "signed", "surface": "octagon"}),
        ("--method certified --moments paper",
         {"interaction": "certified", "moments": "paper"}),
        ("--surface parabolic", {"torsion_shear": "parabolic"}),
        ("--method zero-dilatancy", {"flow": "zero-dilatancy"}),
        ("--model full", {"model": ()}),
    ],
)  # fmt: skip
def test_the_result_is_of_what_was_asked_for(
    run: Run, options: str, said: dict[str, object]
) -> None:
    """One block rocks at 0.4 by every model; the fixed point stops at a change of 1e-2."""
    code, _, err = run("solve", "single-block", *options.split(), "--tolerance", "1e-2",
                         "--json", "o.json")  # fmt: skip
    assert (code, err) == (0, "")
    result = read_result("o.json")
    assert {name: getattr(result, name) for name in said} == said
    assert result.load_factor == pytest.approx(0.4, rel=2e-2)


@pytest.mark.parametrize(
    ("options", "phrase"),
    [
        ("--moments signed", "moments does nothing for method 'convex', got 'signed'"),
        ("--moments independent", "moments does nothing for method 'convex'"),
        ("--method exact --moments paper", "moments does nothing for method 'exact'"),
        ("--method exact --model least", "model 'least' does nothing for method 'exact'"),
        ("--branching-seconds 3", "--branching-seconds and --workers go with --method certified"),
        ("--workers 2", "--branching-seconds and --workers go with --method certified"),
        ("--method certified --workers 2 --branching-seconds 0", "--workers 2 does nothing"),
        *(
            (
                f"--method zero-dilatancy --seed 3 {more}",
                "--branching-seconds and --workers go with --method certified",
            )
            for more in ("--workers 2", "--branching-seconds 3")
        ),
    ],
)
def test_options_without_effect_are_refused(run: Run, options: str, phrase: str) -> None:
    assert_refused(run("solve", "single-block", *options.split()), phrase)


FALLS = (
    ("solve",),
    *(("solve", "--method", name) for name in TABLE if name != "convex"),
    ("settle", "--support", "ground", "--direction=0,0,-1"),
    ("sweep", "--vary", "friction=0.5,0.6"),
)


@pytest.mark.parametrize("command", FALLS, ids=" ".join)
def test_a_dead_load_that_cannot_stand_has_exit_code_3(run: Run, command: tuple[str, ...]) -> None:
    """The tower's weight is beside its base: it falls by itself."""
    write_scene(tower(shift=0.8), "tower.json")
    code, _, err = run(command[0], "tower.json", *command[1:])
    assert code == 3
    assert "dead load cannot stand" in err
    assert err.count("\n") == 1


def test_scene_file_and_names_that_look_like_markup(run: Run) -> None:
    Path("[red]").mkdir()
    write_scene(tower(), "[red]/to[bold]wer.json")
    code, out, err = run("solve", "[red]/to[bold]wer.json", "-v", "--json", "[red]/o[i].json")
    assert code == 0
    assert "MarkupError" not in err
    assert "tower [bold] ([red]/to[bold]wer.json)\n" in out
    assert "written      [red]/o[i].json\n" in out
    assert Path("[red]/o[i].json").exists()


def test_control_characters_in_names_do_not_reach_the_terminal(run: Run) -> None:
    write_scene(tower().with_name("a\x1b[31m\nb"), "s.json")
    code, out, _ = run("solve", "s.json", "-v")
    assert code == 0
    assert r"scene      a\x1b[31m\nb (s.json)" in out
    assert "\x1b" not in out


def test_builtin_name_wins_over_a_file_and_a_path_does_not(run: Run) -> None:
    write_scene(tower(), "stack")
    assert "scene      stack (built-in)" in run("solve", "stack", "-v")[1]
    assert "scene      tower [bold] (./stack)" in run("solve", "./stack", "-v")[1]


def test_explain(run: Run) -> None:
    assert "planar" not in run("explain", "arch")[1]  # where it does not pay
    code, out, err = run("explain", "arch", "--surface", "octagon", "--model", "least")
    assert (code, err) == (0, "")
    assert out.startswith("arch: 20 free blocks x 21 contacts\n")
    assert "\nplanar             64         60         84          0\n" in out
    assert "\nsolver: " in out
    assert "planar" not in run("explain", "arch", "--model", "full")[1]
    for arguments in (("explain", "arch"), ("solve", "arch")):
        assert_refused(run(*arguments, "--model", "half"), "model must be one of auto, full")


def test_scenes_lists_all(run: Run) -> None:
    code, out, err = run("scenes")
    assert (code, err) == (0, "")
    lines = out.splitlines()[1:]
    assert [line.split()[0] for line in lines] == list(BUILTIN)
    assert re.search(r"^tuff-wall +54 +146 +\S", out, re.MULTILINE)
    assert all(scene.description in out for scene in BUILTIN.values())


def test_version(run: Run) -> None:
    assert run("--version") == (0, f"cvxlimit {cvxlimit.__version__}\n", "")


@pytest.mark.parametrize(
    "arguments", [(), ("--help",), ("-h",), ("solve", "-h"), ("scenes", "--help")]
)
def test_help(run: Run, arguments: tuple[str, ...]) -> None:
    code, out, err = run(*arguments)
    assert (code, err) == (0, "")
    assert "Usage: cvxlimit" in out


COMMANDS = [command.name for command in cli.app.registered_commands]


@pytest.mark.parametrize("argument", ["--version", "--help", "-h"])
def test_help_and_version_load_nothing_heavy(argument: str) -> None:
    code = (
        "import sys\nfrom cvxlimit.cli import main\n"
        f"assert main.run([{argument!r}]) == 0\n"
        "heavy = {'cvxpy', 'scipy', 'numpy', 'pandas', 'matplotlib'} & {*sys.modules}\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_the_list_of_commands_says_what_each_says_itself(run: Run) -> None:
    """Its lines are read from files that are not imported."""
    for name, place in cli.COMMANDS.places.items():
        said = cli._summary(place)
        itself = run(name, "--help")[1]
        assert " ".join(said.split())[:40] in " ".join(itself.split()), name


@pytest.mark.parametrize("command", [name for name in COMMANDS if name])
def test_help_is_short_and_breaks_no_word(
    run: Run, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below 60 lines on a terminal of 80 columns; every choice can be read as it is written."""
    monkeypatch.setenv("COLUMNS", "80")
    out = run(command, "--help")[1]
    assert len(out.splitlines()) < 60
    assert max(map(len, out.splitlines())) <= 80
    if command == "solve":
        words = set(re.findall(r"[\w-]+", out))
        # examples of pages run in this process may have added pictures of their own
        pictures = [
            name for name, draw in PICTURES.items() if draw.__module__.startswith("cvxlimit.")
        ]
        assert words >= {*TABLE, *MOMENTS, *pictures, "octagon-inscribed", "--branching-seconds"}
        assert re.findall(r"─ (\w+) ─", out) == [
            "Arguments",
            "Options",
            "Model",
            "Output",
            "Effort",
        ]


def test_several_pictures_of_one_solution(run: Run) -> None:
    pictures = ["--plot", "forces:f.png", "--plot", "m.html", "--plot", "thrust:t.svg"]
    code, out, err = run("solve", "single-block", *pictures)
    assert (code, err) == (0, "")
    assert re.findall(r"^written +(\S+)$", out, re.MULTILINE) == ["f.png", "m.html", "t.svg"]
    assert "<svg" in Path("t.svg").read_text("utf-8")


def test_quiet_leaves_files_and_errors(run: Run) -> None:
    assert run("solve", "stack", "--quiet", "--json", "o.json") == (0, "", "")
    assert read_result("o.json").status is Status.CERTIFIED
    code, out, err = run("solve", "arhc", "-q")
    assert (code, out) == (2, "")
    assert "did you mean 'arch'?" in err


def test_verbose_tells_every_solve_once(run: Run) -> None:
    for _ in range(2):  # nothing is left behind by the first
        code, out, err = run("solve", "stack", "-v")
        assert code == 0
        assert "\nscene      stack" in out
        (_,) = re.findall(r"^[\d:]+ load factor in .* \(solve 1, \w+\)$", err, re.MULTILINE)
    assert run("solve", "stack")[2] == ""
    rows = run("sweep", "stack", "--vary", "friction=0.5,0.6", "-v")[2]
    assert re.findall(r"sweep: (\d of \d), ", rows) == ["1 of 2", "2 of 2"]


def test_compare(run: Run) -> None:
    models = ("--models", "cvxlimit,cvxlimit/octagon", "--repeat", "1")
    code, out, err = run("compare", "stack", *models, "--csv", "t.csv", "--plot", "t.png")
    assert (code, err) == (0, "")
    assert [line.split()[-1] for line in out.splitlines()[1:3]] == ["certified"] * 2
    assert len(Path("t.csv").read_text("utf-8").splitlines()) == 3
    assert Path("t.png").read_bytes().startswith(b"\x89PNG")


def test_sensitivity(run: Run) -> None:
    code, out, err = run("solve", "arch", "--sensitivity")
    assert (code, err) == (0, "")
    assert re.search(r"^moves +most in v16 \+1.38, ", out, re.MULTILINE)


# --- refused: exit 2 ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed_scene(run: Run, tmp_path: Path, name: str) -> None:
    content, phrase = MALFORMED[name]
    file = tmp_path / "scene.json"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert_refused(run("solve", str(file), "--json", "out.json", "--plot", "out.html"), phrase)


@pytest.mark.parametrize(
    ("arguments", "phrase"),
    [
        (("solve",), "Missing argument 'SCENE'; see cvxlimit solve --help"),
        (("solve", "arch", "--surfaces", "conic"), "No such option"),
        (("solve", "arch", "--json"), "requires an argument"),
        (("solve", "arch", "more"), "unexpected extra argument"),
        (("solve", "arch", "--tolerance", "tight"), "--tolerance"),
        (("scenes", "arch"), "unexpected extra argument"),
        (("draw",), "No such command 'draw'; see cvxlimit --help"),
        (("solve", "arch", "--surface", "cone"), "got 'cone'"),
        (("solve", "arch", "--surface", "2-gon"), "at least 3 facets, got 2"),
        (("solve", "arch", "--surface", "[red]"), "got '[red]'"),
        (("solve", "arch", "--method", "some"), "got 'some'"),
        (("solve", "arch", "--moments", "both"), "got 'both'"),
        (("solve", "arch", "--tolerance", "0"), "tolerance must be between 0 and 1, got 0.0"),
        (("solve", "arch", "--tolerance", "nan"), "got nan"),
        (("solve", "arhc"), "did you mean 'arch'?"),
        (("solve", "zzz"), "cvxlimit scenes lists the built-in ones"),
        (("solve", ""), "there is no built-in scene"),
        (("solve", "no/arch"), "no/arch: there is no such file"),
        (("solve", "arch.json"), "arch.json: there is no such file"),
        (("solve", "."), "this is a folder"),
        (("solve", "new\nline"), r"new\nline"),
        (("solve", "arch", "--plot", "m.txt"), "must end in .png, .html, .vtu"),
        (("solve", "arch", "--plot", "forces:m.vtu"), "forces:m.vtu: the name must end in .png"),
        (("solve", "arch", "--friction", "0.5"), "cvxlimit sweep --vary friction=0.5"),
        (("compare", "arch", "--models", "cnic"), "did you mean 'conic'?"),
        (("solve", "arch", "--plot", "forcs:m.png"), "no picture 'forcs'; did you mean 'forces'?"),
        (("solve", "arch", "--plot", "a.png", "--plot", "forces:a.png"), "this is the file of"),
        (("solve", "arch", "-v", "-q"), "--verbose and --quiet exclude each other"),
        (("compare", "arch", "--models", "octogon*"), "no model is called 'octogon*'"),
        (("solve", "arch", "--plot", "png"), "must end in"),
        (("solve", "arch", "--plot", "no/m.png"), "there is no folder 'no'; create it first"),
        (("solve", "arch", "--json", "no/o.json"), "there is no folder 'no'; create it first"),
        (("solve", "arch", "--json", "."), "this is a folder; name a file in it"),
        (("solve", "arch", "--json", "x" * 300), "File name too long"),
        (("solve", "arch", "--json", "a.png", "--plot", "./a.png"), "the file of --json"),
    ],
)
def test_bad_arguments(run: Run, arguments: tuple[str, ...], phrase: str) -> None:
    assert_refused(run(*arguments), phrase)


def test_geometric_fault_names_the_blocks(run: Run, tmp_path: Path) -> None:
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    p = Block.box("p", (0, 0, 0), (1, 1, 1), density=1.0)
    q = Block.box("q", (0.5, 0, 0), (1.5, 1, 1), density=1.0)
    scene = Scene([ground, p, q], ["ground"], Load(acceleration=(1, 0, 0)))
    write_scene(scene, tmp_path / "s.json")
    outcome = run("solve", str(tmp_path / "s.json"), "--json", "out.json")
    assert_refused(outcome, "q")
    assert "p" in outcome[2]


def test_outputs_are_checked_before_the_solve(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solving, "solve", lambda *_, **__: pytest.fail("solved in vain"))
    assert_refused(run("solve", "arch", "--plot", "m.jpg"), "must end in")
    assert_refused(run("solve", "arch", "--json", "no/o.json"), "there is no folder")


def test_the_scene_is_not_overwritten(run: Run) -> None:
    write_scene(tower(), "s.json")
    before = Path("s.json").read_bytes()
    code, out, err = run("solve", "s.json", "--json", "./s.json")
    assert (code, out) == (2, "")
    assert "this is the file of the scene; choose another name" in err
    assert Path("s.json").read_bytes() == before


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
@pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")
def test_folder_without_rights(run: Run) -> None:
    Path("locked").mkdir()
    Path("locked").chmod(stat.S_IRUSR | stat.S_IXUSR)
    code, out, err = run("solve", "arch", "--json", "locked/o.json")
    Path("locked").chmod(stat.S_IRWXU)
    assert (code, out) == (2, "")
    assert "Permission denied" in err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_disk_full_at_the_end_still_shows_the_result(run: Run) -> None:
    code, out, err = run("solve", "single-block", "--json", "/dev/full")
    assert code == 2
    assert "load factor" in out
    assert err == "cvxlimit: /dev/full: the file cannot be written: No space left on device\n"


def test_picture_without_matplotlib(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert_refused(run("solve", "arch", "--plot", "m.png"), "pip install 'cvxlimit[plot]'")
    assert_refused(run("solve", "arch", "--plot", "m.vtu"), "pip install 'cvxlimit[pyvista]'")


# --- no answer: exit 3; not good enough: exit 4 ---------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "status"),
    [
        (tower(shift=0.8), Status.DEAD_LOAD_UNSTABLE),
        (tower(live=(0, 0, -1)), Status.LIVE_LOAD_HARMLESS),
    ],
    ids=["overhanging", "pressed-down"],
)
def test_a_picture_that_there_is_none_of_hides_no_diagnosis(
    run: Run, scene: Scene, status: Status
) -> None:
    write_scene(scene, "s.json")
    files = ("--plot", "forces:f.png", "--plot", "o.png", "--export", "e.csv")
    code, _, err = run("solve", "s.json", *files)
    assert code == 3
    assert status.advice in err
    assert Path("o.png").exists()
    assert Path("e.csv").exists()
    is_drawn = status is Status.LIVE_LOAD_HARMLESS  # which has forces
    assert Path("f.png").exists() == is_drawn
    assert ("f.png is not drawn" in err) == (not is_drawn)


@pytest.mark.parametrize(
    ("scene", "status"),
    [
        (tower(shift=0.8), Status.DEAD_LOAD_UNSTABLE),
        (tower(live=(0, 0, -1)), Status.LIVE_LOAD_HARMLESS),
    ],
    ids=["overhanging", "pressed-down"],
)
def test_no_answer(run: Run, scene: Scene, status: Status) -> None:
    write_scene(scene, "s.json")
    code, out, err = run("solve", "s.json", "--json", "o.json", "--plot", "o.html")
    assert code == 3
    assert re.fullmatch(f"cvxlimit: {status}: .*{re.escape(status.advice)}.*\n", err)
    assert f"load factor  none   {status}\n" in out
    result = read_result("o.json")
    assert (result.status, result.load_factor) == (status, None)
    assert result.note in err
    assert Path("o.html").exists()


def test_not_certified_to_the_tolerance(run: Run) -> None:
    code, out, err = run("solve", "arch", "--tolerance", "1e-14", "--json", "o.json", "-v")
    result = read_result("o.json")
    assert code == 4
    assert err.endswith(f"cvxlimit: not certified: {Status.NOT_CERTIFIED.advice}\n")
    assert result.status is Status.NOT_CERTIFIED
    assert re.findall(r"\(solve (\d+), ", err) == [str(i + 1) for i in range(len(result.history))]
    assert "solver" in out


@pytest.mark.parametrize("status", Status)
def test_exit_code_of_every_status(
    run: Run, monkeypatch: pytest.MonkeyPatch, status: Status
) -> None:
    solve = solving.solve
    monkeypatch.setattr(
        solving, "solve", lambda scene, *_, **__: replace(solve(scene), status=status)
    )
    code, _, err = run("solve", "single-block")
    assert code == (0 if status.is_good else 4 if status.has_answer else 3)
    assert (err == "") == (code == 0)


def test_no_solver(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> Solution:
        raise SolverError("no solver could be run: install one")

    monkeypatch.setattr(solving, "solve", fail)
    assert_refused(run("solve", "arch"), "install one", code=4)


# --- what nobody planned: exit 1, 130 -------------------------------------------------------------


def test_stdout_is_for_answers() -> None:
    """HiGHS prints a banner there when it is first made, past Python; asked to, it may."""
    code = """if True:
    from cvxlimit import builtin_scene, solve
    for solver in ("HIGHS", "CLARABEL", "SCS"):
        solve(builtin_scene("single-block"), "octagon", solver=solver)
    """
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("", "")


def test_internal_error(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> Solution:
        raise KeyError("a\nb")

    monkeypatch.setattr(solving, "solve", fail)
    assert_refused(run("solve", "arch"), "please report it", code=1)
    monkeypatch.setenv("CVXLIMIT_DEBUG", "1")
    code, out, err = run("solve", "arch")
    assert (code, out) == (1, "")
    assert err.startswith("Traceback")


def test_keyboard_interrupt(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> Solution:
        raise KeyboardInterrupt

    monkeypatch.setattr(solving, "solve", interrupt)
    assert_refused(run("solve", "arch", "--json", "o.json"), "interrupted", code=130)


def test_the_console_script_is_the_module() -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))
    assert project["project"]["scripts"] == {"cvxlimit": "cvxlimit.__main__:main"}


# --- streams ------------------------------------------------------------------------------------


def test_process_with_pipes() -> None:
    done = subprocess.run(
        command("solve", "single-block"), capture_output=True, stdin=subprocess.DEVNULL, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
    lines = done.stdout.decode().splitlines()
    assert lines[0].startswith("load factor  0.4000000   [0.39999")
    assert all(line == line.rstrip() for line in lines)
    assert b"\x1b" not in done.stdout


@pytest.mark.exhaustive
def test_long_error_is_one_line_whatever_the_terminal(tmp_path: Path) -> None:
    name = str(tmp_path / ("long " * 40)) + "/s.json"
    done = subprocess.run(
        command("solve", name),
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "COLUMNS": "40", "FORCE_COLOR": "1"},
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"cvxlimit: {name}: there is no such file; check the path\n"


@pytest.mark.exhaustive
def test_stdout_that_cannot_hold_the_characters(tmp_path: Path) -> None:
    write_scene(tower().with_name("Würfel ☃"), tmp_path / "s.json")
    done = subprocess.run(
        command("explain", str(tmp_path / "s.json")),
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"},
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert rb"W\xfcrfel \u2603" in done.stdout


@pytest.mark.exhaustive
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_stdout_is_one_line() -> None:
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            command("scenes"), stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr == "cvxlimit: standard output: No space left on device\n"


@pytest.mark.exhaustive
@pytest.mark.skipif(os.name != "posix", reason="needs a pseudo-terminal")
def test_terminal_gets_progress_on_stderr_only(tmp_path: Path) -> None:
    import pty

    master, slave = pty.openpty()
    done = subprocess.run(
        command("solve", "single-block"),
        stdout=subprocess.PIPE,
        stderr=slave,
        check=False,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
    )
    os.close(slave)
    seen = os.read(master, 100_000).decode()
    os.close(master)
    assert done.returncode == 0
    assert "reading the scene" in seen or "solving" in seen
    assert done.stdout.startswith(b"load factor ")
    assert b"\x1b" not in done.stdout


# --- numbers ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bracket", "shown"),
    [
        (Bracket(1 / 3, 2 / 3), "[0.3333333, 0.6666667], relative width 5.0e-01 (asked: 1e-05)"),
        (Bracket(-0.0, 2 / 3), "[0, 0.6666667], relative width 1.0e+00 (asked: 1e-05)"),
        (Bracket(-1 / 3, 2 / 3), "[-0.3333334, 0.6666667], relative width 1.5e+00 (asked: 1e-05)"),
        (Bracket(upper=1 / 3), "[?, 0.3333334], one bound (asked: 1e-05)"),
        (Bracket(), None),
    ],
)
def test_bounds_are_rounded_outward(
    bracket: Bracket, shown: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    third = Solution(
        "s", "conic", "none", "independent", 1, 1, 1 / 3, bracket, Status.NOT_CERTIFIED, (), {}
    )
    show(report.details(third, "file", 1e-5))
    lines = [x for x in capsys.readouterr().out.splitlines() if x.startswith("bracket")]
    assert lines == ([] if shown is None else [f"bracket  {shown}"])


def test_result_file_is_json_with_the_promised_keys(run: Run) -> None:
    run("solve", "single-block", "--json", "o.json")
    document = json.loads(Path("o.json").read_text("utf-8"))
    assert (document["format"], document["version"]) == ("cvxlimit-result", 1)
    assert document["load_factor"] == pytest.approx(0.4, abs=1e-5)
    assert set(document["seconds"]) >= {"detect", "compile", "solve", "total"}


def test_geometry_is_no_scene(run: Run) -> None:
    Path("wall.obj").write_text("v 0 0 0\n")
    code, out, err = run("solve", "wall.obj")
    assert (code, out) == (2, "")
    assert err == "cvxlimit: wall.obj: this is geometry: cvxlimit import makes a scene of it\n"


def test_import_names_all_that_is_missing_and_speaks_of_options(run: Run, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    rows = "g,0,0,0,1,1,1,,1\nb,0,0,1,1,1,1.0000001,20,\n"
    table.write_text("id,xmin,ymin,zmin,xmax,ymax,zmax,density,support\n" + rows)
    outcome = run("import", str(table), "--friction", "0.5")
    assert_refused(outcome, "give --output SCENE.json")
    for name in ("--length-unit m", "--up x, y or z", "--live X,Y,Z", "none is guessed"):
        assert name in outcome[2]
    assert "--friction" not in outcome[2]
    asked = ("import", str(table), "-o", "scene.json", "--length-unit", "m", "--up", "z",
             "--friction", "0.5", "--live", "1,0,0")  # fmt: skip
    for more, option in (("--joint-tolerance=-1", "--joint-tolerance must be"),):
        outcome = run(*asked, more)
        assert_refused(outcome, option)
        assert "joint_tolerance" not in outcome[2]
    table.write_text(table.read_text().replace("1.0000001", "1.5").replace("b,0,0,1", "b,0,0,0.95"))
    assert_refused(run(*asked), "or raise --joint-tolerance to 0.05")
    table.write_text("id,xmin,ymin,zmin,xmax,ymax,zmax\ng,0,0,0,1,1,1\nb,0,0,1,1,1,2\n")
    bare = run("import", str(table))[2]
    for name in ("output", "length-unit", "up", "friction", "live", "supports", "density"):
        assert f"--{name} " in bare  # all seven, at once
    both = run(*asked)[2]
    assert "--supports lowest" in both
    assert "--density" in both


@pytest.mark.parametrize("verb", ["solve", "explain", "show", "domain"])
def test_a_scene_without_a_support_is_bad_input(run: Run, tmp_path: Path, verb: str) -> None:
    path = tmp_path / "scene.json"
    write_scene(tower(), path)
    document = json.loads(path.read_text())
    document["supports"] = []
    document["blocks"][0]["density"] = 20.0
    path.write_text(json.dumps(document))
    outcome = run(verb, str(path))
    assert_refused(outcome, "has no support, so that nothing can stand: name the fixed blocks")


def test_a_vehicle_crosses_a_bridge(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same as in Python, with soil; what is beside the bridge has no limit, and the page is of
    the worst position."""
    plain = bridge(Arch(3.0, 0.75, voussoirs=8), thickness=0.2, width=1.0, cover=0.2)
    scene, files = tmp_path / "bridge.json", [tmp_path / f"e.{x}" for x in ("csv", "png", "html")]
    write_scene(plain, scene)
    asked = ["envelope", str(scene), "--level", "1.15", "--axle", "0,30", "--axle", "1,50",
             "--one-way", "--soil", "20,1.5"]  # fmt: skip
    outputs = [x for file in files for x in ("--" + {".csv": "csv", ".png": "plot"}.get(
        file.suffix, "report"), str(file))]  # fmt: skip
    assert cli.run([*asked, "--positions", "-5,3,5", *outputs]) == 0
    held = replace(plain, reactions=passive(plain, 1.15, 20.0, 1.5))
    vehicle = Vehicle([(0.0, 30.0), (1.0, 50.0)])
    found = envelope(held, vehicle, [-5, -3, -1, 1, 3], 1.15, both_ways=False)
    rows = [line.split(",") for line in files[0].read_text().splitlines()[1:]]
    assert [float(row[2]) for row in rows] == pytest.approx(found.to_dataframe()["load_factor"])
    page = files[2].read_text("utf-8")
    assert "Positions of a vehicle" in page
    assert "least load factor" in page
    bare = solve(replace(found.worst.solution.scene, reactions=()))  # type: ignore[union-attr]
    for said in (
        "30 kN at 0 m, 50 kN at 1 m", "level 1.15 m", "with 0.2 m of fill", "K = 1.5",
        f"{bare.load_factor:.4f}"[:-1], f"{found.worst.lost:.6g} kN on abutments",
    ):  # fmt: skip
        assert said in page
    capsys.readouterr()
    for wrong, message in (
        (["--positions", "0,1"], "3 numbers are meant, as in -1,12,27"),
        (["--positions", "0,1,2.5"], "must be whole"),
        (["--positions", "0,1,2", "--spread", "half"], "1 numbers are meant, as in 0.5, or bous"),
    ):
        assert cli.run([*asked, *wrong]) == 2
        assert message in capsys.readouterr().err


def test_import_with_what_surrounds_a_wall(run: Run, tmp_path: Path) -> None:
    """Two stones of 20 each, earth of 10.8 that pushes, soil before the toe that holds 3.375, water
    that pushes 9.81 / 2, fill of 20 on top."""
    table = tmp_path / "wall.csv"
    rows = "g,-1,0,-1,3,1,0,,1\nb1,0,0,0,1,1,1,20,\nb2,0,0,1,1,1,2,20,\n"
    table.write_text("id,xmin,ymin,zmin,xmax,ymax,zmax,density,support\n" + rows)
    earth, water = ("--earth", "2,18,0.3,-1,0,0"), ("--water", "1,9.81,-1,0,0")
    soil, fill = ("--soil", "0.5,18,1.5,1,0,0"), ("--fill", "3,20")
    for live, more, by_hand in (
        ("pressures", (*earth, *soil), (0.3 * 40.0 + 3.375) / 10.8),
        ("pressures", (*earth, *water, *fill), 0.3 * 60.0 / (10.8 + 9.81 / 2.0)),
        ("1,0,0", (*earth,), (0.3 * 40.0 - 10.8) / 40.0),
    ):
        asked = ("import", str(table), "-o", "scene.json", "--length-unit", "m", "--up", "z",
                 "--friction", "0.3", "--live", live)  # fmt: skip
        assert run(*asked, *more)[0] == 0
        found = solve(read_scene("scene.json"))
        assert_certified(found)
        assert found.load_factor == pytest.approx(by_hand, rel=1e-6)
    Path("scene.json").unlink()
    assert_refused(run(*asked[:-1], "pressures"), "give --earth or --water")
    assert_refused(run(*asked, "--fill", "3"), "2 numbers are meant, as in 3,20")


def test_an_option_that_no_docstring_describes_is_refused() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Dig(Command):
        """Dig under a scene."""

        depth: float = 1.0

        def run(self) -> int:
            return 0

    with pytest.raises(ModelError, match="command Dig: its docstring does not describe 'depth'"):
        typer_command(Dig)
