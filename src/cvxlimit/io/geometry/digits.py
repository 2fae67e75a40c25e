"""Whether the numbers of a file have digits enough to tell its blocks apart.

Far from the origin, as in map coordinates, single precision and texts of six or seven digits leave
steps of centimetres to metres: corners fall together, joints gape, and blocks vanish. And whether
geometry is no more exact than its faces are plane: surveys, and models drawn by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import GeometryError, InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import polygon_vectors
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE
from cvxlimit.io.geometry.bodies import Body
from cvxlimit.scene import Scene

_SAMPLE = 2_000
"""Numbers that are looked at for their digits; a file is written with one and the same format."""

_FEW = 9
"""Numbers with fewer digits may have been cut; doubles written in full have 15 to 17."""


def too_few_digits(bodies: Sequence[Body]) -> str:
    """What is wrong with the coordinates, and the cure; empty if a move to the origin would not
    help, or steps between numbers are no wider than joints may gape."""
    filled = [body.vertices for body in bodies if len(body.vertices)]
    sides = np.array([np.ptp(points, axis=0).max() for points in filled])
    size = float(np.median(sides[sides > 0.0])) if (sides > 0.0).any() else 0.0
    points = np.concatenate(filled) if filled else np.empty((0, 3))
    if not size or not np.isfinite(points).all():
        return ""
    single, digits = is_single(bodies), _digits(points)
    worst, words = 0.0, ""
    for axis, values in zip("xyz", points.T, strict=True):
        far, extent = float(np.abs(values).max()), float(np.ptp(values))
        if single:
            step, near = (float(np.spacing(np.float32(x))) for x in (far, extent))
            what = "in single precision"
        elif digits < _FEW:
            step, near = (
                10.0 ** (np.floor(np.log10(x or 1.0)) + 1 - digits) for x in (far, extent)
            )
            what = f"with {digits} digits"
        else:
            continue
        if step > max(worst, JOINT_TOLERANCE * size) and near < 0.1 * step:
            worst = step
            words = (
                f"along {axis} they reach {far:.7g} {what}, which leaves steps of {step:.2g} for "
                f"blocks of some {size:.2g}; move the model to an origin beside it, or write more "
                "digits, and export it again"
            )
    return f"the file's numbers cannot tell its blocks apart: {words}" if words else ""


def is_single(bodies: Sequence[Body]) -> bool:
    """True if all coordinates are numbers of single precision, as binary files have them."""
    return all(bool((b.vertices.astype(np.float32) == b.vertices).all()) for b in bodies)


def _digits(values: FloatArray) -> int:
    """The most significant digits that a number of the file has."""
    some = np.unique(values)[:: max(1, len(values) // _SAMPLE)].tolist()
    return max((len(Decimal(repr(x)).normalize().as_tuple().digits) for x in some), default=0)


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
