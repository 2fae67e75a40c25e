"""``cvxlimit explain`` and ``show``: look at a scene before it is solved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from rich.text import Text

from cvxlimit.base.lines import one_line
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import Command
from cvxlimit.cli.report import SCENE_PICTURES, counted, facts, files_asked, warn_of_geometry
from cvxlimit.cli.shell import ExitCode, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.methods.solving import TABLE
from cvxlimit.plotting import plot_scene, refused
from cvxlimit.reductions.explaining import explain
from cvxlimit.scene import Scene


@dataclass(frozen=True, kw_only=True)
class ExplainCommand(Command):
    """Report the size of the model, the solver and the expected time of every method, without
    solving."""

    scene: str
    surface: str = "conic"
    model: str = "auto"

    def run(self) -> ExitCode:
        given: Any = {"surface": self.surface, "model": self.model}
        found = interruptible(lambda tell: explain(scene_named(self.scene), **given))
        title, *lines = str(found).splitlines()
        answers = [f"{name}: {method.answers}" for name, method in TABLE.items()]
        show(Text("\n".join([one_line(title), *lines, "", *answers])))
        return ExitCode.SOLVED


@dataclass(frozen=True, kw_only=True)
class ShowCommand(Command):
    """Draw a scene before it is solved: blocks, supports, joints, loads, near misses.

    A scene whose geometry is refused is drawn with the blocks to blame in red.

    Output
    ------
    plot : OUT.png|.html
        Picture, or page to turn and point at. Unless given, a page in a temporary folder.
    """

    scene: str
    plot: Path | None = None

    def run(self) -> ExitCode:
        files_asked(self, plot=SCENE_PICTURES)

        def checked(tell: Tell) -> tuple[Scene, InputError | None]:
            scene = scene_named(self.scene)
            tell("finding contacts")
            return scene, refused(scene)

        scene, refusal = interruptible(checked)
        plot = self.plot or Path(mkdtemp(prefix="cvxlimit-")) / f"{Path(self.scene).stem}.html"
        written = [("written", str(path)) for path in plot_scene(scene, plot, refusal)]
        free, fixed = (
            counted(len(scene.free), "free block"),
            counted(len(scene.supports), "support"),
        )
        contacts = "" if refusal else f" x {counted(len(scene.contacts), 'contact')}"
        rows = [
            ("scene", scene.name),
            ("size", f"{free}, {fixed}{contacts}"),
            ("weight", f"{scene.total_weight:.6g} {scene.units.force}"),
            *((f"{case} load", _load(scene, case)) for case in ("dead", "live")),
            *written,
        ]
        if self.plot is None:
            rows.append(("to see it", "open that file in a browser"))
        show(facts(rows))
        if refusal is not None:
            raise refusal
        warn_of_geometry(scene)
        return ExitCode.SOLVED


def _load(scene: Scene, case: str) -> str:
    """The resultant of a load, components of rounding left out, and the number of pressures."""
    load, resultant = getattr(scene, case), getattr(scene, f"{case}_forces")[:, :3].sum(axis=0)
    resultant[abs(resultant) <= 1e-9 * abs(resultant).max()] = 0.0
    along = ", ".join(f"{x:.6g}" for x in resultant)
    pressures = f", {counted(len(load.pressures), 'pressure')}" if load.pressures else ""
    return f"{along} {scene.units.force} in all{pressures}"
