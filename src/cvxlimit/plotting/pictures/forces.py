"""What each joint transmits, and how compression flows from joint to joint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.geometry.contacts import pressure_centres
from cvxlimit.plotting.annotations import LONGEST, annotated, loads_to_scale
from cvxlimit.plotting.camera import thin_axis, upright
from cvxlimit.plotting.contents import Drawing, Lines, Viewer, at_rest
from cvxlimit.plotting.registry import picture
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import free_size
from cvxlimit.results.utilisation import forces_of
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

FAINTEST = 0.02
"""Forces below this share of the largest are not drawn: in a wall in space most joints carry a
hundredth of it, and their lines hide the others."""

THREADS = 0.1
"""The same for thrust lines in space, of which a wall has hundreds: what is below a tenth were
threads around the few lines by which the structure stands."""


FAR = 0.35
"""Opacity of the force farthest from the viewer over the nearest's: it is still seen on paper."""

ACROSS = 0.1
"""Sine of the angle within which the joints of a planar structure are across one plane."""


@picture
def forces(solution: Solution, *, viewer: Viewer = None) -> Drawing:
    """Resultants: the force that each joint exerts on the block above it, at its pressure centre.

    Arrows are as long, wide and dark as the force; below 2 % of the largest there is none. Loads
    are those at collapse. Dead load, live load and forces in joints each have a scale of their own:
    the legend says what the longest arrow of each stands for. Parameters and errors as for
    :func:`mechanism`; besides, a solution must have forces. Planar structures are seen straight
    from the front unless ``viewer`` says otherwise.
    """
    scene = solution.scene
    contacts, found = scene.contacts, forces_of(scene, solution)
    _, place = pressure_centres(contacts, found)
    vectors = np.einsum("nk,nkx->nx", found[:, :3], contacts.axes)
    centre = np.array([block.centroid for block in scene.blocks])
    is_above = (centre[contacts.b] - centre[contacts.a]) @ upright(scene) >= -1e-9 * free_size(
        scene
    )
    vectors *= np.where(is_above, 1.0, -1.0)[:, None]  # as they are, they act on block b
    size = np.linalg.norm(vectors, axis=1)
    largest = float(size.max(initial=0.0)) or 1.0
    shown = np.flatnonzero((size > FAINTEST * largest) & np.isfinite(place).all(axis=1))
    each = LONGEST * free_size(scene) / largest
    ends = np.stack([place[shown] - each * vectors[shown], place[shown]], axis=1)
    label = "force on the block above"
    drawing = _with_forces(
        solution, viewer, "loads and forces in the joints at collapse; forces above "
        f"{100 * FAINTEST:g} % of the largest",
        ends, size[shown] / largest,
        Lines(ends, 0.6 + 1.4 * size[shown] / largest, Style.force, label, heads=True, each=each),
    )  # fmt: skip
    factor = 1.0 if solution.load_factor is None else solution.load_factor
    return replace(drawing, notes=loads_to_scale(scene, factor))


@picture
def thrust(solution: Solution, *, viewer: Viewer = None) -> Drawing:
    """Thrust lines: how compression flows from joint to joint through the pressure centres.

    Where a block has two loaded joints the line joins their pressure centres, as in an arch; where
    it has more, lines meet in the mean of them, weighted by force. Lines are as wide and dark as
    the force; what carries less than 2 % of the largest is left out, in space less than 10 %. There
    blocks are glass, and lines behind fainter. Parameters and errors as for :func:`forces`.
    """
    scene = solution.scene
    found = forces_of(scene, solution)
    ends, size, _ = thrust_lines(scene, found)
    largest = float(size.max(initial=0.0)) or 1.0
    share = size / largest
    _, place = pressure_centres(scene.contacts, found)
    drawing = _with_forces(
        solution, viewer, f"thrust lines at collapse above {100 * _faintest(scene):g} % of the "
        f"largest, {largest:.3g} {scene.units.force}", ends, share,
        Lines(ends, 0.4 + 3.6 * share, Style.thrust, "thrust"),
    )  # fmt: skip
    loaded = found[:, 2] > FAINTEST * float(found[:, 2].max(initial=0.0))
    return drawing if drawing.glass else replace(drawing, dots=place[loaded])


def _with_forces(
    solution: Solution, viewer: Viewer, caption: str, ends: FloatArray, share: FloatArray,
    lines: Lines,
) -> Drawing:  # fmt: skip
    """Lines over the blocks, the darker the larger the force; in space fainter behind, on glass."""
    scene = solution.scene
    is_flat = _is_planar(scene)
    front: Viewer = tuple((-thin_axis(scene)).tolist()) if is_flat else None
    opacity = np.minimum(0.4 + share, 1.0)
    drawing = at_rest(solution, viewer or front, caption, notes=annotated(scene), glass=not is_flat)
    if not is_flat and len(ends):
        depth = ends.mean(axis=1) @ drawing.camera.axes[2]
        opacity = opacity * (FAR + (1.0 - FAR) * (depth - depth.min()) / (np.ptp(depth) or 1.0))
    return replace(drawing, lines=replace(lines, opacity=opacity))


def thrust_lines(scene: Scene, found: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Thrust lines that are drawn: ends (k, 2, 3), the compressions (k,) they carry, and the blocks
    (k,) they run through. ``found`` are the forces (n, 6) of the contacts, the third of which is
    the compression."""
    contacts = scene.contacts
    _, place = pressure_centres(contacts, found)
    normal = found[:, 2]
    loaded = np.flatnonzero(
        (normal > FAINTEST * float(normal.max(initial=0.0))) & np.isfinite(place).all(axis=1)
    )
    ends: list[FloatArray] = []
    size: list[float] = []
    inside: list[int] = []
    for block in scene.free.tolist():
        own = loaded[(contacts.a[loaded] == block) | (contacts.b[loaded] == block)]
        if len(own) == 2:
            ends.append(place[own])
            size.append(float(normal[own].mean()))
        elif len(own):
            hub = normal[own] @ place[own] / normal[own].sum()
            ends += [np.stack([place[j], hub]) for j in own.tolist()]
            size += normal[own].tolist()
        inside += [block] * (len(ends) - len(inside))
    carried = np.array(size)
    drawn = carried > _faintest(scene) * carried.max(initial=0.0)
    return (
        np.array(ends).reshape(-1, 2, 3)[drawn],
        carried[drawn],
        np.array(inside, dtype=np.int64)[drawn],
    )


def _faintest(scene: Scene) -> float:
    """Share of the largest compression below which a thrust line is not drawn."""
    return FAINTEST if _is_planar(scene) else THREADS


def _is_planar(scene: Scene) -> bool:
    """True if joints lie across one plane, within which the live load acts: such a structure is
    seen straight from the front."""
    thin = thin_axis(scene)
    across = np.abs(scene.contacts.axes[:, 2] @ thin).max(initial=0.0)
    push = np.abs(scene.live_forces[:, :3] @ thin).max(initial=0.0)
    return bool(across < ACROSS and push <= 1e-9 * np.abs(scene.live_forces).max(initial=0.0))
