"""A solution as two pages to print and sign: the problem, its result, and what that is based on."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date
from html import escape
from io import BytesIO
from itertools import islice
from typing import Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.versions import __version__
from cvxlimit.errors import ModelError
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.plotting.contents import scene_drawing
from cvxlimit.plotting.look import printable
from cvxlimit.plotting.pictures.mechanism import mechanism_of
from cvxlimit.plotting.pictures.webpage import Page, asset, sentences
from cvxlimit.plotting.registry import figures
from cvxlimit.results.movement import motion
from cvxlimit.scene import Load, Scene
from cvxlimit.solution import LOAD_FACTOR, Solution, Status
from cvxlimit.solution.kinematics import ContactKind
from cvxlimit.solution.said import basis_of, ends, said

LONGEST, LONGEST_NAME, MOST_NAMES, MOST_ROWS, MOST_BLOCKS = 600, 40, 6, 12, 20_000
"""Largest numbers of characters of a sentence and of a name, of names in a list, and of rows of a
text, so that any structure fits on two sheets; blocks up to which pictures are drawn, in about ten
seconds."""

Rows = Iterator[tuple[str, str]]


def report(
    solution: Solution,
    digest: str,
    path: Any = None,
    check: Any = None,
    envelope: Any = None,
    sensitivity: Any = None,
    without_dilatancy: Solution | None = None,
) -> Page:
    """Returns the page of :meth:`cvxlimit.Solution.report`; ``digest`` is the scene's."""
    scene = solution.scene
    extras = {"Sensitivity": sensitivity, "Path": path, "Code check": check}
    extras["Positions of a vehicle"] = envelope
    falling = solution if without_dilatancy is None else without_dilatancy
    sections = [
        ("Result", _table(_result(solution, without_dilatancy), "result")),
        ("", _pictures(scene, falling)),
        ("Structure", _table(_structure(scene))),
        ("Loads", _table(_loads(scene, solution))),
        ("Joints", _table(_joints(scene))),
        ("Assumptions", _list(_assumptions(scene, solution, without_dilatancy))),
        ("Mechanism", _table(_mechanism(scene, falling))),
        *((name, _shown(value)) for name, value in extras.items() if value is not None),
        ("How it was found", _table(_found(solution, digest))),
        ("", _SIGNATURE),
    ]
    body = "".join(f"<h2>{head}</h2>{text}" if head else text for head, text in sections if text)
    name = _text(scene.name)
    return Page(asset("report.html").replace("<!--TITLE-->", name).replace("<!--BODY-->", body))


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
        drawings.insert(0, ("the structure and its loads", at_rest))
        shown = ""
        for text, drawing in drawings:
            shown += _figure(pictures.drawn(drawing, figsize=(4.6, 3.6), title=""), text)
        return f'<div class="pictures">{shown}</div>'
    except ModelError as error:  # without Matplotlib the figures are still worth having
        return f"<p>{_text(f'no pictures: {error}')}</p>"


def _curve(path: Any) -> str:
    if len(path.scene.blocks) > MOST_BLOCKS:
        return ""
    try:
        return f'<div class="pictures">{_figure(path.plot(figsize=(5.2, 2.9)), "the curve")}</div>'
    except ModelError as error:
        return f"<p>{_text(f'no curve: {error}')}</p>"


def _figure(drawn: Any, text: str) -> str:
    file = BytesIO()
    drawn.savefig(file, format="png", dpi=150)
    data = base64.b64encode(file.getvalue()).decode("ascii")
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text[0].upper()}{text[1:]}</figcaption></figure>"
    )


def _structure(scene: Scene) -> Rows:
    """Yields facts about blocks, supports, contacts, ties and reactions."""
    unit = scene.units
    free = [scene.blocks[i] for i in scene.free]
    yield "free blocks", f"{len(free)}, weight {scene.total_weight:.6g} {unit.force}"
    yield "supports", f"{len(scene.supports)}: {_names(scene.supports)}"
    size = np.ptp(np.concatenate([block.vertices for block in free]), axis=0)
    yield "extent of them all", _vector(size, unit.length, " x ")
    density = np.array([block.density or 0.0 for block in free])
    yield "weight per volume", f"{_range(density)} {unit.force}/{unit.length}³"
    tolerance = "one hundredth of the thinner block's mean thickness"
    if scene.joint_tolerance is not None:
        tolerance = f"{scene.joint_tolerance:g} {unit.length}"
    joints = len(scene.contacts.faces)
    yield "contacts", f"{joints}, found within a joint tolerance of {tolerance}"
    for tie in scene.ties[:MOST_NAMES]:
        yield (
            "tie",
            f"{_names([tie.a])} - {_names([tie.b])}, yields at {tie.yield_force:g} {unit.force}",
        )
    if scene.reactions:
        most = _range(np.array([each.most for each in scene.reactions]))
        pushed = _names(list(dict.fromkeys(each.block for each in scene.reactions)))
        yield (
            "reactions",
            f"{len(scene.reactions)} forces of a fixed direction, each as large as equilibrium "
            f"needs, up to its bound: {most} {unit.force}; on {pushed}",
        )
    yield from (("simplified", remark) for remark in scene.told)
    if not scene.told:
        yield "simplified", "nothing: gaps, overlaps and faces are as the scene has them"


def _loads(scene: Scene, solution: Solution) -> Rows:
    """Yields both load cases with their parts and resultants."""
    for case, load, forces in (
        ("dead", scene.dead, scene.dead_forces),
        ("live", scene.live, scene.live_forces),
    ):
        if case == "live" and solution.quantity != LOAD_FACTOR:
            continue  # a reaction is under the dead load alone
        parts = "; ".join(_parts(load, scene)) or "none"
        yield f"{case} load", f"{parts}; {_resultant(scene, forces)}"
    if solution.quantity == LOAD_FACTOR:
        yield "load factor", "multiplies the live load alone"


def _resultant(scene: Scene, forces: FloatArray) -> str:
    """Returns in words the sum of loads (free blocks, 6), and the point of its line nearest the
    blocks."""
    centres = np.array([scene.blocks[i].centroid for i in scene.free])
    total, middle = forces[:, :3].sum(axis=0), centres.mean(axis=0)
    moment = (np.cross(centres - middle, forces[:, :3]) + forces[:, 3:]).sum(axis=0)
    text = f"{_vector(total, scene.units.force)} in all"
    size = float(np.linalg.norm(total))
    if size <= 1e-9 * np.abs(forces[:, :3]).sum():
        return text
    at = middle + np.cross(total, moment) / size**2
    return f"{text}, along a line through {_vector(at, scene.units.length)}"


def _parts(load: Load, scene: Scene) -> Iterator[str]:
    units = scene.units
    if load.gravity is not None:
        yield f"own weight along {_vector(load.gravity)}"
    if load.acceleration is not None:
        yield f"weights times {_vector(load.acceleration)}"
    for each in load.growing:
        yield (
            f"weights times {_vector(each.acceleration)}, growing from nothing at "
            f"{_vector(each.base)} to that at {_vector(each.top)} {units.length}"
        )
    for number, what in (
        (len(load.forces), "force at a centroid"),
        (len(load.points), "force at a point"),
        (len(load.weights), "block with a weight of its own"),
    ):
        if number:
            yield f"{what}: {number}"
    if load.pressures:
        per = f"{units.force}/{units.length}"
        slope = max(float(np.linalg.norm(p.gradient)) for p in load.pressures)
        grows = f", growing by up to {slope:.4g} {per}³" if slope else ""
        own = {block.id: block for block in scene.blocks}
        values = np.array([x for p in load.pressures for x in p.extent(own[p.block])])
        yield f"pressures: {len(load.pressures)}, of {_range(values)} {per}²{grows}"


def _joints(scene: Scene) -> Rows:
    """Yields friction and strengths, with exceptions."""
    area = f" {scene.units.force}/{scene.units.length}²"
    for what, each in PROPERTIES.items():
        value, own = getattr(scene, what), getattr(scene, f"contact_{what}")
        text = "unlimited" if value == np.inf else f"{value:g}"
        if value not in (0.0, np.inf) and each.metadata["per_area"]:
            text += area
        if own:
            pairs = _names([f"{a} - {b}" for a, b in own])
            text += f"; {_range(np.array([*own.values()]))} at {len(own)}: {pairs}"
        yield what.replace("_", " "), text


def _assumptions(scene: Scene, solution: Solution, without: Solution | None) -> Iterator[str]:
    """Yields the assumptions behind the answer, a sentence each."""
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
    else:
        yield "Sliding obeys Coulomb's law without dilatancy, for which there is no single answer."
    torsion = f"Friction's surface: {solution.surface}, torsion with shear {solution.torsion_shear}"
    if solution.interaction == "none":
        yield f"{torsion}; torsion is not reduced where the pressure is eccentric."
    else:
        how = f"{solution.interaction}, {solution.moments} moments"
        yield f"{torsion}; reduced where the pressure is eccentric ({how})."
    yield "Loads act at once and statically; there is neither settlement nor temperature."


def _mechanism(scene: Scene, solution: Solution) -> Rows:
    """Yields which joints open, slide and twist, and which blocks move fastest."""
    if not solution.mechanism:
        return
    moving, contacts = motion(scene, solution), scene.contacts
    for kind in (ContactKind.OPENS, ContactKind.SLIDES, ContactKind.TWISTS):
        which = np.flatnonzero((moving.contacts.kind == kind) & ~contacts.is_point).tolist()
        names = _names([contacts.names[j] for j in which])
        yield f"joint {kind.name.lower()}", f"{len(which)} of {len(contacts.faces)}: {names}"
    speed = moving.speed / moving.speed.max()
    free, rates = scene.free, moving.rates[scene.free]
    if np.abs(rates - rates[0]).max() <= 1e-6 * np.abs(rates).max():
        yield "moving blocks", f"all {len(free)} move alike"
        return
    order = np.argsort(-np.round(speed, 6), kind="stable")  # equal ones in the scene's order
    yield "fastest blocks", _names([scene.blocks[i].id for i in order if speed[i] > 1e-6])


def _found(solution: Solution, digest: str) -> Rows:
    """Yields solvers, model, versions and the scene's digest."""
    solvers = dict.fromkeys(iterate.solver for iterate in solution.history)
    number = len(solution.history)
    yield "solver", f"{_names(list(solvers))}; {number} solve{'s' * (number != 1)}"
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
            _table(value.facts()) + _curve(value)
        )
    if hasattr(value, "crossings"):
        drawn = _figure(value.plot(figsize=(5.2, 2.9)), "load factors at all positions")
        said = "".join(f"<p>{_text(sentences(line))}</p>" for line in str(value).splitlines())
        return f'{said}<div class="pictures">{drawn}</div>'
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


def _names(names: Sequence[str]) -> str:
    most = LONGEST_NAME
    short = [x if len(x) <= most else f"{x[: most - 1]}…" for x in names[:MOST_NAMES]]
    more = len(names) - len(short)
    return (", ".join(short) or "none") + (f" and {more} more" if more > 0 else "")


def _range(values: FloatArray) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"


def _vector(values: Any, unit: str = "", between: str = ", ") -> str:
    numbers = np.asarray(values, dtype=float)
    small = np.abs(numbers) <= 1e-9 * np.abs(numbers).max(initial=0.0)
    text = between.join(f"{x:.6g}" for x in np.where(small, 0.0, numbers).tolist())
    return f"{text if between != ', ' else f'({text})'} {unit}".rstrip()
