"""``explain``: model size, solver and expected time of a solve, with reasons; nothing is solved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from types import MappingProxyType

import numpy as np

from cvxlimit.base.checks import check_choice, ratio
from cvxlimit.base.doors import Door
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.choice import MODELS, PLANAR_FROM, ModelName, Reductions
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solvers import Shape
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import SurfaceName, needed_surfaces, surfaces_of

PACES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "exact": (2e-5, 2.2),
        "fixed-point": (2.5e-4, 1.85),
        "certified": (5e-2, 1.0),
        "zero-dilatancy": (3e-3, 1.3),
        "incremental": (1.5e-3, 1.3),
        "pushover": (1.2e-2, 1.5),
    }
)
"""CPU seconds by method: the first times contacts to the power of the second, within a factor of
some five (docs/evidence/speed.md#other-methods). Planar scenes take a third or less. Those of zero
dilatancy are of one search; those of a path, which is no method of ``solve``, are of its default
steps, from 0.2 s of a stack of five blocks to 22 s of a wall of 129 contacts whose joints slide."""

BUDGET = 300
"""Problems that a search without dilatancy solves."""

SEARCHES = 5
"""As many of them at most unless asked for more, each with a seed of its own."""

SEARCH_SECONDS = 40.0
"""Seconds that all of them together may take, as far as can be told; one is made in any case."""


def searches_in_time(contacts: int, is_plane: bool) -> int:
    """Returns how many searches without dilatancy are made of a scene unless a number is asked for:
    as many as fit the time, which depends on its size alone, not on the machine."""
    return int(np.clip(SEARCH_SECONDS / _pace("zero-dilatancy", contacts, is_plane), 1, SEARCHES))


def _pace(method: str, contacts: int, is_plane: bool) -> float:
    """Returns the CPU seconds that :data:`PACES` expects."""
    rate, power = PACES[method]
    return float(rate * contacts**power / (3 if is_plane else 1))


MEANING: Mapping[str, str] = MappingProxyType(
    {
        "parts": "parts without live load are left out: they stand",
        "symmetry": "one half of a symmetric scene",
        "planar": "three degrees of freedom per block, three forces per contact",
    }
)
"""What reductions are, by name."""


@dataclass(frozen=True)
class Explanation:
    """What :func:`explain` has found out.

    ``blocks`` are free ones; ``sizes`` those of the full model and after each reduction, in order;
    ``seconds`` are those of one idle core, to a factor of two or so; ``methods`` those of the other
    methods, to a factor of five or so. ``told`` is what detection leaves out or simplifies, and
    ``searches`` how many are made for members without dilatancy.
    """

    scene_name: str
    blocks: int
    contacts: int
    sizes: Mapping[str, Shape]
    solver: str
    reason: str
    seconds: float
    methods: Mapping[str, float]
    told: tuple[str, ...]
    searches: int

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name} {s.variables} variables" for name, s in self.sizes.items())
        return f"Explanation({self.scene_name!r}: {sizes}, {self.solver}, {self.seconds:.1g} s)"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"

    def __str__(self) -> str:
        lines = [f"{self.scene_name}: {self.blocks} free blocks x {self.contacts} contacts"]
        head = ("model", "variables", "equations", "rows", "cones")
        lines.append("".join(f"{name:>11}" if i else f"{name:<10}" for i, name in enumerate(head)))
        for name, s in self.sizes.items():
            numbers = (s.variables, s.equations, s.rows, s.cones)
            lines.append(f"{name:<10}" + "".join(f"{number:>11}" for number in numbers))
        lines += [f"{name}: {MEANING[name]}" for name in self.sizes if name in MEANING]
        lines.append(f"solver: {self.solver}, because {self.reason}")
        lines.append(f"expected time: {duration(self.seconds)} to solve, on one idle core")
        of = f"{self.searches} searches of" if self.searches > 1 else "one search of"
        many = {"zero-dilatancy": f" for {of} {BUDGET} solves (--searches, --budget)"}
        many["pushover"] = " for a path"
        others = [f"{name} {duration(s)}{many.get(name, '')}" for name, s in self.methods.items()]
        lines += [f"other methods, roughly: {', '.join(others)}"] * bool(others)
        lines += [f"geometry: {said}" for said in self.told]
        return "\n".join(lines)


def expected_seconds(contacts: int, is_plane: bool) -> dict[str, float]:
    """Seconds that methods beside the convex one are expected to take, by name; without dilatancy
    those of all searches."""
    seconds = {name: _pace(name, contacts, is_plane) for name in PACES}
    seconds["zero-dilatancy"] *= searches_in_time(contacts, is_plane)
    doors = Door("cvxlimit.methods"), Door("cvxlimit.commands")  # extensions may be missing
    return {
        name: each
        for name, each in seconds.items()
        if all(door.missing(name) is None for door in doors)
    }


def duration(seconds: float) -> str:
    """An expected time in words.

    >>> duration(0.02), duration(8.3), duration(400.0)
    ('less than 0.1 s', 'about 8 s', '7 min')
    """
    if seconds < 0.1:
        return "less than 0.1 s"
    return f"about {float(f'{seconds:.1g}'):g} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def explain(
    scene: Scene,
    surface: SurfaceName | Cone | Sequence[YieldSurface] = "conic",
    *,
    tolerance: float = 1e-5,
    model: ModelName = "auto",
) -> Explanation:
    """Model size, solver and expected time of ``solve`` without interaction, with reasons, and
    expected times of the other methods; nothing is solved.

    Raises
    ------
    InputError, ModelError
        As :func:`cvxlimit.solve`.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> found = explain(builtin_scene("arch"), model="least")
    >>> {name: size.variables for name, size in found.sizes.items()}
    {'full': 169, 'planar': 64}
    """
    check_scene(scene)
    ratio(tolerance, "tolerance")
    check_choice("model", model, MODELS)
    surfaces = needed_surfaces(surfaces_of(surface)[0])
    assemblage = Assemblage.of(scene)
    found = Reductions.of(assemblage, surfaces, model=model, planar_from=PLANAR_FROM)
    any_size = Reductions.of(assemblage, surfaces, model=model)  # as other methods see it
    state = Certifier(found.assemblage, surfaces).references.easy_dead_state
    problems = {
        ("full", *step.names)[-1]: LimitProgram(found.assemblage, surfaces, reduction=step)
        for step in found.steps(state)
    }
    *_, last = problems.values()
    sizes = {name: problem.shape for name, problem in problems.items()}
    first = last.ladder(tolerance)[0]
    pace, growth = first.row.pace
    size = len(scene.contacts), any_size.plane is not None
    return Explanation(
        scene.name,
        len(scene.free),
        len(scene.contacts),
        sizes,
        str(first),
        _reason(first.name, last.shape),
        float(pace * last.shape.variables**growth),
        expected_seconds(*size),
        scene.told,
        searches_in_time(*size),
    )  # fmt: skip


def _reason(solver: str, shape: Shape) -> str:
    kind = {
        "conic": "the problem has second-order cones",
        "facets": "the problem is linear with many facets",
        "lean": "the problem is linear with few rows",
    }[shape.kind]
    size = "large" if solver == "BLOCKWISE" else "not so large that the blockwise solver pays"
    return f"{kind} and is {size} ({shape.variables:,} variables)"
