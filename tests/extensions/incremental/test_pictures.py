"""Pictures of a way from rest show the numbers that the solution has."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.kit.pictures import assert_legible

from cvxlimit import Incremental, builtin_scene, solve
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError
from cvxlimit.solution import Trial

pytest.importorskip("matplotlib")


def test_the_curve_rises_to_the_load_factor_below_the_proved_limit() -> None:
    """A block that tips at 0.4: the curve, the limit and the ends of the spread meet there."""
    found = solve(builtin_scene("single-block"), method=Incremental(bedding=0.0, draws=2))
    figure = found.plot("curve")
    way, limit, spread, draws, *_ = figure.axes[0].get_lines()
    assert np.max(way.get_ydata()) == found.load_factor == pytest.approx(0.4, rel=1e-6)
    for line in (limit, spread, draws):
        assert np.asarray(line.get_ydata()) == pytest.approx(0.4, rel=1e-2)
    for line, name in zip(figure.axes[1].get_lines(), ("sliding", "open"), strict=True):
        assert [*line.get_ydata()] == [getattr(step, name) for step in found.steps]
    marks = {line.get_label(): line for line in figure.axes[0].get_lines()}
    for name, label in (("sliding", "first joints slide"), ("open", "first joints are open")):
        first = next(step for step in found.steps if getattr(step, name))
        assert first.load_factor > 0.0  # at rest the block stands on all of its joint
        assert marks[label].get_xydata().tolist() == [[first.displacement, first.load_factor]]
    assert_legible(found.plot("curve", figsize=(3.4, 3.2)))


def test_where_joints_open_first() -> None:
    """A block whose pressure leaves the middle third of its joint: at 0.4 / 6 over half its height.
    Below, it neither opens nor slides anywhere."""
    found = solve(builtin_scene("single-block"), method=Incremental(spread=False))
    way = found.from_rest
    before, first = next((a, b) for a, b in pairwise(found.steps) if b.open)
    assert way.opened.tolist() == [first.load_factor]
    assert before.load_factor <= 0.4 / 3.0 + 1e-9 <= first.load_factor + 2e-9
    stack = solve(builtin_scene("stack"), method=Incremental(spread=False))
    assert np.isnan(stack.from_rest.opened[-1])  # the uppermost joint, whose block would tip at 2
    drawn = stack.plot("onset", what="opening")
    assert "joints that never open" in [text.get_text() for text in drawn.legends[0].get_texts()]
    assert_legible(found.plot("onset", what="opening", figsize=(3.4, 3.2)))
    with pytest.raises(InputError, match="what must be one of either, sliding, opening, got 'x'"):
        found.plot("onset", what="x")
    with pytest.raises(InputError, match="read from a file"):
        replace(found, from_rest=replace(way, slipped=None)).plot("onset")


def test_draws_stand_in_their_distribution_and_those_without_an_end_are_counted() -> None:
    """Half of the draws are lost: the distribution ends at one half, and the words say why."""
    found = solve(builtin_scene("single-block"), method=Incremental(bedding=0.0, draws=2))
    way = found.from_rest
    lost = Trial("seed 9", None, "no state further on found")
    drawn = replace(found, from_rest=replace(way, draws=(*way.draws, lost, lost)))
    figure = drawn.plot("bedding")
    draws, limit, true = figure.axes[0].get_lines()
    assert draws.get_ydata().tolist() == [0.0, 0.25, 0.5]
    assert draws.get_xdata()[1:].tolist() == [trial.load_factor for trial in way.draws]
    assert limit.get_xdata()[0] == way.limit
    assert true.get_xdata()[0] == found.load_factor
    assert figure.legends[0].get_title().get_text() == "no load factor: 2 no state further on found"
    assert_legible(drawn.plot("bedding", figsize=(3.4, 3.2)))
    with pytest.raises(InputError, match=r"no draw of .* ended in a load factor: 2 no state"):
        replace(found, from_rest=replace(way, draws=(lost, lost))).plot("bedding")
    with pytest.raises(InputError, match="--bedding 30"):
        replace(found, from_rest=replace(way, draws=())).plot("bedding")


@pytest.mark.parametrize("kind", ["curve", "onset", "bedding"])
def test_other_methods_have_none(kind: str) -> None:
    with pytest.raises(InputError, match="method='incremental'"):
        solve(builtin_scene("single-block")).plot(kind)


def test_they_are_drawn_from_the_command_line(tmp_path: Path) -> None:
    files = [tmp_path / f"{kind}.png" for kind in ("curve", "onset", "bedding")]
    asked = [x for file in files for x in ("--plot", f"{file.stem}:{file}")]
    method = ["--method", "incremental", "--bedding", "0.1", "--draws", "2"]
    assert run(["solve", "single-block", *method, *asked]) == 0
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
    assert run(["solve", "single-block", "--plot", f"curve:{tmp_path / 'none.png'}"]) == 2
    assert not (tmp_path / "none.png").exists()
