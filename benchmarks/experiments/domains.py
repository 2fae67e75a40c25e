"""Solves and CPU seconds until load domains are closed to a tolerance.

With ``--ideal`` also how few pairs of a point and a tangent could do, if the set were known: a
second domain, twenty times as tight, stands for it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from benchmarks.experiment import Head, Lines, Part, experiment
from cvxlimit import Load, builtin_scene, solve
from cvxlimit.studies import LoadDomain, load_domain

SCENES = ("facade", "house-corner", "dome", "s12-panel", "arch")


def closed(name: str, loads: int, tolerance: float, most: int) -> LoadDomain:
    """The domain under pushes along two or three axes."""
    axes = {f"a_{axis}": Load(acceleration=at) for axis, at in zip("xyz", np.eye(3), strict=True)}
    named = {axis: axes[axis] for axis in list(axes)[:loads]}
    return load_domain(builtin_scene(name), named, tolerance, most_solves=most, progress=False)


def fewest(domain: LoadDomain, tolerance: float) -> int:
    """Fewest pairs of a point and a tangent on the boundary that leave a gap of ``tolerance``.

    Pairs stand at corners of the hull of ``domain`` (in the plane, zero inside), each with a
    tangent between its two edges, which is taken to be the best for what follows; the first is
    tried everywhere. So no choice of directions takes fewer.
    """
    corners = domain.points / domain.units
    angle = np.arctan2(corners[:, 1], corners[:, 0])
    ring = corners[np.argsort(angle)]
    ring = ring[np.abs(np.diff(np.vstack([ring, ring[:1]]), axis=0)).max(axis=1) > 1e-9]
    best = len(ring)
    for start in range(0, len(ring), max(1, len(ring) // 40)):
        around = np.roll(ring, -start, axis=0)
        best = min(best, _pairs(np.vstack([around, around[:1]]), tolerance, best))
    return best


def _pairs(ring: np.ndarray, tolerance: float, most: int) -> int:
    """Steps from the first corner round to itself, each as far as the gap allows."""
    at, steps = 0, 0
    while at < len(ring) - 1 and steps < most:
        ahead = at + 1
        while ahead + 1 < len(ring) and _gap(ring, at, ahead + 1) <= tolerance:
            ahead += 1
        at, steps = ahead, steps + 1
    return steps


def _gap(ring: np.ndarray, i: int, j: int) -> float:
    """Between two corners' chord and where the lines along the edges next to them meet."""
    out, back = ring[i + 1] - ring[i], ring[j] - ring[j - 1]
    cross = out[0] * back[1] - out[1] * back[0]
    chord = ring[j] - ring[i]
    if abs(cross) < 1e-12:
        return 0.0
    share = (chord[0] * back[1] - chord[1] * back[0]) / cross
    corner = ring[i] + share * out
    normal = np.array([chord[1], -chord[0]])
    return float(1.0 - (normal @ ring[i]) / (normal @ corner))


@experiment(
    Part(4, "--ideal"),
    Part(1, "--scenes facade --loads 3 --tolerance 0.03", "domains-space"),
)
def domains(
    scenes: Sequence[str] = SCENES, loads: int = 2, tolerance: float = 0.01, most: int = 2000,
    ideal: bool = False,
) -> Lines:  # fmt: skip
    """Solves and CPU seconds until load domains under pushes are closed to a tolerance."""
    yield Head("scene", "gap", "solves", "pairs at best", "points", "rays", "half-spaces", "CPU s",
               "CPU s in single solves", "status")  # fmt: skip
    for name in scenes:
        start = time.process_time()
        solve(builtin_scene(name))
        one, start = time.process_time() - start, time.process_time()
        domain = closed(name, loads, tolerance, most)
        seconds = time.process_time() - start
        pairs = ""
        if ideal and loads == 2:
            pairs = str(fewest(closed(name, 2, 0.05 * tolerance, most), tolerance))
        yield (
            name, f"{domain.gap:.2%}", domain.solves, pairs, len(domain.points), len(domain.rays),
            len(domain.offsets), f"{seconds:.1f}", f"{seconds / one:.1f}", domain.status,
        )  # fmt: skip
