"""The compiled parts: what does not fit is refused, where it would be a crash, and every way of
building them gives the same answers without a word of the sanitizers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvxlimit.extensions.blockcone.interior import INTERIOR
from cvxlimit.solvers.compiled import CHOLESKY
from cvxlimit.solvers.sources import HERE, digest

ROOT = Path(__file__).parents[3]
WHERE_BUILT = pytest.mark.skipif(INTERIOR is None or CHOLESKY is None, reason="not compiled here")


def ints(*values: int) -> Any:
    return np.array(values, dtype=np.int64)


def shorts(*values: int) -> Any:
    return np.array(values, dtype=np.int32)


def wrong_arguments() -> dict[str, tuple[Any, ...]]:
    """Of every function: sizes that are negative, too large, or of another array, places beyond an
    array's end, and arrays of another kind."""
    two = np.ones(2)
    # x >= 0, |(x, y)| <= z under y + z = 1: three columns, an equation, a line and a cone
    right = [
        two[:1].repeat(3), shorts(0, 2, 4, 6), shorts(1, 3, 0, 4, 0, 2), np.ones(6), np.ones(5),
        1, 1, ints(3), ints(), np.array([1e-8, 0.0, np.inf]), 50, np.ones(0),
        np.ones(12), np.ones(24), ints(0, 0),
    ]  # fmt: skip
    INTERIOR.minimise(*right)
    wrong = {
        0: np.ones(2), 1: ints(0, 2, 4, 6), 1.5: shorts(0, 4, 2, 6), 2: shorts(1, 3, 0, 5, 0, 2),
        2.5: shorts(1, 3, 0, -1, 0, 2), 3: np.ones(5), 4: np.ones(4), 5: -1, 6: 2, 7: ints(3, 3),
        7.5: ints(2**62), 8: shorts(0), 9: two, 12: np.ones(11), 13: ints(0), 14: ints(0),
    }  # fmt: skip
    minimise = {
        f"minimise, {place}": (INTERIOR.minimise, *right[:at], value, *right[at + 1 :])
        for place, value in wrong.items()
        for at in [int(place)]
    }
    return minimise | {
        "blocks": (INTERIOR.blocks, *right[:8], ints(0, 0)),
        "blocks, lines": (INTERIOR.blocks, *right[:6], -1, ints(3), ints(0, 0, 0)),
        "analysed": (CHOLESKY.analysed, ints(0, 1), ints(1)),
        "analysed, nothing": (CHOLESKY.analysed, ints(), ints()),
        "analysed, disorder": (CHOLESKY.analysed, ints(0, 3, 2), ints(0, 1)),
        "analysed, upper": (CHOLESKY.analysed, ints(0, 1, 2), ints(0, 0)),
        "factorised": (CHOLESKY.factorised, CHOLESKY.analysed(ints(0, 1), ints(0)), two),
        "factorised, no factor": (CHOLESKY.factorised, 5, two),
        "solution": (CHOLESKY.solution, CHOLESKY.analysed(ints(0, 1), ints(0)), two),
    }


@WHERE_BUILT
def test_what_does_not_fit_is_refused() -> None:
    for name, (function, *arguments) in wrong_arguments().items():
        try:
            function(*arguments)
        except (ValueError, BufferError, TypeError):
            continue
        pytest.fail(f"{name} was taken")


@WHERE_BUILT
def test_one_argument_less_is_refused() -> None:
    for function, *arguments in wrong_arguments().values():
        with pytest.raises(TypeError):
            function(*arguments[:-1])


def test_the_digest_is_of_the_sources(tmp_path: Path) -> None:
    """A letter changes it, the kind of line ends does not; without sources there is none."""
    source, own = HERE / "cholesky.c", tmp_path / "cholesky.c"
    assert digest(own, tmp_path) == ""
    for path in (source, *HERE.glob("*.h")):
        (tmp_path / path.name).write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert digest(own, tmp_path) == digest(source)
    changed = tmp_path / "dense.h"
    changed.write_bytes(changed.read_bytes().replace(b"QUADS 3", b"QUADS 2"))
    assert digest(own, tmp_path) != digest(source)


BUILD = """
import runpy, sys
from pathlib import Path
build = runpy.run_path("hatch_build.py")
for source in build["SOURCES"]:
    path = Path("src", source).resolve()
    made = build["compiled"](path, Path(sys.argv[1]), sys.argv[2:])
    if made is None:
        sys.exit(f"{source} could not be compiled")
    path.with_name(made.name).write_bytes(made.read_bytes())
"""

PROGRAMS = """
import numpy as np, scipy.sparse as sp
from cvxlimit.extensions.blockcone.interior import INTERIOR
from cvxlimit.solvers.compiled import CHOLESKY
assert INTERIOR and CHOLESKY, "not compiled"
from cvxlimit.errors import SolverError
from cvxlimit.solvers import settings_for
from cvxlimit.solvers.program import ConeProgram

def program(rng):
    '''Blocks of up to five variables in boxes, inequalities and cones, around a point that is
    inside; then, in half of them, something is wrong.'''
    blocks, p = int(rng.integers(0, 9)), int(rng.integers(0, 7))
    widths = rng.integers(1, 6, blocks)
    n = int(widths.sum()) + int(rng.integers(0, 2))
    inside, at = rng.normal(size=n), 0
    equations = rng.normal(size=(p, n)) * (rng.random((p, n)) < 0.7)
    plain, curved, plain_right, curved_right = [np.zeros((0, n))], [], [np.zeros(0)], []
    for width in widths:
        own = slice(at, at + width)
        part = np.zeros((2 * width + int(rng.integers(0, 4)), n))
        part[:width, own], part[width:2 * width, own] = np.eye(width), -np.eye(width)
        part[2 * width:, own] = rng.normal(size=(len(part) - 2 * width, width))
        plain.append(part), plain_right.append(part @ inside + rng.random(len(part)) + 0.1)
        for size in rng.integers(1, 6, int(rng.integers(0, 3))):
            part, slack = np.zeros((size, n)), 0.3 * rng.normal(size=size)
            part[:, own], slack[0] = rng.normal(size=(size, width)), 1.0 + np.linalg.norm(slack)
            curved.append(part), curved_right.append(part @ inside + slack)
        at += width
    matrix = np.concatenate([equations, *plain, *curved])
    right = np.concatenate([equations @ inside, *plain_right, *curved_right])
    cost, kind = rng.normal(size=n), int(rng.integers(0, 10))
    for part in (matrix, right, cost) if kind < 3 else ():
        if part.size:
            part.flat[int(rng.integers(part.size))] = (np.inf, -np.inf, np.nan)[kind]
    if kind == 3:
        matrix *= 10.0 ** rng.integers(-150, 150, (len(matrix), 1))
    if kind == 4:
        right += 3.0 * rng.normal(size=len(right))
    cones = tuple(map(len, curved))
    return ConeProgram(cost, sp.csc_array(matrix), right, p, sum(map(len, plain)), cones)

ended = {}
for seed in range(1000):
    rng = np.random.default_rng(seed)
    given, cache = program(rng), {}
    outcome, x, y = given.solve(settings_for("BLOCKWISE", 1e-8), cache)
    ended[outcome.status[:30]] = ended.get(outcome.status[:30], 0) + 1
print(ended)
assert ended["optimal"] > 300, ended
"""

WAYS = {
    "sanitizers": ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"],
    "no vectors": ["-std=c11", "-DNO_VECTORS"],
    "clang": [],
}


@pytest.mark.exhaustive
@pytest.mark.skipif(sys.platform != "linux", reason="GCC's sanitizers are asked for on Linux")
@pytest.mark.parametrize("way", WAYS)
def test_built_in_other_ways(way: str, tmp_path: Path) -> None:
    """In a copy: the tests of solvers, and a thousand random programs, some of them with numbers
    that are infinite or none, or empty."""
    for name in ("hatch_build.py", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path)
    leave = shutil.ignore_patterns("*.so", "__pycache__")
    shutil.copytree(ROOT / "src", tmp_path / "src", ignore=leave)
    shutil.copytree(ROOT / "tests", tmp_path / "tests", ignore=leave)
    compiler = "clang" if way == "clang" else "gcc"
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler} here")
    own = {"CC": compiler, "PYTHONPATH": str(tmp_path / "src"), "OPENBLAS_NUM_THREADS": "1"}
    if way == "sanitizers":
        runtime = _sanitizer()
        if runtime is None:
            pytest.skip("this GCC has no address sanitizer")
        own |= {"LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}

    def run(*command: str, **more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, *command],
            cwd=tmp_path, env={**os.environ, **own, **more}, text=True, capture_output=True,
        )  # fmt: skip

    made = run("-c", BUILD, str(tmp_path / "objects"), *WAYS[way], LD_PRELOAD="")
    assert made.returncode == 0, made.stdout + made.stderr
    many = run("-c", PROGRAMS)
    assert many.returncode == 0, many.stdout + many.stderr[-3000:]
    chosen = [
        "tests/extensions/blockcone/test_interior.py",
        "tests/solvers/test_sparse.py",
        __file__,
    ]
    tests = run(
        "-m", "pytest", "-q", "-x", *chosen[:2], "tests/extensions/blockcone/test_compiled.py"
    )
    assert tests.returncode == 0, tests.stdout[-3000:] + tests.stderr[-3000:]


def _sanitizer() -> str | None:
    """GCC's library of the address sanitizer, which has to be there before all others."""
    found = subprocess.run(
        ["gcc", "-print-file-name=libasan.so"], text=True, capture_output=True, check=True
    ).stdout.strip()
    return found if Path(found).is_absolute() else None
