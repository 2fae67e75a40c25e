"""``cvxlimit solve``: the collapse load factor of a scene."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import SCENE, argument, option, result_option, taking
from cvxlimit.cli.outputs import ExitCode
from cvxlimit.cli.solutions import Files, deliver
from cvxlimit.errors import ModelError
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.interaction.readings.named import MOMENTS
from cvxlimit.methods.solving import solve
from cvxlimit.methods.table import TABLE, words
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

EXIT_CODES = (
    "Exit code: 0 solved; 2 bad input; 3 no answer exists (the dead load cannot stand, or the "
    "live load does no harm); 4 not converged, or not certified to the tolerance."
)
"""Shown below the command's help."""


@dataclass(frozen=True, kw_only=True)
class Order:
    """What ``cvxlimit solve`` was asked to do."""

    scene: str = argument(
        f"{SCENE} A built-in name wins over a file of that name: write ./NAME for the file."
    )
    surface: str = option(
        "conic|parabolic|octagon|K-gon",
        "Yield surface: the exact cone; torsion and shear on a parabola nearer the exact limit, at "
        "the same price; the paper's 8 facets, or any K, as in 16-gon. Facets are on the unsafe "
        "side; octagon-inscribed or 16-gon-inscribed on the safe one.",
        "conic",
    )
    method: str | None = option(
        "|".join(TABLE),
        "; ".join(f"{name}: {row.method.answers}" for name, row in TABLE.items())
        + ". Unless given: convex.",
    )
    interaction: str | None = option(
        "|".join(words("interaction")),
        "Older spelling of --method fixed-point and --method certified.",
    )
    moments: str | None = option(
        "|".join(MOMENTS),
        "How the interaction adds moments: every sign on its own, the safe reading; static torsion "
        "about the pressure centre, without or with the paper's Eq. 27; or the paper's own "
        "reading, which depends on the contacts' axes. For methods with interaction only; unless "
        "given: independent.",
    )
    torsion_shear: str | None = option(
        "|".join(words("torsion_shear")),
        "Older spelling of --surface parabolic and --method exact.",
    )
    flow: str | None = option(
        "|".join(words("flow")), "Older spelling of --method zero-dilatancy and --method gilbert."
    )
    json: Path | None = result_option()
    plot: Path | None = option(
        "OUT.png|.html|.vtu",
        "Draw the mechanism: a picture, an interactive page, or files for ParaView.",
    )
    export: Path | None = option(
        "OUT.csv|.obj|.glb",
        "Write the contacts with their forces (CSV), or the blocks, for other programs.",
    )
    tolerance: float | None = option(
        "WIDTH",
        "Asked width of the bracket, relative to its larger bound; the fixed point stops at a "
        "change of this size. Unless given: 1e-5 without interaction, 1e-4 for the fixed point, "
        "1e-3 for exact torsion-shear; the certified method goes as far as it can, and 0.05 counts "
        "as good.",
    )
    model: str = option(
        "|".join(MODELS),
        "How much model: no more than the scene needs, all of it, or the least that is valid "
        "whether it pays or not. The bounds are those of the full scene in any case; cvxlimit "
        "explain SCENE says what is left out.",
        "auto",
    )
    branching_seconds: float | None = option(
        "S",
        "Time for branch and bound, which narrows the certified interaction's bracket. Unless "
        "given: 60 where a tolerance is asked for, or a scene has few contacts; else what is left "
        "of ten seconds, or of thirty solves without interaction.",
    )
    workers: int = option("N", "Processes that branch and bound uses.", 1)

    def settings(self) -> dict[str, str | float | Certified | None]:
        names = ("method", "moments", "interaction", "torsion_shear", "flow", "tolerance", "model")
        given = {name: getattr(self, name) for name in names}
        if self.branching_seconds is None and self.workers == 1:
            return given
        if Certified.name not in (self.method, self.interaction):
            raise ModelError("--branching-seconds and --workers go with --method certified")
        if self.workers > 1 and self.branching_seconds == 0.0:
            raise ModelError(
                f"--workers {self.workers} does nothing without branch and bound: give "
                "--branching-seconds S above 0, or leave that out"
            )
        asked = Certified(branching_seconds=self.branching_seconds, workers=self.workers)
        return {**given, "method": asked, "interaction": None}


@taking(Order)
def solve_command(order: Order) -> ExitCode:
    """Find the collapse load factor of a scene, with a bracket recomputed outside the solver."""
    files = Files(order.json, order.plot, order.export)
    files.check(order.scene)
    settings = order.settings()

    def solved(tell: Tell) -> tuple[Scene, Solution]:
        scene = scene_named(order.scene)
        return scene, solve(scene, order.surface, progress=tell, **settings)  # type: ignore[arg-type]

    scene, solution = interruptible(solved)
    return deliver(scene, order.scene, solution, files, order.tolerance)
