"""Files hold every field of what they describe, and a schema says what they hold."""

from __future__ import annotations

import copy
import json
import math
import pickle
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from cvxlimit import (
    Block,
    GrowingAcceleration,
    Load,
    PointForce,
    Pressure,
    Reaction,
    Scene,
    Solution,
    Status,
    SupportMotion,
    Tie,
    Units,
    io,
)
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError
from cvxlimit.geometry.lumped import Lumped
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.io import (
    json_schema,
    result_from_dict,
    result_to_dict,
    scene_from_dict,
    scene_to_dict,
)
from cvxlimit.io.fields import laid_out
from cvxlimit.masonry import BUILTIN
from cvxlimit.solution import (
    FromRest,
    Iterate,
    Iteration,
    LowerEnd,
    Member,
    Search,
    Step,
    Trial,
)
from cvxlimit.solution.bracket import Bracket, Evidence, Reference
from cvxlimit.solution.kinematics import Dilatancy
from malformed_scenes import GOLDEN

# ------------------------------------------------- every field, away from its default

PAIR = ("b1", "b2")
WATER = Pressure(
    "b1", (0, 1, 0), 2.5, (0, 0, -3), (1, 1, 0.5), (0, 0, -1), ((0, 1, 0), (1, 1, 0), (0, 1, 1))
)
PUSH = GrowingAcceleration((1, 0.5, 0), (0, 0, 0.5), (0, 0, 2))
MOTION = SupportMotion(("ground",), (0, 0, -1), (0, 0.5, 0), (1, 0, 2))
PUSHED = Reaction("b1", (0, 0, 0.5), (1, 0, 0), 3.0, -1.5, "b2")
LOADED = Load(
    gravity=(0.0, 0.6, -0.8),
    acceleration=(0.1, 0.2, 0.3),
    forces={"b1": (1, 2, 3, 4, 5, 6)},
    points=[PointForce("b2", (0.5, 0.5, 2.0), (1, 2, 3))],
    pressures=[WATER],
    weights={"b2": (0, 0, -1.5)},
    growing=[PUSH],
)
TETRAHEDRON = Block.polyhedron(
    "b3", [(0, 0, 2), (1, 0, 2), (0, 1, 2), (0, 0, 3)],
    [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)], density=3.0,
)  # fmt: skip
GROUND = Block.box("ground", (-1, -1, -1), (2, 2, 0))
BLOCKS = (GROUND, *(Block.box(f"b{i}", (0, 0, i - 1), (1, 1, i), 1.0 + i) for i in (1, 2)))
BRICK = BLOCKS[1]

JOINTS: dict[str, Any] = {name: 0.25 + i for i, name in enumerate(PROPERTIES)} | {
    f"contact_{name}": {PAIR: 0.5 + i} for i, name in enumerate(PROPERTIES)
}
EVERY: dict[type, dict[str, Any]] = {
    Scene: {
        **JOINTS,
        "blocks": (*BLOCKS, TETRAHEDRON),
        "supports": ("ground",),
        "live": LOADED,
        "dead": Load(gravity=(0, 0, 1), forces={"b2": (6, 5, 4, 3, 2, 1)}),
        "units": Units("mm", "N"),
        "name": "every field",
        "joint_tolerance": 1e-3,
        "ties": (Tie("b1", "ground", (0, 0, 0.5), (0, 0, -0.5), 3.0),),
        "reactions": (PUSHED,),
        "settling": (MOTION,),
    },
    Reaction: {each.name: getattr(PUSHED, each.name) for each in fields(Reaction)},
    Load: {each.name: getattr(LOADED, each.name) for each in fields(Load)},
    Pressure: {each.name: getattr(WATER, each.name) for each in fields(Pressure)},
    GrowingAcceleration: {each.name: getattr(PUSH, each.name) for each in fields(PUSH)},
    SupportMotion: {each.name: getattr(MOTION, each.name) for each in fields(MOTION)},
    Units: {"length": "ft", "force": "lbf"},
    Iterate: {
        "load_factor": 0.1, "seconds": 0.2, "solver": "a", "status": "b", "lower": -0.3,
        "upper": 0.4, "change": 0.5, "equilibrium_residual": 0.6, "yield_excess": 0.7,
        "flow_violation": 0.8,
    },
    Bracket: {"lower": 0.1, "upper": 0.2, "lower_is_proved": True, "upper_is_proved": True,
              "least": 0.3},
}  # fmt: skip


def default_of(field: Field[Any]) -> Any:
    return field.default if field.default_factory is MISSING else field.default_factory()


def same(a: Any, b: Any) -> bool:
    """Equal, arrays and what has no equality of its own field by field."""
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b)
    if isinstance(
        a,
        Block | Load | Tie | Reaction | PointForce | Pressure | GrowingAcceleration
        | SupportMotion | Reference | Evidence,
    ):  # fmt: skip
        return type(a) is type(b) and all(
            same(getattr(a, each.name), getattr(b, each.name)) for each in fields(a)
        )
    if isinstance(a, Mapping):
        return isinstance(b, Mapping) and a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


def assert_same_fields(a: Any, b: Any, without: tuple[str, ...] = ()) -> None:
    for each in fields(a):
        if each.name not in without:
            assert same(getattr(a, each.name), getattr(b, each.name)), each.name


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_no_field_is_left_at_its_default(kind: type) -> None:
    """A new field fails here first: give it a value, then a place in the file."""
    for each in fields(kind):
        assert each.name in EVERY[kind], f"{each.name} of {kind.__name__} has no value yet"
        assert not same(EVERY[kind][each.name], default_of(each)), each.name


def scene(**changes: Any) -> Scene:
    return Scene(**{**EVERY[Scene], **changes})


def through_text(given: Scene) -> Scene:
    return scene_from_dict(json.loads(laid_out(scene_to_dict(given))))


def test_a_scene_comes_back_with_every_field() -> None:
    assert_same_fields(scene(), through_text(scene()))
    assert_same_fields(scene(), pickle.loads(pickle.dumps(scene())))


def test_boxes_and_meshes_with_and_without_density() -> None:
    for block in (GROUND, BRICK, TETRAHEDRON):
        back = through_text(scene()).blocks[[b.id for b in scene().blocks].index(block.id)]
        assert_same_fields(block, back)


@pytest.mark.parametrize("name", PROPERTIES)
@pytest.mark.parametrize("value", [0.0, 1e-9, 7.0, math.inf])
def test_what_differs_from_its_default_is_written(name: str, value: float) -> None:
    """Zero and infinity are values like others: they mean nothing by themselves."""
    given = scene()
    try:
        given = scene(**{name: value})
    except InputError:
        return  # no friction is infinite, no strength of stone is zero
    if value == math.inf and PROPERTIES[name].default != math.inf:
        with pytest.raises(InputError):
            scene_to_dict(given)
    else:
        assert getattr(through_text(given), name) == value


def test_one_contact_may_be_as_strong_as_no_scene_says() -> None:
    """Stones that crush, but for those of one contact."""
    own = {("b1", "b2"): math.inf}
    given = scene(compressive_strength=7.0, contact_compressive_strength=own)
    assert through_text(given).contact_compressive_strength == own
    document = scene_to_dict(given)
    document["friction"] = "inf"
    with pytest.raises(InputError, match="friction of the scene must be a number, got 'inf'"):
        scene_from_dict(document)


@pytest.mark.parametrize("name", [each.name for each in fields(Scene)])
def test_each_field_of_a_scene_is_in_its_file(name: str) -> None:
    """Nothing else of the file says it: with this field changed, the file is another one."""
    others: dict[str, Any] = {
        "blocks": (*BLOCKS, TETRAHEDRON.moved(np.eye(3), (0.0, 0.0, 1.0))),
        "supports": ("ground", "b3"),
        "live": Load(acceleration=(1, 0, 0)),
        "dead": Load(),
        "units": Units("m", "N"),
        "name": "other",
        "joint_tolerance": None,
        "ties": (),
        "reactions": (replace(PUSHED, most=math.inf, on=None),),
        "settling": (),
    }
    own = {each: {} if each.startswith("contact_") else 0.75 for each in JOINTS}
    changed = scene(**{name: {**others, **own}[name]})
    assert scene_to_dict(changed) != scene_to_dict(scene())
    assert_same_fields(changed, through_text(changed))


MEMBER = Member(0.1, "dense", 3, 1e-9, 2e-9, 3e-9, 4e-9, np.zeros((0, 6)), np.zeros((0, 6)))
SOLUTION = {
    "scene_name": "a", "surface": "conic", "interaction": "certified", "moments": "paper",
    "blocks": 1, "contacts": 1, "load_factor": 0.15, "bracket": Bracket(**EVERY[Bracket]),
    "status": Status.INTERRUPTED, "history": (Iterate(**EVERY[Iterate]),),
    "seconds": {"solve": 1.0}, "forces": np.arange(6.0).reshape(1, 6),
    "mechanism": {"b": np.arange(6.0)},
    "note": "so it is",
    "versions": {"cvxpy": "1.9"}, "torsion_shear": "exact", "flow": "zero-dilatancy",
    "members": (MEMBER,), "searches": (Search(3, 0.4, 300, 120), Search(4, None, 300, 0)),
    "iteration": Iteration(None, None, 0.1, 0.3, 20),
    "lower_end": LowerEnd(
        0.1, Bracket(**EVERY[Bracket]), np.ones((1, 6)), {"b": np.arange(6.0)},
        Reference(0.11, np.ones((1, 6))),
    ),
    "reference": Reference(0.16, np.arange(4.0), np.arange(12.0).reshape(2, 6)),
    "beside": {
        "points": Evidence(
            0.2, np.ones((1, 6)), np.arange(12.0).reshape(2, 6), np.arange(5.0),
            Reference(0.2, np.arange(5.0)), np.array([2]), np.array([0]), 0.3,
        )
    },
    "dilatancy": Dilatancy(0.5, ("a-b",), 2), "model": ("planar",), "quantity": "reaction",
    "contact_names": ("a-b",), "units": Units("cm", "N"), "internal": np.arange(3.0),
    "scene_digest": "ab12", "tolerance": 0.02,
    "lumped": Lumped(8, 2, 0.02, 0.5, "a-b", 0.01, 0.5),
    "from_rest": FromRest(
        "level", 0.21, None, (Step(0.5, 0.1, 1, 2, 1e-12, 0.0, 1e-9),),
        (Trial("ratio 1", None, "lost"),), 3.0, (Trial("seed 0", 0.2, "level"),),
    ),
}  # fmt: skip
NOT_IN_FILES = {"solved_scene", "surfaces"}
"""Of a solution: they live in memory and pickles only; files have their names."""


def test_a_result_comes_back_with_every_field() -> None:
    for each in fields(Solution):
        if each.name not in NOT_IN_FILES:
            assert each.name in SOLUTION, f"{each.name} of Solution has no value yet"
            assert each.name in ("forces", "mechanism") or not same(
                SOLUTION[each.name], default_of(each)
            )
    given = Solution(**SOLUTION)  # type: ignore[arg-type]
    back = result_from_dict(json.loads(laid_out(result_to_dict(given))))
    assert_same_fields(given, back, (*NOT_IN_FILES, "members", "mechanism", "lower_end"))
    assert given.lower_end is not None
    assert_same_fields(given.lower_end, back.lower_end, ("mechanism",))
    assert_same_fields(given.members[0], back.members[0])
    assert back.mechanism is not None
    assert back.mechanism["b"].tolist() == [0, 1, 2, 3, 4, 5]
    assert back.lower_end is not None
    assert back.lower_end.mechanism is not None
    assert back.lower_end.mechanism["b"].tolist() == [0, 1, 2, 3, 4, 5]


# ------------------------------------------------- the schema

SCENES = Draft202012Validator(json_schema("scene"))
RESULTS = Draft202012Validator(json_schema("result"))


@pytest.mark.parametrize("name", BUILTIN)
def test_files_of_builtin_scenes_follow_the_schema(name: str) -> None:
    SCENES.validate(json.loads(json.dumps(scene_to_dict(BUILTIN[name]()))))


def test_files_with_every_field_follow_the_schema() -> None:
    Draft202012Validator.check_schema(json_schema("scene"))
    Draft202012Validator.check_schema(json_schema("result"))
    SCENES.validate(scene_to_dict(scene()))
    SCENES.validate(json.loads(GOLDEN))
    RESULTS.validate(result_to_dict(Solution(**SOLUTION)))  # type: ignore[arg-type]


def entries(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    keys = (
        value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    )
    return [place for key in keys for place in [(*at, key), *entries(value[key], (*at, key))]]


@pytest.mark.parametrize("stranger", [None, True, [], {}, "x"], ids=repr)
@pytest.mark.exhaustive_cases("{}", "'x'", "None")
def test_the_schema_refuses_only_what_reading_refuses(stranger: Any) -> None:
    """Every entry replaced by what is not its kind: an editor must not cry at a good file."""
    refused = 0
    whole = scene_to_dict(scene())
    for at in entries(whole):
        document = copy.deepcopy(whole)
        inner: Any = document
        for key in at[:-1]:
            inner = inner[key]
        inner[at[-1]] = stranger
        if not SCENES.is_valid(document):
            refused += 1
            with pytest.raises(InputError):
                scene_from_dict(document)
    assert refused > 50


def test_an_unknown_key_and_a_missing_one_are_refused_by_the_schema() -> None:
    whole = scene_to_dict(scene())
    for key in ("blocks", "supports", "friction", "loads", "format", "version"):
        assert not SCENES.is_valid({k: x for k, x in whole.items() if k != key})
    assert not SCENES.is_valid({**whole, "frction": 1.0})


def test_a_file_may_name_its_schema() -> None:
    whole = {"$schema": "scene.schema.json", **scene_to_dict(scene())}
    SCENES.validate(whole)
    assert_same_fields(scene(), scene_from_dict(whole))


def test_the_command_line_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["scenes", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(json_schema("scene")))


def test_another_kind_is_refused() -> None:
    with pytest.raises(InputError, match="kind must be one of 'scene', 'result'"):
        json_schema("wall")


@pytest.mark.parametrize("proved", [[[]], [{}], ["middle"], "lower", [None]])
def test_what_bounds_rest_on_is_checked(proved: Any, tmp_path: Path) -> None:
    document = result_to_dict(Solution(**SOLUTION))  # type: ignore[arg-type]
    document["bracket"] = {"proved": proved, "least": 0.0}
    file = tmp_path / "result.json"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"result\.json: .*proved of bracket"):
        io.read_result(file)
