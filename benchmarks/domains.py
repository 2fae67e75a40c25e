"""Solves and CPU seconds until load domains are closed to a tolerance.

    .venv/bin/python -m benchmarks.domains                          # 1 %, pushes along x and y
    .venv/bin/python -m benchmarks.domains --scenes facade --loads 3 --tolerance 0.03

With ``--ideal`` also how few pairs of a point and a tangent could do, if the set were known: a
second domain, twenty times as tight, stands for it.
"""

from __future__ import annotations

import argparse
import os
import time
from itertools import count

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from rich.console import Console

from cvxlimit import Load, builtin_scene, solve
from cvxlimit.studies import LoadDomain, load_domain

SCENES = ("facade", "house-corner", "dome", "s12-panel", "arch")


def closed(name: str, loads: int, tolerance: float, most: int) -> LoadDomain:
    """The domain under pushes along two or three axes; tells how the gap falls."""
    axes = {f"a_{axis}": Load(acceleration=at) for axis, at in zip("xyz", np.eye(3), strict=True)}
    named = {axis: axes[axis] for axis in list(axes)[:loads]}
    told = count(1)

    def tell(line: str) -> None:
        if loads == 3 and (number := next(told)) % 50 == 0:
            console.print(f"  after {number} answers: {line}")

    return load_domain(
        builtin_scene(name), named, tolerance, most_solves=most, progress=tell
    )  # fmt: skip


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


def main() -> None:
    """A line per scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--loads", type=int, choices=(2, 3), default=2)
    parser.add_argument("--tolerance", type=float, default=0.01)
    parser.add_argument("--most", type=int, default=2000, help="solves after which it is enough")
    parser.add_argument("--ideal", action="store_true")
    asked = parser.parse_args()
    for name in asked.scenes:
        start = time.process_time()
        solve(builtin_scene(name))
        one, start = time.process_time() - start, time.process_time()
        domain = closed(name, asked.loads, asked.tolerance, asked.most)
        seconds = time.process_time() - start
        line = (
            f"{name}: gap {domain.gap:.2%} after {domain.solves} solves, {len(domain.points)} "
            f"points, {len(domain.rays)} rays, {len(domain.offsets)} half-spaces, "
            f"{seconds:.1f} CPU s, {seconds / one:.1f} times one solve; {domain.status}"
        )
        if asked.ideal and asked.loads == 2:
            fine = closed(name, 2, 0.05 * asked.tolerance, asked.most)
            line += f"; {fewest(fine, asked.tolerance)} pairs at best"
        console.print(line)


console = Console(highlight=False, soft_wrap=True)

if __name__ == "__main__":
    main()
