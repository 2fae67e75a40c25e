"""Exploring without a browser: callbacks by hand, answers as single solves have them."""

from __future__ import annotations

import base64
import re
import sys

import numpy as np
import pytest

from cvxlimit import Load, Scene, Status, builtin_scene, solve
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.exploring import Explorer
from cvxlimit.masonry import arch
from cvxlimit.scene.loads import combined
from cvxlimit.studies import explore

PNG = b"\x89PNG"


def explorer(scene: Scene, **ranges: tuple[float, ...]) -> Explorer:
    return Explorer(scene, None, 0.05, {}, ranges)


def picture(state: dict[str, str]) -> bytes:
    return base64.b64decode(state["picture"])


def test_the_mechanism_follows_the_load_point() -> None:
    """A block that rocks at 0.4 either way, and what is beyond is told to be so."""
    shown = explorer(builtin_scene("single-block"))
    along_x = shown.move((0.2, 0.0))
    assert "a_x 0.2, a_y 0: carried" in along_x["text"]
    low, high = map(float, re.findall(r"multiplied by \[([\d.]+), ([\d.]+)\]", along_x["text"])[0])
    assert low <= 2.0 <= high
    assert high - low <= 0.05 * high  # what was asked
    along_y = shown.move((0.0, 0.5))
    assert "not carried" in along_y["text"]
    assert picture(along_x).startswith(PNG)
    assert picture(along_x) != picture(along_y)
    assert shown.move((0, 0))["text"].startswith("a_x 0, a_y 0: carried")


def test_a_slider_shows_the_mechanism_first_and_then_the_domain() -> None:
    shown = explorer(builtin_scene("stack"), friction=(0.05, 0.9))
    shown.move((0.1, 0.02))
    before = shown.state["inside"]
    first, last = shown.change({"friction": 0.1})
    assert not first["is_last"]
    assert last["is_last"]
    assert first["inside"] == before != last["inside"]
    exact = solve(builtin_scene("stack").with_friction(0.1).with_live(
        combined(list(shown.loads.values()), shown.point)
    ))  # fmt: skip
    assert exact.bracket.shown(5) in last["text"]
    assert shown.domain.status is Status.CERTIFIED
    assert shown.domain.load_factor(shown.point).lower <= exact.upper


def test_a_slider_moves_the_domain_under_a_point_without_load() -> None:
    shown = explorer(builtin_scene("stack"), friction=(0.05, 0.9))
    before = shown.move((0, 0))["inside"]
    (last,) = shown.change({"friction": 0.1})
    assert last["is_last"]
    assert last["inside"] != before
    assert last["text"].startswith("a_x 0, a_y 0: carried")


def test_thickness_is_a_parameter_of_a_function() -> None:
    def made(thickness: float) -> Scene:
        return arch(voussoirs=8, thickness_ratio=thickness)

    shown = Explorer(made, None, 0.1, {}, {"thickness": (0.05, 0.3, 0.2)})
    assert shown.values == {"thickness": 0.2}
    reach = shown.domain.load_factor((1, 0)).upper
    assert list(shown.change({"thickness": 0.25}))[-1]["is_last"]
    assert shown.domain.load_factor((1, 0)).lower > reach
    thin = list(shown.change({"thickness": 0.05}))[-1]  # which does not stand
    assert thin["is_last"]
    assert picture(thin).startswith(PNG)


def test_what_cannot_be_is_told() -> None:
    shown = explorer(builtin_scene("stack"), friction=(-1.0, 0.9))
    (told,) = shown.change({"friction": -0.5})
    assert "friction of the scene must be" in told["text"]


def test_what_a_function_raises_is_told_to_the_page_that_waits() -> None:
    def made(thickness: float) -> Scene:
        if thickness < 0.1:
            raise ValueError("too thin")
        return builtin_scene("single-block")

    shown = Explorer(made, None, 0.05, {}, {"thickness": (0.05, 0.3)})
    (told,) = shown.change({"thickness": 0.05})
    assert (told["text"], told["is_last"]) == ("ValueError: too thin", True)


def test_the_widget_answers_the_page() -> None:
    pytest.importorskip("anywidget")
    widget = builtin_scene("stack").explore(friction=(0.3, 0.9))
    widget.point = [0.05, 0.1]
    assert "a_x 0.05, a_y 0.1: carried" in widget.state["text"]
    widget.values = {"friction": 0.4}
    assert widget.state["is_last"]
    assert widget.sliders == [{"name": "friction", "low": 0.3, "high": 0.9}]


def test_without_widgets_a_picture_stands_still(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "anywidget", None)
    shown = explore(builtin_scene("single-block"))
    assert isinstance(shown, Explorer)
    assert shown.sliders["friction"][2] == builtin_scene("single-block").friction
    html = shown._repr_html_()
    assert html.count("<img") == 2
    assert "friction" in html


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"friction": (0.9, 0.3)}, "range of 'friction' must be a least and a larger number"),
        ({"friction": (0.3, np.inf)}, "range of 'friction' must be a least and a larger number"),
        ({"frction": (0.3, 0.9)}, "has no parameter 'frction'"),
        ({"loads": [Load(acceleration=a) for a in np.eye(3)]}, "two loads can be explored, got 3"),
    ],
)
def test_bad_input(options: dict[str, tuple[float, ...]], message: str) -> None:
    with pytest.raises(InputError, match=message):
        builtin_scene("single-block").explore(**options)


def test_what_is_neither_scene_nor_function_is_refused() -> None:
    with pytest.raises(InputError, match="builtin_scene\\('arch'\\)"):
        explore("arch")  # type: ignore[arg-type]


def test_a_parameter_without_default_or_range_is_named() -> None:
    with pytest.raises(InputError, match="missing a required argument: 'density'"):
        explore(lambda density, friction=0.6: builtin_scene("stack"), friction=(0.3, 0.9))


@pytest.mark.parametrize(
    ("loads", "phrase"),
    [
        ([Load(acceleration=(1, 0, 0))] * 3, "two loads can be explored, got 3"),
        (Load(acceleration=(1, 0, 0)), "loads must be a mapping or a sequence of Load"),
    ],
)
def test_loads_that_cannot_be_explored(loads: object, phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        explore(builtin_scene("stack"), loads)  # type: ignore[arg-type]
