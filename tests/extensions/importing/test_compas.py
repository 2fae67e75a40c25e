"""Models of COMPAS as scenes and results back: against the package's own arch, and by statics."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvxlimit import Scene, Solution, solve
from cvxlimit.errors import InputError
from cvxlimit.io import import_geometry
from cvxlimit.masonry import arch

compas = pytest.importorskip("compas")
pytest.importorskip("compas_dem")


def model(**changes: float) -> Any:
    """An arch of compas_dem's template, whose springers are supports."""
    from compas_dem.models import BlockModel
    from compas_dem.templates import ArchTemplate

    sizes = {"rise": 0.925, "span": 1.85, "thickness": 0.15, "depth": 0.3, "n": 22} | changes
    made = BlockModel("bridge")
    for mesh in ArchTemplate(**sizes).blocks():
        made.add_block_from_mesh(mesh)
    made.add_supports([0, 21])
    return made


@pytest.fixture(scope="module")
def solved() -> tuple[Any, Solution]:
    given = model()
    return given, solve(Scene.from_compas(given, friction=0.7, density=20.0))


def test_a_template_s_arch_is_the_own_one(solved: tuple[Any, Solution]) -> None:
    _, solution = solved
    assert solution.scene.name == "bridge"
    assert solution.scene.supports == ("0", "21")
    own = solve(arch(20, 0.15, embrace=180 * 20 / 22, friction=0.7))
    assert solution.load_factor == pytest.approx(own.load_factor, rel=1e-9)


def test_an_object_and_its_file_are_the_same(tmp_path: Path) -> None:
    given, file = model(), tmp_path / "bridge.json"
    compas.json_dump(given, file)
    found = import_geometry(
        file, length_unit="m", up="z", friction=0.7, density=20.0, live=(1, 0, 0)
    ).scene
    direct = Scene.from_compas(given, friction=0.7, density=20.0)
    assert direct.supports == found.supports
    for one, other in zip(direct.blocks, found.blocks, strict=True):
        np.testing.assert_allclose(one.vertices, other.vertices, atol=1e-12)


@pytest.mark.parametrize(("to", "force", "weight"), [(None, "kN", 1.0), ("mm", "N", 1e-6)])
def test_masses_become_weights(to: str | None, force: str, weight: float) -> None:
    from compas_dem.material import Stone

    given, stone = model(), Stone(fck=20.0, density=2200.0)
    given.add_material(stone)
    for element in given.elements():
        given.assign_material(stone, element=element)
    scene = Scene.from_compas(given, friction=0.7, to_unit=to, force_unit=force)
    assert scene.blocks[1].density == pytest.approx(2200.0 * 9.81e-3 * weight)


def test_elements_move_with_their_groups(solved: tuple[Any, Solution]) -> None:
    from compas.geometry import Translation
    from compas_dem.elements import Block
    from compas_model.models import Model

    made, origin = Model(), solved[0]
    group = made.add_group("all")
    for element in origin.elements():
        block = Block.from_mesh(element.modelgeometry)
        block.transformation = Translation.from_vector([0, 0, 2.0])
        made.add_element(block, parent=group)
    scene = Scene.from_compas(made, friction=0.7, density=20.0, supports="lowest")
    assert len(scene.free) == 20
    assert min(block.vertices[:, 2].min() for block in scene.blocks) == pytest.approx(2.0)


def test_results_are_in_equilibrium_and_move_as_the_mechanism(
    solved: tuple[Any, Solution],
) -> None:
    given, solution = solved
    results = solution.to_compas(given, largest=0.02)
    scene = solution.scene
    back = compas.json_loads(compas.json_dumps(results))  # as others keep and send it
    for i in scene.free:
        block = scene.blocks[i]
        total = scene.dead_forces[scene.free.tolist().index(i)].copy()
        total += solution.load_factor * scene.live_forces[scene.free.tolist().index(i)]
        for edge in results.edges():
            if i not in edge:
                continue
            contact, sign = results.contact_data(edge), 1.0 if edge[1] == i else -1.0
            frame = np.array([contact.frame.xaxis, contact.frame.yaxis, contact.frame.zaxis])
            for point, each in zip(contact.points, contact.forces, strict=True):
                local = [each["c_u"], each["c_v"], each["c_np"] - each["c_nn"]]
                assert each["c_nn"] == pytest.approx(0.0, abs=1e-12)
                force = sign * np.array(local) @ frame
                total += np.r_[force, np.cross(np.array(point) - block.centroid, force)]
            resultant = np.array(back.resultant_global(edge))
            drawn = np.array(contact.resultantforce[0].vector)
            np.testing.assert_allclose(drawn, resultant, atol=1e-9)
        np.testing.assert_allclose(total, 0.0, atol=1e-7)
    moved = []
    for i, block in enumerate(scene.blocks):
        matrix = np.array(results.transformation(i).matrix)
        np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)
        there = block.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        moved.append(np.linalg.norm(there - block.vertices, axis=1).max())
    assert moved[0] == moved[21] == 0.0
    assert max(moved) == pytest.approx(0.02, rel=0.02)  # the turn is finite


def test_what_is_no_model_and_another_model(solved: tuple[Any, Solution]) -> None:
    _, solution = solved
    with pytest.raises(InputError, match=r"object of COMPAS, got 3: of files, .*import_geometry"):
        Scene.from_compas(3, friction=0.7)
    with pytest.raises(InputError, match=r"says? which blocks are fixed|no density|supports"):
        Scene.from_compas([mesh.modelgeometry for mesh in model().elements()], friction=0.7)
    with pytest.raises(InputError, match=r"block '\d+' lies .* from where the model has it"):
        solution.to_compas(model(rise=0.5))
    assert json.loads(solution.to_compas(solved[0]).to_jsonstring())["data"]["metadata"][
        "status"
    ] == str(solution.status)
