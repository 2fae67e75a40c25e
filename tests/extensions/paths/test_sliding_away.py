"""What slides keeps its load factor for as far as its support was drawn: no displacement of it is a
capacity. What rocks has one, whatever the ground is; what does both says how much of it is slip."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cvxlimit import Block, Load, Path, Scene, code_check, pushover
from cvxlimit.cli import main as cli
from cvxlimit.io import read_path, write_scene

B, G, WIDE = 0.6, 9.81, (1.0, 2.0, 4.0)
"""Half widths of the ground, as it may be drawn."""

FLOWS = ("associated", "zero-dilatancy")


def on_ground(
    half: float, friction: float, height: float = 1.0, courses: int = 1, tilt: float = 0.0,
    **options: Any,
) -> Scene:  # fmt: skip
    """Courses of 0.6 m on a ground that reaches as far to both sides, pushed along x; all of it
    tilted, so that the push goes uphill."""
    ground = Block.box("ground", (-half, -1, -1), (half, 1, 0))
    edges = np.linspace(0.0, height, courses + 1)
    blocks = [Block.box(f"b{i}", (-B / 2, -0.5, edges[i]), (B / 2, 0.5, edges[i + 1]), density=20)
              for i in range(courses)]  # fmt: skip
    c, s = np.cos(tilt), np.sin(tilt)
    push, dead = Load(acceleration=(c, 0, -s)), Load(gravity=(-s, 0, -c))
    return Scene([ground, *blocks], ["ground"], push, dead, friction=friction, **options)


def retaining(half: float) -> Scene:
    """A wide wall of two rows of stones that slides on its base."""
    ground = Block.box("ground", (-half, -1, -1), (half, 1, 0))
    low = [Block.box(f"low{i}", (-0.4 + 0.4 * i, 0, 0), (0.4 * i, 0.5, 0.3), density=20)
           for i in range(2)]  # fmt: skip
    top = Block.box("top", (-0.4, 0, 0.3), (0.4, 0.5, 0.6), density=20)
    return Scene([ground, *low, top], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.2,
                 contact_friction={("low0", "top"): 0.7, ("low1", "top"): 0.7})  # fmt: skip


SLIDING = {
    "a block": (lambda half: on_ground(half, 0.3), 0.3, ["'ground'-'b0'"]),
    "a block that nearly tips": (lambda half: on_ground(half, 0.3, 1.8), 0.3, ["'ground'-'b0'"]),
    "uphill": (
        lambda half: on_ground(half, 0.3, 0.4, tilt=0.1), np.tan(np.arctan(0.3) + 0.1),
        ["'ground'-'b0'"],
    ),
    "downhill": (
        lambda half: on_ground(half, 0.3, 0.4, tilt=-0.1), np.tan(np.arctan(0.3) - 0.1),
        ["'ground'-'b0'"],
    ),
    "a joint of a wall": (
        lambda half: on_ground(half, 0.6, courses=4, contact_friction={("b1", "b2"): 0.2}), 0.2,
        ["'b1'-'b2'"],
    ),
    "a wall on its base": (retaining, 0.2, ["'ground'-'low0'", "'ground'-'low1'"]),
}  # fmt: skip


def refused(path: Path, factor: float) -> None:
    """The code check has the acceleration that moves it, and no displacement anywhere."""
    check = code_check(path, 1.35)
    assert check.a0_star == pytest.approx(factor * G / 1.35 / check.e_star, rel=1e-6)
    for name in ("d0", "d_SLV", "T_SLV", "d_SLC", "T_SLC"):
        assert np.isnan(getattr(check, name))
        assert name in str(check)
    assert str(check).count("no d0") == 1
    table = check.to_dataframe()
    assert table["value"].isna().sum() == 1
    assert "stays level" in table["meaning"][table["value"].isna()].item()
    assert "no d0" in check.plot().get_suptitle()


@pytest.mark.parametrize(("half", "flow"), [
    (1.0, "associated"),
    *(pytest.param(half, flow, marks=pytest.mark.exhaustive) for half in WIDE for flow in FLOWS),
])  # fmt: skip
@pytest.mark.parametrize("name", SLIDING)
@pytest.mark.exhaustive_cases("a block that nearly tips-1.0-associated0")
def test_what_slides_has_no_d0_however_far_its_ground_goes(name, half, flow) -> None:
    made, factor, joints = SLIDING[name]
    path = pushover(made(half), flow=flow, certify="none")
    assert path.load_factor[0] == pytest.approx(factor, abs=1e-7)
    assert path.slides_away
    assert np.isnan(path.d0)
    assert all(joint in path.reason for joint in joints)
    assert "ends where what it slides on was drawn to end" in path.reason
    refused(path, factor)


@pytest.mark.parametrize("step", [0.5, 2.0])
def test_steps_make_no_capacity_of_it(step: float) -> None:
    for flow in FLOWS:
        refused(pushover(on_ground(1.0, 0.3), step=step, flow=flow, certify="none"), 0.3)


@pytest.mark.exhaustive
def test_a_path_that_did_not_get_anywhere_slides_too() -> None:
    """Of twelve courses on equal joints any may slide, and steps settle on none."""
    path = pushover(on_ground(2.0, 0.3, courses=12), certify="none")
    assert path.slides_away
    assert np.isnan(code_check(path).d_SLV)


@pytest.mark.parametrize("half", WIDE)
@pytest.mark.parametrize("courses", [1, 3])
@pytest.mark.exhaustive_cases("1-2.0", "1-4.0", "3-1.0", "3-2.0")
def test_what_rocks_has_its_closed_form_however_far_its_ground_goes(half, courses) -> None:
    path = pushover(on_ground(half, 0.7, 2.0, courses), certify="none")
    e_star = 3 * courses**2 / (4 * courses**2 - 1)
    check = code_check(path, 1.0)
    assert not path.slides_away
    assert path.d0 == pytest.approx(B / 2, abs=1e-7)
    assert path.slip_share == 0.0
    assert check.refused == ""
    assert check.e_star == pytest.approx(e_star, rel=1e-6)
    assert check.d0 == pytest.approx(B / 2 / e_star, rel=1e-6)
    assert check.d_SLV == pytest.approx(0.4 * check.d0, rel=1e-6)
    assert "rock" in path.headline


def test_what_rocks_and_slips_says_how_much_is_slip() -> None:
    """A tall block turns by an angle and pushes a low one: what both slide by is in proportion."""
    ground = Block.box("ground", (-2, -2, -1), (2, 2, 0))
    low = Block.box("low", (0, 0, 0), (0.3, 0.5, 0.3), density=20)
    tall = Block.box("tall", (-0.3, 0, 0), (0, 0.5, 1), density=20)
    scene = Scene([ground, low, tall], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.3)
    path = pushover(scene, flow="zero-dilatancy", certify="none", halvings=0)
    assert not path.slides_away
    assert 0.0 < path.d0 < 0.3
    way = path[-1].displacements["low"][0]
    assert path.sliding_joints["'ground'-'low'"] == pytest.approx(way, rel=1e-3)
    slip = sum(path.sliding_joints.values())
    size = scene.contacts.typical_size
    turned = abs(path[-1].displacements["tall"][4]) * size
    assert path.slip_share == pytest.approx(slip / (slip + 2.0 * turned), rel=0.05)
    share = f"{100.0 * path.slip_share:.0f} % of the displacement in joints is slip"
    assert share in path.headline
    assert share in str(code_check(path))
    table = path.to_dataframe()
    assert table["slip"].sum() == pytest.approx(way, rel=1e-3)


def test_a_path_that_is_broken_off_on_its_way_is_not_called_level() -> None:
    path = pushover(on_ground(1.0, 0.7), until=0.55, certify="none")
    assert not path.slides_away
    short = replace(path, configurations=path.configurations[:1])
    assert not short.slides_away


def test_command_line_file_and_report_say_so(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    write_scene(on_ground(1.0, 0.3), "slides.json")
    asked = ["pushover", "slides.json", "--code-check", "1.35", "--json", "path.json",
             "--report", "page.html", "--plot", "path.html"]  # fmt: skip
    assert int(cli.run(asked)) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "in short a load factor of 0.3 moves it, and there is no d0" in out
    assert "d0, d_SLV, T_SLV, d_SLC, T_SLC none" in out
    assert read_path("path.json").slides_away
    for name in ("page.html", "path.html"):
        page = (tmp_path / name).read_text("utf-8")
        assert "load factor of 0.3 moves it, and there is no d0" in page.replace("&#x27;", "'")
        assert ">nan<" not in page
    assert "<td>none</td>" in (tmp_path / "page.html").read_text("utf-8")
