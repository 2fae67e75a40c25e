"""Mortar that bears tension: Mohr-Coulomb with a tension cut-off, for any polygon.

Pressures p >= -t with abs(slip stress) <= c + mu p are pressures p + t >= 0 and a uniform tension
t, a force t A through the centroid. So such contacts are dry ones, with N + t A in place of N and
cohesion c - mu t, under a dead load that also pulls both blocks together with t A.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cvxlimit.base.arrays import ROUNDING, FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.statics import DOF, Statics
from cvxlimit.scene import Scene


@dataclass(frozen=True, eq=False)
class Mortar:
    """A scene without tension that stands for one with, and what its normal forces hide: N of the
    original scene is N of ``scene`` less ``pull`` (n,). Reactions that push at least so much push
    that much in its dead load, too.

    >>> from cvxlimit import builtin_scene
    >>> scene = builtin_scene("single-block").with_cohesion(1.0).with_strength(tensile=0.5)
    >>> mortar = Mortar.of(scene)
    >>> (mortar.pull / scene.contacts.area).round(6).tolist()
    [0.5]
    """

    scene: Scene
    pull: FloatArray

    @classmethod
    def of(cls, scene: Scene) -> Mortar:
        contacts = scene.contacts
        tension = contacts.tensile_strength
        if not contacts.pulls:
            return cls(scene, np.zeros(len(contacts)))
        cohesion = contacts.cohesion - contacts.friction * tension
        # c = mu t is a fair choice
        short = np.flatnonzero(cohesion < -ROUNDING * contacts.cohesion)
        if len(short):
            j = int(short[0])
            raise ModelError(
                f"tensile_strength {tension[j]:g} of contact {contacts.names[j]} is beyond its "
                f"cohesion over friction, {contacts.cohesion[j]:g} / {contacts.friction[j]:g}: "
                "Mohr-Coulomb's cone ends there; give more cohesion or less tensile strength"
            )
        pressed, pull = without_tension(contacts)
        forces = np.zeros((len(pull), len(COMPONENTS)))
        forces[:, COLUMN["N"]] = pull
        extra = -(Statics.of(scene).matrix @ forces.ravel()).reshape(-1, DOF)
        own = dict(scene.dead.forces)
        for i, force in zip(scene.free, extra, strict=True):
            key = scene.blocks[i].id
            own[key] = tuple(np.array(own.get(key, np.zeros(DOF))) + force)
        pulled = scene.with_dead(replace(scene.dead, forces=own))
        return cls(pulled._with_contacts(pressed), pull)

    def original(self, forces: FloatArray) -> FloatArray:
        result = np.array(forces)
        result[:, COLUMN["N"]] -= self.pull
        return result


def without_tension(contacts: Contacts) -> tuple[Contacts, FloatArray]:
    """The contacts without tensile strength, and without least reactions, that stand for some with,
    and their ``pull`` (n,)."""
    tension, least = contacts.tensile_strength, contacts.least
    pressed = contacts.with_values(
        cohesion=np.maximum(contacts.cohesion - contacts.friction * tension, 0.0),
        compressive_strength=contacts.compressive_strength + tension,
        tensile_strength=0.0,
        least=0.0,
        most=contacts.most - least,
    )
    return pressed, tension * contacts.area - contacts.sense * least
