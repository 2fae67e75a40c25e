"""The protocol of runners: ``COMMAND SCENE.json RESULT.json ...``, standard library only.

More pairs may follow: starting a program often takes longer than the scenes do.

A runner says what it found as ``{"load_factor": number}``, with ``"reach"`` beside it if it
searched in steps; or ``{"answer": "falls"}`` where the dead load alone finds no equilibrium,
``{"answer": "stands"}`` where it does and no factor was asked for, ``{"answer": "no limit"}``.
Whatever it raises is a refusal, which is its answer too.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

STRENGTHS = ("cohesion", "compressive_strength", "tensile_strength", "ties", "pressures")


def answer(packages: tuple[str, ...], solve: Callable[[Path], Mapping[str, Any]]) -> None:
    """Read the arguments, run ``solve`` on every scene file in turn and write its result file."""
    versions = {name: metadata.version(name) for name in packages}
    files = [Path(argument) for argument in sys.argv[1:]]
    for scene, result in zip(files[::2], files[1::2], strict=True):
        start = time.perf_counter()
        try:
            found = dict(solve(scene))
        except Exception as error:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            found = {"answer": "refused", "reason": reason[:160]}
        if found.get("load_factor") is not None:
            found.setdefault("answer", "load factor")
        seconds = round(time.perf_counter() - start, 4)
        document = {"format": "cvxlimit-bench-answer", "version": 1, **found,
                    "versions": versions, "seconds": seconds}  # fmt: skip
        partial = result.with_suffix(".partial")
        partial.write_text(json.dumps(document), encoding="utf-8")
        partial.rename(result)


def dry(scene: Path) -> dict[str, Any]:
    """The document of a scene file of dry joints; refused if it has a strength besides."""
    document: dict[str, Any] = json.loads(scene.read_text("utf-8"))
    entries = [document, *document.get("contacts", [])]
    found = [key for key in STRENGTHS if any(key in entry for entry in entries)]
    if found:
        raise ValueError(f"the program knows dry joints only; the scene has {', '.join(found)}")
    return document


def factor_or(status: str, load_factor: float | None) -> dict[str, Any]:
    """What a solver's status and value say."""
    if load_factor is not None:
        return {"load_factor": load_factor}
    for word, said in (("unbounded", "no limit"), ("infeasible", "falls")):
        if word in status.lower():
            return {"answer": said}
    raise ValueError(f"no answer: {status}")
