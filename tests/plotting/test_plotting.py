"""Plots: what they say about a mechanism is right, complete, safe, and needs no display."""

from __future__ import annotations

import io
import json
import math
import os
import pickle
import re
import subprocess
import sys
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial import ConvexHull, HalfspaceIntersection

from cvxlimit import plotting
from cvxlimit.errors import InputError, ModelError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.plotting import ContactKind, Drawing, figure, motion, page, plot, title, to_pyvista
from cvxlimit.plotting.annotations import Marking
from cvxlimit.plotting.camera import camera_from, default_camera
from cvxlimit.plotting.look import KIND_COLOURS, KIND_TEXTS, rgb
from cvxlimit.plotting.picture import cropped, drawn_mesh, seen
from cvxlimit.plotting.visible import Faces
from cvxlimit.results.movement import DEFORMATION, LARGEST_ROTATION, free_size
from cvxlimit.scene import Load, Scene, Units
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import Bracket

MU = 0.6
LENGTH, THICKNESS, HEIGHT = 1.0, 0.5, 0.4


def solution_of(scene, mechanism, /, **changes):
    fields = {
        "scene_name": scene.name,
        "surface": "conic",
        "interaction": "none",
        "moments": "signed",
        "blocks": len(scene.free),
        "contacts": len(scene.contacts),
        "load_factor": 0.4230583,
        "bracket": Bracket(0.4230561, 0.4230593),
        "status": Status.CERTIFIED,
        "history": (),
        "seconds": {},
        "mechanism": mechanism,
    }
    return Solution(**(fields | changes))


def about(block, angular, point, linear=(0.0, 0.0, 0.0)):
    """Rates at the centroid of a rotation about an axis through ``point``, plus a translation."""
    arm = block.centroid - np.array(point)
    return np.concatenate([np.cross(angular, arm) + np.array(linear), angular])


def wall_blocks(rename=lambda name: name):
    """Three by four blocks in running bond on a huge slab, and a wedge on the last half block."""
    blocks = [Block.box("ground", (-50, -50, -5), (50, 50, 0))]
    for row in range(4):
        joints = [0, 1, 2, 3] if row % 2 == 0 else [0, 0.5, 1.5, 2.5, 3]
        for i, (start, end) in enumerate(pairwise(joints)):
            low = (start * LENGTH, 0.0, row * HEIGHT)
            high = (end * LENGTH, THICKNESS, (row + 1) * HEIGHT)
            blocks.append(Block.box(rename(f"r{row}-{i}"), low, high, density=20.0))
    top = 4 * HEIGHT
    corners = [(x, y, top) for x in (2.5, 3.0) for y in (0.0, THICKNESS)]
    crown = [(x, y, top + 0.3) for x in (2.65, 2.85) for y in (0.0, THICKNESS)]
    return [*blocks, Block.hull(rename("wedge"), corners + crown, density=20.0)]


@pytest.fixture
def wall():
    return Scene(
        wall_blocks(), ["ground"], Load(acceleration=(1, 0, 0)), friction=MU, name="bench wall"
    )


@pytest.fixture
def mechanism(wall):
    """Top blocks: one rocks about an edge, one slides and dilates, one twists, the wedge lifts."""
    rates = {wall.blocks[i].id: np.zeros(6) for i in wall.free}
    block = {b.id: b for b in wall.blocks}
    rates["r3-0"] = about(block["r3-0"], (0, -1, 0), (0, 0, 3 * HEIGHT))
    rates["r3-1"][:3] = (0, 0.5, MU * 0.5)
    rates["r3-2"] = about(block["r3-2"], (0, 0, 1), block["r3-2"].centroid)
    rates["wedge"][2] = 0.3
    return rates


@pytest.fixture
def solved(wall, mechanism):
    forces = np.arange(6.0 * len(wall.contacts)).reshape(-1, 6)
    return solution_of(wall, mechanism, forces=forces)


# ---------------------------------------------------------------- movement and classification


def test_contacts_of_the_wall_are_told_apart(wall, solved):
    kinds = dict(zip(wall.contacts.names, motion(wall, solved).contacts.kind, strict=True))
    expected = {
        "r2-0-r3-0": ContactKind.OPENS,
        "r2-0-r3-1": ContactKind.SLIDES,
        "r2-1-r3-1": ContactKind.SLIDES,
        "r2-1-r3-2": ContactKind.TWISTS,
        "r2-2-r3-2": ContactKind.TWISTS,
        "r3-3-wedge": ContactKind.OPENS,
    }
    assert {name: kinds[name] for name in expected} == expected
    below = [name for name in kinds if "r3" not in name]
    assert len(below) > 15
    assert all(kinds[name] == ContactKind.CLOSED for name in below)


def test_contact_rates_are_exact(wall, solved):
    contacts, what = wall.contacts, motion(wall, solved).contacts
    at = {name: j for j, name in enumerate(contacts.names)}
    opening = {
        name: what.opening[contacts.corner_start[j] : contacts.corner_start[j + 1]]
        for name, j in at.items()
    }
    np.testing.assert_allclose(np.sort(opening["r2-0-r3-0"]), [0, 0, 0.5, 0.5], atol=1e-12)
    np.testing.assert_allclose(opening["r2-1-r3-1"], MU * 0.5, atol=1e-12)
    assert what.slip[at["r2-1-r3-1"]] == pytest.approx(0.5)
    assert what.twist[at["r2-1-r3-2"]] == pytest.approx(1.0)
    assert what.slip[at["r2-1-r3-2"]] == pytest.approx(math.hypot(0.5, THICKNESS / 2))


CORNER = (0.5, 0.5, 0.0)


@pytest.mark.parametrize(
    ("angular", "point", "linear", "kind"),
    [
        ((0, 0, 0), (0, 0, 0), (0, 0, 0), ContactKind.CLOSED),
        ((0, 1, 0), CORNER, (0, 0, 0), ContactKind.OPENS),
        ((0, 0, 0), CORNER, (0, 0, 1), ContactKind.OPENS),
        ((0, 0, 0), CORNER, (1, 0, MU), ContactKind.SLIDES),
        ((0, 0, 0), CORNER, (1, 0, MU / math.cos(math.pi / 4)), ContactKind.SLIDES),
        ((0, 0, 0), CORNER, (1, 0, 2.0), ContactKind.OPENS),
        ((0, 0, 1), (0, 0, 0), (0, 0, 0.2), ContactKind.TWISTS),
        ((0, 0, 1), CORNER, (0, 0, 0.4), ContactKind.TWISTS),
        ((0, 0, 1), (3, 0, 0), (0, 0, 1.8), ContactKind.SLIDES),
        ((0, 1, 0), CORNER, (0.3, 0, 0), ContactKind.OPENS),
    ],
)
@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_kind_of_one_contact(angular, point, linear, kind, tilt):
    """A block of 1 x 1 x 2 on the ground, in the plane and tilted with everything else."""
    ground = Block.box("ground", (-3, -3, -1), (3, 3, 0))
    block = Block.box("block", (-0.5, -0.5, 0), (0.5, 0.5, 2), density=1.0)
    c, s = math.cos(tilt), math.sin(tilt)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ np.array(
        [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    )
    scene = Scene([ground, block], ["ground"], Load(acceleration=(1, 0, 0)), friction=MU)
    rates = about(block, angular, point, linear)
    turned = np.concatenate([turn @ rates[:3], turn @ rates[3:]])
    moving = motion(scene.moved(turn), solution_of(scene, {"block": turned}))
    assert moving.contacts.kind.tolist() == [kind]


def test_small_contact_rates_are_not_marked(wall):
    """Half a percent of the largest speed is invisible, two percent is marked."""
    for rate, kind in ((0.005, ContactKind.CLOSED), (0.02, ContactKind.OPENS)):
        rates = {wall.blocks[i].id: np.array([0, 0, 1.0, 0, 0, 0]) for i in wall.free}
        rates["wedge"] = np.array([0, 0, 1.0 + rate, 0, 0, 0])
        what = motion(wall, solution_of(wall, rates)).contacts
        assert what.kind[wall.contacts.names.index("r3-3-wedge")] == kind


def test_speed_is_relative_to_the_fastest_corner(wall, solved):
    moving = motion(wall, solved)
    speed = {b.id: v for b, v in zip(wall.blocks, moving.speed, strict=True)}
    fastest = math.hypot(0.5, HEIGHT)
    assert moving.largest == pytest.approx(fastest)
    assert speed["r3-0"] == pytest.approx(1.0)
    assert speed["wedge"] == pytest.approx(0.3 / fastest)
    assert speed["ground"] == speed["r0-0"] == 0.0


def test_largest_displacement_is_a_fixed_part_of_the_structure(wall):
    rates = {wall.blocks[i].id: np.array([0, 7.0, 0, 0, 0, 0]) for i in wall.free}
    moving = motion(wall, solution_of(wall, rates))
    assert moving.scale * moving.largest == pytest.approx(DEFORMATION * free_size(wall))
    assert free_size(wall) < 4.0


def test_a_small_toppling_block_is_not_inflated(wall):
    rates = {wall.blocks[i].id: np.zeros(6) for i in wall.free}
    rates["wedge"][4] = 5.0
    moving = motion(wall, solution_of(wall, rates))
    assert moving.scale * 5.0 == pytest.approx(LARGEST_ROTATION)


def test_a_solution_of_another_scene_is_refused(wall, mechanism):
    with pytest.raises(InputError, match="lacks block 'wedge'"):
        motion(wall, solution_of(wall, {k: v for k, v in mechanism.items() if k != "wedge"}))
    with pytest.raises(InputError, match="names block 'ghost'"):
        motion(wall, solution_of(wall, mechanism | {"ghost": np.zeros(6)}))
    with pytest.raises(InputError, match="'wedge' must be finite"):
        motion(wall, solution_of(wall, mechanism | {"wedge": np.full(6, np.nan)}))
    with pytest.raises(InputError, match="contacts"):
        page(wall, solution_of(wall, mechanism, forces=np.zeros((3, 6))))


# ---------------------------------------------------------------- title


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, "bench wall, Coulomb friction: load factor \N{GREEK SMALL LETTER ALPHA} = 0.42306"),
        (
            {"load_factor": 12.34567, "bracket": Bracket(12.34561, 12.34569)},
            "bench wall, Coulomb friction: load factor \N{GREEK SMALL LETTER ALPHA} = 12.346",
        ),
        (
            {"load_factor": 0.0, "bracket": Bracket(0.0, 0.0)},
            "bench wall, Coulomb friction: load factor \N{GREEK SMALL LETTER ALPHA} = 0",
        ),
        (
            {"bracket": Bracket(0.4230561), "status": Status.NOT_CERTIFIED},
            "bench wall, Coulomb friction: load factor \N{GREEK SMALL LETTER ALPHA} = 0.42306 "
            "in [0.42305, ?] (not certified)",
        ),
        (
            {
                "interaction": "certified",
                "load_factor": 0.25291,
                "bracket": Bracket(0.25291, 0.30149),
            },
            "bench wall, Coulomb friction, interaction with bending (signed moments): "
            "load factor \N{GREEK SMALL LETTER ALPHA} = 0.25291 in [0.25291, 0.30149] "
            "(certified within 17 %)",
        ),
        (
            {"load_factor": None, "status": Status.DEAD_LOAD_UNSTABLE},
            "bench wall, Coulomb friction: dead load cannot stand",
        ),
        (
            {"scene_name": "a\nb\x00"},
            "a\ufffdb\ufffd, Coulomb friction: load factor \N{GREEK SMALL LETTER ALPHA} = 0.42306",
        ),
    ],
)
def test_title(wall, changes, text):
    assert title(solution_of(wall, None, **changes)) == text


@pytest.mark.parametrize("factor", [1e-7, 0.00123456789, 0.99999999, 1.0, 54321.123456])
def test_printed_bracket_holds_the_bracket(wall, factor):
    text = title(
        solution_of(wall, None, load_factor=factor, bracket=Bracket(0.9999 * factor, factor))
    )
    low, high = re.search(r"\[(\S+), (\S+)\]", text).groups()
    assert float(low) <= factor * 0.9999
    assert float(high) >= factor * (1 - 1e-9)


# ---------------------------------------------------------------- geometry that is drawn


def test_huge_supports_are_cropped(wall):
    mesh = drawn_mesh(wall)
    points = mesh.points[mesh.point_block == 0]
    assert np.ptp(points, axis=0).max() < 1.3 * free_size(wall)
    assert points[:, 2].max() == pytest.approx(0.0)
    assert len(set(mesh.patch[mesh.face_block == 0])) == 6


def test_cropped_polyhedron_is_the_intersection():
    """Closed and convex (else Block refuses it), with the volume of scipy's intersection."""
    rng = np.random.default_rng(3)
    low, high = np.array([-0.5, -0.6, -0.7]), np.array([0.6, 0.5, 0.4])
    sides = np.vstack([np.c_[np.eye(3), -high], np.c_[-np.eye(3), low]])
    for _ in range(20):
        block = Block.hull("b", rng.normal(size=(12, 3)) * 0.7, density=1.0, inner="drop")
        vertices, faces = cropped(block, low, high)
        hull = ConvexHull(block.vertices)
        both = HalfspaceIntersection(np.vstack([hull.equations, sides]), np.zeros(3))
        expected = ConvexHull(both.intersections).volume
        assert Block.polyhedron("c", vertices, faces).volume == pytest.approx(expected, rel=1e-6)


def test_supports_out_of_sight_are_left_out():
    far = Block.box("far", (40, 0, 0), (41, 1, 1))
    vertices, faces = cropped(far, np.zeros(3), np.ones(3))
    assert not len(faces)
    assert vertices is far.vertices


def seen_at(faces, points):
    """Numbers of the nearest face at points, by comparing all of them: -1 where there is none."""
    nearest, result = np.full(len(points), -np.inf), np.full(len(points), -1)
    for k, corners in enumerate(faces):
        edge = np.roll(corners, -1, axis=0)[:, :2] - corners[:, :2]
        arm = points[:, None] - corners[:, :2]
        side = edge[:, 0] * arm[:, :, 1] - edge[:, 1] * arm[:, :, 0]
        inside = (side >= 0).all(axis=1) | (side <= 0).all(axis=1)
        plane = np.linalg.solve(np.c_[corners[:3, :2], np.ones(3)], corners[:3, 2])
        depth = np.c_[points, np.ones(len(points))] @ plane
        closer = inside & (depth > nearest)
        nearest[closer], result[closer] = depth[closer], k
    return result


def test_what_is_seen_is_the_nearest_also_where_faces_interpenetrate():
    """Rectangles any way round in a box: nearly all of them cut through others."""
    rng = np.random.default_rng(5)
    faces = []
    for _ in range(25):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * rng.uniform(0.2, 1)
        faces.append(corners @ turn.T + rng.uniform(-1, 1, 3))
    points = rng.uniform(-1.5, 1.5, (3000, 2))
    wanted = seen_at(faces, points)
    regions = Faces(faces).visible()
    shown = np.full(len(points), -1)
    for k, region in enumerate(regions):
        shown[shapely.contains_xy(region, points)] = k
    assert (wanted >= 0).sum() > 1000
    # Regions lie on a grid of 2e-5 of the picture: points nearer to a line than that may differ.
    assert (shown != wanted).sum() <= 3


def test_lines_end_where_faces_hide_them():
    square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    lines = np.array([
        [[-1, 1, -1], [3, 1, -1]],  # behind
        [[-1, 1, 1], [3, 1, 1]],  # before
        [[0, 1, -1], [2, 1, 1]],  # through it: seen from the middle on
    ])  # fmt: skip
    parts, number = Faces([square]).visible_lines(lines, 0.0)
    found = {k: sorted(parts[number == k][:, :, 0].tolist()) for k in range(3)}
    assert np.allclose(found[0], [[-1, 0], [2, 3]])
    assert np.allclose(found[1], [[-1, 3]])
    assert np.allclose(found[2], [[1, 2]])


def test_camera_shows_the_movement(wall, solved):
    """Right-handed, upright, and neither along nor behind the way the structure moves."""
    for camera in (default_camera(wall, motion(wall, solved)), camera_from(wall, (1, 2, 3))):
        np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(camera.axes) == pytest.approx(1.0)
        assert camera.axes[1, 2] > 0.0
    for direction in np.vstack([np.eye(3)[:2], -np.eye(3)[:2]]):
        rates = {wall.blocks[i].id: np.r_[direction, 0, 0, 0] for i in wall.free}
        seen = default_camera(wall, motion(wall, solution_of(wall, rates))).axes @ direction
        assert abs(seen[0]) > 0.5
        assert seen[2] > 0.0
    assert camera_from(wall, (0, 0, 1)).axes[2].tolist() == [0, 0, 1]
    with pytest.raises(InputError, match="viewer"):
        camera_from(wall, (0, 0, 0))


def test_moved_blocks_and_marks_are_drawn(wall, solved):
    moving = motion(wall, solved)
    marking = Marking(wall.contacts, moving.contacts.kind, KIND_COLOURS, KIND_TEXTS)
    shown = seen(Drawing(wall, moving, default_camera(wall, moving), marking=marking))
    for colour in KIND_COLOURS.values():
        assert np.isclose(shown.colours, rgb(colour)).all(axis=1).any()
    area = sum(abs(shapely.area(shapely.Polygon(ring))) for ring in shown.ghost.rings)
    assert area > 0.0
    points = np.concatenate([ring for fill in shown.fills for ring in fill.rings])
    slack = 1e-4 * np.ptp(points, axis=0).max()
    assert (points >= shown.bounds[0] - slack).all()
    assert (points <= shown.bounds[1] + slack).all()


# ---------------------------------------------------------------- PNG


def pixels_of(path):
    image = pytest.importorskip("matplotlib.image")
    return (image.imread(path)[..., :3] * 255).round().astype(int)


def test_png_shows_something(wall, solved, tmp_path):
    (written,) = plot(wall, solved, tmp_path / "wall.png")
    pixels = pixels_of(written)
    white = (pixels == 255).all(axis=2).mean()
    assert 0.2 < white < 0.9
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 200


@pytest.mark.exhaustive
def test_figure_texts(wall, solved):
    pytest.importorskip("matplotlib")
    drawn = figure(wall.with_name("other"), solved, viewer=(1, -2, 1))
    texts = [t.get_text() for t in drawn.texts + drawn.axes[0].texts]
    legend = [t.get_text() for t in drawn.legends[0].get_texts()]
    assert title(solved) in texts
    assert {"x (m)", "z (m)"} <= set(texts)
    assert any(t.startswith("y ") and t.endswith("(m)") for t in texts)
    assert "speed" in drawn.axes[1].get_ylabel()
    assert "contact twists (2)" in legend
    assert drawn._repr_png_().startswith(b"\x89PNG")


@pytest.mark.exhaustive
def test_mathematical_and_missing_characters_are_harmless(mechanism, tmp_path):
    scene = Scene(
        wall_blocks(), ["ground"], Load(acceleration=(0, 1, 0)), friction=MU,
        name="$\\frac{ 城 \x1b[31m", units=Units(length="$m_", force="kN"),
    )  # fmt: skip
    assert plot(scene, solution_of(scene, mechanism), tmp_path / "a.png")[0].stat().st_size > 10_000


@pytest.mark.exhaustive
def test_no_mechanism_is_drawn_undeformed(wall, tmp_path):
    failed = solution_of(
        wall, None, load_factor=None, bracket=Bracket(), status=Status.LIVE_LOAD_HARMLESS
    )
    for name in ("a.png", "a.html", "a.vtu"):
        assert all(p.stat().st_size > 1000 for p in plot(wall, failed, tmp_path / name))
    drawn = figure(wall, failed)
    assert len(drawn.axes) == 1
    assert drawn.get_suptitle() == "bench wall, Coulomb friction: live load does no harm"
    assert "block (no mechanism)" in [t.get_text() for t in drawn.legends[0].get_texts()]


def run_python(code, **variables):
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND")
    environment = {k: v for k, v in os.environ.items() if k not in hidden} | variables
    environment["PYTHONPATH"] = str(Path(plotting.__file__).parents[2])
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.exhaustive
def test_png_needs_no_display(wall, solved, tmp_path):
    (tmp_path / "case").write_bytes(pickle.dumps((wall, solved)))
    run = run_python(
        "import pickle, pathlib, sys\n"
        "from cvxlimit.plotting import plot\n"
        f"folder = pathlib.Path({str(tmp_path)!r})\n"
        "plot(*pickle.loads((folder / 'case').read_bytes()), folder / 'a.png')\n"
        "assert not {'vtk', 'vtkmodules', 'pyvista', 'tkinter'} & set(sys.modules)\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n",
        MPLBACKEND="tkagg",
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert len(np.unique(pixels_of(tmp_path / "a.png").reshape(-1, 3), axis=0)) > 200


@pytest.mark.exhaustive
def test_plotting_imports_nothing_heavy():
    run = run_python(
        "import sys, cvxlimit.plotting\n"
        "sys.exit(bool({'matplotlib', 'pyvista', 'vtkmodules'} & set(sys.modules)))"
    )
    assert run.returncode == 0, run.stderr


def test_missing_matplotlib_is_one_clear_error(wall, solved, tmp_path, monkeypatch):
    for name in ("drawing", "axes", "sheet"):
        monkeypatch.delattr(plotting, name, raising=False)
        monkeypatch.delitem(sys.modules, f"cvxlimit.plotting.{name}", raising=False)
    for name in [n for n in sys.modules if n.startswith("matplotlib")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ModelError, match=r'pip install "cvxlimit\[plot\]"'):
        plot(wall, solved, tmp_path / "a.png")
    assert plot(wall, solved, tmp_path / "a.html")
    assert not (tmp_path / "a.png").exists()


# ---------------------------------------------------------------- HTML


class Reader(HTMLParser):
    """Collects elements with attributes, and the text of every script."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.scripts = [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data):
        if self.elements and self.elements[-1][0] == "script":
            self.scripts[-1] += data


HOSTILE = (
    "</script><script>alert(1)</script>", "<!--<script>", "/*DATA*/", "\"'`${1}&lt;\u2028\u2029",
    "<img src=http://evil.example/x onerror=alert(1)>",
)  # fmt: skip


@pytest.fixture
def hostile(mechanism):
    """The wall with hostile texts wherever a user can put one."""
    names = dict(zip(("r0-0", "r1-1", "r2-2", "r3-1", "wedge"), HOSTILE, strict=True))
    scene = Scene(
        wall_blocks(lambda name: names.get(name, name)), ["ground"], Load(acceleration=(1, 0, 0)),
        friction=MU, name=HOSTILE[0], units=Units(HOSTILE[1], HOSTILE[0]),
    )  # fmt: skip
    renamed = {names.get(name, name): rates for name, rates in mechanism.items()}
    return scene, solution_of(scene, renamed, surface=HOSTILE[4], note=HOSTILE[0])


def test_page_carries_hostile_texts_as_data(hostile):
    scene, solution = hostile
    reader = Reader(page(scene, solution))
    assert [tag for tag, _ in reader.elements].count("script") == 2
    assert [tag for tag, _ in reader.elements].count("img") == 0
    data = json.loads(reader.scripts[0])
    assert data["blocks"]["id"] == [b.id for b in scene.blocks]
    assert data["contacts"]["name"] == list(scene.contacts.names)
    assert data["title"] == title(solution)
    assert data["units"] == {"length": HOSTILE[1], "force": HOSTILE[0]}


def test_page_needs_no_network(hostile):
    text = page(*hostile)
    reader = Reader(text)
    assert not [(t, a) for t, a in reader.elements if {"src", "href", "srcset"} & set(a)]
    assert not {t for t, _ in reader.elements} & {"link", "iframe", "object", "embed", "base"}
    script = reader.scripts[1]
    for word in ("http", "fetch(", "XMLHttpRequest", "import(", "WebSocket", "innerHTML", "eval("):
        assert word not in script
    assert "default-src 'none'" in text
    assert not re.search(r"url\(|@import", text)


def test_page_data_are_the_mechanism(wall, solved):
    data = json.loads(Reader(page(wall, solved)).scripts[0])
    moving = motion(wall, solved)
    rates = np.array(data["blocks"]["rates"]).reshape(-1, 6)
    np.testing.assert_allclose(rates, moving.rates, rtol=1e-6)
    assert data["scale"] == moving.scale
    assert data["contacts"]["kind"] == moving.contacts.kind.tolist()
    np.testing.assert_allclose(
        np.array(data["contacts"]["forces"]).reshape(-1, 6), solved.forces, rtol=1e-6
    )
    assert data["mesh"]["faceStart"][-1] == len(data["mesh"]["corners"])
    assert len(data["mesh"]["points"]) == 3 * len(data["mesh"]["pointBlock"])


def test_a_far_origin_changes_nothing(wall, mechanism):
    """National grid coordinates in mm, and the same wall at the origin."""
    far = wall.moved(np.eye(3), (5e8, 4e9, 0.0))
    images, shapes = [], []
    for scene in (wall, far):
        moving = motion(scene, solution_of(scene, mechanism))
        drawing = Drawing(scene, moving, camera_from(scene, (1, -2, 1)))
        shown = seen(drawing)
        areas = [sum(map(shapely.area, map(shapely.Polygon, f.rings))) for f in shown.fills]
        images.append(np.array([sum(areas), *(shown.bounds[1] - shown.bounds[0])]))
        data = json.loads(Reader(page(scene, solution_of(scene, mechanism))).scripts[0])
        points = np.array(data["mesh"]["points"]).reshape(-1, 3)
        shapes.append(points - np.array(data["bounds"][:3]))
    # At 4e9 a coordinate has a step of 5e-7, of structures of 3.
    np.testing.assert_allclose(images[0], images[1], rtol=1e-4)
    np.testing.assert_allclose(shapes[0], shapes[1], atol=2e-6)


def test_page_in_a_notebook_is_a_closed_frame(hostile):
    frame = page(*hostile)._repr_html_()
    reader = Reader(frame)
    ((tag, attributes),) = reader.elements
    assert tag == "iframe"
    assert attributes["sandbox"] == "allow-scripts allow-downloads"
    assert attributes["srcdoc"] == page(*hostile)


# ---------------------------------------------------------------- VTU


@pytest.fixture
def grids(wall, solved, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    paths = plot(wall, solved, tmp_path / "wall.vtu")
    assert [p.name for p in paths] == ["wall.vtu", "wall-contacts.vtu"]
    return [pyvista.read(p) for p in paths]


def test_vtu_blocks_read_back(wall, solved, grids):
    blocks, moving = grids[0], motion(wall, solved)
    volumes = blocks.compute_cell_sizes()["Volume"]
    np.testing.assert_allclose(volumes, [b.volume for b in wall.blocks], rtol=1e-9)
    assert set(blocks.celltypes) == {42}
    assert blocks.cell_data["is_support"].tolist() == [1] + [0] * (len(wall.blocks) - 1)
    assert blocks.cell_data["block"].tolist() == list(range(len(wall.blocks)))
    assert blocks.cell_data["id"].tolist() == [b.id for b in wall.blocks]
    np.testing.assert_allclose(blocks.cell_data["speed"], moving.speed)
    assert blocks.field_data["load_factor"].tolist() == [solved.load_factor]
    assert blocks.field_data["upper"].tolist() == [solved.upper]


def test_vtu_displacement_is_the_mechanism(wall, solved, grids):
    """Recomputed for every point of every cell from the solution's rates."""
    blocks, scale = grids[0], motion(wall, solved).scale
    for i, block in enumerate(wall.blocks):
        points = blocks.get_cell(i).point_ids
        rates = solved.mechanism.get(block.id, np.zeros(6))
        expected = rates[:3] + np.cross(rates[3:], blocks.points[points] - block.centroid)
        np.testing.assert_allclose(blocks["velocity"][points], expected, atol=1e-12)
        np.testing.assert_allclose(blocks["displacement"][points], scale * expected, atol=1e-12)
    warped = blocks.warp_by_vector("displacement")
    np.testing.assert_allclose(warped.points, blocks.points + blocks["displacement"], atol=1e-6)


def test_vtu_contacts_read_back(wall, solved, grids):
    contacts, moving = grids[1], motion(wall, solved)
    np.testing.assert_allclose(contacts.compute_cell_sizes()["Area"], wall.contacts.area, rtol=1e-9)
    assert contacts.cell_data["kind"].tolist() == moving.contacts.kind.tolist()
    assert contacts.cell_data["name"].tolist() == list(wall.contacts.names)
    assert contacts.cell_data["block_b"].tolist() == wall.contacts.b.tolist()
    for column, name in enumerate(COMPONENTS):
        assert contacts.cell_data[name].tolist() == solved.forces[:, column].tolist()
    np.testing.assert_allclose(contacts.cell_data["slip"], moving.contacts.slip)


def test_vtu_with_hostile_texts_reads_back(hostile, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    scene, solution = hostile
    paths = plot(scene, solution, tmp_path / "h.vtu")
    assert pyvista.read(paths[0]).cell_data["id"].tolist() == [b.id for b in scene.blocks]
    assert "V1" not in pyvista.read(paths[1]).cell_data


def test_missing_pyvista_is_one_clear_error(wall, solved, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    for make in (
        lambda: plot(wall, solved, tmp_path / "a.vtu"),
        lambda: to_pyvista(solved.of(wall)),
    ):
        with pytest.raises(ModelError, match=r'need pyvista: pip install "cvxlimit\[pyvista\]"'):
            make()
    assert not list(tmp_path.iterdir())


# ---------------------------------------------------------------- files


@pytest.mark.parametrize("name", ["a.jpg", "a", ".png", "a.png.gz"])
def test_other_suffixes_are_refused(wall, solved, tmp_path, name):
    with pytest.raises(InputError, match=r"\.png, \.html or \.vtu"):
        plot(wall, solved, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_suffix_may_be_in_capitals(wall, solved, tmp_path):
    assert plot(wall, solved, str(tmp_path / "A.HTML"))[0].read_text("utf-8").endswith("</html>\n")


def test_files_are_replaced_whole_or_not_at_all(wall, solved, tmp_path, monkeypatch):
    target = tmp_path / "a.html"
    target.write_text("old")

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        with pytest.raises(InputError, match="No space left"):
            plot(wall, solved, target)
    assert target.read_text() == "old"
    plot(wall, solved, target)
    assert target.read_text("utf-8") == page(wall, solved)
    assert list(tmp_path.iterdir()) == [target]


def test_unusable_folders_are_named(wall, solved, tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        plot(wall, solved, tmp_path / "nowhere" / "a.html")
    (tmp_path / "d.html").mkdir()
    with pytest.raises(InputError, match=r"d\.html"):
        plot(wall, solved, tmp_path / "d.html")
    assert [p.name for p in tmp_path.iterdir()] == ["d.html"]


@pytest.mark.exhaustive
def test_png_has_an_image_header(wall, solved, tmp_path):
    pil = pytest.importorskip("PIL.Image")
    data = plot(wall, solved, tmp_path / "a.png")[0].read_bytes()
    image = pil.open(io.BytesIO(data))
    assert image.format == "PNG"
    assert 600 < image.width < 2400
