"""Scenes seen before they are solved: pictures, pages, and the commands that make them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvxlimit import Block, Load, PointForce, Pressure, Scene, builtin_scene, solve
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError
from cvxlimit.io import read_scene, write_scene
from cvxlimit.plotting import page, plot_scene, refused, scene_figure, scene_page
from cvxlimit.plotting.annotations import JointKind, annotated, joint_kinds

GROUND = Block.box("ground", (-1, -1, -1), (3, 2, 0))
LEFT = Block.box("left", (0, 0, 0), (1, 1, 2), density=20.0)
RIGHT = Block.box("right", (1, 0, 0), (2, 1, 2), density=20.0)
CROWDED = Block.box("crowded", (0.9, 0, 0), (2, 1, 2), density=20.0)
APART = Block.box("apart", (1.03, 0, 0), (2, 1, 2), density=20.0)
LOADS = Load(
    points=[PointForce("left", (0, 0.5, 2), (3, 0, 0))],
    pressures=[Pressure("left", (0, -1, 0), 0.5)],
    forces={"left": (0, 0, -1, 0, 0, 0)},
    weights={"left": (0.1, 0, 0)},
)


def scene(*blocks: Block, live: Load = LOADS) -> Scene:
    return Scene((GROUND, *blocks), ("ground",), live, friction=0.7, name="pair")


def data_of(text: str) -> Any:
    found = re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found.group(1))


# --- annotations --------------------------------------------------------------------------------


def test_joints_are_told_apart_by_how_they_lie() -> None:
    pair = scene(LEFT, RIGHT)
    kinds = dict(zip(pair.contacts.names, joint_kinds(pair, pair.contacts), strict=True))
    assert kinds == {
        "ground-left": JointKind.BED,
        "ground-right": JointKind.BED,
        "left-right": JointKind.HEAD,
    }
    arch = builtin_scene("arch")
    assert set(joint_kinds(arch, arch.contacts)) == set(JointKind)
    tipped = pair.with_dead(Load(gravity=(1, 0, 0)))
    assert joint_kinds(tipped, tipped.contacts)[pair.contacts.names.index("left-right")] == (
        JointKind.BED
    )


def test_arrows_say_what_acts_where() -> None:
    notes = annotated(scene(LEFT, RIGHT))
    texts = [(arrow.case, arrow.text) for arrow in notes.arrows]
    assert texts == [
        ("dead", "dead load, resultant of the blocks' weights: 80 kN"),
        ("live", "live load, at the centroid of left: 1 kN"),
        ("live", "live load, from the weight of left: 4 kN"),
        ("live", "live load, at a point of left: 3 kN"),
        ("live", "live load, pressure 0.5 kN/m² on left: 1 kN"),
    ]
    point = notes.arrows[3]
    assert point.tip == (0.0, 0.5, 2.0)
    assert np.subtract(point.tip, point.tail)[0] > 0.0


def test_near_misses_are_marked() -> None:
    notes = annotated(scene(LEFT, APART))
    assert len(notes.marks) == 1
    assert notes.marks[0].at == pytest.approx((1.015, 0.5, 1.0))
    assert "left-apart: a gap of 0.03 m" in notes.marks[0].text


def test_a_refused_scene_names_its_culprits() -> None:
    bad = scene(LEFT, CROWDED)
    reason = refused(bad)
    assert reason is not None
    notes = annotated(bad, reason)
    assert notes.culprits == {"left", "crowded"}
    assert "interpenetrate" in notes.refusal
    assert notes.marks
    assert all(0.9 <= mark.at[0] <= 1.0 for mark in notes.marks)


# --- pictures and pages -------------------------------------------------------------------------


@pytest.mark.exhaustive_cases(".png-blocks0", ".png-blocks1", ".png-blocks2")
@pytest.mark.parametrize("blocks", [(LEFT, RIGHT), (LEFT, APART), (LEFT, CROWDED)])
@pytest.mark.parametrize("suffix", [".png", ".html"])
def test_any_scene_is_drawn(blocks: tuple[Block, ...], suffix: str, tmp_path: Path) -> None:
    (path,) = plot_scene(scene(*blocks), tmp_path / f"scene{suffix}")
    assert path.stat().st_size > 5000


@pytest.mark.exhaustive
def test_the_legend_counts_what_is_there() -> None:
    pytest.importorskip("matplotlib")
    drawn = scene_figure(scene(LEFT, APART))
    legend = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert {"bed joint (2)", "near miss (1)", "dead load", "live load", "support"} <= set(legend)
    refusal = scene_figure(scene(LEFT, CROWDED))
    caption = refusal.legends[0].get_title().get_text().replace("\n", " ")
    assert "refused: blocks 'left' and 'crowded' interpenetrate" in caption


@pytest.mark.exhaustive
def test_scene_plot_is_a_figure_or_a_file(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    pair = scene(LEFT, RIGHT)
    assert pair.plot()._repr_png_().startswith(b"\x89PNG")  # type: ignore[union-attr]
    assert pair.plot(tmp_path / "pair.html") == (tmp_path / "pair.html",)
    pair.plot(tmp_path / "pair.pdf", figsize=(3.4, 3.0), title="Two blocks")
    assert (tmp_path / "pair.pdf").read_bytes().startswith(b"%PDF")
    with pytest.raises(InputError, match=r"give a name that ends in \.png or .* or \.html"):
        pair.plot(tmp_path / "pair.doc")
    with pytest.raises(InputError, match="a page has no figsize: leave it out"):
        pair.plot(tmp_path / "pair.html", figsize=(3.4, 3.0))


def test_the_page_holds_names_numbers_and_units() -> None:
    data = data_of(scene_page(scene(LEFT, APART)))
    assert data["title"] == "pair: 2 free blocks, 1 support"
    assert data["advice"] == "2 contacts, weight 78.8 kN, friction 0.7"
    assert data["blocks"]["id"] == ["ground", "left", "apart"]
    assert data["blocks"]["weight"][1] == 40.0
    assert data["contacts"]["name"] == ["ground-left", "ground-apart"]
    assert data["contacts"]["area"] == [1.0, 0.97]
    assert data["contacts"]["forces"] is None
    assert [kind["text"] for kind in data["kinds"]] == ["bed joint", "head joint", "sloping joint"]
    assert data["marks"][0]["text"].startswith("left-apart: a gap of 0.03 m")
    assert [arrow["case"] for arrow in data["arrows"]] == ["dead"] + 4 * ["live"]


def test_the_page_of_a_solution_has_the_forces_of_every_contact() -> None:
    """Where the page puts the pressure centre, the given moments vanish."""
    pair = scene(LEFT, RIGHT)
    answer = solve(pair)
    contacts = data_of(page(pair, answer))["contacts"]
    forces = np.array(contacts["forces"]).reshape(-1, 6)
    assert answer.forces is not None
    np.testing.assert_allclose(forces, answer.forces, rtol=1e-6, atol=1e-9)
    assert len(contacts["axes"]) == 9 * len(pair.contacts)


def test_names_are_data_to_the_page() -> None:
    nasty = Block.box("</script><b>", (0, 0, 0), (1, 1, 2), density=20.0)
    text = scene_page(scene(nasty, live=Load(points=[PointForce(nasty.id, (0, 0, 1), (1, 0, 0))])))
    assert text.count("</script>") == 2
    assert data_of(text)["blocks"]["id"][1] == nasty.id


def test_curved_faces_have_no_inner_lines() -> None:
    """A prism of 60 sides: its shell is one patch, its ends are another each."""
    from cvxlimit.plotting.picture import drawn_mesh

    angles = 2 * np.pi * np.arange(60) / 60
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.vstack([np.column_stack([ring, np.full(60, z)]) for z in (0.0, 2.0)])
    column = Block.hull("column", points, density=20.0)
    mesh = drawn_mesh(scene(column, live=Load(acceleration=(1, 0, 0))))
    assert len(set(mesh.patch[mesh.face_block == 1])) == 3
    assert len(set(mesh.patch[mesh.face_block == 0])) == 6


# --- commands -----------------------------------------------------------------------------------


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_show_draws_a_scene(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", "arch", "--plot", "arch.html"]) == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    assert "20 free blocks, 2 supports x 21 contacts" in shown.out
    assert (here / "arch.html").exists()


def test_show_and_solve_tell_of_near_misses(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_scene(scene(LEFT, APART), here / "pair.json")
    for arguments in (["show", "pair.json", "--plot", "p.html"], ["solve", "pair.json"]):
        assert run(arguments) == 0
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("cvxlimit: 1 joint is nearly there")
        assert "left-apart: a gap of 0.03 m" in line


def test_show_draws_what_is_refused_and_says_so(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_scene(scene(LEFT, CROWDED), here / "pair.json")
    assert run(["show", "pair.json", "--plot", "p.html"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "interpenetrate" in line
    assert data_of((here / "p.html").read_text("utf-8"))["refused"]


def test_without_a_file_a_page_is_written_aside(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is opened by itself: there may be no browser."""
    assert run(["show", "arch"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    (page,) = [line.split()[1] for line in out.splitlines() if line.startswith("written")]
    assert data_of(Path(page).read_text("utf-8"))["blocks"]
    assert "open that file in a browser" in out
    assert not list(here.iterdir())


def test_what_is_no_scene_leaves_no_folder(
    here: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    assert run(["show", "arc"]) == 2
    assert not list(temporary.iterdir())


@pytest.mark.parametrize(
    ("arguments", "phrase"),
    [
        (["show", "arch", "--plot", "a.vtu"], "the name must end in .png, .html"),
        (["show", "arc", "--plot", "a.png"], "did you mean 'arch'?"),
        (["import", "a.obj"], "give --output"),
        (["solve", "single-block", "--export", "a.dxf"], "the name must end in .obj, .glb, .csv"),
    ],
)
def test_misuse_is_one_line(
    arguments: list[str], phrase: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert phrase in line
    assert not list(here.iterdir())


IMPORT = ["--output", "s.json", "--length-unit", "m", "--up", "z", "--friction", "0.7"]
IMPORT += ["--live", "1,0,0"]


def test_import_says_what_it_found_and_writes_a_scene(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file in which every face of the second brick is there twice, and inside out."""
    lines, begin = [], 1
    for block in (GROUND, LEFT):
        lines += [f"o {block.id}", *(f"v {x} {y} {z}" for x, y, z in block.vertices.tolist())]
        faces = [tuple(begin + i for i in face) for face in block.faces]
        faces = [face[::-1] for face in 2 * faces] if block is LEFT else faces
        lines += ["f " + " ".join(map(str, face)) for face in faces]
        begin += 8
    (here / "tower.obj").write_text("\n".join(lines))
    code = run(["import", "tower.obj", *IMPORT, "--density", "20", "--supports", "ground"])
    assert code == 0
    shown = capsys.readouterr()
    facts = dict(line.split(None, 1) for line in shown.out.splitlines())
    assert facts["blocks"] == "2"
    assert facts["supports"] == "1: ground"
    assert facts["contacts"] == "1"
    assert facts["repairs"] == "6 doubled (in 1 block), 6 turned (in 1 block)"
    assert shown.err == ""
    assert read_scene(here / "s.json").contacts.names == ("ground-left",)
    assert solve(read_scene(here / "s.json")).load_factor == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("option", ["--output", "--length-unit", "--up", "--friction", "--live"])
def test_import_asks_for_what_files_do_not_say(
    option: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = IMPORT.index(option)
    assert run(["import", "a.obj", *IMPORT[:at], *IMPORT[at + 2 :]]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"give {option}" in line


def test_solve_exports_forces(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "single-block", "--export", "forces.csv"]) == 0
    assert "forces.csv" in capsys.readouterr().out
    head, row = (here / "forces.csv").read_text("utf-8").splitlines()
    assert "N (kN)" in head
    assert row.startswith("ground-")
