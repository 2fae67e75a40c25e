"""Our own solver: its algebra by definition, its answers by other solvers and by hand."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import cvxpy as cp
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cvxlimit import Load, Scene, Status, builtin_scene, solve
from cvxlimit.errors import SolverError
from cvxlimit.masonry import panel, running_bond, wall
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.formulations import resultants
from cvxlimit.model.goals import LargestFactor
from cvxlimit.model.problem import LimitProblem
from cvxlimit.proof.certificate import Certifier
from cvxlimit.solvers import (
    Blockwise,
    Outcome,
    Shape,
    SolverSettings,
    default_ladder,
    limit_ladder,
)
from cvxlimit.solvers.extensions import BATCH, SMALL
from cvxlimit.solvers.interior.compiled import CompiledCones, CompiledSystem
from cvxlimit.solvers.interior.cones import Cones
from cvxlimit.solvers.interior.elimination import NewtonSystem
from cvxlimit.solvers.interior.iteration import InteriorPoint, Point, Result
from cvxlimit.solvers.interior.whole import HANDED_OVER, small_program
from cvxlimit.solvers.sparse import backends
from cvxlimit.surfaces.coulomb import DEFAULT_SURFACES
from helpers import assert_certified, named_scene, scenes
from kinematics import KinematicProblem

FloatArray = NDArray[np.float64]

OWN = SolverSettings("BLOCKWISE")
SEEDS = st.integers(0, 2**32 - 1)


COMPILED = pytest.mark.skipif(BATCH is None, reason="not compiled here")
SYSTEMS = [NewtonSystem, pytest.param(CompiledSystem, marks=COMPILED)]
KINDS = [Cones, pytest.param(CompiledCones, marks=COMPILED)]


def random_cones(rng: np.random.Generator, kind: type[Cones] = Cones) -> Cones:
    """Up to a dozen cones of sizes 1 to 5, some of equal size."""
    slabs = [tuple(map(int, rng.integers(1, 6, 2))) for _ in range(int(rng.integers(1, 5)))]
    return kind(int(rng.integers(0, 5)), slabs)  # type: ignore[arg-type]


def inside(cones: Cones, rng: np.random.Generator, margin: float = 0.1) -> FloatArray:
    v = rng.normal(size=cones.size)
    return v + (margin - cones.margin(v)) * cones.identity


@pytest.mark.parametrize("kind", KINDS)
class TestCones:
    @given(seed=SEEDS)
    @settings(max_examples=50, deadline=None)
    def test_scaling_maps_z_and_s_to_one_point(self, kind: type[Cones], seed: int) -> None:
        """The definition W z = W^-1 s; 1e-9 for points up to 1e-3 from the boundary."""
        rng = np.random.default_rng(seed)
        cones = random_cones(rng, kind)
        s, z = inside(cones, rng, 1e-3), inside(cones, rng, 1e-3)
        scaling = cones.scaling(s, z)
        v = rng.normal(size=cones.size)
        close = partial(np.testing.assert_allclose, rtol=1e-9, atol=1e-9)
        close(scaling.times(z), scaling.lam)
        close(scaling.times(scaling.lam), s)
        close(scaling.squared(v), scaling.times(scaling.times(v)))
        # rounding grows with the square of what W does: 3e-9 in the worst of thousands of cases
        close(scaling.squared(scaling.squared(v), -1.0), v, rtol=1e-7, atol=1e-7)
        if kind is not Cones:
            return
        for slab, (place, shape) in enumerate(zip(cones.places, cones.shapes, strict=True)):
            applied = scaling.over(slab, v[place].reshape(shape)[:, None])
            whole = np.zeros_like(v)
            whole[place] = applied.ravel()
            close(scaling.times(whole)[place], v[place])

    @given(seed=SEEDS)
    @settings(max_examples=50, deadline=None)
    def test_quotient_undoes_product(self, kind: type[Cones], seed: int) -> None:
        rng = np.random.default_rng(seed)
        cones = random_cones(rng, kind)
        u, v = inside(cones, rng), rng.normal(size=cones.size)
        product = cones.product(u, v)
        np.testing.assert_allclose(cones.quotient(product, u), v, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(cones.product(u, cones.identity), u, atol=1e-12)

    @given(seed=SEEDS)
    @settings(max_examples=50, deadline=None)
    def test_step_ends_on_the_boundary(self, kind: type[Cones], seed: int) -> None:
        rng = np.random.default_rng(seed)
        cones = random_cones(rng, kind)
        u, d = inside(cones, rng), rng.normal(size=cones.size)
        t = float(cones.steps(u, d)[0])
        if np.isinf(t):
            assert cones.margin(d) >= -1e-12
        else:
            assert cones.margin(u + t * d) == pytest.approx(0.0, abs=1e-9 * (1.0 + t))
            assert cones.margin(u + 0.99 * t * d) > 0.0

    @given(seed=SEEDS)
    @settings(max_examples=50, deadline=None)
    def test_clipping_moves_eigenvalues_and_no_more(self, kind: type[Cones], seed: int) -> None:
        rng = np.random.default_rng(seed)
        cones = random_cones(rng, kind)
        u = 3.0 * rng.normal(size=cones.size)
        clipped = cones.clipped(u, 0.2, 1.5)
        assert cones.margin(clipped) >= 0.2 - 1e-12
        assert cones.margin(1.5 * cones.identity - clipped) >= -1e-12
        np.testing.assert_allclose(cones.clipped(clipped, 0.2, 1.5), clipped, atol=1e-12)

    def test_a_point_on_the_boundary_has_no_scaling(self, kind: type[Cones]) -> None:
        cones = kind(1, [(3, 1)])
        with pytest.raises(FloatingPointError, match="left the cones"):
            cones.scaling(np.array([1.0, 1.0, 1.0, 0.0]), cones.identity)

    def test_nan_is_seen(self, kind: type[Cones]) -> None:
        cones = kind(2, [(3, 2)])
        for place in range(cones.size):
            v = cones.identity.copy()
            v[place] = np.nan
            assert np.isnan(cones.margin(v))
            with pytest.raises(FloatingPointError):
                cones.scaling(v, cones.identity)

    def test_margins_of_infinite_heads(self, kind: type[Cones]) -> None:
        """They are no NaN: the other cones' margin, or none."""
        cones = kind(1, [(3, 2)])
        u = 2.0 * cones.identity
        u[1] = np.inf
        assert cones.margin(u) == 2.0
        u[1] = -np.inf
        assert cones.margin(u) == -np.inf


@pytest.mark.parametrize("backend", backends())
class TestNewtonSystem:
    @pytest.mark.parametrize("kind", SYSTEMS)
    def test_agrees_with_a_dense_solution(self, kind: type[NewtonSystem], backend: str) -> None:
        """The whole matrix, written out; 1e-9 because the right-hand sides are of order one."""
        rng = np.random.default_rng(3)
        G = sp.block_diag(  # rows in another order than the cones, so that blocks mix both kinds
            [sp.csr_array(rng.normal(size=(7, width))) for width in (3, 4, 2)]
        ).tocsr()
        order = [0, 1, 7, 8, 14, 15, 16, 17, 2, 3, 4, 9, 10, 11, 5, 6, 18, 19, 12, 13, 20]
        G = sp.hstack([G[order], sp.csr_array((21, 1))]).tocsr()
        E = sp.csr_array(rng.normal(size=(5, 10)))
        system = kind(sp.vstack([E, G]).tocsr(), 5, 8, [3, 3, 4, 3], backend)
        cones = system.cones
        scaling = cones.scaling(inside(cones, rng), inside(cones, rng))
        system.factorise(scaling)
        right = rng.normal(size=36)
        W = np.stack([scaling.times(row) for row in np.eye(21)])
        G, E = G[system.rows][:, system.columns], E[:, system.columns]
        whole = np.block(
            [
                [np.zeros((10, 10)), E.toarray().T, G.toarray().T],
                [E.toarray(), np.zeros((5, 26))],
                [G.toarray(), np.zeros((21, 5)), -W @ W],
            ]
        )
        expected = np.linalg.solve(whole, right)
        np.testing.assert_allclose(system.solve(right), expected, atol=1e-9)

    @pytest.mark.parametrize("kind", SYSTEMS)
    def test_hard_blocks_among_others(self, kind: type[NewtonSystem], backend: str) -> None:
        """Columns that are equal but for 1e-5, which squares lose half of their digits on, in
        some of 13 blocks: by the residual of the whole system, relative to what adds up in it;
        1e-9 for six digits lost."""
        rng = np.random.default_rng(4)
        blocks = [rng.normal(size=(4, 3)) for _ in range(13)]
        for hard in (0, 5, 6, 12):
            blocks[hard][:, 1] = blocks[hard][:, 0] + 1e-5 * blocks[hard][:, 1]
        G = sp.block_diag([sp.csr_array(block) for block in blocks]).tocsr()
        E = sp.csr_array(rng.normal(size=(8, 39)))
        system = kind(sp.vstack([E, G]).tocsr(), 8, 52, [], backend)
        scaling = system.cones.scaling(*rng.uniform(0.5, 2.0, (2, 52)))
        system.factorise(scaling)
        right = rng.normal(size=39 + 8 + 52)
        x, y, z = system.parts(system.solve(right))
        E, G = E[:, system.columns], G[system.rows][:, system.columns]
        left = np.concatenate([E.T @ y + G.T @ z, E @ x, G @ x - scaling.squared(z)]) - right
        terms = abs(E.T) @ abs(y) + abs(G.T) @ abs(z), abs(E) @ abs(x), abs(G) @ abs(x)
        assert np.all(np.abs(left) <= 1e-9 * (1.0 + np.concatenate(terms)))

    @pytest.mark.parametrize("kind", SYSTEMS)
    def test_entries_given_twice_add_up(self, kind: type[NewtonSystem], backend: str) -> None:
        """Each entry in two halves, then other numbers: as a system made of those; 1e-9 because
        the right-hand side is of order one."""
        rng = np.random.default_rng(6)
        G = sp.block_diag([sp.csr_array(rng.normal(size=(5, 3))) for _ in range(6)], format="csr")
        G = sp.hstack([G, sp.csr_array((30, 1))])
        A = sp.vstack([sp.csr_array(rng.normal(size=(7, 19))), G], format="csr")
        halves = [np.repeat(0.5 * A.data, 2), np.repeat(A.indices, 2), 2 * A.indptr]
        scaled, right = rng.uniform(0.5, 2.0, (2, 30)), rng.normal(size=19 + 7 + 30)
        answers = []
        for factor in (1.0, 3.0):
            whole = kind(factor * A, 7, 30, [], backend)
            twice = kind(sp.csr_array(tuple(halves), shape=A.shape), 7, 30, [], backend)
            twice.renew(factor * halves[0])
            for system in (whole, twice):
                system.factorise(system.cones.scaling(*scaled))
                answers.append(system.solve(right))
        np.testing.assert_allclose(answers[1], answers[0], atol=1e-9)
        np.testing.assert_allclose(answers[3], answers[2], atol=1e-9)
        assert np.abs(answers[2] - answers[0]).max() > 0.01

    def test_a_bounded_variable_in_all_equations(self, backend: str) -> None:
        """It borders the Schur complement although it has a cone row: max t, t <= 2 or less."""
        n = 300
        for most, expected in ((2.0, 2.0), (0.5, 0.5), (9.0, 3.0)):
            t, x = cp.Variable(), cp.Variable(n)
            problem = cp.Problem(
                cp.Maximize(t), [x == t * np.ones(n) - 1.0, x <= 2.0, x >= -4.0, t <= most]
            )
            value = problem.solve(solver=Blockwise(), backend=backend)
            assert value == pytest.approx(expected, abs=1e-8)


def random_program(rng: np.random.Generator) -> cp.Problem:
    """Feasible and bounded: contacts of random sizes, tied together by sparse equations."""
    count, rows = int(rng.integers(3, 12)), int(rng.integers(2, 9))
    variables = [cp.Variable(int(rng.integers(2, 6))) for _ in range(count)]
    constraints: list[cp.Constraint] = []
    total: Any = 0.0
    level = cp.Variable()
    for x in variables:
        n = x.shape[0]
        constraints.append(cp.norm(rng.normal(size=(n, n)) @ x) <= 1.0 + rng.random())
        if rng.random() < 0.5:
            constraints.append(x[0] + rng.random(n) @ x <= 0.3)
        matrix = rng.normal(size=(rows, n)) * (rng.random((rows, 1)) < 0.7)
        total = total + matrix @ x
    constraints.append(total == level * rng.normal(size=rows))
    cost = sum(rng.normal(size=x.shape[0]) @ x for x in variables)
    return cp.Problem(cp.Maximize(level + 0.1 * cost), [*constraints, level <= 5.0])


class TestAnswers:
    @pytest.mark.exhaustive
    @given(seed=SEEDS)
    @settings(max_examples=40, deadline=None)
    def test_random_programs_as_clarabel(self, seed: int) -> None:
        """Two solvers, one value: 1e-6, a hundred times what both are asked for.

        Clarabel is asked for its own 1e-8: at 1e-9 it gave up on seeds 1975 and 22403.
        """
        problem = random_program(np.random.default_rng(seed))
        expected = problem.solve(solver="CLARABEL")
        assert problem.solve(solver=Blockwise()) == pytest.approx(expected, rel=1e-6, abs=1e-6)
        assert problem.status == "optimal"

    def test_duals_have_cvxpys_signs(self) -> None:
        problem = random_program(np.random.default_rng(5))
        problem.solve(solver="CLARABEL", tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
        expected = [c.dual_value for c in problem.constraints]
        problem.solve(solver=Blockwise())
        for constraint, dual in zip(problem.constraints, expected, strict=True):
            np.testing.assert_allclose(_flat(constraint.dual_value), _flat(dual), atol=1e-5)

    @pytest.mark.exhaustive_cases(*(f"s10-panel-conic-0.259313-{name}" for name in backends()))
    @pytest.mark.exhaustive_cases(
        *(f"s12-panel-octagon-0.184581-{name}" for name in backends()),
        *(f"s12-panel-conic-0.181935-{name}" for name in backends()),
    )
    @pytest.mark.parametrize("backend", backends())
    @pytest.mark.parametrize(
        ("name", "surface", "published"),
        [
            ("ferris-tin-loi-1", "octagon", 0.642859),
            ("ferris-tin-loi-3", "conic", 0.403694),
            ("tuff-wall", "octagon", 0.450034),
            ("tuff-wall", "conic", 0.423056),
            ("s12-panel", "octagon", 0.184581),
            ("s12-panel", "conic", 0.181935),
            ("s10-panel", "conic", 0.259313),
        ],
    )
    def test_published_values(
        self, name: str, surface: str, published: float, backend: str
    ) -> None:
        """On its own, certified: digits and tolerance of tests/whole/test_published.py."""
        rung = SolverSettings("BLOCKWISE", {"backend": backend})
        solution = solve(builtin_scene(name), surface, ladder=[rung])
        assert_certified(solution, builtin_scene(name), proved=name != "ferris-tin-loi-1")
        assert solution.load_factor == pytest.approx(published, rel=1e-5)

    @pytest.mark.exhaustive
    @given(scene=scenes())
    @settings(max_examples=15, deadline=None)
    def test_random_scenes_as_the_usual_ladder(self, scene: Scene) -> None:
        """Brackets that are both right meet; 1e-9 for rounding."""
        own, usual = solve(scene, ladder=[OWN]), solve(scene)
        assert own.status.has_answer == usual.status.has_answer
        if usual.status.has_answer:
            slack = 1e-9 * max(1.0, abs(usual.upper))
            assert own.lower <= usual.upper + slack
            assert usual.lower <= own.upper + slack

    @pytest.mark.parametrize("surface", ["conic", "octagon"])
    def test_an_octagon_that_clarabel_leaves_inaccurate(self, surface: str) -> None:
        """A bonded wall of 988 contacts, 46 iterations long for Clarabel."""
        scene = wall(running_bond(13, 26), friction=0.65)
        assert_certified(solve(scene, surface, ladder=[OWN]), scene)

    @pytest.mark.exhaustive
    def test_a_panel_on_which_refinement_stalled(self) -> None:
        """Its iterates broke the flow rule by 1e-8: brackets of 3e-6, and Clarabel's turn."""
        scene = panel(1.32, 44, left_return=0.88, right_return=0.88)
        assert len(scene.contacts) == 4_914
        solution = solve(scene, ladder=[OWN], tolerance=1e-6)
        assert solution.status is Status.CERTIFIED
        assert_certified(solution, scene)

    @pytest.mark.parametrize("backend", backends())
    @pytest.mark.parametrize(
        ("constraints", "value"),
        [
            (lambda x, y: [x[0] + x[1] >= 1, x[0] + x[1] <= 3, x[2:] >= 0, x[2:] == y[2:]], 1.0),
            (lambda x, y: [x >= 1, x == y, x == y], 16.0),
            (lambda x, y: [x >= 1, x[0] == y[0], 0 * x[0] == 0], 9.0),
            (lambda x, y: [x >= 1, x == y, x == y + 1], np.inf),
            (lambda x, y: [x >= 1, x[0] == y[0], 0 * x[0] == 1], np.inf),
        ],
        ids=["free direction", "twice", "empty", "contradiction", "empty contradiction"],
    )
    def test_degenerate_programs(self, constraints: Any, value: float, backend: str) -> None:
        """Values by hand: the least sum of 8 x and 8 y >= 0."""
        x, y = cp.Variable(8), cp.Variable(8)
        problem = cp.Problem(cp.Minimize(cp.sum(x) + cp.sum(y)), [*constraints(x, y), y >= 0])
        assert problem.solve(solver=Blockwise(), backend=backend) == pytest.approx(value, rel=1e-8)

    def test_other_formulation(self) -> None:
        state = LimitProblem(builtin_scene("tuff-wall"), formulation=resultants).run(OWN)
        assert state.load_factor == pytest.approx(0.423056, rel=1e-5)


@pytest.fixture(scope="module")
def program() -> InteriorPoint:
    return _program(builtin_scene("tuff-wall"))


@pytest.fixture(scope="module")
def cold(program: InteriorPoint) -> Result:
    return program.minimise(1e-8, 100)


@COMPILED
@pytest.mark.parametrize("name", ["tuff-wall", "ferris-tin-loi-2", "dome"])
@pytest.mark.parametrize("surface", ["conic", "octagon"])
def test_compiled_or_not_the_answer_is_one(
    monkeypatch: pytest.MonkeyPatch, name: str, surface: str
) -> None:
    """A load factor to 1e-9, which both were asked for, on surfaces with and without cones."""
    scene, factors = builtin_scene(name), []
    for extension in (BATCH, None):
        monkeypatch.setattr("cvxlimit.solvers.interior.compiled.BATCH", extension)
        rung = SolverSettings("BLOCKWISE", {"tolerance": 1e-9})
        factors.append(solve(scene, surface, ladder=[rung]).load_factor)
    assert factors[0] == pytest.approx(factors[1], rel=1e-8)


class TestWarmStarts:
    """A start costs or saves time; the answer is that of a cold solve."""

    @pytest.mark.parametrize("friction", [0.55, 0.6, 0.9])
    def test_a_neighbours_point_is_the_way_to_the_answer(
        self, cold: Result, friction: float
    ) -> None:
        """Two solves to 1e-8 agree to 1e-7."""
        other = _program(builtin_scene("tuff-wall").with_friction(friction))
        own, warm = other.minimise(1e-8, 100), other.minimise(1e-8, 100, [cold.middle])
        assert warm.status == own.status == "Solved"
        assert warm.objective == pytest.approx(own.objective, rel=1e-7)

    @pytest.mark.parametrize("seed", range(4))
    @pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
    def test_noise(self, program: InteriorPoint, cold: Result, seed: int, size: float) -> None:
        rng = np.random.default_rng(seed)
        x, y, z, s = (size * rng.normal(size=len(v)) for v in _parts(cold.point))
        found = program.minimise(1e-8, 150, [Point(x, y, np.abs(z), np.abs(s))])
        if found.status == "Solved":
            assert found.objective == pytest.approx(cold.objective, rel=1e-7)

    @pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
    def test_nothing_to_start_from(
        self, program: InteriorPoint, cold: Result, value: float
    ) -> None:
        start = Point(*(np.full_like(v, value) for v in _parts(cold.point)))
        found = program.minimise(1e-8, 100, [start])
        assert (found.status, found.objective) == (cold.status, cold.objective)

    def test_another_scenes_point(self, program: InteriorPoint, cold: Result) -> None:
        other = _program(builtin_scene("stack")).minimise(1e-8, 100)
        found = program.minimise(1e-8, 100, [other.middle])
        assert (found.status, found.objective) == (cold.status, cold.objective)

    def test_who_only_leads_ends_at_a_point_to_start_from(self) -> None:
        """Where the answer to a hundredth is all that is asked for, of residuals as well."""
        given = _program(builtin_scene("tuff-wall"))
        lead = given.minimise(1e-2, 100, residual=1e-2)
        assert lead.status == "Solved"
        assert lead.middle is not None
        found = given.minimise(1e-8, 100, [lead.middle])
        assert found.status == "Solved"
        assert lead.objective == pytest.approx(found.objective, rel=0.05)

    def test_iterates_are_strictly_admissible(self) -> None:
        """Inside all cones, and so near to equilibrium that the state still is inside all surfaces
        once it is put there: its bound loses nothing."""
        assemblage = Assemblage.of(builtin_scene("tuff-wall"))
        problem = LimitProblem(assemblage)
        given = problem.program
        assert given is not None
        matrix, cones = sp.csr_array(given.matrix), list(given.cones)
        own = InteriorPoint(
            given.cost, matrix, given.right, given.zero, given.nonneg, cones, "superlu"
        )
        middle = own.minimise(1e-8, 100).middle
        assert middle is not None
        assert own.cones.margin(own.h - own.system.G @ middle.x[own.system.columns]) > 0.0
        state = problem.state(Outcome("on the way", 0.0, 0.0), middle.x, middle.y)
        bounds = Certifier(assemblage, DEFAULT_SURFACES).of(state)
        assert bounds.lower_is_proved
        assert bounds.lower == pytest.approx(state.load_factor, rel=1e-12)

    def test_cvxpy_hands_the_start_over(self) -> None:
        """The second answer, warm, is that of a solver which has seen nothing else."""
        friction = cp.Parameter(nonneg=True, value=0.5)
        x = cp.Variable(3)
        problem = cp.Problem(
            cp.Maximize(x[0]), [cp.norm(x[:2]) <= friction * x[2], x[2] == 2.0, x[1] == 0.1]
        )
        for value in (0.5, 0.6):
            friction.value = value
            found = problem.solve(solver=Blockwise(), warm_start=True)
            assert found == pytest.approx(np.sqrt((2.0 * value) ** 2 - 0.01), rel=1e-8)


def _program(scene: Scene) -> InteriorPoint:
    """The limit problem as arrays, from CVXPY."""
    problem = LimitProblem(scene).problem
    data, _, _ = problem.get_problem_data(Blockwise(), solver_opts={})
    dims = data["dims"]
    matrix, right = sp.csr_array(data["A"]), np.asarray(data["b"])
    return InteriorPoint(
        np.asarray(data["c"]), matrix, right, dims.zero, dims.nonneg, list(dims.soc), "superlu"
    )


def _parts(point: Point) -> tuple[FloatArray, ...]:
    return point.x, point.y, point.z, point.s


def _flat(dual: Any) -> FloatArray:
    """A dual value, or the several of a cone, as one array."""
    parts = dual if isinstance(dual, list) else [dual]
    return np.concatenate([np.atleast_1d(part).ravel() for part in parts])


@pytest.mark.skipif(SMALL is None, reason="not compiled here")
class TestSmall:
    """The whole iteration compiled, on general programs; test_hull.py has copies of contacts."""

    @staticmethod
    def given(problem: cp.Problem) -> tuple[FloatArray, sp.csc_array, FloatArray, Any]:
        data = problem.get_problem_data(Blockwise())[0]
        dims = data["dims"]
        return data["c"], sp.csc_array(data["A"]), data["b"], (dims.zero, dims.nonneg, dims.soc)

    @pytest.mark.parametrize("seed", range(12))
    def test_as_the_general_way(self, seed: int) -> None:
        """Both to 1e-9; what else they share are formulas."""
        c, A, b, cones = self.given(random_program(np.random.default_rng(seed)))
        expected = InteriorPoint(c, sp.csr_array(A), b, *cones, backends()[0]).minimise(1e-9, 100)
        found = small_program(c, A, b, cones, 1e-9, 100)
        assert found is not None
        assert found.status == expected.status == "Solved"
        assert found.objective == pytest.approx(expected.objective, rel=1e-7, abs=1e-8)

    @pytest.mark.parametrize("seed", range(12))
    def test_both_sides_are_feasible(self, seed: int) -> None:
        """Sizes of entries are of the order of 1; 1e-7 is ten times what is asked for."""
        c, A, b, cones = self.given(random_program(np.random.default_rng(100 + seed)))
        found = small_program(c, A, b, cones, 1e-8, 100)
        assert found is not None
        x, y, z, s = (getattr(found.point, name) for name in "xyzs")
        zero, orthant, soc = cones
        assert np.abs(A @ x + np.concatenate([np.zeros(zero), s]) - b).max() < 1e-7
        assert np.abs(A.T @ np.concatenate([y, z]) + c).max() < 1e-7
        for side in (s, z):
            assert side[:orthant].min(initial=1.0) > 0.0
            at = orthant
            for size in soc:
                assert np.linalg.norm(side[at + 1 : at + size]) < side[at]
                at += size
        assert -b @ np.concatenate([y, z]) == pytest.approx(c @ x, rel=1e-7, abs=1e-7)

    @pytest.mark.parametrize("seed", range(6))
    def test_the_order_of_what_is_given_does_not_matter(self, seed: int) -> None:
        """Equations and columns in another order, an entry in two parts: the same optimum."""
        rng = np.random.default_rng(seed)
        c, A, b, cones = self.given(random_program(rng))
        rows = np.concatenate([rng.permutation(cones[0]), np.arange(cones[0], len(b))])
        columns = rng.permutation(len(c))
        other = sp.csc_array(A[rows][:, columns])
        share = rng.random(len(other.data))
        halves = np.column_stack([share * other.data, (1.0 - share) * other.data]).ravel()
        twice = sp.csc_array((halves, np.repeat(other.indices, 2), 2 * other.indptr), other.shape)
        first = small_program(c, A, b, cones, 1e-9, 100)
        second = small_program(c[columns], twice, b[rows], cones, 1e-9, 100)
        assert first is not None
        assert second is not None
        assert second.objective == pytest.approx(first.objective, rel=1e-7, abs=1e-8)

    @pytest.mark.parametrize("seed", range(6))
    @pytest.mark.parametrize("above", [1e-3, 0.1, 1.0])
    def test_it_may_end_where_the_dual_objective_is_enough(self, seed: int, above: float) -> None:
        """What it then says is a bound: feasible duals whose objective lies between both."""
        c, A, b, cones = self.given(random_program(np.random.default_rng(seed)))
        whole = small_program(c, A, b, cones, 1e-9, 100)
        assert whole is not None
        enough = whole.objective - above
        found = small_program(c, A, b, cones, 1e-9, 100, enough)
        assert found is not None
        y = np.concatenate([found.point.y, found.point.z])
        assert np.abs(A.T @ y + c).max() < 1e-3 * above
        assert enough <= -b @ y <= whole.objective + 1e-7 * (1.0 + abs(whole.objective))

    @pytest.mark.parametrize("size", [0.0, 1e-6, 1.0, 1e6, np.nan, np.inf])
    def test_any_start(self, size: float) -> None:
        """From its own path, from noise and from none the optimum is the same."""
        rng = np.random.default_rng(3)
        c, A, b, cones = self.given(random_program(rng))
        cold = small_program(c, A, b, cones, 1e-9, 100)
        assert cold is not None
        assert cold.middle is not None
        for point in (cold.middle, cold.point):
            noisy = Point(*(v + size * rng.normal(size=len(v)) for v in _parts(point)))
            found = small_program(c, A, b, cones, 1e-9, 100, start=noisy)
            assert found is not None
            assert found.objective == pytest.approx(cold.objective, rel=1e-7, abs=1e-8)
        short = Point(*(v[1:] for v in _parts(cold.point)))
        found = small_program(c, A, b, cones, 1e-9, 100, start=short)
        assert found is not None
        assert found.objective == cold.objective

    def test_equations_out_of_reach_of_each_other(self) -> None:
        """Two walls of blocks without a common equation, and a variable in all equations of both:
        max t, t <= x for all x, where x = 1 and x = 2 in turns."""
        n = 120
        x, t = cp.Variable(n), cp.Variable()
        value = 1.0 + np.arange(n) % 2
        problem = cp.Problem(
            cp.Maximize(t),
            [x - t >= 0, x + 0 * t == value, t <= 9.0, cp.sum(x[: n // 2]) >= 0],
        )
        assert problem.solve(solver=Blockwise()) == pytest.approx(1.0, abs=1e-8)

    def test_runs_at_the_same_time_do_not_disturb_each_other(self) -> None:
        """Programs of several sizes, one after another and in four threads: each the same to the
        last digit, whatever memory a run finds."""
        given = [self.given(random_program(np.random.default_rng(seed))) for seed in range(12)] * 8

        def answer(program: tuple[FloatArray, sp.csc_array, FloatArray, Any]) -> FloatArray:
            found = small_program(*program, 1e-9, 100)
            assert found is not None
            return np.concatenate(_parts(found.point))

        expected = [answer(program) for program in given]
        with ThreadPoolExecutor(4) as pool:
            for found, one in zip(pool.map(answer, given), expected, strict=True):
                assert np.array_equal(found, one)

    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_what_is_no_number_has_no_answer(self, value: float) -> None:
        """In any place of the data, or of a start: no answer, and the same one as from afresh."""
        rng = np.random.default_rng(3)
        c, A, b, cones = self.given(random_program(rng))
        whole = small_program(c, A, b, cones, 1e-9, 100)
        assert whole is not None
        for _ in range(40):
            data = [c.copy(), A.copy(), b.copy()]
            wrong = data[rng.integers(3)]
            entries = wrong.data if isinstance(wrong, sp.csc_array) else wrong
            entries[rng.integers(len(entries))] = value
            found = small_program(data[0], data[1], data[2], cones, 1e-9, 100)
            assert found is None or found.status not in ("Solved", "AlmostSolved")
            parts = [part.copy() for part in _parts(whole.point)]
            start = parts[rng.integers(4)]
            start[rng.integers(len(start))] = value
            found = small_program(c, A, b, cones, 1e-9, 100, start=Point(*parts))
            assert found is not None
            assert found.objective == pytest.approx(whole.objective, rel=1e-8)

    def test_wrong_arrays_are_refused(self) -> None:
        """A size that does not fit would be a crash: arrays of a wrong kind, length or place."""
        c, A, b, (zero, orthant, soc) = self.given(random_program(np.random.default_rng(0)))
        size = len(c) + zero + 2 * (len(b) - zero)
        indptr, indices = A.indptr.astype(np.int32), A.indices.astype(np.int32)
        right = [
            c, indptr, indices, A.data, b, zero, orthant, np.array(soc), 1e-8, 50, np.inf, 0,
            np.zeros(size), np.zeros(size), HANDED_OVER,
        ]  # fmt: skip
        SMALL.minimise(*right)
        wrong = {
            0: c[:-1], 1: indptr.astype(np.int64), 2: indices + len(b), 3: A.data[:-1], 4: b[:-1],
            5: -1, 6: orthant + 1, 7: np.array([*soc, 3]), 12: np.zeros(size - 1),
            13: np.zeros(size + 1), 14: HANDED_OVER[:-1], 14.5: np.nan * HANDED_OVER,
        }  # fmt: skip
        for place, value in ((int(place), value) for place, value in wrong.items()):
            with pytest.raises((ValueError, BufferError)):
                SMALL.minimise(*right[:place], value, *right[place + 1 :])
        with pytest.raises(TypeError):
            SMALL.minimise(*right[:-1])


class TestNoAnswer:
    def test_live_load_that_only_helps(self) -> None:
        scene = builtin_scene("single-block").with_live(Load(gravity=(0.0, 0.0, -1.0)))
        state = LimitProblem(scene).run(OWN)
        assert state.outcome.status == "unbounded"
        assert solve(scene, ladder=[OWN]).status is Status.LIVE_LOAD_HARMLESS

    def test_dead_load_that_lifts(self) -> None:
        scene = builtin_scene("tuff-wall").with_dead(Load(gravity=(0.0, 0.0, 1.0)))
        state = LimitProblem(scene).run(OWN)
        assert state.outcome.status == "infeasible"
        assert solve(scene, ladder=[OWN]).status is Status.DEAD_LOAD_UNSTABLE

    def test_bounded_load_factor(self) -> None:
        """`most` gives the load factor a cone of its own: 0.2 of the possible 0.423."""
        state = LimitProblem(builtin_scene("tuff-wall"), goal=LargestFactor(most=0.2)).run(OWN)
        assert state.load_factor == pytest.approx(0.2, rel=1e-8)


class TestRefusals:
    def test_cones_that_tie_everything_together(self) -> None:
        state = KinematicProblem(builtin_scene("s12-panel")).solve(OWN)
        assert state.outcome.status.startswith("failed: blockwise: ")
        assert "use another solver" in state.outcome.status

    @pytest.mark.parametrize(
        ("constraints", "said"),
        [
            (lambda x, y: [cp.sum(x) >= 1, y >= 0, cp.sum(x) == y[0]], "not bounded by them"),
            (lambda x, y: [x[0] >= 1, y >= 0, cp.sum(x) == 2], "no cone"),
            (lambda x, y: [cp.norm(cp.hstack([x, y])) <= 1, x[0] == y[0]], "more than 128"),
            (lambda x, y: [x[0] + x[1] >= 1, x[0] + x[1] <= 3, x[2:] >= 0, y >= x[2]], "no eq"),
            (lambda x, y: [x[0] + x[1] >= 1, x[0] + x[1] <= 3, x[2:] == y[2:], y >= 0], "no cone"),
        ],
    )
    def test_programs_without_blocks(self, constraints: Any, said: str) -> None:
        x, n = cp.Variable(100), cp.Variable(100)
        problem = cp.Problem(cp.Minimize(cp.sum(x) + cp.sum(n)), constraints(x, n))
        with pytest.raises(SolverError, match=f"(?s)blockwise.*{said}.*use another solver"):
            problem.solve(solver=Blockwise())

    def test_a_variable_that_nothing_holds(self) -> None:
        x, loose = cp.Variable(2, nonneg=True), cp.Variable()
        problem = cp.Problem(cp.Minimize(cp.sum(x) + loose), [cp.sum(x) == 1])
        with pytest.raises(SolverError, match=r"blockwise: some variables .*use another solver"):
            problem.solve(solver=Blockwise())

    def test_unknown_option(self) -> None:
        x = cp.Variable(2, nonneg=True)
        problem = cp.Problem(cp.Minimize(cp.sum(x)))
        with pytest.raises(SolverError, match="no option 'tol'; its options are tolerance"):
            problem.solve(solver=Blockwise(), tol=1e-3)
        with pytest.raises(
            SolverError, match="backend must be one of supernodal, superlu, got 'lu'"
        ):
            problem.solve(solver=Blockwise(), backend="lu")


class TestRule:
    """When it comes first."""

    def test_it_is_on_every_ladder_beside_clarabel(self) -> None:
        shapes = (Shape(variables, 6, cones=1) for variables in (7, 100_000))
        small, large = ([str(rung) for rung in limit_ladder(shape)] for shape in shapes)
        assert large[:3] == ["BLOCKWISE", "BLOCKWISE tight", "CLARABEL"]
        assert [name for name in small if name != "QOCO"][:2] == ["CLARABEL", "BLOCKWISE"]
        assert set(small) - {"QOCO"} == {"BLOCKWISE", *(str(rung) for rung in default_ladder())}

    @pytest.mark.exhaustive
    def test_a_large_wall_of_facets(self) -> None:
        scene = panel(1.6, 30, left_return=0.8, right_return=0.8)
        assert_certified(solve(scene, "octagon"), scene)

    def test_it_saves_what_clarabel_leaves_open(self) -> None:
        """1e-8 on the S12-class panel: without it Clarabel's rungs ended at 5e-8 and above."""
        solution = solve(named_scene("s12-class"), tolerance=1e-8)
        assert_certified(solution, tolerance=1e-8)
