"""An interactive page in one file: drawn on a canvas by its own script, no network, no WebGL."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Sequence
from functools import reduce
from importlib.resources import files
from typing import Any

import numpy as np

import cvxlimit.plotting.look as look
from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.plotting.annotations import Marking, refused
from cvxlimit.plotting.camera import default_camera, thin_axis, upright
from cvxlimit.plotting.contents import Drawing, scene_drawing
from cvxlimit.plotting.look import Saved
from cvxlimit.plotting.picture import drawn_mesh, shown_bounds
from cvxlimit.plotting.pictures.forces import thrust_lines
from cvxlimit.plotting.pictures.mechanism import mechanism_of
from cvxlimit.plotting.pictures.utilisation import used_shares
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import Motion, displaced, free_size
from cvxlimit.results.utilisation import contact_forces, least_used_state
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import rounded_down, rounded_up
from cvxlimit.solution.said import DIGITS, said

_MOST_SOLVED = 400
"""Contacts up to which a page shows the state that uses joints least; finding it takes a second."""


class Page(str, Saved):
    """A complete HTML page; notebooks show it in a frame of its own."""

    suffixes = (".html",)

    def _repr_html_(self) -> str:
        return (
            '<iframe style="width:100%;height:620px;border:1px solid #ddd" '
            'sandbox="allow-scripts allow-downloads" '
            f'srcdoc="{html.escape(self)}"></iframe>'
        )

    def file(self, kind: str) -> bytes:
        """The page in UTF-8."""
        return self.encode("utf-8")


def page(scene: Scene, solution: Solution) -> Page:
    """The mechanism as a self-contained interactive page.

    Orbit, zoom, scale the movement, animate it; look inside at contacts, their forces, thrust
    lines and strength in use; point at something to read its numbers. The view turns by the
    keyboard too, and is saved as a picture. Texts from the scene are data to the page, never
    markup.
    """
    drawing = mechanism_of(scene, solution)
    forces, what = contact_forces(scene, solution), drawing.moving.contacts
    advice, more = _said(solution)
    data = _page_data(drawing) | {"advice": advice, "more": more, "speedText": look.SPEED_TEXT}
    data["contacts"] |= {
        "opening": _short(what.widest),
        "slip": _short(what.slip),
        "twist": _short(what.twist),
        "forces": None if forces is None else _short(forces),
    }
    if forces is not None:
        data |= _strength_data(scene, solution, forces)
    return framed("viewer.html", data)


def _said(solution: Solution) -> tuple[str, str]:
    """What the number is worth, in one short sentence, and the note, which says why."""
    note = solution.note
    if not solution.status.has_answer:  # what to do is in the note
        return sentences(solution.standing, note), ""
    told = said(solution)
    first = told.headline
    if solution.status is Status.CERTIFIED:
        lower = rounded_down(solution.lower, look.DIGITS)
        upper = rounded_up(solution.upper, look.DIGITS)
        slides = dict(told.rows).get("sliding")
        how = f"{'proved' if solution.is_proved else 'recomputed'} outside the solver"
        first = f"{solution.standing}: between {lower} and {upper}, {how}"
        if slides:
            first = f"{solution.standing}: between {lower} and {upper}; {slides}"
        if solution.is_proved:
            note = note.removeprefix("both bounds are proved, up to rounding").removeprefix("; ")
    return sentences(first), sentences(note)


def sentences(*texts: str) -> str:
    return " ".join(f"{each[0].upper()}{each[1:]}." for each in texts if each)


def _strength_data(scene: Scene, solution: Solution, forces: FloatArray) -> dict[str, Any]:
    """Thrust lines, and strength in use as :func:`cvxlimit.plotting.utilisation` shows it."""
    shown, state = solution, "in the state of forces that was found"
    try:
        if len(forces) <= _MOST_SOLVED:
            shown, state = least_used_state(solution, scene)
        used = used_shares(shown, scene)
    except InputError:  # of a surface of one's own only the name is left
        state, used = "", np.full(len(scene.contacts), np.nan)
    ends, size, block = thrust_lines(scene, forces)
    return {
        "useStops": Style.use,
        "useText": f"{look.USE_TEXT} {state}",
        "used": [None if np.isnan(u) else round(min(u, 1.0), 4) for u in used.tolist()],
        "thrust": {
            "ends": _coordinates(scene, ends.reshape(-1, 3)),
            "share": _short(size / size.max(initial=0.0)),
            "block": block.tolist(),
        },
    }


def scene_page(scene: Scene, refusal: InputError | None = None) -> Page:
    """A scene that is not solved as a self-contained interactive page.

    Blocks, supports, joints by how they lie, loads and near misses; what is under the pointer is
    named. Of a refused scene the blocks to blame are red and the places ringed.
    """
    drawing = scene_drawing(scene, None, refusal or refused(scene))
    reason = drawing.notes.refusal
    counts = "" if reason else f"{len(scene.contacts.faces)} contacts, "
    weight = f"weight {scene.total_weight:.6g} {scene.units.force}, friction {scene.friction:g}"
    advice = f"refused: {reason}" if reason else counts + weight
    return framed("viewer.html", _page_data(drawing) | {"advice": advice})


def path_page(scene: Scene, motions: Sequence[Motion], told: dict[str, Any]) -> Page:
    """The configurations of a path, one at each stop of a slider, beside the curve of its load
    factor; ``told`` are title, advice, and the ``path`` with its texts."""
    farthest = max(motions, key=lambda moving: moving.largest)
    data = _page_data(Drawing(scene, farthest, default_camera(scene, farthest)))
    mesh = drawn_mesh(scene)
    points = [displaced(scene, moving, mesh.points, mesh.point_block) for moving in motions]
    reach = np.concatenate([shown_bounds(scene), *points])
    data["bounds"] = _coordinates(scene, np.stack([reach.min(axis=0), reach.max(axis=0)]))
    ways = [_short(moving.rates) for moving in motions]
    data |= told | {"path": told["path"] | {"ways": ways}, "speedText": look.WAY_TEXT}
    return framed("viewer.html", data)


def asset(name: str, home: str = "cvxlimit.plotting") -> str:
    """A part of pages, as it lies beside the modules of a folder."""
    return files(home).joinpath(name).read_text(encoding="utf-8")


def framed(name: str, data: dict[str, Any], home: str = "cvxlimit.plotting") -> Page:
    """A page of the frame that all share, and of what ``name`` in the folder ``home`` has:
    controls, and a script that finds ``data`` by its name."""
    frame, ticks, part = asset("frame.html"), asset("ticks.js"), asset(name, home)
    controls, script = part.split("<script>\n")
    parts = {
        "<!--ASIDE-->\n": controls,
        "/*TICKS*/\n": ticks,
        "/*SCRIPT*/\n": script.removesuffix("</script>\n"),
    }
    whole = reduce(lambda text, place: text.replace(place, parts[place]), parts, frame)
    before, after = whole.split("/*DATA*/")
    return Page(before + _as_script_data(data) + after)


def _as_script_data(data: dict[str, Any]) -> str:
    """JSON that cannot end the script element it stands in, whatever the texts are."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _page_data(drawing: Drawing) -> dict[str, Any]:
    """What the page shows of a drawing."""
    scene, moving = drawing.scene, drawing.moving
    marking, notes = drawing.marking, drawing.notes
    return {
        "title": drawing.heading,
        "units": {"length": scene.units.length, "force": scene.units.force},
        "bounds": _coordinates(scene, shown_bounds(scene)),
        "size": free_size(scene),
        "up": upright(scene).tolist(),
        "viewer": drawing.camera.axes[2].tolist(),
        "front": thin_axis(scene).tolist(),
        "used": None,
        "thrust": None,
        "scale": moving.scale,
        "moves": moving.moves,
        "largest": moving.largest,
        "stops": Style.speed,
        "stone": Style.stone,
        "stoneText": drawing.blocks,
        "refused": bool(notes.refusal),
        "mesh": _mesh_data(scene),
        "blocks": _block_data(scene, moving, notes.culprits),
        "contacts": _contact_data(scene, marking),
        "kinds": []
        if marking is None
        else [
            {"text": marking.texts[kind], "colour": colour, "code": int(kind)}
            for kind, colour in marking.colours.items()
        ],
    } | _notes_data(drawing)


def _notes_data(drawing: Drawing) -> dict[str, Any]:
    """Crushed zones, ties, arrows of loads, and places to look at."""
    scene, notes = drawing.scene, drawing.notes
    return {
        "shapes": [
            {
                "points": _coordinates(scene, shape.points),
                "moves": _coordinates(scene, shape.moves),
                "colour": shape.colour,
                "text": shape.text,
                "zone": shape.is_zone,
            }
            for shape in drawing.shapes
        ],
        "arrows": [
            {
                "ends": _coordinates(scene, np.array([arrow.tail, arrow.tip])),
                "case": arrow.case,
                "text": arrow.text,
                "total": arrow.total,
                "colour": look.CASE_COLOURS[arrow.case],
            }
            for arrow in notes.arrows
        ],
        "marks": [
            {"at": _coordinates(scene, np.array([mark.at])), "text": mark.text}
            for mark in notes.marks
        ],
        "markColour": Style.mark,
        "markText": "where it is wrong" if notes.refusal else "near miss",
    }


def _mesh_data(scene: Scene) -> dict[str, Any]:
    mesh = drawn_mesh(scene)
    return {
        "points": _coordinates(scene, mesh.points),
        "pointBlock": mesh.point_block.tolist(),
        "corners": np.concatenate(mesh.faces).tolist(),
        "faceStart": np.cumsum([0, *map(len, mesh.faces)]).tolist(),
        "faceBlock": mesh.face_block.tolist(),
        "patch": mesh.patch.tolist(),
    }


def _block_data(scene: Scene, moving: Motion, culprits: frozenset[str]) -> dict[str, Any]:
    return {
        "id": [b.id for b in scene.blocks],
        "support": [b.id in set(scene.supports) for b in scene.blocks],
        "centroid": _coordinates(scene, np.array([b.centroid for b in scene.blocks])),
        "rates": _short(moving.rates),
        "speed": _short(moving.speed),
        "volume": _short(np.array([b.volume for b in scene.blocks])),
        "weight": _short(np.array([b.weight for b in scene.blocks])),
        "colour": [round(255 * c) for c in look.block_colours(scene, moving, culprits).flat],
    }


def _contact_data(scene: Scene, marking: Marking | None) -> dict[str, Any]:
    if marking is None:
        empty: dict[str, Any] = {name: [] for name in ("name", "a", "b", "kind", "points")}
        return empty | {"start": [0], "forces": None}
    c = marking.contacts
    return {
        "name": c.names,
        "a": c.a.tolist(),
        "b": c.b.tolist(),
        "kind": marking.kind.tolist(),
        "width": None if marking.width is None else _short(marking.width),
        "start": c.corner_start.tolist(),
        "points": _coordinates(scene, c.corner_points),
        "origin": _coordinates(scene, c.origin),
        "pieces": {
            j: [_coordinates(scene, piece) for piece in c.piece_points(j)] for j in sorted(c.pieces)
        },
        "axes": [round(x, 6) for x in c.axes.ravel().tolist()],
        "area": _short(c.area),
        "friction": _short(c.friction),
        "components": COMPONENTS,
        "forces": None,
    }


def _short(values: FloatArray) -> list[float]:
    return [float(f"{v:.{DIGITS}g}") for v in values.ravel().tolist()]


def _coordinates(scene: Scene, points: FloatArray) -> list[float]:
    """All coordinates in a row, rounded relative to the size of what is drawn."""
    decimals = DIGITS - math.ceil(math.log10(free_size(scene)))
    return [float(v) for v in np.round(points, decimals).ravel()]
