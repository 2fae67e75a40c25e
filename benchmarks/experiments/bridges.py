"""Arch bridges that were loaded to collapse: measured beside computed.

Geometry and loads of full-scale tests, 40 voussoirs, friction 0.6 between them, the load over the
full width, spread 1 in 2 through the fill. K is the coefficient of the soil's resistance, the same
for all: measured loads choose nothing here. *read*: the measured load stands in the summary of the
report that is named; *recalled*: it was not opened here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.experiment import Head, Lines, Part, Title, experiment
from cvxlimit import Load, Road, Scene, Vehicle, envelope, passive, solve
from cvxlimit.masonry import Arch, bridge

COEFFICIENTS = (0.0, 1.5, 3.0)


@dataclass(frozen=True)
class Test:
    """A full-scale test: shape, sizes in m, weights in kN/m3, where it was loaded (share of the
    span), length of the patch, measured load in kN and where that is from, strength in MPa."""

    name: str
    arch: Arch
    thickness: float
    width: float
    cover: float
    density: float
    fill: float
    at: float
    patch: float
    measured: float
    source: str
    strength: float
    rings: int = 1

    def scene(self, coefficient: float, strength: float = np.inf) -> Scene:
        """Under fill, with soil that resists, and the load of 1 kN."""
        scene = bridge(
            self.arch, thickness=self.thickness, rings=self.rings, width=self.width,
            cover=self.cover, density=self.density, fill=self.fill, friction=0.6,
            ring_friction=0.53, compressive_strength=1e3 * strength, name=self.name,
        )  # fmt: skip
        level = max(float(block.vertices[:, 2].max()) for block in scene.blocks) + self.cover
        if coefficient:
            scene = replace(scene, reactions=passive(scene, level, self.fill, coefficient))
        load = Road(scene, level).load(self.at * self.arch.span, 1.0, self.patch)
        return scene.with_live(Load(points=load.points))


TESTS = (
    Test("Prestwood", Arch(6.55, 1.428), 0.22, 3.8, 0.165, 17.66, 20.0, 0.25, 0.3, 228.0,
         "read, TRRL RR110", 4.5),
    Test("Preston", Arch(4.95, 1.636, "ellipse"), 0.36, 5.7, 0.38, 22.0, 20.0, 1 / 3, 0.75,
         2110.0, "read, TRRL RR110", 5.0),
    Test("Shinafoot", Arch(6.16, 1.185), 0.542, 7.03, 0.215, 25.0, 20.0, 0.25, 0.75, 2524.0,
         "read, TRRL RR159", 5.0),
    Test("Strathmashie", Arch(9.42, 2.99), 0.6, 5.81, 0.41, 25.0, 20.0, 0.25, 0.75, 1325.0,
         "read, TRRL RR201", 5.0),
    Test("Barlae", Arch(9.865, 1.695), 0.45, 9.8, 0.295, 25.0, 20.0, 0.25, 0.75, 2900.0,
         "read, TRRL RR201", 5.0),
    Test("Bridgemill", Arch(18.29, 2.84, "parabola"), 0.711, 8.3, 0.203, 21.0, 22.0, 0.25, 0.75,
         3100.0, "recalled", 5.0),
    Test("Bargower", Arch(10.36, 5.18), 0.588, 8.68, 1.2, 26.8, 20.0, 1 / 3, 0.75, 5600.0,
         "recalled", 5.0),
    Test("Bolton 3-1", Arch(3.0, 0.75), 0.215, 2.88, 0.305, 23.7, 22.2, 0.25, 0.42, 540.0,
         "recalled", 26.8),
    Test("Bolton 5-1", Arch(5.0, 1.25), 0.44, 2.88, 0.295, 23.7, 22.2, 0.25, 0.42, 1720.0,
         "recalled", 26.8),
)  # fmt: skip

APART = (
    replace(TESTS[-2], name="Bolton 3-2, two rings", rings=2, measured=360.0),
    replace(TESTS[-1], name="Bolton 5-2, four rings", rings=4, measured=500.0),
)
"""Rings that came apart: friction between them, and nothing else."""


@experiment(Part(1))
def bridges() -> Lines:
    """Full-scale tests, rings that came apart, and three spans beside one."""
    yield Title("tests")
    yield _head("strength, MPa", "K = 3 and crushing", "K for the measured load")
    for test in TESTS:
        found = [factor_of(test.scene(k)) for k in COEFFICIENTS]
        crushing = factor_of(test.scene(3.0, test.strength))
        needed = coefficient_for(lambda k, test=test: factor_of(test.scene(k, test.strength)),
                                 test.measured)  # fmt: skip
        yield (
            test.name, f"{test.measured:,.0f}", test.source, *(f"{x:,.0f}" for x in found),
            f"{test.strength:g}", f"{crushing:,.0f}", needed,
        )  # fmt: skip
    yield Title("rings")
    yield _head()
    for test in APART:
        found = [factor_of(test.scene(k)) for k in COEFFICIENTS]
        yield test.name, f"{test.measured:,.0f}", test.source, *(f"{x:,.0f}" for x in found)
    yield Title("spans")
    yield Head("spans of 3 m", "K", "least load, kN", "at, m from the loaded span's left springing")
    for number in (1, 3):
        for k in COEFFICIENTS:
            least, at = spans(number, k)
            yield number, f"{k:g}", f"{least:.0f}", f"{at:.2f}"


def _head(*more: str) -> Head:
    return Head("test", "measured, kN", "source", *(f"K = {k:g}" for k in COEFFICIENTS), *more)


def factor_of(scene: Scene) -> float:
    """The certified load factor, infinite where any load is carried."""
    found = solve(scene)
    if not found.status.has_answer:
        return float("inf")
    assert str(found.status) == "certified", found
    return float(found.load_factor or 0.0)


def coefficient_for(load_at: Callable[[float], float], measured: float) -> str:
    """The coefficient of the soil that gives the measured load, to a hundredth."""
    low, high = 0.0, 10.0
    if load_at(low) >= measured:
        return "0 is more"
    if load_at(high) < measured:
        return "none up to 10"
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if load_at(middle) < measured else (low, middle)
    return f"{high:.2f}"


def spans(number: int, coefficient: float) -> tuple[float, float]:
    """The least axle load on the middle one of some spans, and its place there."""
    piers = {"piers": (0.44, 1.5)} if number > 1 else {}
    scene = bridge(
        [Arch(3.0, 0.75, voussoirs=24)] * number, thickness=0.215, width=2.88, cover=0.305,
        density=23.7, fill=22.2, friction=0.6, **piers,
    )  # fmt: skip
    level, first = 0.75 + 0.215 + 0.305, (number // 2) * 3.44
    if coefficient:
        scene = replace(scene, reactions=passive(scene, level, 22.2, coefficient))
    axle = Vehicle([(0.0, 1.0)], length=0.42)
    found = envelope(scene, axle, first + np.linspace(0.15, 2.85, 37), level, both_ways=False)
    return found.worst.load_factor, found.worst.at - first
