"""``cvxlimit envelope``: a vehicle that crosses a bridge, at many positions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.text import Text

from cvxlimit.cli.interrupting import Tell, interruptible
from cvxlimit.cli.options import Command, numbers, vector
from cvxlimit.cli.report import facts, files_asked, write_rows
from cvxlimit.cli.shell import ExitCode, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.envelopes import Envelope, Vehicle, envelope
from cvxlimit.plotting.look import IMAGES
from cvxlimit.solution import Status
from cvxlimit.surroundings.resisting import passive
from cvxlimit.surroundings.roads import BOUSSINESQ


@dataclass(frozen=True, kw_only=True)
class EnvelopeCommand(Command):
    """Find the load factor of a vehicle at each of many positions on a bridge, and the worst.

    Model
    -----
    level : Z
        Level of the road, against gravity.
    axle : DISTANCE,FORCE
        An axle by its distance behind the first; give each axle.
    positions : FROM,TO,NUMBER
        Places of the first axle, at equal distances.
    along : X,Y,Z
        Axis of the road; 1,0,0 unless given.
    length : L
        Of the patch that an axle loads on the road; 0.3.
    spread : S
        How much a load grows on either side per depth, 0.5 unless given; or boussinesq.
    soil : WEIGHT,K
        Soil up to the road that resists: its unit weight, and K; see passive.
    one_way
        Leave out the way back.

    Output
    ------
    csv : OUT
        Write a row for each position.
    plot : FILE
        Draw load factors over positions.
    report : OUT.html
        Write a page to print and sign, of the worst position.

    Exit code
    ---------
    0 all positions solved; 2 bad input; 3 none has an answer; 4 some have none, or are not
    certified.
    """

    scene: str
    level: float
    axle: list[str]
    positions: str
    along: str = "1,0,0"
    length: float = 0.3
    spread: str = "0.5"
    soil: str | None = None
    one_way: bool = False
    surface: str = "conic"
    csv: Path | None = None
    plot: Path | None = None
    report: Path | None = None

    def run(self) -> ExitCode:
        written = files_asked(self, "csv", plot=IMAGES, report=(".html",))
        vehicle = self.vehicle()
        first, last, number = numbers("--positions", self.positions, 3, "-1,12,27")
        if not (number >= 1.0 and number == int(number)):
            raise InputError(f"--positions {self.positions}: NUMBER must be whole, 1 or more")
        along = vector("--along", self.along, "1,0,0")

        def crossed(tell: Tell) -> Envelope:
            scene = scene_named(self.scene)
            if self.soil is not None:
                weight, coefficient = numbers("--soil", self.soil, 2, "20,1.5")
                soil = passive(scene, self.level, weight, coefficient, along)
                scene = replace(scene, reactions=(*scene.reactions, *soil))
            return envelope(
                scene, vehicle, np.linspace(first, last, int(number)), self.level, along=along,
                both_ways=not self.one_way, progress=tell, surface=self.surface,
            )  # fmt: skip

        found = interruptible(crossed)
        table = found.to_dataframe()
        write_rows(self.csv, table)
        if np.isnan(table["load_factor"]).all():
            return refuse(
                ExitCode.NO_ANSWER, f"no position has an answer: {found.crossings[0].status}"
            )
        worst, good = found.worst, {str(Status.CERTIFIED), *map(str, _WITHOUT_LIMIT)}
        if self.plot is not None:
            found.plot(self.plot)
        if self.report is not None:
            if worst.solution is None:
                raise InputError(
                    "--report: any multiple is carried at all positions: nothing to sign"
                )
            worst.solution.report(self.report, envelope=found, notes=self.notes())
        shown = table.to_string(index=False, float_format="{:.6g}".format)
        show(Text(str(found)), Text(), Text(shown), *([facts(written)] if written else []))
        open_ones = sorted({each.status for each in found.crossings} - good)
        if open_ones:
            return refuse(ExitCode.NOT_GOOD_ENOUGH, f"some positions: {', '.join(open_ones)}")
        return ExitCode.SOLVED

    def notes(self) -> dict[str, str]:
        """What the page cannot see: what soil was asked for."""
        if self.soil is None:
            return {}
        weight, coefficient = numbers("--soil", self.soil, 2, "20,1.5")
        return {"soil that resists": f"unit weight {weight:g}, K = {coefficient:g}"}

    def vehicle(self) -> Vehicle:
        spread: Any = self.spread
        if spread != BOUSSINESQ:
            (spread,) = numbers("--spread", spread, 1, "0.5, or boussinesq")
        axles = [numbers("--axle", each, 2, "3.2,115") for each in self.axle]
        return Vehicle([(distance, force) for distance, force in axles], self.length, spread)


_WITHOUT_LIMIT = (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED, "not on the bridge")
