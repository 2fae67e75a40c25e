"""How much model a scene gets, which solver, how long it will take: said without solving it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import cvxpy as cp
from cvxpy.constraints import SOC

from cvxlimit.checks import ratio
from cvxlimit.errors import ModelError
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.certificate import Certifier
from cvxlimit.reductions.choice import MODELS, Reductions
from cvxlimit.scene import Scene, check_scene
from cvxlimit.solvers import SOLVERS, Shape
from cvxlimit.solvers.ladders import inequalities
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
class Size:
    """A compiled problem: scalar variables, equations, linear inequalities, second-order cones."""

    variables: int
    equations: int
    rows: int
    cones: int

    @classmethod
    def of(cls, problem: LimitProblem) -> Size:
        """Auxiliary variables of surfaces count; signs of variables are rows."""
        stated = problem.problem
        cones = sum(c.num_cones() for c in stated.constraints if isinstance(c, SOC))
        equations = sum(
            c.size for c in stated.constraints if isinstance(c, cp.constraints.Equality)
        )
        variables = sum(v.size for v in stated.variables())
        return cls(variables, equations, inequalities(stated), cones)


@dataclass(frozen=True)
class Explanation:
    """What :func:`explain` has found out.

    Attributes
    ----------
    scene : str
    blocks, contacts : int
        Free blocks and contacts of the scene.
    sizes : mapping of str to Size
        Of the full model, and after each reduction, in order.
    solver : str
        Who tries first.
    reason : str
        Why.
    seconds : float
        What the solver is expected to take on one idle core, to a factor of two or so.
    """

    scene: str
    blocks: int
    contacts: int
    sizes: Mapping[str, Size]
    solver: str
    reason: str
    seconds: float

    def __str__(self) -> str:
        lines = [f"{self.scene}: {self.blocks} free blocks x {self.contacts} contacts"]
        head = ("model", "variables", "equations", "rows", "cones")
        lines.append("".join(f"{name:>11}" if i else f"{name:<10}" for i, name in enumerate(head)))
        for name, s in self.sizes.items():
            numbers = (s.variables, s.equations, s.rows, s.cones)
            lines.append(f"{name:<10}" + "".join(f"{number:>11}" for number in numbers))
        lines += [f"{name}: {MEANING[name]}" for name in self.sizes if name in MEANING]
        lines.append(f"solver: {self.solver}, because {self.reason}")
        lines.append(f"expected time: {_about(self.seconds)} to solve, on one idle core")
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
    first = last.ladder(tolerance)[0]
    return Explanation(
        scene.name,
        len(scene.free),
        len(scene.contacts),
        {name: Size.of(problem) for name, problem in problems.items()},
        str(first),
        _reason(first.name, last.shape),
        _seconds(first.name, Size.of(last).variables),
    )


def _about(seconds: float) -> str:
    return "less than 0.1 s" if seconds < 0.1 else f"about {float(f'{seconds:.1g}'):g} s"


def _reason(solver: str, shape: Shape) -> str:
    kind = {
        "conic": "the problem has second-order cones",
        "facets": "the problem is linear with many facets",
        "lean": "the problem is linear with few rows",
    }[shape.kind]
    size = "large" if solver == "BLOCKWISE" else "not so large that the blockwise solver pays"
    return f"{kind} and is {size} (work {shape.work:.1e})"


def _seconds(solver: str, variables: int) -> float:
    pace, growth = SOLVERS[solver].pace
    return float(pace * variables**growth)
