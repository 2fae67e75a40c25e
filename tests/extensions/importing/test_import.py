"""Geometry of other programs: every format gives the same scene, and nothing is guessed."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from broken_meshes import gltf, text_stl
from cells import cells
from cvxlimit import Block, Load, Scene, Status, builtin_scene, solve
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, separated
from cvxlimit.extensions.importing.digits import too_few_digits
from cvxlimit.extensions.importing.files import bodies_in
from cvxlimit.geometry.mesh import triangulated
from cvxlimit.geometry.solids import solid
from cvxlimit.io import export, import_geometry, read_bodies
from cvxlimit.masonry import BUILTIN, running_bond, wall
from exhaustive import mostly_slow

trimesh = pytest.importorskip("trimesh")

WALL = builtin_scene("tuff-wall")
PUSH = WALL.live.acceleration


def reimported(path: Path, **changes: Any) -> Scene:
    """The tuff wall from geometry, its loads and supports stated again."""
    asked: dict[str, Any] = {
        "length_unit": "m", "up": "z", "friction": WALL.friction, "live": PUSH,
        "density": next(b.density for b in WALL.blocks if b.density), "supports": WALL.supports,
    }  # fmt: skip
    return import_geometry(path, **asked | changes).scene


# --- the same wall in every form ----------------------------------------------------------------


def as_table(folder: Path) -> Path:
    path = folder / "wall.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["id", "xmin", "ymin", "zmin", "xmax", "ymax", "zmax"])
        for b in WALL.blocks:
            assert b.bounds is not None
            writer.writerow([b.id, *b.bounds.ravel().tolist()])
    return path


def as_polygons(folder: Path) -> Path:
    return export(WALL, folder / "wall.obj")[0]


def mesh_of(block: Block) -> Any:
    triangles, _ = triangulated(block.vertices, block.faces)
    return trimesh.Trimesh(block.vertices, triangles, process=False)


def as_triangles(folder: Path) -> Path:
    path = folder / "wall.obj"
    lines, begin = [], 1
    for b in WALL.blocks:
        mesh = mesh_of(b)
        lines += [f"o {b.id}", *(f"v {x!r} {y!r} {z!r}" for x, y, z in b.vertices.tolist())]
        lines += [f"f {i + begin} {j + begin} {k + begin}" for i, j, k in mesh.faces.tolist()]
        begin += len(b.vertices)
    path.write_text("\n".join(lines))
    return path


def as_folder(suffix: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        inside = folder / suffix
        inside.mkdir()
        for b in WALL.blocks:
            mesh_of(b).export(inside / f"{b.id}.{suffix}")
        return inside

    return write


def as_nodes(folder: Path) -> Path:
    return export(WALL, folder / "wall.glb")[0]


def as_assembly(folder: Path) -> Path:
    """As COMPAS 2 writes an assembly."""
    nodes = {
        str(i): {
            "block": {
                "dtype": "compas_assembly.datastructures/Block",
                "data": {
                    "vertex": {str(k): dict(zip("xyz", v, strict=True))
                               for k, v in enumerate(b.vertices.tolist())},
                    "face": {str(k): list(f) for k, f in enumerate(b.faces)},
                },
            },
            "is_support": b.id in WALL.supports,
        }
        for i, b in enumerate(WALL.blocks)
    }  # fmt: skip
    graph = {"dtype": "compas.datastructures/Graph", "data": {"node": nodes, "edge": {}}}
    document = {"dtype": "compas_assembly.datastructures/Assembly", "data": {"graph": graph}}
    path = folder / "wall.json"
    path.write_text(json.dumps(document))
    return path


FORMS: dict[str, tuple[Callable[[Path], Path], float]] = {
    "boxes": (as_table, 1e-6),
    "polygons": (as_polygons, 1e-6),
    "triangles": (as_triangles, 1e-6),
    "stl": (as_folder("stl"), 1e-5),
    "ply": (as_folder("ply"), 1e-5),
    "glb": (as_nodes, 1e-5),
    "compas": (as_assembly, 1e-6),
}
"""STL, PLY and glTF hold single precision, 6e-8 of a coordinate, or 1e-6 of a block's size here."""


@pytest.fixture(scope="module")
def reference() -> Any:
    return solve(WALL, tolerance=1e-8)


@pytest.mark.parametrize("form", FORMS)
def test_the_same_wall_in_every_form(form: str, tmp_path: Path, reference: Any) -> None:
    write, tolerance = FORMS[form]
    supports = None if form == "compas" else WALL.supports
    scene = reimported(write(tmp_path), supports=supports)
    assert len(scene.blocks) == len(WALL.blocks)
    number = {str(i): b.id for i, b in enumerate(WALL.blocks)} if form == "compas" else {}
    found = Counter(tuple(sorted(number.get(name, name) for name in pair)) for pair in pairs(scene))
    assert found == Counter(tuple(sorted(pair)) for pair in pairs(WALL))
    np.testing.assert_allclose(sum(scene.contacts.area), sum(WALL.contacts.area), rtol=1e-5)
    assert scene.total_weight == pytest.approx(WALL.total_weight, rel=1e-6)
    answer = solve(scene, tolerance=1e-8)
    assert answer.lower <= answer.upper * (1 + 1e-9)
    assert answer.load_factor == pytest.approx(reference.load_factor, rel=tolerance)


def pairs(scene: Scene) -> list[tuple[str, str]]:
    c = scene.contacts
    return [(c.block_ids[i], c.block_ids[j]) for i, j in zip(c.a, c.b, strict=True)]


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_gravity_is_against_the_axis_that_points_up(up: str, tmp_path: Path) -> None:
    scene = reimported(as_polygons(tmp_path), up=up)
    assert scene.dead.gravity == tuple(-1.0 if axis == up else 0.0 for axis in "xyz")
    np.testing.assert_array_equal(scene.blocks[3].vertices, WALL.blocks[3].vertices)


def test_a_turned_wall(tmp_path: Path, reference: Any) -> None:
    """Odd angles; the loads are turned with it."""
    turn = Rotation.from_euler("xyz", (13, 37, -71), degrees=True).as_matrix()
    moved = WALL.moved(turn, (3, -2, 5))
    scene = reimported(export(moved, tmp_path / "wall.obj")[0], live=moved.live)
    scene = scene.with_dead(moved.dead)
    assert pairs(scene) == pairs(WALL)
    answer = solve(scene, tolerance=1e-8)
    assert answer.load_factor == pytest.approx(reference.load_factor, rel=1e-6)


@pytest.mark.parametrize("form", ["rounded", "noisy"])
def test_a_wall_that_is_not_exact(form: str, tmp_path: Path, reference: Any) -> None:
    """Coordinates to 4 decimals after a turn, and noise of 1e-5 of a block's size on each."""
    rng = np.random.default_rng(4)
    turn = Rotation.from_euler("xyz", (13, 37, -71), degrees=True).as_matrix()
    base = WALL.moved(turn) if form == "rounded" else WALL
    lines, begin = [], 1
    for b in base.blocks:
        noise = 1e-5 * b.size * rng.uniform(-1, 1, b.vertices.shape)
        points = b.vertices.round(4) if form == "rounded" else b.vertices + noise
        lines += [f"o {b.id}", *(f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist())]
        lines += ["f " + " ".join(str(begin + i) for i in f) for f in b.faces]
        begin += len(points)
    path = tmp_path / "wall.obj"
    path.write_text("\n".join(lines))
    scene = reimported(path, live=base.live).with_dead(base.dead)
    assert len(scene.contacts) == len(WALL.contacts)
    assert solve(scene).load_factor == pytest.approx(reference.load_factor, rel=1e-3)


def test_coordinates_in_another_unit_are_converted_first(tmp_path: Path) -> None:
    """A file in millimetres with --to-unit m is the file in metres, up to rounding."""
    table = as_table(tmp_path)
    head, *rows = table.read_text().splitlines()
    lines = [row.split(",") for row in rows]
    scaled = [",".join([name, *(repr(1000 * float(x)) for x in xs)]) for name, *xs in lines]
    table.write_text("\n".join([head, *scaled]))
    metres = reimported(table, length_unit="mm", to_unit="m")
    assert metres.units.length == "m"
    assert metres.total_weight == pytest.approx(WALL.total_weight, rel=1e-12)
    assert metres.contacts.names == WALL.contacts.names
    with pytest.raises(InputError, match=r"no conversion of length unit 'furlong'.* m, dm, cm, mm"):
        reimported(table, length_unit="furlong", to_unit="m")


@pytest.mark.parametrize(
    ("unit", "force", "density", "said"),
    [("m", "kN", 22, ""), ("m", "N", 22e3, ""), ("mm", "kN", 22e-9, ""), ("furlong", "kN", 1, ""),
     ("mm", "kN", 22, "is 2.2e+10 kN/m³, which no stone has"),
     ("m", "kN", 2200, "is 2.2e+03 kN/m³, which no stone has (5 to 40)")],
)  # fmt: skip
def test_a_density_of_no_stone_is_told(
    tmp_path: Path, unit: str, force: str, density: float, said: str
) -> None:
    asked = {"length_unit": unit, "up": "z", "friction": 0.5, "live": (1, 0, 0)}
    supports = {"supports": "lowest", "density": density, "force_unit": force}
    notes = " ".join(import_geometry(as_table(tmp_path), **asked, **supports).notes)  # type: ignore[arg-type]
    assert said in notes
    assert ("no stone" in notes) == bool(said)


# --- what a file holds --------------------------------------------------------------------------

CUBE = Block.box("cube", (0, 0, 0), (1, 1, 1))


def soup(*shifts: Sequence[float], turned: str = "none", seed: int | None = None) -> Body:
    """Unit cubes with one list of vertices; with a ``seed`` of triangles, cut and listed anyhow."""
    rng = np.random.default_rng(seed)
    points: dict[tuple[float, ...], int] = {}
    faces: list[list[int]] = []
    for shift in shifts:
        corners = [tuple(p) for p in (CUBE.vertices + np.array(shift)).tolist()]
        number = [points.setdefault(p, len(points)) for p in corners]
        own = [[number[i] for i in face] for face in CUBE.faces]
        if seed is not None:
            around = [
                face[k:] + face[:k] for face, k in zip(own, rng.integers(4, size=6), strict=True)
            ]
            own = [[a, *two] for a, b, c, d in around for two in ((b, c), (c, d))]
        share = {"none": 0.0, "all": 1.0, "bodies": float(rng.random() < 0.5), "some": 0.5}[turned]
        faces += [face[::-1] if rng.random() < share else face for face in own]
    order = range(len(faces)) if seed is None else rng.permutation(len(faces))
    return Body("soup", np.array(list(points)), [faces[i] for i in order])


def volumes(bodies: list[Body]) -> list[float]:
    return [Block.polyhedron(b.name, b.vertices, b.faces).volume for b in bodies]


@pytest.mark.parametrize(
    "shifts",
    [
        [(0, 0, 0)],
        [(0, 0, 0), (5, 0, 0)],
        [(0, 0, 0), (0, 0, 1)],
        [(0, 0, 0), (1, 0, 1)],
        [(0, 0, 0), (1, 1, 1)],
        [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1, 2)],
    ],
    ids=["one", "apart", "face shared", "edge shared", "corner shared", "a pile"],
)
@pytest.mark.parametrize("turned", ["none", "all", "bodies", "some"])
def test_bodies_of_one_mesh_are_told_apart(
    shifts: list[tuple[float, float, float]], turned: str
) -> None:
    """Cubes that share vertices, edges or whole faces: each comes out whole, however the faces of
    each are turned."""
    for seed in (None, 1, 2):
        found = separated(soup(*shifts, turned=turned, seed=seed))
        assert volumes(found) == pytest.approx([1.0] * len(shifts))


@pytest.mark.parametrize("seed", mostly_slow(range(200), range(6)))
def test_bodies_around_hollows_are_told_apart(seed: int) -> None:
    """Cubes in most places of a grid: hollows between them are not taken for bodies."""
    rng = np.random.default_rng(seed)
    places = np.argwhere(rng.random((3, 3, 3)) < rng.choice([0.4, 0.8, 1.0])).tolist()
    for turned in ("none", "all", "bodies", "some"):
        blocks = [
            Block.polyhedron(b.name, b.vertices, b.faces)
            for b in separated(soup(*places, turned=turned, seed=seed))
        ]
        assert [b.volume for b in blocks] == pytest.approx([1.0] * len(places))
        found = sorted((b.centroid - 0.5).round(6).tolist() for b in blocks)
        assert found == places


@pytest.mark.parametrize("turned", ["none", "all", "bodies", "some"])
@pytest.mark.parametrize("kind", ["text", "binary"])
def test_stl_of_three_cubes_turned_inwards(tmp_path: Path, kind: str, turned: str) -> None:
    """A mirrored export: two stand exactly on each other, the third 0.3 aside."""
    body = soup((0, 0, 0), (0, 0, 1), (0.3, 0, 2), turned=turned, seed=4)
    path = tmp_path / "cubes.stl"
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    path.write_bytes(mesh.export(file_type="stl" if kind == "binary" else "stl_ascii").encode()
                     if kind == "text" else mesh.export(file_type="stl"))  # fmt: skip
    found = import_geometry(path, length_unit="m", up="z", density=20, friction=0.35,
                            supports="lowest", live=(1, 0, 0))  # fmt: skip
    assert len(found.scene.blocks) == 3
    assert solve(found.scene).load_factor == pytest.approx(0.35, rel=1e-6)


@pytest.mark.parametrize("step", [1, -1], ids=["alike", "from both sides"])
def test_faces_listed_twice_are_no_second_body(step: int) -> None:
    """Programs that draw faces from one side only write each twice."""
    once = soup((0, 0, 0), (0, 0, 1))
    both = replace(once, faces=[*once.faces, *(face[::step] for face in once.faces)])
    assert volumes_mended(separated(both)) == pytest.approx([1.0, 1.0])


def test_the_same_body_twice_is_refused_naming_both(tmp_path: Path) -> None:
    """As two objects, or in one soup of triangles."""
    again = CUBE.vertices[::-1]
    turned = [[7 - i for i in face] for face in CUBE.faces]
    objects = [("a", CUBE.vertices, CUBE.faces), ("b", again, turned)]
    path, begin, lines = tmp_path / "twice.obj", 1, ["o ground"]
    for name, points, faces in [("ground", CUBE.vertices - (0, 0, 1), CUBE.faces), *objects]:
        lines += [f"o {name}", *("v {} {} {}".format(*p) for p in points.tolist())]
        lines += ["f " + " ".join(str(begin + i) for i in face) for face in faces]
        begin += 8
    path.write_text("\n".join(lines))
    asked: dict[str, Any] = {
        "length_unit": "m", "up": "z", "density": 1, "friction": 0.5, "supports": "lowest",
        "live": (1, 0, 0),
    }  # fmt: skip
    with pytest.raises(InputError, match=r"'a' and 'b' are the same body twice.*remove one"):
        _ = import_geometry(path, **asked).scene.contacts
    body = soup((0, 0, -1), (0, 0, 0), (0, 0, 0), seed=2)  # cut otherwise
    path = tmp_path / "twice.stl"
    path.write_bytes(
        trimesh.Trimesh(body.vertices, body.faces, process=False).export(file_type="stl")
    )
    with pytest.raises(InputError, match=r"'b\d' and 'b\d' are the same body twice"):
        _ = import_geometry(path, **asked).scene.contacts


@pytest.mark.parametrize("kind", ["off", "ply", "stl"])
def test_a_body_twice_in_one_mesh_never_weighs_twice(tmp_path: Path, kind: str) -> None:
    """With corners of its own it is named; where a format stores corners once it is mended."""
    below, path = CUBE.vertices - (0, 0, 1), tmp_path / f"twice.{kind}"
    points = np.vstack([below, CUBE.vertices, CUBE.vertices])
    quads = [[8 * k + i for i in face] for k in range(3) for face in CUBE.faces]
    triangles = [(f[0], f[k], f[k + 1]) for f in quads for k in (1, 2)]
    path.write_bytes(
        trimesh.Trimesh(points, triangles, process=False).export(file_type=kind, **{})
        if kind != "off" else "\n".join(
            [f"OFF\n{len(points)} {len(quads)} 0", *(" ".join(map(str, p)) for p in points),
             *(f"4 {' '.join(map(str, f))}" for f in quads)]
        ).encode()
    )  # fmt: skip
    asked: dict[str, Any] = {
        "length_unit": "m", "up": "z", "density": 1, "friction": 0.5, "supports": "lowest",
        "live": (1, 0, 0),
    }  # fmt: skip
    if kind == "off":
        with pytest.raises(InputError, match=r"'b2' and 'b3' are the same body twice"):
            _ = import_geometry(path, **asked).scene.contacts
        return
    scene = import_geometry(path, **asked).scene
    assert [block.volume for block in scene.blocks] == pytest.approx([1.0, 1.0])
    assert {repair.kind for repair in scene.blocks[1].repairs} >= {"doubled"}


@pytest.mark.parametrize("length", [1e-9, 1e-7, 1e-6])
def test_an_edge_of_next_to_no_length(length: float) -> None:
    """A corner cut off by a sliver, which some programs close from both sides."""
    points = np.vstack([CUBE.vertices, CUBE.vertices[6] - (length, 0, 0)])
    quads = [[i for k in face for i in ([6, 8] if k == 6 and 7 in face and 3 in face else [k])]
             for face in map(list, CUBE.faces)]  # fmt: skip
    fans = [[f[0], f[k], f[k + 1]] for f in quads for k in range(1, len(f) - 1)]
    body = Body("b", points, [*fans, [6, 8, 5], [8, 6, 5]])
    assert volumes_mended(separated(body)) == pytest.approx([1.0], rel=1e-5)


def test_stones_that_share_a_face_stay_two_where_a_corner_is_twice_there() -> None:
    """A hair apart, on an edge that both stones have; and triangles of one corner are nothing."""
    once = soup((0, 0, 0), (1, 0, 0))
    shared = int(np.flatnonzero((once.vertices == (1, 1, 1)).all(axis=1))[0])
    points = np.vstack([once.vertices, once.vertices[shared] - (0, 0, 1e-8)])
    faces = [list(face) for face in once.faces]
    for face in faces[:6]:  # those of the first cube, along the edge down from that corner
        below = int(np.flatnonzero((points == (1, 1, 0)).all(axis=1))[0])
        if shared in face and below in face:
            i, k = face.index(shared), face.index(below)
            face.insert(k if (i + 1) % len(face) == k else i, len(points) - 1)
    found = separated(Body("b", points, [*faces, [3, 3, 3], [2, 2, 5]]))
    assert volumes_mended(found) == pytest.approx([1.0, 1.0], rel=1e-6)


def volumes_mended(bodies: list[Body]) -> list[float]:
    return [solid(b.name, b.vertices, b.faces).volume for b in bodies]


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_cavity_stays_with_its_body(mirrored: bool) -> None:
    inner = 0.5 * CUBE.vertices + 0.25
    faces = [list(f) for f in CUBE.faces] + [[8 + i for i in f[::-1]] for f in CUBE.faces]
    hollow = Body("hollow", np.vstack([CUBE.vertices, inner]), [f[::-1] for f in faces]
                  if mirrored else faces)  # fmt: skip
    assert [len(b.faces) for b in separated(hollow)] == [12]


def test_a_stone_in_a_notch_is_no_cavity_however_it_is_turned() -> None:
    """Within the box around a stool, not within its stone."""
    parts = [(0, 0, 2), (1, 0, 2), (2, 0, 2), (0, 0, 1), (2, 0, 1)]
    stool = solid("stool", *cells(parts))
    small = 0.5 * CUBE.vertices + (1.25, 0.25, 1.25)
    faces = [*stool.faces, *([len(stool.vertices) + i for i in f[::-1]] for f in CUBE.faces)]
    body = Body("", np.vstack([stool.vertices, small]), faces)
    assert volumes_mended(separated(body)) == pytest.approx([5.0, 0.125])


def test_open_shells_stay_together_for_a_repair() -> None:
    body = soup((0, 0, 0))
    apart = Body("b", np.vstack([body.vertices, body.vertices + 1e-9]),
                 [*body.faces[:3], *([8 + i for i in f] for f in body.faces[3:])])  # fmt: skip
    assert separated(apart) == [apart]


OBJ_GROUPS = """\
# two bricks of one object
o wall
g left front
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
vn 0 0 1
usemtl stone
f 1 4 3 2
f 5//1 6//1 7//1 8//1
f 1 2 6 5
f 3 4 8 7
g right
v 2 0 0\nv 3 0 0\nv 3 1 0\nv 2 1 0\nv 2 0 1\nv 3 0 1\nv 3 1 1\nv 2 1 1
f -8 -5 -6 -7
f 13 14 \\
15 16
f 9 10 14 13
f 11 12 16 15
f 9 13 16 12
f 10 11 15 14
g left front
f 1/1 5/2 8/3 4/4
f 2 3 7 6
"""


def test_obj_groups_where_there_is_one_object(tmp_path: Path) -> None:
    path = tmp_path / "groups.obj"
    path.write_text(OBJ_GROUPS)
    bodies = read_bodies(path)
    assert [body.name for body in bodies] == ["left front", "right"]
    assert volumes(bodies) == pytest.approx([1.0, 1.0])


def test_obj_objects_of_one_name_are_several_blocks(tmp_path: Path) -> None:
    path = tmp_path / "same.obj"
    path.write_text(OBJ_GROUPS.replace("g right", "o wall").replace("g left front\nf 1/1", "f 1/1"))
    with pytest.raises(InputError, match="block 'wall"):  # its last faces went to the other object
        reimported(path, supports=["wall"])
    export(WALL, path)
    path.write_text("\n".join("o brick" if x.startswith("o ") else x
                              for x in path.read_text().splitlines()))  # fmt: skip
    found = import_geometry(
        path, length_unit="m", up="z", friction=0.5, live=(1, 0, 0), density=1, supports="lowest"
    )
    assert {b.id for b in found.scene.blocks} >= {"brick", "brick#2", "brick#56"}
    assert "numbered" in found.notes[0]


def test_numbering_gives_no_name_that_is_there_already(tmp_path: Path) -> None:
    lines = ["OFF", f"{len(CUBE.vertices)} {len(CUBE.faces)} 0"]
    lines += [" ".join(map(str, point)) for point in CUBE.vertices]
    lines += [" ".join(map(str, (len(face), *face))) for face in CUBE.faces]
    files = [tmp_path / "one" / "a.off", tmp_path / "other" / "a.off", tmp_path / "one" / "a#2.off"]
    for file in files:
        file.parent.mkdir(exist_ok=True)
        file.write_text("\n".join(lines))
    assert [body.name for body in bodies_in(files)] == ["a", "a#3", "a#2"]


def block_model() -> dict[str, Any]:
    """As compas_dem writes it: a support, and a block moved by its element and by the model."""
    mesh = {
        "dtype": "compas.datastructures/Mesh",
        "data": {
            "vertex": {str(k): dict(zip("xyz", v, strict=True))
                       for k, v in enumerate(CUBE.vertices.tolist())},
            "face": {str(k): list(f) for k, f in enumerate(CUBE.faces)},
        },
    }  # fmt: skip
    lift = {"dtype": "compas.geometry/Translation", "data": {"matrix": np.eye(4).tolist()}}
    lift["data"]["matrix"][2][3] = 1.0  # type: ignore[index]
    shift = {"dtype": "compas.geometry/Translation", "data": {"matrix": np.eye(4).tolist()}}
    shift["data"]["matrix"][0][3] = 10.0  # type: ignore[index]
    elements = {
        key: {
            "dtype": "compas_dem.elements/Block",
            "data": {"transformation": t, "features": [], "material": "m", "geometry": mesh,
                     "is_support": key == "guid-a"},
        }
        for key, t in (("guid-a", None), ("guid-b", lift))
    }  # fmt: skip
    materials = {"m": {"dtype": "compas_dem.material/Stone", "data": {"density": 2000}}}
    tree = {"root": {"name": "root", "children": [{"element": key} for key in elements]}}
    return {
        "dtype": "compas_dem.models/BlockModel",
        "data": {"transformation": shift, "elements": elements, "materials": materials,
                 "tree": tree, "graph": {"node": {}}},
    }  # fmt: skip


def test_a_block_model_with_materials_supports_and_transformations(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(json.dumps(block_model()))
    asked: dict[str, Any] = {"length_unit": "m", "up": "z", "friction": 0.5, "live": (1, 0, 0)}
    with pytest.raises(InputError, match=r"density 2000 in the file.*density_factor=0.00981"):
        import_geometry(path, **asked)
    scene = import_geometry(path, density_factor=0.00981, **asked).scene
    assert scene.supports == ("0",)
    assert scene.blocks[1].density == pytest.approx(19.62)
    assert scene.blocks[1].vertices.min(axis=0).tolist() == [10.0, 0.0, 1.0]
    assert scene.contacts.names == ("0-1",)
    assert solve(scene).load_factor == pytest.approx(0.5, rel=1e-5)


def test_groups_of_a_block_model_move_what_is_in_them(tmp_path: Path) -> None:
    document = block_model()
    data = document["data"]
    lift = data["elements"]["guid-b"]["data"]["transformation"]
    group = {"dtype": "compas_model.elements/Group", "data": {"transformation": lift}}
    data["elements"]["guid-c"] = group
    data["tree"]["root"]["children"] = [
        {"element": "guid-c", "children": [{"element": "guid-a"}, {"element": "guid-b"}]}
    ]
    path = tmp_path / "model.json"
    path.write_text(json.dumps(document))
    lowest = [b.vertices.min(axis=0).tolist() for b in read_bodies(path)]
    assert lowest == [[10.0, 0.0, 1.0], [10.0, 0.0, 2.0]]


def test_the_first_compas_wrapped_values(tmp_path: Path) -> None:
    """COMPAS 1: {"dtype", "value": {"datatype", "data"}}, with nodes right inside."""

    def wrapped(data: Any) -> dict[str, Any]:
        return {
            "dtype": "compas_assembly/X",
            "value": {"datatype": "compas_assembly/X", "data": data},
        }

    mesh = block_model()["data"]["elements"]["guid-a"]["data"]["geometry"]["data"]
    node = {"0": {"block": wrapped(mesh), "density": 3.0}, "10": {"block": wrapped(mesh)},
            "9": {"block": wrapped(mesh)}}  # fmt: skip
    path = tmp_path / "old.json"
    path.write_text(json.dumps(wrapped({"node": node, "edge": {}})))
    assert [(b.name, b.density) for b in read_bodies(path)] == [
        ("0", 3.0),
        ("9", None),
        ("10", None),
    ]


TABLE = """\
id;xmin;ymin;zmin;xmax;ymax;zmax;density;support
ground;-1;-1;-1;2;2;0;;yes
lower;0;0;0;1;1;1;20;
upper;0;0;1;1;1;2;10;no
"""


def test_a_table_states_densities_and_supports(tmp_path: Path) -> None:
    path = tmp_path / "tower.csv"
    path.write_text(TABLE)
    asked: dict[str, Any] = {"length_unit": "m", "up": "z", "friction": 0.5, "live": (1, 0, 0)}
    found = import_geometry(path, **asked)
    assert (found.scene.supports, found.scene.total_weight, found.notes) == (("ground",), 30.0, ())
    assert found.scene.blocks[1].bounds is not None
    other = import_geometry(path, density=5, supports=["lower", "ground"], **asked)
    assert (other.scene.supports, other.scene.total_weight) == (("ground", "lower"), 5.0)
    assert len(other.notes) == 2


def test_lowest_blocks_are_all_that_reach_the_bottom(tmp_path: Path) -> None:
    """Three feet, of which two are 0.5 % of the height higher, and a block at 5 %."""
    rows = ["id,xmin,ymin,zmin,xmax,ymax,zmax"]
    for i, z in enumerate((0.0, 0.05, 0.05, 0.5)):
        rows.append(f"foot{i},{2 * i},0,{z},{2 * i + 1},1,3")
    rows.append("beam,0,0,3,7,1,10")
    path = tmp_path / "feet.csv"
    path.write_text("\n".join(rows))
    scene = import_geometry(
        path, length_unit="m", up="z", friction=0.5, live=(1, 0, 0), density=1, supports="lowest"
    ).scene
    assert scene.supports == ("foot0", "foot1", "foot2")


@pytest.mark.parametrize(("noise", "taken"), [(0.2, False), (0.5, True), (4.0, None)])
def test_a_survey_with_noise_is_imported_with_a_word(
    noise: float, taken: bool | None, tmp_path: Path
) -> None:
    """A wall in mm whose corners are off by up to so much: within the usual tolerance without a
    word, half a millimetre with one, and what is no survey any more is refused as before."""
    random, lines, first = np.random.default_rng(3), list[str](), 1
    for block in wall(running_bond(3, 4), unit=(300, 150, 100), friction=0.7).blocks:
        off = random.uniform(-noise, noise, block.vertices.shape)
        lines += [f"o {block.id}", *("v {} {} {}".format(*p) for p in block.vertices + off)]
        lines += ["f " + " ".join(str(first + i) for i in face) for face in block.faces]
        first += len(block.vertices)
    file = tmp_path / "survey.obj"
    file.write_text("\n".join(lines))
    found = import_geometry(file, length_unit="mm", to_unit="m", up="z", friction=0.7, density=18,
                            supports=["ground"], live=(1, 0, 0))  # fmt: skip
    words = [note for note in found.notes if "as by noise" in note]
    assert len(words) == bool(taken)
    if taken is None:
        with pytest.raises(InputError):
            len(found.scene.contacts)
        return
    assert len(found.scene.contacts) == 31
    assert (found.scene.joint_tolerance is not None) == taken
    assert solve(found.scene).load_factor == pytest.approx(0.7, rel=0.01)


# --- nothing is guessed -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"supports": None}, "no file marks supports: say which blocks are fixed .supports="),
        ({"density": None}, "block '.*' has no density in the file: give density="),
        ({"up": "-z"}, "up must be x, y or z, got '-z'"),
        ({"supports": ["floor"]}, "support 'floor' is not a block; the blocks are 'b1.1'"),
        ({"friction": -1}, "friction of the scene must be finite and not negative, got -1"),
        ({"density": -20}, "density of block '.*' must be finite and not negative, got -20"),
        ({"live": (0, 0, 0)}, "the live load is zero everywhere"),
        ({"live": (1, 0)}, "acceleration must be 3 numbers"),
        ({"joint_tolerance": 0}, "joint_tolerance"),
    ],
)
def test_what_is_asked_for(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        reimported(as_polygons(tmp_path), **changes)


def test_a_folder_with_strange_files_is_refused(tmp_path: Path) -> None:
    folder = as_folder("stl")(tmp_path)
    (folder / "notes.txt").write_text("left alone")
    assert len(reimported(folder).blocks) == len(WALL.blocks)
    (folder / "roof.dwg").write_text("?")
    with pytest.raises(InputError, match=r"also holds 'roof.dwg'"):
        reimported(folder)
    (folder / "roof.dwg").unlink()
    for path in folder.glob("*.stl"):
        path.unlink()
    with pytest.raises(InputError, match="holds no geometry"):
        reimported(folder)


# --- export -------------------------------------------------------------------------------------


def test_obj_keeps_every_digit(tmp_path: Path) -> None:
    bodies = read_bodies(export(WALL, tmp_path / "w.obj")[0])
    for body, block in zip(bodies, WALL.blocks, strict=True):
        assert body.name == block.id
        np.testing.assert_array_equal(body.vertices, block.vertices)


def test_contacts_as_csv(tmp_path: Path, reference: Any) -> None:
    """The pressure centre lies on the contact, and N e2 = M1 there."""
    (path,) = export(WALL, tmp_path / "c.csv", reference)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["contact"] for row in rows] == list(WALL.contacts.names)
    for j, row in enumerate(rows):
        normal = float(row["N (kN)"])
        assert normal == reference.forces[j, 2]
        if not row["px (m)"]:
            continue
        contact = WALL.contacts[j]
        centre = np.array([float(row[f"p{x} (m)"]) for x in "xyz"])
        offset = centre - contact.origin
        assert abs(offset @ contact.normal) < 1e-12
        assert offset @ contact.t2 * normal == pytest.approx(float(row["M1 (kN m)"]), abs=1e-12)
        reach = np.linalg.norm(contact.corners - contact.origin, axis=1).max()
        assert np.linalg.norm(offset) <= reach * (1 + 1e-3)


def test_exports_are_refused_with_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"give a name that ends in \.obj, \.glb, \.csv"):
        export(WALL, tmp_path / "w.dxf")
    other = solve(Scene((Block.box("g", (0, 0, -1), (1, 1, 0)),
                         Block.box("b", (0, 0, 0), (1, 1, 1), 1.0)), ("g",),
                        Load(acceleration=(1, 0, 0))))  # fmt: skip
    with pytest.raises(InputError, match="it does not belong to it"):
        export(WALL, tmp_path / "w.csv", other)
    assert not list(tmp_path.iterdir())


@pytest.mark.exhaustive
def test_what_trimesh_gets_over_is_not_shown(tmp_path: Path) -> None:
    """Normals of a text STL are not needed: a broken one printed a traceback to stderr."""
    (tmp_path / "wall.stl").write_text(text_stl().replace("facet normal", "facet normal x", 1))
    code = (
        "from cvxlimit.io import read_bodies\n"
        "try:\n print(len(read_bodies('wall.stl')))\n"
        "except ValueError as error:\n print(error)\n"
    )
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert found.stdout.count("\n") == 1
    assert found.stderr == ""


# --- tables with decimal commas -----------------------------------------------------------------

HEAD = "id;xmin;ymin;zmin;xmax;ymax;zmax;density;support\n"
ASKED: dict[str, Any] = {"length_unit": "m", "up": "z", "friction": 0.7, "live": (1, 0, 0)}


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_table_with_decimal_commas(tmp_path: Path, separator: str) -> None:
    """As a spreadsheet in German writes it: the stone of 1 x 1 x 1 tips at 0.5."""
    rows = "boden;0;0;0;1,0;1;1;;1\nstein;0,25;0;1;1,25;1;2;20,0;0\n"
    path = tmp_path / "tabelle.csv"
    path.write_text("\ufeff" + (HEAD + rows).replace(";", separator))
    scene = import_geometry(path, **ASKED).scene
    assert scene.total_weight == pytest.approx(20.0)
    assert solve(scene).load_factor == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("a;0;0;0;1,5;1;1;;1\nb;0.25;0;1;1;1;2;20;0\n", "'1,5' with a comma, and '0.25' stands"),
        ("a;0;0;0;1,500;1;1;;1\nb;0;0;1;1;1;2;20;0\n", "part thousands as well as decimals"),
        ("a;0;0;0;1,5,0;1;1;;1\nb;0;0;1;1;1;2;20;0\n", "must be a number"),
    ],
    ids=["both", "thousands", "two"],
)
def test_commas_that_may_be_something_else(tmp_path: Path, rows: str, message: str) -> None:
    path = tmp_path / "table.csv"
    path.write_text(HEAD + rows)
    with pytest.raises(InputError, match=message):
        read_bodies(path)


def test_three_decimals_that_cannot_be_thousands(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(HEAD + "a;0;0;0;1,500;1;0,250;;1\n")
    assert read_bodies(path)[0].vertices[1].tolist() == [1.5, 1.0, 0.25]


def test_decimal_commas_between_commas(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text((HEAD + "a;0;0;0;1,5;1;1;;1\n").replace(";", ","))
    with pytest.raises(InputError, match="part the cells by semicolons"):
        read_bodies(path)


# --- supports -----------------------------------------------------------------------------------


def test_lowest_says_which_stones_of_the_structure_became_supports(tmp_path: Path) -> None:
    path = export(builtin_scene("arch"), tmp_path / "arch.obj")[0]
    bodies = [body.name for body in read_bodies(path)]
    found = import_geometry(path, density=20, supports="lowest", **ASKED)
    (note,) = found.notes
    assert all(repr(name) in note for name in found.scene.supports)
    assert "stones of the structure itself" in note
    assert len(found.scene.supports) < len(bodies)
    slab = Block.box("slab", (-50, -50, -3), (50, 50, -2))
    standing = replace(WALL, blocks=(*WALL.blocks, slab), supports=(*WALL.supports, "slab"))
    path = export(standing, tmp_path / "wall.obj")[0]
    found = import_geometry(path, density=20, supports="lowest", **ASKED)
    assert (found.scene.supports, found.notes) == (("slab",), ())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_as_a_buffer_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.bin")
    path = tmp_path / "scene.gltf"
    path.write_text(json.dumps(gltf(buffers=[{"byteLength": 240, "uri": "pipe.bin"}])))
    with pytest.raises(InputError, match="no regular file but a pipe"):
        read_bodies(path)


# --- ground of no thickness ---------------------------------------------------------------------


def plane_and_stone(path: Path, turn: Rotation, triangles: bool = True) -> Path:
    """A stone of 1 x 1 x 2 on a square of 6 x 6 in its bottom plane, all turned."""
    square = np.array([(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], dtype=float)
    stone = (CUBE.vertices - (0.5, 0.5, 0.0)) * (1, 1, 2)
    points = turn.apply(np.vstack([square, stone]))
    faces: list[list[int]] = [[0, 1, 2], [0, 2, 3]] if triangles else [[0, 1, 2, 3]]
    own = [[4 + i for i in face] for face in CUBE.faces]
    if path.suffix == ".obj":
        lines = ["v {} {} {}".format(*p) for p in points.tolist()]
        for name, listed in (("ground", faces), ("stone", own)):
            lines += [f"o {name}", *("f " + " ".join(str(i + 1) for i in f) for f in listed)]
        path.write_text("\n".join(lines))
        return path
    cut = triangulated(points, [*faces, *own])[0]
    data = trimesh.Trimesh(points, cut, process=False).export(file_type=path.suffix[1:])
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


@pytest.mark.parametrize("supports", ["lowest", None, "named"])
@pytest.mark.parametrize("name", ["a.obj", "b.obj", "a.stl", "a.ply", "a.off"])
def test_ground_of_one_face(tmp_path: Path, name: str, supports: str | None) -> None:
    path = plane_and_stone(tmp_path / name, Rotation.identity(), name[0] == "a")
    if supports == "named":
        supports = next(b.name for b in read_bodies(path) if len(b.faces) < 6)
    found = import_geometry(path, density=20, supports=supports, **ASKED)
    assert len(found.scene.supports) == 1
    assert "a plane of no thickness, taken as support" in found.notes[0]
    assert solve(found.scene).load_factor == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("degrees", [5.0, 30.0])
def test_inclined_ground_of_one_face(tmp_path: Path, degrees: float) -> None:
    """Along the slope the stone tips: (h/2 sin + a h/2 cos') of a load along x is worked out in the
    turned frame, in which gravity is inclined."""
    t = np.radians(degrees)
    path = plane_and_stone(tmp_path / "a.stl", Rotation.from_euler("y", degrees, degrees=True))
    asked = ASKED | {"friction": 5.0}
    scene = import_geometry(path, density=20, supports="lowest", **asked).scene
    # down the slope is +x: moments about the lower edge, of unit weight and of the load a along x
    stands, pushes = 0.5 * np.cos(t) - 1.0 * np.sin(t), 1.0 * np.cos(t) + 0.5 * np.sin(t)
    if stands < 0.0:
        assert solve(scene).load_factor is None
    else:
        assert solve(scene).load_factor == pytest.approx(stands / pushes, rel=1e-5)


def test_a_free_plane_is_no_stone(tmp_path: Path) -> None:
    path = plane_and_stone(tmp_path / "a.obj", Rotation.identity())
    with pytest.raises(InputError, match=r"'ground' is a plane of no thickness.*only be a support"):
        import_geometry(path, density=20, supports=["stone"], **ASKED)


# --- numbers with too few digits ----------------------------------------------------------------

UTM = np.array([513_045.0, 4_502_345.0, 112.0])


def brick_wall(at: np.ndarray) -> list[tuple[np.ndarray, list[list[int]]]]:
    """Four bricks of 0.25 x 0.12 x 0.065 on each other."""
    brick = CUBE.vertices * (0.25, 0.12, 0.065)
    faces = triangulated(CUBE.vertices, CUBE.faces)[0].tolist()
    return [(brick + at + (0, 0, 0.065 * i), faces) for i in range(4)]


def written(path: Path, at: np.ndarray, form: str) -> Path:
    """As binary STL or PLY in single precision, or as text in a format of numbers."""
    bricks = brick_wall(at)
    points = np.concatenate([p for p, _ in bricks])
    faces = [[8 * i + k for k in f] for i, (_, own) in enumerate(bricks) for f in own]
    if path.suffix in (".stl", ".ply"):
        single = points.astype(np.float32)
        mesh = trimesh.Trimesh(single, faces, process=False)
        path.write_bytes(mesh.export(file_type=path.suffix[1:]))
    elif path.suffix == ".csv":
        ends = [np.concatenate([p.min(0), p.max(0)]) for p, _ in bricks]
        rows = [",".join([f"b{i}", *(format(x, form) for x in e)]) for i, e in enumerate(ends)]
        path.write_text("id,xmin,ymin,zmin,xmax,ymax,zmax\n" + "\n".join(rows))
    else:
        lines = ["v " + " ".join(format(x, form) for x in p) for p in points.tolist()]
        for i, (_, own) in enumerate(bricks):
            lines += [f"o b{i}", *("f " + " ".join(str(8 * i + k + 1) for k in f) for f in own)]
        path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(
    ("name", "form"),
    [("a.stl", ""), ("a.ply", ""), ("a.obj", ".6g"), ("a.obj", ".7g"), ("a.csv", ".6g")],
)
def test_numbers_that_cannot_tell_blocks_apart_are_named(
    tmp_path: Path, name: str, form: str
) -> None:
    asked = ASKED | {"density": 20, "supports": "lowest"}
    here = written(tmp_path / name, np.zeros(3), form)
    found = import_geometry(here, **asked)
    assert solve(found.scene).load_factor == pytest.approx(0.7, rel=1e-4)
    assert not any("cannot tell" in note for note in found.notes)
    there = written(tmp_path / name, UTM, form)
    said = "numbers cannot tell its blocks apart: along y .*steps of .* move the model"
    with pytest.raises(InputError, match=said):
        import_geometry(there, **asked)


def test_map_coordinates_in_full_are_fine(tmp_path: Path) -> None:
    path = written(tmp_path / "a.obj", UTM, ".12g")
    found = import_geometry(path, density=20, supports="lowest", **ASKED)
    assert solve(found.scene).load_factor == pytest.approx(0.7, rel=1e-4)
    assert not any("cannot tell" in note for note in found.notes)


def test_digits_are_counted_where_many_corners_share_few_coordinates() -> None:
    """A wall of 10,000 bricks has 80,000 corners, but only some 200 numbers to look at."""
    x, z = 500_000.625 + 0.125 * np.arange(101), np.round(0.1 * np.arange(101), 1)
    corners = np.stack(np.meshgrid(x, [0.0, 0.3], z), axis=-1).reshape(-1, 3)
    brick = Body("", np.array([[x[0], 0.0, 0.0], [x[1], 0.3, 0.1]]), (), is_box=True)
    assert not too_few_digits([brick, brick, Body("", np.tile(corners, (4, 1)), ())])


# --- what is likely meant otherwise --------------------------------------------------------------


def pile(path: Path, scale: float = 1.0, axes: Sequence[int] = (0, 1, 2)) -> Path:
    """A slab with two cubes on it, as an OBJ in other axes or another unit."""
    lines = list[str]()
    for i, (name, low, high) in enumerate(
        [("slab", (-1, -1, -0.5), (2, 2, 0)), ("low", (0, 0, 0), (0.5, 0.5, 0.5)),
         ("top", (0.1, 0, 0.5), (0.6, 0.5, 1))]
    ):  # fmt: skip
        block = Block.box(name, low, high)
        points = scale * block.vertices[:, list(axes)]
        lines += [f"o {name}", *(f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points.tolist())]
        lines += ["f " + " ".join(str(8 * i + k + 1) for k in face) for face in block.faces]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(
    ("scale", "said"),
    [(1.0, ""), (9.0, ""), (11.0, "5.5 m across: are coordinates in m. In cm it would"),
     (50.0, "25 m across: are coordinates in m. In cm it would have 0.25 m"),
     (500.0, "433 m across: are coordinates in m. In mm the largest block would have 0.433 m"),
     (0.021, ""), (0.019, "smallest stone is 0.0095 m across: are coordinates in m")],
)  # fmt: skip
def test_stones_of_no_size_ask_about_the_unit_once(tmp_path: Path, scale: float, said: str) -> None:
    found = import_geometry(pile(tmp_path / "a.obj", scale), length_unit="m", up="z", density=20,
                            friction=0.7, supports="lowest", live=(1, 0, 0))  # fmt: skip
    doubts = [line for line in (*found.notes, *found.scene.doubts) if "coordinates" in line]
    assert len(doubts) == bool(said)
    assert not said or re.search(said, doubts[0])


def test_another_axis_up_is_asked_for(tmp_path: Path) -> None:
    """Read with z up, the slab is a wall beside the cubes: in the answer's note too."""
    path = pile(tmp_path / "a.obj", axes=(0, 2, 1))
    asked: dict[str, Any] = {"length_unit": "m", "density": 20, "friction": 0.7,
                             "supports": ["slab"], "live": (1, 0, 0)}  # fmt: skip
    wrong = import_geometry(path, up="z", **asked).scene
    assert any("is y up?" in said for said in wrong.doubts)
    answer = solve(wrong)
    assert answer.status is Status.DEAD_LOAD_UNSTABLE
    assert "is y up?" in answer.note
    assert not import_geometry(path, up="y", **asked).scene.doubts


def test_no_built_in_scene_is_asked_about_its_axes() -> None:
    assert not {name for name, build in BUILTIN.items() if build().doubts}


def test_supports_that_are_not_the_lowest_are_told(tmp_path: Path) -> None:
    asked: dict[str, Any] = {"length_unit": "m", "up": "z", "density": 20, "friction": 0.7,
                             "live": (1, 0, 0)}  # fmt: skip
    path = pile(tmp_path / "a.obj")
    notes = import_geometry(path, supports=["low"], **asked).notes
    assert any("no support is as low as block 'slab', which is free" in note for note in notes)
    assert not import_geometry(path, supports=["slab"], **asked).notes


def test_hulls_that_touch_in_points_get_one_verdict(tmp_path: Path) -> None:
    """Stones of a wall as hulls of points on their faces: they meet at angles."""
    rng, lines, before = np.random.default_rng(3), ["o ground"], 1
    bodies = [("ground", Block.box("g", (-1, -1, -0.3), (4, 2, 0)).vertices)]
    for i in range(4):
        for k in range(3):
            low = np.array([0.6 * i + 0.3 * (k % 2), 0.0, 0.3 * k])
            points = rng.random((40, 3))
            points[np.arange(40), rng.integers(3, size=40)] = rng.integers(2, size=40)
            points += rng.uniform(-0.01, 0.0, (40, 3)) * np.sign(points - 0.5)
            bodies.append((f"s{k}_{i}", low + points * (0.6, 0.3, 0.3)))
    lines = []
    for name, points in bodies:
        hull = trimesh.Trimesh(points, process=False).convex_hull
        lines += [f"o {name}", *("v {:.9g} {:.9g} {:.9g}".format(*p) for p in hull.vertices)]
        lines += ["f " + " ".join(str(i + before) for i in f) for f in hull.faces.tolist()]
        before += len(hull.vertices)
    (tmp_path / "hulls.obj").write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"the blocks do not touch in faces: at \d+ of the"):
        _ = import_geometry(tmp_path / "hulls.obj", length_unit="m", up="z", density=20,
                            friction=0.7, supports="lowest", live=PUSH).scene.contacts  # fmt: skip


# --- 3DEC ----------------------------------------------------------------------------------------

OLD_WORDS = """\
new
; a slab, and a stone with a slanted top on it, another against that
poly region 1 brick -1 2 -1 2 -0.5 0
poly reg 2 mat 3 prism &
  a (0,0,0) (1,0,0) (1,1,0) (0,1,0) &   ; the bottom
  b 0 0 1  1 0 2  1 1 2  0 1 1
poly reg 2 face 1,0,0 1,0,2 1,1,2 1,1,0 face 2,0,0 2,1,0 2,1,2 2,0,2 &
  face 1 0 0 2 0 0 2 0 2 1 0 2  face 1 1 0 1 1 2 2 1 2 2 1 0 &
  face 1 0 0 1 1 0 2 1 0 2 0 0  face 1 0 2 2 0 2 2 1 2 1 1 2
prop mat 3 density 2700
fix range region 1
cycle 100
"""

NEW_WORDS = """\
model new
block create brick (-1, 2) (-1, 2) (-0.5, 0) group 'ground'
block create prism face-1 (0,0,0) (1,0,0) (1,1,0) (0,1,0) ...
  face-2 (0,0,1) (1,0,2) (1,1,2) (0,1,1) group "stones" slot "material"
BLOCK CREATE brick 1 2 0 1 0 2 group stones
block fix range group 'ground'
"""


@pytest.mark.parametrize(
    ("text", "names"),
    [(OLD_WORDS, ["region 1", "region 2", "region 2#2"]),
     (NEW_WORDS, ["ground", "stones", "stones#2"])],
)  # fmt: skip
def test_blocks_of_3dec_in_old_and_new_words(tmp_path: Path, text: str, names: list[str]) -> None:
    path = tmp_path / "wall.dat"
    path.write_text(text)
    found = import_geometry(path, supports="lowest", **{**ASKED, "density": 20})
    assert [block.id for block in found.scene.blocks] == names
    assert [block.volume for block in found.scene.blocks] == pytest.approx([4.5, 1.5, 2.0])
    assert len(found.scene.contacts) == 3
    assert any("these commands are left alone" in note for note in found.notes)


# --- digits that are nearly too few ---------------------------------------------------------------


@pytest.mark.parametrize(("shift", "outcome"), [(0.0, ""), (2.0**11, "told"), (2.0**20, "refused")])
def test_single_precision_is_never_silent(tmp_path: Path, shift: float, outcome: str) -> None:
    """Neighbouring numbers lie 1e-4 apart at 2 km, and 0.06 at 1000 km; stones are 0.5 wide."""
    soups = [Block.box(n, low, high) for n, low, high in
             [("slab", (-1, -1, -0.5), (2, 2, 0)), ("low", (0, 0, 0), (0.5, 0.5, 0.3)),
              ("top", (0, 0, 0.3), (0.5, 0.5, 0.9))]]  # fmt: skip
    meshes = [mesh_of(block) for block in soups]
    for mesh in meshes:
        mesh.apply_translation((shift, 0, 0))
    path = tmp_path / "a.stl"
    path.write_bytes(trimesh.util.concatenate(meshes).export(file_type="stl"))
    if outcome == "refused":
        with pytest.raises(InputError, match="numbers cannot tell its blocks apart: along x"):
            import_geometry(path, supports="lowest", **{**ASKED, "density": 20})
        return
    found = import_geometry(path, supports="lowest", **{**ASKED, "density": 20})
    assert any("numbers are coarse" in note for note in found.notes) == (outcome == "told")
    assert solve(found.scene).load_factor == pytest.approx(0.5 / 0.9, rel=1e-3)
