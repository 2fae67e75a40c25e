"""Reactions of supports that move, against hand calculation."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from cvxlimit import (
    Block,
    Load,
    Scene,
    Status,
    SupportMotion,
    Units,
    builtin_scene,
    settlement,
)
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError, ModelError
from cvxlimit.geometry.solids import solid
from cvxlimit.io import read_result, write_scene
from cvxlimit.methods.settlement import SupportReaction
from cvxlimit.plotting import plot
from cvxlimit.plotting.look import title
from helpers import renumbered, rotations

FloatArray = NDArray[np.float64]
DOWN = (0.0, 0.0, -1.0)
PUSH = Load(acceleration=(1.0, 0.0, 0.0))


def beam_on_three(widths: float = 0.2) -> Scene:
    """A beam of length 2, height 0.2 and weight 4 on piers at its ends and in the middle."""
    piers = [
        Block.box(f"p{i}", (x, 0, -1), (x + widths, 1, 0))
        for i, x in enumerate((0.0, 1.0 - widths / 2.0, 2.0 - widths))
    ]
    beam = Block.box("beam", (0, 0, 0), (2, 1, 0.2), density=10.0)
    return Scene([*piers, beam], ["p0", "p1", "p2"], PUSH, friction=0.6)


def jack_arch(length: float = 1.0, height: float = 0.5) -> Scene:
    """Two blocks between vertical abutments: thrust W L / (2 h) from toe to crown."""
    left = Block.box("left", (-1, 0, -1), (0, 1, 2))
    right = Block.box("right", (2 * length, 0, -1), (2 * length + 1, 1, 2))
    blocks = [
        Block.box(f"b{i}", (i * length, 0, 0), ((i + 1) * length, 1, height), density=10.0)
        for i in (0, 1)
    ]
    return Scene([left, *blocks, right], ["left", "right"], PUSH, friction=20.0)


class TestBeam:
    def test_middle_pier_may_lose_everything(self) -> None:
        reaction = settlement(beam_on_three(), "p1", DOWN)
        assert reaction.solution.status is Status.CERTIFIED
        assert reaction.value == pytest.approx(0.0, abs=1e-6)
        assert reaction.bracket.lower <= 0.0 + 1e-9 <= reaction.bracket.upper + 2e-9

    def test_end_pier_settles_and_heaves(self) -> None:
        """Least: all but nothing, since the middle pier's inner half lets the beam balance on it.
        Largest: the beam turns about the far edge of the far pier, 4 * 1 / 1.8."""
        scene = beam_on_three()
        least, largest = (settlement(scene, "p2", DOWN, which) for which in ("least", "largest"))
        assert least.value == pytest.approx(0.0, abs=1e-6)
        assert largest.value == pytest.approx(4.0 * 1.0 / 1.8, rel=1e-6)
        assert largest.solution.mechanism is not None
        rates = largest.solution.mechanism["p2"]
        np.testing.assert_allclose(rates, [0, 0, 1, 0, 0, 0], atol=1e-7)
        assert largest.bracket.lower <= 4.0 / 1.8 + 1e-9 <= largest.bracket.upper + 2e-9
        assert largest.bracket.is_proved

    def test_on_two(self) -> None:
        """Least: about the near edge of the other pier, at the far edge of its own."""
        scene = beam_on_three()
        blocks = tuple(b for b in scene.blocks if b.id != "p1")
        two = Scene(blocks, ["p0", "p2"], PUSH, friction=0.6)
        found = [settlement(two, "p2", DOWN, which).value for which in ("least", "largest")]
        assert found == pytest.approx([4.0 * 0.8 / 1.8, 4.0 * 1.0 / 1.8], rel=1e-6)

    def test_sideways_friction(self) -> None:
        """A pier drawn from under a beam drags it along until half the weight is on it: the other
        piers hold the beam back with as much friction, and no more."""
        scene = beam_on_three()
        found = settlement(scene, "p2", (1.0, 0.0, 0.0), "largest").value
        assert found == pytest.approx(0.6 * 4.0 / 2.0, rel=1e-5)


class TestArch:
    @pytest.mark.parametrize(("length", "height"), [(1.0, 0.5), (1.0, 0.9), (0.5, 0.2)])
    def test_spreading_springing(self, length: float, height: float) -> None:
        scene = jack_arch(length, height)
        weight = 10.0 * length * height
        reaction = settlement(scene, "right", (1.0, 0.0, 0.0))
        assert reaction.solution.status is Status.CERTIFIED
        assert reaction.value == pytest.approx(weight * length / (2.0 * height), rel=1e-5)
        assert reaction.bracket.lower <= reaction.value <= reaction.bracket.upper

    def test_thrust_of_a_voussoir_arch_lies_between(self) -> None:
        """Least and largest thrust enclose each other, and a mechanism goes with each."""
        scene = builtin_scene("arch")
        key = scene.supports[-1]
        side = np.sign(next(b for b in scene.blocks if b.id == key).centroid[0]
                       - np.mean([b.centroid[0] for b in scene.blocks]))  # fmt: skip
        low, high = (settlement(scene, key, (side, 0, 0), which) for which in ("least", "largest"))
        assert 0.0 < low.value < high.value

    @given(turn=rotations())
    @settings(max_examples=2, deadline=None)
    def test_rotation_units_and_numbering(self, turn: FloatArray) -> None:
        scene = jack_arch()
        expected = settlement(scene, "right", (1.0, 0.0, 0.0)).value
        turned = settlement(scene.moved(turn), "right", turn @ [2.0, 0.0, 0.0])
        assert turned.value == pytest.approx(expected, rel=1e-5)
        other = settlement(scene.in_units(scene.units, 1e3, 7.0), "right", (1.0, 0.0, 0.0))
        assert other.value == pytest.approx(7.0 * expected, rel=1e-5)
        shuffled = settlement(renumbered(scene, 3), "right", (1.0, 0.0, 0.0))
        assert shuffled.value == pytest.approx(expected, rel=1e-5)

    @pytest.mark.exhaustive
    def test_picture(self, tmp_path: Path) -> None:
        scene = jack_arch()
        reaction = settlement(scene, "right", (1.0, 0.0, 0.0))
        plot(scene, reaction.solution, tmp_path / "arch.png")
        assert (tmp_path / "arch.png").stat().st_size > 0


def test_refusals() -> None:
    scene = beam_on_three()
    for arguments, error, message in (
        (("beam", DOWN), InputError, "'beam' is no support"),
        (("p1", (0, 0, 0)), InputError, "must not be zero"),
        (("p1", DOWN, "most"), ModelError, "least or largest"),
    ):
        with pytest.raises(error, match=message):
            settlement(scene, *arguments)
    named = "knows no strength .* got compressive strength, 1000 at contact p0-beam:"
    with pytest.raises(ModelError, match=named):
        settlement(scene.with_strength(compressive=1e3), "p1", DOWN)


class TestCommandLine:
    @pytest.mark.exhaustive
    def test_spreading_springing_with_file_and_picture(self, tmp_path: Path) -> None:
        """The arch's least thrust, as :func:`settlement` has it; the file keeps what it is of."""
        scene = builtin_scene("arch")
        reaction = settlement(scene, "right-abutment", (1.0, 0.0, 0.0))
        out, picture = tmp_path / "out.json", tmp_path / "arch.png"
        arguments = ["settle", "arch", "--support", "right-abutment", "--direction", "1,0,0"]
        assert run([*arguments, "--json", str(out), "--plot", str(picture)]) == 0
        kept = read_result(out)
        assert kept.load_factor == pytest.approx(reaction.value, rel=1e-9)
        assert kept.lower <= kept.load_factor <= kept.upper
        assert kept.quantity == "least reaction of right-abutment"
        assert title(kept).startswith("arch, Coulomb friction: least reaction of right-abutment 0.")
        assert picture.stat().st_size > 0

    @pytest.mark.parametrize("direction", ["down", "0,0", "0,0,0", "1;2;3"])
    def test_no_direction(self, direction: str, capsys: pytest.CaptureFixture[str]) -> None:
        arguments = ["settle", "arch", "--support", "right-abutment", "--direction", direction]
        assert run(arguments) == 2
        assert "direction" in capsys.readouterr().err

    def test_no_support(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["settle", "arch", "--support", "pier", "--direction", "0,0,1"]) == 2
        assert "left-abutment, right-abutment are" in capsys.readouterr().err

    def test_no_limit(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """A block wedged between two supports holds any push of theirs: exit 3, and why."""
        fixed = [
            Block.box("floor", (0, 0, -1), (1, 1, 0)),
            Block.box("left", (-1, 0, 0), (0, 1, 1)),
            Block.box("right", (1, 0, 0), (2, 1, 1)),
        ]
        block = Block.box("block", (0, 0, 0), (1, 1, 1), density=20.0)
        scene = Scene([*fixed, block], [b.id for b in fixed], Load(acceleration=(0, 1, 0)))
        write_scene(scene, tmp_path / "wedge.json")
        arguments = ["settle", str(tmp_path / "wedge.json"), "--support", "right"]
        assert run([*arguments, "--direction=-1,0,0"]) == 3
        captured = capsys.readouterr()
        assert re.fullmatch(
            r"cvxlimit: the least reaction of right has no limit: .*\n", captured.err
        )
        assert "seconds" not in captured.out  # no history of the problem behind it
        assert run([*arguments, "--direction=1,0,0"]) == 0  # and none is needed at least

    def test_what_was_found_is_shown_though_the_disk_is_full(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        arguments = ["settle", "arch", "--support", "right-abutment", "--direction", "1,0,0"]
        assert run([*arguments, "--json", "/dev/full"]) == 2
        captured = capsys.readouterr()
        assert "least reaction of right-abutment  0.49455" in captured.out
        assert "/dev/full" in captured.err


class TestSeveralTogether:
    """A beam of length 2 and weight 4 on three piers of 0.2 m; arches between abutments."""

    def check(self, reaction: SupportReaction, expected: float) -> None:
        assert reaction.solution.status is Status.CERTIFIED
        assert reaction.value == pytest.approx(expected, rel=1e-6, abs=1e-6)
        assert reaction.bracket.is_within(1e-4)
        assert reaction.bracket.lower <= expected + 1e-6
        assert reaction.bracket.upper >= expected - 1e-6

    def test_two_piers_settle(self) -> None:
        """Least: the third bears at its inner edge, the two at the far end: 4 - 4 / 1.8. Largest:
        all, for the middle one can. Both ends together may carry nothing, or all but what is
        needed of the middle: nothing."""
        scene = beam_on_three()
        for names, least, largest in ((("p1", "p2"), 4 - 4 / 1.8, 4.0), (("p0", "p2"), 0.0, 4.0)):
            self.check(settlement(scene, names, DOWN), least)
            found = settlement(scene, names, (0, 0, -7), "largest")
            self.check(found, largest)
            assert found.solution.quantity == f"largest reaction of {', '.join(names)}"

    def test_piers_turn_as_one(self) -> None:
        """About the first one's inner edge by an axis along y: the sum of forces times distances
        is 4 x 0.8, and besides at most 2 x 0.2, from the first pier's outer edge. As a translation
        of a point 1 m away with a rotation it is the same."""
        scene = beam_on_three()
        axis = {"rotation": (0, 1, 0), "about": (0.2, 0.5, 0)}
        for which, expected in (("least", 3.2), ("largest", 3.6)):
            self.check(settlement(scene, ("p1", "p2"), None, which, **axis), expected)
            both = settlement(scene, ("p1", "p2"), DOWN, which, rotation=(0, 1, 0),
                              about=(1.2, 0, 0))  # fmt: skip
            self.check(both, expected)
        reaction = settlement(scene, ("p1", "p2"), None, "largest", **axis)
        rates = reaction.solution.mechanism
        assert rates is not None
        assert reaction.solution.quantity == "largest moment of p1, p2"
        assert reaction.solution.quantity_unit == "kN m"
        scale = rates["p2"][4]
        for name, x in (("p1", 0.8), ("p2", 1.7)):  # of the centroids from the axis
            np.testing.assert_allclose(rates[name], scale * np.array([-0.5, 0, -x, 0, 1, 0]),
                                       atol=1e-7 * abs(scale))  # fmt: skip

    @pytest.mark.parametrize(("length", "height"), [(1.0, 0.5), (0.5, 0.2)])
    def test_springings_spread_and_turn(self, length: float, height: float) -> None:
        """Both spread: twice the thrust W L / (2 h). One turns about an axis as far below the
        springing as the arch is high: the thrust acts at its toe, W L / (2 h) x h."""
        scene, weight = jack_arch(length, height), 10.0 * length * height
        spread = [SupportMotion("left", (-1, 0, 0)), SupportMotion("right", (1, 0, 0))]
        self.check(settlement(scene, spread), weight * length / height)
        turned = settlement(
            scene, "right", rotation=(0, 3, 0), about=(2 * length, 0.5, -height)
        )  # fmt: skip
        self.check(turned, weight * length / 2.0)

    def test_rotation_and_units(self) -> None:
        scene = replace(
            beam_on_three(), settling=(SupportMotion(("p1", "p2"), DOWN, (0, 1, 0), (1.2, 0, 0)),)
        )
        turn = Rotation.from_euler("xyz", (20, 40, 60), degrees=True).as_matrix()
        self.check(settlement(scene), 3.2)
        self.check(settlement(scene.moved(turn, (1, 2, 3))), 3.2)
        other = settlement(scene.in_units(Units("mm", "N"), 1e3, 1e3))
        assert other.value == pytest.approx(3.2e3, rel=1e-6)

    def test_motions_of_a_file_and_options(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        scene, file = beam_on_three(), str(tmp_path / "beam.json")
        motion = SupportMotion(("p1", "p2"), rotation=(0, 1, 0), about=(0.2, 0, 0))
        write_scene(replace(scene, settling=(motion,)), file)
        assert run(["settle", file]) == 0
        assert re.search("least moment of p1, p2 +3.2000.* kN m ", capsys.readouterr().out)
        assert (
            run(["settle", file, "--support", "p1", "--support", "p2", "--direction=0,0,-1"]) == 0
        )
        assert re.search("least reaction of p1, p2 +1.777.* kN ", capsys.readouterr().out)
        write_scene(scene, file)
        assert run(["settle", file]) == 2
        assert (
            "says nothing of supports that move: name one of p0, p1, p2" in capsys.readouterr().err
        )

    def test_refusals(self) -> None:
        scene = beam_on_three()
        for arguments, options, message in (
            ((("p1", "beam"), DOWN), {}, "'beam' is no support of scene 'scene': p0, p1, p2 are"),
            ((("p1", "p1"), DOWN), {}, "each once, got 'p1' twice"),
            ((("p1", "p2"),), {}, "direction of the motion of 'p1', 'p2' must not be zero"),
            (("p1",), {"rotation": (0, 1, 0)}, "about of the motion of 'p1' is missing"),
            (([SupportMotion("p1", DOWN)] * 2,), {}, "support 'p1' has two motions: give one"),
            ((SupportMotion("p1", DOWN), DOWN), {}, "are the motions' own: leave them out"),
        ):
            with pytest.raises(InputError, match=message):
                settlement(scene, *arguments, **options)  # type: ignore[arg-type]
        with pytest.raises(InputError, match="'beam' is no support"):
            replace(scene, settling=(SupportMotion("beam", DOWN),))


# ------------------------------------------------- arches on spreading supports, by their statics


@dataclass(frozen=True)
class Half:
    """Right half of a symmetric arch of width 1: its joints from the crown down, and what is above.

    ``inner`` and ``outer`` (n + 1, 2) are the joints' ends (x, z), ``weight`` (n + 1,) and
    ``moment`` (n + 1,) the weight between crown and joint and its moment about x = 0.
    """

    inner: FloatArray
    outer: FloatArray
    weight: FloatArray
    moment: FloatArray

    @classmethod
    def of(
        cls, mean: float, thickness: float, begin: float, end: float, n: int, aside: float
    ) -> Half:
        """Radial joints about (-aside, 0), at angles from upright; the crown's one is upright."""
        angles = np.linspace(begin, end, n + 1)
        rays = np.stack([np.sin(angles), np.cos(angles)], axis=1)
        inner, outer = ((mean + s * thickness / 2) * rays - [aside, 0] for s in (-1, 1))
        if aside:  # the crown's joint lies in the plane of symmetry
            for ends, r in ((inner, mean - thickness / 2), (outer, mean + thickness / 2)):
                ends[0] = 0.0, np.sqrt(r**2 - aside**2)
        weight, moment = [0.0], [0.0]
        for k in range(n):
            x, z = np.array([inner[k], outer[k], outer[k + 1], inner[k + 1]]).T
            cross = x * np.roll(z, -1) - np.roll(x, -1) * z
            weight.append(weight[-1] + 20.0 * abs(cross.sum()) / 2)
            moment.append(moment[-1] + 20.0 * abs(((x + np.roll(x, -1)) * cross).sum()) / 6)
        return cls(inner, outer, np.array(weight), np.array(moment))

    def thrust(self, sign: float) -> float:
        """Least (1) or largest (-1) horizontal thrust whose line stays in the arch: two unknowns,
        the thrust and its moment at the crown; where it passes a joint, moments about its ends have
        two signs."""
        rows, most = [], []
        for ends, way in ((self.inner, 1.0), (self.outer, -1.0)):
            x, z = ends.T
            rows.append(way * np.stack([z, -np.ones(len(z))], axis=1))
            most.append(way * (self.moment - self.weight * x))
        found = linprog([sign, 0.0], np.vstack(rows), np.concatenate(most), bounds=[(0, None)] * 2)
        return float(found.x[0])

    def scene(self) -> Scene:
        def voussoir(name: str, k: int, side: float) -> Block:
            flat = [self.inner[k], self.outer[k], self.outer[k + 1], self.inner[k + 1]]
            points = [(side * x, y, z) for y in (0.0, 1.0) for x, z in flat]
            faces = [
                (0, 1, 2, 3),
                (4, 5, 6, 7),
                (0, 1, 5, 4),
                (1, 2, 6, 5),
                (2, 3, 7, 6),
                (3, 0, 4, 7),
            ]
            return solid(name, np.array(points), faces, 20.0)

        n = len(self.inner) - 1
        blocks = [
            voussoir(f"{name}{k}", k, side)
            for name, side in (("l", -1), ("r", 1))
            for k in range(n)
        ]
        return Scene(blocks, [f"l{n - 1}", f"r{n - 1}"], PUSH, friction=5.0)


SPREADING = {
    "semicircle": (1.0, 0.15, 0.0, np.pi / 2, 12, 0.0),
    "thick": (2.0, 0.5, 0.0, np.pi / 2, 9, 0.0),
    "segment": (1.5, 0.2, 0.0, 1.0, 8, 0.0),
    "pointed": (1.3, 0.22, np.arcsin(0.5 / 1.3), np.pi / 2, 10, 0.5),
}


@pytest.mark.parametrize("kind", SPREADING)
@pytest.mark.parametrize(("which", "sign"), [("least", 1.0), ("largest", -1.0)])
def test_an_arch_on_spreading_supports(kind: str, which: str, sign: float) -> None:
    """Ochsendorf's question, and Coccia's for pointed arches: what an arch presses on supports that
    give way, and what pushes them back. The lowest voussoirs are the supports."""
    mean, thickness, begin, end, n, aside = SPREADING[kind]
    whole = Half.of(mean, thickness, begin, end, n, aside)
    above = Half(*(values[:n] for values in (whole.inner, whole.outer, whole.weight, whole.moment)))
    found = settlement(whole.scene(), f"r{n - 1}", (1, 0, 0), which)
    expected = above.thrust(sign)
    assert found.value == pytest.approx(expected, rel=1e-5)
    assert found.bracket.lower - 1e-9 <= expected * (1 + 1e-7)
    assert found.bracket.upper + 1e-9 >= expected * (1 - 1e-7)


@pytest.mark.parametrize("ratio", [0.12, 0.2])
def test_many_voussoirs_tend_to_the_continuous_semicircle(ratio: float) -> None:
    """Least thrust, hinges at the crown's outer edge and inside at an angle b, where it is most:
    H (ro - ri cos b) = W(b) (ri sin b - xg(b)). This proves the statics above."""
    inner, outer = 1.0 - ratio / 2, 1.0 + ratio / 2
    b = np.linspace(1e-3, np.pi / 2, 20_001)
    weight = 20.0 * (outer**2 - inner**2) / 2 * b
    moment = 20.0 * (outer**3 - inner**3) / 3 * (1 - np.cos(b))
    thrust = ((weight * inner * np.sin(b) - moment) / (outer - inner * np.cos(b))).max()
    fine = Half.of(1.0, ratio, 0.0, np.pi / 2, 1000, 0.0).thrust(1.0)
    assert fine == pytest.approx(thrust, rel=1e-4)
