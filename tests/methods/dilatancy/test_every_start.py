"""Friction without dilatancy: every start ends at a solution, in the plane and in space."""

from __future__ import annotations

import pytest

from cvxlimit import Status, builtin_scene, solve
from cvxlimit.methods.dilatancy.zero_dilatancy import ZeroDilatancy

pytestmark = pytest.mark.exhaustive

PLANE = ("ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3", "arch", "arch-on-piers")

SPACE = ("tuff-wall", "barrel-vault", "facade", "house-corner", "dome")


@pytest.mark.parametrize("name", PLANE)
def test_in_the_plane(name: str) -> None:
    """Residuals below 1e-6 from each of eight starts."""
    solution = solve(builtin_scene(name), method=ZeroDilatancy(starts=8, descents=0))
    assert "from 8 of 8 starts" in solution.note
    assert max(member.residual for member in solution.members) < 1e-6


@pytest.mark.parametrize("name", SPACE)
def test_in_space(name: str) -> None:
    """Below 1e-4 from each of four."""
    rule = ZeroDilatancy(starts=4, descents=0, tolerance=1e-4)
    solution = solve(builtin_scene(name), method=rule)
    assert "from 4 of 4 starts" in solution.note
    assert max(member.residual for member in solution.members) < 1e-4


def test_panel_s12() -> None:
    """The largest one here: two starts."""
    rule = ZeroDilatancy(starts=2, descents=0, tolerance=1e-4)
    solution = solve(builtin_scene("s12-panel"), method=rule)
    assert solution.status is Status.CONVERGED
    assert "from 2 of 2 starts" in solution.note
    assert max(member.residual for member in solution.members) < 1e-4
