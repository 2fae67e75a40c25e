"""Scene and result files: lossless both ways, strict in reading, atomic in writing."""

from __future__ import annotations

import copy
import json
import math
import os
import re
import stat
import warnings
from dataclasses import fields, replace
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from cvxlimit.base.lines import one_line
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.io import (
    read_result,
    read_scene,
    result_from_dict,
    result_to_dict,
    scene_from_dict,
    scene_to_dict,
    write_result,
    write_scene,
)
from cvxlimit.io.fields import laid_out
from cvxlimit.scene import Load, Scene, Units
from cvxlimit.solution import Iterate, Solution, Status
from cvxlimit.solution.bracket import Bracket
from malformed_scenes import GOLDEN, MALFORMED


def assert_one_clear_line(message: str) -> None:
    assert message.isprintable(), message
    assert len(message) < 1100, message


def refusal(text: str | bytes, folder: Path) -> str:
    """Message with which a file of this content is refused, after the file's name."""
    file = folder / "scene.json"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        read_scene(file)
    message = str(caught.value)
    assert_one_clear_line(message)
    assert message.startswith(f"{file}: ")
    return message.removeprefix(f"{file}: ")


def same_bits(a: Any, b: Any) -> bool:
    if a is None or b is None:
        return a is b
    first, second = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return first.shape == second.shape and first.tobytes() == second.tobytes()


def assert_same_load(a: Load, b: Load) -> None:
    assert same_bits(a.gravity, b.gravity)
    assert same_bits(a.acceleration, b.acceleration)
    assert list(a.forces) == list(b.forces)
    assert all(same_bits(a.forces[k], b.forces[k]) for k in a.forces)


def assert_same_scene(a: Scene, b: Scene) -> None:
    for one, other in zip(a.blocks, b.blocks, strict=True):
        assert (one.id, one.faces) == (other.id, other.faces)
        assert same_bits(one.bounds, other.bounds)
        assert same_bits(one.density, other.density)
        assert same_bits(one.vertices, other.vertices)
        assert same_bits(one.volume, other.volume)
        assert same_bits(one.centroid, other.centroid)
    assert (a.supports, a.units, a.name) == (b.supports, b.units, b.name)
    assert same_bits(a.friction, b.friction)
    assert a.contact_friction == b.contact_friction
    assert_same_load(a.dead, b.dead)
    assert_same_load(a.live, b.live)


# ---------------------------------------------------------------- random scenes and results

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
IDS = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=12)
NUMBERS = st.floats(-1e29, 1e29)
DENSITY = st.just(0.0) | st.floats(1e-3, 1e3)
EDGES = st.floats(0.01, 10.0)
FRICTION = st.floats(0.0, 1e3)
DIRECTIONS = st.sampled_from([(0.0, 0.0, -1.0), (-0.0, 0.6, -0.8), (1 / math.sqrt(2),) * 2 + (0,)])


@st.composite
def shapes(draw: st.DrawFn, id: str, density: float | None) -> Block:
    low = np.array(draw(st.tuples(*[st.floats(-1e3, 1e3)] * 3)))
    box = Block.box(id, low, low + draw(st.tuples(*[EDGES] * 3)), density)
    kind = draw(st.sampled_from(["box", "turned", "tapered"]))
    if kind == "turned":
        x, y, z, w = np.array(draw(st.tuples(*[st.floats(0.1, 1.0)] * 4)))
        square = x * x + y * y + z * z + w * w
        q = np.array([x, y, z])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = np.eye(3) + 2 * (w * cross + np.outer(q, q) - (q @ q) * np.eye(3)) / square
        # a moved block keeps its turned centroid; a read one computes it: give points instead
        return Block.polyhedron(id, box.vertices @ turn.T, box.faces, density)
    if kind == "tapered":
        corners = np.array(box.vertices)
        middle = corners[4:].mean(axis=0)
        corners[4:] = middle + draw(st.floats(0.2, 1.0)) * (corners[4:] - middle)
        return Block.polyhedron(id, corners, box.faces, density)
    return box


@st.composite
def load_cases(draw: st.DrawFn, ids: list[str], live: bool) -> Load:
    sixes = st.tuples(*[NUMBERS] * 6)
    forces = draw(st.dictionaries(st.sampled_from(ids), sixes, max_size=3))
    if live:
        forces[ids[0]] = (1.0, *draw(st.tuples(*[NUMBERS] * 5)))
    return Load(draw(st.none() | DIRECTIONS), draw(st.none() | st.tuples(*[NUMBERS] * 3)), forces)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    ids = draw(st.lists(IDS, min_size=2, max_size=5, unique=True))
    free, fixed = ids[:-1], ids[-1:]
    blocks = [draw(shapes(name, draw(DENSITY))) for name in free]
    blocks += [draw(shapes(name, draw(st.none() | DENSITY))) for name in fixed]
    pairs = [(a, b) for a in ids for b in ids if a < b]
    return Scene(
        blocks=tuple(blocks),
        supports=tuple(fixed),
        live=draw(load_cases(free, live=True)),
        dead=draw(load_cases(free, live=False)),
        friction=draw(FRICTION),
        contact_friction=draw(st.dictionaries(st.sampled_from(pairs), FRICTION, max_size=3)),
        units=Units(draw(TEXTS), draw(TEXTS)),
        name=draw(TEXTS),
    )


FINITE = st.floats(allow_nan=False, allow_infinity=False)
SIZE = FINITE.map(abs)
OPTIONAL = st.none() | st.floats(allow_nan=False)
LOWER = st.floats(max_value=1e300) | st.just(math.inf)
ITERATES = st.builds(
    Iterate, OPTIONAL, FINITE, TEXTS, TEXTS, OPTIONAL, OPTIONAL, OPTIONAL, OPTIONAL, OPTIONAL
)


@st.composite
def solutions(draw: st.DrawFn) -> Solution:
    contacts = draw(st.integers(0, 4))
    forces = [draw(st.tuples(*[FINITE] * 6)) for _ in range(contacts)]
    rates = st.tuples(*[FINITE] * 6).map(np.array)
    return Solution(
        scene_name=draw(TEXTS),
        surface=draw(st.sampled_from(["conic", "octagon", "16-gon"])),
        interaction="none",
        moments="signed",
        blocks=draw(st.integers(0, 10**6)),
        contacts=contacts,
        load_factor=draw(st.none() | FINITE),
        bracket=draw(st.builds(Bracket, LOWER, LOWER, st.booleans(), st.booleans(), SIZE)),
        status=draw(st.sampled_from(list(Status))),
        history=tuple(draw(st.lists(ITERATES, max_size=4))),
        seconds=draw(st.dictionaries(TEXTS, FINITE, max_size=4)),
        forces=draw(st.sampled_from([None, np.array(forces).reshape(-1, 6)])),
        mechanism=draw(st.none() | st.dictionaries(TEXTS, rates, max_size=4)),
        note=draw(TEXTS),
        versions=draw(st.dictionaries(TEXTS, TEXTS, max_size=3)),
    )


def assert_same_solution(a: Solution, b: Solution) -> None:
    for each in fields(Solution):
        if each.name not in ("forces", "mechanism", "versions", "solved_scene"):
            one, other = getattr(a, each.name), getattr(b, each.name)
            assert repr(one) == repr(other), each.name  # tells -0.0 from 0.0, and nan is nan
    assert same_bits(a.forces, b.forces)
    assert (a.mechanism is None) == (b.mechanism is None)
    first, second = dict(a.mechanism or {}), dict(b.mechanism or {})
    assert list(first) == list(second)
    assert all(same_bits(first[k], second[k]) for k in first)
    assert isinstance(b.status, Status)
    assert dict(a.versions) == dict(b.versions)


def a_solution(**changes: Any) -> Solution:
    solution = Solution(
        scene_name="tower", surface="conic", interaction="none", moments="signed", blocks=1,
        contacts=1, load_factor=0.25, bracket=Bracket(0.2499, 0.25), status=Status.CERTIFIED,
        history=(Iterate(0.25, 0.01, "CLARABEL", "optimal", upper=math.inf),),
        seconds={"detect": 0.1, "compile": 0.2, "solve": 0.3, "total": 0.6},
        forces=np.array([[0.0, 1.0, 80.0, -0.0, 1e-300, 0.1]]),
        mechanism={"tower": np.array([1 / 3, 0, 0, 0, -0.0, 2.0])},
    )  # fmt: skip
    return replace(solution, **changes)


# ---------------------------------------------------------------- scenes: round trips


class TestSceneRoundTrip:
    @pytest.mark.exhaustive
    @given(scenes())
    def test_through_text_is_lossless(self, scene: Scene) -> None:
        assert_same_scene(scene, scene_from_dict(json.loads(laid_out(scene_to_dict(scene)))))

    @pytest.mark.exhaustive
    @given(scenes())
    def test_writing_is_stable(self, scene: Scene) -> None:
        document = scene_to_dict(scene)
        assert scene_to_dict(scene_from_dict(copy.deepcopy(document))) == document

    def test_through_file(self, tmp_path: Path) -> None:
        scene = scene_from_dict(json.loads(GOLDEN)).with_name("Stütze\n\x1b[31m")
        write_scene(scene, tmp_path / "a.json")
        assert_same_scene(scene, read_scene(tmp_path / "a.json"))
        write_scene(scene, str(tmp_path / "b.json"))
        assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
        assert "Stütze" in (tmp_path / "a.json").read_text(encoding="utf-8")

    def test_moved_scene_keeps_vertices(self) -> None:
        turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
        scene = scene_from_dict(json.loads(GOLDEN)).moved(turn, (0.1, 0.2, 0.3))
        back = scene_from_dict(scene_to_dict(scene))
        for one, other in zip(scene.blocks, back.blocks, strict=True):
            assert same_bits(one.vertices, other.vertices)
            assert one.faces == other.faces
            assert np.allclose(one.centroid, other.centroid, rtol=0, atol=1e-14)

    def test_rescaled_boxes_keep_their_corners(self) -> None:
        scene = scene_from_dict(json.loads(GOLDEN)).in_units(Units("inch", "lbf"), 39.37, 224.8)
        back = scene_from_dict(scene_to_dict(scene))
        for one, other in zip(scene.blocks, back.blocks, strict=True):
            assert same_bits(one.bounds, other.bounds)
            assert same_bits(one.density, other.density)
        assert_same_load(scene.live, back.live)
        assert back.units == Units("inch", "lbf")

    def test_golden(self, tmp_path: Path) -> None:
        file = tmp_path / "golden.json"
        file.write_text(GOLDEN, encoding="utf-8")
        scene = read_scene(file)
        assert [b.id for b in scene.blocks] == ["b1", "b2", "ground"]
        assert scene.blocks[0].weight == 2.5
        assert scene.blocks[0].bounds is not None
        assert scene.blocks[1].bounds is None
        assert scene.blocks[2].density is None
        assert (scene.name, scene.units, scene.supports) == ("example", Units(), ("ground",))
        assert (scene.friction, dict(scene.contact_friction)) == (0.7, {("b1", "b2"): 0.5})
        assert scene.dead == Load(gravity=(0, 0, -1))
        assert scene.live.acceleration == (0.0, 1.0, 0.0)
        assert dict(scene.live.forces) == {"b1": (0.5, 0.0, 0.0, 0.0, 0.25, 0.0)}
        assert sorted(scene.contacts.friction) == [0.5, 0.7]
        assert scene_to_dict(scene) == json.loads(GOLDEN)

    def test_box_stays_box(self) -> None:
        document = scene_to_dict(scene_from_dict(json.loads(GOLDEN)))
        assert [set(b) for b in document["blocks"]] == [  # type: ignore[attr-defined]
            {"id", "box", "density"}, {"id", "vertices", "faces", "density"}, {"id", "box"},
        ]  # fmt: skip

    def test_defaults(self) -> None:
        document = json.loads(GOLDEN)
        for key in ("name", "units", "contacts"):
            del document[key]
        scene = scene_from_dict(document)
        assert (scene.name, scene.units, dict(scene.contact_friction)) == ("scene", Units(), {})

    def test_empty_dead_load_is_no_dead_load(self) -> None:
        document = json.loads(GOLDEN)
        document["loads"]["dead"] = {}
        assert not scene_from_dict(document).dead_forces.any()

    def test_byte_order_mark_is_allowed(self, tmp_path: Path) -> None:
        file = tmp_path / "bom.json"
        file.write_bytes(b"\xef\xbb\xbf" + GOLDEN.encode())
        assert read_scene(file).name == "example"

    def test_document_is_not_changed_nor_shared(self) -> None:
        document = json.loads(GOLDEN)
        scene = scene_from_dict(document)
        assert document == json.loads(GOLDEN)
        document["blocks"][1]["vertices"][0][0] = 99.0
        assert scene.blocks[1].vertices[0, 0] == 0.0

    def test_one_block_per_line(self) -> None:
        lines = laid_out(scene_to_dict(scene_from_dict(json.loads(GOLDEN)))).splitlines()
        assert sum('{"id": ' in line for line in lines) == 3
        assert all(line.count('"id"') <= 1 for line in lines)


# ---------------------------------------------------------------- scenes: refusals


class TestMalformedScene:
    @pytest.mark.parametrize("name", MALFORMED)
    def test_refused_in_one_clear_line(self, name: str, tmp_path: Path) -> None:
        text, phrase = MALFORMED[name]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert phrase in refusal(text, tmp_path)

    def test_missing_file(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match=r"nowhere\.json: there is no such file"):
            read_scene(tmp_path / "nowhere.json")

    def test_folder(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="this is a folder"):
            read_scene(tmp_path)

    def test_no_sentence_loses_its_middle(self) -> None:
        """Names of any length do; what is long beyond reason loses its end."""
        known = "met the criterion after 60 solves, at 0.13040"
        sentence = f"{' '.join(['joint-a'] * 30)}; {known}; {' '.join(['joint-b'] * 30)}"
        assert one_line(sentence) == sentence
        assert known in one_line(f"{known} {'x' * 5000} and more")
        assert one_line(f"{known} {'name ' * 5000}").startswith(known)

    def test_odd_paths_stay_on_one_line(self, tmp_path: Path) -> None:
        for name in ("a\nb.json", "a\0b", "x" * 5000, "\x1b[31m"):
            with pytest.raises(InputError) as caught:
                read_scene(str(tmp_path / name))
            assert_one_clear_line(str(caught.value))

    @pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root reads all")
    def test_no_permission(self, tmp_path: Path) -> None:
        file = tmp_path / "locked.json"
        file.write_text(GOLDEN)
        file.chmod(0)
        with pytest.raises(InputError, match="cannot be read: Permission denied"):
            read_scene(file)

    def test_too_large(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("cvxlimit.io.fields.LARGEST_FILE", len(GOLDEN))
        file = tmp_path / "scene.json"
        file.write_text(GOLDEN)
        assert read_scene(file).name == "example"
        assert "larger than" in refusal(GOLDEN + " ", tmp_path)

    @pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="no such device")
    def test_endless_file(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("cvxlimit.io.fields.LARGEST_FILE", 2**20)
        with pytest.raises(InputError, match="larger than 1 MiB"):
            read_scene("/dev/zero")

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
    def test_a_pipe_that_another_program_fills(self, tmp_path: Path) -> None:
        pipe = tmp_path / "pipe.json"
        os.mkfifo(pipe)
        writer = Thread(target=pipe.write_text, args=(GOLDEN,))
        writer.start()
        assert read_scene(pipe).name == "example"
        writer.join()

    @pytest.mark.parametrize("junk", [None, 3, "x", [], {1: 2}, {"format": 1}, {None: None}])
    def test_junk_instead_of_a_document(self, junk: object) -> None:
        with pytest.raises(InputError):
            scene_from_dict(junk)

    def test_long_values_are_cut(self, tmp_path: Path) -> None:
        document = json.loads(GOLDEN)
        document["friction"] = "x" * 100_000
        document_2 = copy.deepcopy(document) | {"friction": 0.7, "supports": ["x" * 100_000]}
        for text in (json.dumps(document), json.dumps(document_2), '{"' + "k" * 10**5 + '": 1}'):
            refusal(text, tmp_path)

    def test_ids_are_only_names(self, tmp_path: Path) -> None:
        odd = [
            "../../etc/passwd",
            "/dev/null",
            "C:\\x",
            "%s{0}",
            "a\n\r\u2028b",
            "\x00",
            " ",
            "b1#2",
        ]
        blocks = [Block.box(name, (i, 0, 0), (i + 1, 1, 1), 1.0) for i, name in enumerate(odd)]
        scene = Scene(tuple(blocks), tuple(odd[:1]), Load(acceleration=(1, 0, 0)))
        file = tmp_path / "odd.json"
        write_scene(scene, file)
        assert_same_scene(scene, read_scene(file))
        assert os.listdir(tmp_path) == ["odd.json"]

    def test_odd_ids_in_messages(self) -> None:
        for name in ("a\nb", "\x1b[2J", "\u2028", "\u202e"):
            document = json.loads(GOLDEN)
            document["blocks"][0] |= {"id": name, "density": -1}
            with pytest.raises(InputError) as caught:
                scene_from_dict(document)
            assert_one_clear_line(str(caught.value))


JUNK: list[Any] = [
    None, True, False, "", "x", "1.0", "b1", "\n", "\ud800", -1, 0, 1, 7, -0.0, 0.5, 1e-320, 1e29,
    1e31, -1e308, float("inf"), float("nan"), 10**20, 10**400, -(10**400), 10**5000, [], {}, [[]],
    [[[]]], [0, 0, 0], [1] * 6, ["b1", "b2"], {"b1": [0] * 6}, {"id": "b1"}, {"": None}, (), b"x",
    1j, object(), {1: 2}, {None: 1},
]  # fmt: skip
ODD_KEYS: list[Any] = ["", "id", "box", "x\ny", "friction", "forces", "\ud800", 1, None, (1, 2)]


def places(node: Any) -> list[tuple[Any, Any]]:
    """All (container, key) of a document."""
    keys = node if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    result = [(node, key) for key in keys]
    return result + [place for key in keys for place in places(node[key])]


def mutate(document: Any, data: st.DataObject, junk: list[Any]) -> None:
    container, key = data.draw(st.sampled_from(places(document)))
    action = data.draw(st.sampled_from(["replace", "replace", "delete", "add", "copy"]))
    value = copy.deepcopy(data.draw(st.sampled_from(junk)))
    if action == "replace":
        container[key] = value
    elif action == "delete":
        del container[key]
    elif action == "copy":
        source, at = data.draw(st.sampled_from(places(document)))
        container[key] = copy.deepcopy(source[at])
    elif isinstance(container, dict):
        container[data.draw(st.sampled_from(ODD_KEYS))] = value
    else:
        container.insert(key, value)


class TestFuzz:
    """Whatever comes in, an object or a one-line InputError comes out, without a warning."""

    @given(st.data())
    def test_mutated_scene(self, data: st.DataObject) -> None:
        document = json.loads(GOLDEN)
        for _ in range(data.draw(st.integers(1, 3))):
            if places(document):
                mutate(document, data, JUNK)
        self.check(lambda: scene_from_dict(document), Scene, scene_to_dict)

    @given(st.data())
    def test_mutated_result(self, data: st.DataObject) -> None:
        document = json.loads(laid_out(result_to_dict(a_solution(note="so it is"))))
        for _ in range(data.draw(st.integers(1, 3))):
            if places(document):
                mutate(document, data, [*JUNK, "inf", "nan"])
        self.check(lambda: result_from_dict(document), Solution, result_to_dict)

    @given(
        cut=st.integers(0, len(GOLDEN)),
        drop=st.integers(0, 8),
        put=st.binary(max_size=8) | st.sampled_from([b"1e999", b"NaN", b"null", b'"', b"[", b"}"]),
    )
    def test_mutated_bytes(self, cut: int, drop: int, put: bytes, tmp_path_factory: Any) -> None:
        file = tmp_path_factory.getbasetemp() / "fuzz.json"
        content = GOLDEN.encode()
        file.write_bytes(content[:cut] + put + content[cut + drop :])
        self.check(lambda: read_scene(file), Scene, scene_to_dict)

    @staticmethod
    def check(read: Any, kind: type, to_dict: Any) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                found = read()
            except InputError as error:
                assert_one_clear_line(str(error))
                return
        assert isinstance(found, kind)
        laid_out(to_dict(found))  # what was read can be written


# ---------------------------------------------------------------- writing


class TestWriting:
    def scene(self) -> Scene:
        return scene_from_dict(json.loads(GOLDEN))

    def failing(self, *_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    @pytest.mark.parametrize("step", ["fsync", "replace"])
    def test_failing_write_leaves_the_old_file(
        self, step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        file = tmp_path / "scene.json"
        file.write_text("old")
        monkeypatch.setattr(os, step, self.failing)
        with pytest.raises(InputError, match=r"scene\.json: .*No space left on device"):
            write_scene(self.scene(), file)
        assert file.read_text() == "old"
        assert os.listdir(tmp_path) == ["scene.json"]

    def test_interrupted_write_leaves_the_old_file(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def interrupted(_: object) -> None:
            raise KeyboardInterrupt

        file = tmp_path / "scene.json"
        file.write_text("old")
        monkeypatch.setattr(os, "fsync", interrupted)
        with pytest.raises(KeyboardInterrupt):
            write_scene(self.scene(), file)
        assert file.read_text() == "old"
        assert os.listdir(tmp_path) == ["scene.json"]

    def test_what_cannot_be_written_touches_nothing(self, tmp_path: Path) -> None:
        file = tmp_path / "scene.json"
        file.write_text("old")
        for scene in (
            self.scene().with_name("\ud800"),
            replace(self.scene(), units=Units("m", "\ud800")),
            self.scene().with_friction(1e31),
            replace(self.scene(), blocks=(*self.scene().blocks[:2], huge_ground())),
        ):
            with pytest.raises(InputError) as caught:
                write_scene(scene, file)
            assert_one_clear_line(str(caught.value))
        assert file.read_text() == "old"
        assert os.listdir(tmp_path) == ["scene.json"]

    def test_no_such_folder(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="cannot be written: No such file or directory"):
            write_scene(self.scene(), tmp_path / "missing" / "scene.json")

    def test_onto_a_folder(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="cannot be written: Is a directory"):
            write_scene(self.scene(), tmp_path)
        assert os.listdir(tmp_path) == []

    def test_links_and_permissions_are_kept(self, tmp_path: Path) -> None:
        file, link = tmp_path / "scene.json", tmp_path / "link.json"
        file.write_text("old")
        file.chmod(0o640)
        link.symlink_to(file)
        write_scene(self.scene(), link)
        assert link.is_symlink()
        assert stat.S_IMODE(file.stat().st_mode) == 0o640
        assert_same_scene(self.scene(), read_scene(file))

    def test_new_file_has_usual_permissions(self, tmp_path: Path) -> None:
        (tmp_path / "usual").touch()
        write_scene(self.scene(), tmp_path / "scene.json")
        assert (tmp_path / "scene.json").stat().st_mode == (tmp_path / "usual").stat().st_mode

    @pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
    def test_pipes_are_written_to(self, tmp_path: Path) -> None:
        pipe = tmp_path / "pipe"
        os.mkfifo(pipe)
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        try:
            write_scene(self.scene(), pipe)
            received = os.read(reader, 100_000)
        finally:
            os.close(reader)
        assert_same_scene(self.scene(), scene_from_dict(json.loads(received)))
        assert stat.S_ISFIFO(pipe.stat().st_mode)

    def test_into_the_current_folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        write_scene(self.scene(), "scene.json")
        assert os.listdir(tmp_path) == ["scene.json"]


def huge_ground() -> Block:
    return Block.box("ground", (-1e40, -1e40, -1e40), (1e40, 1e40, 0.0))


# ---------------------------------------------------------------- results

KEYS = [
    "format", "version", "scene", "surface", "interaction", "moments", "blocks", "contacts",
    "load_factor", "lower", "upper", "status", "history", "seconds", "forces", "mechanism",
]  # fmt: skip


class TestResult:
    @given(solutions())
    def test_round_trip_is_lossless(self, solution: Solution) -> None:
        is_free = solution.load_factor is None and solution.upper == np.inf
        assume(solution.status.has_answer or is_free)  # else reading refuses it
        text = laid_out(result_to_dict(solution))
        assert not re.search(r"\b(NaN|Infinity)\b", re.sub(r'"(\\.|[^"\\])*"', '""', text))
        assert_same_solution(solution, result_from_dict(json.loads(text)))

    def test_through_file(self, tmp_path: Path) -> None:
        write_result(a_solution(), tmp_path / "r.json")
        assert_same_solution(a_solution(), read_result(tmp_path / "r.json"))

    def test_golden(self) -> None:
        document = json.loads(laid_out(result_to_dict(a_solution())))
        assert list(document) == KEYS
        assert (document["format"], document["version"]) == ("cvxlimit-result", 1)
        assert document["status"] == "certified"
        assert document["history"] == [
            {"load_factor": 0.25, "seconds": 0.01, "solver": "CLARABEL", "status": "optimal",
             "upper": None}
        ]  # fmt: skip
        assert document["forces"] == [[0.0, 1.0, 80.0, -0.0, 1e-300, 0.1]]
        assert document["mechanism"] == {"tower": [1 / 3, 0.0, 0.0, 0.0, -0.0, 2.0]}

    def test_note_only_where_there_is_one(self) -> None:
        assert list(result_to_dict(a_solution(note="why"))) == [*KEYS, "note"]

    def test_versions_are_an_addition(self) -> None:
        """Files written before there were any are read; what is no text is refused by name."""
        assert result_from_dict(result_to_dict(a_solution())).versions == {}
        document = result_to_dict(a_solution(versions={"cvxpy": "1.9.3"}))
        assert list(document) == [*KEYS, "versions"]
        with pytest.raises(InputError, match="version of 'cvxpy' must be a text in quotes, got 1"):
            result_from_dict({**document, "versions": {"cvxpy": 1}})

    def test_missing_bounds_are_null(self) -> None:
        solution = a_solution(bracket=Bracket(), load_factor=None)
        document = result_to_dict(solution)
        assert [document[k] for k in ("lower", "upper", "load_factor")] == [None, None, None]
        back = result_from_dict(document)
        assert (back.lower, back.upper, back.load_factor) == (-math.inf, math.inf, None)

    def test_other_infinities_are_texts(self) -> None:
        iterate = Iterate(math.nan, 0.1, "HIGHS", "failed", upper=-math.inf, change=math.inf)
        document = result_to_dict(a_solution(bracket=Bracket(lower=math.inf), history=(iterate,)))
        assert document["lower"] == "inf"
        back = result_from_dict(json.loads(laid_out(document)))
        assert back.lower == math.inf
        assert repr(back.history) == repr((iterate,))

    def test_numpy_scalars_become_plain(self) -> None:
        document = result_to_dict(
            a_solution(
                load_factor=np.float64(0.25), blocks=np.int64(1), bracket=Bracket(np.float32(0.5))
            )
        )
        assert [type(document[k]) for k in ("load_factor", "blocks", "lower")] == [
            float, int, float,
        ]  # fmt: skip
        laid_out(document)

    @pytest.mark.parametrize(
        ("key", "value", "phrase"),
        [
            ("format", "cvxlimit-scene", "this is not a result file"),
            ("version", 3, "version must be 1, got 3"),
            ("status", "fine", "status must be one of 'certified'"),
            ("status", 3, "status must be a text in quotes, got 3"),
            ("lower", "much", "lower must be a number, got 'much'"),
            ("blocks", -1, "blocks must be a whole number from 0 on, got -1"),
            ("contacts", 2, "forces must be 2 rows, one for each contact, got 1"),
            ("forces", [[1, 2]], "force on contact 0 must be 6 numbers [V1, V2, N, M1, M2, MT]"),
            ("forces", [[1, 2, "inf", 0, 0, 0]], "N of force on contact 0 must be a number"),
            ("mechanism", {"b": [1]}, "mechanism of block 'b' must be 6 numbers [ux, uy"),
            ("mechanism", [], "mechanism must be an object"),
            ("history", {}, "history must be a list"),
            (
                "history",
                [{"seconds": 1, "solver": "x"}],
                "entry 0 of history lacks the key 'status'",
            ),
            ("history", [{"gap": 1}], "entry 0 of history has an unknown key 'gap'"),
            ("seconds", {"solve": None}, "seconds of phase 'solve' must be a number, got None"),
            ("gap", 0.1, "the result has an unknown key 'gap'"),
        ],
    )
    def test_malformed(self, key: str, value: object, phrase: str, tmp_path: Path) -> None:
        file = tmp_path / "r.json"
        file.write_text(json.dumps(result_to_dict(a_solution()) | {key: value}))
        with pytest.raises(InputError) as caught:
            read_result(file)
        assert_one_clear_line(str(caught.value))
        assert f"{file}: " in str(caught.value)
        assert phrase in str(caught.value)

    @pytest.mark.parametrize("key", KEYS)
    def test_every_key_is_needed(self, key: str) -> None:
        document = result_to_dict(a_solution())
        del document[key]
        with pytest.raises(InputError, match=f"the result lacks the key '{key}'"):
            result_from_dict(document)

    def test_infinite_forces_are_refused(self, tmp_path: Path) -> None:
        file = tmp_path / "r.json"
        for changes in (
            {"forces": np.full((1, 6), np.nan)},
            {"mechanism": {"tower": np.full(6, np.inf)}},
            {"forces": np.zeros((1, 5))},
        ):
            with pytest.raises(InputError):
                write_result(a_solution(**changes), file)
        assert not file.exists()
