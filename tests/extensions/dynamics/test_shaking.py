"""Motion in time: Newmark's sliding block, Housner's rocking block, an arch, a block overturned by
a sine; and what must not change the answer. Closed forms in g = 9.81 m/s2."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cvxlimit import Block, Load, PointForce, Scene, Tie, Units, pulse, read_record, shake
from cvxlimit.errors import InputError, ModelError, SolverError
from cvxlimit.extensions.dynamics.convex import convex_pieces
from cvxlimit.extensions.dynamics.mjcf import mjcf
from cvxlimit.extensions.dynamics.record import Record
from cvxlimit.extensions.dynamics.shaking import Shaking
from cvxlimit.geometry.mesh import second_moments
from cvxlimit.io import export
from cvxlimit.masonry import arch
from exhaustive import mostly_slow

mujoco = pytest.importorskip("mujoco")

G = 9.81
GROUND = Block.box("ground", (-3, -3, -1), (8, 3, 0))
PUSH = Load(acceleration=(1, 0, 0))
FLAT = Scene([GROUND, Block.box("b", (0, 0, 0), (1, 1, 0.2), 20.0)], ["ground"], PUSH, friction=0.3)
SLENDER = Scene(
    [GROUND, Block.box("b", (0, -0.5, 0), (0.4, 0.5, 1), 20.0)], ["ground"], PUSH, friction=0.7
)
RECTANGLE = pulse("rectangle", 0.8, 0.4)

WITHIN = 1e-3
"""Contacts are soft: at rest a block sinks by 1e-4 of its size, and slips by as much more or less
at both ends of a pulse."""


def slipped(push: float, holds: float, time: float = 0.4) -> float:
    """Way of a block that ``push`` - ``holds`` accelerates over a time, and friction stops; both
    are in g, the first while the pulse lasts, the second afterwards, with signs."""
    speed = (push - holds) * G * time
    return 0.5 * speed * time + 0.5 * speed**2 / (holds * G)


def every_run(shaking: Shaking) -> list[float]:
    return [float(shaking.displacement(each)[-1]) for each in shaking.histories]


def test_newmark_slides_by_the_closed_form_in_all_runs() -> None:
    shaking = shake(FLAT, RECTANGLE)
    assert shaking.ending == "stands"
    assert shaking.falls is False
    assert every_run(shaking) == pytest.approx([1.0464] * 4, rel=WITHIN)
    assert slipped(0.8, 0.3) == pytest.approx(1.0464, rel=1e-6)


def test_half_a_sine() -> None:
    """0.510704 m: the block starts where the pulse passes 0.3 g."""
    shaking = shake(FLAT, pulse("half-sine", 0.8, 0.5), control=("b", (2, 0, 0)))
    assert every_run(shaking) == pytest.approx([0.510704] * 4, rel=WITHIN)


def newmark(amplitude: float, duration: float, friction: float) -> tuple[float, float]:
    """Largest displacement and that at the end of a block that slides to and fro under one sine,
    step by step with the acceleration of each step's middle: exact to the sixth digit."""
    steps, speed, way, largest, holds = 40_000, 0.0, 0.0, 0.0, friction * G
    dt = duration / steps
    for k in range(steps):
        push = amplitude * G * np.sin(2.0 * np.pi * (k + 0.5) / steps)
        if speed == 0.0 and abs(push) <= holds:
            continue
        change = (push - np.copysign(holds, speed if speed else push)) * dt
        if speed * (speed + change) < 0.0:  # it stops
            change = -speed
        way, speed = way + (speed + 0.5 * change) * dt, speed + change
        largest = max(largest, way, key=abs)
    way += speed * abs(speed) / (2.0 * holds)
    return max(largest, way, key=abs), way


SINES = [(1.542, 0.306, 0.568, 1.69, 0.449)]
"""Amplitude in g, duration in s, friction, length and height in m of blocks that are flat enough
not to rock."""
SINES += [
    (times * mu, duration, mu, length, share * length / mu)
    for times, duration, mu, length, share in np.random.default_rng(3)
    .uniform((1.3, 0.25, 0.2, 0.6, 0.1), (4.0, 1.2, 0.7, 2.0, 0.35), (24, 5))
    .tolist()
]


@pytest.mark.parametrize("sine", mostly_slow(SINES, SINES[:5]), ids=str)
def test_newmark_to_and_fro(sine: tuple[float, ...]) -> None:
    """Peaks to 2 %: contacts are soft. The end within what is said of it, which no spread is."""
    amplitude, duration, friction, length, height = sine
    ground = Block.box("ground", (-30, -30, -1), (30, 30, 0))
    block = Block.box("b", (0, 0, 0), (length, 0.7, height), 20.0)
    scene = Scene([ground, block], ["ground"], PUSH, friction=friction)
    shaking = shake(scene, pulse("sine", amplitude, duration), control=("b", (1, 0, 0)))
    largest, end = newmark(amplitude, duration, friction)
    assert shaking.peak.value == pytest.approx(largest, rel=0.02)
    assert abs(shaking.residual.value - end) <= shaking.residual_off
    assert f"give or take {shaking.residual_off:.2g}" in shaking.headline
    if sine == SINES[0]:  # the spread of four runs is no interval
        assert end == pytest.approx(0.0114, abs=1e-4)
        assert not shaking.residual.low <= end <= shaking.residual.high


@pytest.mark.parametrize(
    "change",
    ["millimetres", "turned", "pairs", "the other way"],
)
@pytest.mark.exhaustive_cases("millimetres", "pairs")
def test_what_does_not_change_the_slip(change: str) -> None:
    scene, direction = FLAT, None
    if change == "millimetres":
        scene = FLAT.in_units(Units("mm", "N"), 1e3, 1e3)
    elif change == "turned":  # boxes become meshes
        c, s = np.cos(0.7), np.sin(0.7)
        scene = FLAT.moved(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), (1, 2, 3))
    elif change == "pairs":
        scene = FLAT.with_friction(0.7, {("b", "ground"): 0.3})
    else:
        direction = (0, 1, 0)
    unit = 1e3 if change == "millimetres" else 1.0
    ways = np.array(every_run(shake(scene, RECTANGLE, direction))) / unit
    assert ways == pytest.approx([1.0464] * 4, rel=WITHIN)


@pytest.mark.parametrize(
    ("dead", "push", "holds"),
    [
        (Load((0, 0, -1), points=[PointForce("b", (0, 0.5, 0.1), (0.4, 0, 0))]), 0.8, 0.2),
        (Load((0, 0, -1), forces={"b": (0.4, 0, 0, 0, 0, 0)}), 0.8, 0.2),
        (Load((0, 0, -1), weights={"b": (0.1, 0, 0)}), 0.8, 0.2),
        (Load((0, 0, -1), points=[PointForce("b", (0.5, 0.5, 0.2), (0, 0, -2.0))]), 0.8, 0.45),
    ],
    ids=["push at a point", "push at the centroid", "share of the weight", "load on top"],
)  # fmt: skip
def test_forces_act(dead: Load, push: float, holds: float) -> None:
    """Of a weight of 4 kN: a push of a tenth takes as much from friction; half of it on top adds
    half to friction."""
    ways = every_run(shake(replace(FLAT, dead=dead), RECTANGLE))
    assert ways == pytest.approx([slipped(push, holds)] * 4, rel=WITHIN)


def test_forces_keep_their_direction_and_move_with_the_block() -> None:
    """On a block that is turned the engine's forces are the same, and moments those of new arms."""
    at, force = np.array([1.0, 0.0, 0.2]), np.array([0.3, -0.2, 0.5])
    dead = Load((0, 0, -1), points=[PointForce("b", at, force)])
    model = mujoco.MjModel.from_xml_string(mjcf(replace(FLAT, dead=dead)))
    data = mujoco.MjData(model)
    turn = 0.8
    data.qpos[3:7] = [np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)]
    mujoco.mj_forward(model, data)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    moment = np.cross(turned @ (at - FLAT.blocks[1].centroid), force)
    assert data.qfrc_actuator[:3] == pytest.approx(1e3 * force)
    assert turned @ data.qfrc_actuator[3:] == pytest.approx(1e3 * moment)  # of a body's own axes


@pytest.mark.exhaustive
def test_housner_rocks() -> None:
    """Released at 0.3 alpha: impacts, and the ratio of rates, 1 - 1.5 sin^2 alpha, which the
    heights between impacts show: energy over the upright block goes with its square."""
    alpha = np.arctan2(0.4, 1.0)
    toe, centre, theta = np.array([0.4, 0, 0]), np.array([0.2, 0, 0.5]), 0.3 * alpha
    c, s = np.cos(theta), np.sin(theta)
    turned = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    start = {"b": (*(toe + turned @ (centre - toe) - centre), 0.0, theta, 0.0)}
    still = pulse("rectangle", 0.0, 0.1)
    shaking = shake(SLENDER, still, start=start, after=1.1, every=0.001, step=0.0005)
    impacts, ratios = [], []
    for each in shaking.histories:
        angle, t = each.displacements[:, 0, 4], each.times
        i = np.flatnonzero(angle[1:] * angle[:-1] < 0.0)[:4]
        impacts.append(t[i] + (t[i + 1] - t[i]) * angle[i] / (angle[i] - angle[i + 1]))
        tops = [np.abs(part).max() for part in np.split(angle, i + 1)[:4]]
        lifted = np.cos(alpha - np.array(tops)) - np.cos(alpha)
        ratios.append(np.sqrt(lifted[1:] / lifted[:-1]))
    exact = np.array([0.24396, 0.59504, 0.85999, 1.06432])
    # Half a per cent: a soft contact takes a time constant, 1.5 to 3 ms, for an impact.
    assert np.array(impacts) == pytest.approx(np.tile(exact, (4, 1)), rel=5e-3)
    assert 1.0 - 1.5 * np.sin(alpha) ** 2 == pytest.approx(0.7931, rel=1e-4)
    assert np.mean(ratios) == pytest.approx(0.7931, rel=1e-2)


def test_a_block_that_leans_in_its_scene_is_taken_as_it_stands() -> None:
    """No face meets the ground, which analyses at rest refuse; it falls beyond its alpha."""
    for share, ending in ((0.5, "stands"), (1.1, "falls")):
        theta = share * np.arctan2(0.4, 1.0)
        c, s = np.cos(theta), np.sin(theta)
        block = SLENDER.blocks[1].moved(np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))
        low = block.vertices[:, 2].min()
        scene = replace(SLENDER, blocks=(GROUND, block.moved(np.eye(3), (0, 0, -low))))
        assert shake(scene, pulse("rectangle", 0.0, 0.1)).ending == ending


def housner_falls(amplitude: float) -> bool:
    """If ``SLENDER`` overturns under one sine of 1 s, in g: Housner's equation of a rigid block
    that rocks about its corners without sliding, integrated from impact to impact."""
    alpha, p2 = np.arctan2(0.2, 0.5), 0.75 * G / np.hypot(0.2, 0.5)
    restitution = 1.0 - 1.5 * np.sin(alpha) ** 2
    t, speed, side = np.arcsin(np.tan(alpha) / amplitude) / (2.0 * np.pi), 0.0, 1.0
    while t < 1.0 or abs(speed) > 0.01:  # rad/s, after the sine: it only comes to rest
        start = t + 1e-6

        def rates(t: float, y: np.ndarray, side: float = side) -> list[float]:
            push = amplitude * np.sin(2.0 * np.pi * t) if t < 1.0 else 0.0
            lean = alpha - side * y[0]
            return [y[1], -p2 * (side * np.sin(lean) - push * np.cos(lean))]

        def impact(t: float, y: np.ndarray, start: float = start, side: float = side) -> float:
            return float(y[0]) if t > start else side

        impact.terminal, impact.direction = True, -side  # type: ignore[attr-defined]
        run = solve_ivp(
            rates, (t, t + 5.0), (0.0, speed), events=impact, rtol=1e-10, atol=1e-13, max_step=0.005
        )
        if np.abs(run.y[0]).max() > 1.0:  # rad
            return True
        t, speed, side = float(run.t[-1]), restitution * float(run.y[1, -1]), -side
    return False


def test_housners_equation_overturns_from_0_48016_g() -> None:
    assert [housner_falls(amplitude) for amplitude in (0.475, 0.4801, 0.4802)] == [
        False,
        False,
        True,
    ]


@pytest.mark.parametrize(
    ("amplitude", "ending"), [(0.39, "stands"), (0.475, "stands"), (0.485, "falls")]
)
def test_one_sine_overturns_from_0_48016_g(amplitude: float, ending: str) -> None:
    """Below 0.4 g it does not even rock."""
    shaking = shake(SLENDER, pulse("sine", amplitude, 1.0))
    assert shaking.ending == ending
    if amplitude < 0.4:
        assert shaking.peak.high < 1e-3
    assert shaking.peak.low <= shaking.peak.value <= shaking.peak.high


def test_runs_that_differ_are_told() -> None:
    """A record at the limit: what the runs have in common is not made up."""
    falls, stands = (shake(SLENDER, pulse("sine", a, 1.0)) for a in (0.485, 0.475))
    mixed = replace(stands, histories=(*falls.histories[:1], *stands.histories[1:]))
    assert mixed.ending is None
    assert mixed.falls is None
    assert "falls in 1, stands in 3" in mixed.headline


@pytest.mark.exhaustive
@pytest.mark.parametrize(("time", "ending"), [(0.2205, "stands"), (0.2295, "falls")])
def test_seven_voussoirs_fall_under_a_pulse_of_0_225_s(time: float, ending: str) -> None:
    scene = arch(7, 0.15, mean_radius=10.0, embrace=157.5, width=1.0, live=PUSH)
    assert shake(scene, pulse("rectangle", 1.0, time)).ending == ending


def test_a_block_with_a_notch_is_cut_and_slides_alike() -> None:
    """Another block stands in the notch, which a hull would fill."""
    profile = [(0, 0), (3, 0), (3, 0.2), (0.2, 0.2), (0.2, 0.4), (3, 0.4), (3, 0.6), (0, 0.6)]
    points = [(x, y, z) for y in (0, 1) for x, z in profile]
    n = len(profile)
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    notched = Block.polyhedron("n", points, [range(n), range(n, 2 * n), *sides], 20.0)
    pieces = [Block.hull("p", corners) for corners in convex_pieces(notched)]
    assert sum(piece.volume for piece in pieces) == pytest.approx(notched.volume, rel=1e-9)
    inner = Block.box("inner", (1, 0.2, 0.2), (2, 0.8, 0.39), 20.0)
    scene = Scene(
        [GROUND, notched, inner], ["ground"], PUSH, friction=0.3,
        contact_friction={("inner", "n"): 0.7},
    )  # fmt: skip
    shaking = shake(scene, RECTANGLE, control=("n", (1, 0, 0)))
    assert shaking.ending == "stands"
    # Two bodies with a soft joint between them, which slips as well.
    assert every_run(shaking) == pytest.approx([1.0464] * 4, rel=2 * WITHIN)
    assert [x.displacements[-1, 1, 2] for x in shaking.histories] == pytest.approx(
        [0.0] * 4, abs=WITHIN
    )  # of the inner one, which neither sinks nor is thrown out


def test_masses_and_inertias_are_those_of_the_blocks() -> None:
    model = mujoco.MjModel.from_xml_string(mjcf(arch(5)))
    scene = arch(5)
    for row, block in zip(scene.free + 1, (scene.blocks[i] for i in scene.free), strict=True):
        moments = second_moments(block.vertices - block.centroid, block.faces) / block.volume
        mass = 1e3 * block.weight / G
        exact = mass * np.sort(np.linalg.eigvalsh(np.trace(moments) * np.eye(3) - moments))
        assert model.body_mass[row] == pytest.approx(mass)
        assert np.sort(model.body_inertia[row]) == pytest.approx(exact)


def test_the_export_is_what_runs(tmp_path: Path) -> None:
    (file,) = export(FLAT, tmp_path / "flat.mjcf")
    assert mujoco.MjModel.from_xml_string(file.read_text("utf-8")).nbody == 3  # and the world


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        (FLAT.with_cohesion(2.0), "cohesion 2"),
        (FLAT.with_strength(compressive=5.0), "compressive strength 5"),
        (replace(FLAT, units=Units("ell", "kN")), "'ell'"),
        (replace(FLAT, ties=[Tie("b", "ground", (0.5, 0.5, 0), (0, 0, 1), 1.0)]), "ties"),
    ],
)
def test_what_the_engine_has_not_is_refused(scene: Scene, said: str) -> None:
    with pytest.raises(ModelError, match=said):
        shake(scene, RECTANGLE)


def test_blocks_that_start_in_each_other_are_refused() -> None:
    with pytest.raises(InputError, match=r"'(b|ground)' and '(b|ground)' start 0\.\d+ m deep"):
        shake(FLAT, RECTANGLE, start={"b": (0, 0, -0.1, 0, 0, 0)})
    with pytest.raises(InputError, match="start names 'c'"):
        shake(FLAT, RECTANGLE, start={"c": (0, 0, 0, 0, 0, 0)})


def test_a_load_without_direction_asks_for_one() -> None:
    with pytest.raises(ModelError, match="direction"):
        shake(FLAT.with_live(Load(forces={"b": (1, 0, 0, 0, 0, 0)})), RECTANGLE)


def test_a_record_of_the_same_pulse_slides_as_far(tmp_path: Path) -> None:
    file = tmp_path / "record.csv"
    file.write_text("t (s);a (gal)\n0;784.8\n0.4;784.8\n")
    shaking = shake(FLAT, read_record(file, "gal"))
    assert every_run(shaking) == pytest.approx([1.0464] * 4, rel=WITHIN)
    assert isinstance(shaking.record, Record)


def test_what_the_engine_warns_of_is_no_business_of_the_screen(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It warns of numbers that are none, on stderr and in a file where it runs, if it is let."""
    monkeypatch.chdir(tmp_path)
    thrown = pulse("sine", 1e12, 0.3)
    with pytest.raises(SolverError, match="diverged"):
        shake(arch(11), thrown, (1, 0, 0), step=0.02, after=1.0)
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
