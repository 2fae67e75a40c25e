"""``cvxlimit domain``: all load vectors that a structure carries, enclosed with proof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from rich.text import Text

from cvxlimit.cli.interrupting import Tell, interruptible, with_result
from cvxlimit.cli.options import Command, named_values, vector
from cvxlimit.cli.report import SCENE_PICTURES, facts, files_asked
from cvxlimit.cli.shell import ExitCode, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.comparing import DomainComparison, compare_domains
from cvxlimit.extensions.studies.domains.domain import LoadDomain
from cvxlimit.extensions.studies.domains.search import load_domain
from cvxlimit.scene.loads import Load
from cvxlimit.solution import Status


@dataclass(frozen=True, kw_only=True)
class DomainCommand(Command):
    """Enclose all load vectors that a structure carries beside its dead load.

    Model
    -----
    load : NAME=X,Y,Z
        A live load, two or three of them: NAME=X,Y,Z is an acceleration in multiples of gravity,
        NAME=BLOCK:FX,FY,FZ a force at a block's centroid. Unless given: a_x=1,0,0 and a_y=0,1,0.
    surface : NAME
        Yield surface: conic, octagon, 16-gon ..., or exact; several are compared. Unless given:
        conic.
    method : NAME
        Method, as for solve: convex (default), exact, certified or zero-dilatancy.

    Effort
    ------
    tolerance : T
        Relative gap in the worst direction; 0.01 unless given.

    Output
    ------
    plot : OUT.png|.html
        Draw the load domain; .svg and .pdf as well.
    json : OUT
        Write the domain to this JSON file after every solve; the same command continues from it.
    """

    scene: str
    load: list[str] | None = None
    surface: list[str] | None = None
    method: str = "convex"
    tolerance: float = 0.01
    plot: Path | None = None
    json: Path | None = None

    def run(self) -> ExitCode:
        written = files_asked(self, "json", plot=SCENE_PICTURES)
        surfaces = self.surface or ["conic"]
        if len(surfaces) > 1 and self.json is not None:
            raise InputError("--json takes one domain: give one --surface")
        loads = _loads(self.load) if self.load else None

        def enclosed(tell: Tell) -> LoadDomain | DomainComparison:
            scene, told = scene_named(self.scene), with_result(tell)
            if len(surfaces) > 1:
                return compare_domains(scene, surfaces, loads, self.tolerance, progress=told)
            # The surface "exact" is a method, which goes with the conic surface.
            choice: Any = {"surface": surfaces[0], "method": self.method}
            if surfaces[0] == "exact":
                choice = {"surface": "conic", "method": "exact"}
            return load_domain(
                scene, loads, self.tolerance, path=self.json, progress=told, **choice
            )

        found = interruptible(enclosed)
        domains = [found] if isinstance(found, LoadDomain) else list(found.domains.values())
        if self.plot is not None:
            found.plot(str(self.plot))
        for domain in domains:
            show(_summary(domain, written))
        if isinstance(found, DomainComparison):
            show(Text(found.to_dataframe().to_string(index=False, float_format="{:.4g}".format)))
        return _verdict(domains)


def _summary(domain: LoadDomain, written: Sequence[tuple[str, str]]) -> Table:
    """A table of what was found, with the files that were ``written``."""
    kind = domain.surface if domain.method == "convex" else f"{domain.surface}, {domain.method}"
    gap = "nothing is said between points"
    if domain.is_convex:
        width, where = domain.worst
        said = f"{width:.2e}" if np.isfinite(width) else domain.gap_said
        along = ", ".join(f"{x:.3g}" for x in where)
        gap = f"{said} along ({along}), asked: {domain.tolerance:g}"
    basis = "all bounds are proved, up to rounding"
    if not domain.is_proved:
        basis = "some bounds rest on an assumption about the size of forces or rates"
    return facts(
        [
            ("scene", domain.scene_name),
            ("surface", kind),
            *((f"largest {name}", found) for name, found in domain.extent().items()),
            ("largest gap", gap),
            ("points", f"{len(domain.points)}, half-spaces {len(domain.offsets)}"),
            ("unbounded", f"{len(domain.rays)} directions" if len(domain.rays) else ""),
            ("solves", f"{domain.solves} in {domain.seconds:.2f} s"),
            ("basis", basis),
            ("status", str(domain.status)),
            *written,
        ]
    )


def _loads(given: Sequence[str]) -> dict[str, Load]:
    """The live loads of ``--load``, by name: NAME=X,Y,Z or NAME=BLOCK:FX,FY,FZ."""
    loads: dict[str, Load] = {}
    form = "NAME=X,Y,Z is meant, as in push=1,0,0"
    for _, name, value in named_values("--load", given, form):
        block, colon, numbers = value.rpartition(":")
        x, y, z = vector(f"--load {name}", numbers, f"{name}=1,0,0")
        forces = {block: (x, y, z, 0.0, 0.0, 0.0)}
        loads[name] = Load(forces=forces) if colon else Load(acceleration=(x, y, z))
    return loads


def _verdict(domains: Sequence[LoadDomain]) -> ExitCode:
    """The exit code; a domain that was interrupted, or is convex and too wide, is refused."""
    for domain in domains:
        status = domain.status
        is_too_wide = domain.is_convex and not status.is_good
        if status is Status.INTERRUPTED or is_too_wide:
            code = ExitCode.NOT_GOOD_ENOUGH if status.has_answer else ExitCode.NO_ANSWER
            return refuse(code, f"{status}: the largest gap is {domain.gap_said}")
    return ExitCode.SOLVED
