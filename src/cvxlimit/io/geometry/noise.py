"""Geometry that is no more exact than its faces are plane: surveys, and models drawn by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import polygon_vectors
from cvxlimit.io.geometry.bodies import Body
from cvxlimit.scene import Scene

NOISIEST = 5.0
"""Over the usual joint tolerance, up to which a measured one is taken unasked: a twentieth of a
stone's thickness, which is less than any stone is wide."""


def with_noise(
    scene: Scene,
    bodies: Sequence[Body],
    made: Callable[[Body, float], Block],
    notes: list[str],
) -> Scene:
    """The scene; or, where its contacts are refused and faces are warped, as by noise, the one with
    a joint tolerance of four times that: twice for either side of a joint."""
    warp = max(map(warped, bodies), default=0.0)
    usual = min(block.joint_tolerance for block in scene.blocks)
    wider = 4.0 * warp
    if not usual < wider <= NOISIEST * usual:
        return scene
    try:
        len(scene.contacts)
        return scene
    except GeometryError:
        pass
    try:
        blocks = tuple(made(body, wider) for body in bodies)
        rough = replace(scene, blocks=blocks, joint_tolerance=wider)
        len(rough.contacts)
    except InputError:
        return scene  # and its refusal comes when contacts are asked for
    unit = scene.units.length
    notes.append(
        f"faces are warped by up to {warp:.3g} {unit}, as by noise: gaps and overlaps of up to "
        f"{wider:.3g} {unit} are taken as joints, unless --joint-tolerance says otherwise"
    )
    return rough


def warped(body: Body) -> float:
    """The farthest that a corner lies off the mean plane of a face; triangles do not say."""
    farthest = 0.0
    for face in body.faces:
        arms = body.vertices[list(face)]
        arms = arms - arms.mean(axis=0)
        normal = polygon_vectors(arms)
        size = float(np.linalg.norm(normal))
        if len(face) > 3 and size > 0.0:
            farthest = max(farthest, float(np.abs(arms @ normal).max()) / size)
    return farthest
