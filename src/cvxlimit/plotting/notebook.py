"""What notebooks show of scenes and solutions: a small picture and the figures that matter."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from html import escape

from cvxlimit.errors import InputError, ModelError
from cvxlimit.plotting.annotations import refused
from cvxlimit.plotting.look import printable
from cvxlimit.plotting.registry import figures
from cvxlimit.results.movement import motion, still
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution
from cvxlimit.solution.said import said

_MOST_BLOCKS = 3000
"""Blocks beyond which no picture is drawn unasked: it would take more than two seconds."""

Rows = Iterator[tuple[str, str]]


def scene_html(scene: Scene) -> str:
    refusal = refused(scene)
    return card(printable(scene.name), _scene_rows(scene, refusal), _image(scene, refusal=refusal))


def solution_html(solution: Solution) -> str:
    image = _image(solution.solved_scene, solution)
    return card(printable(solution.scene_name), _solution_rows(solution), image)


def _scene_rows(scene: Scene, refusal: InputError | None) -> Rows:
    yield "free blocks", f"{len(scene.free)}, weight {scene.total_weight:.5g} {scene.units.force}"
    yield "supports", ", ".join(scene.supports[:4]) + (" \u2026" if len(scene.supports) > 4 else "")
    if refusal is not None:
        yield "refused", str(refusal)
        return
    yield "contacts", f"{len(scene.contacts)}, friction {scene.friction:g}"
    if scene.live.acceleration is not None:
        push = ", ".join(f"{a:g}" for a in scene.live.acceleration)
        yield "live load", f"weight times ({push})"
    yield from (("look at", remark) for remark in scene.told)


def _solution_rows(solution: Solution) -> Rows:
    told = said(solution)
    yield solution.quantity, told.value
    yield "", told.standing
    surface = solution.surface_name
    if solution.interaction != "none":
        surface += f", {solution.interaction} interaction, {solution.moments} moments"
    yield "surface", surface
    yield from told.rows
    if solution.lumped is not None and solution.lumped.is_worth_a_word:
        yield "geometry", solution.lumped.row
    yield "size", f"{solution.blocks} blocks, {solution.contacts} contacts"
    if "total" in solution.seconds:
        yield "time", f"{solution.seconds['total']:.2f} s"
    if not solution.status.is_good:
        yield "note", solution.note or solution.advice


def card(title: str, rows: Rows, image: bytes | None) -> str:
    """A table, and the picture on its left; texts from the scene are data, never markup."""
    cells = ""
    for name, value in rows:
        stressed = ("<b>", "</b>") if name == "load factor" else ("", "")
        shown = escape(printable(value)).join(stressed)
        cells += (
            f'<tr><td style="text-align:left;opacity:.7">{escape(name)}</td>'
            f'<td style="text-align:left">{shown}</td></tr>'
        )
    picture = ""
    if image is not None:
        data = base64.b64encode(image).decode("ascii")
        picture = (
            f'<img alt="{escape(title)}" style="max-width:340px;max-height:280px;background:#fff"'
            f' src="data:image/png;base64,{data}">'
        )
    return (
        '<div style="display:flex;gap:18px;align-items:center">'
        f"{picture}<div><b>{escape(title)}</b><table>{cells}</table></div></div>"
    )


def _image(
    scene: Scene | None, solution: Solution | None = None, refusal: InputError | None = None
) -> bytes | None:
    if scene is None or len(scene.blocks) > _MOST_BLOCKS:
        return None
    try:
        moving = still(scene) if solution is None else motion(scene, solution)
        image: bytes = figures().thumbnail(scene, moving, refusal)
    except (InputError, ModelError):  # a picture is not worth losing the figures
        return None
    return image
