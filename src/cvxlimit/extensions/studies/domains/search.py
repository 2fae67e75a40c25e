"""The search for a load domain: it is enclosed from both sides, where the gap is largest next.

The load factors p that a structure carries are a convex set for every convex model. One solve in a
direction d finds the largest d @ p: its forces show a point of the set, its mechanism a half-space
that holds it (``supports.py``). The hull of all points lies inside, what all half-spaces leave lies
outside; the gap is largest at a corner of the latter. So a search has three stages:

1. *first directions*: each load in both senses;
2. *reference*: where the dead load alone does not stand, everything is proved anew about a state
   with some live load, and what needs no solver is added;
3. *next directions*: the one that splits the largest gap, until it is within the tolerance.

Each answer is taken with its mirror images, as far as they are proved, and kept in the file.

Load factors are in natural units in here: the dead load over each live load.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import check_choice, count, of_type, ratio
from cvxlimit.base.progressbar import Progress, progress_bar
from cvxlimit.base.search import searched
from cvxlimit.base.versions import __version__
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.document import read_domain, write_domain
from cvxlimit.extensions.studies.domains.domain import WINDOW, LoadDomain
from cvxlimit.extensions.studies.domains.images import Raw, images
from cvxlimit.extensions.studies.domains.polytopes import FLAT, Inner
from cvxlimit.extensions.studies.domains.supports import Structure, Support
from cvxlimit.extensions.studies.identity import check_version, digest, row_identity
from cvxlimit.io.scenes import LOAD, scene_digest
from cvxlimit.methods.solving import TABLE, MethodName, check, chosen, solve
from cvxlimit.proof.certificate import Certifier
from cvxlimit.readings.moments import Moments
from cvxlimit.readings.named import MomentsName
from cvxlimit.reductions.choice import MODELS, ModelName
from cvxlimit.scene import Scene, check_scene
from cvxlimit.scene.loads import Load, combined
from cvxlimit.solution import Solution, Status
from cvxlimit.surfaces import Cone, Rocking, YieldSurface
from cvxlimit.surfaces.coulomb import SurfaceName

PUSHES = {"a_x": Load(acceleration=(1, 0, 0)), "a_y": Load(acceleration=(0, 1, 0))}
"""Loads unless others are given: pushes of the weight along both horizontal axes."""

METHODS = ("convex", "exact", "certified", "zero-dilatancy")
"""Methods whose load domain is sought; of the first two it is convex."""

NEAR = 0.5 * WINDOW
"""Load factors up to which answers make a reference: farther out the window may have stopped them,
and a state with so much live load says little about the dead load."""


@dataclass(frozen=True, eq=False)
class Study:
    """What any process needs to answer a question: the scene, its loads, and options of solve."""

    scene: Scene
    loads: tuple[Load, ...]
    method: str
    tolerance: float
    directions: int
    options: Mapping[str, Any]

    def __post_init__(self) -> None:
        check_choice("method", self.method, METHODS)
        check_choice("model", self.options["model"], MODELS)
        count(self.directions, 4, "directions")
        ratio(self.tolerance, "tolerance")

    @cached_property
    def structure(self) -> Structure:
        """The compiled problem, which every process makes once."""
        surface, ladder, model = (self.options[n] for n in ("surface", "ladder", "model"))
        made = Structure(self.scene, self.loads, surface, ladder, model, self.tolerance)
        reading = {name: value for name, value in self.options.items() if name == "moments"}
        asked = TABLE[self.method](**reading)
        check(f"method {self.method!r}", made.run, asked.takes)
        flow = asked.flow(made.run.contacts)
        if flow is not None:
            made.certifier = Certifier(made.run.assemblage, (Rocking(),), flow=flow)
        return made

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "structure"}

    def __call__(self, question: tuple[FloatArray, float]) -> tuple[list[Raw | Solution], int]:
        """Returns the answers to a question, and how many solves they took. It is a direction (k,)
        in natural load factors, and how far known rays go along it."""
        direction, along_rays = question
        if self.method == "convex":
            before = len(self.structure.run.history)
            answers = self.structure.answers(direction, WINDOW, along_rays)
            return [*answers], len(self.structure.run.history) - before
        scene = self.scene.with_live(combined(self.loads, self.structure.units * direction))
        answer = solve(scene, method=self.method, **self.options)  # type: ignore[arg-type]
        if answer.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return [answer], 1


class Search:
    """A domain under way: its answers so far, and the next directions to ask in."""

    def __init__(
        self, study: Study, domain: LoadDomain, path: Any, advance: Callable[[str], None]
    ) -> None:
        self.study, self.structure, self.domain = study, study.structure, domain
        self.path, self.advance = path, advance
        self.started, self.written = time.perf_counter() - domain.seconds, -np.inf
        self.asked = list[FloatArray]()  # besides the directions of supports
        self.raw = [raw for s in domain.supports if (raw := self.structure.said(s)) is not None]

    def closed(self, most: int, executor: Any) -> LoadDomain:
        """Returns the domain after questions until its gap is within the tolerance, or ``most``
        solves."""
        status = None
        try:
            first = (way for way in self.first_directions() if not self._was_asked(way))
            self._ask(lambda: next(first, None), None)
            self.refer()
            self._ask(lambda: self._most_useful(most), executor)
        except KeyboardInterrupt:
            if not self.domain.supports:
                raise
            status = Status.INTERRUPTED
        self.written = -np.inf
        self._keep(status or status_of(self.domain))
        return self.domain

    def _most_useful(self, most: int) -> FloatArray | None:
        return next(self.next_directions(), None) if self.domain.solves < most else None

    def _ask(self, following: Callable[[], FloatArray | None], executor: Any) -> None:
        """Asks in the directions that follow, and takes the answers as they come."""

        def question() -> tuple[FloatArray, float] | None:
            if (direction := following()) is None:
                return None
            self.asked.append(direction)
            rays = self.domain.rays / self.domain.units
            rays /= np.abs(rays).max(axis=1, initial=1e-300, keepdims=True)
            return direction, float((rays @ direction).max(initial=-np.inf))

        at_once = _workers(executor)
        for (direction, _), answered in searched(self.study, question, executor, at_once):
            self.take(direction, *answered)
            self._keep(Status.NOT_CERTIFIED)
            is_convex = self.domain.is_convex
            self.advance(f"gap {self.domain.gap_said}" if is_convex else "points one by one")

    def _keep(self, status: Status) -> None:
        """Updates status and time of the domain, and writes its file if that is due."""
        seconds = time.perf_counter() - self.started
        self.domain = replace(self.domain, status=status, seconds=seconds)
        is_last, waited = status is not Status.NOT_CERTIFIED, seconds - self.written
        if self.path is not None and (is_last or waited > 1.0):  # all answers are written each time
            self.written = seconds
            write_domain(self.domain, self.path)

    def take(self, direction: FloatArray, answers: Sequence[Raw | Solution], solves: int) -> None:
        """Adds to the domain what answers and their mirror images prove."""
        supports = list[Support]()
        for answer in answers:
            if isinstance(answer, Solution):
                supports += self._of_solution(direction, answer)
                continue
            for raw in (answer, *images(answer, self.structure.mirrors)):
                self.raw.append(raw)
                supports.append(self.structure.proved(raw))
        domain, every = self.domain, (*self.domain.supports, *supports)
        self.domain = replace(domain, supports=every, solves=domain.solves + solves)

    def _of_solution(self, direction: FloatArray, solution: Solution) -> Iterator[Support]:
        """Yields the supports that a solution in a direction (k,) proves."""
        units, structure = self.domain.units, self.structure
        normal, offset, is_proved = np.zeros(len(units)), np.inf, False
        if solution.mechanism is not None and self.study.method != "zero-dilatancy":
            forces = np.zeros(1) if solution.forces is None else solution.forces
            raw = Raw(
                direction, direction * (solution.load_factor or 0.0), forces=forces, given=forces,
                mechanism=np.array(list(solution.mechanism.values())), is_ray=False,
                iterate=solution.history[-1],
            )  # fmt: skip
            normal, offset, is_proved = structure.half_space(raw)
        ends = [(member.load_factor, False) for member in solution.members]
        for lower, holds in ends or [(solution.lower, solution.bracket.lower_is_proved)]:
            yield Support(
                direction * units, point=lower * direction * units if np.isfinite(lower) else None,
                ray=None, normal=normal / units, offset=offset, point_is_proved=holds,
                half_space_is_proved=is_proved, loaded=direction * units, solution=solution,
            )  # fmt: skip

    def refer(self) -> None:
        """Proves everything anew if there is a better reference than the dead load alone."""
        near = [r for r in self.raw if not r.is_ray and np.abs(r.factors).max() < NEAR]
        supports = self.domain.supports
        if self.structure.refer_to(near) and len(self.raw) == len(supports):
            supports = tuple(self.structure.proved(raw) for raw in self.raw)
        self.domain = replace(self.domain, supports=(*supports, *self._without_solver(supports)))

    def _without_solver(self, supports: Sequence[Support]) -> Iterator[Support]:
        """Yields supports that need no solver: sums of loads that cancel, and the dead load alone
        where nothing else is carried."""
        structure, units = self.structure, self.domain.units
        none = np.zeros(len(units))
        rays = [s.ray for s in supports if s.ray is not None]
        for way in (*structure.idle, *-structure.idle):
            if not any(np.allclose(way * units, ray) for ray in rays):
                yield Support(way * units, None, way * units, none, np.inf, True)
        inner = self.domain.inner
        is_thin = self.study.method == "convex" and (inner is None or inner.is_flat)
        if is_thin and structure.certifier.references.dead_state is not None:
            yield Support(none, structure.centre * units, None, none, np.inf, True)

    def first_directions(self) -> list[FloatArray]:
        """Returns the first directions: each load in both senses, or an even distribution where
        nothing is proved between points."""
        size = len(self.domain.units)
        axes = np.vstack([np.eye(size), -np.eye(size)])
        every = axes if self.domain.is_convex else _around(size, self.study.directions)
        acting = [self.structure.acting(d) for d in every]
        return [d / np.linalg.norm(d) for d in acting if np.linalg.norm(d) > 0.5]

    def next_directions(self) -> Iterator[FloatArray]:
        """Yields directions to ask in, most useful first; none once the gap is within the
        tolerance."""
        domain, inner = self.domain, self.domain.inner
        if inner is None or domain.is_empty:
            return
        if self.study.method == "convex":
            for across in (*inner.across, *-inner.across):
                if not self._was_asked(across):
                    yield self.structure.acting(across)
        corners, gaps = domain.gaps()
        for at in np.argsort(-gaps):
            if gaps[at] <= domain.tolerance:
                return
            for direction in self._splitting(corners[at], float(gaps[at]), inner):
                acting = self.structure.acting(direction)
                if not self._was_asked(acting):
                    yield acting
                    break

    def _splitting(self, corner: FloatArray, gap: float, inner: Inner) -> Iterator[FloatArray]:
        """Yields directions that split a corner's gap, best first; for solves of a load that grows
        it is the corner itself.

        On an ellipse whose tangents meet at an angle, the gap is the square of a sine: so many
        pieces as the angle has of the one that the tolerance allows are needed. An odd number is
        cut unevenly, by the tangent in between, into whole pieces: halves would take one more, and
        end below the tolerance. An even one is halved by the normal of the hull's facet beneath,
        which touches where the corner is farthest off.
        """
        if self.study.method != "convex":
            yield corner / np.linalg.norm(corner)
            return
        domain, step = self.domain, corner - self.domain.centre
        angle = math.asin(math.sqrt(min(gap, 1.0))) / math.asin(math.sqrt(domain.tolerance))
        # up to 2 % over is not worth a piece more: boundaries are ellipses only nearly
        pieces = math.ceil(angle - 0.02)
        if pieces % 2 and len(step) == 2 and not inner.is_flat:
            reach = domain.outer.offsets - domain.outer.normals @ domain.centre
            polar = domain.outer.normals / np.maximum(reach, 1e-300)[:, None]
            order = np.argsort(-(polar @ step))
            first = polar[order[0]]
            others = order[np.abs(polar[order] - first).max(axis=1) > 1e-6 * np.abs(first).max()]
            if len(others):
                share = (pieces // 2) / pieces
                between = (1.0 - share) * first + share * polar[others[0]]
                yield between / np.linalg.norm(between)
        speed, room = inner.normals @ step, inner.offsets - inner.normals @ domain.centre
        yield inner.normals[int((speed / np.maximum(room, 1e-300)).argmax())]

    def _was_asked(self, direction: FloatArray) -> bool:
        """Returns whether this direction, or one that differs by rounding, was asked before."""
        known = [s.direction / self.domain.units for s in self.domain.supports]
        others = np.array([*known, *self.asked]).reshape(-1, len(direction))
        size = np.maximum(np.linalg.norm(others, axis=1), 1e-300)[:, None]
        unit = direction / np.linalg.norm(direction)
        return bool((np.abs(unit - others / size).max(axis=1) < FLAT).any())


def load_domain(
    scene: Scene,
    loads: Mapping[str, Load] | Sequence[Load] | None = None,
    tolerance: float = 0.01,
    *,
    surface: SurfaceName | Cone | Sequence[YieldSurface] = "conic",
    method: MethodName = "convex",
    moments: MomentsName | Moments | None = None,
    ladder: Any = None,
    model: ModelName = "auto",
    most_solves: int = 200,
    directions: int = 16,
    executor: Any = None,
    path: str | os.PathLike[str] | None = None,
    progress: Progress = True,
) -> LoadDomain:
    """Returns all load factors of two or three live loads that a structure carries, enclosed with
    proof.

    Every solve asks how far the loads reach in one direction. Forces prove a point inside, the
    mechanism a half-space that holds the whole set; the next direction is where the gap between
    them is largest. The problem is compiled once, and the mirror image of an answer, where the
    structure has a mirror plane, is checked, not solved for.

    Parameters
    ----------
    scene : Scene
        Its own live load does not matter here.
    loads : mapping of str to Load, or sequence of Load
        Two or three; unit accelerations along x and y unless given.
    tolerance : float
        Relative gap that is asked for, in the worst direction.
    surface, ladder, model
        As for :func:`cvxlimit.solve`.
    method : {"convex", "exact", "certified", "zero-dilatancy"}
        With ``"certified"`` the set need not be convex: half-spaces of the convex relaxation hold
        it, points inside are proved one by one in ``directions`` directions, and nothing is said
        between them. With ``"zero-dilatancy"`` there are points only.
    moments
        As for :func:`cvxlimit.solve`, for the certified method.
    most_solves : int
        Largest number of solver runs.
    directions : int
        For methods without a convex set.
    executor : Executor or dask Client, or None
        Where several directions are asked at once; None is one after another.
    path : path or None
        A JSON file that is written as answers come, once a second at most, and at the end; the
        same call goes on from it.
    progress : bool, callable or None
        A bar on stderr with the gap, or a function that is told.

    Returns
    -------
    LoadDomain
        Its ``to_dataframe()`` has a row for each direction that was solved.

    Raises
    ------
    InputError
        For an object that is no scene, loads that are not two or three or are all zero, or a file
        of another domain.
    ModelError
        For options that do not exist.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> domain = load_domain(builtin_scene("arch"), tolerance=0.05, progress=False)
    >>> domain.gap <= 0.05, domain.is_proved
    (True, True)
    """
    check_scene(scene)
    count(most_solves, 1, "most_solves")
    named = named_loads(loads)
    options = {"surface": surface, "ladder": ladder, "model": model}
    if moments is not None:
        options["moments"] = moments
    if method == "exact":
        options["tolerance"] = max(1e-3, 0.1 * tolerance)
    study = Study(scene, tuple(named.values()), method, tolerance, directions, options)
    chosen(surface, method, {"moments": moments})  # refuses what does not go together
    structure, is_convex = study.structure, method in ("convex", "exact")
    domain = LoadDomain(
        scene.name, structure.run.surface, method, named, structure.units, (),
        Status.NOT_CERTIFIED, tolerance, is_convex, scene_digest=scene_digest(scene, ["dead"]),
        versions={"cvxlimit": __version__},
    )  # fmt: skip
    if path is not None:
        domain = replace(domain, about=_about(study))
        domain = _gone_on(path, domain) if os.path.exists(path) else domain
    title = f"domain of {scene.name}"
    with progress_bar(title, most_solves, progress, domain.solves) as advance:
        return Search(study, domain, path, advance).closed(most_solves, executor)


def _gone_on(path: str | os.PathLike[str], domain: LoadDomain) -> LoadDomain:
    """Returns the domain with the answers in its file; InputError for another domain's."""
    known = read_domain(path)
    check_version(path, "a domain", known.versions.get("cvxlimit"), "file, or delete it")
    if known.about != domain.about:
        raise InputError(
            f"{path}: holds the domain of another scene, other loads or other options (scene "
            f"{known.scene_name!r}, {known.surface}, {known.method}): take another file, or "
            "delete it"
        )
    return replace(domain, supports=known.supports, solves=known.solves, seconds=known.seconds)


def _about(study: Study) -> str:
    """Returns a digest of all that the set depends on, but not of tolerance and solvers."""
    plain = [LOAD.write(load, "a load", "a domain") for load in study.loads]
    asked = [digest(study.options.get(name), f"option {name!r}") for name in ("surface", "moments")]
    asked.append(digest(["domain", study.method, plain], "the domain"))
    return row_identity(digest(asked, "the domain"), study.structure.run.given, {})


def status_of(domain: LoadDomain) -> Status:
    """Returns the status of a finished domain."""
    if domain.is_empty:
        return Status.DEAD_LOAD_UNSTABLE
    if domain.is_convex:
        return Status.CERTIFIED if domain.gap <= domain.tolerance else Status.NOT_CERTIFIED
    found = [s.solution.status for s in domain.supports if s.solution is not None]
    bad = [each for each in found if not each.is_good]
    return bad[0] if bad or not found else found[0]


def named_loads(loads: Mapping[str, Load] | Sequence[Load] | None) -> dict[str, Load]:
    """Returns two or three loads by name; raises InputError for anything else."""
    given = PUSHES if loads is None else loads
    of_type(given, (Mapping, Sequence), "loads must be a mapping or a sequence of Load")
    if not isinstance(given, Mapping):
        given = {f"load {i}": load for i, load in enumerate(given, 1)}
    if not 2 <= len(given) <= 3:
        raise InputError(f"a load domain has two or three loads, got {len(given)}")
    for name, load in given.items():
        if not isinstance(load, Load):
            raise InputError(f"{name} must be a Load, got {load!r:.60}: write Load(...)")
    return dict(given)


def _workers(executor: Any) -> int:
    """Returns how many directions are asked at once: one for each process of a pool, whose number
    :mod:`concurrent.futures` has no public name for, and four of any other executor. More would
    only be chosen with fewer answers known."""
    return int(getattr(executor, "_max_workers", 4))


def _around(size: int, number: int) -> FloatArray:
    """Returns unit vectors (number, size), evenly distributed."""
    each = np.arange(number)
    turn = 2.0 * np.pi * each / number
    if size == 2:
        return np.stack([np.cos(turn), np.sin(turn)], axis=1)
    height = 1.0 - (2.0 * each + 1.0) / number
    turn = np.pi * (1.0 + 5.0**0.5) * each  # a spiral by the golden angle
    flat = np.sqrt(1.0 - height**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
