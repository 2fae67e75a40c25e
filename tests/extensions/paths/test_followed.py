"""Configurations that are followed by explicit steps, where no iterates come to rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cvxlimit import Path, builtin_scene, code_check, prove, pushover
from cvxlimit.extensions.paths.following import Walk
from cvxlimit.extensions.paths.resting import FARTHEST, LEFT, Failed
from cvxlimit.io import read_path
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
    assert "followed" in figure.axes[0].get_title()
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert {"followed, not at rest", "zero-dilatancy, where blocks are followed"} <= set(labels)
    check = code_check(path)
    assert str(check).count("by step and flow") >= 3  # d0 and both limit states
    assert "an interval" in check.plot().axes[0].get_title()


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
        ({"residual": 0.0}, "equilibrium"),
        ({"residual": 0.01}, "equilibrium"),
        ({"load_factor": 0.3}, "equilibrium"),
        ({"loss": 0.0}, "loss"),
        ({"is_followed": False}, "equilibrium"),
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
def test_the_house_corner_is_followed_to_zero_without_dilatancy() -> None:
    path = pushover(builtin_scene("house-corner"), flow="zero-dilatancy", halvings=0)
    assert path.status == "zero"
    assert max(shown.residual for shown in path if shown.is_followed) <= 1e-4
    assert path.other_flow is not None
    assert path.other_flow.status == "zero"
