"""``cvxlimit envelope``: a vehicle that crosses a bridge, at many positions."""

# ruff: noqa: RUF009  # options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.text import Text

from cvxlimit.base.files import write_file
from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import (
    OUTPUT,
    argument,
    command_of,
    numbers,
    option,
    surface_option,
    vector,
)
from cvxlimit.cli.report import ExitCode, check_outputs, facts, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.envelopes import Envelope, Vehicle, envelope
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting.look import IMAGES
from cvxlimit.scene.resisting import passive
from cvxlimit.scene.roads import BOUSSINESQ
from cvxlimit.solution import Status


@dataclass(frozen=True, kw_only=True)
class Crossed:
    """What ``cvxlimit envelope`` is asked."""

    scene: str = argument()
    level: float = option("Z", "Level of the road, against gravity.", ...)
    axle: list[str] = option(
        "DISTANCE,FORCE", "An axle by its distance behind the first; give each axle.", ...
    )
    positions: str = option("FROM,TO,NUMBER", "Places of the first axle, at equal distances.", ...)
    along: str = option("X,Y,Z", "Axis of the road; 1,0,0 unless given.", "1,0,0")
    length: float = option("L", "Of the patch that an axle loads on the road; 0.3.", 0.3)
    spread: str = option(
        "S", "How much a load grows on either side per depth, 0.5 unless given; or boussinesq.",
        "0.5",
    )  # fmt: skip
    soil: str | None = option(
        "WEIGHT,K", "Soil up to the road that resists: its unit weight, and K; see passive."
    )
    one_way: bool = option("", "Leave out the way back.", False, "--one-way")
    surface: str = surface_option()
    csv: Path | None = option("OUT", "Write a row for each position.", group=OUTPUT)
    plot: Path | None = option("FILE", "Draw load factors over positions.", group=OUTPUT)
    report: Path | None = option(
        "OUT.html", "Write a page to print and sign, of the worst position.", group=OUTPUT
    )

    def vehicle(self) -> Vehicle:
        spread: Any = self.spread
        if spread != BOUSSINESQ:
            (spread,) = numbers("--spread", spread, "0.5, or boussinesq")
        axles = [numbers("--axle", each, "3.2,115") for each in self.axle]
        return Vehicle([(distance, force) for distance, force in axles], self.length, spread)


@command_of(
    Crossed,
    "Exit code: 0 all positions solved; 2 bad input; 3 none has an answer; 4 some have none, "
    "or are not certified.",
)
def envelope_command(asked: Crossed) -> ExitCode:
    """Find the load factor of a vehicle at each of many positions on a bridge, and the worst."""
    inputs = {} if asked.scene in BUILTIN else {asked.scene: "the scene"}
    outputs = {"--csv": asked.csv, "--plot": asked.plot, "--report": asked.report}
    check_outputs(outputs, inputs, plot=IMAGES, report=(".html",))
    vehicle = asked.vehicle()
    first, last, number = numbers("--positions", asked.positions, "-1,12,27")
    if not (number >= 1.0 and number == int(number)):
        raise InputError(f"--positions {asked.positions}: NUMBER must be whole, 1 or more")
    along = vector("--along", asked.along, "1,0,0")

    def crossed(tell: Tell) -> Envelope:
        scene = scene_named(asked.scene)
        if asked.soil is not None:
            weight, coefficient = numbers("--soil", asked.soil, "20,1.5")
            soil = passive(scene, asked.level, weight, coefficient, along)
            scene = replace(scene, reactions=(*scene.reactions, *soil))
        return envelope(
            scene, vehicle, np.linspace(first, last, int(number)), asked.level, along=along,
            both_ways=not asked.one_way, progress=tell, surface=asked.surface,
        )  # fmt: skip

    found = interruptible(crossed)
    table = found.to_dataframe()
    if asked.csv is not None:
        write_file(asked.csv, table.to_csv(index=False).encode("utf-8"))
    if np.isnan(table["load_factor"]).all():
        return refuse(ExitCode.NO_ANSWER, f"no position has an answer: {found.crossings[0].status}")
    worst, good = found.worst, {str(Status.CERTIFIED), *map(str, _WITHOUT_LIMIT)}
    if asked.plot is not None:
        found.plot(asked.plot)
    if asked.report is not None:
        if worst.solution is None:
            raise InputError("--report: any multiple is carried at all positions: nothing to sign")
        worst.solution.report(asked.report, envelope=found)
    shown = table.to_string(index=False, float_format="{:.6g}".format)
    written = [("written", str(file)) for file in outputs.values() if file is not None]
    show(Text(str(found)), Text(), Text(shown), *([facts(written)] if written else []))
    open_ones = sorted({each.status for each in found.crossings} - good)
    if open_ones:
        return refuse(ExitCode.NOT_GOOD_ENOUGH, f"some positions: {', '.join(open_ones)}")
    return ExitCode.SOLVED


_WITHOUT_LIMIT = (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED, "not on the bridge")
