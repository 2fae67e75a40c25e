"""Five hundred malformed files through the command line.

Scene files damaged in their bytes, scene files with a value replaced or left out, and geometry
files of six formats, at random until 150 of each are refused, and scene files broken by hand. Each
refusal is exit 2 and one line, without a traceback and without an output file; what is still a
scene ends in 0, 3 or 4.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from broken_meshes import GEOMETRIES, TABLE, damaged
from cvxlimit.cli.main import run
from malformed_scenes import GOLDEN, MALFORMED

pytestmark = pytest.mark.exhaustive

PIECES = [b"", b"0", b"-", b"1e999", b"[", b"}", b'"', b",", b"\xff", b"nan", b"\n", b"null",
          b"9" * 30, b"-1", b"\0\0\0\0", b"/", b"e"]  # fmt: skip
EACH, MOST = 150, 3_000
SOLVE = ["solve", "IN", "--json", "out.json"]
IMPORT = ["--output", "out.json", "--length-unit", "m", "--up", "z", "--density", "20",
          "--friction", "0.7", "--live", "1,0,0"]  # fmt: skip
ALONE = ("a.obj", "a.csv")  # the others hold a brick, and get a ground beside them


def cuts(rng: np.random.Generator) -> list[tuple[int, int, bytes]]:
    """One to three places where bytes are replaced by others."""
    return [
        (int(rng.integers(10_000)), int(rng.choice([0, 1, 2, 7, 400])),
         PIECES[int(rng.integers(len(PIECES)))])
        for _ in range(int(rng.integers(1, 4)))
    ]  # fmt: skip


ODD = [None, True, "", "b1", -1, 0, 1e999, 10**40, [], {}, [1, 2], [[[]]], "1", 1e-300, [None] * 3]


def changed(text: str, rng: np.random.Generator) -> str:
    """A JSON document with one of its values replaced by an odd one, or left out."""
    document = json.loads(text)
    inner: Any = document
    while True:
        places = list(inner) if isinstance(inner, dict) else list(range(len(inner)))
        place = places[int(rng.integers(len(places)))]
        if isinstance(inner[place], (dict, list)) and inner[place] and rng.random() < 0.8:
            inner = inner[place]
            continue
        if rng.random() < 0.2:
            del inner[place]
        else:
            inner[place] = ODD[int(rng.integers(len(ODD)))]
        return json.dumps(document)


def importing(name: str) -> list[str]:
    """The command for a geometry file."""
    own = name in ALONE
    files = ["IN"] if own else ["ground.csv", "IN"]
    return ["import", *files, *IMPORT, "--supports", "lowest" if own else "ground"]


class Shell:
    """The command line in a folder of its own, and what it said."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.capsys, self.codes = capsys, Counter[int]()

    def ends(self, command: list[str], name: str, content: bytes) -> int:
        """The exit code for a file of this content, all promises about refusals checked."""
        Path(name).write_bytes(content)
        code = run([name if word == "IN" else word for word in command])
        said = self.capsys.readouterr().err
        assert code in (0, 2, 3, 4), said
        if code == 2:
            assert said.startswith("cvxlimit: "), said
            assert said.count("\n") == 1, said
            assert "Traceback" not in said
            assert not Path("out.json").exists()
        Path("out.json").unlink(missing_ok=True)
        Path(name).unlink()
        self.codes[code] += 1
        return code


def test_three_hundred_malformed_files_and_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shell, rng, refused = Shell(capsys), np.random.default_rng(0), Counter[str]()
    Path("ground.csv").write_text(TABLE)
    names = sorted(GEOMETRIES)
    kinds: dict[str, Callable[[], tuple[list[str], str, bytes]]] = {
        "scene files, bytes": lambda: (SOLVE, "a.json", damaged(GOLDEN.encode(), cuts(rng))),
        "scene files, values": lambda: (SOLVE, "a.json", changed(GOLDEN, rng).encode()),
        "geometry files, bytes": lambda: (
            importing(name := names[int(rng.integers(len(names)))]),
            name,
            damaged(GEOMETRIES[name], cuts(rng)),
        ),
    }
    for name in names:
        assert shell.ends(importing(name), name, GEOMETRIES[name]) == 0
    for kind, made in kinds.items():
        for _ in range(MOST):
            refused[kind] += shell.ends(*made()) == 2
            if refused[kind] == EACH:
                break
        assert refused[kind] == EACH
    for content, _ in MALFORMED.values():
        content = content.encode() if isinstance(content, str) else content
        assert shell.ends(SOLVE, "scene.json", content) == 2
    refused["scene files, by hand"] = len(MALFORMED)
    codes = {int(code): number for code, number in sorted(shell.codes.items())}
    with capsys.disabled():
        sys.stdout.write(f"\nrefused: {dict(refused)}; exit codes: {codes}\n")
    assert sum(refused.values()) >= 500
    assert set(codes) >= {0, 2}
