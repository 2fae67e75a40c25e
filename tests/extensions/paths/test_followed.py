"""Configurations that are followed by explicit steps, where no iterates come to rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cvxlimit import Block, Load, Path, Scene, builtin_scene, code_check, prove, pushover
from cvxlimit.extensions.paths.following import Walk
from cvxlimit.extensions.paths.resting import FARTHEST, LEFT, Failed
from cvxlimit.io import read_path
from cvxlimit.masonry import single_block
from cvxlimit.scene.loads import Pressure
from linkages import rocking


@pytest.fixture(scope="module")
def path() -> Iterator[Path]:
    """A block of which no iterates come to rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            Walk, "settle", lambda self, _, w: Failed(w, "not-converged", np.ones(len(self.radius)))
        )
        yield pushover(builtin_scene("single-block"), halvings=0)


def test_explicit_steps_alone_follow_a_block_to_its_closed_form(path: Path) -> None:
    """Linearised steps leave the curve by the square of how far each of them goes."""
    assert path.status == "zero"
    assert all(shown.is_followed for shown in path[1:])
    exact = [rocking(0.4, 1.0, w) for w in path.w]
    assert path.load_factor == pytest.approx(exact, abs=FARTHEST**2)
    assert path.d0 == pytest.approx(0.2, abs=FARTHEST**2)
    assert max(shown.residual for shown in path) <= 1e-4
    for shown, value in zip(path, exact, strict=True):
        if shown.bracket is not None:
            assert shown.bracket.is_proved
            assert shown.bracket.lower - LEFT <= value <= shown.bracket.upper + LEFT
            assert shown.widest_gap <= LEFT * path.scene.contacts.typical_size


@pytest.fixture
def unsettled(monkeypatch: pytest.MonkeyPatch) -> None:
    """No iterates come to rest."""
    monkeypatch.setattr(
        Walk, "settle", lambda self, _, w: Failed(w, "not-converged", np.ones(len(self.radius)))
    )


@pytest.mark.usefixtures("unsettled")
def test_explicit_steps_follow_a_block_that_starts_displaced() -> None:
    """Of 0.5 x 1 m, leaning by ten degrees about its toe."""
    angle = np.radians(10.0)
    c, s = np.cos(angle), np.sin(angle)
    block = Block.box("b", (-0.5, -0.25, 0), (0, 0.25, 1), density=10).moved(
        [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    )
    ground = Block.box("ground", (-5, -5, -1), (5, 5, 0))
    scene = Scene([ground, block], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.7)
    path = pushover(scene, certify="none", halvings=0)
    assert path.initial is None
    assert all(shown.is_followed for shown in path[1:])
    exact = [np.tan(np.arctan(0.5) - angle - shown.displacements["b"][4]) for shown in path]
    assert path.status == "zero"
    assert path.load_factor == pytest.approx(exact, abs=LEFT)


@pytest.mark.usefixtures("unsettled")
def test_explicit_steps_know_pressures_that_turn() -> None:
    """Their lever arm about the toe stays half the height, and the weight's goes to zero."""
    b, h, width = 0.4, 1.0, 0.5
    wind = Pressure("b1", normal=(-1, 0, 0), pressure=1.0)
    scene = single_block((b, width, h), friction=2.0, live=Load(pressures=[wind]))
    path = pushover(scene, certify="none", halvings=0)
    assert all(shown.is_followed for shown in path[1:])
    turns = np.array([shown.displacements["b1"][4] for shown in path])
    rest = scene.total_weight * np.hypot(b, h) / 2 * np.sin(np.arctan2(b, h) - turns)
    exact = rest / (h * width * h / 2)
    assert path.status == "zero"
    assert path.load_factor == pytest.approx(exact, abs=LEFT * exact[0])


def test_what_is_followed_says_so_wherever_its_numbers_are(path: Path) -> None:
    assert path.other_flow is not None
    assert path.other_flow.flow == "zero-dilatancy"
    runs = [run.d0 for run in (path, path.halved, path.other_flow) if run is not None]
    assert path.d0_interval == (min(runs), max(runs))
    without = sum(shown.bracket is None for shown in path)
    words = (f"{len(path) - 1} of {len(path)} configurations are followed", "an interval over step")
    assert all(each in path.headline for each in words)
    assert (f"no bracket is proved for {without} of them" in path.headline) == bool(without)
    assert path.to_dataframe()["followed"].sum() == len(path) - 1
    figure = path.plot()
    assert "followed" in figure.get_suptitle()
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert {"followed, not at rest", "zero-dilatancy, where blocks are followed"} <= set(labels)
    check = code_check(path)
    assert str(check).count("by step and flow") >= 3  # d0 and both limit states
    assert "an interval" in check.plot().get_suptitle()


@pytest.mark.exhaustive
def test_files_of_what_is_followed_are_proved_again(path: Path, tmp_path: Any) -> None:
    path.save(tmp_path / "path.json")
    again = read_path(tmp_path / "path.json")
    assert [shown.is_followed for shown in again] == [shown.is_followed for shown in path]
    assert again.d0_interval == path.d0_interval
    proof = prove(again)
    assert proof.is_proved
    assert f"{len(path) - 1} are followed and lack up to" in str(proof)
    assert "by the other flow in equilibrium" in str(proof)
    same = replace(path, other_flow=replace(path, halved=None, other_flow=None))
    assert "the other flow" in {check.claim for check in prove(same).missing}


@pytest.mark.parametrize(
    ("change", "claim"),
    [
        ({"residual": 0.01}, "equilibrium"),
        ({"load_factor": 0.3}, "equilibrium"),
        ({"loss": 0.0}, "loss"),
        ({"is_followed": False}, "loss"),
    ],
)
def test_forces_that_lack_more_than_is_told_are_not_proved(path: Path, change, claim) -> None:
    made = tuple(
        replace(each, **(change if i == 3 else {}))
        for i, each in enumerate(path.configurations[:4])
    )
    found = prove(replace(path, configurations=made, other_flow=None)).missing
    assert claim in {check.claim.split()[0] for check in found}


@pytest.mark.exhaustive
def test_the_dome_is_followed_to_zero_by_both_rules() -> None:
    path = pushover(builtin_scene("dome"), halvings=0)
    other = path.other_flow
    assert other is not None
    assert path.status == other.status == "zero"
    assert 0.005 < path.d0_interval[0] < path.d0_interval[1] < 0.014
    assert prove(path).is_proved
    assert max(shown.residual for shown in path if shown.is_followed) <= 1e-4


@pytest.mark.exhaustive
def test_the_house_corner_comes_to_zero_without_dilatancy() -> None:
    """It begins where the way from rest ends, and comes to rest wherever it is pushed to."""
    path = pushover(
        builtin_scene("house-corner"), flow="zero-dilatancy", halvings=0, certify="none"
    )
    assert path.status == "zero"
    assert path.load_factor[0] < 0.165  # 0.184 in the state that the associated one leads to
    assert all(shown.residual <= 1e-4 for shown in path if shown.is_followed)
