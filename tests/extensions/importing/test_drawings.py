"""DXF drawings, OFF meshes and files of COMPAS 0.x: bodies against hand calculation, refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from cells import CUBE, cells
from cvxlimit import solve
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import BOX_FACES, Block
from cvxlimit.geometry.solids import solid
from cvxlimit.io import import_geometry, read_bodies

ezdxf = pytest.importorskip("ezdxf")

ASKED: dict[str, Any] = {"length_unit": "m", "up": "z", "friction": 0.7, "live": (1, 0, 0)}
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def blocks_of(path: Path) -> dict[str, Block]:
    return {b.name: solid(b.name or "unnamed", b.vertices, b.faces) for b in read_bodies(path)}


def drawing(path: Path, draw: Callable[[Any], None]) -> Path:
    document = ezdxf.new("R2010")
    draw(document.modelspace())
    document.saveas(path)
    return path


class TestDrawings:
    def test_closed_polylines_with_elevation_and_thickness(self, tmp_path: Path) -> None:
        def draw(space: Any) -> None:
            plate = {"elevation": 3.0, "thickness": 0.5, "layer": "plate"}
            space.add_lwpolyline([(0, 0), (2, 0), (2, 1), (0, 1)], close=True, dxfattribs=plate)
            front = {"elevation": 1.0, "thickness": 2.0, "layer": "front", "extrusion": (0, -1, 0)}
            space.add_lwpolyline(SQUARE, close=True, dxfattribs=front)
            back = {"elevation": (0, 0, 4), "thickness": -1.0, "layer": "back"}
            space.add_polyline2d([*SQUARE, SQUARE[0]], dxfattribs=back)
            space.add_line((0, 0), (9, 9))
            space.add_text("not a block")

        found = blocks_of(drawing(tmp_path / "a.dxf", draw))
        assert {name: b.volume for name, b in found.items()} == pytest.approx(
            {"plate": 1.0, "front": 2.0, "back": 1.0}
        )
        np.testing.assert_allclose(found["plate"].centroid, (1, 0.5, 3.25))
        np.testing.assert_allclose(found["front"].centroid, (0.5, -2, 0.5))
        np.testing.assert_allclose(found["back"].centroid, (0.5, 0.5, 3.5))

    def test_arcs_of_polylines(self, tmp_path: Path) -> None:
        """Two half circles: a disc of 64 chords; both sides of an arc are cut alike."""
        disc = [(0, 0, 0, 0, 1), (2, 0, 0, 0, 1)]
        path = drawing(tmp_path / "a.dxf", lambda space: space.add_lwpolyline(
            disc, close=True, dxfattribs={"thickness": 1.0}))  # fmt: skip
        (block,) = blocks_of(path).values()
        assert block.volume == pytest.approx(32.0 * np.sin(2.0 * np.pi / 64.0))
        np.testing.assert_allclose(block.centroid, (1, 0, 0.5), atol=1e-12)

    def test_faces_meshes_and_solids(self, tmp_path: Path) -> None:
        """Cubes as 3D faces, polyface mesh, mesh, 2D solid with a thickness, inserted block."""
        forms = pytest.importorskip("ezdxf.render.forms")

        def cube(*shift: float) -> Any:
            made = forms.cube(center=False)
            made.translate(*shift)
            return made

        def draw(space: Any) -> None:
            for z in (0, 1):
                cube(0, 0, z).render_3dfaces(space, dxfattribs={"layer": "faces"})
            cube(3, 0, 0).render_polyface(space, dxfattribs={"layer": "polyface"})
            cube(6, 0, 0).render_mesh(space, dxfattribs={"layer": "mesh"})
            corners = [(9, 0), (10, 0), (9, 1), (10, 1)]
            space.add_solid(corners, dxfattribs={"thickness": 1.0, "layer": "solid"})
            inside = space.doc.blocks.new("stone")
            cube(0, 0, 0).render_polyface(inside, dxfattribs={"layer": "inserted"})
            space.add_blockref("stone", (12, 0, 0), dxfattribs={"xscale": 2.0})

        found = blocks_of(drawing(tmp_path / "a.dxf", draw))
        volumes = dict.fromkeys(("faces.1", "faces.2", "polyface", "mesh", "solid"), 1.0)
        assert {name: b.volume for name, b in found.items()} == pytest.approx(
            {**volumes, "inserted": 2.0}
        )
        assert sorted(b.centroid[0] for b in found.values()) == pytest.approx(
            [0.5, 0.5, 3.5, 6.5, 9.5, 13.0]
        )

    def test_a_solid_of_the_modelling_kernel(self, tmp_path: Path) -> None:
        api = pytest.importorskip("ezdxf.acis.api")
        forms = pytest.importorskip("ezdxf.render.forms")
        document = ezdxf.new("R2000")
        body = document.modelspace().add_3dsolid(dxfattribs={"layer": "stone"})
        api.export_dxf(body, [api.body_from_mesh(forms.cube(center=False))])
        document.saveas(tmp_path / "a.dxf")
        assert blocks_of(tmp_path / "a.dxf")["stone"].volume == pytest.approx(1.0)
        body.sat = ["garbage"]
        document.saveas(tmp_path / "a.dxf")
        with pytest.raises(InputError, match=r"solid on layer 'stone'.*convert it to a mesh"):
            read_bodies(tmp_path / "a.dxf")

    def test_it_is_solved(self, tmp_path: Path) -> None:
        """A slab and a tower of 1 x 1 x 2 on it, drawn in plan: it tips at 0.5."""

        def draw(space: Any) -> None:
            wide = [(-1, -1), (2, -1), (2, 2), (-1, 2)]
            space.add_lwpolyline(wide, close=True, dxfattribs={"thickness": -1, "layer": "slab"})
            space.add_lwpolyline(SQUARE, close=True, dxfattribs={"thickness": 2, "layer": "tower"})

        path = drawing(tmp_path / "a.dxf", draw)
        scene = import_geometry(path, density=20, supports=["slab"], **ASKED).scene
        assert solve(scene).load_factor == pytest.approx(0.5, rel=1e-6)

    @pytest.mark.parametrize(
        ("draw", "message"),
        [
            (lambda s: s.add_lwpolyline(SQUARE), "an open polyline on layer '0'"),
            (lambda s: s.add_line((0, 0), (1, 1)), "nothing that encloses a block: draw closed"),
            (lambda s: s.add_circle((0, 0), 1.0), "CIRCLE on layer '0' is no body"),
        ],
        ids=["open", "line", "circle"],
    )
    def test_refused(self, tmp_path: Path, draw: Any, message: str) -> None:
        with pytest.raises(InputError, match=message):
            read_bodies(drawing(tmp_path / "a.dxf", draw))

    def test_what_a_drawing_does_not_show_is_left_out_and_told(self, tmp_path: Path) -> None:
        """A tower on a slab; on it stands what would not leave it as it is: on layers that are off
        or frozen, hidden by itself, and in blocks inserted there. In a block layer 0 is that on
        which it is inserted; a layer that is off does not hide what is on others in the block."""

        def draw(space: Any) -> None:
            layers = space.doc.layers
            layers.add("Off").off()
            layers.add("frozen").freeze()
            layers.add("shown")
            on_it = {"thickness": 1.0, "elevation": 1.5}

            def stone(where: Any, **given: Any) -> None:
                where.add_lwpolyline(SQUARE, close=True, dxfattribs={**on_it, **given})

            wide = [(-1, -1), (2, -1), (2, 2), (-1, 2)]
            space.add_lwpolyline(wide, close=True, dxfattribs={"thickness": -1, "layer": "slab"})
            stone(space, layer="off")
            stone(space, layer="frozen")
            stone(space, layer="shown", invisible=1)
            space.add_text("a note", dxfattribs={"layer": "off"})
            inside = space.doc.blocks.new("stone")
            stone(inside, elevation=0.0, thickness=2.0, layer="tower")
            stone(inside, layer="0")
            space.add_blockref("stone", (0, 0), dxfattribs={"layer": "off"})
            space.add_blockref("stone", (0, 0), dxfattribs={"layer": "frozen"})

        path = drawing(tmp_path / "a.dxf", draw)
        found = import_geometry(path, density=20, supports=["slab"], **ASKED)
        assert [block.id for block in found.scene.blocks] == ["slab", "tower"]
        said = (
            "left out: 5 objects that the drawing does not show (layers 'frozen', 'off', 'shown')"
        )
        assert said in found.notes
        assert solve(found.scene).load_factor == pytest.approx(0.5, rel=1e-6)

    def test_a_drawing_that_shows_nothing(self, tmp_path: Path) -> None:
        def draw(space: Any) -> None:
            space.doc.layers.add("old").freeze()
            space.add_lwpolyline(SQUARE, close=True, dxfattribs={"thickness": 1, "layer": "old"})

        with pytest.raises(
            InputError, match=r"but 1 object that .* not show \(layers 'old'\): draw"
        ):
            read_bodies(drawing(tmp_path / "a.dxf", draw))

    @pytest.mark.parametrize(
        ("number", "unit"), [(0, ""), (1, "in"), (4, "mm"), (6, ""), (3, "miles")]
    )
    def test_a_unit_that_differs_is_told(self, tmp_path: Path, number: int, unit: str) -> None:
        def draw(space: Any) -> None:
            space.doc.header["$INSUNITS"] = number
            for low in (-1, 0):
                plate = {"elevation": low, "thickness": 1, "layer": f"b{low}"}
                space.add_lwpolyline(SQUARE, close=True, dxfattribs=plate)

        path = drawing(tmp_path / "a.dxf", draw)
        notes = import_geometry(path, density=20, supports="lowest", **ASKED).notes
        said = f"the unit of 2 blocks is {unit} in the file, and m is what was asked for"
        assert any(said in note for note in notes) == bool(unit)
        if unit == "in":
            asked = {**ASKED, "length_unit": "in", "to_unit": "m"}
            other = import_geometry(path, density=20, supports="lowest", **asked)
            assert not any("asked for" in note for note in other.notes)

    def test_an_arch_with_bulged_edges(self, tmp_path: Path) -> None:
        """Nine voussoirs between radii of 0.8 and 1 m: a linear program in the plane, written for
        this arch, of the polygons whose arcs of 20 degrees are four chords."""
        bulge, angles = np.tan(np.radians(20.0) / 4.0), np.radians(20.0 * np.arange(10))
        spokes = np.column_stack([np.cos(angles), np.sin(angles)])

        def draw(space: Any) -> None:
            attributes = {"thickness": 0.5}
            ground = [(-1.5, -0.5), (1.5, -0.5), (1.5, 0), (-1.5, 0)]
            space.add_lwpolyline(ground, close=True, dxfattribs={**attributes, "layer": "ground"})
            for a, b in pairwise(spokes):
                corners = [(*0.8 * a, 0), (*a, bulge), (*b, 0), (*0.8 * b, -bulge)]
                space.add_lwpolyline(corners, "xyb", close=True, dxfattribs=attributes)

        path = drawing(tmp_path / "a.dxf", draw)
        asked = {**ASKED, "up": "y"}
        scene = import_geometry(path, density=20, supports=["ground"], **asked).scene
        assert len(scene.contacts) == 10
        fine = np.radians(np.arange(0.0, 181.0, 5.0))
        ring = np.column_stack([np.cos(fine), np.sin(fine)])
        stones = [
            np.concatenate([ring[4 * k : 4 * k + 5], 0.8 * ring[4 * k : 4 * k + 5][::-1]])
            for k in range(9)
        ]
        expected = ring_load_factor(stones, spokes, 0.7)
        assert solve(scene).load_factor == pytest.approx(expected, rel=1e-6)

    def test_blocks_of_blocks_of_blocks(self, tmp_path: Path) -> None:
        """10^12 lines in a file of a few kB."""

        def draw(space: Any) -> None:
            inside = None
            for i in range(12):
                block = space.doc.blocks.new(f"b{i}")
                for k in range(10):
                    if inside:
                        block.add_blockref(inside, (k, 0))
                    else:
                        block.add_line((k, 0), (k, 1))
                inside = f"b{i}"
            space.add_blockref(inside, (0, 0))

        with pytest.raises(InputError, match="more than 100000 entities once"):
            read_bodies(drawing(tmp_path / "a.dxf", draw))

    @pytest.mark.parametrize("seed", range(15))
    def test_hostile(self, tmp_path: Path, seed: int) -> None:
        """Bytes changed or cut off: bodies, or a refusal."""
        path = drawing(tmp_path / "a.dxf", lambda space: space.add_lwpolyline(
            SQUARE, close=True, dxfattribs={"thickness": 1.0}))  # fmt: skip
        data = bytearray(path.read_bytes())
        rng = np.random.default_rng(seed)
        at = data.rindex(b"LWPOLYLINE") + rng.integers(-200, 400, size=6)
        for place in at.tolist():
            data[min(max(place, 0), len(data) - 1)] = int(rng.integers(32, 127))
        path.write_bytes(data[: len(data) - 1000 * (seed % 2)])
        with suppress(InputError):
            read_bodies(path)


def ring_load_factor(stones: list[np.ndarray], spokes: np.ndarray, friction: float) -> float:
    """Largest push along x over the weight that a ring of stones (k, 2) carries, which meet on the
    spokes (n + 1, 2) between radii of 0.8 and 1: two normal forces and one shear a joint."""
    count = len(stones)
    matrix, dead, live = np.zeros((3 * count, 3 * count + 4)), [], []
    for k, corners in enumerate(stones):
        ahead = np.roll(corners, -1, axis=0)
        twice = corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0]
        area = 0.5 * twice.sum()
        centroid = twice @ (corners + ahead) / (6.0 * area)
        dead += [0.0, -area, 0.0]
        live += [area, 0.0, 0.0]
        for j, sign in ((k, 1.0), (k + 1, -1.0)):
            normal = np.array([-spokes[j][1], spokes[j][0]])
            forces = ((0.8 * spokes[j], normal), (spokes[j], normal), (spokes[j], spokes[j]))
            for column, (point, force) in enumerate(forces, 3 * j):
                arm = point - centroid
                moment = arm[0] * force[1] - arm[1] * force[0]
                matrix[3 * k : 3 * k + 3, column] = sign * np.array([*force, moment])
    matrix[:, -1] = live
    rows = np.zeros((2 * count + 2, matrix.shape[1]))
    for j in range(count + 1):
        rows[2 * j : 2 * j + 2, 3 * j : 3 * j + 2] = -friction
        rows[2 * j : 2 * j + 2, 3 * j + 2] = 1.0, -1.0
    bounds = [*([(0, None), (0, None), (None, None)] * (count + 1)), (None, None)]
    objective = np.append(np.zeros(matrix.shape[1] - 1), -1.0)
    found = linprog(objective, rows, np.zeros(len(rows)), matrix, -np.array(dead), bounds)
    assert found.status == 0, found.message
    return float(-found.fun)


OFF = """OFF  # a cube
8 6 0
0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1

4 0 3 2 1 255 0 0\n4 4 5 6 7\n4 0 1 5 4\n4 2 3 7 6\n4 0 4 7 3\n4 1 2 6 5
"""


class TestOff:
    @pytest.mark.parametrize("head", ["OFF  # a cube\n8 6 0", "OFF 8 6 0", "COFF\n\n8 6 12"])
    def test_a_cube(self, tmp_path: Path, head: str) -> None:
        path = tmp_path / "cube.off"
        path.write_text(OFF.replace("OFF  # a cube\n8 6 0", head))
        assert blocks_of(path)[""].volume == pytest.approx(1.0)

    def test_several_bodies(self, tmp_path: Path) -> None:
        points, faces = cells([(0, 0, 0), (0, 0, 2), (3, 0, 0)])
        lines = ["OFF", f"{len(points)} {len(faces)} 0"]
        lines += [" ".join(map(str, p)) for p in points.tolist()]
        lines += [" ".join(map(str, (len(f), *f))) for f in faces]
        path = tmp_path / "cubes.off"
        path.write_text("\n".join(lines))
        assert [b.volume for b in blocks_of(path).values()] == pytest.approx([1.0] * 3)

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ("OFF", "PLY", "line 1 must say OFF"),
            ("OFF  # a cube", "OFF BINARY", "binary"),
            ("8 6 0", "8 x 0", "line 2: the counts"),
            ("8 6 0", "999999999 6 0", "more than the file holds"),
            ("8 6 0", "-8 6 0", "more than the file holds"),
            ("0 1 1\n", "0 1\n", "line 10: a vertex must be 3 numbers"),
            ("4 1 2 6 5", "4 1 2 6 8", "line 17: a face must list"),
            ("4 1 2 6 5", "4 1 2 6", "line 17: a face must be 5 numbers"),
            ("4 1 2 6 5", "2 1 2", "line 17: a face must list at least three"),
            ("4 1 2 6 5", "-4 1 2 6 5", "line 17"),
            ("4 1 2 6 5\n", "", "it is cut off"),
        ],
    )
    def test_refused(self, tmp_path: Path, old: str, new: str, message: str) -> None:
        path = tmp_path / "broken.off"
        assert old in OFF
        path.write_text(OFF.replace(old, new))
        with pytest.raises(InputError, match=message):
            read_bodies(path)


def old_mesh(shift: float) -> dict[str, Any]:
    """As COMPAS 0.x writes a mesh."""
    points = CUBE.vertices + np.array([0, 0, shift])
    return {
        "attributes": {"name": "Mesh"}, "dva": {"x": 0.0, "y": 0.0, "z": 0.0}, "dea": {},
        "vertex": {str(i): dict(zip("xyz", p, strict=True)) for i, p in enumerate(points.tolist())},
        "face": {str(i): [str(k) for k in f] for i, f in enumerate(CUBE.faces)},
        "edgedata": {}, "max_int_key": 7,
    }  # fmt: skip


@pytest.mark.parametrize("nodes", ["vertex", "node"])
def test_an_assembly_of_compas_0(tmp_path: Path, nodes: str) -> None:
    network = {
        "attributes": {"name": "Assembly"}, "edge": {"0": {}, "1": {}},
        nodes: {str(i): {"is_support": i == 0, "x": 0.5, "y": 0.5, "z": i + 0.5} for i in (0, 1)},
    }  # fmt: skip
    document = {"assembly": network, "blocks": {str(i): old_mesh(i) for i in (1, 0)}}
    path = tmp_path / "old.json"
    path.write_text(json.dumps(document))
    scene = import_geometry(path, density=20, **ASKED).scene
    assert scene.supports == ("0",)
    assert solve(scene).load_factor == pytest.approx(0.7, rel=1e-6)
    del document["blocks"]["1"]
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="node '1' of the assembly has no block"):
        read_bodies(path)


def test_a_mesh_of_compas_0_and_what_is_none(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text(json.dumps(old_mesh(0.0)))
    assert blocks_of(path)[""].volume == pytest.approx(1.0)
    path.write_text(json.dumps({"stones": []}))
    with pytest.raises(InputError, match="holds no blocks that are known") as refusal:
        read_bodies(path)
    assert "written by" not in str(refusal.value)


def test_outlines_without_thickness_are_named(tmp_path: Path) -> None:
    def draw(space: Any) -> None:
        for x in (0, 1, 2):
            corners = [(x + a, b) for a, b in SQUARE]
            space.add_lwpolyline(corners, close=True, dxfattribs={"layer": "STONES"})

    said = "3 closed polylines on layer 'STONES' have no thickness, .* program's properties"
    with pytest.raises(InputError, match=said):
        read_bodies(drawing(tmp_path / "flat.dxf", draw))


def test_lowest_of_blocks_that_are_all_lowest_asks_for_the_axis(tmp_path: Path) -> None:
    """As where y points up in the file: a wall lies on its side."""

    def draw(space: Any) -> None:
        for z in (0, 1):
            corners = [(a, z + b) for a, b in SQUARE]
            space.add_lwpolyline(corners, close=True, dxfattribs={"thickness": 0.5})

    file = drawing(tmp_path / "wall.dxf", draw)
    with pytest.raises(InputError, match=r'all 2 blocks are lowest along z, .* \(up="y"\)'):
        import_geometry(file, **ASKED, density=20, supports="lowest")
    stands = import_geometry(file, **ASKED | {"up": "y"}, density=20, supports="lowest").scene
    assert len(stands.free) == 1


@pytest.mark.parametrize("shape", ["flat", "list of lists", "deeper", "with an empty list"])
def test_lists_of_compas_meshes(tmp_path: Path, shape: str) -> None:
    """A slab, and a tower of two blocks of 1 x 1 m, 2 m high in all."""
    boxes = [((-1, -1, -1), (2, 2, 0)), ((0, 0, 0), (1, 1, 1.2)), ((0, 0, 1.2), (1, 1, 2))]
    meshes = []
    for low, high in boxes:
        corners = Block.box("b", low, high).vertices.tolist()
        vertices = {str(i): dict(zip("xyz", p, strict=True)) for i, p in enumerate(corners)}
        faces = {str(i): list(face) for i, face in enumerate(BOX_FACES)}
        data = {"vertex": vertices, "face": faces}
        meshes.append({"dtype": "compas.datastructures/Mesh", "data": data})
    a, b, c = meshes
    nested: Any = {
        "flat": [a, b, c],
        "list of lists": [[a], [b, c]],
        "deeper": [[[a], [[b]]], c],
        "with an empty list": [a, [], [b, c]],
    }[shape]
    path = tmp_path / "a.json"
    path.write_text(json.dumps(nested))
    scene = import_geometry(path, density=20, supports="lowest", **ASKED).scene
    assert solve(scene).load_factor == pytest.approx(0.5, rel=1e-6)
    for _ in range(20):
        nested = [nested]
    path.write_text(json.dumps(nested))
    with pytest.raises(InputError, match="lists of blocks are nested too deeply; flatten them"):
        read_bodies(path)
