"""What goes with what: the table is what solve does, and what docs/choosing.md says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from cvxlimit import Tie, builtin_scene, explain, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import single_block
from cvxlimit.methods.solving import EXTRAS, TABLE
from cvxlimit.model.formulations import resultants
from cvxlimit.reductions.explaining import PACES
from cvxlimit.surfaces import Rocking, TorsionShear

CHOOSING = Path(__file__).parents[2] / "docs" / "choosing.md"

SURFACES: dict[str, Any] = {
    "conic": "conic", "facets": "octagon", "parabolic": "parabolic",
    "own": [Rocking(), TorsionShear()],
}  # fmt: skip

SCENES = {
    "cohesion": lambda scene: scene.with_cohesion(1.0),
    "strength": lambda scene: scene.with_strength(compressive=1e3),
    "reactions": lambda scene: scene._copy(
        ties=(Tie("ground", "b1", (-0.5, 0.2, 0.5), (0.0, 0.2, 0.5), 1.0),)
    ),
}


@pytest.mark.parametrize("surface", SURFACES)
@pytest.mark.parametrize("name", TABLE)
def test_surfaces(name: str, surface: str) -> None:
    """Taken, or refused with what the method takes and who takes the surface."""
    scene = single_block()
    if surface in TABLE[name].surfaces:
        assert solve(scene, SURFACES[surface], name).load_factor == pytest.approx(0.4, rel=1e-2)
        return
    with pytest.raises(ModelError, match=f"^method '{name}' goes with surface conic") as caught:
        solve(scene, SURFACES[surface], name)
    others = [other for other, row in TABLE.items() if surface in row.surfaces]
    assert all(repr(other) in str(caught.value) for other in others)


@pytest.mark.exhaustive_cases("zero-dilatancy-strength")
@pytest.mark.parametrize("extra", EXTRAS)
@pytest.mark.parametrize("name", TABLE)
def test_scenes_and_formulations(name: str, extra: str) -> None:
    scene, options = single_block(), {}
    if extra == "formulation":
        options = {"formulation": resultants}
    else:
        scene = SCENES[extra](scene)
    if extra in TABLE[name].takes:
        assert solve(scene, method=name, **options).load_factor is not None
        return
    with pytest.raises(ModelError, match=f"^method '{name}' .*: (leave|take)"):
        solve(scene, method=name, **options)


def test_every_method_has_an_expected_time() -> None:
    """Those of the convex problem follow from its size; all others have a pace."""
    small, large = (explain(builtin_scene(name)).methods for name in ("tuff-wall", "s12-panel"))
    assert {*TABLE} <= {"convex", *PACES}
    assert {*TABLE} - {"convex"} <= {*small} <= {*PACES}  # an extension may be left out
    assert all(0.0 < small[name] < large[name] for name in small)


@pytest.mark.parametrize("name", TABLE)
def test_moments_are_a_setting_of_those_that_have_a_reading(name: str) -> None:
    scene = single_block()
    if hasattr(TABLE[name], "moments"):
        assert solve(scene, method=name, moments="signed").moments == "signed"
        return
    told = r"moments does nothing .* 'fixed-point'( or 'certified')?"
    with pytest.raises(ModelError, match=told):
        solve(scene, method=name, moments="signed")


@pytest.mark.parametrize(
    ("method", "told"),
    [
        ("convex", ("none", "associated", "linear")),
        ("exact", ("none", "associated", "exact")),
        ("fixed-point", ("fixed-point", "associated", "linear")),
        ("certified", ("certified", "associated", "linear")),
        ("zero-dilatancy", ("none", "zero-dilatancy", "linear")),
    ],
)
def test_results_say_in_three_words_what_the_method_took(
    method: str, told: tuple[str, ...]
) -> None:
    found = solve(single_block(), method=method)
    assert (found.interaction, found.flow, found.torsion_shear) == told


def test_the_page_has_the_table() -> None:
    page = CHOOSING.read_text("utf-8")
    for name, row in TABLE.items():
        extras = ", ".join(row.takes) or "nothing"
        line = f"| `{name}` | {row.answers} | {', '.join(row.surfaces)} | {extras} |"
        assert line in page, line
