"""Members of random walls by a second writing of strength, flow and loss; friction held at theirs
by a linear program; what an interruption leaves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from cvxlimit import Load, Member, Scene, Status, builtin_scene, solve
from cvxlimit.extensions.dilatancy.pair import Pair, pressed
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.masonry import running_bond, wall
from cvxlimit.methods.driver import Run, drive
from exhaustive import mostly_slow
from helpers import corners_in_plane, hand_equilibrium, hand_torsion_arm
from planar import _planar_equilibrium

FloatArray = NDArray[np.float64]

RULE = ZeroDilatancy(searches=1, budget=60)


def random_wall(seed: int) -> tuple[Scene, str]:
    """Slender or squat, pushed in its plane or out of it, with and without cohesion, on the cone or
    eight facets."""
    rng = np.random.default_rng(seed)
    unit = (0.4, 0.2, float(rng.uniform(0.15, 0.6)))
    across = float(rng.choice([0.0, rng.uniform(0.1, 1.0)]))
    scene = wall(
        running_bond(int(rng.integers(1, 4)), int(rng.integers(2, 5))),
        unit=unit,
        density=20.0,
        friction=float(rng.uniform(0.2, 0.9)),
        live=Load(acceleration=(1.0, across, float(rng.choice([0.0, -0.2])))),
    )
    if rng.uniform() < 0.3:
        scene = scene.with_cohesion(float(rng.uniform(0.1, 3.0)))
    return scene, str(rng.choice(["conic", "octagon"]))


def gauges(vector: FloatArray, surface: str) -> tuple[float, float]:
    """Size of a shear force, and how much power a slip takes of one of size 1."""
    if surface == "conic":
        return float(np.hypot(*vector)), float(np.hypot(*vector))
    angle = np.pi / 4.0 * np.arange(8)
    sides = np.column_stack([np.cos(angle), np.sin(angle)])
    ends = np.column_stack([np.cos(angle + np.pi / 8.0), np.sin(angle + np.pi / 8.0)])
    return float((sides @ vector).max()), float((ends @ vector).max() / np.cos(np.pi / 8.0))


def loss(scene: Scene, surface: str, member: Member) -> tuple[float, float, float]:
    """What forces and mechanism lose, in sum over contacts; the largest excess of strength, as a
    force; the largest penetration, over the largest rate."""
    place = {scene.blocks[i].id: row for row, i in enumerate(scene.free)}
    blocks = {block.id: block for block in scene.blocks}
    lost, excess, worst, largest = 0.0, -np.inf, 0.0, 0.0
    for contact, x, cohesion, area in zip(
        scene.contacts, member.forces, scene.contacts.cohesion, scene.contacts.area, strict=True
    ):
        motion, turning = np.zeros(3), np.zeros(3)
        for key, sign in ((contact.b, 1.0), (contact.a, -1.0)):
            if key in place:
                u = member.mechanism[place[key]]
                motion += sign * (u[:3] + np.cross(u[3:], contact.origin - blocks[key].centroid))
                turning += sign * u[3:]
        axes = (contact.t1, contact.t2, contact.normal)
        slip, twist = np.array([motion @ axes[0], motion @ axes[1]]), turning @ contact.normal
        at = contact.corners - contact.origin
        openings = (motion + np.cross(turning, at)) @ contact.normal
        arm, most = hand_torsion_arm(contact), contact.friction * x[2] + cohesion * area
        slides = max(gauges(slip, surface)[1], arm * abs(twist))
        power = x[:3] @ [motion @ axis for axis in axes] + x[3:] @ [turning @ a for a in axes]
        lost += abs(power + most * slides)
        corners = corners_in_plane(contact)
        outside = [
            (e[0] * (x[2] * p[1] - x[3]) - e[1] * (x[2] * p[0] + x[4])) / np.hypot(*e)
            for p, e in zip(corners, np.roll(corners, -1, axis=0) - corners, strict=True)
        ]
        shear = gauges(x[:2], surface)[0] + abs(x[5]) / arm - most
        excess = max(excess, shear, *(o / np.sqrt(area) for o in outside))
        worst, largest = min(worst, openings.min()), max(largest, np.abs(openings).max())
        largest = max(largest, float(np.hypot(*slip)))
    return lost, excess, -worst / largest


@pytest.mark.parametrize("seed", mostly_slow(range(300), range(5)))
@pytest.mark.exhaustive_cases("2", "4")
def test_random_walls(seed: int) -> None:
    """Every member is right by the second writing, and inside the bracket of all of them."""
    scene, surface = random_wall(seed)
    solution = solve(scene, surface, method=RULE)
    assert solution.status is Status.CONVERGED
    assert solution.bracket.upper_is_proved
    matrix, dead, live = hand_equilibrium(scene)
    load = np.abs(dead).sum()
    for member in solution.members:
        alpha = member.load_factor
        assert np.abs(matrix @ member.forces.ravel() + dead + alpha * live).max() < 1e-9 * load
        assert live @ member.mechanism.ravel() == pytest.approx(1.0)
        lost, excess, penetration = loss(scene, surface, member)
        assert lost < 2e-6 * abs(alpha)
        assert excess < 2e-6 * load
        assert penetration < 2e-6
        assert solution.lower * (1 - 1e-6) <= alpha <= solution.upper * (1 + 1e-6)


def tresca(scene: Scene, normal: FloatArray) -> float:
    """The load factor in the plane with abs(V) <= mu N of given N, by SciPy's ``linprog``."""
    matrix, count = _planar_equilibrium(scene)[0], len(normal)
    dead, live = (
        np.column_stack([f[:, 0], f[:, 2], f[:, 4]]).ravel()
        for f in (scene.dead_forces, scene.live_forces)
    )
    most = scene.contacts.friction * np.maximum(normal, 0.0)
    bounds = [(0.0, None)] * (2 * count) + [(-m, m) for m in most] + [(None, None)]
    answer = linprog(
        np.append(np.zeros(3 * count), -1.0),
        A_eq=np.column_stack([matrix.toarray(), live]),
        b_eq=-dead,
        bounds=bounds,
        options={"primal_feasibility_tolerance": 1e-10},
    )
    return float(answer.x[-1])


def test_friction_held_at_its_own_compressions_carries_no_more_than_a_member() -> None:
    """And more than what forces carry that belong to no member: those of associated friction, on
    whose compressions the linear program and the package agree."""
    scene = wall(
        running_bond(3, 4), unit=(0.4, 0.2, 0.3), density=20.0, friction=0.5,
        live=Load(acceleration=(1, 0, 0)),
    )  # fmt: skip
    for member in solve(scene, method=RULE).members:
        held = tresca(scene, member.forces[:, 2])
        assert held == pytest.approx(member.load_factor, rel=2e-6)
    scene = builtin_scene("ferris-tin-loi-3")
    pair = Pair(Run(scene))
    associated = pair.priced(np.zeros(len(scene.contacts)), 1e-9)
    held = pair.held(pressed(associated), 1e-9).load_factor
    assert held == pytest.approx(tresca(scene, pressed(associated)), rel=1e-6)
    assert held is not None
    assert associated.load_factor is not None
    assert held > associated.load_factor * (1 + 1e-3)


def test_pairs_never_lose_more() -> None:
    """On a wall in space, undamped."""
    run = Run(builtin_scene("tuff-wall"))
    pair, losses = Pair(run), list[float]()
    price = np.zeros(len(run.contacts))
    for _ in range(5):
        forces = pair.priced(price, 1e-9)
        held = pair.held(pressed(forces), 1e-9)
        assert held.mechanism is not None
        assert held.load_factor is not None
        assert forces.load_factor is not None
        losses.append(held.load_factor - forces.load_factor)
        price = pair.dilatancy(held.mechanism)
    assert min(losses) > -1e-7
    assert max(np.diff(losses)) < 1e-7
    assert losses[-1] < 0.1 * losses[0]


@pytest.mark.exhaustive
def test_interrupted_runs_return_members() -> None:
    """Ctrl-C during the search: what was found by then, in its bracket."""
    begun = []

    def progress(message: str) -> None:
        begun.append(message)
        if sum("friction held" in said for said in begun) > 30:
            raise KeyboardInterrupt

    scene = builtin_scene("ferris-tin-loi-1")
    rule = ZeroDilatancy(searches=1)
    whole = solve(scene, method=rule)
    solution = drive(rule, Run(scene, progress=progress))
    assert solution.status is Status.INTERRUPTED
    assert 0 < len(solution.members) < len(whole.members)
    assert solution.load_factor == solution.members[0].load_factor
    assert any("lowest so far" in said for said in begun)
    assert len(solution.searches) == 1
    assert solution.bracket.upper_is_proved
