"""Arches of curved voussoirs, written with triangles of three corners on a line, and with edges
that only one of their faces is cut at."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cvxlimit import Block, Load, Scene
from flawed_imports import FORMS, Mesh
from gltf_files import Gltf

WAYS = {
    "whole": (False, False, False), "triangle": (False, False, True),
    "one-face": (True, False, False), "filled": (True, False, True),
    "both": (True, True, False), "both-and-triangle": (True, True, True),
}  # fmt: skip
"""Whether the one and the other face at an edge are cut, and whether triangles lie along it."""


class Arch:
    """Voussoirs between radial joints, whose inner and outer sides have several facets; somewhere,
    turned about the vertical. ``scene`` is made from the corners themselves."""

    def __init__(self, rng: np.random.Generator) -> None:
        radius, width, count = rng.uniform(0.8, 3.0), rng.uniform(0.2, 1.0), int(rng.integers(4, 9))
        half = rng.uniform(0.07, 0.15) * radius
        inner, outer = radius - half, radius + half
        facets, turn = int(rng.integers(2, 7)), rng.uniform(0.0, 2.0 * np.pi)
        along = np.array([np.cos(turn), np.sin(turn), 0.0])
        axes = np.array([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
        place = np.array([*rng.uniform(-20.0, 20.0, 2), 0.0])

        def prism(name: str, outline: Sequence[tuple[float, float]]) -> Mesh:
            k = len(outline)
            points = np.array([(x, y, z) for y in (0.0, width) for x, z in outline])
            sides = [((i + 1) % k, i, i + k, (i + 1) % k + k) for i in range(k)]
            faces = [tuple(range(k)), tuple(range(2 * k - 1, k - 1, -1)), *sides]
            return name, points @ axes + place, faces

        joints = np.linspace(np.pi, 0.0, count + 1)
        self.meshes = list[Mesh]()
        for i in range(count):
            angles = np.linspace(joints[i], joints[i + 1], facets + 1)
            ring = [(inner, a) for a in angles] + [(outer, a) for a in angles[::-1]]
            self.meshes.append(prism(f"v{i}", [(r * np.cos(a), r * np.sin(a)) for r, a in ring]))
        for name, (a, b) in {"left": (-outer, -inner), "right": (inner, outer)}.items():
            self.meshes.append(prism(name, [(a, -0.3), (a, 0.0), (b, 0.0), (b, -0.3)]))
        self.friction, self.live = float(rng.uniform(0.5, 0.9)), tuple(along.tolist())
        blocks = [Block.polyhedron(*mesh, 20.0) for mesh in self.meshes]
        push = Load(acceleration=self.live)
        self.scene = Scene(blocks, ["left", "right"], push, friction=self.friction)


def cut(mesh: Mesh, way: str, rng: np.random.Generator) -> Mesh:
    """One edge, at one place or at two, as ``way`` says."""
    name, points, polygons = mesh
    faces = [(f[0], f[k], f[k + 1]) for f in polygons for k in range(1, len(f) - 1)]
    one, other, filled = WAYS[way]
    a, b, _ = np.roll(faces[int(rng.integers(len(faces)))], rng.integers(3)).tolist()
    shares = [0.5] if rng.random() < 0.5 else [0.3, 0.7]
    line = [a, *range(len(points), len(points) + len(shares)), b]
    result = []
    for face in faces:
        for start in range(3):
            x, y, z = np.roll(face, -start).tolist()
            if (x, y) == (a, b) and one:
                result += [(u, v, z) for u, v in pairwise(line)]
            elif (x, y) == (b, a) and other:
                result += [(v, u, z) for u, v in pairwise(line)]
            else:
                continue
            break
        else:
            result.append(face)
    if filled:
        result += [(b, u, v) for u, v in pairwise(line[:-1])]
    new = [(1.0 - share) * points[a] + share * points[b] for share in shares]
    return name, np.vstack([points, *new]), result


def text_stl(meshes: list[Mesh]) -> bytes:
    """In seven digits, as most programs write it."""
    lines = ["solid all"]
    for _, points, faces in meshes:
        for face in faces:
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += ["vertex {:.6e} {:.6e} {:.6e}".format(*points[i]) for i in face]
            lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid all", ""]).encode()


def glb(meshes: list[Mesh]) -> bytes:
    file = Gltf()
    for mesh in meshes:
        file.stone(mesh)
    return file.glb()


WRITTEN = {**{name: FORMS[name] for name in ("a.stl", "a.ply", "a.obj", "a.off")},
           "text.stl": text_stl, "a.glb": glb}  # fmt: skip
