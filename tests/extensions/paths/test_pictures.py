"""Pictures of paths: blocks are drawn where they are, snaps as drops, brackets at their places."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cvxlimit import Path as Displacements
from cvxlimit import code_check
from cvxlimit.errors import InputError
from cvxlimit.results.movement import moved_by, points_moved
from cvxlimit.solution.bracket import Bracket
from turning import END, turning, wall


@pytest.fixture(scope="module")
def path() -> Displacements:
    """A wall whose load factor falls to half behind its second configuration."""
    found = turning(wall(2), np.linspace(0.0, END, 5).tolist())
    made = [replace(c, bracket=Bracket(c.load_factor - 1e-3, c.load_factor + 1e-3)) for c in found]
    after = [replace(c, load_factor=0.5 * c.load_factor) for c in made[3:]]
    return replace(found, configurations=(*made[:3], *after), snaps=(made[2].w,))


def lines(figure: Any) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for line in figure.axes[0].get_lines():
        found.setdefault(line.get_linestyle(), []).append(line.get_xydata())
    return found


def test_the_curve_has_a_gap_and_a_drop_at_a_snap_and_a_bracket_at_every_configuration(
    path: Displacements,
) -> None:
    figure = path.plot()
    drawn = lines(figure)
    whole, second = drawn["-"][0], next(each for each in drawn["-"] if each[0, 0] == path.w[3])
    np.testing.assert_array_equal(whole, np.stack([path.w, path.load_factor], axis=1)[:3])
    assert len(second) == 2
    (drop,) = drawn[":"]
    assert drop[0, 0] == drop[1, 0] == path.w[3]
    assert drop[:, 1].tolist() == path.load_factor[2:4].tolist()
    ends = [
        each[:, 1].tolist()
        for each in drawn["-"]
        if each.shape == (2, 2) and np.ptp(each[:, 0]) == 0
    ]
    assert [[c.bracket.lower, c.bracket.upper] for c in path if c.bracket] == ends
    said = figure.axes[0].get_xlabel().replace("\n", " ")
    assert "proves what its configuration carries, not that the structure gets there" in said


def test_the_run_with_half_the_step_is_drawn_beside_the_path(path: Displacements) -> None:
    half = replace(path, configurations=path.configurations[:4])
    shown = replace(path, halved=half, notes=("it slides",))
    named = {line.get_label(): line for line in shown.plot().axes[0].get_lines()}
    line = named["with half the step"]
    assert line.get_xydata().tolist() == [[c.w, c.load_factor] for c in half[:3]]  # to its snap
    assert line.get_linewidth() < named["load factor"].get_linewidth()
    assert "with half the step" not in {line.get_label() for line in path.plot().axes[0].lines}
    page = shown.plot("page")
    assert "It slides" in page
    data = json.loads(page.split('application/json">')[1].split("</script>")[0])["path"]
    assert data["half"]["load_factor"] == half.load_factor.tolist()
    assert data["half"]["displacement"] == half.displacement.tolist()


def test_blocks_are_drawn_where_the_scene_of_a_configuration_has_them(path: Displacements) -> None:
    for each in path:
        moving = moved_by(path.scene, each.displacements)
        for i, block in enumerate(each.scene().blocks):
            at = path.scene.blocks[i].vertices
            drawn = points_moved(path.scene, moving.rates, at, np.full(len(at), i))
            np.testing.assert_allclose(drawn, block.vertices, atol=1e-14)


def test_a_film_shows_every_configuration_forth_and_back(
    path: Displacements, tmp_path: Path
) -> None:
    short = replace(path, configurations=path.configurations[:3], snaps=())
    film = short.animate(figsize=(3.0, 2.5))
    assert len(film.frames) == 4
    assert (film.frames[1] == film.frames[3]).all()
    assert all((film.frames[i] != film.frames[i + 1]).any() for i in range(2))
    assert film.save(tmp_path / "fall.gif").read_bytes()[:6] == b"GIF89a"


def test_the_page_holds_the_ways_of_all_blocks(path: Displacements, tmp_path: Path) -> None:
    page = path.plot("page", tmp_path / "fall.html").read_text("utf-8")
    data = json.loads(page.split('application/json">')[1].split("</script>")[0])
    ways = np.array(data["path"]["ways"]).reshape(5, len(path.scene.blocks), 6)
    for way, each in zip(ways, path, strict=True):
        for block, own in zip(path.scene.blocks, way, strict=True):
            there = each.displacements.get(block.id, np.zeros(6))
            np.testing.assert_allclose(own, there, rtol=1e-6)
    assert data["path"]["pieces"] == [[0, 3], [3, 5]]
    assert "not that the structure gets there" in data["advice"]
    low, high = np.array(data["bounds"]).reshape(2, 3)
    corners = np.concatenate([b.vertices for b in path[4].scene().blocks if b.id != "ground"])
    assert (low <= corners.min(axis=0)).all()
    assert (high >= corners.max(axis=0) - 1e-6).all()


def test_the_capacity_curve_shows_both_limits(path: Displacements, tmp_path: Path) -> None:
    check = code_check(path)
    figure = check.plot()
    marks = [each[0] for each in (line.get_xydata() for line in figure.axes[0].get_lines()
             if line.get_marker() == "o")]  # fmt: skip
    assert marks[0].tolist() == [check.d_SLV, check.slv.acceleration]
    assert marks[1].tolist() == [check.d_SLC, check.slc.acceleration]
    assert check.plot(tmp_path / "check.svg").exists()


def test_another_picture_is_refused(path: Displacements) -> None:
    with pytest.raises(InputError, match="no picture 'thrust': choose one of curve, film, page"):
        path.plot("thrust")
    with pytest.raises(InputError, match=r"ends in \.html"):
        path.plot("page", "fall.png")
