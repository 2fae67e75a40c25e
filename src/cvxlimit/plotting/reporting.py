"""A solution as two pages to print and sign: the problem, its result, and what that is based on."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from html import escape
from io import BytesIO
from itertools import islice
from typing import Any

import numpy as np

from cvxlimit.base.versions import __version__
from cvxlimit.errors import ModelError
from cvxlimit.plotting.annotations import without_live_load
from cvxlimit.plotting.contents import scene_drawing
from cvxlimit.plotting.look import printable
from cvxlimit.plotting.pictures.mechanism import mechanism_of
from cvxlimit.plotting.pictures.webpage import Page, asset, sentences
from cvxlimit.plotting.registry import figures
from cvxlimit.plotting.stated import (
    HEAD,
    LONGEST_NAME,
    Rows,
    Stated,
    joints,
    loads,
    mechanism,
    names,
    structure,
    vector,
)
from cvxlimit.scene import Scene
from cvxlimit.solution import LOAD_FACTOR, FromRest, Solution, Status
from cvxlimit.solution.said import basis_of, ends, said

LONGEST, MOST_ROWS, MOST_BLOCKS = 600, 12, 20_000
"""Largest numbers of characters of a sentence and of rows of a text, so that any structure fits on
two sheets; blocks up to which pictures are drawn, in about ten seconds."""


def report(
    solution: Solution,
    digest: str,
    path: Any = None,
    check: Any = None,
    envelope: Any = None,
    sensitivity: Any = None,
    without_dilatancy: Solution | None = None,
    notes: Mapping[str, str] | None = None,
) -> Page:
    """Returns the page of :meth:`cvxlimit.Solution.report`; ``digest`` is the scene's."""
    scene, stated = solution.scene, Stated(notes or {})
    extras = {"Sensitivity": sensitivity, "Path": path, "Code check": check}
    extras["Positions of a vehicle"] = envelope
    falling = solution if without_dilatancy is None else without_dilatancy
    way = solution.from_rest
    sections = [
        ("", _head(stated)),
        ("Result", _table(_result(solution, without_dilatancy), "result")),
        ("", _pictures(scene, falling)),
        ("From rest", way and _from_rest(solution, way, has_room=path is None)),
        ("Structure", _table(structure(scene, stated))),
        ("Loads", _table(loads(scene, solution, stated))),
        ("Joints", _table(joints(scene, stated))),
        ("Assumptions", _list(_assumptions(scene, solution, without_dilatancy))),
        ("Mechanism", _table(mechanism(scene, falling))),
        *((name, _shown(value)) for name, value in extras.items() if value is not None),
        ("Stated besides", _table(stated.others())),
        ("How it was found", _table(_found(solution, digest))),
        ("", _SIGNATURE),
    ]
    body = "".join(f"<h2>{head}</h2>{text}" if head else text for head, text in sections if text)
    name = _text(scene.name)
    return Page(asset("report.html").replace("<!--TITLE-->", name).replace("<!--BODY-->", body))


def _head(stated: Stated) -> str:
    """Returns what the page is about and whose it is, in one line of HTML."""
    fields = "".join(f"<span>{name}: {_text(stated.source(name))}</span>" for name in HEAD)
    return f'<p class="head">{fields}</p>'


_SIGNATURE = """<p class="sign"><span>checked by</span><span>place and date</span>
<span>signature</span></p>"""


def _result(solution: Solution, without: Solution | None) -> Rows:
    """Yields the load factor, what it is and what it is not, its bounds, and what sliding means."""
    first = solution if without is None else without
    told = said(first)
    without_it = "" if first.flow == "associated" else " without dilatancy"
    yield f"{solution.quantity}{without_it}", told.value
    yield "in words", told.headline
    if without is not None:
        yield "with dilatancy", f"{said(solution).value}, an upper limit of the number above"
    unit, end = f" {solution.quantity_unit}".rstrip(), solution.lower_end
    whose = "bracket" if without is None else "its bracket"
    for name, bracket in ((whose, solution.bracket), ("lower end", end and end.bracket)):
        if bracket and bracket.has_both:
            low, high = ends(bracket)
            yield name, f"between {low} and {high}{unit}, relative width {bracket.width:.1e}"
    yield "status", first.standing
    if basis := basis_of(first):
        yield "rests on", basis
    dilatancy = first.dilatancy
    if dilatancy is not None and dilatancy.is_worth_a_word:
        yield "sliding", str(dilatancy)
    elif dilatancy is not None:
        yield "sliding", "none that counts in this mechanism"


def _pictures(scene: Scene, solution: Solution) -> str:
    """Returns the structure and its mechanism as images in HTML."""
    if len(scene.blocks) > MOST_BLOCKS:
        return ""
    try:
        pictures = figures()
        viewer = None  # both from one side, that of the mechanism
        drawings = []
        if solution.mechanism:
            drawings.append(("the mechanism", mechanism_of(scene, solution)))
            viewer = drawings[0][1].camera.axes[2]
        at_rest = scene_drawing(scene, viewer, None)
        if solution.quantity != LOAD_FACTOR:
            at_rest = replace(at_rest, notes=without_live_load(at_rest.notes))
        way = at_rest.camera.axes[2]
        seen = f"both seen from the direction {vector(np.round(way, 2))}"
        drawings.insert(0, (f"the structure and its loads, {seen}", at_rest))
        shown = ""
        for text, drawing in drawings:
            shown += _figure(pictures.drawn(drawing, figsize=(4.6, 3.6), title=""), text)
        return f'<div class="pictures">{shown}</div>'
    except ModelError as error:  # without Matplotlib the figures are still worth having
        return f"<p>{_text(f'no pictures: {error}')}</p>"


def _from_rest(solution: Solution, way: FromRest, has_room: bool) -> str:
    """Returns how a way from rest ended, its curve, where joints slide and open first (if two
    sheets have room for it), and the distribution of draws, as HTML."""
    curves = {"curve": "the curve"} if way.steps else {}
    if has_room and way.slipped is not None:
        curves["onset"] = "where joints slide or open first"
    if any(trial.load_factor is not None for trial in way.draws):
        curves["bedding"] = "draws of beds that are not true"
    return _with_curves(_table(said(solution).rows), solution, curves)


def _with_curves(table: str, thing: Any, curves: Mapping[str, str]) -> str:
    """Returns a table with pictures by their kind, each with what it is called: one beside it, as
    paper is short, several below."""
    if len(thing.scene.blocks) > MOST_BLOCKS or not curves:
        return table
    size = (4.4, 2.1) if len(curves) == 1 else (4.6, 3.4)
    try:
        shown = [_figure(thing.plot(kind, figsize=size), text) for kind, text in curves.items()]
    except ModelError as error:
        return f"{table}<p>{_text(f'no curve: {error}')}</p>"
    if len(curves) == 1:
        return f'<div class="beside">{table}{shown[0]}</div>'
    return f'{table}<div class="pictures">{"".join(shown)}</div>'


def _figure(drawn: Any, text: str) -> str:
    file = BytesIO()
    drawn.savefig(file, format="png", dpi=150)
    data = base64.b64encode(file.getvalue()).decode("ascii")
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text[0].upper()}{text[1:]}</figcaption></figure>"
    )


def _assumptions(scene: Scene, solution: Solution, without: Solution | None) -> Iterator[str]:
    """Yields the assumptions behind the answer, a sentence each."""
    is_from_rest = solution.from_rest is not None
    yield "Blocks are rigid; the geometry is that before any movement, and joints are plane."
    if not np.any(scene.contacts.tensile_strength):
        yield "Joints bear no tension."
    if np.isinf(scene.contacts.compressive_strength).all():
        yield "Stone does not crush."
    if without is not None:
        yield (
            "Sliding obeys Coulomb's law: without dilatancy in the number that leads, for which "
            "there is no single answer; with dilatancy (associated flow) in its upper limit."
        )
    elif solution.flow == "associated":
        yield (
            "Sliding obeys Coulomb's law with dilatancy (associated flow): joints open as they "
            "slide, and where they do the load factor is an upper bound of what Coulomb friction "
            "without dilatancy holds."
        )
    elif is_from_rest:
        yield (
            "Joints are elastic until they open or slide, stiff in shear at a fixed ratio of "
            "the normal stiffness, and beds are true but in draws; sliding obeys Coulomb's law "
            "without dilatancy. The answer is where the wall ends that is loaded from rest, not a "
            "bound."
        )
    else:
        yield "Sliding obeys Coulomb's law without dilatancy, for which there is no single answer."
    torsion = f"Friction's surface: {solution.surface_name}"
    if solution.interaction == "none":
        yield f"{torsion}; torsion is not reduced where the pressure is eccentric."
    else:
        how = f"{solution.interaction}, {solution.moments} moments"
        yield f"{torsion}; reduced where the pressure is eccentric ({how})."
    loads = "The dead load acts first, then the live load" if is_from_rest else "Loads act at once"
    besides = "neither settlement nor" if solution.quantity == LOAD_FACTOR else "no"
    yield f"{loads}, and statically; there is {besides} temperature."


def _found(solution: Solution, digest: str) -> Rows:
    """Yields solvers, model, versions and the scene's digest."""
    solvers = dict.fromkeys(iterate.solver for iterate in solution.history)
    number = len(solution.history)
    yield "solver", f"{names(list(solvers))}; {number} solve{'s' * (number != 1)}"
    if solution.model:
        yield "model", f"reduced ({', '.join(solution.model)}); bounds hold for the full one"
    if solution.status is Status.CERTIFIED:
        yield "bounds", "recomputed from forces and mechanism, outside the solver"
    used = solution.versions or {"cvxlimit": __version__}
    yield "versions", ", ".join(f"{name} {number}" for name, number in used.items())
    yield "digest of the scene", digest
    yield "page made on", date.today().isoformat()
    yield (
        "cite",
        (
            "The cvxlimit engineers: cvxlimit, certified collapse loads of dry-jointed masonry by "
            f"convex optimisation, version {used.get('cvxlimit', __version__)}; model: Portioli et "
            "al., Archive of Applied Mechanics 83 (2013), 1415-1438"
        ),
    )


def _shown(value: Any) -> str:
    """Returns as HTML a path, an envelope, a mapping, a pandas table, anything with ``rows``, or
    the text of any other object."""
    if hasattr(value, "facts"):
        return f"<p><strong>{_text(sentences(value.headline))}</strong></p>" + (
            _with_curves(_table(value.facts()), value, {"curve": "the curve"})
        )
    if hasattr(value, "crossings"):
        drawn = _figure(value.plot(figsize=(7.2, 2.0)), "load factors at all positions")
        said = f"<p>{_text(sentences(str(value).splitlines()[0]))}</p>"
        return f'{said}{_table(value.told())}<div class="pictures">{drawn}</div>'
    if hasattr(value, "columns") and hasattr(value, "itertuples"):
        named = [value.index.name or "", *map(str, value.columns)]
        return _grid(value.itertuples(), named)
    if isinstance(value, Mapping):
        return _table((str(name), _plain(each)) for name, each in value.items())
    if hasattr(value, "rows"):
        rows = list(value.rows)
        shown = _table(rows) if all(len(row) == 2 for row in rows) else _grid(rows)
        return shown + "".join(f"<p>{_text(line)}</p>" for line in getattr(value, "caveats", ()))
    return "".join(f"<p>{_text(line)}</p>" for line in str(value).splitlines()[:MOST_ROWS])


def _grid(rows: Iterable[Sequence[Any]], head: Sequence[str] = ()) -> str:
    listed = list(rows)
    cells = [[*map(_plain, row)] for row in islice(listed, 2 * MOST_ROWS)]
    if len(listed) > len(cells):
        cells.append([f"and {len(listed) - len(cells)} more"])
    titles = "".join(f"<th>{_text(name)}</th>" for name in head)
    lines = "".join("".join(f"<td>{_text(x)}</td>" for x in row).join(_ROW) for row in cells)
    return f'<table class="grid">{titles.join(_ROW) if head else ""}{lines}</table>'


_ROW = ("<tr>", "</tr>")


def _plain(value: Any) -> str:
    return "none" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _table(rows: Iterable[tuple[str, str]], kind: str = "facts") -> str:
    lines = "".join(
        f"<tr><th>{_text(a, LONGEST_NAME)}</th><td>{_text(b)}</td></tr>" for a, b in rows
    )
    return f'<table class="{kind}">{lines}</table>' if lines else ""


def _list(items: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{_text(item)}</li>' for item in items)}</ul>"


def _text(value: str, most: int = LONGEST) -> str:
    """Returns a text as HTML without markup of its own, at most ``most`` characters long."""
    shown = printable(value)
    return escape(shown if len(shown) <= most else f"{shown[: most - 1]}…")
