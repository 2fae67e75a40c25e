"""Bad input and bad luck: one sentence, exit 2, nothing half-written; whatever the mistake."""

from __future__ import annotations

import copy
import errno
import json
import multiprocessing
import os
import pickle
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from broken_meshes import GEOMETRIES, damaged
from cvxlimit import (
    Block,
    Certified,
    FixedPoint,
    Load,
    PointForce,
    Pressure,
    Scene,
    Tie,
    builtin_scene,
    io,
    solve,
)  # fmt: skip
from cvxlimit.cli.main import run
from cvxlimit.errors import CvxlimitError, InputError
from cvxlimit.io import fields
from cvxlimit.masonry import arch, dome, panel, random_wall, running_bond, stack, wall
from cvxlimit.plotting import plot
from cvxlimit.solution import Solution
from exhaustive import slow
from malformed_scenes import GOLDEN

FIXTURES = [HealthCheck.function_scoped_fixture]


# --- every entry of a scene file, replaced by what is not its kind --------------------------------

STRANGERS: tuple[Any, ...] = (None, True, "x", [], {}, float("nan"))


def paths(value: Any, at: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Ways to all entries of a JSON document."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in entries:
        yield (*at, key)
        if isinstance(inner, (dict, list)):
            yield from paths(inner, (*at, key))


def replaced(at: tuple[str | int, ...], stranger: Any) -> str:
    document: Any = json.loads(GOLDEN)
    inner = document
    for key in at[:-1]:
        inner = inner[key]
    inner[at[-1]] = copy.deepcopy(stranger)
    return json.dumps(document)


CASES = [(at, stranger) for at in paths(json.loads(GOLDEN)) for stranger in STRANGERS]


@pytest.mark.parametrize("share", [7, slow(1)])
def test_every_entry_of_a_scene_refuses_what_is_not_its_kind(
    share: int, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each file through the command line, or every seventh; those that are scenes are solved."""
    monkeypatch.chdir(tmp_path)
    refused = 0
    for at, stranger in CASES[::share]:
        Path("scene.json").write_text(replaced(at, stranger), encoding="utf-8")
        code = run(["solve", "scene.json", "--json", "out.json"])
        shown = capsys.readouterr()
        what = f"{stranger!r} at {at}: {shown.err}"
        assert code in (0, 2, 3, 4), what
        assert "internal error" not in shown.err, what
        if code == 2:
            refused += 1
            assert shown.out == "", what
            assert shown.err.startswith("cvxlimit: scene.json: "), what
            assert shown.err.count("\n") == 1, what
            assert len(shown.err) < 1000, what
            assert not Path("out.json").exists(), what
        Path("out.json").unlink(missing_ok=True)
        assert os.listdir() == ["scene.json"], what
    assert len(CASES) > 500
    assert refused > 0.9 * len(CASES[::share])


# --- files with bytes changed, lost and doubled ---------------------------------------------------


def refusal_of(call: Callable[[], object]) -> str:
    """What is said about bad input; nothing if it is good. Any other error is a failure."""
    try:
        call()
    except InputError as error:
        return str(error)
    return ""


CUTS = st.lists(
    st.tuples(
        st.integers(0, 10_000),
        st.sampled_from([0, 1, 2, 7, 400]),
        st.sampled_from([b"", b"0", b"-", b"1e999", b"[", b"}", b'"', b",", b"\xff", b"nan", b"\n",
                         b"null", b"9" * 30, b"-1", b"\0\0\0\0", b"/", b"e"]),
    ),
    min_size=1,
    max_size=3,
)  # fmt: skip


@given(CUTS)
@settings(max_examples=150, deadline=None)
def test_damaged_scenes_are_scenes_or_refused(cuts: list[tuple[int, int, bytes]]) -> None:
    said = refusal_of(lambda: io.scene_from_dict(fields.parsed(damaged(GOLDEN.encode(), cuts))))
    assert "\n" not in said
    assert len(said) < 2000


KNOWN = {"length_unit": "m", "up": "z", "friction": 0.7, "density": 20.0, "supports": "lowest"}


@given(name=st.sampled_from(sorted(GEOMETRIES)), cuts=CUTS)
@settings(max_examples=200, deadline=None, suppress_health_check=FIXTURES)
def test_damaged_geometry_is_a_scene_or_refused(
    name: str, cuts: list[tuple[int, int, bytes]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    pytest.importorskip("trimesh")
    path = tmp_path_factory.mktemp("damaged") / name
    path.write_bytes(damaged(GEOMETRIES[name], cuts))
    said = refusal_of(
        lambda: io.import_geometry(path, live=(1.0, 0.0, 0.0), **KNOWN).scene.contacts  # type: ignore[arg-type]
    )
    assert "\n" not in said
    assert len(said) < 2000


# --- calls ----------------------------------------------------------------------------------------

PUSH = Load(acceleration=(1, 0, 0))
GROUND = Block.box("ground", (-1, -1, -1), (2, 2, 0))
CUBE = Block.box("cube", (0, 0, 0), (1, 1, 1), 20.0)
TOWER = builtin_scene("stack")


def scene(**changes: Any) -> Scene:
    given: dict[str, Any] = {"blocks": (GROUND, CUBE), "supports": ("ground",), "live": PUSH}
    return Scene(**{**given, **changes})


def beside(at: tuple[float, float, float]) -> object:
    """Contacts of the cube and another one."""
    return scene(blocks=(GROUND, CUBE, Block.box("c", at, np.add(at, 1.0), 1.0))).contacts


CALLS: dict[str, tuple[Callable[[], object], str]] = {
    # blocks
    "box-text": (lambda: Block.box("b", "low", (1, 1, 1)), "box min of block 'b'"),
    "box-nan": (lambda: Block.box("b", (0, 0, np.nan), (1, 1, 1)), "box min of block 'b'"),
    "box-none": (lambda: Block.box("b", None, (1, 1, 1)), "box min of block 'b'"),  # type: ignore[arg-type]
    "box-flat": (lambda: Block.box("b", (0, 0, 0), (1, 1, 0)), "block 'b' is degenerate"),
    "box-huge": (lambda: Block.box("b", (0, 0, 0), (1e200,) * 3), "block 'b'"),
    "box-id": (lambda: Block.box("", (0, 0, 0), (1, 1, 1)), "non-empty text"),
    "box-id-number": (lambda: Block.box(3, (0, 0, 0), (1, 1, 1)), "non-empty text, got 3"),  # type: ignore[arg-type]
    "density-negative": (lambda: Block.box("b", (0,) * 3, (1,) * 3, -1.0), "density of block 'b'"),
    "density-text": (lambda: Block.box("b", (0,) * 3, (1,) * 3, "20"), "density of block 'b'"),  # type: ignore[arg-type]
    "density-infinite": (lambda: Block.box("b", (0,) * 3, (1,) * 3, np.inf), "density of block"),
    "hull-flat": (lambda: Block.hull("b", np.eye(3)), "'b'"),
    "hull-inner": (lambda: Block.hull("b", [*CUBE.vertices, (0.5, 0.5, 0.5)]), "block 'b'"),
    "polyhedron-open": (lambda: Block.polyhedron("b", CUBE.vertices, CUBE.faces[1:]), "'b'"),
    "polyhedron-index": (lambda: Block.polyhedron("b", CUBE.vertices, [(0, 1, 9)]), "'b'"),
    "polyhedron-shape": (lambda: Block.polyhedron("b", np.zeros(7), [(0, 1, 2)]), "'b'"),
    "moved-mirror": (lambda: CUBE.moved(-np.eye(3)), "mirror"),
    "moved-skew": (lambda: CUBE.moved(np.ones((3, 3))), "orthogonal"),
    "scaled-zero": (lambda: CUBE.scaled(0.0), "scales must be positive"),
    # scenes
    "blocks-none": (lambda: scene(blocks=None), "blocks"),
    "blocks-text": (lambda: scene(blocks=("cube",)), "blocks must be Blocks"),
    "blocks-twice": (lambda: scene(blocks=(GROUND, CUBE, CUBE)), "'cube' is used twice"),
    "supports-unknown": (lambda: scene(supports=("floor",)), "support 'floor'"),
    "supports-number": (lambda: scene(supports=(1,)), "supports must be ids"),
    "nothing-free": (lambda: scene(supports=("ground", "cube")), "no free block"),
    "no-density": (lambda: scene(supports=()), "'ground' has no density"),
    "friction-negative": (lambda: scene(friction=-0.1), "friction of the scene"),
    "friction-text": (lambda: scene(friction="rough"), "friction of the scene"),
    "friction-nan": (lambda: scene(friction=np.nan), "friction of the scene"),
    "friction-pair": (lambda: scene(contact_friction={("a", "b"): 0.5}), "'a'"),
    "friction-key": (lambda: scene(contact_friction={"cube": 0.5}), "cube"),
    "cohesion-negative": (lambda: scene(cohesion=-1.0), "cohesion of the scene"),
    "strength-zero": (lambda: scene(compressive_strength=0.0), "compressive_strength"),
    "tension-negative": (lambda: scene(tensile_strength=-1.0), "tensile_strength"),
    "tolerance-zero": (lambda: scene(joint_tolerance=0.0), "joint_tolerance"),
    "live-none": (lambda: scene(live=None), "live"),
    "live-zero": (lambda: scene(live=Load()), "live load is zero"),
    "live-unknown": (lambda: scene(live=Load(forces={"b9": (1,) * 6})), "'b9'"),
    "live-on-support": (lambda: scene(live=Load(forces={"ground": (1,) * 6})), "'ground'"),
    "dead-number": (lambda: scene(dead=9.81), "dead"),
    "units-text": (lambda: scene(units="m"), "units"),
    "name-number": (lambda: scene(name=3), "name"),
    "ties-text": (lambda: scene(ties=("rope",)), "ties must be Ties"),
    "overlapping": (lambda: beside((0.5, 0, 0)), "'cube' and 'c'"),
    "floating": (lambda: beside((0, 0, 5)), "'c'"),
    "touching-an-edge": (lambda: beside((1, 0, 1)), "'c'"),
    "no-such-contact": (lambda: TOWER.contacts["b1-b9"], "there is no contact 'b1-b9'"),
    "contact-by-half": (lambda: TOWER.contacts[0.5], "got 0.5"),  # type: ignore[index]
    # loads
    "gravity-2d": (lambda: Load(gravity=(0, -1)), "gravity"),
    "gravity-9.81": (lambda: Load(gravity=(0, 0, -9.81)), "gravity"),
    "acceleration-nan": (lambda: Load(acceleration=(np.nan, 0, 0)), "acceleration"),
    "force-short": (lambda: Load(forces={"cube": (1, 0, 0)}), "'cube'"),
    "force-list": (lambda: Load(forces=[1, 2]), "forces"),  # type: ignore[arg-type]
    "point-text": (lambda: PointForce("cube", "top", (0, 0, 1)), "'cube'"),  # type: ignore[arg-type]
    "point-far-off": (
        lambda: scene(live=Load(points=[PointForce("cube", (99, 0, 0), (1, 0, 0))])), "'cube'"
    ),
    "pressure-nowhere": (lambda: Pressure("cube", (0, 0, 0), 1.0), "normal of the pressure"),
    "pressure-no-face": (
        lambda: scene(live=Load(pressures=[Pressure("cube", (1, 1, 1), 1.0)])), "'cube'"
    ),
    "tie-nowhere": (
        lambda: scene(ties=(Tie("cube", "b9", (0, 0, 0), (1, 1, 1), 1.0),)), "'b9'"
    ),
    # generators
    "no-such-scene": (lambda: builtin_scene("tower"), "no built-in scene 'tower'"),
    "bond-half": (lambda: running_bond(2.5, 3), "whole_units"),  # type: ignore[arg-type]
    "bond-first": (lambda: running_bond(2, 3, first="third"), "first must be"),
    "wall-empty": (lambda: wall([]), "no courses"),
    "wall-text": (lambda: wall([["a"]]), "course 1"),  # type: ignore[list-item]
    "wall-zero": (lambda: wall([[1.0, 0.0]]), "course 1"),
    "wall-side": (lambda: wall([[1.0]], side_supports=("left",)), "side_supports"),
    "wall-unit": (lambda: wall([[1.0]], unit=(1.0, 1.0)), "unit"),  # type: ignore[arg-type]
    "panel-return": (lambda: panel(0.5, 3, left_return=0.01), "left_return"),
    "stack-none": (lambda: stack(0), "blocks"),
    "stack-shift": (lambda: stack(2, shift=(9.0, 0.0)).contacts, "b2"),
    "arch-thick": (lambda: arch(9, 3.0), "thickness_ratio"),
    "dome-shut": (lambda: dome(springing=85.0), "springing"),
    "random-negative": (lambda: random_wall(-1), "seed"),
    # solve
    "not-a-scene": (lambda: solve("stack"), "scene"),  # type: ignore[arg-type]
    "surface": (lambda: solve(TOWER, "conical"), "conical"),
    "surface-2-gon": (lambda: solve(TOWER, "2-gon"), "at least 3 facets, got 2"),
    "surface-list": (lambda: solve(TOWER, [3]), "3"),  # type: ignore[list-item]
    "surface-none": (lambda: solve(TOWER, []), "surface"),
    "method": (lambda: solve(TOWER, method="yes"), "'yes'"),
    "moments": (lambda: solve(TOWER, moments="tied"), "'tied'"),
    "model": (lambda: solve(TOWER, model="half"), "'half'"),
    "tolerance-negative": (lambda: solve(TOWER, tolerance=-1.0), "tolerance"),
    "tolerance-one": (lambda: solve(TOWER, tolerance=2.0), "tolerance"),
    "tolerance-text": (lambda: solve(TOWER, tolerance="1e-5"), "tolerance"),  # type: ignore[arg-type]
    "formulation": (lambda: solve(TOWER, formulation="corners"), "'corners'"),  # type: ignore[arg-type]
    "ladder-unknown": (lambda: solve(TOWER, ladder=["CLARABELLA"]), "CLARABEL"),
    "ladder-empty": (lambda: solve(TOWER, ladder=[]), "ladder"),
    "ladder-number": (lambda: solve(TOWER, ladder=[3]), "3"),  # type: ignore[list-item]
    "weight-one": (lambda: FixedPoint(old_value_weight=1.0), "old_value_weight"),
    "most-none": (lambda: FixedPoint(max_iterations=0), "max_iterations"),
    "starts": (lambda: Certified(starts=("top",)), "starts"),
    "branching": (lambda: Certified(branching_seconds=-1.0), "branching_seconds"),
    "facets-certified": (lambda: solve(TOWER, "octagon", method="certified"), "conic"),
}  # fmt: skip


@pytest.mark.parametrize("case", CALLS)
def test_bad_calls_are_refused_with_the_object_named(case: str) -> None:
    call, phrase = CALLS[case]
    with pytest.raises(CvxlimitError) as refusal:
        call()
    assert phrase in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_there_are_more_than_three_hundred() -> None:
    assert len(CASES) + len(CALLS) > 600


# --- whole or not at all --------------------------------------------------------------------------

SOLUTION = solve(TOWER)


def pictured(path: Path) -> None:
    plot(TOWER, SOLUTION, path)


WRITERS: dict[str, Callable[[Path], object]] = {
    "scene.json": lambda path: io.write_scene(TOWER, path),
    "result.json": lambda path: io.write_result(SOLUTION, path),
    "picture.png": pictured,
    "page.html": pictured,
    "forces.csv": lambda path: io.export(TOWER, path, SOLUTION),
    "blocks.obj": lambda path: io.export(TOWER, path, SOLUTION),
    "blocks.glb": lambda path: io.export(TOWER, path, SOLUTION),
}


@pytest.mark.exhaustive_cases("-picture.png", "[Errno 28] No space left on device-picture.png")
@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize(
    "luck", [OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), KeyboardInterrupt()], ids=str
)
def test_a_full_disk_and_ctrl_c_leave_the_old_file_and_nothing_else(
    name: str, luck: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / name
    path.write_bytes(b"as it was")

    def unlucky(descriptor: int) -> None:
        raise luck

    monkeypatch.setattr(os, "fsync", unlucky)
    with pytest.raises((InputError, KeyboardInterrupt)) as failure:
        WRITERS[name](path)
    if isinstance(luck, OSError):
        assert f"{name}: the file cannot be written: No space left" in str(failure.value)
    assert path.read_bytes() == b"as it was"
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device of Linux")
def test_a_device_that_is_full(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "single-block", "--json", "/dev/full"]) == 2
    assert "cvxlimit: /dev/full: the file cannot be written: No space" in capsys.readouterr().err


def test_two_writers_leave_one_of_both_files(tmp_path: Path) -> None:
    """Readers in between see one or the other, never a part."""
    path = tmp_path / "scene.json"
    names = ("single-block", "stack")
    io.write_scene(builtin_scene(names[0]), path)

    def writing(name: str) -> None:
        for _ in range(40):
            io.write_scene(builtin_scene(name), path)

    threads = [threading.Thread(target=writing, args=(name,)) for name in names]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        assert io.read_scene(path).name in names
    assert [p.name for p in tmp_path.iterdir()] == ["scene.json"]


def test_a_huge_scene_is_refused_by_its_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fields, "LARGEST_FILE", 2**20)
    with open("huge.json", "wb") as file:
        file.truncate(2**40)
    assert run(["solve", "huge.json"]) == 2
    assert "huge.json: the file is larger than 1 MiB" in capsys.readouterr().err


# --- the same bits everywhere ---------------------------------------------------------------------


def bits(subject: Scene) -> bytes:
    """All numbers of an answer."""
    solution: Solution = solve(subject)
    assert solution.forces is not None
    rates = np.concatenate(list((solution.mechanism or {}).values()))
    bounds = np.array([solution.lower, solution.upper, solution.load_factor])
    return solution.forces.tobytes() + rates.tobytes() + bounds.tobytes()


@pytest.mark.exhaustive
def test_threads_processes_and_pickles_give_the_same_bits() -> None:
    subject = random_wall(0)
    known = bits(subject)
    assert bits(pickle.loads(pickle.dumps(subject))) == known
    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(bits, [subject] * 8)) == {known}
    for method in ("fork", "spawn"):
        if method in multiprocessing.get_all_start_methods():
            context = multiprocessing.get_context(method)
            with ProcessPoolExecutor(1, mp_context=context) as processes:
                assert processes.submit(bits, subject).result() == known, method
