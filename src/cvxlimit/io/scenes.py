"""Scene files: ``cvxlimit-scene``, version 1."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.checks import positive
from cvxlimit.errors import InputError
from cvxlimit.files import write_file
from cvxlimit.geometry.blocks import Block
from cvxlimit.io.documents import Path, encoded, file_prefix, read_document
from cvxlimit.io.fields import (
    LARGEST,
    JsonObject,
    check_header,
    fields,
    items,
    mapping,
    number,
    numbers,
    refusals,
    shown,
    text,
    whole,
)
from cvxlimit.loads import Load, PointForce, Pressure
from cvxlimit.scene import Scene, Units, check_scene
from cvxlimit.strengths import PROPERTIES
from cvxlimit.ties import Tie

_AXES = ("x", "y", "z")
_FORCE = ("fx", "fy", "fz", "mx", "my", "mz")
_LOAD = ("gravity", "acceleration", "forces", "points", "pressures", "weights")
_REQUIRED = ("format", "version", "blocks", "supports", "friction", "loads")
_OPTIONAL = ("name", "units", "contacts", "joint_tolerance", *PROPERTIES, "ties")


def read_scene(path: Path) -> Scene:
    """Read a scene file.

    ``name``, ``units`` and ``contacts`` may be left out and then take the defaults of
    :class:`~cvxlimit.scene.Scene`. Everything else must be there: friction and both loads are
    never guessed (``"dead": {}`` states that there is no dead load).

    The keys of a load, all optional, add up: ``gravity`` and ``acceleration`` (3,) in multiples of
    each free block's weight; ``forces`` {id: (6,)} at centroids; ``weights`` {id: (3,)} in
    multiples of the weight of selected blocks; ``points``, a list of {"block", "at" (3,),
    "force" (3,)}; ``pressures``, a list of {"block", "normal" (3,), "pressure"} on the faces that
    look along ``normal``. See :class:`~cvxlimit.loads.Load`.

    Parameters
    ----------
    path : str or path-like
        File in JSON, UTF-8 (a byte order mark is allowed).

    Raises
    ------
    InputError
        If the file cannot be read or is no valid scene: one line naming the file, the object
        in it, the value and the cure. Contacts are detected later, on first use.

    Example
    -------
    >>> import tempfile, pathlib
    >>> ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    >>> tower = Block.box("tower", (0, 0, 0), (1, 1, 4), density=20.0)
    >>> scene = Scene([ground, tower], ["ground"], Load(acceleration=(1, 0, 0)), name="tower")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "tower.json")
    ...     write_scene(scene, file)
    ...     read_scene(file).total_weight
    80.0
    """
    with refusals(file_prefix(path)):
        return scene_from_dict(read_document(path))


def write_scene(scene: Scene, path: Path) -> None:
    """Write a scene file that :func:`read_scene` reads back without loss.

    The file is complete or untouched: a temporary file beside it is renamed at the end.

    Raises
    ------
    InputError
        If a number or text of the scene has no place in the format (see
        :func:`scene_to_dict`), or the file cannot be written.

    Example
    -------
    See :func:`read_scene`.
    """
    with refusals(file_prefix(path)):
        data = encoded(scene_to_dict(scene))
    write_file(path, data)


def scene_to_dict(scene: Scene) -> JsonObject:
    """The scene as plain dicts, lists, texts and numbers, laid out as in a scene file.

    Blocks given as boxes stay boxes (``min`` and ``max`` are kept bit for bit), all others are
    written with vertices and faces. Detected contacts are not written, friction overrides are.

    Raises
    ------
    InputError
        If a number is larger than 1e30 or a text cannot be written in UTF-8.

    Example
    -------
    >>> ground = Block.box("ground", (0, 0, -1), (1, 1, 0))
    >>> brick = Block.box("brick", (0, 0, 0), (1, 1, 1), density=18.0)
    >>> document = scene_to_dict(Scene([ground, brick], ["ground"], Load(acceleration=(1, 0, 0))))
    >>> document["blocks"][0]
    {'id': 'ground', 'box': {'min': [0.0, 0.0, -1.0], 'max': [1.0, 1.0, 0.0]}}
    """
    check_scene(scene)
    with refusals():
        document: JsonObject = {
            "format": "cvxlimit-scene",
            "version": 1,
            "name": text(scene.name, "name of the scene"),
            "units": {
                "length": text(scene.units.length, "length unit"),
                "force": text(scene.units.force, "force unit"),
            },
            "blocks": [_block_to_dict(block) for block in scene.blocks],
            "supports": list(scene.supports),
        }
        document |= _joints_to_dict(scene)
        if scene.joint_tolerance is not None:
            document["joint_tolerance"] = number(scene.joint_tolerance, "joint_tolerance")
        if scene.ties:
            document["ties"] = [_tie_to_dict(tie) for tie in scene.ties]
        own = _contacts_to_list(scene)
        if own:
            document["contacts"] = own
        loads = (("dead", scene.dead), ("live", scene.live))
        document["loads"] = {case: _load_to_dict(case, load) for case, load in loads}
        return document


def scene_from_dict(document: object) -> Scene:
    """The scene described by the content of a scene file; see :func:`read_scene`.

    Raises
    ------
    InputError
        If it is no valid scene: one line naming the object in it, the value and the cure.

    Example
    -------
    >>> scene_from_dict({"format": "cvxlimit-scene", "version": 1, "blocs": []})
    Traceback (most recent call last):
    cvxlimit.errors.InputError: the scene has an unknown key 'blocs'; did you mean 'blocks'?
    """
    with refusals():
        check_header(document, "scene")
        top = fields(document, "the scene", _REQUIRED, _OPTIONAL)
        loads = fields(top["loads"], "loads", ("dead", "live"))
        supports = items(top["supports"], "supports")
        joint_tolerance = _joint_tolerance(top)
        own: dict[str, Any] = dict(_by_contact(top.get("contacts", [])))
        own |= {w: number(top[w], f"{w} of the scene") for w in PROPERTIES if w in top}
        return Scene(
            blocks=_blocks(top["blocks"], joint_tolerance),
            supports=tuple(text(support, f"support {i}") for i, support in enumerate(supports)),
            live=_load("live", loads["live"]),
            dead=_load("dead", loads["dead"]),
            **own,
            units=_units(top["units"]) if "units" in top else Units(),
            name=text(top.get("name", "scene"), "name of the scene"),
            joint_tolerance=joint_tolerance,
            ties=tuple(_tie(i, tie) for i, tie in enumerate(items(top.get("ties", []), "ties"))),
        )


def _block_to_dict(block: Block) -> JsonObject:
    entry: JsonObject = {"id": text(block.id, "id of a block")}
    if block.bounds is not None:
        low, high = _rows(block.bounds, block.id)
        entry["box"] = {"min": low, "max": high}
    else:
        entry["vertices"] = _rows(block.vertices, block.id)
        entry["faces"] = [list(face) for face in block.faces]
    if block.density is not None:
        entry["density"] = number(block.density, f"density of block {shown(block.id)}")
    return entry


def _rows(points: NDArray[np.float64], id: str) -> list[list[float]]:
    if not (np.abs(points) <= LARGEST).all():
        raise InputError(
            f"coordinates of block {shown(id)} must be finite and at most {LARGEST:g}; "
            "choose other units"
        )
    rows: list[list[float]] = points.tolist()
    return rows


def _load_to_dict(case: str, load: Load) -> JsonObject:
    entry: JsonObject = {}
    for name, vector in (("gravity", load.gravity), ("acceleration", load.acceleration)):
        if vector is not None:
            entry[name] = list(numbers(vector, _AXES, f"{name} of the {case} load"))
    if load.forces:
        entry["forces"] = {
            text(block, f"a block id of the {case} load"): list(
                numbers(force, _FORCE, f"force of the {case} load on block {shown(block)}")
            )
            for block, force in load.forces.items()
        }
    if load.weights:
        entry["weights"] = {
            text(block, f"a block id of the {case} load"): list(
                numbers(times, _AXES, f"weight of the {case} load on block {shown(block)}")
            )
            for block, times in load.weights.items()
        }
    if load.points:
        entry["points"] = [_point_to_dict(case, point) for point in load.points]
    if load.pressures:
        entry["pressures"] = [_pressure_to_dict(case, pressure) for pressure in load.pressures]
    return entry


def _point_to_dict(case: str, point: PointForce) -> JsonObject:
    where = f"of the {case} load on block {shown(point.block)}"
    return {
        "block": text(point.block, f"a block id of the {case} load"),
        "at": list(numbers(point.at, _AXES, f"point {where}")),
        "force": list(numbers(point.force, _AXES, f"point force {where}")),
    }


def _pressure_to_dict(case: str, load: Pressure) -> JsonObject:
    where = f"of the {case} load on block {shown(load.block)}"
    return {
        "block": text(load.block, f"a block id of the {case} load"),
        "normal": list(numbers(load.normal, _AXES, f"normal {where}")),
        "pressure": number(load.pressure, f"pressure {where}"),
    }


def _units(value: object) -> Units:
    units = fields(value, "units", ("length", "force"))
    return Units(text(units["length"], "length unit"), text(units["force"], "force unit"))


def _joint_tolerance(top: JsonObject) -> float | None:
    if "joint_tolerance" not in top:
        return None
    return positive(number(top["joint_tolerance"], "joint_tolerance"), "joint_tolerance")


def _blocks(value: object, joint_tolerance: float | None) -> tuple[Block, ...]:
    blocks = tuple(
        _block(i, entry, joint_tolerance) for i, entry in enumerate(items(value, "blocks"))
    )
    ids = sorted(block.id for block in blocks)
    for one, following in pairwise(ids):
        if one == following:
            raise InputError(f"block id {shown(one)} is used twice; ids must be unique")
    return blocks


def _block(index: int, value: object, joint_tolerance: float | None) -> Block:
    where = f"entry {index} of blocks"
    if isinstance(value, dict) and "id" in value:
        name = text(value["id"], f"id of {where}")
        if not name:
            raise InputError(f"id of {where} must not be empty; give every block a name")
        where = f"block {shown(name)}"
    entry = fields(value, where, ("id",), ("box", "vertices", "faces", "density"))
    density = number(entry["density"], f"density of {where}") if "density" in entry else None
    if "box" in entry:
        return _box(name, where, entry, density)
    if "vertices" not in entry or "faces" not in entry:
        raise InputError(f"{where} has no shape; give it a box, or both vertices and faces")
    vertices, faces = _vertices(entry["vertices"], where), _faces(entry["faces"], where)
    return Block.polyhedron(name, vertices, faces, density, joint_tolerance)


def _box(id: str, where: str, entry: JsonObject, density: float | None) -> Block:
    if "vertices" in entry or "faces" in entry:
        raise InputError(f"{where} has a box and vertices or faces; keep one of the two shapes")
    box = fields(entry["box"], f"box of {where}", ("min", "max"))
    low, high = (numbers(box[end], _AXES, f"box {end} of {where}") for end in ("min", "max"))
    return Block.box(id, low, high, density)


def _vertices(value: object, where: str) -> list[tuple[float, ...]]:
    return [
        numbers(vertex, _AXES, f"vertex {i} of {where}")
        for i, vertex in enumerate(items(value, f"vertices of {where}"))
    ]


def _faces(value: object, where: str) -> list[tuple[int, ...]]:
    return [
        _indices(face, f"face {i} of {where}")
        for i, face in enumerate(items(value, f"faces of {where}"))
    ]


def _indices(value: object, where: str) -> tuple[int, ...]:
    return tuple(whole(index, f"a vertex index in {where}") for index in items(value, where))


def _tie_to_dict(tie: Tie) -> JsonObject:
    where = f"tie {shown(tie.a)}-{shown(tie.b)}"
    return {
        "between": [tie.a, tie.b],
        "start": list(numbers(tie.start, _AXES, f"start of {where}")),
        "end": list(numbers(tie.end, _AXES, f"end of {where}")),
        "yield_force": number(tie.yield_force, f"yield_force of {where}"),
    }


def _tie(index: int, value: object) -> Tie:
    where = f"entry {index} of ties"
    entry = fields(value, where, ("between", "start", "end", "yield_force"))
    first, second = _pair(entry["between"], f"'between' in {where}")
    start, end = (numbers(entry[name], _AXES, f"{name} of {where}") for name in ("start", "end"))
    return Tie(first, second, start, end, number(entry["yield_force"], f"yield_force of {where}"))


def _joints_to_dict(scene: Scene) -> JsonObject:
    """Friction, and what differs from its default."""
    return {
        what: number(value, f"{what} of the scene")
        for what, each in PROPERTIES.items()
        if (value := getattr(scene, what)) != each.default or what == "friction"
    }


def _contacts_to_list(scene: Scene) -> list[JsonObject]:
    """One entry per pair of blocks with anything of its own."""
    entries: dict[tuple[str, str], JsonObject] = {}
    for what in PROPERTIES:
        for pair, value in getattr(scene, f"contact_{what}").items():
            if value == float("inf"):
                raise InputError(
                    f"{what} of contact {pair} is infinite, which a scene file cannot say for one "
                    "contact: give a large number"
                )
            entry = entries.setdefault(pair, {"between": list(pair)})
            entry[what] = number(value, f"{what} of contact {pair}")
    return list(entries.values())


def _by_contact(value: object) -> dict[str, dict[tuple[str, str], float]]:
    """What contacts have of their own, as arguments of the scene."""
    result: dict[str, dict[tuple[str, str], float]] = {f"contact_{what}": {} for what in PROPERTIES}
    for i, item in enumerate(items(value, "contacts")):
        where = f"entry {i} of contacts"
        entry = fields(item, where, ("between",), PROPERTIES)
        first, second = _pair(entry["between"], f"'between' in {where}")
        contact = f"contact {shown(first)}-{shown(second)}"
        if first == second:
            raise InputError(f"{where} names block {shown(first)} twice; name two blocks")
        given = [what for what in PROPERTIES if what in entry]
        if not given:
            raise InputError(f"{where} lacks {', '.join(PROPERTIES)}: give at least one")
        for what in given:
            own = result[f"contact_{what}"]
            if (first, second) in own or (second, first) in own:
                raise InputError(f"{what} of {contact} is given twice; keep one entry")
            own[first, second] = number(entry[what], f"{what} of {contact}")
    return result


def _pair(value: object, where: str) -> tuple[str, str]:
    names = [text(name, where) for name in items(value, where)]
    if len(names) != 2:
        raise InputError(f"{where} must be two block ids, got {shown(value)}")
    return names[0], names[1]


def _load(case: str, value: object) -> Load:
    where = f"the {case} load"
    entry = fields(value, where, (), _LOAD)
    vectors = {
        name: numbers(entry[name], _AXES, f"{name} of {where}")
        for name in ("gravity", "acceleration")
        if name in entry
    }
    forces = {
        block: numbers(force, _FORCE, f"force of {where} on block {shown(block)}")
        for block, force in mapping(entry.get("forces", {}), f"forces of {where}").items()
    }
    weights = {
        block: numbers(times, _AXES, f"weight of {where} on block {shown(block)}")
        for block, times in mapping(entry.get("weights", {}), f"weights of {where}").items()
    }
    points = enumerate(items(entry.get("points", []), f"points of {where}"))
    pressures = enumerate(items(entry.get("pressures", []), f"pressures of {where}"))
    with refusals(f"in {where}, "):
        return Load(
            vectors.get("gravity"),
            vectors.get("acceleration"),
            forces,
            [_point(point, f"point load {i}") for i, point in points],
            [_pressure(pressure, f"pressure {i}") for i, pressure in pressures],
            weights,
        )


def _point(value: object, where: str) -> PointForce:
    entry = fields(value, where, ("block", "at", "force"))
    return PointForce(
        text(entry["block"], f"block of {where}"),
        numbers(entry["at"], _AXES, f"'at' of {where}"),
        numbers(entry["force"], _AXES, f"force of {where}"),
    )


def _pressure(value: object, where: str) -> Pressure:
    entry = fields(value, where, ("block", "normal", "pressure"))
    return Pressure(
        text(entry["block"], f"block of {where}"),
        numbers(entry["normal"], _AXES, f"normal of {where}"),
        number(entry["pressure"], f"value of {where}"),
    )
