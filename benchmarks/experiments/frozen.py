"""The frozen surface of Eq. 32 as a method of the benchmarks: what changed Parameters cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cvxlimit.compare.models import Method, Model, Row
from cvxlimit.errors import ModelError
from cvxlimit.methods.driver import Clock
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.proof.certificate import Certifier
from cvxlimit.readings.named import parse_moments
from cvxlimit.readings.states.pressure import Pressure
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import known
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Cone, parse_cone


@dataclass(frozen=True)
class FrozenModel(Model):
    """The surface with interaction coefficients as CVXPY Parameters, solved twice.

    The first solve, at eccentricity zero, is the problem without interaction and gives the load
    factor; the second, at the first one's eccentricities, shows what changed Parameters cost.

    Attributes
    ----------
    parameters : str
        ``"rows"``: entries of the rows are patched; ``"cvxpy"``: by CVXPY's own compilation.
    """

    parameters: str = "rows"

    CHOICES: ClassVar[tuple[str, ...]] = ("rows", "cvxpy")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.surface, (str, Cone)):
            raise ModelError(f"surface must be a name or a cone, got {self.surface!r}")
        if self.parameters not in self.CHOICES:
            raise ModelError(
                f"parameters must be one of {', '.join(self.CHOICES)}, got {self.parameters!r}"
            )

    def axes(self) -> dict[str, str]:
        """See :class:`Method`."""
        return {**super().axes(), "parameters": self.parameters}

    def measure(self, scene: Scene) -> Row:
        """See :class:`Method`."""
        settings = self.solver or settings_for("CLARABEL", 1e-8)
        clock = Clock()
        with clock.phase("detect"):
            contacts = scene.contacts
        with clock.phase("compile"):
            cone, moments = parse_cone(str(self.surface)), parse_moments(self.moments)
            frozen = FrozenProblem(scene, cone, moments)
            has_rows = self.parameters == "rows"
            centred = Pressure.of(np.zeros((len(contacts), 6)), contacts)
            frozen.set(centred)
            state = frozen.problem.run(settings, has_rows)
            clock.seconds["solve"] += state.outcome.solve_seconds
        if state.forces is not None:
            clock.seconds["reparametrise"] = 0.0
            with clock.phase("reparametrise"):
                frozen.set(Pressure.of(state.forces, contacts))
                again = frozen.problem.run(settings, has_rows)
                clock.seconds["solve"] += again.outcome.solve_seconds
        with clock.phase("certify"):
            bounds = Certifier(scene, frozen.surfaces(centred)).certificate(
                state.forces, state.load_factor, state.mechanism
            )
        return Row(
            status=state.outcome.status, load_factor=state.load_factor, lower=known(bounds.lower),
            upper=known(bounds.upper), total=clock.elapsed, **clock.seconds,
        )  # fmt: skip


def frozen_methods() -> dict[str, Method]:
    """Both choices by name."""
    made = (
        FrozenModel(f"frozen/{choice}", "cone, Parameters, Clarabel",
                    solver=settings_for("CLARABEL", 1e-8, "Clarabel qdldl"), tolerance=1e-8,
                    parameters=choice)
        for choice in FrozenModel.CHOICES
    )  # fmt: skip
    return {model.name: model for model in made}
