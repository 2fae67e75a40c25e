"""How much model a scene gets, which solver, how long it will take: said without solving it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from cvxlimit.checks import ratio
from cvxlimit.errors import ModelError
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.choice import MODELS, Reductions
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solvers import SOLVERS, Shape
from cvxlimit.surfaces import Cone, YieldSurface
from cvxlimit.surfaces.coulomb import needed_surfaces, surfaces_of

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
    ``seconds`` are those of one idle core, to a factor of two or so.
    """

    scene: str
    blocks: int
    contacts: int
    sizes: Mapping[str, Shape]
    solver: str
    reason: str
    seconds: float

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name} {s.variables} variables" for name, s in self.sizes.items())
        return f"Explanation({self.scene!r}: {sizes}, {self.solver}, {self.seconds:.1g} s)"

    def __str__(self) -> str:
        lines = [f"{self.scene}: {self.blocks} free blocks x {self.contacts} contacts"]
        head = ("model", "variables", "equations", "rows", "cones")
        lines.append("".join(f"{name:>11}" if i else f"{name:<10}" for i, name in enumerate(head)))
        for name, s in self.sizes.items():
            numbers = (s.variables, s.equations, s.rows, s.cones)
            lines.append(f"{name:<10}" + "".join(f"{number:>11}" for number in numbers))
        lines += [f"{name}: {MEANING[name]}" for name in self.sizes if name in MEANING]
        lines.append(f"solver: {self.solver}, because {self.reason}")
        about = f"about {float(f'{self.seconds:.1g}'):g} s"
        expected = "less than 0.1 s" if self.seconds < 0.1 else about
        lines.append(f"expected time: {expected} to solve, on one idle core")
        return "\n".join(lines)


def explain(
    scene: Scene,
    surface: str | Cone | Sequence[YieldSurface] = "conic",
    *,
    tolerance: float = 1e-5,
    model: str = "auto",
) -> Explanation:
    """How much model ``solve`` gives a scene without interaction, and why; nothing is solved.

    Raises
    ------
    InputError, ModelError
        As :func:`cvxlimit.solve`.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> found = explain(builtin_scene("arch"))
    >>> {name: size.variables for name, size in found.sizes.items()}
    {'full': 169, 'planar': 64}
    """
    check_scene(scene)
    ratio(tolerance, "tolerance")
    if model not in MODELS:
        raise ModelError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
    surfaces = needed_surfaces(surfaces_of(surface)[0])
    found = Reductions.of(Assemblage.of(scene), surfaces, model=model)
    state = Certifier(found.assemblage, surfaces).witnesses.easy_dead_state
    problems = {
        ("full", *step.names)[-1]: LimitProblem(found.assemblage, surfaces, reduction=step)
        for step in found.steps(state)
    }
    *_, last = problems.values()
    sizes = {name: problem.shape for name, problem in problems.items()}
    first = last.ladder(tolerance)[0]
    pace, growth = SOLVERS[first.name].pace
    return Explanation(
        scene.name,
        len(scene.free),
        len(scene.contacts),
        sizes,
        str(first),
        _reason(first.name, last.shape),
        float(pace * last.shape.variables**growth),
    )


def _reason(solver: str, shape: Shape) -> str:
    kind = {
        "conic": "the problem has second-order cones",
        "facets": "the problem is linear with many facets",
        "lean": "the problem is linear with few rows",
    }[shape.kind]
    size = "large" if solver == "BLOCKWISE" else "not so large that the blockwise solver pays"
    return f"{kind} and is {size} (work {shape.work:.1e})"
