"""What one contact contributes: its forces, rows and duals, against a program of the tests' own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cvxpy as cp
import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, Status, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COMPONENTS
from cvxlimit.masonry import random_wall
from cvxlimit.problem.problem import LimitProblem
from cvxlimit.proof.certificate import Certifier
from exhaustive import mostly_slow
from helpers import Ellipse
from referee import ROUNDING, referee, with_random_reactions


def solved(scene: Scene, surface: Any = "conic", **given: Any) -> LimitProblem:
    problem = LimitProblem(scene, surface, **given)
    assert problem.solve().status is Status.CERTIFIED
    return problem


def certified_wall(seed: int) -> tuple[Scene, LimitProblem]:
    """A random wall that collapses, and its problem, solved."""
    for number in range(100 * seed, 100 * seed + 100):
        problem = LimitProblem(scene := random_wall(number))
        if problem.solve().status is Status.CERTIFIED:
            return scene, problem
    raise AssertionError


@pytest.mark.parametrize("seed", mostly_slow(range(8), []))
def test_duals_by_contact_are_slopes(seed: int) -> None:
    """The load factor is concave in what a contact resists: a dual is no less than the difference
    quotient upwards, and no more than that downwards. Where these meet it is that slope."""
    scene, problem = certified_wall(seed)
    table, weight = problem.to_dataframe(), scene.total_weight
    exact = referee(scene).optimum
    step = 1e-4 * weight
    room = 3 * ROUNDING * exact / step
    for label in ("rocking", "torsion-shear"):
        gains = table[f"gain_{label}"].to_numpy()
        order = np.argsort(-gains)
        for j in order[[0, -1]]:
            up, down = (
                (other.value - exact) / h
                if (other := referee(scene, more={(label, int(j)): h})).status == cp.OPTIMAL
                else np.inf
                for h in (step, -step)
            )
            assert up - room <= gains[j] <= down + room


@pytest.mark.parametrize(("name", "j"), [("single-block", 0), ("arch", 0), ("arch", 20)])
@pytest.mark.exhaustive_cases("arch-0")
def test_duals_of_single_rows(name: str, j: int) -> None:
    """Each corner by itself, as the frame has their sum, and friction: where one mechanism governs
    the dual is the slope."""
    scene = builtin_scene(name)
    problem = solved(scene)
    exact, step = referee(scene).optimum, 1e-4 * scene.total_weight
    room = 3 * ROUNDING * exact / step
    duals = problem.interface(j).duals
    assert duals is not None
    for corner, dual in enumerate(duals["rocking"]):
        more = np.zeros(len(duals["rocking"]))
        more[corner] = step
        slope = (referee(scene, more={("rocking", j): more}).optimum - exact) / step
        assert dual == pytest.approx(slope, abs=room, rel=0.01)
    slope = (referee(scene, more={("torsion-shear", j): step}).optimum - exact) / step
    gain = problem.to_dataframe()["gain_torsion-shear"].iloc[j]
    assert gain == pytest.approx(slope, abs=room, rel=0.01)


@pytest.mark.parametrize("surface", ["conic", "octagon", "parabolic"])
def test_slacks_duals_and_power(surface: str) -> None:
    """Rows keep their limits, a row with room has no dual, and in all the duals of contacts and of
    equilibrium are those of the answer: forces at the limit do the work of the dead load."""
    scene = builtin_scene("tuff-wall")
    problem = solved(scene, surface)
    size = scene.total_weight
    for name in scene.contacts.names[::7]:
        face = problem.interface(name)
        assert face.slacks is not None
        assert face.duals is not None
        for label, slacks in face.slacks.items():
            duals = face.duals[label]
            assert slacks.min() >= -1e-6 * size
            assert duals.min() >= -1e-6 / size
            # inner points end where the products are alike: 1e-7 of the load factor in all
            assert (slacks * duals).max() <= 1e-6
        assert face.forces.value == pytest.approx([getattr(face, c).value for c in COMPONENTS])


@pytest.mark.parametrize("name", ["tuff-wall", "arch", "ferris-tin-loi-3"])
@pytest.mark.parametrize("solver", [None, "CLARABEL", "SCS"])
def test_duals_of_equilibrium_are_the_mechanism(name: str, solver: str | None) -> None:
    """Rates of blocks with live power 1, translations and rotations alike, whoever solves it: the
    bound that they prove is the load factor. SCS ends at 1e-4 of what it solves."""
    scene = builtin_scene(name)
    problem = LimitProblem(scene)
    found = problem.solve()
    if solver is not None:
        problem.problem.solve(solver=solver)
    rates = problem.constraints["equilibrium"].dual_value.reshape(-1, 6)
    assert (rates * scene.live_forces).sum() == pytest.approx(1.0, abs=1e-3)
    certifier = Certifier(problem._stated.at_present(), problem._stated.surfaces)
    upper = certifier.certificate(None, None, rates).upper
    assert found.lower <= upper <= found.upper * (1e-2 if solver == "SCS" else 1e-5) + found.upper
    if solver is None:
        mechanism = np.array([found.mechanism[scene.blocks[i].id] for i in scene.free])
        np.testing.assert_allclose(rates, mechanism, atol=1e-12 * np.abs(rates).max())


def test_duals_of_equilibrium_are_slopes_by_loads() -> None:
    """A further dead load e costs u . e: forces and moments, in any unit of force."""
    scene = builtin_scene("arch")
    problem = solved(scene)
    rates = problem.constraints["equilibrium"].dual_value.reshape(-1, 6)
    step = 1e-5 * scene.total_weight
    for row, column in ((3, 0), (3, 2), (8, 4), (11, 4)):
        extra = np.zeros((len(scene.free), 6))
        extra[row, column] = step
        up, down = (
            solved(scene, dead=scene.dead_forces + s * extra).solve(tolerance=1e-9).load_factor
            for s in (1.0, -1.0)
        )
        assert up is not None
        assert down is not None
        assert -rates[row, column] == pytest.approx((up - down) / (2 * step), rel=1e-3)


def test_units_of_force() -> None:
    """In newtons the same block has a thousandth of the duals, and the same mechanism's shape."""
    scene = builtin_scene("tuff-wall")
    blocks = [replace(b, density=b.density and 1e3 * b.density) for b in scene.blocks]
    kilo, plain = (solved(s).to_dataframe() for s in (scene, scene._copy(blocks=tuple(blocks))))
    for label in ("gain_rocking", "gain_torsion-shear"):
        total = kilo[label].sum()
        assert total > 0.0
        assert 1e3 * plain[label].sum() == pytest.approx(total, rel=1e-3)


def test_rows_of_all_contacts_are_the_problem() -> None:
    """Put together again, for every kind of rows: facets, cohesion, crushing, reactions."""
    wall = random_wall(3, sizes=[(2, 3)])
    for scene, surface in (
        (wall, "conic"),
        (wall, "octagon"),
        (wall, "parabolic"),
        (wall.with_cohesion(0.1), "conic"),
        (wall.with_strength(compressive=30.0), "conic"),
        (with_random_reactions(wall, 3, is_planar=False), "conic"),
        (builtin_scene("single-block"), [*LimitProblem(wall)._stated.surfaces[:1], Ellipse()]),
    ):
        problem = LimitProblem(scene, surface)
        rows = [
            limit
            for name in scene.contacts.names
            for limits in problem.interface(name).constraints.values()
            for limit in limits
        ]
        whole = cp.Problem(cp.Maximize(problem.factor), problem.constraints["equilibrium"] + rows)
        whole.solve(solver=cp.CLARABEL)
        assert whole.value == pytest.approx(solve(scene, surface).load_factor, rel=1e-5)
        sizes = {k: sum(c.size for c in v) for k, v in problem.constraints.items()}
        del sizes["equilibrium"]
        assert sum(row.size for row in rows) == sum(sizes.values())


def test_a_problem_of_its_own_tells_its_own_duals() -> None:
    """Rows of a contact in another problem have the duals of that."""
    problem = solved(builtin_scene("single-block"))
    base = problem.interface("ground-b1")
    before = base.constraints["rocking"][0].dual_value
    rows = [limit for limits in base.constraints.values() for limit in limits]
    half = cp.Maximize(0.5 * problem.factor)
    cp.Problem(half, problem.constraints["equilibrium"] + rows).solve(solver=cp.CLARABEL)
    after = base.constraints["rocking"][0].dual_value
    np.testing.assert_allclose(after, 0.5 * before, atol=1e-6)
    assert problem.interface(0).duals is not None


def leg(x: float) -> list[Block]:
    return [Block.box(f"leg{x:g}", (x, 0, 0), (x + 0.2, 1, 1), 20.0)]


class TestNames:
    """Contacts are known by name, number, or both blocks."""

    def scene(self) -> Scene:
        """A table on two legs."""
        ground = Block.box("ground", (-1, -1, -1), (3, 2, 0))
        plank = Block.box("plank", (0, 0, 1), (2, 1, 1.2), 20.0)
        push = Load(acceleration=(1, 0, 0))
        return Scene([ground, *leg(0.0), *leg(1.8), plank], ["ground"], push, friction=0.6)

    def test_all_ways(self) -> None:
        problem = LimitProblem(self.scene())
        names = problem._stated.assemblage.contacts.names
        for j, pair in enumerate(problem._stated.pairs):
            for asked in (names[j], j, np.int64(j), j - len(names), pair, [*pair[::-1]]):
                face = problem.interface(asked)
                assert (face.name, face.between) == (names[j], pair)
        assert problem.interface(0).slacks is None
        assert problem.interface(0).duals is None
        assert problem.to_dataframe().isna().any(axis=1).all()

    @pytest.mark.parametrize(
        ("asked", "message"),
        [
            ("leg0-plnk", "no contact 'leg0-plnk': did you mean 'leg0-plank'"),
            (("leg0", "leg1.8"), "no contact between .*: these blocks do not touch"),
            (("leg0", "plonk"), "no contact has a block 'plonk'; did you mean 'plank'"),
            (17, "its name, its two blocks or its number below 4, got 17"),
            (True, "its name, its two blocks or its number below 4, got True"),
            (None, "its name, its two blocks or its number below 4, got None"),
        ],
    )
    def test_wrong_ones(self, asked: Any, message: str) -> None:
        with pytest.raises(ModelError, match=message):
            LimitProblem(self.scene()).interface(asked)

    def test_two_contacts_between_the_same_blocks(self) -> None:
        scene = builtin_scene("single-block")
        low, block = scene.blocks
        corner = block.vertices.max(axis=0)
        beside = Block.box("beside", (corner[0], -1, 0), (corner[0] + 1, 1, corner[2]), 20.0)
        both = [low, block, beside]
        found = LimitProblem(replace(scene, blocks=both)).interface(("beside", "b1"))
        assert set(found.between) == {"beside", "b1"}


def test_two_scenes_in_one_problem() -> None:
    """One friction and one load factor for both: the lesser of what each carries alone."""
    friction = cp.Parameter(value=0.5, name="friction")
    one, two = (
        LimitProblem(builtin_scene(n), friction=friction) for n in ("single-block", "tuff-wall")
    )
    both = cp.Problem(
        cp.Maximize(one.factor),
        [*one.problem.constraints, *two.problem.constraints, one.factor == two.factor],
    )
    for friction.value in (0.6, 0.4):
        alone = [problem.solve().load_factor for problem in (one, two)]
        both.solve(solver=cp.CLARABEL)
        assert None not in alone
        assert both.value == pytest.approx(min(a for a in alone if a is not None), rel=1e-5)
        powers = [
            float(p.constraints["equilibrium"].dual_value @ p._stated.assemblage.statics.live)
            for p in (one, two)
        ]
        # a mechanism of the one that governs; the other stays at rest
        assert sum(powers) == pytest.approx(1.0, abs=1e-4)
        assert powers[int(np.argmin(alone))] == pytest.approx(1.0, abs=1e-4)
