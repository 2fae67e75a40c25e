"""Rows of a sweep: each variation is solved, and what scenes of one geometry share is computed
once."""

from __future__ import annotations

import json
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np

from cvxlimit.base.checks import check_choice, is_number, meant, ratio
from cvxlimit.errors import CvxlimitError, InputError, ModelError
from cvxlimit.extensions.studies.identity import digest, row_identity
from cvxlimit.extensions.studies.patched import PatchedProblem, strengths_of
from cvxlimit.extensions.studies.store import IDENTITY, PROOF
from cvxlimit.extensions.studies.variations import Family
from cvxlimit.io.results import result_to_dict
from cvxlimit.methods.solving import TABLE, solve
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.readings.named import parse_moments
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution import FromRest, Solution, Status
from cvxlimit.solution.bracket import TOLERANCE
from cvxlimit.solution.said import said
from cvxlimit.solvers import asked_ladder, ladder_of
from cvxlimit.surfaces.coulomb import surfaces_of

Row = dict[str, Any]

FIGURES = ("load_factor", "lower", "upper", "gap", "least_factor", "dilatancy")
TEXTS = ("status", "note", "error", "solver")
RESULTS = (*FIGURES, *TEXTS, "seconds")
"""Columns of a sweep besides its parameters."""

OF_A_WAY = (
    "from_rest_to_come", "from_rest_limit", "from_rest_spread_least", "from_rest_spread_most",
    "from_rest_beds_least", "from_rest_beds_most",
)  # fmt: skip
"""Columns besides of method ``"incremental"``: what may be to come, the proved limit if joints open
as they slide, and the other ends."""

_LOADS = ("live", "dead")
"""Parameters of :func:`varied` that are no numbers."""

_OF_A_RUN = ("scene", "progress", "verbose")

_USUAL = {
    name: each.default
    for name, each in signature(solve).parameters.items()
    if name not in _OF_A_RUN
}
OPTIONS = tuple(_USUAL)
"""Options of :func:`cvxlimit.solve`, which may be parameters of a sweep as well."""

_CHECKS: dict[str, Callable[[Any], object]] = {
    "surface": surfaces_of,
    "moments": parse_moments,
    "ladder": ladder_of,
    "solver": ladder_of,
    "tolerance": lambda value: ratio(value, "tolerance"),
    "method": lambda value: check_choice("method", value, TABLE),
    "model": lambda value: check_choice("model", value, MODELS),
}
"""What refuses the name of an option's value that does not exist."""


class Structures:
    """Contacts and mechanics of the last few geometries, with the problems stated for them."""

    def __init__(self) -> None:
        self._known: OrderedDict[str, Assemblage] = OrderedDict()
        self._problems: OrderedDict[object, PatchedProblem | None] = OrderedDict()

    def mechanics(self, scene: Scene) -> Scene | Assemblage:
        """Returns the scene with contacts, equilibrium and factorisation of one of its geometry.

        Scenes with mortar that bears tension, or reactions that push at least so much, keep to
        themselves: their loads follow from their strength.
        """
        is_loaded = any(r.least > 0.0 or r.most < 0.0 for r in scene.reactions)
        if is_loaded or scene.tensile_strength or scene.contact_tensile_strength:
            return scene
        known = self._known.get(scene.geometry)
        if known is None:
            assemblage = Assemblage.of(scene)
            _put(self._known, scene.geometry, assemblage)
            return assemblage
        self._known.move_to_end(scene.geometry)
        return known.like(scene.sharing_contacts_of(known.scene))

    def problem(self, given: Assemblage, options: Row) -> PatchedProblem | None:
        """Returns the problem of all rows of this geometry under one surface, None if they are not
        one convex problem with different numbers."""
        if not _is_patched(options):
            return None
        surface = options.get("surface", "conic")
        key = given.scene.geometry, repr(surface), strengths_of(given.contacts)
        if key not in self._problems:
            _put(self._problems, key, PatchedProblem.of(given, surface))
        self._problems.move_to_end(key)
        return self._problems[key]


def _put(kept: OrderedDict[Any, Any], key: object, value: object) -> None:
    """Adds an entry to a cache that keeps the last four.

    Parameters that change the geometry come in random order, and 1,000 contacts take 20 MB.
    """
    kept[key] = value
    if len(kept) > 4:
        kept.popitem(last=False)


def check_option(name: str, value: object) -> None:
    """Raises ModelError or InputError for an option that :func:`cvxlimit.solve` refuses."""
    if name not in OPTIONS:
        raise ModelError(
            f"solve has no option {name!r}: it has {', '.join(OPTIONS)}; parameters of the scene "
            "go into the grid" + meant(name, OPTIONS, before="; ")
        )
    if name in _CHECKS and isinstance(value, (str, float, int)):
        _CHECKS[name](value)


@dataclass(frozen=True, eq=False)
class Study:
    """What is done with every variation: its scene is built, solved and measured."""

    scenes: Callable[..., Scene] | Scene
    options: Mapping[str, Any] = field(default_factory=dict)
    measure: Callable[[Solution], Mapping[str, Any]] | None = None
    asked: str = ""
    """Digest of all that is asked of every row, where rows are stored; else empty."""
    stored: frozenset[str] = frozenset()
    """Identities of the rows that are there already."""

    def __post_init__(self) -> None:
        if not (isinstance(self.scenes, Scene) or callable(self.scenes)):
            raise InputError(
                f"scenes must be a Scene or a function that returns one, got {self.scenes!r:.60}"
            )
        for name, value in self.options.items():
            check_option(name, value)
        if self.measure is not None and not callable(self.measure):
            raise ModelError(f"measure must be a function of a solution, got {self.measure!r:.60}")

    @cached_property
    def family(self) -> Family:
        """The scenes by their parameters."""
        return Family(self.scenes)

    @cached_property
    def known(self) -> Structures:
        """What its rows share in this process."""
        return Structures()

    def __getstate__(self) -> dict[str, Any]:
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def split(self, variation: Mapping[str, Any]) -> tuple[Row, Row]:
        """Returns a variation's parameters of the scene, and its options of the solve."""
        own = self.family.parameters
        for_solve = {k: v for k, v in variation.items() if k in OPTIONS and k not in own}
        return {k: v for k, v in variation.items() if k not in for_solve}, for_solve

    def check(self, variations: Sequence[Mapping[str, Any]]) -> None:
        """Raises errors for what cannot be varied, and for values without a meaning, before any
        solve.

        Values out of their range are rows with an error: others may be good.
        """
        self.family.check(self.split(variations[0])[0], OPTIONS)
        for variation in variations:
            parameters, for_solve = self.split(variation)
            for name, value in for_solve.items():
                check_option(name, value)
            for name, value in parameters.items() if isinstance(self.scenes, Scene) else ():
                if name not in _LOADS and not (value is None or is_number(value)):
                    raise InputError(f"{name} must be a number, got {value!r:.60}")

    def to_be_stored(self) -> Study:
        """Returns the study for rows that are stored, with the digest of all that is asked.

        Raises
        ------
        ModelError
            If an option or the measure holds what cannot be told apart.
        """
        given = {**_USUAL, **self.options}
        parts = [digest(x, f"option {name!r}") for name, x in given.items()]
        parts.append(digest(self.measure, "measure"))
        return replace(self, asked=digest(parts, "the sweep"))

    def __call__(self, group: Sequence[tuple[str, Row]]) -> list[Row]:
        """Returns the rows of some variations, which are given with their names."""
        return [self.row(variation) for _, variation in group]

    def row(self, variation: Mapping[str, Any]) -> Row:
        """Returns the answer to one variation. Where rows are stored it has its identity, alone if
        that is stored already, and otherwise with the result file that proves it."""
        start = time.perf_counter()
        result: Row = dict.fromkeys(FIGURES, np.nan) | dict.fromkeys(TEXTS, "")
        try:
            parameters, options = self.split(variation)
            scene = self.family.scene(parameters)
            if self.asked:
                result[IDENTITY] = row_identity(self.asked, scene, options)
                if result[IDENTITY] in self.stored:
                    return {IDENTITY: result[IDENTITY]}
            result |= self._solved(scene, options)
        except CvxlimitError as error:
            result["error"] = str(error)
        except Exception as error:  # a factory may raise what it likes; the row keeps the reason
            result["error"] = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
        if self.asked and IDENTITY not in result:  # there is no scene: it is tried every time
            result[IDENTITY] = digest([self.asked, dict(variation), result["error"]], "the row")
            if result[IDENTITY] in self.stored:
                return {IDENTITY: result[IDENTITY]}
        return result | {"seconds": time.perf_counter() - start}

    def _solved(self, scene: Scene, options: Row) -> Row:
        """Returns the results of one scene, by column."""
        solution = _answer(self.known, scene, {**self.options, **options})
        figures = results_of(solution)
        figures |= dict(self.measure(solution) if self.measure else {})
        if self.asked:
            figures[PROOF] = json.dumps(result_to_dict(solution))
        return figures


def results_of(solution: Solution) -> Row:
    """Returns what a row says of its solution, by column."""
    factor, end, slides = solution.load_factor, solution.lower_end, solution.dilatancy
    from_rest = {} if solution.from_rest is None else _of_a_way(solution.from_rest)
    return {
        "load_factor": np.nan if factor is None else factor,
        "lower": solution.lower,
        "upper": solution.upper,
        "gap": solution.gap,
        "least_factor": np.nan if end is None else end.load_factor,
        "dilatancy": np.nan if slides is None else slides.share,
        "status": str(solution.status),
        "note": said(solution).headline,
        "solver": solution.history[-1].solver if solution.history else "",
        **from_rest,
    }


def _of_a_way(way: FromRest) -> Row:
    """Returns the columns that only a way from rest has, whose end is the load factor."""
    values = [way.to_come, way.limit]
    for trials in (way.spread, way.draws):
        ends = [trial.load_factor for trial in trials if trial.load_factor is not None]
        values += [min(ends, default=None), max(ends, default=None)]
    found = zip(OF_A_WAY, values, strict=True)
    return {name: np.nan if value is None else value for name, value in found}


def _answer(known: Structures, scene: Scene, options: Row) -> Solution:
    """Returns the solution of a scene, by the shared problem where there is one."""
    given, solution = known.mechanics(scene), None
    problem = known.problem(given, options) if isinstance(given, Assemblage) else None
    if problem is not None and isinstance(given, Assemblage):
        ladder = asked_ladder(options.get("solver"), options.get("ladder"))
        tolerance = options.get("tolerance") or TOLERANCE
        solution = problem.solve(given, tolerance=tolerance, ladder=ladder)
    if solution is None:
        solution = solve(given, **options)
    if solution.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return solution


def _is_patched(options: Row) -> bool:
    """Returns whether options mean one convex problem, whatever the choice of model."""
    others = options.keys() - {"surface", "method", "tolerance", "solver", "ladder", "model"}
    is_plain = all(options[name] == _USUAL[name] for name in others)
    return (
        is_plain and options.get("method") in (None, "convex") and options.get("model") != "least"
    )
