"""The ladder of solvers, and scenes without an answer: each proof is computed anew, by hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cvxpy.reductions.solution import Solution as Answer
from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import CLARABEL
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cvxlimit import Block, Load, Scene, Solution, Status, Units, builtin_scene, solve
from cvxlimit.errors import ModelError
from cvxlimit.masonry import arch, running_bond, single_block, stack, wall
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import LimitProgram
from cvxlimit.solution import Iterate
from cvxlimit.solvers import (
    SOLVERS,
    Blockwise,
    Shape,
    SolverSettings,
    blockwise,
    default_ladder,
    installed,
    ladder_of,
    limit_ladder,
    settings_for,
)
from falling import FALLING, GOOD, STOPPED, UNKNOWN, assert_falls, incline
from helpers import (
    COMPILED,
    assert_certified,
    dead_load_stands,
    hand_equilibrium,
    linear_load_factor,
    partly_pressed,
    scenes,
    side_by_side,
    yield_excess,
)

WRONG_OPTION = SolverSettings("CLARABEL", {"no_such_option": 1}, "wrong option")
UNFIT = SolverSettings("HIGHS", label="no cones")
TRUE = 0.423056  # tuff wall, conic, published.json


def climbed(solution: Solution) -> list[Iterate]:
    """The history without the questions asked aside, whose solver is called "..., what"."""
    return [h for h in solution.history if ", " not in h.solver]


def assert_bounds_hold(solution: Solution, true: float) -> None:
    assert solution.lower <= true * (1.0 + 2e-6)  # six published digits
    assert solution.upper >= true * (1.0 - 2e-6)


class TestLadder:
    @pytest.mark.parametrize("bad", [STOPPED, UNKNOWN, WRONG_OPTION], ids=str)
    def test_a_bad_rung_is_recorded_and_the_next_one_closes(self, bad: SolverSettings) -> None:
        scene = builtin_scene("tuff-wall")
        told: list[str] = []
        solution = solve(scene, ladder=[bad, GOOD], progress=told.append)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(TRUE, rel=1e-5)
        assert [h.solver for h in climbed(solution)][-2:] == [str(bad), "CLARABEL"]
        assert f"solving with {bad}" in told
        first = climbed(solution)[0]
        assert first.status.startswith("failed") or first.status == "user_limit"
        assert first.lower is None or first.lower <= TRUE * (1.0 + 2e-6)
        assert first.upper is None or first.upper >= TRUE * (1.0 - 2e-6)

    @pytest.mark.parametrize("ladder", ["HIGHS", ["HIGHS"], [UNFIT, "SCIPY"]], ids=str)
    @pytest.mark.parametrize("method", ["convex", "fixed-point", "certified", "zero-dilatancy"])
    def test_a_ladder_without_a_solver_for_the_problem_is_refused(
        self, method: str, ladder: object
    ) -> None:
        """Who lacks what, and who has it, in one sentence; no bracket [?, ?], no "diverged"."""
        scene = builtin_scene("tuff-wall")
        said = "HIGHS takes no second-order cones, which this problem has; .*CLARABEL.* take them"
        with pytest.raises(ModelError, match=said):
            solve(scene, method=method, ladder=ladder)  # type: ignore[arg-type]

    def test_planar_scenes_have_no_cones(self) -> None:
        assert_certified(solve(builtin_scene("arch"), ladder=["HIGHS"]))

    @pytest.mark.exhaustive
    def test_a_linear_solver_is_for_facets_only(self) -> None:
        """HiGHS cannot take cones: said so there, an answer in its own right on the octagon."""
        scene = builtin_scene("tuff-wall")
        assert_certified(conic := solve(scene, ladder=[UNFIT, GOOD]), scene)
        refused = next(h for h in climbed(conic) if h.solver == "no cones")
        assert refused.status.startswith("failed: HIGHS takes no second-order cones")
        octagon = solve(scene, "octagon", ladder=[UNFIT])
        assert [h.solver for h in climbed(octagon)][:1] == ["no cones"]
        assert_bounds_hold(octagon, 0.450034)
        assert octagon.load_factor == pytest.approx(0.450034, rel=1e-4)

    def test_the_first_good_rung_is_the_last(self) -> None:
        solution = solve(builtin_scene("tuff-wall"), ladder=[GOOD, UNKNOWN])
        assert_certified(solution)
        assert [h.solver for h in climbed(solution)] == ["CLARABEL"]

    def test_only_bad_rungs(self) -> None:
        solution = solve(builtin_scene("tuff-wall"), ladder=[STOPPED, UNKNOWN, WRONG_OPTION])
        assert solution.status is Status.NOT_CERTIFIED
        assert not solution.status.is_good
        assert solution.status.has_answer
        assert_bounds_hold(solution, TRUE)
        assert solution.gap > 1e-5
        assert {"stopped", "unknown", "wrong option"} <= {h.solver for h in solution.history}

    def test_rungs_that_do_not_even_return(self) -> None:
        solution = solve(builtin_scene("tuff-wall"), ladder=[UNKNOWN, UNFIT])
        assert solution.status is Status.SOLVER_FAILED
        assert (solution.lower, solution.upper) == (-np.inf, np.inf)
        assert solution.load_factor is None
        assert solution.forces is None
        assert solution.mechanism is None

    @pytest.mark.parametrize("iterations", [3, 5, 7, 9, 11])
    def test_stopped_early(self, iterations: int) -> None:
        """Bounds hold and, rung by rung, are taken from whoever gave the better one."""
        rungs = [
            SolverSettings("CLARABEL", {"max_iter": k}, f"{k}")
            for k in (iterations, iterations + 1)
        ]
        solution = solve(builtin_scene("ferris-tin-loi-3"), ladder=rungs)
        assert_bounds_hold(solution, 0.403694)
        lowers = [h.lower for h in climbed(solution) if h.lower is not None]
        uppers = [h.upper for h in climbed(solution) if h.upper is not None]
        if lowers:
            assert solution.lower == max(lowers)
        if uppers:
            assert solution.upper == min(uppers)
        assert (solution.status is Status.CERTIFIED) == (solution.gap <= 1e-5)

    def test_loose_solver_is_believed_for_what_it_proves(self) -> None:
        loose = SolverSettings("SCS", {"eps_abs": 1e-3, "eps_rel": 1e-3}, "SCS loose")
        solution = solve(builtin_scene("tuff-wall"), ladder=[loose])
        assert_bounds_hold(solution, TRUE)
        assert solution.status is Status.NOT_CERTIFIED
        wide = solve(builtin_scene("tuff-wall"), ladder=[loose, GOOD], tolerance=0.5)
        assert wide.status is Status.CERTIFIED
        assert_bounds_hold(wide, TRUE)

    @pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-5])
    def test_tolerance(self, tolerance: float) -> None:
        solution = solve(builtin_scene("tuff-wall"), tolerance=tolerance)
        assert_certified(solution, tolerance=tolerance)

    @pytest.mark.parametrize("tolerance", [0.0, 1.0, -1.0, float("nan")])
    def test_nonsense_tolerance(self, tolerance: float) -> None:
        with pytest.raises(ModelError, match="tolerance must be between 0 and 1"):
            solve(builtin_scene("single-block"), tolerance=tolerance)

    def test_unreachable_tolerance_is_said_to_be_so(self) -> None:
        solution = solve(builtin_scene("tuff-wall"), tolerance=1e-15, ladder=[GOOD])
        assert solution.status is Status.NOT_CERTIFIED
        assert_bounds_hold(solution, TRUE)

    @pytest.mark.parametrize("turn", [0.0, 0.6, 0.9])
    def test_forces_of_the_first_rung_are_in_equilibrium(self, turn: float) -> None:
        """Of a turned dome, whose thin corners make 100 times as much of the bracket as it lacks:
        1e-8 of the loads. QOCO by its own settings lacks 2e-7 to 2e-6 at 0.6 or 0.9, on three
        kinds of processors."""
        rotation = Rotation.from_rotvec([0.0, 0.0, turn]).as_matrix()
        assemblage = Assemblage.of(builtin_scene("dome").moved(rotation))
        statics = assemblage.statics
        problem = LimitProgram(assemblage)
        state = problem.run(problem.ladder()[0])
        assert state.forces is not None
        assert state.load_factor is not None
        lacking = statics.residual(state.forces, state.load_factor)
        assert np.abs(lacking).max() < 1e-8 * np.abs(statics.dead).max()

    def test_default_order(self) -> None:
        ladder = default_ladder()
        first = ["CLARABEL", "RESCALED", *("RESCALED" for _ in blockwise())]
        assert [rung.name for rung in ladder[: len(first)]] == first
        assert len({str(rung) for rung in ladder}) == len(ladder)
        assert {rung.name for rung in ladder} <= set(SOLVERS)

    @pytest.mark.exhaustive_cases("CVXOPT")
    @pytest.mark.parametrize("name", sorted(installed() - {"OSQP", "GLPK_MI", "UNO"}))
    def test_any_installed_solver_by_its_name(self, name: str) -> None:
        """OSQP and UNO are for other problems, GLPK_MI the same as GLPK; CVXOPT's best bracket is
        wider than the default tolerance, and is called so."""
        solution = solve(builtin_scene("ferris-tin-loi-1"), "octagon", ladder=name)
        assert {iterate.solver.split(",")[0] for iterate in solution.history} == {name}
        assert_bounds_hold(solution, 0.642859)
        assert (solution.status is Status.CERTIFIED) == (name != "CVXOPT")

    def test_a_ladder_of_names_and_settings(self) -> None:
        loose = settings_for("CLARABEL", 1e-2, "loose")
        solution = solve(builtin_scene("tuff-wall"), ladder=[loose, "CLARABEL"])
        assert [iterate.solver for iterate in solution.history][-1] == "CLARABEL"
        assert_certified(solution)

    @pytest.mark.parametrize(
        ("ladder", "message"),
        [
            ("CLARABELL", "there is no solver 'CLARABELL'; did you mean CLARABEL"),
            (["MOSEC"], "there is no solver 'MOSEC'; did you mean MOSEK"),
            (["simplex"], "there is no solver 'SIMPLEX'; installed are (BLOCKWISE, )?CLARABEL"),
            (["MOSEK"], "MOSEK is not installed; it comes with a package of its own"),
            ([], "ladder must be a list of solvers"),
            ([3], "a solver's name or SolverSettings, got 3"),
        ],
    )
    def test_ladders_that_cannot_be_meant(self, ladder: object, message: str) -> None:
        with pytest.raises(ModelError, match=message):
            ladder_of(ladder)  # type: ignore[arg-type]

    @COMPILED
    def test_a_solver_of_ones_own(self) -> None:
        """A class that CVXPY could take as a solver may stand on the ladder as it is."""

        class Mine(Blockwise):
            def name(self) -> str:
                return "MINE"

        solution = solve(builtin_scene("tuff-wall"), ladder=[Mine])
        assert_certified(solution)
        assert "MINE" in [iterate.solver for iterate in solution.history]

    @pytest.mark.parametrize("rung", default_ladder(is_conic=False), ids=str)
    def test_every_rung_is_honest_on_its_own(self, rung: SolverSettings) -> None:
        scene = builtin_scene("ferris-tin-loi-1")
        solution = solve(scene, "octagon", ladder=[rung], model="least")
        assert not solution.history[-1].status.startswith("failed"), solution.history
        assert_bounds_hold(solution, 0.642859)
        # A looser solver may leave a wider bracket, never a wrong one.
        assert solution.load_factor == pytest.approx(0.642859, rel=1e-3)


def assert_harmless(
    solution: Solution, scene: Scene, status: Status = Status.LIVE_LOAD_HARMLESS
) -> None:
    """Forces in equilibrium with the live load alone, inside all surfaces: any multiple is."""
    assert solution.status is status, solution
    assert (solution.load_factor, solution.upper) == (None, np.inf)
    assert solution.forces is not None
    matrix, _, live = hand_equilibrium(scene)
    carried = matrix @ solution.forces.ravel()
    factor = -(carried @ live) / (live @ live)
    assert factor > 0.4  # of the live load
    unit = np.abs(live).sum()
    assert np.abs(carried + factor * live).max() <= 1e-7 * unit
    assert yield_excess(scene, solution.forces).max() <= 1e-7 * unit


class TestDeadLoadCannotStand:
    @pytest.mark.parametrize("surface", ["conic", "octagon"])
    @pytest.mark.parametrize("name", FALLING)
    def test_proof(self, name: str, surface: str) -> None:
        scene = FALLING[name]()
        assert_falls(solve(scene, surface), scene)

    @pytest.mark.parametrize("name", FALLING)
    @pytest.mark.parametrize("force", [1e-6, 1e6])
    def test_in_other_units(self, name: str, force: float) -> None:
        scene = FALLING[name]().in_units(Units("a", "b"), 1e3, force)
        solution = solve(scene)
        assert solution.status is Status.DEAD_LOAD_UNSTABLE

    @pytest.mark.parametrize("slope", [30.0, 30.9])
    def test_just_not_steep_enough(self, slope: float) -> None:
        """Across the slope: alpha^2 cos^2... = the rest of the friction circle, in closed form."""
        scene = incline(slope, 0.6)
        t = np.radians(slope)
        expected = np.sqrt((0.6 * np.cos(t)) ** 2 - np.sin(t) ** 2)
        solution = solve(scene)
        assert_certified(solution, scene, proved=False)
        assert solution.load_factor == pytest.approx(expected, rel=1e-5)

    def test_names_a_block_that_falls(self) -> None:
        assert "block 'b2' falls" in solve(FALLING["overhang"]()).note


def between_supports() -> Scene:
    blocks = (
        Block.box("left", (-1, 0, 0), (0, 1, 1)),
        Block.box("b", (0, 0, 0), (1, 1, 1), 20.0),
        Block.box("right", (1, 0, 0), (2, 1, 1)),
        Block.box("ground", (-1, 0, -1), (2, 1, 0)),
    )
    return Scene(blocks, ("left", "right", "ground"), Load(acceleration=(1, 0, 0)), friction=0.5)


HARMLESS: dict[str, Callable[[], Scene]] = {
    "pressed down": lambda: single_block(live=Load(acceleration=(0, 0, -1))),
    "within the friction cone": lambda: single_block(
        (1, 1, 0.2), friction=0.5, live=Load(acceleration=(0.49, 0, -1))
    ),
    "against a wall": between_supports,
    "wedged": lambda: (
        between_supports().with_live(Load(acceleration=(0, 0.3, 0.2))).with_friction(1.2)
    ),
    "wall pressed down": lambda: wall(
        running_bond(3, 4), friction=0.65, live=Load(acceleration=(0.05, 0.0, -1.0))
    ),
    "thick arch": lambda: arch(10, 0.4, live=Load(acceleration=(0, 0, -1.0))),
    "one of two boxes": side_by_side,
    "dead load only helps": lambda: (
        single_block().with_dead(Load()).with_live(Load(acceleration=(0, 0, -1)))
    ),
}


WITH_DILATANCY = ("wedged", "wall pressed down")
"""Those of which nothing is proved without it."""


class TestLiveLoadHarmless:
    @pytest.mark.parametrize("surface", ["conic", "octagon"])
    @pytest.mark.parametrize("name", HARMLESS)
    @pytest.mark.exhaustive_cases(
        "wall pressed down-octagon", "wall pressed down-conic", "wedged-octagon", "wedged-conic"
    )
    def test_proof(self, name: str, surface: str) -> None:
        scene = HARMLESS[name]()
        is_known = name not in WITH_DILATANCY
        status = Status.LIVE_LOAD_HARMLESS if is_known else Status.UNBOUNDED
        assert_harmless(solve(scene, surface), scene, status)

    @pytest.mark.parametrize("seed", range(12))
    def test_blocks_without_load_are_not_judged_by_noise(self, seed: int) -> None:
        """Where the live load alone does not reach, nothing but rounding holds or fails."""
        scene = partly_pressed(seed)
        assert linear_load_factor(scene).status == 3
        assert_harmless(solve(scene), scene)

    @pytest.mark.parametrize("push", [1e-6, 1e-9])
    def test_a_push_that_noise_could_hide_is_not_harmless(self, push: float) -> None:
        """One box is pressed down, the other one slides at 0.6 times its weight of 20."""
        forces = {"b0": (0, 0, -1, 0, 0, 0), "b1": (push, 0, 0, 0, 0, 0)}
        solution = solve(side_by_side().with_live(Load(forces=forces)))
        assert solution.status is not Status.LIVE_LOAD_HARMLESS
        assert solution.lower <= 0.6 * 20.0 / push * (1.0 + 1e-9)
        assert solution.upper >= 0.6 * 20.0 / push * (1.0 - 1e-9)

    def test_just_outside_the_friction_cone(self) -> None:
        """alpha = mu / (t - mu) when pushed at slope t > mu: large, and finite."""
        live = Load(acceleration=(0.51, 0, -1))
        scene = single_block((1, 1, 0.2), friction=0.5, live=live)
        solution = solve(scene)
        assert_certified(solution, scene)
        assert solution.load_factor == pytest.approx(0.5 / 0.01, rel=1e-5)

    @pytest.mark.parametrize("size", [1e-9, 1e9])
    def test_whatever_its_size(self, size: float) -> None:
        scene = single_block(live=Load(acceleration=(0, 0, -size)))
        assert_harmless(solve(scene), scene)


def on_the_edge() -> Scene:
    """The centroid exactly above the rim of its support: any push outwards tips it."""
    blocks = (
        Block.box("ground", (-1, 0, -1), (0.5, 1, 0)),
        Block.box("b", (0, 0, 0), (1, 1, 0.5), 20.0),
    )
    return Scene(blocks, ("ground",), Load(acceleration=(1, 0, 0)), friction=0.5)


ZERO: dict[str, Callable[[], Scene]] = {
    "on the edge": on_the_edge,
    "no friction": lambda: single_block(friction=0.0),
    "stack without friction": lambda: stack(4, friction=0.0),
    "one icy joint": lambda: stack(3).with_friction(0.6, {("b1", "b2"): 0.0}),
    "no dead load": lambda: single_block().with_dead(Load()),
    "no dead load on a wall": lambda: builtin_scene("tuff-wall").with_dead(Load()),
    "at the friction angle": lambda: single_block((1, 1, 0.2), friction=0.5).with_dead(
        Load(acceleration=(0.5, 0, -1))
    ),
}


class TestLoadFactorZero:
    """1e-6 of dead over live load: where a factor counts as zero to six digits."""

    @pytest.mark.parametrize("name", ZERO)
    def test_is_a_number_not_a_failure(self, name: str) -> None:
        scene = ZERO[name]()
        solution = solve(scene)
        assert solution.status in (Status.CERTIFIED, Status.NOT_CERTIFIED), solution
        assert solution.load_factor == pytest.approx(0.0, abs=1e-6)
        assert solution.lower <= 1e-9
        assert solution.upper >= -1e-9
        assert solution.upper - solution.lower <= 1e-6

    @pytest.mark.parametrize("name", ["no friction", "no dead load"])
    @pytest.mark.parametrize("force", [1e-3, 1e3, 1e9])
    def test_in_any_unit_of_force(self, name: str, force: float) -> None:
        solution = solve(ZERO[name]().in_units(Units("m", "x"), 1.0, force))
        assert solution.load_factor == pytest.approx(0.0, abs=1e-6)
        assert solution.upper >= -1e-9


class TestExtremeLoads:
    @pytest.mark.parametrize("size", [1e-12, 1e-6, 1e6, 1e12])
    def test_live_load_of_any_size(self, size: float) -> None:
        scene = single_block(live=Load(acceleration=(size, 0, 0)))
        solution = solve(scene)
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(0.4 / size, rel=1e-6)

    @pytest.mark.parametrize("density", [1e-9, 1e9])
    def test_dead_load_of_any_size(self, density: float) -> None:
        solution = solve(single_block(density=density))
        assert_certified(solution)
        assert solution.load_factor == pytest.approx(0.4, rel=1e-6)

    @pytest.mark.parametrize("friction", [1e-6, 1e-3, 1e3])
    def test_friction_of_any_size(self, friction: float) -> None:
        scene = single_block((0.4, 0.4, 1.0), friction=friction)
        solution = solve(scene)
        assert_certified(solution, proved=False)
        assert solution.load_factor == pytest.approx(min(friction, 0.4), rel=1e-5)


RANDOM = given(
    scene=scenes(),
    mu=st.sampled_from([0.05, 0.2, 0.6, 1.1]),
    tilt=st.floats(0.0, 0.7),
    towards=st.floats(0.0, 6.28),
    units=st.sampled_from([(1.0, 1.0), (1e3, 1e3), (1.0, 1e-6), (1e-3, 1e6)]),
)


@RANDOM
@example(
    scene=single_block(live=Load(acceleration=(0, 0, -1))),
    mu=0.6,
    tilt=0.0,
    towards=0.0,
    units=(1.0, 1.0),
)
@settings(max_examples=3, deadline=None)
def test_every_end_is_proved_and_right(**drawn: Any) -> None:
    assert_right(**drawn)


@pytest.mark.exhaustive
@RANDOM
@settings(max_examples=60, deadline=None)
def test_every_end_is_proved_and_right_on_random_scenes(**drawn: Any) -> None:
    assert_right(**drawn)


def assert_right(
    scene: Scene, mu: float, tilt: float, towards: float, units: tuple[float, float]
) -> None:
    """Leaning gravity, any friction, any units: standing, falling, held or harmless, each with its
    proof, and each as linprog on matrices of our own has it.
    """
    down = (np.sin(tilt) * np.cos(towards), np.sin(tilt) * np.sin(towards), -np.cos(tilt))
    scene = scene.with_friction(mu).with_dead(Load(acceleration=down))
    answer, stands = linear_load_factor(scene), dead_load_stands(scene)
    if scene.contacts.is_rectangle.all():
        # Facets lean on the longest edge: of a regular polygon's equal ones, rounding picks it.
        scene = scene.in_units(Units("a", "b"), *units)
    solution = solve(scene, "octagon")
    if not stands and solution.interval is not None:  # some of the live load holds it
        assert solution.interval[0] > 0.0
        assert solution.load_factor == pytest.approx(answer.load_factor, rel=1e-5, abs=1e-7)
    elif not stands:
        assert solution.status is Status.DEAD_LOAD_UNSTABLE
        # The octagon lies around the cone: what falls with it falls with the cone.
        assert_falls(solve(scene), scene)
    elif answer.status == 3:
        assert solution.status is Status.LIVE_LOAD_HARMLESS
    else:
        assert_certified(solution, proved=False)
        assert solution.load_factor == pytest.approx(answer.load_factor, rel=1e-5, abs=1e-7)


class Dualless(CLARABEL):
    """Forces without duals, as CVXPY gets them of cones from some solvers."""

    def name(self) -> str:
        return "DUALLESS"

    def invert(self, solution: Any, inverse_data: Any) -> Answer:
        found = super().invert(solution, inverse_data)
        return Answer(found.status, found.opt_val, found.primal_vars, None, found.attr)


def test_without_duals_there_is_a_lower_bound_and_a_word_why_no_upper_one() -> None:
    """A block 0.4 wide and 1 high on friction of 0.3 slides."""
    scene = single_block(friction=0.3)
    solution = solve(scene, solver=Dualless)
    assert solution.status is Status.NOT_CERTIFIED
    assert solution.lower == pytest.approx(0.3, rel=1e-6)
    assert solution.upper == np.inf
    assert "DUALLESS returned forces without duals" in solution.note
    assert not solve(scene, solver=Dualless, method="certified").status.is_good


class TestOneSolver:
    @pytest.mark.parametrize("solver", ["clarabel", SolverSettings("CLARABEL"), CLARABEL])
    def test_it_alone_is_tried(self, solver: Any) -> None:
        solution = solve(builtin_scene("tuff-wall"), solver=solver)
        assert solution.status is Status.CERTIFIED
        assert {iterate.solver for iterate in solution.history} == {"CLARABEL"}

    def test_its_own_log_is_handed_through(self, capfd: pytest.CaptureFixture[str]) -> None:
        scene = builtin_scene("arch")
        solve(scene, solver="CLARABEL")
        assert "iter" not in capfd.readouterr().out
        solve(scene, solver="CLARABEL", verbose=True)
        assert "iter" in capfd.readouterr().out

    @pytest.mark.parametrize(
        ("options", "said"),
        [
            ({"solver": "CLARABLE"}, "no solver 'CLARABLE'; did you mean CLARABEL"),
            ({"solver": "CLARABEL", "ladder": ["CLARABEL"]}, "solver and ladder .* leave one out"),
            ({"solver": ["CLARABEL", "SCS"]}, r"one solver, got .*: write ladder=\['CLARABEL', 'S"),
            ({"solver": 5}, "solver must be a name, got 5: write solver='CLARABEL'"),
            ({"solver": int}, "an entry of the ladder must be"),
            ({"solver": "HIGHS"}, "no solver asked for can solve this: HIGHS takes no second-"),
        ],
    )
    def test_refusals(self, options: dict[str, Any], said: str) -> None:
        with pytest.raises(ModelError, match=said):
            solve(builtin_scene("tuff-wall"), **options)


@pytest.mark.parametrize(("has_qoco", "first"), [(True, "QOCO"), (False, "CLARABEL")])
def test_where_nothing_is_compiled_the_best_installed_solver_leads(
    has_qoco: bool, first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the 888 contacts of S12, whose numbers these are, and on 16,000."""
    here = frozenset({"CLARABEL", *(["QOCO"] if has_qoco else [])})
    monkeypatch.setattr("cvxlimit.solvers.ladders.SOLVERS", {n: SOLVERS[n] for n in here})
    monkeypatch.setattr("cvxlimit.solvers.ladders.installed", lambda: here)
    for shape in (Shape(7105, 1884, 888, 5328), Shape(128_000, 40_000, 16_000, 96_000)):
        names = [rung.name for rung in limit_ladder(shape)]
        assert names[0] == first
        assert "BLOCKWISE" not in names
