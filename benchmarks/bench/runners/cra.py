"""compas_cra in its own environment: rigid-block equilibrium (RBE), with Coulomb forces at corners.

RBE says whether a structure stands under its own weight. A horizontal push on all blocks is found
by tilting: bisection between what stands and what falls, to a hundredth. A live load of another
kind cannot be said to it; then the answer is whether the dead load stands.

RBE takes tension at a price of 1e6; a structure falls if it takes more than 1e-3 of its weight
(1e-7 to 4e-5 was seen 1 % below our load factors, 2e-3 to 2e-2 as much above them).
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np
from compas.datastructures import Mesh
from compas_assembly.datastructures import Block
from compas_cra.algorithms import assembly_interfaces_numpy
from compas_cra.datastructures import CRA_Assembly
from compas_cra.equilibrium import rbe_solve

from protocol import answer, dry

PULL = 1e-3
CLOSE = 0.01
FACES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def body(block: dict[str, Any]) -> tuple[np.ndarray, list[list[int]]]:
    """Vertices and faces."""
    if "box" not in block:
        return np.array(block["vertices"]), block["faces"]
    (x0, y0, z0), (x1, y1, z1) = block["box"]["min"], block["box"]["max"]
    ring = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return np.array([(x, y, z) for z in (z0, z1) for x, y in ring]), FACES


def sized(scene: dict[str, Any]) -> dict[str, Any]:
    """With blocks of volume 1 in the mean: its tolerances are absolute numbers."""
    bodies = {block["id"]: body(block) for block in scene["blocks"]}
    free = [name for name in bodies if name not in scene["supports"]]
    volumes = [
        Mesh.from_vertices_and_faces(v.tolist(), f).volume() for v, f in map(bodies.get, free)
    ]
    scale = (len(free) / sum(volumes)) ** (1 / 3)
    blocks = [
        {"id": name, "vertices": (vertices * scale).tolist(), "faces": faces}
        for name, (vertices, faces) in bodies.items()
    ]
    return {**scene, "blocks": blocks}


def stands(scene: dict[str, Any], pull: np.ndarray) -> bool:
    """Whether it stands where gravity points along ``pull``."""
    down = pull / np.linalg.norm(pull)
    side = np.cross(down, (0, 0, -1.0))
    sine, cosine = float(np.linalg.norm(side)), float(-down[2])
    turn = np.eye(3)
    if sine > 0:
        x, y, z = side / sine
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + sine * cross + (1 - cosine) * cross @ cross
    assembly, weight, names = CRA_Assembly(), 0.0, {}
    for index, block in enumerate(scene["blocks"]):
        vertices, faces = body(block)
        mesh = Mesh.from_vertices_and_faces((vertices @ turn.T).tolist(), faces)
        assembly.add_block(mesh.copy(cls=Block), index)
        names[block["id"]] = index
        weight += 0.0 if block["id"] in scene["supports"] else mesh.volume()
    assembly.set_boundary_conditions([names[support] for support in scene["supports"]])
    assembly_interfaces_numpy(assembly, nmax=20, amin=1e-6, tmax=1e-4)
    rbe_solve(assembly, mu=scene["friction"], density=1.0)
    pulled = sum(
        max(force["c_nn"], 0.0)
        for edge in assembly.graph.edges()
        for interface in assembly.graph.edge_attribute(edge, "interfaces") or []
        for force in interface.forces or []
    )
    return bool(pulled / weight <= PULL)


def readable(file: Path) -> dict[str, Any]:
    """The scene, if it is one of blocks of one density and one friction under gravity."""
    scene = dry(file)
    densities = {b["density"] for b in scene["blocks"] if b["id"] not in scene["supports"]}
    if scene.get("contacts") or len(densities) != 1:
        raise ValueError("one friction and one density for all blocks is what the runner can say")
    if set(scene["loads"].get("dead", {"gravity": 0})) != {"gravity"}:
        raise ValueError("dead loads other than gravity are not for RBE")
    return scene


def solve(file: Path) -> dict[str, Any]:
    """Bisection of the tilt."""
    scene = sized(readable(file))
    with contextlib.redirect_stdout(io.StringIO()):
        live, gravity = scene["loads"]["live"], np.array([0, 0, -1.0])
        if not stands(scene, gravity):
            return {"answer": "falls"}
        if set(live) != {"acceleration"}:
            return {"answer": "stands"}
        push, low, high = np.array(live["acceleration"], float), 0.0, 0.1
        while stands(scene, gravity + high * push):
            low, high = high, 2 * high
            if high > 10:
                return {"answer": "no limit"}
        while high - low > CLOSE * high:
            middle = (low + high) / 2
            if stands(scene, gravity + middle * push):
                low = middle
            else:
                high = middle
    return {"load_factor": (low + high) / 2, "reach": (high - low) / 2}


answer(("compas_cra",), solve)
