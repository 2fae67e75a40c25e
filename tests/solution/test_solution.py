"""What a solution remembers: the surfaces it was made with, and what is said without them."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from cvxlimit import Block, Contacts, Load, Scene, Solution, solve
from cvxlimit.errors import InputError
from cvxlimit.io import read_result, write_result
from cvxlimit.results.utilisation import utilisations
from cvxlimit.surfaces import Condition, Facets, Norm, Rocking, Sliding, Torsion, YieldSurface

SHARE = 0.5
"""Of Coulomb's friction that the surface of one's own leaves."""


class HalfSliding(YieldSurface):
    """abs(V) <= mu N / 2."""

    name = "half-sliding"

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [Condition([Norm({"V1": 1}, {"V2": 1})], {"N": SHARE * contacts.friction})]


class Sheet(HalfSliding):
    """The same under the name of a surface of the package."""

    name = "sliding"


def slab() -> Scene:
    """So flat that it slides before it tips."""
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    block = Block.box("slab", (0, 0, 0), (1, 1, 0.1), density=20.0)
    return Scene([ground, block], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.6)


def used(solution: Solution) -> float:
    return float(utilisations(solution, solution.scene)["utilisation"][0])


@pytest.mark.parametrize("own", [HalfSliding, Sheet])
def test_a_block_at_the_limit_of_its_own_surface_uses_all_of_it(own: type[YieldSurface]) -> None:
    solution = solve(slab(), [Rocking(), own()])
    assert solution.load_factor == pytest.approx(SHARE * 0.6, rel=1e-5)
    assert used(solution) == pytest.approx(1.0, abs=1e-5)
    table = solution.to_dataframe()
    assert table["utilisation"].iloc[0] == pytest.approx(1.0, abs=1e-5)
    figure = solution.plot("utilisation", surface=own.name)
    assert any(t.get_text().endswith(f"; {own.name}") for t in figure.findobj(Text))


@pytest.mark.exhaustive
def test_a_twisted_block_at_the_exact_limit_uses_all_of_its_strength() -> None:
    """Told by the parabola, which is inside the exact limit: never less than all."""
    twist = Load(forces={"slab": (0.3, 0, 0, 0, 0, 1)})
    solution = solve(slab().with_live(twist), method="exact")
    assert 1.0 <= used(solution) < 1.05


@pytest.mark.parametrize("own", [HalfSliding, Sheet])
def test_a_file_says_which_surfaces_and_refuses_what_it_cannot_know(
    own: type[YieldSurface], tmp_path
) -> None:
    surfaces = [Rocking(), own()]
    write_result(solve(slab(), surfaces), tmp_path / "slab.json")
    assert own.name in (tmp_path / "slab.json").read_text("utf-8")
    read = read_result(tmp_path / "slab.json").of(slab())
    for asked in (read.to_dataframe, lambda: read.plot("utilisation")):
        with pytest.raises(InputError, match=r"names are left.*of\(scene, surfaces\) gives them"):
            asked()
    assert read.plot("forces")  # which asks for no strength
    assert used(read.of(slab(), surfaces)) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(
    "surface",
    ["conic", "16-gon-inscribed", [Rocking(), Sliding(Facets.circumscribed(8)), Torsion()]],
)
def test_built_in_surfaces_come_back_from_a_file(surface, tmp_path) -> None:
    solution = solve(slab(), surface)
    write_result(solution, tmp_path / "slab.json")
    read = read_result(tmp_path / "slab.json").of(slab())
    assert used(read) == used(solution) == pytest.approx(1.0, abs=1e-5)


def test_a_solution_has_the_scene_that_was_solved_and_a_file_its_name(tmp_path: Path) -> None:
    scene = slab()
    solution = solve(scene)
    assert solution.scene is scene
    assert copy.copy(solution).scene is replace(solution, note="mine").scene is scene
    for twin in (copy.deepcopy(solution), pickle.loads(pickle.dumps(solution))):
        assert twin.scene.name == twin.scene_name == solution.scene_name == scene.name
        assert twin.plot("forces") is not None
    write_result(solution, tmp_path / "result.json")
    read = read_result(tmp_path / "result.json")
    assert read.scene_name == scene.name
    with pytest.raises(InputError, match=r"has no scene, .*: solution\.of\(scene\) gives it back"):
        _ = read.scene
    assert read.of(scene).scene is scene


def test_a_pickle_keeps_surfaces_of_a_module_and_drops_those_of_a_function() -> None:
    class Local(HalfSliding):
        name = "local"

    kept = pickle.loads(pickle.dumps(solve(slab(), [Rocking(), Sliding()])))
    assert [type(surface) for surface in kept.surfaces] == [Rocking, Sliding]
    again = pickle.loads(pickle.dumps(solve(slab(), [Rocking(), Local()])))
    assert again.load_factor == pytest.approx(SHARE * 0.6, rel=1e-5)
    with pytest.raises(InputError, match="only the names are left"):
        used(again)


def test_a_polygon_of_another_reach_is_not_taken_for_the_inscribed_one(tmp_path) -> None:
    solution = solve(slab(), Facets(8, 0.97))
    write_result(solution, tmp_path / "slab.json")
    with pytest.raises(InputError, match=r"octagon of reach 0\.97"):
        used(read_result(tmp_path / "slab.json").of(slab()))
    assert used(solution) == pytest.approx(1.0, abs=1e-5)
    assert np.isfinite(solution.lower)
