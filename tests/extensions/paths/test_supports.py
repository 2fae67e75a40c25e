"""Supports that move under the dead load: reactions by hand, and how far they may move."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise, product

import numpy as np
import pytest
from scipy.optimize import linprog

from cvxlimit import Block, Load, Scene, SupportMotion, fitted_motion, prove, pushover, settlement
from cvxlimit.cli import main as cli
from cvxlimit.errors import InputError, NoAnswerError
from cvxlimit.io import read_path, write_scene
from cvxlimit.masonry import arch, barrel_vault, dome
from cvxlimit.scene.loads import PointForce
from displaced import imbalance

OUT = SupportMotion("right-abutment", (1, 0, 0))


def spread(count: int, ratio: float, friction: float = 0.9, **options: float) -> Scene:
    return arch(count, ratio, mean_radius=10.0, width=1.0, friction=friction, **options)  # type: ignore[arg-type]


class ThreeHinges:
    """An arch of R = 10 whose right springing moves by ``direction`` and turns by ``turn`` about
    ``about`` (x, z), each for w = 1, as bars between three hinges: thrust lines of the displaced
    arch by hand."""

    def __init__(
        self, count: int, ratio: float, embrace: float = 180.0, direction=(0.0, 0.0),
        turn: float = 0.0, about=(0.0, 0.0),
    ) -> None:  # fmt: skip
        angle = np.radians(90.0 + embrace / 2.0 - embrace * np.arange(count + 1) / count)
        out = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        self.sides = 10.0 * np.stack([(1.0 - ratio / 2.0) * out, (1.0 + ratio / 2.0) * out])
        quads = [np.concatenate([self.sides[:, i], self.sides[::-1, i + 1]]) for i in range(count)]
        areas, middles = zip(*map(area_and_middle, quads), strict=True)
        self.weight, self.middle = 20.0 * np.array(areas), np.array(middles)
        self.count, self.about = count, np.array(about)
        self.direction, self.turn = np.array(direction), -turn  # about y: clockwise in (x, z)
        which = combinations(range(count + 1), 3)
        self.hinges = [(j, k) for j in which for k in product((0, 1), repeat=3)]

    def reactions(self, w: float) -> dict:
        """Returns all at which a thrust line lies in all joints, of which three are hinged and
        open, by these joints and their sides."""
        found = {hinges: self.of(w, *hinges) for hinges in self.hinges}
        return {hinges: each for hinges, each in found.items() if each is not None}

    def of(self, w: float, joints, kinds) -> float | None:
        about = self.about + w * self.direction
        a, b, c = (self.sides[k, j] for k, j in zip(kinds, joints, strict=True))
        end = about + turned(self.turn * w, c - self.about)
        # The middle hinge is where both bars meet, on the same side as at first.
        one, two, chord = np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(end - a)
        along = (one**2 - two**2 + chord**2) / (2.0 * chord)
        if not abs(along) < one:
            return None
        u = (end - a) / chord
        up = np.sign(cross(c - a, b - a)) * np.sqrt(one**2 - along**2)
        crown = a + along * u + up * np.array([-u[1], u[0]])
        turns = [angle_of(crown - a) - angle_of(b - a), angle_of(end - crown) - angle_of(c - b)]
        turns = [(x + np.pi) % (2.0 * np.pi) - np.pi for x in turns]
        each = np.array([0.0, *turns, self.turn * w])
        opens = np.diff(each) * np.where(np.array(kinds) == 0, -1.0, 1.0)
        if not (opens >= 0.0).all():
            return None
        # Where all points are: on the left part, both bars, or the right part.
        at = [(np.zeros(2), np.zeros(2)), (a, a), (b, crown), (self.about, about)]
        part = np.searchsorted(joints, np.arange(self.count), side="right")

        def placed(x, parts):
            return np.array([at[i][1] + turned(each[i], y - at[i][0])
                             for y, i in zip(x, parts, strict=True)])  # fmt: skip

        middle = placed(self.middle, part)
        # The force on the left bar at the crown: moments of each bar about its other hinge.
        loads = np.stack([np.zeros(self.count), -self.weight], axis=1)
        about_a, about_c = crown - a, crown - end
        left = sum(cross(middle[i] - a, loads[i]) for i in range(joints[0], joints[1]))
        right = sum(cross(middle[i] - end, loads[i]) for i in range(joints[1], joints[2]))
        rows = np.array([[-about_a[1], about_a[0]], [about_c[1], -about_c[0]]])
        force = np.linalg.solve(rows, [-left, -right])
        # Thrusts lie in all joints, seen from the part on their left.
        for j in range(self.count + 1):
            own = part[j] if j < self.count else 3
            some = range(j, joints[1]) if j <= joints[1] else range(joints[1], j)
            sign = 1.0 if j <= joints[1] else -1.0
            for k in (0, 1):
                p = placed([self.sides[k, j]], [own])[0]
                moment = cross(crown - p, force)
                moment += sign * sum(cross(middle[i] - p, loads[i]) for i in some)
                if (moment if k == 0 else -moment) < -1e-9 * self.weight.sum():
                    return None
        # What pushes the right part on: the thrust at its hinge, and its weight.
        thrust = -force + loads[joints[1] : joints[2]].sum(axis=0)

        def power(f, x):
            arm = x - about
            return float(f @ (self.direction + self.turn * np.array([-arm[1], arm[0]])))

        rest = range(joints[2], self.count)
        return power(thrust, end) + sum(power(loads[i], middle[i]) for i in rest)


def cross(u, v) -> float:
    return float(u[0] * v[1] - u[1] * v[0])


def turned(angle: float, x):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * x[0] - s * x[1], s * x[0] + c * x[1]])


def angle_of(x) -> float:
    return float(np.arctan2(x[1], x[0]))


def area_and_middle(quad) -> tuple[float, np.ndarray]:
    after = np.roll(quad, -1, axis=0)
    own = quad[:, 0] * after[:, 1] - quad[:, 1] * after[:, 0]
    return 0.5 * abs(own.sum()), ((quad + after) * own[:, None]).sum(axis=0) / (3.0 * own.sum())


@pytest.mark.exhaustive
def test_an_arch_of_twelve_spreads_to_its_closed_form(tmp_path) -> None:
    scene = spread(12, 0.15)
    path = pushover(scene, motion=OUT)
    hand = ThreeHinges(12, 0.15, direction=(1.0, 0.0))
    exact = [hand.of(max(w, 1e-9), (2, 6, 10), (0, 1, 0)) for w in path.w]
    # A hair from the end hinges compete, and solvers leave more: 1.2e-5 kN with nothing compiled.
    is_last = path.w > 0.999 * path.w[-1]
    exact = np.array(exact)
    assert -path.load_factor[~is_last] == pytest.approx(exact[~is_last], abs=1e-7)
    assert -path.load_factor == pytest.approx(exact, abs=1e-4)
    assert path.reactions[1:] == pytest.approx(np.transpose([exact[1:]] * 4), abs=1e-4)
    low, high = path.largest_movement
    assert low < 1.410498 < high < low + 1e-4
    assert path.status == "falls"
    crown, *springings = path.openings(-1)
    assert crown == "v6-v7"
    assert {*springings} == {"v2-v3", "v10-v11"}
    # At rest both reactions are those of settlement.
    for which, column in (("least", 0), ("largest", 2)):
        own = settlement(scene, "right-abutment", (1, 0, 0), which).value
        assert path.reactions[0, column] == pytest.approx(own, rel=1e-6)
    path.save(tmp_path / "path.json")
    proof = prove(tmp_path / "path.json")
    assert proof.is_proved
    assert any("no forces carry the dead load at w" in check.claim for check in proof.checks)
    again = read_path(tmp_path / "path.json")
    assert again.largest_movement == path.largest_movement
    assert again.headline == path.headline
    # A configuration that stands is none that has fallen, and reactions are not better than found.
    wrong = replace(path, fallen=replace(path[-1], w=path.w[-1] + 1e-9))
    assert not prove(wrong).is_proved
    last = path[-1]
    tight = replace(last.largest, upper=last.largest.upper - 1.0)
    kept = (*path.configurations[:-1], replace(last, largest=tight))
    assert not prove(replace(path, configurations=kept)).is_proved


def followed_by_hand(path, hand: ThreeHinges) -> None:
    """The reaction is that of a thrust line, of which a springing that has moved leaves more than
    one where mechanisms compete; and beyond the end the last one is none any more."""
    close = 1e-7 * np.abs(path.load_factor).max()
    for w, alpha, (least, _, _, most) in zip(
        path.w[1:], path.load_factor[1:], path.reactions[1:], strict=True
    ):
        exact = hand.reactions(w)
        hinges = min(exact, key=lambda which: abs(exact[which] + alpha))
        assert -alpha == pytest.approx(exact[hinges], abs=close)
        assert least - close <= exact[hinges] <= most + close
    low, high = path.largest_movement
    if np.isfinite(high):
        assert low < high <= low + 1e-3 * path.step
        assert hinges not in hand.reactions(high)


@pytest.mark.exhaustive
def test_a_springing_turns_as_thrust_lines_have_it(tmp_path) -> None:
    scene = spread(8, 0.2)
    motion = SupportMotion("right-abutment", rotation=(0, 2, 0), about=(10, 0.5, 0))
    path = pushover(scene, motion=motion, until=0.05)
    assert path.ending == "reached"
    assert path.w[-1] == 0.05
    assert path.units == ("rad", "rad", "kN m")
    followed_by_hand(path, ThreeHinges(8, 0.2, turn=1.0, about=(10, 0)))
    how = "right-abutment turns by w (0, 1, 0) about (10, 0.5, 0) m"
    assert dict(path.facts())["motion"] == how  # of a report
    assert path.headline.startswith("support right-abutment moves by 0.05 rad, as was asked for")
    path.save(tmp_path / "path.json")
    assert prove(tmp_path / "path.json", scene).is_proved
    # It goes on from the file; and blocks that have left their motion are none of it.
    on = pushover(read_path(tmp_path / "path.json"), until=0.06, certify="last")
    assert on.w[-1] == pytest.approx(0.06, abs=1e-12)
    assert prove(on).is_proved
    strange = dict(path[-1].displacements)
    strange["right-abutment"] = strange["right-abutment"] + [0, 0, 1e-3, 0, 0, 0]
    kept = (*path.configurations[:-1], replace(path[-1], displacements=strange))
    wrong = prove(replace(path, configurations=kept))
    assert any("motion of configuration" in check.claim for check in wrong.checks)


ARCHES = (10, 0.2, 150.0), (9, 0.12, 180.0), (11, 0.1, 140.0), (8, 0.3, 120.0), (14, 0.25, 170.0)
MOTIONS = (
    ((1.0, 0.0), 0.0), ((-1.0, 0.0), 0.0), ((0.0, -1.0), 0.0), ((0.6, -0.8), 0.0),
    ((0.0, 0.0), 1.0), ((0.0, 0.0), -1.0), ((0.8, -0.6), 0.1),
)  # fmt: skip


@pytest.mark.exhaustive
@pytest.mark.parametrize("which", range(0, len(ARCHES) * len(MOTIONS), 3))
def test_arches_are_followed_to_their_ends_by_hand(which) -> None:
    (count, ratio, embrace), (direction, turn) = [*product(ARCHES, MOTIONS)][which]
    scene, foot = spread(count, ratio, embrace=embrace, friction=2.0), np.radians(embrace / 2.0)
    about = 10.0 * np.array([np.sin(foot), np.cos(foot)])
    x, z = direction
    motion = SupportMotion("right-abutment", (x, 0, z), (0, turn, 0), (about[0], 0, about[1]))
    path = pushover(scene, motion=motion, until=1.0 if any(direction) else 0.3)
    followed_by_hand(path, ThreeHinges(count, ratio, embrace, direction, turn, about))
    assert path.status in ("falls", "zero")
    assert prove(path).is_proved


@pytest.mark.parametrize(
    ("courses", "height", "mu"),
    [(1, 2.0, 0.9), pytest.param(4, 1.2, 0.9, marks=pytest.mark.exhaustive),
     pytest.param(3, 0.4, 0.45, marks=pytest.mark.exhaustive)],
)  # fmt: skip
def test_a_wall_leans_with_its_support_until_it_overturns_or_slides(
    courses, height, mu, tmp_path
) -> None:
    """All supports turn, about a point beside, and no joint moves. Its moment about the axis, and
    the angle of b / h or of friction, whichever is less."""
    pad, rise = Block.box("pad", (0, 0, -0.5), (0.5, 1, 0)), height / courses
    wall = [Block.box(f"c{i}", (0, 0, i * rise), (0.5, 1, (i + 1) * rise), density=10.0)
            for i in range(courses)]  # fmt: skip
    scene = Scene([pad, *wall], ["pad"], Load(acceleration=(1, 0, 0)), friction=mu)
    path = pushover(scene, motion=SupportMotion("pad", rotation=(0, 1, 0), about=(0.3, 0, -0.2)))
    x, z = 0.25 - 0.3, height / 2 + 0.2
    exact = 5.0 * height * (np.cos(path.w) * x + np.sin(path.w) * z)
    assert path.reactions == pytest.approx(np.transpose([exact] * 4), abs=1e-6)
    low, high = path.largest_movement
    assert low < np.arctan(min(0.5 / height, mu)) < high < low + 1e-4
    path.save(tmp_path / "path.json")  # whose scene has its support, which moves
    assert prove(tmp_path / "path.json", scene).is_proved
    assert settlement(scene, "pad", (0, 0, -1)).value == pytest.approx(5.0 * height, rel=1e-6)


@pytest.mark.exhaustive
def test_a_motion_is_fitted_to_positions_with_noise() -> None:
    """Errors of 1 mm of six voussoirs: the motion is found within four of its deviations, and they
    are the rest."""
    scene, draw = spread(8, 0.2), np.random.default_rng(7)
    way = (0.2, 0.0, -0.12)
    moved = pushover(scene, motion=SupportMotion("right-abutment", way), until=np.hypot(0.2, 0.12))
    each = {b.id: b.centroid for b in moved[-1].scene().blocks if b.id in ("v2", "v4", "v5", "v7")}
    noisy = {name: x + 1e-3 * draw.standard_normal(3) for name, x in each.items()}
    found = fitted_motion(scene, noisy, "right-abutment")
    off = np.array(found.motion.direction) - way
    assert np.abs(off[[0, 2]] / found.deviation[[0, 2]]).max() < 4.0
    assert 5e-4 < found.deviation[0] < 2e-3
    assert off[1] == found.deviation[1] == 0.0  # planar
    assert 0.5e-3 < found.rest / np.sqrt(3.0) < 1.6e-3
    assert found.path.ending == "reached"
    assert "right-abutment moved by (" in found.headline
    for name, x in noisy.items():
        at = scene_of(found.path)[name].centroid + found.residuals[name]
        assert at == pytest.approx(x, abs=1e-6)
    with pytest.raises(InputError, match="names 'v99', which is no block"):
        fitted_motion(scene, {"v99": (0, 0, 0)}, "right-abutment")
    with pytest.raises(InputError, match="has 2 numbers for a motion of 3"):
        fitted_motion(scene, {"v1": (0, 0, 0)}, "right-abutment", turns=True)


@pytest.mark.exhaustive
def test_a_fitted_motion_may_turn() -> None:
    """Without noise, to what paths leave."""
    scene = spread(8, 0.2)
    about = {block.id: block.centroid for block in scene.blocks}["right-abutment"]
    motion = SupportMotion("right-abutment", (0.1, 0, -0.05), (0, 0.01, 0), about)
    moved = pushover(scene, motion=motion, until=motion.size)
    names = ("v1", "v3", "v4", "v5", "v6", "v8", "right-abutment")
    each = {b.id: b.centroid for b in moved[-1].scene().blocks if b.id in names}
    found = fitted_motion(scene, each, "right-abutment", turns=True)
    assert found.motion.direction == pytest.approx(motion.direction, abs=1e-5)
    assert found.motion.rotation == pytest.approx(motion.rotation, abs=1e-5)
    assert found.rest < 1e-5


def scene_of(path) -> dict[str, Block]:
    return {block.id: block for block in path[-1].scene().blocks}


def reactions_by_hand(path, i: int, facets: int = 24) -> np.ndarray:
    """Least and largest reaction at configuration ``i`` by linear programs at its closed points:
    with friction's cone inscribed, and circumscribed (2, 2)."""
    here, scene = path[i], path.start
    size = scene.contacts.typical_size
    opened_by = here.points.friction * np.linalg.norm(here.points.slip, axis=1)
    apart = here.points.gap - (opened_by if path.flow == "associated" else 0.0)
    p = here.points.take(apart <= max(1e-6 * size, here.widest_gap) * (1.0 + 1e-6))
    moving = {name: motion for motion in path.motions for name in motion.supports}
    place = {block.id: block for block in here.scene().blocks}
    names = [scene.blocks[k].id for k in scene.free]
    still = [name for name in names if name not in moving]
    turn = 2.0 * np.pi * np.arange(facets) / facets
    found = []
    for mu in (p.friction, p.friction / np.cos(np.pi / facets)):
        # Forces along the edges of every cone: columns of equilibrium, and of the reaction.
        columns, push = [], []
        for k, (a, b) in enumerate(zip(p.a.tolist(), p.b.tolist(), strict=True)):
            t1, t2, n = p.axes[k]
            for f in n + mu[k] * (np.outer(np.cos(turn), t1) + np.outer(np.sin(turn), t2)):
                column, along = {}, 0.0
                for number, force in ((a, -f), (b, f)):
                    name = scene.blocks[number].id
                    arm = p.at[k] - place[name].centroid
                    if name in moving:  # these are translated
                        along += float(force @ moving[name].direction) / path.motions[0].size
                    column[name] = np.concatenate([force, np.cross(arm, force)])
                columns.append([column.get(name, np.zeros(6)) for name in still])
                push.append(along)
        weights = [np.array([0, 0, place[name].weight, 0, 0, 0]) for name in still]
        rows = np.array(columns).reshape(len(columns), -1).T
        found.append([
            sign * linprog(sign * np.array(push), A_eq=rows, b_eq=np.concatenate(weights)).fun
            for sign in (1.0, -1.0)
        ])  # fmt: skip
    return np.array(found)


@pytest.mark.exhaustive
@pytest.mark.parametrize("flow", ["associated", "zero-dilatancy"])
@pytest.mark.parametrize("kind", ["dome", "vault"])
def test_reactions_of_a_dome_and_a_vault_lie_between_linear_programs(kind, flow) -> None:
    """A quarter of the dome's ring goes outwards and down, an abutment of the vault aside."""
    if kind == "dome":
        scene = dome(8, 3, 0.2)
        motion = SupportMotion(("ring1", "ring2"), (1, 1, -0.5))
    else:
        scene, motion = barrel_vault(6, 0.2), SupportMotion("right-abutment", (1, 0.3, 0))
    path = pushover(scene, 0.01, flow=flow, motion=motion, until=0.02)
    unit = 1e-6 * scene.total_weight
    for i, (low, to, most, up) in enumerate(path.reactions):
        if path[i].bracket is None:
            continue
        inscribed, circumscribed = reactions_by_hand(path, i)
        assert low - unit <= inscribed[0]
        assert circumscribed[0] <= to + unit
        assert inscribed[1] <= up + unit
        assert most - unit <= circumscribed[1]
    assert prove(path).is_proved


def piers(friction: float = 0.5) -> Scene:
    """A beam of weight 2 on two piers."""
    both = [Block.box(f"p{i}", (x, 0, -1), (x + 0.2, 1, 0)) for i, x in enumerate((0.0, 0.8))]
    beam = Block.box("beam", (0, 0, 0), (1, 1, 0.2), density=10.0)
    return Scene([*both, beam], ["p0", "p1"], Load(acceleration=(1, 0, 0)), friction=friction)


@pytest.mark.exhaustive
def test_a_pier_that_sinks_keeps_its_share() -> None:
    """The beam turns about the edge of the other pier: moments about it, with the friction that
    its far end has at most either way."""
    down = SupportMotion("p1", (0, 0, -1))
    path = pushover(piers(), 0.01, flow="zero-dilatancy", motion=down)
    assert path.reactions[0] == pytest.approx([0.75, 0.75, 1.25, 1.25], abs=1e-6)
    for each, (least, _, _, most) in zip(path.configurations[1:], path.reactions[1:], strict=True):
        if each.w > 0.2:
            break
        x, _, z, _, turn, _ = each.displacements["beam"]
        middle, c, s = np.array([0.5 + x, 0.1 + z]), np.cos(turn), np.sin(turn)
        end = middle + np.array([0.5 * c - 0.1 * s, -0.5 * s - 0.1 * c])
        arm, depth, moment = end[0] - 0.2, -end[1], 2.0 * (middle[0] - 0.2)
        ends = [moment / (arm + mu * depth) for mu in (0.5, -0.5)]
        assert ends[0] - 1e-6 <= least
        assert most <= ends[1] + 1e-6


def test_supports_that_cannot_be_followed_are_refused(tmp_path, capsys) -> None:
    scene = piers()
    with pytest.raises(InputError, match="'p9' is no support"):
        pushover(scene, motion=SupportMotion("p9", (0, 0, -1)))
    with pytest.raises(InputError, match=r"all supports .* move alike"):
        pushover(scene, motion=SupportMotion(("p0", "p1"), (0, 0, -1)))
    with pytest.raises(InputError, match="how far supports move, must be finite and not neg"):
        pushover(scene, motion=SupportMotion("p1", (0, 0, -1)), until=-1.0)
    bed = Block.box("bed", (2, 0, -1), (3, 1, 0))
    off = scene.blocks[2].moved(np.eye(3), np.array([-0.75, 0.0, 0.0]))
    cap = Block.box("cap", (2, 0, 0), (3, 1, 0.1), density=10.0)
    falls = Scene([scene.blocks[0], off, bed, cap], ["p0", "bed"], scene.live)
    with pytest.raises(NoAnswerError, match="no path begins"):
        pushover(falls, motion=SupportMotion("bed", (0, 0, -1)))
    write_scene(scene, tmp_path / "scene.json")
    asked = ["pushover", str(tmp_path / "scene.json"), "--move"]
    assert int(cli.run([*asked, "p1=0,0"])) == 2
    assert "must be three numbers" in capsys.readouterr().err
    assert int(cli.run([*asked[:2], "--about", "p1=0,0,0"])) == 2
    assert "'p1' turns by no --rotation" in capsys.readouterr().err
    assert int(cli.run([*asked, "p1"])) == 2
    assert "SUPPORT=X,Y,Z is meant" in capsys.readouterr().err


@pytest.mark.exhaustive
def test_the_command_line_moves_supports(tmp_path, capsys) -> None:
    write_scene(spread(8, 0.2), tmp_path / "arch.json")
    asked = ["pushover", str(tmp_path / "arch.json"), "--move", "right-abutment=1,0,0",
             "--csv", str(tmp_path / "path.csv"), "--json", str(tmp_path / "path.json"),
             "--plot", str(tmp_path / "curve.png")]  # fmt: skip
    assert int(cli.run(asked)) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "until no forces carry the dead load" in out
    assert "motion right-abutment by w (1, 0, 0) reactions" in out
    assert "least_reaction_lower" in (tmp_path / "path.csv").read_text("utf-8")
    path = read_path(tmp_path / "path.json")
    assert f"{path.largest_movement[0]:.6g} and" in out


def bonded(pad: float, seed: int | None = None, rows: int = 5) -> Scene:
    """Courses of bricks in running bond on a bed, and on a pad from ``pad`` on; with a ``seed``
    uneven ones, of a friction of their own."""
    draw, z = np.random.default_rng(seed), 0.0
    made = [
        Block.box("bed", (-0.5, 0, -1), (pad, 0.2, 0)),
        Block.box("pad", (pad, 0, -1), (2.4, 0.2, 0)),
    ]
    for row in range(rows):
        edges = np.arange(0.0, 2.5, 0.4) if row % 2 == 0 else [0.0, *np.arange(0.2, 2.3, 0.4), 2.4]
        high = 0.2 if seed is None else draw.uniform(0.15, 0.35)
        if seed is not None:
            edges = np.linspace(0.0, 2.0, draw.integers(4, 7))
            edges[1:-1] += draw.uniform(-0.12, 0.12, len(edges) - 2)
        made += [
            Block.box(f"b{row}.{k}", (x, 0, z), (to, 0.2, z + high), density=20.0)
            for k, (x, to) in enumerate(pairwise(edges))
        ]
        z += high
    friction = 0.6 if seed is None else draw.uniform(0.2, 0.6)
    return Scene(made, ["bed", "pad"], Load(acceleration=(1, 0, 0)), friction=friction)


@pytest.mark.parametrize("flow", ["associated", "zero-dilatancy"])
@pytest.mark.parametrize(("pad", "seed", "rows"), [
    (1.1, 0, 3), *(pytest.param(*each, marks=pytest.mark.exhaustive) for each in
    [(1.6, None, 5), (1.2, None, 5), *((0.8 + 0.1 * k, k, 2 + k % 3) for k in range(1, 7))]),
])  # fmt: skip
@pytest.mark.exhaustive_cases("1.1-0-3-associated")
def test_a_wall_on_a_pad_that_sinks_has_its_reaction_between_both(pad, seed, rows, flow) -> None:
    """Also where joints slide, and no row names another bracket than its own; nothing pulls."""
    scene, down = bonded(pad, seed, rows), SupportMotion("pad", (0, 0, -1))
    path = pushover(scene, flow=flow, motion=down, until=0.04, halvings=int(seed is None))
    near = 1e-6 * path.start.total_weight
    for alpha, (least, to, most, up) in zip(path.load_factor, path.reactions, strict=True):
        assert -near <= least <= to + near
        assert least - near <= -alpha <= up + near
        assert most <= up + near
    assert not any(path.below)
    assert path.slides
    assert prove(path).is_proved


@pytest.mark.exhaustive
def test_blocks_that_clamp_each_other_press_no_harder_than_balances() -> None:
    """A pad between walls without friction holds six courses, which clamp as it gives way."""
    wall = bonded(1.6, rows=6)
    blocks = [replace(b, density=0.001) if b.id == "pad" else b for b in wall.blocks]
    blocks.append(Block.box("guide", (2.4, 0, -2), (2.9, 0.2, 0)))
    under = (2.0, 0.1, -1.0)
    holds = Load(gravity=(0, 0, -1), points=[PointForce("pad", under, (0, 0, 1.7647))])
    pulls = Load(points=[PointForce("pad", under, (0, 0, -1))])
    smooth = {("bed", "pad"): 0.0, ("guide", "pad"): 0.0}
    scene = Scene(
        blocks, ["bed", "guide"], pulls, holds, friction=0.6, contact_friction=smooth
    )  # fmt: skip
    lines: list[str] = []

    def stop(line: str) -> None:
        lines.append(line)
        if len(lines) == 30:
            raise KeyboardInterrupt

    path = pushover(scene, halvings=0, progress=stop)
    assert len(path) == 30
    assert prove(path).is_proved
    widths = [c.bracket.upper - c.bracket.lower for c in path if c.bracket is not None]
    assert max(widths) <= 1e-6 * path.load_factor[0]
    off = [max(imbalance(shown)) for shown in path if not shown.is_followed]
    assert len(off) > 10
    assert max(off) <= 1e-6 * scene.total_weight
