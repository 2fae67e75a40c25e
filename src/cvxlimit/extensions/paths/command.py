"""``cvxlimit pushover``: the path of a structure after its collapse factor, configuration by
configuration."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text

from cvxlimit.cli.interrupting import Tell, interruptible, with_result
from cvxlimit.cli.options import Command, named_block
from cvxlimit.cli.report import (
    ExitCode,
    counted,
    facts,
    files_asked,
    refuse,
    show,
    write_rows,
)
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.code_check import code_check
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.path import Path as Displacements
from cvxlimit.extensions.paths.pushover import pushover
from cvxlimit.extensions.paths.wording import PROVES
from cvxlimit.io import scene_from_dict
from cvxlimit.io.fields import file_prefix, one_line, read_document, refusals
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting.look import IMAGES
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import TOLERANCE, Bracket, rounded, rounded_down, rounded_up

_KINDS = dict.fromkeys(IMAGES, "curve") | {".gif": "film", ".mp4": "film", ".html": "page"}
"""Pictures of a path, by suffix."""


@dataclass(frozen=True, kw_only=True)
class PushoverCommand(Command):
    """Follow a structure after its collapse factor in finite displacements, with a bracket at every
    configuration.

    Arguments
    ---------
    scene : SCENE
        Scene file, or name of a built-in scene; or a path (pushover --json), which goes on.

    Effort
    ------
    step : L
        Step of the live load's mean displacement; chosen by the package unless given; where joints
        slide, it is then also halved.

    Model
    -----
    until : A
        Load factor at which to end; 0 unless given.
    flow : NAME
        Flow rule of sliding joints: associated (default), or zero-dilatancy: none opens.
    control : BLOCK:X,Y,Z
        Block and direction whose displacement is told; unless given, the mean displacement of the
        live load.
    pressures : NAME
        Pressures stay on their faces: turning with them (default), or keeping their direction.
    stretch : S
        Share of its length by which a tie is stretched before it is gone; 0 unless given.
    code_check : FC
        Report the displacement check of Circolare 7/2019 with this confidence factor.

    Output
    ------
    json : OUT
        Write the path to this JSON file.
    csv : OUT
        Write a row per configuration.
    report : OUT.html
        Write a page to print and sign, with the path and its check.
    plot : OUT.png|.html|.gif
        Draw the curve (.svg and .pdf as well), a page with a slider, or a film (.mp4 as well).

    Exit code
    ---------
    0 the path ends; 2 bad input; 3 no answer exists; 4 it was broken off, or a bracket is wider
    than 1e-5.
    """

    scene: str
    step: float | None = None
    until: float = 0.0
    flow: str | None = None
    control: str | None = None
    pressures: str | None = None
    stretch: float | None = None
    code_check: float | None = None
    json: Path | None = None
    csv: Path | None = None
    report: Path | None = None
    plot: Path | None = None

    def run(self) -> ExitCode:
        written = files_asked(self, "json", "csv", plot=[*_KINDS], report=(".html",))
        given: Any = {name: getattr(self, name) for name in ("flow", "pressures", "stretch")}
        given["control"] = named_block(self.control)

        def followed(tell: Tell) -> Displacements:
            begin, told = _begin(self.scene), with_result(tell)
            return pushover(begin, self.step, self.until, progress=told, **given)

        path = interruptible(followed)
        if self.json is not None:
            path.save(self.json)
        write_rows(self.csv, path.to_dataframe())
        if self.plot is not None:
            path.plot(_KINDS[self.plot.suffix.lower()], self.plot)
        check = None if self.code_check is None else code_check(path, self.code_check)
        if self.report is not None:
            if path.initial is None:
                raise InputError(
                    f"--report {self.report}: the path starts displaced, so that there is no "
                    "solution at rest to report: draw the path by --plot, or write it by --json"
                )
            path.initial.of(path.scene).report(self.report, path=path, check=check)
        show(_summary(path, written), Text(), _table(path), Text(one_line(f"{PROVES}")))
        if check is not None:
            show(Text(), Text(str(check)))
        return _verdict(path)


def _begin(name: str) -> Scene | Displacements:
    if name in BUILTIN or not os.path.isfile(name):
        return scene_named(name)
    with refusals(file_prefix(name)):
        document = read_document(name)
        is_path = isinstance(document, dict) and document.get("format") == "cvxlimit-path"
        return PATH.from_dict(document) if is_path else scene_from_dict(document)


def _summary(path: Displacements, written: list[tuple[str, str]]) -> Table:
    unit, initial = path.scene.units.length, path.initial
    widths = _widths(path)
    return facts(
        [
            ("scene", path.scene.name),
            ("load factor", "" if initial is None else f"{rounded(initial.load_factor or 0.0)} in "
             f"{initial.bracket}, friction over whole joints"),
            ("on the path", f"{rounded(path.load_factor[0])} at "
             f"{'the start' if initial is None else 'rest'}, friction at points"),
            ("in short", path.headline),
            ("end", path.ending + f": {path.reason}" * (path.reason != path.headline)),
            ("snaps at", ", ".join(f"w = {w:.6g} {unit}" for w in path.snaps)),
            ("flow", f"{path.flow}; joints slide" if path.slides else "joints rock"),
            ("brackets", f"{len(widths)} of {len(path)} configurations, widest "
             f"{max(widths):.1e} of the first load factor" if widths else ""),
            ("work", "" if path.work is None else f"area {path.work.area:.6g}, potential "
             f"{path.work.potential:.6g} {path.scene.units.force} {unit}"),
            *(("note", note) for note in path.notes),
            *written,
        ]
    )  # fmt: skip


def _table(path: Displacements) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    unit = path.scene.units.length
    for name in (f"w ({unit})", f"displacement ({unit})", "load factor", "lower", "upper"):
        table.add_column(name, justify="right")
    table.add_column("")
    for each, x in zip(path, path.displacement.tolist(), strict=True):
        bracket = each.bracket or Bracket()
        table.add_row(f"{each.w:.6g}", f"{x:.6g}", rounded(each.load_factor),
                      *(end(value) if np.isfinite(value) else "" for end, value in
                        ((rounded_down, bracket.lower), (rounded_up, bracket.upper))),
                      "followed" * each.is_followed)  # fmt: skip
    return table


def _verdict(path: Displacements) -> ExitCode:
    if path.status not in ("zero", "falls", "blocked") and path.reason != path.headline:
        return refuse(ExitCode.NOT_GOOD_ENOUGH, f"{path.ending}: {path.reason}")
    for run, which in ((path.halved, "with half the step"), (path.other_flow, "the other flow")):
        if run is not None and run.status == "interrupted":
            return refuse(ExitCode.NOT_GOOD_ENOUGH, f"{which}: {run.reason}")
    if wide := sum(not width <= TOLERANCE for width in _widths(path)):
        return refuse(
            ExitCode.NOT_GOOD_ENOUGH,
            f"of {counted(len(path), 'configuration')} {wide} have brackets wider than "
            f"{TOLERANCE:g} of the first load factor",
        )
    return ExitCode.SOLVED


def _widths(path: Displacements) -> list[float]:
    """Returns the widths of all brackets over the first load factor, since the last ones hold
    zero."""
    brackets = [each.bracket for each in path if each.bracket is not None]
    return [(each.upper - each.lower) / abs(path.load_factor[0]) for each in brackets]
