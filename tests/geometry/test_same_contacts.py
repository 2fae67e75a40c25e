"""A scene shifted, turned and scaled as a whole has the same contacts: generators and meshes."""

from __future__ import annotations

import manifold3d
import numpy as np
import pytest

from cvxlimit import Block, builtin_scene
from cvxlimit.geometry.mesh import triangulated
from cvxlimit.geometry.solids import solid
from cvxlimit.masonry import BUILTIN, random_wall
from placements import OUTLINES, assert_same_contacts, prism, shaped

LARGE = {"s10-panel", "s12-panel", "house-corner"}
"""Seconds each: every kind of contact they have stands in the others too."""


@pytest.mark.parametrize("name", sorted(BUILTIN.keys() - LARGE))
def test_generators(name: str) -> None:
    assert len(assert_same_contacts(builtin_scene(name).blocks))


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", sorted(LARGE))
def test_large_generators(name: str) -> None:
    assert len(assert_same_contacts(builtin_scene(name).blocks))


@pytest.mark.parametrize("seed", range(3))
def test_random_walls(seed: int) -> None:
    assert len(assert_same_contacts(random_wall(seed).blocks))


@pytest.mark.parametrize("name", OUTLINES)
def test_meshes_of_triangles(name: str) -> None:
    """As programs write them: triangles on their own corners, mended before they are blocks."""
    blocks = []
    for block in (shaped(name), Block.box("b", (0.4, 0.3, 0.0), (2.2, 2.6, 1.0), 20.0)):
        triangles = block.vertices[triangulated(block.vertices, block.faces)[0]].reshape(-1, 3)
        numbers = np.arange(len(triangles)).reshape(-1, 3).tolist()
        blocks.append(solid(block.id, triangles, numbers, 20.0))
    assert len(assert_same_contacts(blocks)) == 1


def test_a_drum_with_a_hole_on_another() -> None:
    """Curved faces, holes, and coordinates of many digits."""
    drum = manifold3d.CrossSection.circle(1.0, 24) - manifold3d.CrossSection.circle(0.4, 17)
    mesh = drum.extrude(0.5).to_mesh64()
    points, faces = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).tolist()
    low, high = (solid(f"d{z}", points + np.array([0.0, 0.0, z]), faces, 20.0) for z in (0.0, 0.5))
    turned = high.moved([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    assert len(assert_same_contacts([low, turned])) == 1


def test_a_curved_joint_of_equal_strips() -> None:
    """Strips as large as each other: rounding must not choose where the flat patches begin."""
    angles = np.radians(np.linspace(30.0, 150.0, 61))
    arc = np.column_stack([np.cos(angles), np.sin(angles)]).tolist()
    lower = prism("lower", [(-1.0, -1.0), (1.0, -1.0), *arc], 0.0, 2.0)
    upper = prism("upper", [*arc[::-1], (1.0, 2.0), (-1.0, 2.0)], 0.0, 2.0)
    contacts = assert_same_contacts([lower, upper])
    # Patches lie in each other's mean planes: a thousandth is the chord's loss over its arc.
    assert contacts.area.sum() == pytest.approx(2.0 * np.radians(120.0), rel=1e-3)
