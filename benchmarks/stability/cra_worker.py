"""Runs in compas_cra's own environment: does a structure stand under its weight, tilted so far?

``python cra_worker.py SCENE.json``: {"blocks": [[vertices, faces], ...], "supports": [index, ...],
"friction": mu, "tilts": [...]}. Prints one JSON line: for every tilt the sum of the tensile forces
that rigid-block equilibrium (RBE, with tension at a price of 1e6) needs, over the weight.
"""

import contextlib
import io
import json
import sys
import time

import numpy as np
from compas.datastructures import Mesh
from compas_assembly.datastructures import Block
from compas_cra.algorithms import assembly_interfaces_numpy
from compas_cra.datastructures import CRA_Assembly
from compas_cra.equilibrium import rbe_solve


def tension(given: dict, tilt: float) -> float:
    """Tensile forces over the weight, with the structure turned about y by atan(tilt)."""
    c, s = 1.0 / np.hypot(1.0, tilt), tilt / np.hypot(1.0, tilt)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    assembly, weight = CRA_Assembly(), 0.0
    for index, (vertices, faces) in enumerate(given["blocks"]):
        mesh = Mesh.from_vertices_and_faces((np.array(vertices) @ turn.T).tolist(), faces)
        assembly.add_block(mesh.copy(cls=Block), index)
        weight += 0.0 if index in given["supports"] else mesh.volume()
    assembly.set_boundary_conditions(given["supports"])
    assembly_interfaces_numpy(assembly, nmax=20, amin=1e-6, tmax=1e-4)
    rbe_solve(assembly, mu=given["friction"], density=1.0)
    pulled = 0.0
    for edge in assembly.graph.edges():
        for interface in assembly.graph.edge_attribute(edge, "interfaces") or []:
            pulled += sum(max(f["c_nn"], 0.0) for f in interface.forces or [])
    return pulled / weight


with open(sys.argv[1], encoding="utf-8") as file:
    GIVEN = json.load(file)
START, FOUND = time.process_time(), []
for TILT in GIVEN["tilts"]:
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            FOUND.append(tension(GIVEN, TILT))
        except Exception as error:
            FOUND.append(f"{type(error).__name__}: {error}"[:120])
sys.stdout.write(json.dumps({"tension": FOUND, "seconds": time.process_time() - START}) + "\n")
