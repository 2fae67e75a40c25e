"""Arches and domes, from thick to thinner than can stand, from gripping to sliding joints."""

from __future__ import annotations

import numpy as np

from benchmarks.stability.families.sample import Family, Sample, direction
from cvxlimit.masonry import arch, arch_on_piers, barrel_vault, dome
from cvxlimit.scene import Load

LEAST_ARCH, LEAST_DOME = 0.1075, 0.042
"""Least thickness over mean radius: of a semicircular arch (Milankovitch) and of a hemispherical
dome (Heyman). Below, no thrust line or surface fits inside; few voussoirs shift it a little."""


def _arch(rng: np.random.Generator, scale: int) -> Sample:
    thick = float(LEAST_ARCH * rng.uniform(0.8, 2.5))
    friction = float(rng.uniform(0.2, 0.9))
    live = Load(acceleration=direction(rng))
    number = int(rng.integers(6, 22)) * scale
    make = arch if rng.random() < 0.7 else arch_on_piers
    scene = make(number, thick, friction=friction, live=live)
    return Sample(scene, knob=f"t/R {thick:.3f}, friction {friction:.2f}")


def _edge(rng: np.random.Generator, scale: int) -> Sample:
    """Within a hair of the least thickness: the load factor goes through zero."""
    thick = LEAST_ARCH * (1.0 + float(rng.choice([-1, 1])) * 10.0 ** rng.uniform(-5, -1))
    number = int(rng.choice([20, 27, 40])) * scale
    scene = arch(number, float(thick), friction=float(rng.choice([0.4, 0.7])))
    return Sample(scene, knob=f"t/R {thick:.5f}")


def _dome(rng: np.random.Generator, scale: int) -> Sample:
    live = Load(acceleration=direction(rng))
    friction, thick = float(rng.uniform(0.2, 0.9)), float(LEAST_DOME * rng.uniform(0.6, 4.0))
    if rng.random() < 0.3:
        scene = barrel_vault(6, 2 * thick, units=2 * scale, friction=friction, live=live)
    else:
        lunes, courses = int(rng.integers(5, 8)) * scale, int(rng.integers(2, 4))
        oculus = float(rng.uniform(10, 40))
        scene = dome(lunes, courses, thick, oculus=oculus, friction=friction, live=live)
    return Sample(scene, knob=f"t/R {thick:.3f}, friction {friction:.2f}")


FAMILIES = (
    Family("arches", "arches from thick to too thin, from gripping to sliding joints", _arch),
    Family("thin-arches", "arches within 10 % to 0.001 % of the least thickness", _edge),
    Family("domes", "domes and vaults from thick to too thin", _dome),
)
