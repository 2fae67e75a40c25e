"""``cvxlimit pushover``: the path of a structure after its collapse factor, configuration by
configuration."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text

from cvxlimit.base.lines import one_line
from cvxlimit.cli.interrupting import Tell, interruptible, with_result
from cvxlimit.cli.options import Command, control_of, named_values, vector
from cvxlimit.cli.report import counted, facts, files_asked, write_rows
from cvxlimit.cli.shell import ExitCode, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.code_check import check_asked, code_check
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.path import Path as Displacements
from cvxlimit.extensions.paths.pushover import pushover
from cvxlimit.extensions.paths.wording import PROVES, below, motions, opened, reactions
from cvxlimit.io import scene_from_dict
from cvxlimit.io.fields import file_prefix, read_document, refusals
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.settlement import settlement
from cvxlimit.methods.solving import solve
from cvxlimit.plotting.look import IMAGES
from cvxlimit.scene import Scene
from cvxlimit.scene.settling import SupportMotion
from cvxlimit.solution import Solution
from cvxlimit.solution.bracket import TOLERANCE, Bracket, rounded, rounded_down, rounded_up

_KINDS = dict.fromkeys(IMAGES, "curve") | {".gif": "film", ".mp4": "film", ".html": "page"}
"""Pictures of a path, by suffix."""

_DISPLACED = (
    "the dead load stands only with a part of the live load, so that the path starts displaced, "
    "and there is no solution at rest to report or to check: draw the path by --plot, or write it "
    "by --json"
)


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
        Step of the live load's mean displacement; chosen unless given, and then also halved where
        joints slide.

    Model
    -----
    until : A
        Load factor, or movement, at which to end.
    flow : NAME
        Flow rule of sliding joints: associated (default), or zero-dilatancy: none opens.
    control : BLOCK:X,Y,Z
        Block and direction whose displacement is told; else the live load's.
    move : SUPPORT=X,Y,Z
        Move a support along this direction, under the dead load alone, until the structure falls;
        repeat for several in proportion.
    rotation : SUPPORT=X,Y,Z
        Turn a support about this axis, right-handed, in radians in proportion to its --move.
    about : SUPPORT=X,Y,Z
        A point of that axis.
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
        Write a page to print and sign.
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
    move: list[str] | None = None
    rotation: list[str] | None = None
    about: list[str] | None = None
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
        given["control"] = control_of(self.control)
        given["motion"] = [*self._motions()]
        if given["motion"] and self.code_check is not None:
            raise InputError("--code-check is of a push: leave out --move and --rotation")

        def followed(tell: Tell) -> Displacements:
            begin, told = _begin(self.scene), with_result(tell)
            # What cannot be checked or reported is not followed first.
            scene = begin if isinstance(begin, Scene) else begin.scene
            if self.code_check is not None:
                check_asked(scene, self.code_check)
                if self.until > 0.0:
                    raise InputError("--code-check is of a path to 0: leave out --until")
            asked = self.code_check is not None or self.report is not None
            if asked and begin is scene and not given["motion"] and solve(scene).lower_end:
                raise InputError(_DISPLACED)
            return pushover(begin, self.step, self.until, progress=told, **given)

        path = interruptible(followed)
        if self.json is not None:
            path.save(self.json)
        write_rows(self.csv, path.to_dataframe())
        if self.plot is not None:
            path.plot(_KINDS[self.plot.suffix.lower()], self.plot)
        check = None if self.code_check is None else code_check(path, self.code_check)
        if self.report is not None:
            self._at_rest(path).report(self.report, path=path, check=check)
        show(_summary(path, written), Text(), _table(path), Text(one_line(f"{PROVES}")))
        if check is not None:
            show(Text(), Text(str(check)))
        return _verdict(path)

    def _motions(self) -> Iterator[SupportMotion]:
        """Motions of ``--move``, ``--rotation`` and ``--about``, one for each support."""
        ways: dict[str, dict[str, Any]] = {}
        for option, what in (("move", "direction"), ("rotation", "rotation"), ("about", "about")):
            given, form = getattr(self, option) or [], "SUPPORT=X,Y,Z is meant"
            for text, support, way in named_values(f"--{option}", given, form):
                own = vector(f"--{option} {text}", way, "pier=0,0,-1")
                if option == "about" and "rotation" not in ways.get(support, {}):
                    raise InputError(f"--about {text}: {support!r} turns by no --rotation")
                ways.setdefault(support, {})[what] = own
        for support, each in ways.items():
            yield SupportMotion((support,), **each)

    def _at_rest(self, path: Displacements) -> Solution:
        """The solution at rest that a report begins with; where supports move it is the least
        reaction."""
        if path.motions:
            return settlement(path.scene, path.motions).solution
        if path.initial is None:
            raise InputError(_DISPLACED)
        return path.initial.of(path.scene)


def _begin(name: str) -> Scene | Displacements:
    if name in BUILTIN or not os.path.isfile(name):
        return scene_named(name)
    with refusals(file_prefix(name)):
        document = read_document(name)
        is_path = isinstance(document, dict) and document.get("format") == "cvxlimit-path"
        return PATH.from_dict(document) if is_path else scene_from_dict(document)


def _summary(path: Displacements, written: list[tuple[str, str]]) -> Table:
    unit, initial = path.units.w, path.initial
    widths = _widths(path)
    return facts(
        [
            ("scene", path.scene.name),
            ("load factor", "" if initial is None else f"{rounded(initial.load_factor or 0.0)} in "
             f"{initial.bracket}, friction over whole joints"),
            ("motion", motions(path) if path.motions else ""),
            ("reactions", f"{reactions(path, 0)} at first") if path.motions else
            ("on the path", f"{rounded(path.load_factor[0])} at "
             f"{'the start' if initial is None else 'rest'}, friction at points"),
            ("in short", path.headline),
            ("end", path.ending + f": {path.reason}" * (path.reason != path.headline)),
            ("snaps at", ", ".join(f"w = {w:.6g} {unit}" for w in path.snaps)),
            ("flow", f"{path.flow}; joints slide" if path.slides else "joints rock"),
            ("brackets", f"{len(widths)} of {len(path)} configurations, widest "
             f"{max(widths):.1e} of the first load factor" if widths else ""),
            ("below them", below(path)),
            ("work", "" if path.work is None else f"area {path.work.area:.6g}, potential "
             f"{path.work.potential:.6g} {path.scene.units.force} {path.scene.units.length}"),
            *(("note", note) for note in path.notes),
            *written,
        ]
    )  # fmt: skip


def _table(path: Displacements) -> Table:
    """A row for each configuration: what it carries, or the reactions of supports that move and the
    widest joints, which are open."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    w, displacement, push = path.units
    names = ["load factor", "lower", "upper"]
    if path.motions:
        names = [f"least reaction ({push})", f"largest reaction ({push})"]
    shows_control = not path.motions or path.control is not None
    names = [f"displacement ({displacement})"] * shows_control + names
    for name in (f"w ({w})", *names):
        table.add_column(name, justify="right")
    table.add_column(f"open ({path.scene.units.length})" if path.motions else "")
    for i, (each, x, is_below) in enumerate(zip(path, path.displacement, path.below, strict=True)):
        marks = ["followed"] * each.is_followed + ["below its bracket"] * is_below
        if path.motions:
            row = [f"[{_down(low)}, {_up(high)}]" for low, high in path.reactions[i].reshape(2, 2)]
            marks += [opened(path.openings(i), 3)]
        else:
            bracket = each.bracket or Bracket()
            row = [rounded(each.load_factor), _down(bracket.lower), _up(bracket.upper)]
        row = [f"{x:.6g}"] * shows_control + row
        table.add_row(f"{each.w:.6g}", *row, ", ".join(filter(None, marks)))
    return table


def _down(value: float) -> str:
    return rounded_down(value) if np.isfinite(value) else ""


def _up(value: float) -> str:
    return rounded_up(value) if np.isfinite(value) else ""


def _verdict(path: Displacements) -> ExitCode:
    is_level = path.slides_away and path.reason == path.headline and path.status != "not-decided"
    if path.status not in ("zero", "falls", "blocked") and not is_level:
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
    zero, or over what is none but for rounding."""
    brackets = [each.bracket for each in path if each.bracket is not None]
    first = abs(path.load_factor[0])
    return [(each.upper - each.lower) / max(first, each.least, 1e-300) for each in brackets]
