"""Every leaf of a stored result, changed one at a time, is refused or named as not looked at."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from cvxlimit import Block, Load, Scene, builtin_scene, prove, solve
from cvxlimit.io import result_from_dict
from helpers import document
from intervals import leaning_cube
from leaves import unnoticed


def pile(friction: float = 0.6, **strengths: float) -> Scene:
    """Two cubes, the upper one 0.2 m off; it tips at (0.5 - 0.2) / 0.5, or slides."""
    blocks = [
        Block.box("ground", (-1, -1, -1), (3, 2, 0)),
        Block.box("lower", (0, 0, 0), (1, 1, 1), density=20.0),
        Block.box("upper", (0.2, 0, 1), (1.2, 1, 2), density=20.0),
    ]
    push = Load(acceleration=(1, 0, 0))
    scene = Scene(blocks, ["ground"], push, friction=friction, name="pile")
    return scene.with_strength(**strengths) if strengths else scene


def clamped() -> Scene:
    """The middle one of three cubes on one another, of which the outer ones are fixed."""
    blocks = [
        Block.box(f"p{i}", (0, 0, 0.5 * i), (0.5, 0.5, 0.5 * i + 0.5), density=20.0)
        for i in range(3)
    ]
    return Scene(blocks, ["p0", "p2"], Load(acceleration=(1, 0, 0)), friction=1.0, name="clamped")


DOWN = builtin_scene("single-block").with_live(Load(acceleration=(0, 0, -1)))
UP = pile().with_dead(Load(gravity=(0, 0, 1)))
CASES: dict[str, tuple[Scene, dict[str, Any]]] = {
    "slides": (pile(0.3), {}),
    "falls": (UP, {}),
    "interaction": (pile(), {"method": "certified", "tolerance": 0.05}),
}
SLOW: dict[str, tuple[Scene, dict[str, Any]]] = {
    "rocks": (pile(), {}),
    "facets": (pile(0.3), {"surface": "octagon"}),
    "parabola": (pile(), {"surface": "parabolic"}),
    "mortar": (pile().with_cohesion(2.0).with_strength(tensile=1.0), {}),
    "exact": (pile(), {"method": "exact"}),
    "interval": (leaning_cube(), {}),
    "harmless": (DOWN, {}),
    "harmless with interaction": (DOWN, {"method": "certified"}),
    "falls with interaction": (UP, {"method": "certified"}),
    "crushing": (pile(compressive=500.0), {}),
    "not certified": (builtin_scene("stack"), {"method": "certified", "tolerance": 1e-12}),
    "without dilatancy": (pile(0.3), {"method": "zero-dilatancy"}),
    "no limit with dilatancy": (clamped(), {}),
}
ALL = CASES | SLOW
EXTENSIONS = {
    "interaction": "interaction", "harmless with interaction": "interaction",
    "falls with interaction": "interaction", "not certified": "interaction",
    "without dilatancy": "dilatancy", "no limit with dilatancy": "dilatancy",
}  # fmt: skip


@cache
def stored(case: str) -> Any:
    scene, options = ALL[case]
    return document(solve(scene, **options))


def assert_every_leaf_counts(case: str) -> None:
    if case in EXTENSIONS:
        pytest.importorskip(f"cvxlimit.extensions.{EXTENSIONS[case]}")
    scene, every = ALL[case][0], 7 if case == "not certified" else 1  # its regions are alike
    assert not unnoticed(stored(case), lambda d: prove(result_from_dict(d), scene), every)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.exhaustive_cases("interaction")
def test_every_leaf_counts(case: str) -> None:
    assert_every_leaf_counts(case)


@pytest.mark.exhaustive
@pytest.mark.parametrize("case", SLOW)
def test_every_leaf_of_other_methods_counts(case: str) -> None:
    assert_every_leaf_counts(case)


@pytest.mark.parametrize(
    ("case", "change"),
    [
        ("falls", {"lower": 5.0}),
        ("slides", {"interaction": "yes"}),
        ("slides", {"torsion_shear": "yes"}),
        ("slides", {"flow": "gilbert"}),
    ],
)
def test_words_and_bounds_beside_a_status_are_looked_at(case: str, change: Any) -> None:
    proof = prove(result_from_dict(stored(case) | change), ALL[case][0])
    assert proof.missing, str(proof)


def test_where_joints_slide_is_proved() -> None:
    """The headline of "no limit with dilatancy": 1 by hand, a clamped cube of friction 1."""
    pytest.importorskip("cvxlimit.extensions.dilatancy")
    held, scene = stored("no limit with dilatancy"), clamped()
    proof = prove(result_from_dict(held), scene)
    slides, bound = (
        next(c for c in proof.of("proved") if c.claim.startswith(start))
        for start in ("joints slide", "lower bound")
    )
    assert "at 1.0000" in slides.claim
    assert "0.99999" in bound.claim
    told = held["dilatancy"] | {"slides_at": 0.9}
    assert prove(result_from_dict(held | {"dilatancy": told}), scene).missing
    other = {**held["beside"], "slides": held["beside"]["slides"] | {"load_factor": 0.9}}
    assert prove(result_from_dict(held | {"beside": other}), scene).missing
    for lower in (0.5, 1.1):  # another one than least thrusts show, below and above 1
        checks = prove(result_from_dict(held | {"lower": lower}), scene).missing
        assert any(check.claim.startswith(f"lower bound {lower}") for check in checks)
