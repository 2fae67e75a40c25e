"""Every family of the stability bench, shifted, turned and scaled as a whole: the same contacts."""

from __future__ import annotations

import pytest
from benchmarks.stability.families import FAMILIES, sample

from placements import assert_same_contacts


@pytest.mark.parametrize("family", FAMILIES)
def test_families(family: str) -> None:
    scene = sample(family, 3).scene
    assert assert_same_contacts(scene.blocks, tolerance=scene.joint_tolerance) is not None


@pytest.mark.exhaustive
@pytest.mark.parametrize("family", FAMILIES)
def test_more_of_each_family(family: str) -> None:
    for seed in range(10, 20):
        scene = sample(family, seed).scene
        assert assert_same_contacts(scene.blocks, tolerance=scene.joint_tolerance) is not None
