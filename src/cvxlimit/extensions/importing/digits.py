"""Whether the numbers of a file have digits enough to tell its blocks apart.

Far from the origin, as in map coordinates, single precision and texts of six or seven digits leave
steps of centimetres to metres: corners fall together, joints gape, and blocks vanish.
:func:`too_few_digits` finds this before blocks are made.

Surveys, and models drawn by hand, are inexact in another way: their faces are not plane, and joints
gape by as much. :func:`with_noise` then finds contacts with a wider joint tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cvxlimit.errors import GeometryError, InputError
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.extensions.importing.steps import FEW, digits_of, holds_single, last_place
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import polygon_vectors
from cvxlimit.geometry.polyhedra import JOINT_TOLERANCE
from cvxlimit.scene import Scene

NOISIEST = 5.0
"""Times the usual joint tolerance, up to which a measured one is taken unasked: a twentieth of a
stone's thickness, which is less than any stone is wide, so that no stone is joined to the next but
one."""

WORTH_A_WORD = 2e-4
"""Share of a stone's size: steps as large change width over height of a stone twice as high as wide
by up to a thousandth, and with it the load factor at which it overturns."""


def too_few_digits(bodies: Sequence[Body], share: float = JOINT_TOLERANCE) -> str:
    """What is wrong with the coordinates, and the cure; empty if nothing is, or if a move to the
    origin would not help.

    They are too coarse if the numbers that a file can hold lie farther apart than ``share`` of the
    blocks' size, by default by as much as joints may gape. The joint tolerance is a share of mean
    thickness, which bodies not yet checked do not have; their longest side takes its place. No
    block is thicker, so that only what is coarser than any tolerance is refused.
    """
    filled = [body.vertices for body in bodies if len(body.vertices)]
    sides = np.array([np.ptp(points, axis=0).max() for points in filled])
    size = float(np.median(sides[sides > 0.0])) if (sides > 0.0).any() else 0.0
    points = np.concatenate(filled) if filled else np.empty((0, 3))
    if not size or not np.isfinite(points).all():
        return ""
    single, digits = is_single(bodies), digits_of(points)
    if not single and digits >= FEW:
        return ""
    kind = "in single precision" if single else f"with {digits} digits"
    coarsest, words = share * size, ""
    for axis, values in zip("xyz", points.T, strict=True):
        far, extent = float(np.abs(values).max()), float(np.ptp(values))
        # between neighbouring numbers where the model stands, and where it would beside the origin
        if single:
            step, step_at_origin = (float(np.spacing(np.float32(x))) for x in (far, extent))
        else:
            step, step_at_origin = last_place(far, digits), last_place(extent, digits)
        # a move is worth the trouble if it makes numbers more than ten times finer
        if step > coarsest and step_at_origin < 0.1 * step:
            coarsest = step
            words = (
                f"along {axis} they reach {far:.7g} {kind}, which leaves steps of {step:.2g} for "
                f"blocks of some {size:.2g}; move the model to an origin beside it, or write more "
                "digits, and export it again"
            )
    what = "cannot tell its blocks apart" if share >= JOINT_TOLERANCE else "are coarse"
    return f"the file's numbers {what}: {words}" if words else ""


def is_single(bodies: Sequence[Body]) -> bool:
    """True if all coordinates are numbers of single precision, as binary files have them."""
    return all(holds_single(body.vertices) for body in bodies)


def with_noise(
    scene: Scene,
    bodies: Sequence[Body],
    blocks_with_tolerance: Callable[[float], tuple[Block, ...]],
    notes: list[str],
) -> Scene:
    """The scene; or, where its contacts are refused and faces are warped, as by noise, the one with
    a joint tolerance that follows from the warp, of which ``notes`` then gets a sentence.

    The tolerance is four times the warp: twice, because the mean plane of a face follows its
    corners, which have moved by more than they lie off it; and twice again, because a joint has
    two such sides. ``blocks_with_tolerance`` makes the blocks anew, for a given tolerance.
    """
    if scene.joint_tolerance is not None:
        return scene
    warp = max(map(warped, bodies), default=0.0)
    usual = min(block.joint_tolerance for block in scene.blocks)
    wider = 4.0 * warp
    if not usual < wider <= NOISIEST * usual or _contacts_are_found(scene):
        return scene
    try:
        rough = replace(scene, blocks=blocks_with_tolerance(wider), joint_tolerance=wider)
        is_mended = _contacts_are_found(rough)
    except InputError:
        is_mended = False
    if not is_mended:
        return scene  # and its refusal comes when contacts are asked for
    unit = scene.units.length
    notes.append(
        f"faces are warped by up to {warp:.3g} {unit}, as by noise: gaps and overlaps of up to "
        f"{wider:.3g} {unit} are taken as joints, unless joint_tolerance says otherwise"
    )
    return rough


def _contacts_are_found(scene: Scene) -> bool:
    """False if the search for contacts refuses the blocks. A scene searches when its contacts are
    first asked for, and keeps them."""
    try:
        _ = scene.contacts
    except GeometryError:
        return False
    return True


def warped(body: Body) -> float:
    """The farthest that a corner lies off the mean plane of its face; triangles are always plane
    and do not count."""
    farthest = 0.0
    for face in body.faces:
        arms = body.vertices[list(face)]
        arms = arms - arms.mean(axis=0)
        normal = polygon_vectors(arms)
        size = float(np.linalg.norm(normal))
        if len(face) > 3 and size > 0.0:
            farthest = max(farthest, float(np.abs(arms @ normal).max()) / size)
    return farthest
