"""Rows of a sweep that need no solve: those of smaller and larger strengths enclose them.

Without interaction, every condition of a contact is a norm of forces, friction not in it, that is
at most a sum of resistances: mu N with N >= 0, c A, pressures up to f and down to -t. So what is
carried stays so when one of these grows: a lower bound holds for all larger values, an upper bound
for all smaller ones, whatever loads are live. Where mortar bears tension, N may be below zero and
mu t is taken off the cohesion: friction is then like any other parameter. With interaction or
without dilatancy more friction may mean less strength, and nothing is transferred.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cvxlimit.arrays import BoolArray
from cvxlimit.bracket import Bracket
from cvxlimit.checks import ratio
from cvxlimit.errors import ModelError
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.table import USUAL, chosen
from cvxlimit.scene import Scene
from cvxlimit.solution import Status
from cvxlimit.strengths import PROPERTIES
from cvxlimit.studies.rows import FIGURES, TEXTS, Row, Study
from cvxlimit.surfaces.coulomb import surfaces_named, surfaces_of

BASIS = "basis"
"""Column that says whether a row was solved or bounded."""


class Transfer:
    """Which rows of a study to solve, in rounds, and the others' bounds.

    Parameters
    ----------
    study : Study
    variations : mapping of str to dict
        Parameters of every row by its name.
    tolerance : float
        Relative width of a bracket that is good enough.
    """

    def __init__(self, study: Study, variations: Mapping[str, Row], tolerance: float) -> None:
        self.variations, self.tolerance = variations, ratio(tolerance, "transfer")
        first = next(iter(variations.values()))
        self.growing = growing(study, list(first))
        families: dict[tuple[Any, ...], dict[str, Row]] = {}
        for name, row in variations.items():
            _check_model({**study.options, **study.split(row)[1]})
            others = [value for key, value in row.items() if key not in self.growing]
            plain = (
                value if isinstance(value, (str, float, int)) else id(value) for value in others
            )
            families.setdefault(tuple(plain), {})[name] = row
        self.families = [_Family(self.growing, rows) for rows in families.values()]

    def rounds(self, done: Mapping[str, Row]) -> Iterator[tuple[dict[str, Row], dict[str, Row]]]:
        """Rows to solve, and rows that are bounded; ``done`` has all that are known when asked."""
        while any(name not in done for name in self.variations):
            todo, bounded = dict[str, Row](), dict[str, Row]()
            for family in self.families:
                for name, (bracket, below, above) in family.enclosed(done, self.tolerance).items():
                    bounded[name] = self._row(bracket, below, above)
                todo |= {name: self.variations[name] for name in family.next(done, bounded)}
            yield todo, bounded

    def _row(self, bracket: Bracket, *sources: str) -> Row:
        lower, upper = (
            ", ".join(f"{key} {self.variations[row][key]:g}" for key in self.growing)
            for row in sources
        )
        return {
            **dict.fromkeys(FIGURES, np.nan), **dict.fromkeys(TEXTS, ""),
            "load_factor": 0.5 * (bracket.lower + bracket.upper),
            "lower": bracket.lower, "upper": bracket.upper, "gap": abs(bracket.width),
            "status": str(Status.CERTIFIED),
            "note": f"lower bound from {lower}, upper bound from {upper}",
            "seconds": 0.0, BASIS: "bounded",
        }  # fmt: skip


class _Family:
    """Rows that differ in strengths only."""

    def __init__(self, names: Sequence[str], rows: Mapping[str, Row]) -> None:
        self.values = np.array([[row[name] for name in names] for row in rows.values()], float)
        ranks = [np.unique(column, return_inverse=True)[1] for column in self.values.T]
        order = np.argsort(np.sum(ranks, axis=0), kind="stable")
        self.rows, self.values = [list(rows)[i] for i in order], self.values[order]
        self.is_less: BoolArray = np.all(self.values[:, None] <= self.values, axis=2)
        smaller, larger = self.is_less.sum(axis=0), self.is_less.sum(axis=1)
        equal = (self.is_less & self.is_less.T).sum(axis=0)
        self.ends = {self.rows[i] for i in np.flatnonzero(equal >= np.minimum(smaller, larger))}
        self.between: dict[str, tuple[int, int]] = {}

    def enclosed(
        self, done: Mapping[str, Row], tolerance: float
    ) -> dict[str, tuple[Bracket, str, str]]:
        """Rows that need no solve: their bracket, and the rows that it comes from."""
        bounds = np.array([self._known(done.get(name)) for name in self.rows])
        result = {}
        for i, name in enumerate(self.rows):
            if name in done:
                continue
            lower = np.where(self.is_less[:, i], bounds[:, 0], -np.inf)
            upper = np.where(self.is_less[i], bounds[:, 1], np.inf)
            below, above = int(lower.argmax()), int(upper.argmin())
            self.between[name] = below, above
            bracket = Bracket(float(lower[below]), float(upper[above]))
            if bracket.is_within(tolerance):
                result[name] = bracket, self.rows[below], self.rows[above]
        return result

    @staticmethod
    def _known(row: Row | None) -> tuple[float, float]:
        is_solved = row is not None and row[BASIS] == "solved" and not row["error"]
        if row is None or not is_solved or Status(row["status"]) is not Status.CERTIFIED:
            return -np.inf, np.inf
        return row["lower"], row["upper"]

    def next(self, done: Mapping[str, Row], bounded: Mapping[str, Row]) -> list[str]:
        """What has nothing below or above it; then the middle of all between the same two rows."""
        left = [name for name in self.rows if name not in done and name not in bounded]
        between: dict[tuple[int, int], list[str]] = {}
        for name in left:
            between.setdefault(self.between[name], []).append(name)
        ends = [name for name in left if name in self.ends]
        return ends or [names[len(names) // 2] for names in between.values()]


def growing(study: Study, varied: Sequence[str]) -> list[str]:
    """The varied parameters with which a scene's strength grows, whatever its loads."""
    scene, names = study.scenes, [name for name in varied if name in PROPERTIES]
    if not isinstance(scene, Scene):
        raise ModelError(
            "transfer is for a scene that is varied by its own parameters: what a function does "
            f"with friction is not known, got {scene!r:.60}"
        )
    if scene.tensile_strength or scene.contact_tensile_strength or "tensile_strength" in varied:
        names = [name for name in names if name != "friction"]
    if not names:
        raise ModelError(
            f"transfer goes over {', '.join(PROPERTIES)} (friction not beside tensile strength, "
            f"which it reduces), but what is varied is {', '.join(varied)}: leave transfer out"
        )
    return names


def _check_model(options: Mapping[str, Any]) -> None:
    older = {axis: options.get(axis) for axis in USUAL}
    surface, method = chosen(options.get("surface", "conic"), options.get("method"), older, {})
    if type(method) is not Convex:
        raise ModelError(
            f"transfer goes with method 'convex', got {method.name!r}: with it, more friction does "
            "not always mean more strength; leave transfer out"
        )
    if "formulation" in options or surfaces_named(surfaces_of(surface)[1]) is None:
        raise ModelError(
            "transfer goes with the package's surfaces and formulation: whether strength grows "
            "with friction is not known of one's own; leave transfer out"
        )
