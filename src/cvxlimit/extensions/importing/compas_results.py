"""Contact forces and mechanism as results of compas_dem, which its viewer shows."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution


def results(solution: Solution, model: Any, largest: float | None) -> Any:
    """See :meth:`cvxlimit.Solution.to_compas`."""
    made = needed("compas_dem.problem.results", "compas", "results of compas_dem")
    scene, nodes = solution.scene, _nodes(solution.scene, model)
    result = made.Results(str(model.guid), solution.scene_name)
    result.metadata = {
        "load_factor": solution.load_factor, "lower": solution.lower, "upper": solution.upper,
        "status": str(solution.status),
    }  # fmt: skip
    for node, matrix in _motions(scene, solution, nodes, largest).items():
        place = needed("compas.geometry", "compas", "results of compas_dem").Transformation
        result.set_node(node, "transformation", place.from_matrix(matrix.tolist()))
    if solution.forces is not None:
        _put_forces(scene, solution.forces, nodes, result)
    return result


def _nodes(scene: Scene, model: Any) -> list[int]:
    """The model's node of every block; refused where it is somewhere else."""
    elements = {str(each.graphnode): each for each in model.elements()}
    for block in scene.blocks:
        element = elements.get(block.id)
        if element is None:
            raise InputError(f"block {block.id!r} of scene {scene.name!r} is no node of the model")
        points = np.array(element.modelgeometry.to_vertices_and_faces()[0], dtype=float)
        ends = np.stack([block.vertices.min(axis=0), block.vertices.max(axis=0)])
        off = np.abs(np.stack([points.min(axis=0), points.max(axis=0)]) - ends).max()
        if off > 0.01 * np.ptp(ends, axis=0).max():  # repairs move corners by less
            raise InputError(
                f"block {block.id!r} lies {off:.3g} from where the model has it: results go back "
                "to the model that the scene was made of, in its own length unit"
            )
    return [elements[block.id].graphnode for block in scene.blocks]


def _motions(
    scene: Scene, solution: Solution, nodes: list[int], largest: float | None
) -> dict[int, FloatArray]:
    """(4, 4) of every block: its rates, so long that the fastest corner moves by ``largest``."""
    still = np.zeros(6)
    rates = [(solution.mechanism or {}).get(block.id, still) for block in scene.blocks]
    speed = max(
        np.linalg.norm(d[:3] + np.cross(d[3:], block.vertices - block.centroid), axis=1).max()
        for d, block in zip(rates, scene.blocks, strict=True)
    )
    reach = 0.1 * scene.contacts.typical_size if largest is None else largest
    moved = {}
    for node, d, block in zip(nodes, rates, scene.blocks, strict=True):
        d = d * (reach / speed if speed > 0.0 else 0.0)
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_rotvec(d[3:]).as_matrix()
        matrix[:3, 3] = block.centroid + d[:3] - matrix[:3, :3] @ block.centroid
        moved[node] = matrix
    return moved


def _put_forces(scene: Scene, forces: FloatArray, nodes: list[int], result: Any) -> None:
    geometry = needed("compas.geometry", "compas", "results of compas_dem")
    contact_of = needed(
        "compas_dem.interactions", "compas", "results of compas_dem"
    ).FrictionContact
    contacts, by_edge = scene.contacts, dict[tuple[int, int], list[int]]()
    for j, (a, b) in enumerate(zip(contacts.a, contacts.b, strict=True)):
        by_edge.setdefault((nodes[a], nodes[b]), []).append(j)
    for edge, which in by_edge.items():
        made = []
        for j in which:
            xy, frame = contacts.corners_of(j), contacts.axes[j]
            points = contacts.origin[j] + xy @ frame[:2]
            made.append(
                contact_of(
                    points=[geometry.Point(*p) for p in points.tolist()],
                    frame=geometry.Frame(*map(list, (contacts.origin[j], frame[0], frame[1]))),
                    size=float(contacts.area[j]),
                    forces=_at_corners(xy, forces[j]),
                )
            )
        size = np.linalg.norm(forces[which][:, :3], axis=1)
        first = made[int(size.argmax())]
        on_b = sum(forces[j, :3] @ contacts.axes[j] for j in which)
        for name, value in {
            "contact_data": first, "contacts": made, "contact_polygon": first.polygon,
            "contact_frame": first.frame, "contact_points": [list(p) for p in first.points],
            "face_contact": True, "edge_contact": False, "point_contact": False,
            "resultant_global": np.asarray(on_b).tolist(),
            "resultant_local": forces[which[int(size.argmax())], :3].tolist(),
            "force_magnitude": float(np.linalg.norm(on_b)),
            "force_normal": [each["c_np"] - each["c_nn"] for each in first.forces],
            "force_tangent1": [each["c_u"] for each in first.forces],
            "force_tangent2": [each["c_v"] for each in first.forces],
        }.items():  # fmt: skip
            result.set_edge(edge, name, value)


def _at_corners(xy: FloatArray, force: FloatArray) -> list[dict[str, float]]:
    """Forces at a contact's corners whose resultant is V1, V2, N, M1, M2, MT: pressure wherever it
    can be that alone, and the least shear."""
    v1, v2, n, m1, m2, mt = force
    x, y = xy.T
    moments, wanted = np.stack([np.ones(len(x)), y, -x]), np.array([n, m1, m2])
    arm = max(float(np.abs(xy).max()), 1e-300)
    scale = np.array([1.0, 1.0 / arm, 1.0 / arm])  # all three are forces, for the residual
    normal, left = nnls(scale[:, None] * moments, scale * wanted)
    if left > 1e-6 * max(abs(n), float(np.abs(force).max())):  # it pulls somewhere
        normal = np.linalg.lstsq(moments, wanted, rcond=None)[0]
    ones, none = np.ones(len(x)), np.zeros(len(x))
    shear = np.stack([np.r_[ones, none], np.r_[none, ones], np.r_[-y, x]])
    u, v = np.split(np.linalg.lstsq(shear, np.array([v1, v2, mt]), rcond=None)[0], 2)
    return [
        {"c_np": max(p, 0.0), "c_nn": max(-p, 0.0), "c_u": s, "c_v": t}
        for p, s, t in zip(normal.tolist(), u.tolist(), v.tolist(), strict=True)
    ]
