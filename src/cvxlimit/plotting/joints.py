"""Joints as figures and pages draw them."""

from __future__ import annotations

import numpy as np

from cvxlimit.plotting.annotations import Marking, joint_kinds
from cvxlimit.plotting.look import JOINT_COLOURS, JOINT_TEXTS, KIND_COLOURS, KIND_TEXTS
from cvxlimit.plotting.movement import ContactKind, Motion
from cvxlimit.scene import Scene

THINNEST = 0.22
"""Width of the joint that moves least, as a share of that which moves most: still to be seen."""


def moving_joints(scene: Scene, moving: Motion, widest: float = 1.0) -> Marking:
    """Contacts by what they do in a mechanism, as wide as they move, so that many small slips do
    not hide what fails."""
    what = moving.contacts
    kinds = {kind: KIND_COLOURS[kind] for kind in KIND_COLOURS if moving.moves}
    slides = np.isin(what.kind, (ContactKind.SLIDES, ContactKind.TWISTS))
    rate = np.where(slides, what.slip, what.widest)
    largest = float(rate[what.kind != ContactKind.CLOSED].max(initial=0.0))
    share = np.clip(rate / largest, 0.0, 1.0) if largest > 0.0 else np.ones(len(rate))
    width = THINNEST + (widest - THINNEST) * share
    return Marking(scene.contacts, what.kind, kinds, KIND_TEXTS, width)


def scene_joints(scene: Scene) -> Marking:
    """Contacts by how they lie to the dead load."""
    return Marking(scene.contacts, joint_kinds(scene, scene.contacts), JOINT_COLOURS, JOINT_TEXTS)
