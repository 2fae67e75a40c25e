"""Shapes that no mason laid: cut rock, and meshes as scanners and programs write them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection

from benchmarks.stability.families.sample import Family, Sample, direction, spread
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.solids import solid
from cvxlimit.masonry import random_wall
from cvxlimit.scene import Load, Scene

FloatArray = NDArray[np.float64]


def cells(rng: np.random.Generator, number: int) -> list[FloatArray]:
    """A cuboid of 2 x 1 x 1.5 on z = 0, cut into Voronoi cells of ``number`` random points."""
    size = np.array([2.0, 1.0, 1.5])
    seeds = rng.uniform(0.1, 0.9, (number, 3)) * size
    box = [[*(s * e), -(s * o)] for e, o in zip(np.eye(3), size, strict=True) for s in (1, -1)]
    for row in box[1::2]:
        row[3] = 0.0
    result = []
    for i, p in enumerate(seeds):
        others = np.delete(seeds, i, axis=0)
        normals = others - p
        offsets = -((others**2).sum(axis=1) - (p**2).sum()) / 2.0
        planes = np.vstack([box, np.column_stack([normals, offsets])])
        points = HalfspaceIntersection(planes, p).intersections
        result.append(points[ConvexHull(points).vertices])
    return result


def _rock(rng: np.random.Generator, scale: int) -> Sample:
    while True:
        number = int(rng.integers(2, 9)) * scale
        ground = Block.box("ground", (-1, -1, -1), (3, 2, 0))
        friction = float(rng.uniform(0.3, 1.2))
        try:
            blocks = [
                Block.hull(f"r{i + 1}", points, 20.0, inner="drop")
                for i, points in enumerate(cells(rng, number))
            ]
            scene = Scene((ground, *blocks), ("ground",), Load(acceleration=direction(rng)),
                          friction=friction)  # fmt: skip
            len(scene.contacts)
        except InputError:  # a cell so small that it is degenerate, or hangs by a point
            continue
        return Sample(scene, knob=f"{number} cells")


def _mesh(rng: np.random.Generator, scale: int) -> Sample:
    """A wall as triangles whose corners are off by 1e-9 to 3e-3 of a block's thickness."""
    exact, noise = random_wall(int(rng.integers(1_000_000))), spread(rng, 1e-9, 3e-3)
    blocks = []
    for block in exact.blocks:
        if block.density is None:
            blocks.append(block)
            continue
        points = block.vertices + 0.2 * noise * rng.uniform(-1, 1, block.vertices.shape)
        triangles = [(f[0], f[k], f[k + 1]) for f in block.faces for k in (1, 2)]
        blocks.append(solid(block.id, points, triangles, block.density))
    scene = Scene(tuple(blocks), exact.supports, exact.live, friction=exact.friction)
    return Sample(scene, knob=f"noise {noise:.0e}")


FAMILIES = (
    Family("rocks", "a cuboid of rock cut by random planes", _rock),
    Family("meshes", "walls as triangle meshes with noise", _mesh),
)
