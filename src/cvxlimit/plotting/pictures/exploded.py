"""Blocks drawn apart."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import cvxlimit.plotting.look as look
from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import positive
from cvxlimit.geometry.contacts import pressure_centres
from cvxlimit.plotting.annotations import Decal
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, camera_for
from cvxlimit.plotting.picture import drawn_mesh
from cvxlimit.plotting.pictures.utilisation import idle_keys, joint_areas, used_shares
from cvxlimit.plotting.registry import picture
from cvxlimit.results.movement import Motion, free_bounds, motion, still
from cvxlimit.results.utilisation import forces_of, least_used_state
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

CORNERS = 20
"""Of the polygon that stands for a dot."""


@picture
def exploded(solution: Solution | Scene, *, gap: float = 0.45, viewer: Viewer = None) -> Drawing:
    """Blocks drawn apart: how much of their strength joints use, and where they are pressed.

    In the state of force that uses joints least, as in :func:`utilisation`.

    Parameters
    ----------
    solution : Solution or Scene
        Of a scene, only blocks and joints are shown.
    gap : float
        How far apart: blocks move away from the foot of the structure by this share of their
        distance from it.
    viewer : (3,) or None

    Raises
    ------
    InputError
        For a solution without its scene, or a gap that is not above 0.
    """
    away = positive(gap, "gap of an exploded view")
    scene = solution if isinstance(solution, Scene) else solution.scene
    solved = solution if isinstance(solution, Solution) and solution.forces is not None else None
    shown = motion(scene, solved) if solved else still(scene)
    caption, used = "exploded view: joints", np.full(len(scene.contacts), np.nan)
    if solved is not None:
        solved, said = least_used_state(solved, scene)
        used = used_shares(solved, scene)
        caption = f"exploded view; strength in use {said}"
    return Drawing(
        scene,
        _apart(scene, away),
        camera_for(scene, shown, viewer),
        look.title(solution) if isinstance(solution, Solution) else scene.name,
        caption,
        colours=look.block_colours(scene, still(scene), stone=look.PALE),
        decals=[*joint_areas(scene, used, both=True), *_dots(scene, solved, used)],
        keys=idle_keys(used) if solved else [],
        dots=np.empty((0, 3)) if solved else None,
        bar=Bar(look.USE_STOPS, look.USE_TEXT) if solved else None,
        has_axes=False,
    )


def _apart(scene: Scene, gap: float) -> Motion:
    mesh = drawn_mesh(scene)
    centres = np.array([block.centroid for block in scene.blocks])
    for i in np.setdiff1d(np.arange(len(scene.blocks)), scene.free).tolist():
        own = mesh.points[mesh.point_block == i]
        if len(own):
            centres[i] = 0.5 * (own.min(axis=0) + own.max(axis=0))
    rates = np.zeros((len(scene.blocks), 6))
    rates[:, :3] = gap * (centres - free_bounds(scene).mean(axis=0))
    return replace(still(scene), rates=rates, scale=1.0)


def _dots(scene: Scene, solution: Solution | None, used: FloatArray) -> Iterator[Decal]:
    """Returns where joints are pressed that carry something."""
    if solution is None:
        return
    contacts = scene.contacts
    place = pressure_centres(contacts, forces_of(scene, solution))[1]
    side = np.sqrt(contacts.area)
    radius = np.minimum(0.075 * np.median(side), 0.25 * side)
    turn = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for j in np.flatnonzero(np.isfinite(place).all(axis=1) & ~np.isnan(used)).tolist():
        dot = place[j] + radius[j] * ring @ contacts.axes[j, :2]
        for block in (int(contacts.a[j]), int(contacts.b[j])):
            yield Decal(dot, block, look.CENTRE_COLOUR, lift=2.0)
