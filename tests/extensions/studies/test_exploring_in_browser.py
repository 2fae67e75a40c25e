"""The widget of ``explore`` as a notebook shows it: in a real browser, with the answers that Python
gives. ``.venv/bin/pytest -m browser`` runs these."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.kit.browser import RIGHT, UP, VIEWS, Browser, browser

from cvxlimit import builtin_scene

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def tab() -> Iterator[Browser]:
    with browser() as opened:
        yield opened


HOST = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>host</title>
<meta name="viewport" content="width=device-width, initial-scale=1"></head>
<body style="margin: 0"><div id="cell"></div>
<script id="given" type="application/json">GIVEN</script>
<script>
const given = JSON.parse(document.getElementById("given").textContent);
const asked = [], listeners = [];
const model = {
  get: (name) => given.traits[name],
  set: (name, value) => { given.traits[name] = value; asked.push([name, value]); },
  save_changes: () => {},
  on: (event, call) => listeners.push([event, call]),
};
const answer = (name, value) => {
  given.traits[name] = value;
  for (const [event, call] of listeners) if (event === `change:${name}`) call();
};
const source = URL.createObjectURL(new Blob([given.esm], { type: "text/javascript" }));
import(source).then((module) => {
  module.default.render({ model, el: document.getElementById("cell") });
});
</script></body></html>
"""
"""What Jupyter gives a widget: its module, an element, and a model to get, set and listen to."""


class Notebook:
    """A widget and the page that shows it; :meth:`asked` carries over what the page has set."""

    def __init__(self, widget: Any, tab: Browser, folder: Path) -> None:
        self.widget, self.tab, self.folder = widget, tab, folder
        widget.observe(lambda change: self._tell(change["new"]), "state")
        self.is_open = False

    def opened(self, width: int, scheme: str) -> Notebook:
        names = ("point", "values", "state", "sliders")
        traits = {name: getattr(self.widget, name) for name in names}
        given = json.dumps({"esm": self.widget._esm, "traits": traits}).replace("<", "\\u003c")
        page = self.folder / "host.html"
        page.write_text(HOST.replace("GIVEN", given), "utf-8")
        self.tab.opened(page, width, scheme)
        self.tab.until(lambda: self.tab.run("return document.querySelector('svg polygon')"))
        self.is_open = True
        return self

    def _tell(self, state: dict[str, Any]) -> None:
        if self.is_open:
            self.tab.run("answer('state', arguments[0])", state)

    def asked(self) -> int:
        """Questions of the page are answered until it has none; how many there were."""
        number = 0
        while asked := self.tab.run("return asked.splice(0)"):
            for name, value in asked:
                setattr(self.widget, name, value)
                number += 1
        self.tab.settled()
        return number

    def ring(self, kind: str) -> np.ndarray[Any, Any]:
        text = self.tab.run(f"return document.querySelector('.{kind}').getAttribute('points')")
        return np.array([list(map(float, corner.split(","))) for corner in text.split()])

    def numbers(self) -> list[str]:
        words = self.tab.run(
            "return [...document.querySelectorAll('svg text')].map((t) => t.textContent)"
        )
        return [word for word in words if re.fullmatch(r"-?[\d.]+", word)]

    def slide(self, share: float) -> None:
        self.tab.run("""const s = document.querySelector("input[type=range]");
            s.value = +s.min + arguments[0] * (s.max - s.min);
            s.dispatchEvent(new Event("input"))""", share)  # fmt: skip


@pytest.fixture
def notebook(tab: Browser, tmp_path: Path) -> Notebook:
    pytest.importorskip("anywidget")
    return Notebook(builtin_scene("stack").explore(friction=(0.1, 0.9)), tab, tmp_path)


class TestExplore:
    @pytest.mark.parametrize(("width", "scheme"), VIEWS)
    def test_it_fits_and_has_numbers(self, width: int, scheme: str, notebook: Notebook) -> None:
        notebook.opened(width, scheme)
        assert notebook.tab.complaints == []
        assert notebook.tab.overflow() == []
        assert min(notebook.tab.letters()) >= 11.0
        assert len(notebook.numbers()) >= 8
        paper = notebook.tab.run(
            "return getComputedStyle(document.querySelector('.cvxlimit')).backgroundColor"
        )
        assert (sum(map(int, re.findall(r"\d+", paper))) > 380) == (scheme == "light")

    def test_the_frame_is_three_times_the_load_point(self, notebook: Notebook) -> None:
        """And the domain's corners are where the numbers at the axes say."""
        notebook.opened(1280, "light")
        (low, high), point = notebook.widget.state["box"], notebook.widget.point
        assert max(high) == pytest.approx(3.0 * max(point))
        assert low == [-x for x in high]
        assert np.abs(np.array(notebook.widget.state["inside"])).max() == pytest.approx(
            0.4, rel=0.03
        )
        numbers = {float(n) for n in notebook.numbers()}
        assert max(numbers) <= max(high) < max(numbers) + np.diff(sorted(numbers)).max()

    def test_a_long_domain_is_cut_off_where_it_says_nothing(self, tab, tmp_path: Path) -> None:
        """Pressed together the tuff wall carries tens of times as much as it does otherwise."""
        widget = builtin_scene("tuff-wall").explore(friction=(0.3, 0.9), tolerance=0.1)
        shown = Notebook(widget, tab, tmp_path).opened(1280, "light")
        ring = shown.ring("inside")
        size = tab.run("return document.querySelector('svg').viewBox.baseVal.width")
        assert (np.ptp(ring, axis=0) > 0.1 * size).all()
        assert (ring >= 0.0).all()
        assert (ring <= size).all()

    def test_dragging_asks_for_the_point_under_the_pointer(self, notebook: Notebook) -> None:
        notebook.opened(1280, "light")
        before = notebook.tab.text(".cvxlimit p")
        notebook.tab.point("svg", (0.6, 0.5), (0.75, 0.3), press=True)
        assert notebook.asked() >= 1
        (low, high), at = notebook.widget.state["box"], notebook.widget.point
        left, right, top, foot = 52 / 360, 350 / 360, 10 / 360, 320 / 360
        wanted = [low[0] + (0.75 - left) / (right - left) * (high[0] - low[0]),
                  high[1] - (0.3 - top) / (foot - top) * (high[1] - low[1])]  # fmt: skip
        np.testing.assert_allclose(at, wanted, atol=0.01 * high[0])
        after = notebook.tab.text(".cvxlimit p")
        assert after != before
        assert f"a_x {at[0]:.4g}, a_y {at[1]:.4g}" in after
        assert notebook.tab.complaints == []

    def test_keys_move_the_point(self, notebook: Notebook) -> None:
        notebook.opened(390, "dark")
        (low, high), before = notebook.widget.state["box"], list(notebook.widget.point)
        notebook.tab.run("document.querySelector('svg').focus()")
        for key in (RIGHT, RIGHT, UP):
            notebook.tab.press(key)
            assert notebook.asked() == 1
        step = [(b - a) / 50 for a, b in zip(low, high, strict=True)]
        np.testing.assert_allclose(
            notebook.widget.point, [before[0] + 2 * step[0], before[1] + step[1]], rtol=1e-9
        )

    def test_the_frame_stands_still_while_a_slider_moves(self, notebook: Notebook) -> None:
        notebook.opened(1280, "light")
        numbers, ring = notebook.numbers(), notebook.ring("inside")
        for share in (0.0, 0.02, 1.0):
            notebook.slide(share)
            assert notebook.asked() >= 1
            assert notebook.numbers() == numbers
        assert notebook.widget.values["friction"] == pytest.approx(0.9)
        notebook.slide(0.05)
        notebook.asked()
        assert np.ptp(notebook.ring("inside"), axis=0).max() < 0.8 * np.ptp(ring, axis=0).max()
        assert notebook.tab.complaints == []

    def test_the_last_question_asked_meanwhile_comes_next(self, notebook: Notebook) -> None:
        notebook.opened(1280, "light")
        for share in (0.2, 0.4, 0.6):  # the first is sent, the last waits for its answer
            notebook.slide(share)
        assert notebook.asked() == 2
        assert notebook.widget.values["friction"] == pytest.approx(0.1 + 0.6 * 0.8)
