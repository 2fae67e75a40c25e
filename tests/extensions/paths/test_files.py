"""Path files: what is read is what was written, and hostile ones are refused."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from cvxlimit import Path as Displacements
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths.configuration import Points
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.path import Work
from cvxlimit.io import json_schema, read_path, write_path
from cvxlimit.solution.bracket import Bracket
from turning import turning, wall

FORMAT = Draft202012Validator(json_schema("path"))


@pytest.fixture(scope="module")
def path() -> Displacements:
    """Every field differs from its default."""
    found = turning(wall(2), (0.0, 0.05, 0.1))
    rng = np.random.default_rng(3)
    points = Points(
        np.array([0, 1, 0]), np.array([1, 2, 2]), rng.normal(size=(3, 3)),
        rng.normal(size=(3, 3, 3)), rng.normal(size=3), rng.normal(size=(3, 2)), rng.random(3),
    )  # fmt: skip
    whole = replace(
        found[1], points=points, forces=rng.normal(size=(3, 3)), widest_gap=1e-9, residual=1e-12,
        bracket=Bracket(0.1, np.inf, True, False, 1e-6), iterates=5,
    )  # fmt: skip
    return replace(
        found, configurations=(found[0], whole, found[2]), status="steps", reason="enough",
        flow="zero-dilatancy", step=0.05, snaps=(found[1].w,), work=Work(1.25, 1.5), slides=True,
        control=("c1", (1.0, 0.0, 0.5)), notes=("one", "two"), halved=replace(
            found, configurations=(found[0], whole), status="interrupted", reason="broken off",
            flow="zero-dilatancy", step=0.025, snaps=(found[0].w,), work=Work(0.25, 0.5),
            slides=True, control=("c1", (1.0, 0.0, 0.5)), notes=("three",),
        ),
    )  # fmt: skip


def same(one: Any, other: Any) -> bool:
    if hasattr(one, "__dataclass_fields__"):
        names = [name for name in one.__dataclass_fields__ if name not in ("start", "initial")]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return bool(np.array_equal(one, other)) if isinstance(one, np.ndarray) else bool(one == other)


def test_what_is_read_is_what_was_written(path: Displacements, tmp_path: Path) -> None:
    path.save(tmp_path / "path.json")
    back = read_path(tmp_path / "path.json")
    assert same(path, back)
    assert back.initial.load_factor == path.initial.load_factor
    assert back.initial.scene is back.scene
    assert [b.id for b in back.scene.blocks] == [b.id for b in path.scene.blocks]
    assert back.pieces == ((0, 2), (2, 3))
    for one, other in zip(path[2].scene().blocks, back[2].scene().blocks, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
    write_path(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_text() == (tmp_path / "path.json").read_text()


def test_the_schema_describes_the_file(path: Displacements) -> None:
    Draft202012Validator.check_schema(json_schema("path"))
    whole = json.loads(json.dumps(PATH.to_dict(path)))
    FORMAT.validate(whole)
    assert not FORMAT.is_valid({k: x for k, x in whole.items() if k != "scene"})


INSIDE = ("scene",), ("initial",)
"""Documents of their own, whose entries have tests of their own."""


def places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Of every entry, but of one row alone where many are alike."""
    keys = list(value) if isinstance(value, dict) else range(min(len(value), 1)) if isinstance(
        value, list) else ()  # fmt: skip
    return [place for key in keys for place in [(*at, key), *places(value[key], (*at, key))]]


def reading(document: Any) -> str:
    """Why it is refused; nothing, if it is not."""
    try:
        PATH.from_dict(document)
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("stranger", [None, True, [], {}, "x", 1e400, -1], ids=repr)
def test_whatever_stands_in_an_entry_is_read_or_refused_in_a_sentence(
    path: Displacements, stranger: Any
) -> None:
    whole = PATH.to_dict(path)
    whole["configurations"] = whole["configurations"][1:]  # type: ignore[index]
    refused = 0
    for at in (place for place in places(whole) if place[:1] not in INSIDE or len(place) == 1):
        document = copy.deepcopy(whole)
        inner: Any = document
        for key in at[:-1]:
            inner = inner[key]
        inner[at[-1]] = stranger
        said = reading(document)
        refused += bool(said)
        assert len(said.splitlines()) <= 1
        assert said or FORMAT.is_valid(json.loads(json.dumps(document)))
    assert refused > 20


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.update(configurations=[]), "configurations must be one at least"),
        (lambda d: d["configurations"][1]["points"][0].__setitem__(0, 7), "two of the blocks"),
        (lambda d: d["configurations"][1]["points"][0].__setitem__(0, 0.5), "numbers of blocks"),
        (lambda d: d["configurations"][1]["points"][0].pop(), "must be 21 numbers"),
        (lambda d: d["configurations"][2]["displacements"].pop("c1"), "'c1' is in one of both"),
        (lambda d: d["control"].update(block="ground"), "must be a free block, got 'ground'"),
        (lambda d: d["control"].update(direction=[1, 0]), "direction of control must be 3 numbers"),
        (lambda d: d["halved"].update(configurations=[]), "halved: configurations must be one"),
        (lambda d: d["halved"].update(snaps=[0.5]), "halved: .* the w of a configuration, got 0.5"),
        (lambda d: d["halved"].update(halved=None), "unknown key 'halved'"),
        (lambda d: d.update(snaps=[0.5]), "the w of a configuration, got 0.5"),
        (lambda d: d.update(format="cvxlimit-result"), "this is not a path file"),
        (lambda d: d.update(version=2), "install a newer cvxlimit"),
        (lambda d: d["scene"].update(supports=["ground", "c0"]), "'c0' is in one of both"),
        (lambda d: d["initial"].update(contacts=9), "one for each contact"),
    ],
)  # fmt: skip
def test_parts_that_do_not_belong_together_are_refused(
    path: Displacements, tmp_path: Path, change: Any, said: str
) -> None:
    document = json.loads(json.dumps(PATH.to_dict(path)))
    change(document)
    file = tmp_path / "path.json"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=f"path.json: .*{said}"):
        read_path(file)


def test_what_is_no_path_is_not_written(path: Displacements, tmp_path: Path) -> None:
    file = tmp_path / "path.json"
    with pytest.raises(InputError, match=r"path must be a Path, got .*pushover\(scene\) makes one"):
        write_path(path.initial, file)  # type: ignore[arg-type]
    assert not file.exists()
