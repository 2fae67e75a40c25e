"""Other physics of the same blocks as rows of a comparison: strengths, ties, settlement."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import ClassVar

from cvxlimit.base.checks import finite_vector
from cvxlimit.compare.models import Method, Row
from cvxlimit.errors import ModelError
from cvxlimit.methods.settlement import settlement
from cvxlimit.scene import Scene


def strengthened(scene: Scene, **strengths: float) -> Scene:
    """With cohesion and strengths as multiples of the mean pressure on the supports, so that one
    model means the same on small and on large scenes.
    """
    contacts = scene.contacts
    fixed = {i for i, block in enumerate(scene.blocks) if block.id in scene.supports}
    rests = [a in fixed or b in fixed for a, b in zip(contacts.a, contacts.b, strict=True)]
    pressure = float(scene.total_weight / contacts.area[rests].sum())
    return scene.with_joints(**{name: times * pressure for name, times in strengths.items()})


def untied(scene: Scene) -> Scene:
    return replace(scene, ties=())


@dataclass(frozen=True)
class Settlement(Method):
    """The reaction of a support that moves; a row without error, for it is no load factor.

    >>> from cvxlimit import builtin_scene
    >>> thrust = Settlement("thrust", support="right-abutment", direction=(1.0, 0.0, 0.0))
    >>> round(thrust.measure(builtin_scene("arch")).load_factor, 4)
    0.4946
    """

    name: str
    support: str = ""
    direction: tuple[float, ...] = ()
    which: str = "least"
    line: str = "settlement"
    is_load_factor: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if not self.support:
            raise ModelError(f"model {self.name!r} needs the id of the support that moves")
        finite_vector(self.direction, 3, f"direction of model {self.name!r}")

    def axes(self) -> dict[str, str]:
        return {"surface": "conic", "formulation": f"{self.which} reaction", **super().axes()}

    def measure(self, scene: Scene) -> Row:
        started = time.perf_counter()
        found = settlement(scene, self.support, self.direction, self.which)
        return Row.of(found.solution, started)
