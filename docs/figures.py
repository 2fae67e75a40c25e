"""Figures of these pages: ``.venv/bin/python docs/figures.py docs/figures`` draws them anew.

The gallery is what :mod:`cvxlimit.plotting` makes of a solution. The figures of the conventions are
drawn here, but what they show is computed by the package: the frame is that of a detected contact,
the effective area that of the forces, and the moments are those of a force at the pressure centre.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Polygon
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D
from mpl_toolkits.mplot3d.proj3d import proj_transform

from cvxlimit import (
    Block,
    Load,
    Scene,
    Vehicle,
    builtin_scene,
    code_check,
    envelope,
    passive,
    pushover,
    solve,
)
from cvxlimit.geometry.polygons import effective_regions, torsion_arm
from cvxlimit.io import import_geometry
from cvxlimit.masonry import Arch, bridge
from cvxlimit.plotting import PICTURES

INK, BLUE, ORANGE, GREEN, GREY = "#222222", "#0072b2", "#d55e00", "#009e73", "#8a8a8a"
"""Wong's colours, told apart by colour-blind readers too."""

PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6}
"""Behind words that lie on lines."""

STYLE = {"font.size": 11.0, "mathtext.fontset": "cm", "text.color": INK, "savefig.dpi": 110}


def main() -> None:
    """Draw all figures into the folder given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        for name, draw in FIGURES.items():
            figure = draw()
            figure.savefig(folder / f"{name}.png", bbox_inches="tight", pad_inches=0.05)
            plt.close(figure)
    gallery(folder)


def two_blocks() -> Scene:
    """A block on another, moved sideways, so that the contact is smaller than either."""
    ground = Block.box("a", (-0.35, -0.2, -0.45), (1.0, 0.8, 0.0))
    block = Block.box("b", (0.0, 0.0, 0.0), (1.25, 0.8, 0.5), density=20.0)
    return Scene([ground, block], ["a"], Load(acceleration=(1, 0, 0)))


# --- axes of a contact --------------------------------------------------------------------------


def contact_frame() -> plt.Figure:
    """Axes, forces and moments of a contact, on blocks drawn apart."""
    scene = two_blocks()
    contact = scene.contacts[0]
    figure, axes = space((6.4, 4.9), (0.5, 0.3, 0.3), 0.95)
    apart = np.array([0.0, 0.0, 0.55])
    draw_block(axes, scene.blocks[0], np.zeros(3))
    draw_block(axes, scene.blocks[1], apart)
    for shift, alpha in ((np.zeros(3), 0.75), (apart, 0.35)):
        axes.add_collection3d(
            Poly3DCollection([contact.corners + shift], facecolor=ORANGE, alpha=alpha, zorder=5)
        )
    label(axes, (-0.1, -0.2, -0.38), "block $a$", INK)
    label(axes, (1.05, 0.0, 0.97), "block $b$", INK)
    middle = contact.origin
    for axis, force, moment, length in zip(
        (contact.t1, contact.t2, contact.normal),
        ("V_1", "V_2", "N"),
        ("M_1", "M_2", "M_T"),
        (0.75, 0.72, 0.42),
        strict=True,
    ):
        arrow(axes, middle, middle + length * axis, BLUE)
        name = {"V_1": "t_1", "V_2": "t_2", "N": "n"}[force]
        label(axes, middle + (length + 0.2) * axis, f"${name}:\\ {force}, {moment}$", BLUE)
        turn(axes, middle + 0.62 * length * axis, axis, GREEN)
    return figure


def block_frame() -> plt.Figure:
    """Rates of a block at its centroid, in the scene's axes."""
    figure, axes = space((4.6, 3.8), (0.6, 0.35, 0.4), 0.75)
    block = Block.box("b", (0.0, 0.0, 0.0), (0.9, 0.6, 0.5), density=20.0)
    draw_block(axes, block, np.zeros(3))
    at = block.centroid
    axes.scatter(*at[:, None], s=18, color=INK, zorder=10)
    for axis, rate, spin, length in zip(
        np.eye(3), ("u_x", "u_y", "u_z"), ("r_x", "r_y", "r_z"), (0.75, 0.7, 0.6), strict=True
    ):
        arrow(axes, at, at + length * axis, BLUE)
        turn(axes, at + 0.78 * length * axis, axis, GREEN)
        label(axes, at + (length + 0.14) * axis, f"${rate}, {spin}$", BLUE)
    return figure


def space(
    size: tuple[float, float], middle: tuple[float, ...], reach: float
) -> tuple[plt.Figure, Axes3D]:
    """An empty space without axes, seen from the front right."""
    figure = plt.figure(figsize=size)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", proj_type="ortho")
    axes.set_axis_off()
    axes.view_init(elev=22.0, azim=-58.0)
    for limits, centre in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), middle, strict=True):
        limits(centre - reach, centre + reach)
    axes.set_box_aspect((1, 1, 1), zoom=1.5)
    return figure, axes


def draw_block(axes: Axes3D, block: Block, shift: np.ndarray) -> None:
    """Faces of a block as glass."""
    faces = [block.vertices[list(face)] + shift for face in block.faces]
    axes.add_collection3d(
        Poly3DCollection(faces, facecolor="#dcdcdc", edgecolor=GREY, linewidth=0.8, alpha=0.25)
    )


class Arrow3D(FancyArrowPatch):
    """An arrow between two points of space."""

    def __init__(self, start: np.ndarray, end: np.ndarray, **style: object) -> None:
        super().__init__((0, 0), (0, 0), **style)  # type: ignore[arg-type]
        self.ends = np.stack([start, end], axis=1)

    def do_3d_projection(self, renderer: object = None) -> float:
        """Where it is on the paper; called by Matplotlib."""
        x, y, z = proj_transform(*self.ends, self.axes.M)
        self.set_positions((x[0], y[0]), (x[1], y[1]))
        return float(min(z)) - 1.0


def arrow(axes: Axes3D, start: np.ndarray, end: np.ndarray, colour: str) -> None:
    """A straight arrow."""
    axes.add_artist(
        Arrow3D(start, end, arrowstyle="-|>", mutation_scale=13, lw=1.8, color=colour,
                shrinkA=0, shrinkB=0, zorder=9)
    )  # fmt: skip


def turn(
    axes: Axes3D, middle: np.ndarray, axis: np.ndarray, colour: str, radius: float = 0.1
) -> None:
    """An arc with an arrow, right-handed about an axis."""
    first = np.cross(axis, [0.3, 0.5, 0.8])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    angle = np.linspace(0.0, np.radians(290.0), 60)[:, None]
    points = middle + radius * (np.cos(angle) * first + np.sin(angle) * second)
    axes.plot(*points[:-4].T, color=colour, lw=1.6, zorder=9)
    arrow(axes, points[-6], points[-1], colour)


def label(axes: Axes3D, at: object, text: str, colour: str) -> None:
    """Words at a point of space."""
    axes.text(*np.asarray(at), text, color=colour, ha="center", va="center", zorder=12, bbox=PAPER)


# --- pressure centre and effective area ---------------------------------------------------------


def pressure_centre() -> plt.Figure:
    """A rectangle and a polygon from above: pressure centre, moments, effective region."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.6, 3.9), width_ratios=(1.15, 1.0))
    l1, l2, e1, e2 = 1.0, 0.6, 0.26, 0.11
    corners = np.array([[-l1, -l2], [l1, -l2], [l1, l2], [-l1, l2]]) / 2.0
    plan(left, corners, (e1, e2))
    side1, side2 = l1 - 2 * e1, l2 - 2 * e2
    dimension(left, (-l1 / 2, -l2 / 2 - 0.09), (l1 / 2, -l2 / 2 - 0.09), "$l_1$")
    dimension(left, (-l1 / 2 - 0.09, -l2 / 2), (-l1 / 2 - 0.09, l2 / 2), "$l_2$")
    dimension(left, (e1 - side1 / 2, -0.12), (e1 + side1 / 2, -0.12), "$l_{1e}$")
    dimension(left, (l1 / 2 + 0.07, e2 - side2 / 2), (l1 / 2 + 0.07, e2 + side2 / 2), "$l_{2e}$")
    share = torsion_arm(side1, side2) / torsion_arm(l1, l2)
    left.set_title(f"Rectangle: $c = {share:.2f}\\,c_T$", fontsize=11)
    polygon = np.array([[-0.55, -0.3], [0.35, -0.34], [0.6, 0.05], [0.1, 0.42], [-0.45, 0.22]])
    plan(right, polygon, (0.2, 0.08))
    right.set_title("Any convex polygon $P$: $P \\cap (2e - P)$", fontsize=11)
    return figure


def plan(axes: Axes, corners: np.ndarray, centre: tuple[float, float]) -> None:
    """The contact, the region the pressure spreads over, and what N gives about the axes."""
    region = effective_regions(corners, [centre])[0]
    axes.add_patch(Polygon(corners, facecolor="#eeeeee", edgecolor=GREY, lw=1.2))
    axes.add_patch(Polygon(region, facecolor=ORANGE, alpha=0.35, edgecolor=ORANGE, lw=1.2))
    for end, name in (((0.82, 0.0), "$t_1$"), ((0.0, 0.56), "$t_2$")):
        axes.annotate("", end, (0, 0), arrowprops={"arrowstyle": "-|>", "color": BLUE, "lw": 1.6})
        axes.text(end[0] + 0.03, end[1] + 0.02, name, color=BLUE)
    e1, e2 = centre
    axes.plot([e1, e1, 0.0], [0.0, e2, e2], ":", color=INK, lw=1.0)
    axes.plot(e1, e2, "o", color=INK, ms=6, zorder=5)
    axes.text(e1 + 0.03, e2 + 0.03, "$N$", color=INK)
    axes.text(e1, -0.055, "$e_1$", color=INK, ha="center")
    axes.text(-0.055, e2, "$e_2$", color=INK, va="center", ha="right")
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(-0.68, 0.95)
    axes.set_ylim(-0.5, 0.66)


def dimension(axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str) -> None:
    """A measured length with its name."""
    style = {"arrowstyle": "<|-|>", "color": GREY, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=style)
    middle = (start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0
    paper = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    axes.text(*middle, text, ha="center", va="center", color=INK, bbox=paper)


# --- readings of Eq. 30 ---------------------------------------------------------------------------


def readings() -> plt.Figure:
    """What a square contact admits under each reading, its pressure centre a quarter side off."""
    figure, axes = plt.subplots(figsize=(6.2, 4.4), layout="constrained")
    side, friction, e1 = 1.0, 0.7, 0.25
    whole, arm = torsion_arm(side, side), torsion_arm(side - 2 * e1, side)
    shear, torsion = np.meshgrid(np.linspace(-1.1, 1.1, 801), np.linspace(-1.1, 1.1, 801))
    # Over mu N and c_T mu N, with V along t2 alone: e1 V2 is then e1 / c_T times the shear.
    lever, room = e1 / whole * shear, arm / whole * (1.0 - np.abs(shear))
    sets = {
        "signed moments": (np.abs(torsion - lever) - room, ORANGE, 0.3),
        "independent signs": (np.abs(torsion) + np.abs(lever) - room, GREEN, 0.6),
    }
    for excess, colour, alpha in sets.values():
        axes.contourf(shear, torsion, excess, [-9.0, 0.0], colors=[colour], alpha=alpha)
        axes.contour(shear, torsion, excess, [0.0], colors=[colour], linewidths=1.5)
    paper = np.maximum(np.abs(torsion + np.abs(e1) / whole * shear) - room,
                       np.abs(torsion) - arm / whole)  # fmt: skip
    axes.contour(shear, torsion, paper, [0.0], colors=[INK], linewidths=1.3, linestyles="--")
    axes.plot([-1, 0, 1, 0, -1], [0, 1, 0, -1, 0], color=BLUE, lw=2.0)
    for at, text, colour in (
        ((-0.62, 0.9), "no interaction (Eq. 24)", BLUE),
        ((0.72, 0.86), "signed moments", ORANGE),
        ((0.0, 0.0), "independent\nsigns", INK),
        ((0.72, -0.86), "the paper's signs", INK),
    ):
        axes.text(*at, text, color=colour, ha="center", va="center")
    axes.set_xlabel(f"shear along $t_2$, $V_2 / \\mu N$  ($\\mu = {friction}$)")
    axes.set_ylabel("torsion, $M_T / (c_T\\,\\mu N)$")
    axes.set_xlim(-1.15, 1.15)
    axes.set_ylim(-1.05, 1.05)
    return figure


# --- gallery ------------------------------------------------------------------------------------

FRAMES = {"forces": "arch-on-piers", "thrust": "arch-on-piers"}
"""Built-in scenes of pictures that are not of the front."""


def gallery(folder: Path) -> None:
    """One picture of each kind."""
    for kind in PICTURES.keys() - {"animation", "page"}:
        solution = solve(builtin_scene(FRAMES.get(kind, "facade")))
        figure = solution.plot(kind, figsize=(3.4, 3.0), title="")
        figure.savefig(folder / f"{kind}.png", dpi=220)
    wall = solve(builtin_scene("tuff-wall"))
    for name, kind, options in (
        ("column-mechanism", "mechanism", {}),
        ("column-half", "utilisation", {"load_factor": 0.5 * wall.load_factor}),
    ):
        figure = wall.plot(kind, figsize=(3.4, 3.2), **options)
        figure.savefig(folder / f"{name}.png", dpi=220)


# --- after the collapse factor ------------------------------------------------------------------


def path() -> plt.Figure:
    """The arch, whose hinges move to other joints on the way."""
    return pushover(builtin_scene("arch")).plot()


def capacity() -> plt.Figure:
    """What the code check reads from the path of five blocks."""
    return code_check(pushover(builtin_scene("stack"))).plot()


def from_rest() -> plt.Figure:
    """A wall whose joints slide from rest on, to an end below its proved limit."""
    return solve(builtin_scene("ferris-tin-loi-2"), method="incremental").plot("curve")


# --- scenes of other programs --------------------------------------------------------------------


def from_blender() -> plt.Figure:
    """Seven boxes as Blender 5.0 has exported them, with Y forward and Z up."""
    found = import_geometry(
        Path(__file__).parent / "figures" / "blender.obj",
        length_unit="m", up="z", friction=0.7, live=(0, 1, 0), density=20, supports="lowest",
        name="wall from Blender",
    )  # fmt: skip
    return found.scene.plot(figsize=(4.6, 3.4))


def from_rhino() -> plt.Figure:
    """An arch on piers in a file of the form that the page has: an object a stone, z up, mm."""
    lines, count = [], 1
    for block in builtin_scene("arch-on-piers").blocks:
        lines.append(f"o {block.id}")
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in 1000.0 * block.vertices]
        lines += ["f " + " ".join(str(count + i) for i in face) for face in block.faces]
        count += len(block.vertices)
    with TemporaryDirectory() as folder:
        file = Path(folder, "arch.obj")
        file.write_text("\n".join(lines), "utf-8")
        found = import_geometry(
            file, length_unit="mm", to_unit="m", up="z", friction=0.7, live=(1, 0, 0), density=20,
            supports="lowest", name="arch in the form of Rhino's files",
        )  # fmt: skip
    return found.scene.plot(figsize=(4.6, 3.4))


def from_compas() -> plt.Figure:
    """The template's arch of compas_dem (extra ``compas``)."""
    from compas_dem.models import BlockModel
    from compas_dem.templates import ArchTemplate

    model = BlockModel("arch of compas_dem")
    for mesh in ArchTemplate(rise=0.925, span=1.85, thickness=0.15, depth=0.3, n=22).blocks():
        model.add_block_from_mesh(mesh)
    model.add_supports([0, 21])
    return Scene.from_compas(model, friction=0.7, density=20).plot(figsize=(4.6, 3.4))


def from_drawing() -> plt.Figure:
    """An elevation of closed polylines with a thickness, in millimetres, y up."""
    import ezdxf

    drawing = ezdxf.new("R2010")
    places = [(-500, -300, 3000, 300, "GROUND")]
    for k in range(3):
        cuts = [0, 1000, 2000] if k % 2 else [0, 500, 1500, 2000]
        places += [(a, 400 * k, b - a, 400, "STONES") for a, b in pairwise(cuts)]
    for x, y, w, h, layer in places:
        depth = {"layer": layer, "thickness": 250}
        corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
        drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs=depth)
    with TemporaryDirectory() as folder:
        file = Path(folder, "elevation.dxf")
        drawing.saveas(file)
        found = import_geometry(
            file, length_unit="mm", to_unit="m", up="y", friction=0.6, live=(0, 0, 1), density=20,
            supports=["GROUND"], name="wall from an elevation",
        )  # fmt: skip
    return found.scene.plot(figsize=(4.6, 3.4))


def envelope_of_a_lorry() -> plt.Figure:
    """The bridge of its page, and the lorry there."""
    arch, level = Arch(6.55, 1.428), 1.428 + 0.22 + 0.165
    scene = bridge(arch, thickness=0.22, width=3.8, cover=0.165, density=17.66, friction=0.6)
    held = replace(scene, reactions=passive(scene, level, 20.0, 1.5))
    lorry = Vehicle([(0.0, 60.0), (3.2, 115.0), (4.5, 115.0)])
    return envelope(held, lorry, np.linspace(-1.0, 12.0, 53), level).plot()


FIGURES = {
    "from-blender": from_blender,
    "from-drawing": from_drawing,
    "from-rhino": from_rhino,
    "from-compas": from_compas,
    "contact-frame": contact_frame,
    "block-frame": block_frame,
    "pressure-centre": pressure_centre,
    "readings": readings,
    "path": path,
    "from-rest": from_rest,
    "capacity": capacity,
    "envelope": envelope_of_a_lorry,
}

if __name__ == "__main__":
    main()
