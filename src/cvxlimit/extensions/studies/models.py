"""What is compared: a choice of options of ``solve`` under a name, and the row of its answer."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, get_args

from cvxlimit.base.arrays import ROUNDING
from cvxlimit.base.checks import meant
from cvxlimit.base.doors import Door
from cvxlimit.errors import ModelError
from cvxlimit.extensions.studies.rows import check_option
from cvxlimit.methods.solving import TABLE, chosen, solve
from cvxlimit.readings.named import MOMENTS, parse_moments
from cvxlimit.reductions.choice import MODELS
from cvxlimit.scene import Scene
from cvxlimit.solution.bracket import Bracket, known
from cvxlimit.solvers import settings_for
from cvxlimit.solvers.table import SOLVERS, able
from cvxlimit.surfaces import Facets
from cvxlimit.surfaces.coulomb import SurfaceName, surfaces_of

OWN = "cvxlimit"
"""The model without options; lines of charts that begin like this are drawn larger."""


@dataclass(frozen=True)
class Row:
    """One run of a model on a scene, of several that of the median time; None where there is no
    figure.

    ``error`` is relative to the reference, so that what a linearisation loses counts; ``moments``
    is the reading of Eq. 30, empty without interaction. ``total`` is seconds from the scene to the
    answer, contact detection included, and those by phase are as in ``Solution.seconds``;
    ``memory`` is MB, where runs have processes of their own. ``reason`` says why there is no
    answer, and is empty otherwise.
    """

    scene: str = ""
    contacts: int = 0
    method: str = ""
    line: str = ""
    surface: str = ""
    facets: int | None = None
    moments: str = ""
    status: str = "failed"
    reason: str = ""
    runs: int = 0
    load_factor: float | None = None
    lower: float | None = None
    upper: float | None = None
    error: float | None = None
    reference_lower: float | None = None
    reference_upper: float | None = None
    reference: str = ""
    detect: float | None = None
    compile: float | None = None
    solve: float | None = None
    certify: float | None = None
    total: float | None = None
    memory: float | None = None

    @property
    def failed(self) -> bool:
        return bool(self.reason)

    @property
    def has_point(self) -> bool:
        return self.total is not None and self.error is not None

    @property
    def truth(self) -> Bracket:
        """The reference's bracket; without bounds where one of them is missing."""
        ends = self.reference_lower, self.reference_upper
        return Bracket() if None in ends else Bracket(*ends)  # type: ignore[arg-type]

    @property
    def floor(self) -> float:
        """The reference's relative width: load factors inside it cannot be told apart."""
        return max(0.0, self.truth.width) if self.truth.has_both else 0.0


class Model:
    """A choice of options of :func:`cvxlimit.solve`, under a name.

    Parameters
    ----------
    name : str
    line : str
        The chart's line that it belongs to, as with the same solver at another tolerance; its own
        unless given.
    options
        Of :func:`cvxlimit.solve`: surface, method, tolerance, formulation, solver ...

    Raises
    ------
    ModelError
        For options that there are not.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> octagon = Model("my octagon", surface="octagon", solver=settings_for("CLARABEL", 1e-8))
    >>> round(octagon.measure(builtin_scene("single-block")).load_factor, 6)
    0.4
    """

    def __init__(self, name: str, line: str = "", **options: Any) -> None:
        for option, value in options.items():
            check_option(option, value)
        self.name, self.line, self.options = name, line or name, options

    @classmethod
    def named(cls, name: str) -> Model:
        """Returns the model whose name's parts are options, whatever their order:
        ``"octagon/clarabel/1e-4"``, ``"certified/paper"``; ``"cvxlimit"`` has none.

        >>> Model.named("fixed-point/octagon").options
        {'method': 'fixed-point', 'surface': 'octagon'}
        """
        parts = {part: _option(part) for part in name.split("/") if part != OWN}
        options = dict(parts.values())
        line = "/".join(part for part in parts if parts[part][0] != "tolerance") or OWN
        if _facets(surface := options.get("surface", "conic")):  # one line whatever their number
            side = "inside" if surface.endswith("-inscribed") else "outside"
            line = line.replace(surface, f"facets {side} the cone")
        if {"solver", "tolerance"} <= options.keys():  # then it is the solver's own
            check_option("solver", options["solver"])
            options["solver"] = settings_for(options["solver"], options.pop("tolerance"))
        return cls(name, line, **options)

    @property
    def moments(self) -> str:
        """The reading that its errors are measured with; empty without interaction."""
        surface, method = self.options.get("surface", "conic"), self.options.get("method")
        given = {"moments": self.options.get("moments")}
        reading = getattr(chosen(surface, method, given), "moments", None)
        return "" if reading is None else parse_moments(reading).name

    def axes(self) -> dict[str, Any]:
        """Returns the columns of the results that describe the model."""
        surface = self.options.get("surface", "conic")
        return {
            "surface": surfaces_of(surface)[1], "facets": _facets(surface), "moments": self.moments
        }  # fmt: skip

    def measure(self, scene: Scene) -> Row:
        """Returns the row of one run; ``scene`` has not looked for contacts yet."""
        started = time.perf_counter()
        found = solve(scene, **self.options)
        measured: dict[str, Any] = {x: known(getattr(found, x)) for x in ("lower", "upper")}
        measured |= {**found.seconds, "total": time.perf_counter() - started}
        return Row(status=str(found.status), load_factor=found.load_factor, **measured)


def _option(part: str) -> tuple[str, Any]:
    """Returns the option of :func:`cvxlimit.solve` that a part of a model's name means."""
    with suppress(ValueError):
        return "tolerance", float(part)
    named = {"model": MODELS, "moments": MOMENTS, "method": TABLE, "solver": {*SOLVERS, *able()}}
    for option, names in named.items():
        if part in names or (option == "solver" and part.upper() in names):
            return option, part.upper() if option == "solver" else part
    Door("cvxlimit.methods").check(part)  # of an extension that is not here
    try:
        surfaces_of(part)
    except ModelError as error:
        every = [*get_args(SurfaceName), *(name for names in named.values() for name in names)]
        raise ModelError(
            f"no model is called {part!r}: parts of a name are a surface, method, reading of "
            f"moments, solver, tolerance or size of model{meant(part, every, before='; ')}"
        ) from error
    return "surface", part


def _facets(surface: Any) -> int | None:
    """Returns the number of facets in place of the cone, None with the cone itself."""
    surfaces, _ = surfaces_of(surface)
    return next((s.cone.count for s in surfaces if isinstance(s.cone, Facets)), None)


def reference(moments: str) -> Model:
    """The model against whose bracket others are measured: with this reading, or none."""
    if moments:
        return Model("reference", method="certified", moments=moments)
    return Model("reference", tolerance=ROUNDING)
