"""What is run: one experiment per row of the page, and how one is run within a time of its own."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks.scenes import scene_of as by_name
from cvxlimit import Scene, Solution, solve
from cvxlimit.errors import CvxlimitError
from cvxlimit.masonry import BUILTIN
from cvxlimit.methods.certified import Certified
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.named import MOMENTS, Paper
from cvxlimit.solution.bracket import known
from cvxlimit.solvers import SolverSettings, settings_for

AXES = tuple(Paper((one, two)) for one in (1, -1) for two in (1, -1))
"""The paper's reading with the four choices of signs of the contacts' axes."""

READINGS: dict[str, Moments] = {**MOMENTS, **{reading.name: reading for reading in AXES}}

WALLS = tuple(f"random-wall-{seed}" for seed in (1, 2, 3, 5, 7, 8, 11, 12, 13, 16))
"""Irregular walls of 14 to 46 contacts whose live load does harm."""

SETTINGS_SCENES = ("tuff-wall", "random-wall-1", "random-wall-2", "random-wall-11")
"""Where all readings with signs are run with other settings, on the exact cone."""

PANELS = (("tuff-wall", 30), ("s12-panel", 8), ("s10-panel", 5))
"""Where the paper's own reading is run with other settings and block orders, on the octagon as in
the paper, and iterations at most."""

LADDERS = {"HIGHS": settings_for("HIGHS", None, "HIGHS ipm", solver="ipm")}
"""Solvers with options: HiGHS's interior point and then a corner of the optimal face, as the
paper's Mosek does by default; its simplex takes minutes here."""

LEAST: dict[str, Any] = {"epsilon": 1e-2, "regularisation": 1e-3}
"""Forces of least norm, so that neither rounding nor the solver picks them."""

CHANGES: tuple[dict[str, Any], ...] = (
    *({"epsilon": epsilon} for epsilon in (1e-3, 1e-2, 1e-1)),
    *({"weight": weight} for weight in (0.0, 0.5, 0.95)),
    LEAST,
)
"""Settings other than the defaults, one at a time."""

FIRST = "first"
"""Kind of an experiment without interaction: the first convex problem, the measure of time."""


@dataclass(frozen=True)
class Experiment:
    """One run.

    Attributes
    ----------
    part : {"tables", "orders", "settings", "brackets"}
        Where on the page it belongs.
    scene : str
        A built-in scene's name or ``random-wall-SEED``.
    moments : str
        Name of a reading in :data:`READINGS`.
    kind : {"fixed-point", "certified", "first"}
    surface, weight, epsilon, solver : the iteration's settings
        ``solver`` "" is the default ladder; others are those of :data:`LADDERS`, or names.
    order : int
        Seed of a permutation of the blocks; -1 leaves them as they are.
    most : int
        Iterations at most.
    regularisation : float
        Weight of the forces' squared norm.
    """

    part: str
    scene: str
    moments: str
    kind: str = "fixed-point"
    surface: str = "conic"
    weight: float = 0.8
    epsilon: float = 0.0
    solver: str = ""
    order: int = -1
    most: int = 30
    regularisation: float = 0.0

    @property
    def key(self) -> str:
        """Tells experiments apart."""
        return "|".join(f"{value}" for value in vars(self).values())


DEFAULTS = "as it is"
"""Name of the default settings."""


def setting(e: Experiment) -> str:
    """What is not as by default."""
    if e.solver:
        return f"solver {e.solver}"
    if e.weight != Experiment.weight:
        return f"beta {e.weight:g}"
    least = ", least forces" if e.regularisation else ""
    return f"epsilon {e.epsilon:g}{least}" if e.epsilon else DEFAULTS


@dataclass(frozen=True)
class Result:
    """What came out: history of load factors and bounds, with CPU seconds after every solve."""

    status: str
    load_factor: float | None
    lower: float | None
    upper: float | None
    seconds: float
    contacts: int
    solves: int
    factors: tuple[float | None, ...] = ()
    clock: tuple[float, ...] = ()
    lowers: tuple[float | None, ...] = ()
    uppers: tuple[float | None, ...] = ()
    measured: str = ""


def experiments() -> Iterator[Experiment]:
    """All of them, the page's most important ones first."""
    yield from _tables()
    yield from _brackets()
    yield from _settings()
    yield from _orders()


def _tables() -> Iterator[Experiment]:
    """The paper's Tables 8 and 10 and its tuff wall, under every reading: octagon, weight 0.8."""
    for scene, most in (("s12-panel", 20), ("s10-panel", 8), ("tuff-wall", 30)):
        for reading in (*AXES, *(m for m in MOMENTS.values() if m.name != "paper")):
            yield Experiment("tables", scene, reading.name, surface="octagon", most=most)


def _brackets() -> Iterator[Experiment]:
    """Certified brackets and the paper's iteration beside them, on the exact cone."""
    apart = ("tuff-wall", "s12-panel", "s10-panel", "dome")
    small = [name for name in BUILTIN if name not in apart]
    for scene in ("tuff-wall", "s12-panel", "s10-panel", *WALLS, *small, "dome"):
        yield Experiment("brackets", scene, "none", FIRST)
        for moments in ("independent", "signed", "paper"):
            yield Experiment("brackets", scene, moments, "certified")
            yield Experiment("brackets", scene, moments, most=8 if scene == "s10-panel" else 20)
        for reading in (
            (*AXES[1:], MOMENTS["signed-torsion-bending"]) if scene == "tuff-wall" else ()
        ):
            yield Experiment("brackets", scene, reading.name, "certified")


def _settings() -> Iterator[Experiment]:
    """What the iteration depends on: epsilon, the old values' weight, the solver."""
    for scene, most in PANELS:
        for change in ({"solver": ""}, *CHANGES, {"solver": "QOCO"}, {"solver": "HIGHS"}):
            yield Experiment("settings", scene, "paper", surface="octagon", most=most, **change)
    for scene in SETTINGS_SCENES:
        for moments in ("signed", "signed-torsion-bending", "paper"):
            for change in ({"solver": ""}, *CHANGES, {"solver": "QOCO"}, {"solver": "CVXOPT"}):
                yield Experiment("settings", scene, moments, most=40, **change)


def _orders() -> Iterator[Experiment]:
    """Blocks in other orders: which of many possible forces a solver returns depends on it."""
    for order in range(12):
        for moments in ("signed", "paper"):
            yield Experiment("orders", "tuff-wall", moments, order=order, most=30)
    for (scene, most), count in zip(PANELS, (12, 6, 3), strict=True):
        for order in range(count):
            own = {"surface": "octagon", "order": order, "most": most}
            yield Experiment("orders", scene, "paper", **own)
            if order < 2:
                yield Experiment("orders", scene, "paper", **own, **LEAST)


def scene_of(experiment: Experiment) -> Scene:
    """The scene, with its blocks in the order asked for."""
    scene = by_name(experiment.scene)
    if experiment.order < 0:
        return scene
    blocks = np.array(scene.blocks, dtype=object)
    shuffled = np.random.default_rng(experiment.order).permutation(blocks)
    return replace(scene, blocks=tuple(shuffled))


def run(experiment: Experiment, seconds: float) -> Result:
    """Run here; after ``seconds`` of CPU time it is interrupted, and keeps its bracket."""
    scene, started = scene_of(experiment), process_time()
    stamps: list[float] = []

    def progress(message: str) -> None:
        if message.startswith("solve "):
            stamps.append(process_time() - started)
        if process_time() - started > seconds:
            raise KeyboardInterrupt

    moments = READINGS.get(experiment.moments, "independent")
    methods = {
        "certified": Certified(moments=moments),
        "fixed-point": FixedPoint(
            experiment.weight,
            max_iterations=experiment.most,
            epsilon=experiment.epsilon,
            regularisation=experiment.regularisation,
            moments=moments,
        ),
        FIRST: None,
    }
    contacts = len(scene.contacts)
    try:
        solution = solve(
            scene,
            experiment.surface,
            method=methods[experiment.kind],
            ladder=_ladder(experiment.solver),
            progress=progress,
        )
    except KeyboardInterrupt:
        return _nothing(f"stopped after {seconds:.0f} s of CPU", process_time() - started, contacts)
    except CvxlimitError as error:
        return _nothing(str(error), process_time() - started, contacts)
    return _result(solution, stamps, process_time() - started)


def _ladder(solver: str) -> list[str | SolverSettings] | None:
    return [LADDERS.get(solver, solver)] if solver else None


def _result(solution: Solution, stamps: list[float], seconds: float) -> Result:
    history = solution.history
    return Result(
        str(solution.status),
        solution.load_factor,
        known(solution.lower),
        known(solution.upper),
        seconds,
        solution.contacts,
        len(history),
        tuple(entry.load_factor for entry in history),
        tuple(stamps[: len(history)]),
        tuple(entry.lower for entry in history),
        tuple(entry.upper for entry in history),
    )


def _nothing(status: str, seconds: float, contacts: int) -> Result:
    return Result(status, None, None, None, seconds, contacts, 0)


class Apart:
    """Runs experiments in one process of their own, a new one where a single solve overran.

    A process for each would spend two seconds importing, more than most of them take.
    """

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None

    def __call__(self, experiment: Experiment, seconds: float) -> Result:
        """As :func:`run`. The child counts CPU seconds; on a busy machine they take longer."""
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"))
        started = perf_counter()
        try:
            return self._pool.submit(run, experiment, seconds).result(60.0 + 6.0 * seconds)
        except (TimeoutError, BrokenProcessPool):
            self.end()
            return _nothing("no answer from one solve", perf_counter() - started, 0)

    def end(self) -> None:
        """End the process, whatever it does."""
        if self._pool is not None:
            for process in list(self._pool._processes.values()):
                process.kill()
            self._pool.shutdown(cancel_futures=True)
        self._pool = None


Pair = tuple[Experiment, Result]


def to_row(experiment: Experiment, result: Result) -> dict[str, Any]:
    """As both are stored: seven digits are enough for tables and pictures."""

    def short(value: object) -> object:
        if isinstance(value, float):
            return float(f"{value:.7g}")
        return [short(v) for v in value] if isinstance(value, tuple) else value

    found = {name: short(value) for name, value in asdict(result).items()}
    return {"key": experiment.key, "experiment": asdict(experiment), "result": found}


def from_row(row: dict[str, Any]) -> Pair:
    """From what is stored."""
    result = {k: tuple(v) if isinstance(v, list) else v for k, v in row["result"].items()}
    return Experiment(**row["experiment"]), Result(**result)
