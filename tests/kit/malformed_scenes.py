"""Scene files that must be refused, and a phrase that the one-line message must hold.

``MALFORMED`` maps a name to (content of the file, phrase); used by the tests of reading and of
the command line. ``GOLDEN`` is the example scene of the format, made complete.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from typing import Any

GOLDEN = """\
{"format": "cvxlimit-scene", "version": 1, "name": "example",
 "units": {"length": "m", "force": "kN"},
 "blocks": [{"id": "b1", "box": {"min": [0, 0, 0], "max": [1, 0.5, 0.25]}, "density": 20.0},
            {"id": "b2", "vertices": [[0, 0, 0.25], [1, 0, 0.25], [1, 0.5, 0.25], [0, 0.5, 0.25],
                                      [0.1, 0.1, 0.75], [0.9, 0.1, 0.75],
                                      [0.9, 0.4, 0.75], [0.1, 0.4, 0.75]],
             "faces": [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6],
                       [3, 0, 4, 7]], "density": 20.0},
            {"id": "ground", "box": {"min": [-1, -1, -0.5], "max": [2, 1.5, 0]}}],
 "supports": ["ground"],
 "friction": 0.7,
 "contacts": [{"between": ["b1", "b2"], "friction": 0.5}],
 "loads": {"dead": {"gravity": [0, 0, -1]},
           "live": {"acceleration": [0, 1, 0], "forces": {"b1": [0.5, 0, 0, 0, 0.25, 0]}}}}
"""


def edited(change: Callable[[dict[str, Any]], object]) -> str:
    """The golden scene after ``change``, as text."""
    document = copy.deepcopy(json.loads(GOLDEN))
    change(document)
    return json.dumps(document)


def put(value: object, *path: str | int) -> str:
    """The golden scene with ``value`` at ``path``."""

    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return edited(change)


def without(*path: str | int) -> str:
    """The golden scene without the entry at ``path``."""

    def change(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        del document[path[-1]]

    return edited(change)


B1 = ("blocks", 0)
B2 = ("blocks", 1)
CONTACT = ("contacts", 0)
DEAD = ("loads", "dead")
LIVE = ("loads", "live")

MALFORMED: dict[str, tuple[str | bytes, str]] = {
    # the file
    "empty": ("", "the file is empty"),
    "blank": (" \n\t\n", "the file is empty"),
    "not-utf8": (GOLDEN.encode().replace(b'"b1"', b'"b\xff"'), "not UTF-8: byte 0xff in line 3"),
    "utf16": (GOLDEN.encode("utf-16"), "save it as UTF-8"),
    "binary": (bytes(range(256)), "byte 0x80 in line 2"),
    "truncated": (GOLDEN[:200], "not valid JSON at line 4, column 4"),
    # from Python 3.13 on the comma itself is named, a line above
    "trailing-comma": ('{\n "format": "cvxlimit-scene",\n}', "not valid JSON at line "),
    "two-documents": (GOLDEN + GOLDEN, "not valid JSON at line 15, column 1: Extra data"),
    "python": ("__import__('os').system('true')", "not valid JSON at line 1, column 1"),
    "deep-lists": ("[" * 200_000, "nested too deeply"),
    "deep-objects": ('{"a":' * 200_000, "nested too deeply"),
    "deep-vertices": (put("@", *B2, "vertices").replace('"@"', "[" * 500 + "]" * 500), "vertex 0"),
    "not-an-object": ("[1, 2]", "a scene must be a JSON object {...}, got [1, 2]"),
    "only-a-number": ("7", "a scene must be a JSON object {...}, got 7"),
    # format and version
    "no-format": (without("format"), "lacks the key 'format'; add \"format\": \"cvxlimit-scene\""),
    "other-format": (put("cvxlimit-result", "format"), "this is not a scene file"),
    "null-format": (put(None, "format"), "format must be 'cvxlimit-scene', got None"),
    "no-version": (without("version"), "lacks the key 'version'"),
    "newer-version": (put(2, "version"), "version must be 1, got 2"),
    "version-as-text": (put("1", "version"), "version must be 1, got '1'"),
    "version-as-boolean": (put(True, "version"), "version must be 1, got True"),
    # keys
    "unknown-key": (put([], "block"), "the scene has an unknown key 'block'; did you mean"),
    "unknown-key-in-block": (
        put(20.0, *B1, "densty"), "block 'b1' has an unknown key 'densty'; did you mean 'density'?"
    ),
    "unknown-key-far-off": (put(1, *B1, "zzz"), "known keys are id, box, vertices, faces, density"),
    "unknown-key-in-box": (put([1, 1, 1], *B1, "box", "size"), "box of block 'b1' has an unknown"),
    "unknown-key-in-units": (put("kg", "units", "mass"), "units has an unknown key 'mass'"),
    "unknown-key-in-contact": (put(0.1, *CONTACT, "mu"), "entry 0 of contacts has an unknown key"),
    "unknown-key-in-loads": (put({}, "loads", "wind"), "loads has an unknown key 'wind'"),
    "unknown-key-in-live": (
        put([0, 1, 0], *LIVE, "accel"), "the live load has an unknown key 'accel'"
    ),
    "newline-in-key": (put(1, *B1, "a\nb"), r"unknown key 'a\nb'"),
    "duplicate-key": (
        GOLDEN.replace('"id": "b1"', '"density": 19, "id": "b1"'),
        "key 'density' of the object with id 'b1' is given twice",
    ),
    "duplicate-friction": (GOLDEN.replace(' "fr', ' "friction": 0.9, "fr', 1), "is given twice"),
    "no-blocks": (without("blocks"), "the scene lacks the key 'blocks'"),
    "no-supports": (without("supports"), "the scene lacks the key 'supports'"),
    "no-friction": (without("friction"), "the scene lacks the key 'friction'"),
    "no-loads": (without("loads"), "the scene lacks the key 'loads'"),
    "no-live-load": (without(*LIVE), "loads lacks the key 'live'"),
    "no-dead-load": (without(*DEAD), "loads lacks the key 'dead'; add \"dead\": {"),
    "no-box-max": (without(*B1, "box", "max"), "box of block 'b1' lacks the key 'max'"),
    "half-units": (without("units", "force"), "units lacks the key 'force'"),
    # blocks
    "blocks-as-object": (put({}, "blocks"), "blocks must be a list [...], got {}"),
    "empty-blocks": (edited(lambda d: d.update(blocks=[], contacts=[])), "support 'ground'"),
    "block-as-text": (put("b1", *B1), "entry 0 of blocks must be an object {...}, got 'b1'"),
    "no-id": (without(*B1, "id"), "entry 0 of blocks lacks the key 'id'"),
    "null-id": (put(None, *B1, "id"), "id of entry 0 of blocks must be a text in quotes, got None"),
    "number-as-id": (put(1, *B1, "id"), "id of entry 0 of blocks must be a text in quotes, got 1"),
    "empty-id": (put("", *B1, "id"), "id of entry 0 of blocks must not be empty"),
    "half-a-character": (put("b\ud800", *B1, "id"), "lone surrogate"),
    "same-id": (put("b1", *B2, "id"), "block id 'b1' is used twice"),
    "no-shape": (without(*B1, "box"), "block 'b1' has no shape; give it a box"),
    "no-faces": (without(*B2, "faces"), "block 'b2' has no shape"),
    "two-shapes": (put([[0, 1, 2]], *B1, "faces"), "block 'b1' has a box and vertices or faces"),
    "flat-box": (put([0, 0.5, 0.25], *B1, "box", "max"), "block 'b1' is degenerate"),
    "inverted-box": (put([1, 0.5, -2], *B1, "box", "max"), "length -2 along z"),
    "box-in-2d": (
        put([0, 0], *B1, "box", "min"), "box min of block 'b1' must be 3 numbers [x, y, z], got [0"
    ),
    "text-as-coordinate": (
        put("0.5", *B1, "box", "max", 1),
        "y of box max of block 'b1' must be a number, got '0.5'; remove the quotes",
    ),
    "boolean-as-coordinate": (put(True, *B1, "box", "max", 0), "must be a number, got True"),
    "null-coordinate": (put(None, *B2, "vertices", 3, 2), "z of vertex 3 of block 'b2' must be a"),
    "nan-coordinate": (put(float("nan"), *B2, "vertices", 0, 0), "x of vertex 0 of block 'b2'"),
    "infinite-coordinate": (put(float("inf"), *B1, "box", "max", 2), "z of box max of block 'b1'"),
    "1e400": (GOLDEN.replace('"density": 20.0', '"density": 1e400', 1), "density of block 'b1'"),
    "10**400": (put(10**400, *B1, "density"), "got a whole number of more than 60 digits"),
    "5000-digits": (GOLDEN.replace("0.7,", "7" * 5000 + ","), "a number has thousands of digits"),
    "overflowing-size": (put([1e200] * 3, *B1, "box", "max"), "box max of block 'b1' must be"),
    "vertex-as-number": (put(1, *B2, "vertices", 5), "vertex 5 of block 'b2' must be 3 numbers"),
    "too-few-vertices": (put([[0, 0, 0]], *B2, "vertices"), "'b2' needs at least four vertices"),
    "no-vertices": (put([], *B2, "vertices"), "'b2' needs at least four vertices"),
    "unused-vertex": (
        edited(lambda d: d["blocks"][1]["vertices"].append([0.5, 0.25, 0.5])),
        "vertex 8 of block 'b2' belongs to no face",
    ),
    "not-convex": (put([0.5, 0.25, 2], *B2, "vertices", 4), "block 'b2'"),
    "face-as-text": (put("0123", *B2, "faces", 2), "face 2 of block 'b2' must be a list"),
    "negative-index": (put(-1, *B2, "faces", 2, 0), "index in face 2 of block 'b2' must"),
    "index-too-large": (put(8, *B2, "faces", 2, 0), "face 2 of block 'b2' names vertex 8"),
    "huge-index": (put(10**400, *B2, "faces", 2, 0), "face 2 of block 'b2'"),
    "index-as-float": (put(1.0, *B2, "faces", 1, 1), "a whole number from 0 on, got 1.0"),
    "index-as-boolean": (put(True, *B2, "faces", 1, 1), "a whole number from 0 on, got True"),
    "two-corner-face": (put([0, 1], *B2, "faces", 0), "face 0 of block 'b2' needs at least three"),
    "empty-face": (put([], *B2, "faces", 0), "face 0 of block 'b2' needs at least three"),
    "open-body": (without(*B2, "faces", 0), "block 'b2' is not closed"),
    "no-density": (without(*B1, "density"), "free block 'b1' has no density"),
    "negative-density": (put(-20.0, *B1, "density"), "density of block 'b1' must be finite"),
    "null-density": (put(None, *B1, "density"), "density of block 'b1' must be a number, got None"),
    # supports and friction
    "supports-as-text": (put("ground", "supports"), "supports must be a list [...], got 'ground'"),
    "support-as-number": (put([2], "supports"), "support 0 must be a text in quotes, got 2"),
    "unknown-support": (put(["floor"], "supports"), "support 'floor' is not a block of the scene"),
    "support-twice": (put(["ground"] * 2, "supports"), "support 'ground' is listed twice"),
    "all-supports": (
        edited(lambda d: d.update(supports=["ground", "b1", "b2"], contacts=[])), "no free block"
    ),
    "negative-friction": (put(-0.1, "friction"), "friction of the scene must be finite"),
    "text-as-friction": (put("0.7", "friction"), "of the scene must be a number, got '0.7'"),
    "list-as-friction": (put([0.7], "friction"), "of the scene must be a number, got [0.7]"),
    "contacts-as-object": (put({"b1": 1}, "contacts"), "contacts must be a list [...]"),
    "contact-without-friction": (without(*CONTACT, "friction"), "entry 0 of contacts lacks"),
    "contact-negative-friction": (put(-1, *CONTACT, "friction"), "friction of contact"),
    "contact-null-friction": (put(None, *CONTACT, "friction"), "contact 'b1'-'b2' must"),
    "contact-of-three": (put(["b1", "b2", "ground"], *CONTACT, "between"), "must be two block ids"),
    "contact-with-itself": (put(["b1", "b1"], *CONTACT, "between"), "names block 'b1' twice"),
    "contact-unknown-block": (put(["b1", "b9"], *CONTACT, "between"), "there is no block 'b9'"),
    "contact-newline-id": (put(["b1", "b\n9"], *CONTACT, "between"), r"there is no block 'b\n9'"),
    "contact-twice": (
        edited(lambda d: d["contacts"].append({"between": ["b2", "b1"], "friction": 0.6})),
        "friction of contact 'b2'-'b1' is given twice",
    ),
    # loads, units, name
    "loads-as-list": (put([], "loads"), "loads must be an object {...}, got []"),
    "null-live-load": (put(None, *LIVE), "the live load must be an object {...}, got None"),
    "zero-live-load": (put({}, *LIVE), "the live load is zero everywhere"),
    "gravity-not-unit": (put([0, 0, -9.81], *DEAD, "gravity"), "in the dead load, gravity must be"),
    "gravity-in-2d": (put([0, -1], *DEAD, "gravity"), "gravity of the dead load must be"),
    "gravity-as-number": (put(9.81, *DEAD, "gravity"), "gravity of the dead load must be"),
    "null-acceleration": (put(None, *LIVE, "acceleration"), "acceleration of the live load must"),
    "short-force": (put([1, 0, 0], *LIVE, "forces", "b1"), "force of the live load on block 'b1'"),
    "text-in-force": (put(["1", 0, 0, 0, 0, 0], *LIVE, "forces", "b1"), "fx of force of the live"),
    "forces-as-list": (put([], *LIVE, "forces"), "forces of the live load must be an object"),
    "force-on-stranger": (put([1] * 6, *LIVE, "forces", "b9"), "the live load names block 'b9'"),
    "force-on-support": (put([1] * 6, *DEAD, "forces"), "forces of the dead load must be"),
    "force-on-ground": (put({"ground": [1] * 6}, *DEAD, "forces"), "block 'ground', which is"),
    "units-as-text": (put("m", "units"), "units must be an object {...}, got 'm'"),
    "unit-as-number": (put(1, "units", "length"), "length unit must be a text in quotes, got 1"),
    "null-name": (put(None, "name"), "name of the scene must be a text in quotes, got None"),
}  # fmt: skip
