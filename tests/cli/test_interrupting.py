"""Ctrl-C at a terminal: real processes, real signals, sent when the program says where it is."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cvxlimit import Status, builtin_scene, settlement
from cvxlimit.io import read_result, write_scene
from cvxlimit.masonry import random_wall
from cvxlimit.methods.driver import ProgressLine
from cvxlimit.studies import read_sweep

if os.name != "posix":
    pytest.skip("signals and terminals of POSIX", allow_module_level=True)

from exhaustive import mostly_slow, slow
from terminals import AMPLE, Terminal, listening


def cvxlimit(*arguments: str, folder: Path | None = None) -> Terminal:
    return Terminal("-m", "cvxlimit", *arguments, folder=folder)


def assert_ended_at_once(program: Terminal) -> None:
    """One line, nothing on stdout, 130."""
    code, out, shown = program.finish()
    assert (code, out) == (130, "")
    assert shown.splitlines()[-1] == "cvxlimit: interrupted"
    assert "Traceback" not in shown


def assert_nothing_is_left(program: Terminal) -> None:
    """No worker outlives the program."""
    with pytest.raises(ProcessLookupError):
        os.killpg(program.process.pid, 0)


# --- while there is no bracket yet ----------------------------------------------------------------

ENTRIES = {
    "module": ("-m", "cvxlimit"),
    "command": ("-c", "from cvxlimit.__main__ import main; main()"),
}
CTRL_C = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(10**9): pass
except BaseException:  # as libraries do that try one extension after another
    pass
raise ImportError("this one is not there")
"""


@pytest.mark.exhaustive_cases("command-cvxpy", "module-cvxpy")
@pytest.mark.parametrize("library", ["numpy", "scipy", "cvxpy", "typer"])
@pytest.mark.parametrize("entry", ENTRIES.values(), ids=ENTRIES.keys())
def test_during_imports(entry: tuple[str, ...], library: str, tmp_path: Path) -> None:
    """A library that presses Ctrl-C while it is loaded."""
    (tmp_path / f"{library}.py").write_text(CTRL_C)
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    done = subprocess.run(
        [sys.executable, *entry, "solve", "stack"],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, timeout=AMPLE,
        preexec_fn=listening, env={**os.environ, "PYTHONPATH": path},
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "cvxlimit: interrupted\n")


@pytest.mark.parametrize("command", mostly_slow(["solve", "settle", "sweep", "import"], ["solve"]))
def test_while_the_input_is_read(command: str, tmp_path: Path) -> None:
    """A pipe in place of the file says when the program is under way."""
    pipe = tmp_path / ("wall.obj" if command == "import" else "scene")
    os.mkfifo(pipe)
    more = {
        "solve": [],
        "settle": ["--support", "b1", "--direction=0,0,-1"],
        "sweep": ["--vary", "friction=0.5"],
        "import": ["--output", "s.json", "--length-unit", "m", "--up", "z", "--friction", "0.5",
                   "--live", "1,0,0"],
    }[command]  # fmt: skip
    with cvxlimit(command, str(pipe), *more, folder=tmp_path) as program, program.opens(pipe):
        program.interrupt()
        assert_ended_at_once(program)


COMMANDS = {
    "solve": ("solve", "s10-panel", "--method", "certified"),
    "settle": ("settle", "s10-panel", "--support", "ground", "--direction=0,0,-1"),
    "sweep": ("sweep", "s10-panel", "--vary", "friction=0.4:0.8:400"),
}


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("command", "phase"),
    [
        ("solve", "reading the scene|finding contacts"),
        slow("solve", "solving with"),
        slow("settle", "reading the scene"),
        slow("sweep", "reading the scene"),
    ],
)
def test_before_there_is_a_bound(command: str, phase: str) -> None:
    with cvxlimit(*COMMANDS[command]) as program:
        program.wait_for(phase)
        program.interrupt()
        assert_ended_at_once(program)


BUSY = """
import sys, time
from cvxlimit.cli import main as cli, solving
from cvxlimit.methods.driver import ProgressLine

def busy(*_, progress, **__):
    line = ProgressLine("under way")
    line.has_bracket = HAS_BRACKET
    progress(line)
    time.sleep(3600)  # as a solver does: in native code, which hears nothing

solving.solve = busy
sys.argv[1:] = ["solve", "stack"]
cli.main()
"""


def busy(has_bracket: bool) -> Terminal:
    return Terminal("-c", BUSY.replace("HAS_BRACKET", str(has_bracket)))


@pytest.mark.exhaustive
def test_inside_a_solver_before_there_is_a_bound() -> None:
    with busy(has_bracket=False) as program:
        program.wait_for("under way")
        program.interrupt()
        assert_ended_at_once(program)


@pytest.mark.exhaustive
def test_the_second_time_ends_at_once() -> None:
    with busy(has_bracket=True) as program:
        program.wait_for("under way")
        program.interrupt()
        program.wait_for("Ctrl-C again ends at once")
        program.interrupt()
        assert_ended_at_once(program)


# --- once there is a bracket ----------------------------------------------------------------------


def assert_bracket(program: Terminal, result: Path, low: float, high: float) -> None:
    """Exit 4, with a bracket of the load factor, on the screen and in the file.

    ``low`` and ``high`` are bounds found by a run that was left alone.
    """
    code, out, shown = program.finish()
    assert code == 4
    assert re.match(r"load factor  (between|at least|at most) [\d.]+.*   interrupted$", out, re.M)
    assert shown.splitlines()[-1].startswith("cvxlimit: interrupted: the bracket is what was prov")
    solution = read_result(result)
    assert solution.status is Status.INTERRUPTED
    assert np.isfinite([solution.lower, solution.upper]).any()
    assert solution.lower <= high
    assert low <= solution.upper


@pytest.mark.exhaustive
def test_inside_a_solver_with_a_bracket(tmp_path: Path) -> None:
    """The first bound of a panel comes after seconds, and the next solve takes as long."""
    result = tmp_path / "out.json"
    with cvxlimit("solve", "s12-panel", "--method", "certified", "--json", str(result)) as program:
        program.wait_for("load factor in")
        program.interrupt()
        assert_bracket(program, result, 0.1260, 0.1264)


@pytest.mark.parametrize("workers", ["1", slow("2")])
def test_while_branching(workers: str, tmp_path: Path) -> None:
    """A wall that is far from closed; its load factor lies in [0.32394, 0.32398]."""
    scene, result = tmp_path / "wall.json", tmp_path / "out.json"
    write_scene(random_wall(0), scene)
    with cvxlimit(
        "solve", str(scene), "--method", "certified", "--tolerance", "1e-9",
        "--branching-seconds", "3600", "--workers", workers, "--json", str(result),
    ) as program:  # fmt: skip
        program.wait_for("branch and bound")
        program.interrupt()
        assert_bracket(program, result, 0.32394, 0.32398)
        assert_nothing_is_left(program)


@pytest.mark.exhaustive
@pytest.mark.parametrize("workers", ["1", slow("2")])
def test_sweep(workers: str, tmp_path: Path) -> None:
    """Rows that are done are shown and kept, and the same command goes on from there."""
    arguments = ("sweep", "stack", "--vary", "friction=0.5:0.9:500", "--workers", workers)
    with cvxlimit(*arguments, "--output", "rows", folder=tmp_path) as program:
        program.wait_for(r"[1-9]\d* of 500")
        program.interrupt()
        code, out, shown = program.finish()
        assert_nothing_is_left(program)
    assert code == 4
    assert re.search(r"^0\.5\d* +0\.[34]\d* .* certified$", out, re.MULTILINE)
    last = shown.splitlines()[-1]
    number = re.match(
        r"cvxlimit: interrupted after (\d+) of 500 variations: the same command", last
    )
    assert number is not None, shown[-500:]
    rows = read_sweep(tmp_path / "rows")
    assert len(rows) == int(number[1])
    with cvxlimit(*arguments, "--output", "rows", folder=tmp_path) as program:
        further = "|".join(map(str, range(len(rows) + 1, 501)))  # stored rows are counted up too
        program.wait_for(rf"(?<!\d)({further}) of 500, ")
        program.interrupt()
        program.finish()
    more = read_sweep(tmp_path / "rows")
    assert len(more) > len(rows)
    assert more[: len(rows)].equals(rows)  # with their seconds: they were not solved again


def test_settlement_returns_the_bracket_reached() -> None:
    """Interrupted when the first bracket is told, it is that of the reaction."""

    def interrupt(line: str) -> None:
        if isinstance(line, ProgressLine) and line.has_bracket:
            raise KeyboardInterrupt

    scene, push = builtin_scene("arch"), (1.0, 0.0, 0.0)
    found = settlement(scene, "right-abutment", push, progress=interrupt)
    whole = settlement(scene, "right-abutment", push)
    assert found.solution.status is Status.INTERRUPTED
    assert found.bracket.lower <= whole.bracket.upper
    assert whole.bracket.lower <= found.bracket.upper
