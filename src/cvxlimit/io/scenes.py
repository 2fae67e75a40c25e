"""Scene files: ``cvxlimit-scene``, version 1."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Collection
from functools import partial
from typing import Any

import numpy as np

from cvxlimit.base.checks import first_twice, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.io.fields import (
    LARGEST_NUMBER,
    FilePath,
    JsonObject,
    fields,
    items,
    number,
    numbers,
    shown,
    text,
)
from cvxlimit.io.forms import (
    NUMBER,
    TEXT,
    WHOLE,
    Document,
    Form,
    Key,
    keyed,
    listed,
    plain,
    record,
    row,
)
from cvxlimit.scene import Scene, Units, check_scene
from cvxlimit.scene.loads import GrowingAcceleration, Load, PointForce
from cvxlimit.scene.pressures import Pressure
from cvxlimit.scene.reactions import Reaction, Tie
from cvxlimit.scene.settling import SupportMotion

AXES = ("x", "y", "z")
POINT = row(AXES)
FORCE = row(("fx", "fy", "fz", "mx", "my", "mz"))

VERTICES = listed(POINT, "vertex {i} of {owner}")
FACES = listed(listed(WHOLE, "a vertex index in {where}"), "face {i} of {owner}")

BlockOf = Callable[[float | None], Block]
"""A block that was read, for the scene's joint tolerance."""


def _read_block(value: object, where: str, _: str) -> BlockOf:
    if isinstance(value, dict) and "id" in value:
        name = text(value["id"], f"id of {where}")
        if not name:
            raise InputError(f"id of {where} must not be empty; give every block a name")
        where = f"block {shown(name)}"
    entry = fields(value, where, ("id",), ("box", "vertices", "faces", "density"))
    density = number(entry["density"], f"density of {where}") if "density" in entry else None
    if "box" in entry:
        if "vertices" in entry or "faces" in entry:
            raise InputError(f"{where} has a box and vertices or faces; keep one of the two shapes")
        box = fields(entry["box"], f"box of {where}", ("min", "max"))
        low, high = (numbers(box[end], AXES, f"box {end} of {where}") for end in ("min", "max"))
        made = Block.box(name, low, high, density)
        return lambda _: made
    if "vertices" not in entry or "faces" not in entry:
        raise InputError(f"{where} has no shape; give it a box, or both vertices and faces")
    vertices = VERTICES.read(entry["vertices"], f"vertices of {where}", where)
    faces = FACES.read(entry["faces"], f"faces of {where}", where)
    return partial(Block.polyhedron, name, vertices, faces, density)


def _write_block(block: Block, *_: str) -> JsonObject:
    where = f"block {shown(block.id)}"
    points = block.vertices if block.bounds is None else np.array(block.bounds)
    if not (np.abs(points) <= LARGEST_NUMBER).all():
        raise InputError(
            f"coordinates of {where} must be finite and at most {LARGEST_NUMBER:g}; "
            "choose other units"
        )
    entry: JsonObject = {"id": text(block.id, "id of a block")}
    if block.bounds is None:
        entry["vertices"] = points.tolist()
        entry["faces"] = [list(face) for face in block.faces]
    else:
        entry["box"] = dict(zip(("min", "max"), points.tolist(), strict=True))
    if block.density is not None:
        entry["density"] = number(block.density, f"density of {where}")
    return entry


BLOCK = Form(
    _read_block,
    _write_block,
    {
        "type": "object",
        "properties": {
            "id": {"type": "string", "minLength": 1},
            "box": {
                "type": "object",
                "properties": {"min": POINT.schema, "max": POINT.schema},
                "required": ["min", "max"],
                "additionalProperties": False,
            },
            "vertices": VERTICES.schema,
            "faces": FACES.schema,
            "density": NUMBER.schema,
        },
        "required": ["id"],
        "oneOf": [{"required": ["box"]}, {"required": ["vertices", "faces"]}],
        "additionalProperties": False,
    },
)


def _read_pair(value: object, where: str) -> tuple[str, str]:
    names = [text(name, where) for name in items(value, where)]
    if len(names) != 2:
        raise InputError(f"{where} must be two block ids, got {shown(value)}")
    return names[0], names[1]


PAIR = plain(_read_pair, {"type": "array", "items": TEXT.schema, "minItems": 2, "maxItems": 2})
BETWEEN = Form(
    lambda value, *place: dict(zip("ab", PAIR.read(value, *place), strict=True)),
    lambda tie, *place: list(PAIR.write((tie.a, tie.b), *place)),
    PAIR.schema,
)
TIE = record(
    Tie,
    {
        "between": Key(BETWEEN, "'between' in {owner}", is_needed=True, is_several=True),
        "start": POINT,
        "end": POINT,
        "yield_force": NUMBER,
    },
)

UNLIMITED = Form(
    lambda value, where, _: math.inf if value == "inf" else number(value, where),
    lambda value, where, _: "inf" if value == math.inf else number(value, where),
    {"anyOf": [NUMBER.schema, {"const": "inf"}]},
)

REACTION = record(
    Reaction,
    {
        "block": TEXT,
        "at": Key(POINT, "'at' of {owner}"),
        "direction": POINT,
        "most": UNLIMITED,
        "least": NUMBER,
        "on": TEXT,
    },
)

MOTION = record(
    SupportMotion,
    {
        "supports": listed(TEXT, "support {i} of {owner}"),
        **dict.fromkeys(("direction", "rotation", "about"), POINT),
    },
)

VALUES = {
    what: UNLIMITED if each.default == math.inf else NUMBER for what, each in PROPERTIES.items()
}


def _read_contacts(value: object, where: str, _: str) -> JsonObject:
    result: dict[str, dict[tuple[str, str], float]] = {f"contact_{what}": {} for what in PROPERTIES}
    for i, item in enumerate(items(value, where)):
        where = f"entry {i} of contacts"
        entry = fields(item, where, ("between",), PROPERTIES)
        first, second = _read_pair(entry["between"], f"'between' in {where}")
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
            own[first, second] = VALUES[what].read(entry[what], f"{what} of {contact}", where)
    return dict(result)


def _write_contacts(scene: Scene, _: str, where: str) -> list[JsonObject] | None:
    entries: dict[tuple[str, str], JsonObject] = {}
    for what in PROPERTIES:
        for pair, value in getattr(scene, f"contact_{what}").items():
            entry = entries.setdefault(pair, {"between": list(pair)})
            entry[what] = VALUES[what].write(value, f"{what} of contact {pair}", where)
    return list(entries.values()) or None


CONTACTS = Form(
    _read_contacts,
    _write_contacts,
    {
        "type": "array",
        "items": {
            "type": "object",
            "properties": {"between": PAIR.schema, **{k: v.schema for k, v in VALUES.items()}},
            "required": ["between"],
            "minProperties": 2,
            "additionalProperties": False,
        },
    },
)

POINT_FORCE = record(
    PointForce,
    {"block": TEXT, "at": Key(POINT, "'at' of {owner}"), "force": POINT},
)
PRESSURE = record(
    Pressure,
    {
        "block": TEXT,
        "normal": POINT,
        "pressure": Key(NUMBER, "value of {owner}"),
        "gradient": POINT,
        "at": POINT,
        "within": POINT,
        "corners": listed(POINT, "corner {i} of {owner}"),
    },
)
GROWING = record(GrowingAcceleration, dict.fromkeys(("acceleration", "base", "top"), POINT))
LOAD = record(
    Load,
    {
        "gravity": POINT,
        "acceleration": POINT,
        "forces": keyed(FORCE, "force of {owner} on block {key}"),
        "weights": keyed(POINT, "weight of {owner} on block {key}"),
        "points": listed(POINT_FORCE, "point load {i}", prefix="in {owner}, "),
        "pressures": listed(PRESSURE, "pressure {i}", prefix="in {owner}, "),
        "growing": listed(GROWING, "growing acceleration {i}", prefix="in {owner}, "),
    },
    prefix="in {where}, ",
)
LOADS = record(
    Scene, {case: Key(LOAD, f"the {case} load", is_needed=True) for case in ("dead", "live")}, dict
)
UNITS = record(
    Units,
    {what: Key(TEXT, f"{what} unit", is_needed=True) for what in ("length", "force")},
)
TOLERANCE = plain(
    lambda value, where: positive(number(value, where), where),
    {"type": "number", "exclusiveMinimum": 0},
)


def _scene(
    *, blocks: tuple[BlockOf, ...], joint_tolerance: float | None = None, **given: Any
) -> Scene:
    made = tuple(block(joint_tolerance) for block in blocks)
    if (twice := first_twice(block.id for block in made)) is not None:
        raise InputError(f"block id {shown(twice)} is used twice; ids must be unique")
    return Scene(made, joint_tolerance=joint_tolerance, **given)


_KEYS: dict[str, Key | Form] = {
    "name": Key(TEXT, is_written=True),
    "units": Key(UNITS, "{key}", is_written=True),
    "blocks": Key(listed(BLOCK), "{key}"),
    "supports": Key(listed(TEXT, "support {i}"), "{key}"),
    **{what: Key(form, is_needed=what == "friction") for what, form in VALUES.items()},
    "joint_tolerance": Key(TOLERANCE, "{key}"),
    "ties": Key(listed(TIE), "{key}"),
    "reactions": Key(listed(REACTION), "{key}"),
    "settling": Key(listed(MOTION), "{key}"),
    "contacts": Key(CONTACTS, "{key}", is_several=True),
    "loads": Key(LOADS, "{key}", is_needed=True, is_several=True),
}

SCENE = Document(
    "scene", Scene, "scene", "builtin_scene('arch') makes one", _KEYS, _scene, "{key} of {owner}"
)


def read_scene(path: FilePath) -> Scene:
    """Read a scene file.

    ``name``, ``units`` and ``contacts`` may be left out and then take the defaults of
    :class:`~cvxlimit.scene.Scene`. Everything else must be there: friction and both loads are
    never guessed (``"dead": {}`` states that there is no dead load).

    The keys of a load are the fields of :class:`~cvxlimit.scene.loads.Load`, all optional.

    Parameters
    ----------
    path : str or path-like
        File in JSON, UTF-8 (a byte order mark is allowed).

    Raises
    ------
    InputError
        If the file cannot be read, or as for :func:`scene_from_dict`. Contacts are detected later,
        on first use.

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
    return SCENE.read(path)


def write_scene(scene: Scene, path: FilePath) -> None:
    """Write a scene file, complete or not at all, that :func:`read_scene` reads without loss.

    Raises
    ------
    InputError
        As for :func:`scene_to_dict`, or if the file cannot be written.
    """
    check_scene(scene)
    SCENE.write(scene, path)


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
    return SCENE.to_dict(scene)


def scene_digest(scene: Scene, cases: Collection[str] = ("dead", "live")) -> str:
    """A digest of all that a scene's file says, but for its name: equal for scenes that are alike.

    ``cases`` are the loads that count.

    Raises
    ------
    InputError
        As for :func:`scene_to_dict`.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> stack = builtin_scene("stack")
    >>> scene_digest(stack) == scene_digest(stack.with_name("pile"))
    True
    >>> scene_digest(stack) == scene_digest(stack.with_friction(0.5))
    False
    """
    document: dict[str, Any] = {k: x for k, x in scene_to_dict(scene).items() if k != "name"}
    document["loads"] = {case: document["loads"][case] for case in cases}
    text = json.dumps(document, sort_keys=True, ensure_ascii=False)
    return hashlib.blake2b(text.encode("utf-8"), digest_size=16).hexdigest()


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
    return SCENE.from_dict(document)
