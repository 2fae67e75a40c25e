"""Other physics of the same blocks as rows of a comparison: strengths, ties, settlement."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import ClassVar

from cvxlimit.bracket import known
from cvxlimit.checks import finite_vector, positive
from cvxlimit.compare.models import PHASES, Measurement, Method, Model
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.settlement import settlement
from cvxlimit.scene import Scene


@dataclass(frozen=True)
class Strengthened(Model):
    """A model of the scene with other strengths of its joints.

    Strengths are multiples of the mean pressure on the supports, the scene's weight over the area
    of its contacts with them, so that one model means the same on small and on large scenes.

    Attributes
    ----------
    compressive, tensile, cohesion : float or None
        None leaves the scene's own.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> weak = Strengthened("weak", compressive=10.0)
    >>> weak.measure(builtin_scene("single-block")).load_factor < 0.4
    True
    """

    compressive: float | None = None
    tensile: float | None = None
    cohesion: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("compressive", "tensile", "cohesion"):
            if getattr(self, name) is not None:
                positive(getattr(self, name), f"{name} of model {self.name!r}")

    def measure(self, scene: Scene) -> Measurement:
        """See :class:`~cvxlimit.compare.models.Method`."""
        unit = mean_pressure(scene)
        if self.cohesion is not None:
            scene = scene.with_cohesion(self.cohesion * unit)
        compressive = None if self.compressive is None else self.compressive * unit
        tensile = None if self.tensile is None else self.tensile * unit
        return super().measure(scene.with_strength(compressive, tensile))


def mean_pressure(scene: Scene) -> float:
    """Weight of the free blocks over the area of the contacts with supports.

    >>> from cvxlimit import builtin_scene
    >>> scene = builtin_scene("single-block")
    >>> bool(mean_pressure(scene) * scene.contacts.area.sum() == scene.total_weight)
    True
    """
    contacts: Contacts = scene.contacts
    fixed = {i for i, block in enumerate(scene.blocks) if block.id in scene.supports}
    rests = [a in fixed or b in fixed for a, b in zip(contacts.a, contacts.b, strict=True)]
    return float(scene.total_weight / contacts.area[rests].sum())


@dataclass(frozen=True)
class Untied(Model):
    """A model of the scene without its ties: what they are worth.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> round(Untied("untied").measure(builtin_scene("single-block")).load_factor, 5)
    0.4
    """

    def measure(self, scene: Scene) -> Measurement:
        """See :class:`~cvxlimit.compare.models.Method`."""
        return super().measure(replace(scene, ties=()))


@dataclass(frozen=True)
class Settlement(Method):
    """The reaction of a support that moves; a row without error, for it is no load factor.

    Attributes
    ----------
    name : str
    support : str
    direction : (3,)
    which : {"least", "largest"}

    Example
    -------
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
        """See :class:`~cvxlimit.compare.models.Method`."""
        return {"surface": "conic", "formulation": f"{self.which} reaction", **super().axes()}

    def measure(self, scene: Scene) -> Measurement:
        """See :class:`~cvxlimit.compare.models.Method`."""
        start = time.perf_counter()
        found = settlement(scene, self.support, self.direction, self.which)
        return Measurement(
            str(found.solution.status),
            found.value,
            known(found.bracket.lower),
            known(found.bracket.upper),
            {k: v for k, v in found.solution.seconds.items() if k in PHASES},
            time.perf_counter() - start,
            len(scene.contacts),
        )
