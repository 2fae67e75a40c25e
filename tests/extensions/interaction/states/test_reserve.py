"""The state of force that uses joints least is admissible, in equilibrium, and the least."""

from __future__ import annotations

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, builtin_scene, solve
from cvxlimit.errors import InputError
from cvxlimit.model.statics import Statics
from cvxlimit.results.utilisation import least_used, least_used_state, utilisations
from cvxlimit.surfaces import utilisation
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES


def use(scene: Scene, forces: np.ndarray) -> float:
    """The sum of N u^2 over contacts that carry something."""
    shares = [utilisation(surface, forces, scene.contacts) for surface in DEFAULT_SURFACES]
    return float(np.nansum(forces[:, 2] * np.fmax.reduce(shares) ** 2))


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_it_is_admissible_and_no_other_state_uses_less(share: float) -> None:
    """Others are those on the line to the solution's own forces, where the two lie at one load."""
    scene = builtin_scene("tuff-wall")
    solution = solve(scene)
    factor = share * solution.lower
    forces = least_used(scene, DEFAULT_SURFACES, factor, solution.forces)
    statics = Statics.of(scene)
    largest = forces[:, 2].max()
    # 1e-6 of the load factor is taken off, and the solver is good for 1e-5 of the forces.
    assert np.abs(statics.residual(forces, factor)).max() < 1e-5 * largest
    for surface in DEFAULT_SURFACES:
        for part in surface.excess(forces, scene.contacts):
            assert part.max() < 1e-5 * largest
    unloaded = least_used(scene, DEFAULT_SURFACES, 0.0, solution.forces)
    other = share * solution.forces + (1.0 - share) * unloaded
    assert np.abs(statics.residual(other, factor)).max() < 1e-5 * largest
    for step in (0.01, 0.3, 1.0):
        mixed = forces + step * (other - forces)
        assert use(scene, forces) <= use(scene, mixed) * (1.0 + 1e-4)


def test_pillars_share_a_beam_evenly() -> None:
    """A block on two pillars between walls: nothing pushes, so nothing needs to be in use."""
    blocks = [
        Block.box("ground", (-1, 0, -1), (4, 1, 0)),
        Block.box("left", (0, 0, 0), (1, 1, 2), density=20.0),
        Block.box("right", (2, 0, 0), (3, 1, 2), density=20.0),
        Block.box("beam", (0, 0, 2), (3, 1, 3), density=20.0),
    ]
    scene = Scene(blocks, ["ground"], Load(acceleration=(1, 0, 0)), friction=0.6)
    solution = solve(scene)
    _, said = least_used_state(solution, scene, 0.0)
    still, _ = least_used_state(solution, scene, 0.0)
    assert said == "at load factor 0, in the state that uses joints least"
    # Least use lets the beam lean on the pillars' axes: u is 0 but for the solver's 1e-5.
    assert np.nanmax(utilisations(still, scene)["utilisation"]) < 0.02
    beam = [j for j, name in enumerate(scene.contacts.names) if "beam" in name]
    assert still.forces[beam, 2] == pytest.approx([30.0, 30.0], rel=1e-3)


def test_what_does_not_exist_is_refused() -> None:
    scene = builtin_scene("single-block")
    solution = solve(scene)
    with pytest.raises(InputError, match="ask for one from 0 to"):
        least_used_state(solution, scene, 2.0 * solution.load_factor)
