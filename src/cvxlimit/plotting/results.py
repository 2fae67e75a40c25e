"""Pictures of what was found: mechanism, cracks, forces, thrust lines, utilisation, exploded view.

Every function returns a figure and shows nothing by itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from cvxlimit.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.pressure import pressure_centres
from cvxlimit.plotting.annotations import Decal, Marking, annotated
from cvxlimit.plotting.camera import Camera, camera_from, thin_axis
from cvxlimit.plotting.crushing import overlay as yielding_overlay
from cvxlimit.plotting.drawing import Bar, Drawing, SceneFigure, camera_for, drawn
from cvxlimit.plotting.joints import moving_joints
from cvxlimit.plotting.look import (
    SPEED_STOPS,
    SPEED_TEXT,
    SUPPORT_COLOUR,
    USE_STOPS,
    rgb,
    title,
    used_colour,
)
from cvxlimit.plotting.mesh import drawn_mesh
from cvxlimit.plotting.movement import (
    Motion,
    contact_forces,
    free_size,
    motion,
    still,
)
from cvxlimit.plotting.strength import utilisations
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Viewer = tuple[float, float, float] | None

PALE = "#efeae0"
"""Blocks behind lines and coloured joints: light enough for both."""

FORCE_COLOUR, THRUST_COLOUR, CENTRE_COLOUR = "#1b5e9c", "#123f6b", "#b3123c"

LONGEST_FORCE = 0.16
"""Length of the largest resultant, relative to the free blocks' size."""

FAINTEST = 0.004
"""Forces below this share of the largest are not drawn: a tenth of a line's width."""

CRACK = 2.2
"""Width of the widest crack, in lines of the mechanism's widest joint: nothing gapes there to be
seen by."""

DOTTED = 0.05
"""Pressure centres are marked where more than this share of the largest force passes: a wall of
many joints would be dots all over."""

_UPRIGHT = 0.1
"""A structure whose joints all lie within this (sine) of being across one plane is planar."""

_LEVELS = 32
"""Colours that utilisation is told apart by: more than eyes can."""

_CORNERS = 20
"""Of the polygon that stands for a dot."""


def mechanism(
    solution: Solution, *, magnification: float = 1.0, viewer: Viewer = None
) -> SceneFigure:
    """How the structure falls: displaced blocks by speed, and what the joints do.

    Joints that open, slide or twist are outlined, the wider the faster, so that many small slips
    do not hide what fails.

    Parameters
    ----------
    solution : Solution
        With its scene.
    magnification : float
        Of the displacements as they are drawn by themselves: 9 % of the structure's size. What the
        largest one comes to is said on the picture; rates have no size of their own.
    viewer : (3,) or None
        Direction from the scene towards the viewer; chosen from the movement if None.

    Raises
    ------
    InputError
        For a solution without its scene, or a magnification that is not above 0.
    """
    return mechanism_of(solution.drawn_scene, solution, magnification, viewer)


def mechanism_of(
    scene: Scene, solution: Solution, magnification: float = 1.0, viewer: Viewer = None
) -> SceneFigure:
    """The mechanism of a solution of ``scene``; see :func:`mechanism`."""
    moving = magnified(motion(scene, solution), magnification)
    drawing = mechanism_drawing(scene, solution, moving)
    return drawn(scene, moving, camera_for(scene, moving, viewer), drawing)


def magnified(moving: Motion, magnification: float) -> Motion:
    """The same with displacements drawn larger or smaller."""
    times = positive(magnification, "magnification")
    return replace(moving, scale=times * moving.scale)


def mechanism_drawing(scene: Scene, solution: Solution, moving: Motion) -> Drawing:
    """What the picture of a mechanism consists of."""
    length = moving.scale * moving.largest
    caption = (
        f"collapse mechanism; largest displacement drawn {length:.3g} {scene.units.length}; "
        "joint lines by rate"
    )
    return Drawing(
        title(solution),
        caption if moving.moves else "",
        marking=moving_joints(scene, moving),
        notes=annotated(scene),
        bar=Bar(SPEED_STOPS, SPEED_TEXT) if moving.moves else None,
        blocks="block (no mechanism)",
        overlay=yielding_overlay(scene, solution, moving),
    )


def cracks(solution: Solution, *, viewer: Viewer = None) -> SceneFigure:
    """The crack pattern: joints that open, slide and twist, on the undeformed structure.

    Lines are as wide as the joints move. Parameters and errors as for :func:`mechanism`.
    """
    scene = solution.drawn_scene
    moving = motion(scene, solution)
    drawing = Drawing(
        title(solution),
        "crack pattern: joint lines as wide as they move in the mechanism",
        marking=moving_joints(scene, moving, CRACK),
        colours=_pale(scene),
    )
    camera = camera_for(scene, moving, viewer)
    return drawn(scene, replace(moving, scale=0.0, largest=0.0), camera, drawing)


def forces(solution: Solution, *, viewer: Viewer = None) -> SceneFigure:
    """Resultants: the force that each joint transmits, through its pressure centre.

    Parameters and errors as for :func:`mechanism`; besides, a solution must have forces. Planar
    structures are seen straight from the front unless ``viewer`` says otherwise.
    """
    scene = solution.drawn_scene
    found = _forces(scene, solution)
    _, place = pressure_centres(scene.contacts, found)
    vectors = np.einsum("nk,nkx->nx", found[:, :3], scene.contacts.axes)
    size = np.linalg.norm(vectors, axis=1)
    largest = float(size.max(initial=0.0)) or 1.0
    shown = np.flatnonzero((size > FAINTEST * largest) & np.isfinite(place).all(axis=1))
    half = 0.5 * LONGEST_FORCE * free_size(scene) * vectors[shown] / largest
    widths = 0.7 + 1.8 * size[shown] / largest

    def overlay(axes: Axes, camera: Camera) -> FloatArray:
        low, high = (camera.project(place[shown] + side * half)[:, :2] for side in (-1.0, 1.0))
        _lines(axes, np.stack([low, high], axis=1), widths, FORCE_COLOUR)
        _dots(axes, camera.project(place[shown][size[shown] > DOTTED * largest])[:, :2])
        return np.concatenate([low, high])

    drawing = Drawing(
        title(solution),
        f"forces in the joints; the longest line is {largest:.3g} {scene.units.force}",
        colours=_pale(scene),
        handles=[_line_key(FORCE_COLOUR, "resultant"), _dot_key()],
        overlay=overlay,
    )
    return _behind_lines(scene, solution, viewer, drawing)


def thrust(solution: Solution, *, viewer: Viewer = None) -> SceneFigure:
    """Thrust lines: how compression flows from joint to joint through the pressure centres.

    Where a block has two loaded joints the line joins their pressure centres, as in an arch; where
    it has more, lines meet in the mean of them, weighted by force. Lines are as wide as the force.
    Parameters and errors as for :func:`forces`.
    """
    scene = solution.drawn_scene
    found = _forces(scene, solution)
    ends, size = thrust_lines(scene, found)
    largest = float(size.max(initial=0.0)) or 1.0
    widths = 0.5 + 3.5 * size / largest
    _, place = pressure_centres(scene.contacts, found)
    pressed = found[:, 2] > DOTTED * float(found[:, 2].max(initial=0.0))

    def overlay(axes: Axes, camera: Camera) -> FloatArray:
        lines = camera.project(ends.reshape(-1, 3))[:, :2].reshape(-1, 2, 2)
        _lines(axes, lines, widths, THRUST_COLOUR)
        _dots(axes, camera.project(place[pressed])[:, :2])
        return lines.reshape(-1, 2)

    drawing = Drawing(
        title(solution),
        f"thrust lines at collapse; the widest line carries {largest:.3g} {scene.units.force}",
        colours=_pale(scene),
        handles=[_line_key(THRUST_COLOUR, "thrust"), _dot_key()],
        overlay=overlay,
    )
    return _behind_lines(scene, solution, viewer, drawing)


def thrust_lines(scene: Scene, found: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ends (k, 2, 3) and compressions (k,) of the thrust lines of contact forces (n, 6)."""
    contacts = scene.contacts
    _, place = pressure_centres(contacts, found)
    normal = found[:, 2]
    loaded = np.flatnonzero(
        (normal > FAINTEST * float(normal.max(initial=0.0))) & np.isfinite(place).all(axis=1)
    )
    ends: list[FloatArray] = []
    size: list[float] = []
    for block in scene.free.tolist():
        own = loaded[(contacts.a[loaded] == block) | (contacts.b[loaded] == block)]
        if len(own) == 2:
            ends.append(place[own])
            size.append(float(normal[own].mean()))
        elif len(own):
            hub = normal[own] @ place[own] / normal[own].sum()
            ends += [np.stack([place[j], hub]) for j in own.tolist()]
            size += normal[own].tolist()
    return np.array(ends).reshape(-1, 2, 3), np.array(size)


def utilisation(
    solution: Solution, *, surface: str | None = None, viewer: Viewer = None
) -> SceneFigure:
    """How much of its strength each joint uses: joint lines from light (nothing) to dark (all).

    Parameters
    ----------
    solution, viewer
        As for :func:`mechanism`; a solution must have forces.
    surface : str or None
        ``"rocking"``, ``"sliding"``, ``"torsion"``, ``"torsion-shear"``, and with interaction
        ``"torsion-shear-bending"`` (Eq. 30); None is the largest of those that were solved with.
    """
    scene = solution.drawn_scene
    used, words = _used(solution, scene, surface)
    level, colours = _levels(used)
    texts = dict.fromkeys(colours, "")
    drawing = Drawing(
        title(solution),
        f"strength in use at collapse, {words}",
        marking=Marking(scene.contacts, level, colours, texts),
        has_key=False,
        colours=_pale(scene),
        bar=Bar(USE_STOPS, "share of strength in use"),
    )
    moving = motion(scene, solution)
    camera = camera_for(scene, moving, viewer)
    return drawn(scene, _at_rest(scene), camera, drawing)


def exploded(
    solution: Solution | Scene, *, gap: float = 0.45, viewer: Viewer = None
) -> SceneFigure:
    """Blocks drawn apart, so that joints are seen: how much of their strength they use, and where
    they are pressed.

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
    scene = solution if isinstance(solution, Scene) else solution.drawn_scene
    moving = _apart(scene, away)
    solved = solution if isinstance(solution, Solution) and solution.forces is not None else None
    decals = _faces(scene, solved)
    heading = title(solution) if isinstance(solution, Solution) else scene.name
    drawing = Drawing(
        heading,
        "exploded view" + ("; joints by share of strength in use" if solved else ": joints"),
        colours=_pale(scene),
        decals=decals,
        bar=Bar(USE_STOPS, "share of strength in use") if solved else None,
        handles=[_dot_key()] if solved else [],
        has_axes=False,
    )
    shown = motion(scene, solved) if solved else still(scene)
    return drawn(scene, moving, camera_for(scene, shown, viewer), drawing)


def _at_rest(scene: Scene) -> Motion:
    return replace(still(scene), is_solved=True)


def _apart(scene: Scene, gap: float) -> Motion:
    """Blocks moved away from the middle of the foot; a support by its drawn part."""
    mesh = drawn_mesh(scene)
    centres = np.array([block.centroid for block in scene.blocks])
    fixed = {block.id for block in scene.blocks} & set(scene.supports)
    for i, block in enumerate(scene.blocks):
        own = mesh.points[mesh.point_block == i]
        if block.id in fixed and len(own):
            centres[i] = 0.5 * (own.min(axis=0) + own.max(axis=0))
    free = np.concatenate([scene.blocks[i].vertices for i in scene.free])
    foot = 0.5 * (free.min(axis=0) + free.max(axis=0))
    rates = np.zeros((len(scene.blocks), 6))
    rates[:, :3] = gap * (centres - foot)
    return replace(_at_rest(scene), rates=rates, scale=1.0)


def _faces(scene: Scene, solution: Solution | None) -> list[Decal]:
    """Contacts on the faces of both blocks, and dots at their pressure centres."""
    contacts = scene.contacts
    used = np.full(len(contacts), np.nan)
    place = np.full((len(contacts), 3), np.nan)
    if solution is not None:
        used = _used(solution, scene, None)[0]
        place = pressure_centres(contacts, _forces(scene, solution))[1]
    radius = 0.22 * float(np.median(np.sqrt(contacts.area)))
    turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    round_ = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    result: list[Decal] = []
    for j in range(len(contacts)):
        colour = "#c9c3b4" if np.isnan(used[j]) else used_colour(float(used[j]))
        sides = (int(contacts.a[j]), int(contacts.b[j]))
        own = 0.5 * min(radius, 0.6 * float(np.sqrt(contacts.area[j])))
        for block in sides:
            result += [Decal(piece, block, colour) for piece in contacts.piece_points(j)]
            if np.isfinite(place[j]).all():
                dot = place[j] + own * round_ @ contacts.axes[j, :2]
                result.append(Decal(dot, block, CENTRE_COLOUR, lift=2.0))
    return result


def _used(solution: Solution, scene: Scene, surface: str | None) -> tuple[FloatArray, str]:
    _forces(scene, solution)
    found = utilisations(solution, scene)
    if surface is None:
        return found["utilisation"], "the most of all surfaces"
    name = "utilisation_" + str(surface).replace("-", "_").replace(" ", "_")
    if name not in found:
        known = [key.removeprefix("utilisation_") for key in found if key != "utilisation"]
        raise InputError(f"there is no surface {surface!r}: choose one of {', '.join(known)}")
    return found[name], str(surface)


def _levels(used: FloatArray) -> tuple[IntArray, dict[int, str]]:
    """A code for every contact, 0 where it carries nothing, and colours by code."""
    steps = np.clip(np.nan_to_num(used) * _LEVELS, 0, _LEVELS - 1).astype(np.int64)
    level = np.where(np.isnan(used), 0, 1 + steps)
    colours = {1 + i: used_colour((i + 0.5) / _LEVELS) for i in range(_LEVELS)}
    return level, colours


def _forces(scene: Scene, solution: Solution) -> FloatArray:
    found = contact_forces(scene, solution)
    if found is None:
        raise InputError(
            f"the solution of {solution.scene!r} has no contact forces ({solution.status})"
        )
    return found


def _behind_lines(
    scene: Scene, solution: Solution, viewer: Viewer, drawing: Drawing
) -> SceneFigure:
    """Blocks at rest behind an overlay; a planar structure straight from the front."""
    front = planar_front(scene)
    if viewer is None and front is not None:
        camera = camera_from(scene, front)
    else:
        camera = camera_for(scene, motion(scene, solution), viewer)
    return drawn(scene, _at_rest(scene), camera, drawing)


def planar_front(scene: Scene) -> FloatArray | None:
    """Direction in which to look at a structure whose joints all lie across one plane."""
    thin = thin_axis(scene)
    across = np.abs(scene.contacts.axes[:, 2] @ thin).max(initial=0.0)
    push = np.abs(scene.live_forces[:, :3] @ thin).max(initial=0.0)
    is_planar = across < _UPRIGHT and push <= 1e-9 * np.abs(scene.live_forces).max(initial=0.0)
    return -thin if is_planar else None


def _pale(scene: Scene) -> FloatArray:
    colours = np.tile(rgb(PALE), (len(scene.blocks), 1))
    fixed = np.ones(len(scene.blocks), dtype=bool)
    fixed[scene.free] = False
    colours[fixed] = rgb(SUPPORT_COLOUR)
    return colours


def _lines(axes: Axes, ends: FloatArray, widths: FloatArray, colour: str) -> None:
    axes.add_collection(
        LineCollection(
            list(ends), linewidths=widths, colors=colour, zorder=6, capstyle="round",
            path_effects=[withStroke(linewidth=1.0, foreground="#ffffff60")],
        ),
        autolim=False,
    )  # fmt: skip


def _dots(axes: Axes, at: FloatArray) -> None:
    size = float(np.clip(60.0 / np.sqrt(len(at) or 1), 1.2, 5.0))
    axes.plot(*at.T, "o", ms=size, mfc=CENTRE_COLOUR, mec="white", mew=0.25 * size**0.5, zorder=7)


def _line_key(colour: str, label: str) -> Artist:
    return Line2D([], [], color=colour, lw=2.2, label=label)


def _dot_key() -> Artist:
    return Line2D(
        [], [], ls="none", marker="o", ms=5, mfc=CENTRE_COLOUR, mec="white", label="pressure centre"
    )
