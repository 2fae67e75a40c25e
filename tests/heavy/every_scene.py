"""Torsion with shear on every built-in scene: line <= parabola <= exact, minutes.

pytest tests/heavy/every_scene.py
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from cvxlimit import builtin_scene, solve
from cvxlimit.masonry import BUILTIN


@pytest.mark.parametrize("name", BUILTIN)
def test_line_parabola_exact(name: str) -> None:
    scene = builtin_scene(name)
    tolerances = {"linear": 1e-6, "parabolic": 1e-6, "exact": 5e-3}
    found = [solve(scene, torsion_shear=form, tolerance=t) for form, t in tolerances.items()]
    for lesser, larger in pairwise(found):
        assert lesser.lower <= larger.upper
