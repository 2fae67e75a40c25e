"""An interactive page in one file: drawn on a canvas by its own script, no network, no WebGL."""

from __future__ import annotations

import html
import json
import math
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.plotting.camera import default_camera, upright
from cvxlimit.plotting.look import (
    KIND_COLOURS,
    KIND_TEXTS,
    SPEED_STOPS,
    SPEED_TEXT,
    STONE_COLOUR,
    block_colours,
    title,
)  # fmt: skip
from cvxlimit.plotting.mesh import Mesh, drawn_mesh
from cvxlimit.plotting.movement import Motion, contact_forces, free_bounds, free_size, motion
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

FloatArray = NDArray[np.float64]

DIGITS = 7
"""Significant digits of numbers in the page; coordinates have as many relative to the structure's
size, however far away the origin is: finer than a pixel at any useful zoom."""

PLACE = "/*DATA*/"
"""Where the template takes the data."""


class Page(str):
    """A complete HTML page; notebooks show it in a frame of its own."""

    def _repr_html_(self) -> str:
        return (
            '<iframe style="width:100%;height:620px;border:1px solid #ddd" sandbox="allow-scripts" '
            f'srcdoc="{html.escape(self)}"></iframe>'
        )


def page(scene: Scene, solution: Solution) -> Page:
    """The mechanism as a self-contained interactive page.

    Orbit, zoom, scale the movement, animate it; hover to read the rates of a block or the
    forces and rates of a contact. Texts from the scene are data to the page, never markup.
    """
    template = files("cvxlimit.plotting").joinpath("viewer.html").read_text(encoding="utf-8")
    before, after = template.split(PLACE)
    return Page(before + _as_script_data(_page_data(scene, solution)) + after)


def _as_script_data(data: dict[str, Any]) -> str:
    """JSON that cannot end the script element it stands in, whatever the texts are."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _page_data(scene: Scene, solution: Solution) -> dict[str, Any]:
    moving = motion(scene, solution)
    mesh = drawn_mesh(scene)
    return {
        "title": title(solution),
        "advice": "; ".join(filter(None, (_advice(solution), solution.note))),
        "units": {"length": scene.units.length, "force": scene.units.force},
        "bounds": _coordinates(scene, free_bounds(scene)),
        "size": free_size(scene),
        "up": upright(scene).tolist(),
        "viewer": default_camera(scene, moving).axes[2].tolist(),
        "scale": moving.scale,
        "moves": moving.moves,
        "largest": moving.largest,
        "stops": SPEED_STOPS,
        "stone": STONE_COLOUR,
        "speedText": SPEED_TEXT,
        "mesh": _mesh_data(scene, mesh),
        "blocks": _block_data(scene, moving),
        "contacts": _contact_data(scene, solution, moving),
        "kinds": [
            {"text": KIND_TEXTS[kind], "colour": KIND_COLOURS[kind], "code": int(kind)}
            for kind in KIND_COLOURS
        ],
    }


def _advice(solution: Solution) -> str:
    return f"{solution.status}: {solution.status.advice}"


def _mesh_data(scene: Scene, mesh: Mesh) -> dict[str, Any]:
    return {
        "points": _coordinates(scene, mesh.points),
        "pointBlock": mesh.point_block.tolist(),
        "corners": mesh.corners.tolist(),
        "faceStart": mesh.face_start.tolist(),
        "faceBlock": mesh.face_block.tolist(),
    }


def _block_data(scene: Scene, moving: Motion) -> dict[str, Any]:
    return {
        "id": [b.id for b in scene.blocks],
        "support": [b.id in set(scene.supports) for b in scene.blocks],
        "centroid": _coordinates(scene, np.array([b.centroid for b in scene.blocks])),
        "rates": _short(moving.rates),
        "speed": _short(moving.speed),
        "colour": np.round(255 * block_colours(scene, moving)).astype(int).ravel().tolist(),
    }


def _contact_data(scene: Scene, solution: Solution, moving: Motion) -> dict[str, Any]:
    """Geometry and rates of all contacts, forces where the solution has them."""
    c, what = scene.contacts, moving.contacts
    forces = contact_forces(scene, solution)
    return {
        "name": c.names,
        "a": c.a.tolist(),
        "b": c.b.tolist(),
        "kind": what.kind.tolist(),
        "start": c.corner_start.tolist(),
        "points": _coordinates(scene, c.corner_points),
        "opening": _short(-c.corner_minimum(-what.opening)),
        "slip": _short(what.slip),
        "twist": _short(what.twist),
        "components": COMPONENTS,
        "forces": None if forces is None else _short(forces),
    }


def _short(values: FloatArray) -> list[float]:
    """All numbers in a row, with :data:`DIGITS` significant digits."""
    return [float(f"{v:.{DIGITS}g}") for v in values.ravel().tolist()]


def _coordinates(scene: Scene, points: FloatArray) -> list[float]:
    """All coordinates in a row, rounded relative to the size of what is drawn."""
    decimals = DIGITS - math.ceil(math.log10(free_size(scene)))
    return [float(v) for v in np.round(points, decimals).ravel()]
