"""Where a path may begin: at rest on its joints, or displaced, held at points by the push alone."""

from __future__ import annotations

import numpy as np

from cvxlimit.errors import GeometryError
from cvxlimit.geometry.detection import detect
from cvxlimit.scene.scene import Scene


def begun(scene: Scene) -> tuple[Scene, GeometryError | None]:
    """The scene with contacts as a path needs them, and why it has none of its own.

    On a path blocks may touch at edges alone, and pairs that do not touch yet may have a friction
    of their own, which counts from where they do. Elsewhere both are refused.
    """
    loose: GeometryError | None = None
    try:
        found = scene._detection
    except GeometryError as error:
        loose, every = error, {block.id for block in scene.blocks}
        found = detect(
            scene.blocks, scene.supports, scene.friction, scene.joint_tolerance, tied=every
        )
    touching = {*found.contacts.pairs}
    own = {pair: mu for pair, mu in scene.contact_friction.items() if pair in touching}
    if loose is None and len(own) == len(scene.contact_friction):
        return scene, None
    contacts = scene._copy(contact_friction=own)._beside("_detection", found).contacts
    if not len(contacts):  # lengths are compared with blocks where there is no contact
        size = float(np.median([scene.blocks[i].size for i in scene.free]))
        contacts.__dict__["typical_size"] = size
    return scene._with_contacts(contacts), loose
