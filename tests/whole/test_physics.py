"""Every model of the physics beside the others: order between them, and invariances of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import pytest

from cvxlimit import Load, Scene, Tie, builtin_scene, settlement, solve
from cvxlimit.masonry import BUILTIN, running_bond, single_block, wall
from cvxlimit.model.crushing import PlasticField
from cvxlimit.model.formulations import corner_compressions, vertex_forces
from cvxlimit.surfaces import Rocking
from exhaustive import mostly_slow
from helpers import renumbered

Answer = Callable[[Scene], float | None]

SPACIOUS = tuple(name for name in BUILTIN if name not in ("s10-panel", "s12-panel"))
"""The panels take too long for every run: test_torsion_shear.py has all, marked exhaustive."""


def solved(scene: Scene, **options: object) -> float | None:
    return solve(scene, tolerance=1e-6, **options).load_factor  # type: ignore[arg-type]


def lowest(scene: Scene) -> float:
    """Of zero dilatancy, found on purpose."""
    return solve(scene, method="zero-dilatancy").members[0].load_factor


def reaction(scene: Scene) -> float | None:
    """Of a side support that yields along x in whatever frame: its contacts' mean normal."""
    side = next(key for key in scene.supports if key.startswith("side"))
    normals = [c.normal if c.b == side else -c.normal for c in scene.contacts if side in (c.a, c.b)]
    return settlement(scene, side, np.sum(normals, axis=0)).value


MODELS: Mapping[str, tuple[Answer, float]] = MappingProxyType(
    {
        "linear": (solved, 1e-5),
        "parabolic": (partial(solved, surface="parabolic"), 1e-5),
        "exact": (lambda scene: solve(scene, method="exact").load_factor, 2e-3),
        "vertex forces": (partial(solved, surface=[Rocking()], formulation=vertex_forces), 1e-5),
        "effective rectangle": (solved, 1e-5),
        "plastic field": (partial(solved, formulation=PlasticField(corner_compressions)), 1e-5),
        "mortar": (solved, 1e-5),
        "ties": (solved, 1e-5),
        "zero dilatancy": (lowest, 1e-5),
        "zero dilatancy, mortar": (lowest, 1e-5),
        "zero dilatancy, ties": (lowest, 1e-5),
        "zero dilatancy, effective rectangle": (lowest, 1e-5),
        "settlement": (reaction, 1e-5),
    }
)
"""How to ask for each, and how far its answers may differ: twice the tolerance that was asked
for."""


def scene_of(model: str) -> Scene:
    """A small wall, out of whose plane and along which it is pushed, with what the model needs."""
    result = wall(
        running_bond(2, 2),
        unit=(0.4, 0.2, 0.3),
        density=20.0,
        friction=0.6,
        side_supports=("start",) if model == "settlement" else (),
        live=Load(acceleration=(1.0, 0.0, 0.0)),
    )
    if model == "zero dilatancy, effective rectangle":  # its one answer: a block that tips
        result = single_block((1.0, 1.0, 2.0), friction=0.9)
        return result.with_strength(compressive=20.0 * result.total_weight)
    model = model.removeprefix("zero dilatancy, ")
    if model in ("effective rectangle", "plastic field"):
        result = result.with_friction(0.9).with_strength(compressive=100.0)
    if model == "mortar":
        result = result.with_cohesion(2.0).with_strength(tensile=1.0)
    if model == "ties":
        ends = (0.2, 0.1, 0.15), (0.6, 0.1, 0.15)
        result = replace(result, ties=(Tie("b1.1", "b1.2", *ends, 1.0),))
    if model == "settlement":
        result = result.with_live(Load(acceleration=(0.0, 1.0, 0.0)))
    return result


@pytest.mark.exhaustive_cases(
    "effective rectangle",
    "ties",
    "zero dilatancy",
    "zero dilatancy, effective rectangle",
    "zero dilatancy, mortar",
)
@pytest.mark.parametrize("model", mostly_slow(MODELS, MODELS.keys() - {"zero dilatancy, ties"}))
def test_rotation_numbering_units(model: str) -> None:
    ask, tolerance = MODELS[model]
    scene = scene_of(model)
    expected = ask(scene)
    angle = np.radians(33.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0],
                     [0.0, 0.0, 1.0]])[:, [1, 2, 0]]  # fmt: skip
    force = 7.0 if model == "settlement" else 1.0
    for other, factor in (
        (scene.moved(turn, (1.0, -2.0, 3.0)), 1.0),
        (renumbered(scene, 2), 1.0),
        (scene.in_units(scene.units, 1e3, 7.0), force),
    ):
        assert ask(other) == pytest.approx(factor * expected, rel=tolerance)


@pytest.mark.exhaustive_cases("dome")
@pytest.mark.parametrize("name", SPACIOUS)
def test_linear_below_parabolic(name: str) -> None:
    """And below what is exact where that is quick: on the others in test_torsion_shear.py."""
    scene = builtin_scene(name)
    found = [solve(scene), solve(scene, "parabolic")]
    found += [solve(scene, method="exact")] if len(scene.contacts) < 30 else []
    for lesser, larger in pairwise(found):
        assert lesser.lower <= larger.upper


def test_vertex_forces_with_cohesion() -> None:
    """A squat block slides at mu + c A / W, however the corners share it."""
    scene = single_block((1.0, 1.0, 0.5), friction=0.3)
    cohesive = scene.with_cohesion(0.1 * scene.total_weight)
    found = solve(cohesive, [Rocking()], formulation=vertex_forces).load_factor
    assert found == pytest.approx(0.4, rel=1e-6)
