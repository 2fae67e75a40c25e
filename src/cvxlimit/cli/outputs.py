"""Exit codes, refusals, and output files that are refused before the work rather than after."""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from enum import IntEnum
from pathlib import Path

from cvxlimit.errors import InputError, ModelError
from cvxlimit.io.fields import one_line

PICTURES = (".png", ".html", ".vtu")
"""What a solution can be drawn as."""

SCENE_PICTURES = (".png", ".html")
"""What a scene without a solution can be drawn as."""


class ExitCode(IntEnum):
    """What the shell gets to see."""

    SOLVED = 0
    INTERNAL_ERROR = 1
    BAD_INPUT = 2
    NO_ANSWER = 3
    NOT_GOOD_ENOUGH = 4
    INTERRUPTED = 130


def complain(message: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"cvxlimit: {one_line(message)}\n")


def refuse(code: ExitCode, message: str) -> ExitCode:
    complain(message)
    return code


def check_outputs(outputs: Mapping[str, Path | None], inputs: Mapping[str, str]) -> None:
    """Refuse output files, given by option, that cannot be written or are taken.

    ``inputs`` names what each file that is read is, by path.
    """
    seen = {os.path.realpath(path): name for path, name in inputs.items()}
    for option, path in outputs.items():
        if path is None:
            continue
        reason = _obstacle(path)
        if reason:
            raise InputError(f"{option} {path}: {reason}")
        taken = seen.setdefault(os.path.realpath(path), option)
        if taken != option:
            raise InputError(f"{option} {path}: this is the file of {taken}; choose another name")


def check_suffix(option: str, path: Path, kinds: Sequence[str]) -> None:
    if path.suffix.lower() not in kinds:
        raise InputError(f"{option} {path}: the name must end in {', '.join(kinds)}")


def check_picture(path: Path, kinds: Sequence[str]) -> None:
    check_suffix("--plot", path, kinds)
    if path.suffix.lower() == ".png" and importlib.util.find_spec("matplotlib") is None:
        raise ModelError(
            f"--plot {path}: pictures need Matplotlib: pip install 'cvxlimit[plot]' "
            "(.html and .vtu work without it)"
        )


def _obstacle(path: Path) -> str:
    if os.path.isdir(path):
        return "this is a folder; name a file in it"
    if not os.path.isdir(path.parent):
        return f"there is no folder {str(path.parent)!r}; create it first"
    try:
        if os.path.exists(path) and not os.path.isfile(path):  # a device or a pipe
            return "" if os.access(path, os.W_OK) else "it cannot be written to; choose another"
        with suppress(FileNotFoundError):
            os.stat(path)
        with tempfile.TemporaryFile(dir=path.parent):
            return ""
    except OSError as error:
        return f"no file can be written there ({error.strerror}); choose another place"
