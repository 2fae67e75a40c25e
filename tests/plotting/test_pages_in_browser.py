"""The interactive pages as they are used: in a real browser, on a phone and on a laptop, in the
light and in the dark. ``.venv/bin/pytest -m browser`` runs these."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tests.kit.browser import HEIGHTS, RIGHT, UP, VIEWS, Browser, browser

from cvxlimit import Block, Load, PointForce, Scene, Status, builtin_scene, plotting, solve
from cvxlimit.extensions.studies.domains.pictures import domain_page
from cvxlimit.plotting.picture import drawn_mesh
from cvxlimit.results.movement import moved_by, points_moved
from cvxlimit.scene.loads import combined
from cvxlimit.studies import load_domain
from turning import ANGLES, turning, wall

pytestmark = pytest.mark.browser

SPACE = [Load(acceleration=a) for a in np.eye(3)]


@pytest.fixture(scope="module")
def tab() -> Iterator[Browser]:
    with browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    block, stack = builtin_scene("single-block"), builtin_scene("stack")
    made = {
        "viewer": solve(builtin_scene("tuff-wall")).plot("page"),
        "refused": plotting.scene_page(Scene((GROUND, LEFT, CROWDED), ("ground",), PUSH)),
        "scene": plotting.scene_page(builtin_scene("arch")),
        "flat": domain_page([load_domain(block, progress=False)]),
        "nested": domain_page([load_domain(stack, surface=surface, progress=False)
                               for surface in ("conic", "octagon")]),
        "solid": domain_page([load_domain(stack, SPACE, 0.1, progress=False)]),
        "path": turning(wall(3), ANGLES).plot("page"),
    }  # fmt: skip
    folder = tmp_path_factory.mktemp("pages")
    for name, page in made.items():
        (folder / f"{name}.html").write_text(page, "utf-8")
    return {name: folder / f"{name}.html" for name in made}


PUSH = Load(acceleration=(1, 0, 0))
GROUND = Block.box("ground", (-1, -1, -1), (3, 2, 0), density=20.0)
LEFT = Block.box("left", (0, 0, 0), (1, 1, 2), density=20.0)
CROWDED = Block.box("crowded", (0.9, 0, 0), (1.9, 1, 2), density=20.0)

PAGES = ("viewer", "scene", "refused", "flat", "nested", "solid", "path")


def tip(tab: Browser) -> str:
    """What is told beside the pointer, empty if nothing is."""
    return str(tab.run("const t = document.getElementById('tip');"
                       "return t.style.display === 'block' ? t.textContent : ''"))  # fmt: skip


# --- what holds of every page --------------------------------------------------------------------


@pytest.mark.parametrize(("width", "scheme"), VIEWS)
@pytest.mark.parametrize("name", PAGES)
class TestEveryPage:
    def test_it_fits_and_nothing_is_complained_of(self, name, width, scheme, tab, pages) -> None:
        tab.opened(pages[name], width, scheme)
        assert tab.complaints == []
        assert tab.overflow() == []
        assert min(tab.letters()) >= 12.0
        assert len(tab.text("#title")) > 5
        assert len(tab.text("#advice")) > 20

    def test_it_is_light_or_dark_and_words_stand_out(self, name, width, scheme, tab, pages) -> None:
        tab.opened(pages[name], width, scheme)
        names = ("paper", "ink", "soft", "axis", "wrong")
        colours = {colour: tab.run("return theme(arguments[0])", colour) for colour in names}
        paper = luminance(colours.pop("paper"))
        assert (paper > 0.5) == (scheme == "light")
        for colour, code in colours.items():
            light, dark = sorted((paper, luminance(code)), reverse=True)
            assert (light + 0.05) / (dark + 0.05) >= 4.5, colour  # WCAG 2.2, AA
        corner = pixels(tab, "scene")[2, 2] / 255.0
        assert (corner.mean() > 0.5) == (scheme == "light")

    def test_numbers_at_the_axes_are_on_the_page_and_apart(
        self, name, width, scheme, tab, pages
    ) -> None:
        tab.opened(pages[name], width, scheme)
        words = canvas_words(tab)
        numbers = [text for text, _ in words if re.fullmatch(r"-?[\d.]+(e-?\d+)?", text)]
        assert len(numbers) >= 4
        wide, high = tab.run("return [stage.clientWidth, stage.clientHeight]")
        for text, (left, top, right, bottom) in words:
            assert left >= -1, text
            assert right <= wide + 1, text
            assert top >= -1, text
            assert bottom <= high + 1, text
        for i, (one, a) in enumerate(words):
            for other, b in words[:i]:
                apart = a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1]
                assert apart, (one, other)

    def test_keys_change_the_picture_and_reset_it(self, name, width, scheme, tab, pages) -> None:
        tab.opened(pages[name], width, scheme)
        first = whole(tab)
        for key in ("+", "\N{LATIN SMALL LETTER N}" if name in DOMAINS else RIGHT):
            before = whole(tab)
            tab.press(key)
            assert whole(tab) != before, key
        tab.press("0")
        assert whole(tab) == first
        tab.press(UP)
        assert whole(tab) != first
        assert tab.complaints == []

    def test_the_picture_is_saved(self, name, width, scheme, tab, pages) -> None:
        tab.opened(pages[name], width, scheme)
        tab.run("document.getElementById('save').scrollIntoView()")
        tab.click("#save")
        image = Image.open(io.BytesIO(tab.saved()))
        wide, high = tab.run("return [stage.clientWidth, stage.clientHeight]")
        assert image.size == (wide, high + 34)  # a line for the title
        assert len(image.convert("RGB").getcolors(2**24)) > 20
        assert tab.complaints == []


DOMAINS = ("flat", "nested", "solid")
PROVED = ("carried: proved point", "carried: mirror image of one, checked as well")


def luminance(colour: str) -> float:
    """Relative luminance, as WCAG has it."""
    parts = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def whole(tab: Browser) -> tuple[str, str]:
    return tab.ink("#scene"), tab.ink("#overlay")


def pixels(tab: Browser, canvas: str) -> np.ndarray[Any, Any]:
    """A canvas as it is (height, width, 4)."""
    import base64

    data = tab.ink(f"#{canvas}").split(",")[1]
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA")).astype(float)


WORDS = """
const words = [], own = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  const wide = this.measureText(text).width, tall = 10, ratio = window.devicePixelRatio || 1;
  const left = { left: 0, center: 0.5, right: 1 }[this.textAlign] || 0;
  const above = { top: 0, middle: 0.5, bottom: 1 }[this.textBaseline];
  const corners = [0, 1].flatMap((i) => [0, 1].map((j) => this.getTransform().transformPoint(
    { x: x + (i - left) * wide, y: y + (j - (above === undefined ? 1 : above)) * tall })));
  const [u, v] = ["x", "y"].map((k) => corners.map((c) => c[k] / ratio));
  if (text) words.push([text, [Math.min(...u), Math.min(...v), Math.max(...u), Math.max(...v)]]);
  own.apply(this, arguments);
};
(typeof render === "function" ? render : draw)();
CanvasRenderingContext2D.prototype.fillText = own;
return words;
"""


def canvas_words(tab: Browser) -> list[tuple[str, list[float]]]:
    """Words that are written on the canvases, and where: left, top, right, bottom."""
    return [(text, box) for text, box in tab.run(WORDS)]


# --- the viewer ----------------------------------------------------------------------------------


class TestViewer:
    def test_it_says_in_one_short_sentence_what_the_number_is_worth(self, tab, pages) -> None:
        said = tab.opened(pages["viewer"], 1280, "light").text("#advice")
        assert said == (
            "Certified: between 0.42305 and 0.42306; 115 of 124 moving joints slide: without "
            "dilatancy it may fall at less."
        )

    def test_on_a_phone_the_picture_comes_before_what_the_number_rests_on(self, tab, pages) -> None:
        tab.opened(pages["viewer"], 390, "light")
        assert tab.run("return document.querySelector('header').offsetHeight") < 0.2 * HEIGHTS[390]
        assert "without dilatancy it may fall at less" in tab.text("#advice")
        assert "those that slide" not in tab.text("header")
        tab.click("#more summary")
        assert "those that slide: ground-b1.1" in tab.text("header")
        assert tab.overflow() == []

    @pytest.mark.parametrize("width", HEIGHTS)
    def test_a_block_is_read_where_it_is(self, width: int, tab, pages) -> None:
        """Blocks are found under the pointer by their names, wherever they are drawn."""
        tab.opened(pages["viewer"], width, "light")
        tab.point("#overlay", (0.5, 0.5))
        seen = tip(tab)
        name = seen.split("\n")[0]
        assert name in tab.run("return [...blocks.id, ...contacts.name, 'dead load']") or (
            "load" in name
        )
        tab.point("#overlay", (0.01, 0.01))
        assert tip(tab) == ""

    def test_a_tap_reads_too(self, tab, pages) -> None:
        tab.opened(pages["viewer"], 390, "light")
        tab.point("#overlay", (0.5, 0.4), press=True)
        assert tip(tab) != ""

    def test_dragging_turns_it(self, tab, pages) -> None:
        tab.opened(pages["viewer"], 1280, "light")
        before = tab.run("return camera.azimuth")
        tab.point("#overlay", (0.5, 0.5), (0.6, 0.5), press=True)
        turned = tab.run("return camera.azimuth") - before
        wide = tab.run("return stage.clientWidth")
        assert turned == pytest.approx(-0.008 * 0.1 * wide, abs=0.02)

    def test_views_are_chosen_by_buttons(self, tab, pages) -> None:
        tab.opened(pages["viewer"], 1280, "light")
        shown = {whole(tab)}
        for view in "123":
            tab.click(f"[data-view='{view}']")
            shown.add(whole(tab))
        assert len(shown) == 4

    @pytest.mark.parametrize(("width", "scheme"), VIEWS)
    def test_it_moves_and_stops(self, width: int, scheme: str, tab, pages) -> None:
        tab.opened(pages["viewer"], width, scheme)
        still = whole(tab)
        tab.click("#play")
        assert tab.text("#play") == "Stop"
        seen = {tab.run("return factor") for _ in range(6) if tab.settled() is None}
        assert len(seen) == 6
        assert all(0.0 <= factor <= 1.0 for factor in seen)
        tab.click("#play")
        assert tab.text("#play") == "Animate"
        assert whole(tab) == still
        assert tab.complaints == []

    def test_the_slider_states_the_displacement(self, tab, pages) -> None:
        tab.opened(pages["viewer"], 1280, "light")
        sizes = []
        for share in (0.5, 1.0, 2.0):
            tab.run("const a = document.getElementById('amount'); a.value = arguments[0];"
                    "a.dispatchEvent(new Event('input'))", share)  # fmt: skip
            tab.settled()
            sizes.append(float(re.findall(r"drawn ([\d.]+) m", tab.text("#factor"))[0]))
        assert sizes[1] == pytest.approx(2 * sizes[0], rel=1e-3)
        assert sizes[2] == pytest.approx(2 * sizes[1], rel=1e-3)

    def test_every_entry_of_the_legend_hides_and_shows(self, tab, pages) -> None:
        tab.opened(pages["viewer"], 1280, "light")
        labels = tab.driver.find_elements("css selector", "#legend label")
        switches = [row for row in labels if row.find_elements("css selector", "input")]
        assert len(switches) >= 8
        by_text = {row.text: row for row in switches}
        first = whole(tab)
        for text in ("arrows of loads", "undeformed", "thrust lines", "look inside: contacts only"):
            by_text[text].click()
            tab.settled()
            assert whole(tab) != first, text
            by_text[text].click()
            tab.settled()
            assert whole(tab) == first, text

    def test_arrows_behind_blocks_are_faint(self, tab, tmp_path: Path) -> None:
        """A force on the far side of a wide block: seen from there it is plain."""
        wide = Block.box("wide", (0, 0, 0), (3, 1, 3), density=20.0)
        force = PointForce("wide", (1.5, 1.0, 1.5), (0.0, -1.0, 0.0))
        scene = Scene((Block.box("ground", (-1, -1, -1), (4, 2, 0)), wide), ("ground",),
                      Load(points=[force]))  # fmt: skip
        page = tmp_path / "wide.html"
        page.write_text(plotting.scene_page(scene), "utf-8")
        tab.opened(page, 1280, "light")
        plain = []
        for viewer in ((0.3, -0.9, 0.3), (0.3, 0.9, 0.3)):
            tab.run("data.viewer = arguments[0]; resetCamera(0); render()", viewer)
            over = pixels(tab, "overlay")
            is_live = np.abs(over[..., :3] - [0xC2, 0x18, 0x5B]).max(axis=2) < 30.0
            plain.append(int((is_live & (over[..., 3] > 240.0)).sum()))
        assert plain[0] == 0
        assert plain[1] > 100

    def test_in_a_notebook_s_closed_frame_it_is_read_and_saved(self, tab, tmp_path: Path) -> None:
        cell = solve(builtin_scene("single-block")).plot("page")._repr_html_()
        page = tmp_path / "cell.html"
        head = '<!DOCTYPE html><meta charset="utf-8"><body style="margin: 0">'
        page.write_text(head + cell, "utf-8")
        tab.opened(page, 1280, "light")
        tab.driver.switch_to.frame(0)
        tab.settled()
        tab.point("#overlay", (0.5, 0.5), press=True)
        assert tip(tab) != ""
        tab.click("#save")
        assert Image.open(io.BytesIO(tab.saved())).width > 600
        tab.driver.switch_to.default_content()
        assert tab.complaints == []

    def test_texts_of_a_scene_are_never_markup(self, tab, tmp_path: Path) -> None:
        nasty = '</script><img src=x onerror="document.title=1">'
        block = Block.box(nasty, (0, 0, 0), (1, 1, 2), density=20.0)
        scene = Scene((GROUND, block), ("ground",), PUSH, name=nasty)
        page = tmp_path / "nasty.html"
        page.write_text(solve(scene).plot("page"), "utf-8")
        tab.opened(page, 1280, "light")
        assert tab.complaints == []
        assert tab.run("return document.images.length") == 0
        assert nasty in tab.run("return document.title")


# --- load domains --------------------------------------------------------------------------------


def _leaning() -> tuple[Scene, Any]:
    """A block that leans on a wall at its back."""
    behind = Block.box("behind", (-1, 0, 0), (0, 1, 2))
    return Scene((GROUND, behind, LEFT), ("ground", "behind"), PUSH, friction=0.5), None


def _pressed() -> tuple[Scene, Any]:
    """A block on a slope it slides down, unless it is pressed: the dead load is not in the set."""
    slope = Load(gravity=(0.5, 0.0, -np.sqrt(0.75)))
    scene = Scene((GROUND, LEFT), ("ground",), PUSH, slope, friction=0.3)
    return scene, {"push": PUSH, "force": Load(forces={"left": (0, 0, -3, 0, 0, 0)})}


def _flat() -> tuple[Scene, Any]:
    """Without friction weight may be added, and nothing else."""
    scene = Scene((GROUND, LEFT), ("ground",), PUSH, friction=0.0)
    return scene, {"push": PUSH, "weight": Load(acceleration=(0, 0, -1))}


SETS = {"tuff wall": lambda: (builtin_scene("tuff-wall"), None), "leaning": _leaning,
        "pressed": _pressed, "flat": _flat}  # fmt: skip


class TestDomain:
    @pytest.mark.parametrize("width", HEIGHTS)
    def test_places_are_read_by_keys(self, width: int, tab, pages) -> None:
        """A block rocks at 0.4: so far along x it is carried, and ruled out beyond."""
        tab.opened(pages["flat"], width, "light")
        carried, beyond = 0.0, np.inf
        for _ in range(25):
            tab.run("document.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'}))")
            said = tip(tab)
            x = float(re.findall(r"a_x\s+(-?[\d.]+)", said)[0])
            if said.endswith("ruled out"):
                beyond = x
                break
            carried = x
        assert carried < 0.4 < beyond
        assert beyond - carried < 0.05
        assert tab.complaints == []

    def test_places_are_read_under_the_pointer(self, tab, pages) -> None:
        """Where the axes' numbers say they are."""
        tab.opened(pages["flat"], 1280, "light")
        left, _, right, _ = next(box for text, box in canvas_words(tab) if text == "0.2")
        across = 0.5 * (left + right) / tab.run("return stage.clientWidth")
        tab.point("#overlay", (across, 0.45))
        assert tip(tab).endswith("carried")
        assert float(re.findall(r"a_x\s+(-?[\d.]+)", tip(tab))[0]) == pytest.approx(0.2, abs=0.01)
        tab.point("#overlay", (across, 0.03))
        assert float(re.findall(r"a_y\s+(-?[\d.]+)", tip(tab))[0]) > 0.4
        assert tip(tab).endswith("ruled out")

    @pytest.mark.parametrize("name", ["flat", "solid"])
    def test_proved_points_are_stepped_through(self, name: str, tab, pages) -> None:
        tab.opened(pages[name], 1280, "light")
        known = np.array(tab.run("return framed.map((s) => s.at)"))
        read = []
        for _ in range(len(known)):
            tab.run("document.dispatchEvent(new KeyboardEvent('keydown', {key: 'n'}))")
            said = tip(tab)
            assert said.rpartition("\n")[2] in PROVED
            read.append([float(line.split()[-1]) for line in said.split("\n")[:-1]])
        np.testing.assert_allclose(read, known, rtol=1e-3, atol=1e-9)

    def test_zooming_in_gives_finer_numbers(self, tab, pages) -> None:
        tab.opened(pages["flat"], 1280, "light")
        steps = []
        for _ in range(2):
            numbers = sorted({float(text) for text, _ in canvas_words(tab) if text[-1].isdigit()})
            steps.append(np.diff(numbers).min())
            tab.press(*"++++++++++")
        assert steps[1] < 0.5 * steps[0]

    def test_several_domains_are_told_apart(self, tab, pages) -> None:
        tab.opened(pages["nested"], 1280, "light")
        tab.press(RIGHT)
        lines = tip(tab).split("\n")
        assert lines[2:] == ["conic: carried", "octagon: carried"]

    @pytest.mark.parametrize("name", SETS)
    def test_far_outside_the_frame_it_says_what_the_domain_and_a_solve_say(
        self, name: str, tab, tmp_path: Path
    ) -> None:
        """Twenty random directions, at a third of a frame, one, ten and a thousand: what a solve
        with these loads beside the dead load says stands, four of them under the pointer itself."""
        scene, loads = SETS[name]()
        domain = load_domain(scene, loads, 0.01, progress=False)
        page = tmp_path / "set.html"
        domain.plot(str(page))
        tab.opened(page, 1280, "light")
        size, rng, agreed = np.abs(domain.frame).max(axis=0), np.random.default_rng(54), 0
        words = {"carried": "carried", "not carried": "ruled out", "open": "between: not decided"}
        for k, way in enumerate(rng.normal(size=(20, 2)) * size):
            if domain.contains((0, 0)) == "carried":
                found = solve(scene.with_live(combined(list(domain.loads.values()), way)))
                is_unbounded = str(domain.load_factor(way)) == "unbounded"
                has_no_limit = found.status in (Status.LIVE_LOAD_HARMLESS, Status.UNBOUNDED)
                assert is_unbounded == has_no_limit  # a domain is one of dilatancy
            for at in np.multiply.outer([0.3, 1.0, 10.0, 1e3], way):
                said = domain.contains(at)
                assert tab.run("return describe(arguments[0])", at.tolist()).endswith(words[said])
                load = combined([scene.dead, *domain.loads.values()], [1.0, *at])
                found = solve(replace(scene, dead=load))
                stands = found.status is not Status.DEAD_LOAD_UNSTABLE and found.interval is None
                agreed += said == ("carried" if stands else "not carried")
                assert said in ("open", "carried" if stands else "not carried"), at
            if k < 4:
                tab.run("camera.zoom = arguments[0]; draw()", 0.05)
                at = (5.0 * way).tolist()
                x, y, _ = tab.run("return projection().to(arguments[0])", at)
                wide, high = tab.run("return [stage.clientWidth, stage.clientHeight]")
                tab.point("#overlay", (x / wide, y / high))
                read = np.array([float(line.split()[-1]) for line in tip(tab).split("\n")[:2]])
                assert np.abs(read - at).max() < 0.05 * np.abs(at).max()
                assert tip(tab).split("\n")[-1] == words[domain.contains(read)]
        assert agreed >= 76  # of 80: few places are left open
        assert tab.complaints == []

    def test_no_line_closes_what_goes_on(self, tab, tmp_path: Path) -> None:
        """The left of a tuff wall's domain has no end: as far as the page shows, now or later,
        there is the same colour up to its edge, and no line along it."""
        page = tmp_path / "open.html"
        load_domain(builtin_scene("tuff-wall"), progress=False).plot(str(page))
        for zoom in (1.0, 0.1, 0.01):
            tab.opened(page, 1280, "light")
            tab.run("camera.zoom = arguments[0]; draw()", zoom)
            left, foot = (round(x) for x in tab.run(
                "const v = projection(); return [v.frame[0], v.to([0, 0])[1]]"))  # fmt: skip
            row = pixels(tab, "scene")[foot - 5, left + 1 : left + 12, :3]
            assert np.ptp(row, axis=0).max() == 0.0
            assert row.mean() < 240.0

    def test_a_solid_is_turned(self, tab, pages) -> None:
        tab.opened(pages["solid"], 390, "dark")
        shown = {whole(tab)}
        for view in "123":
            tab.press(view)
            shown.add(whole(tab))
        tab.point("#overlay", (0.4, 0.4), (0.7, 0.6), press=True)
        shown.add(whole(tab))
        assert len(shown) == 5


# --- a path ---------------------------------------------------------------------------------------


class TestPath:
    def test_blocks_are_where_the_configuration_at_the_slider_has_them(self, tab, pages) -> None:
        path = turning(wall(3), ANGLES)
        tab.opened(pages["path"], 1280, "light")
        mesh = drawn_mesh(path.scene)
        for k, each in enumerate(path):
            script = (
                "el('amount').value = arguments[0]; el('amount').dispatchEvent(new Event('input'));"
            )
            ways = tab.run(script + "return Array.from(moved)", k)
            there = moved_by(path.scene, each.displacements).rates
            there = points_moved(path.scene, there, mesh.points, mesh.point_block)
            np.testing.assert_allclose(np.reshape(ways, (-1, 3)), there - mesh.points, atol=1e-6)
            assert f"load factor {each.load_factor:.5f}" in tab.text("#factor")

    def test_it_runs_through_the_path_and_stops_where_the_slider_is(self, tab, pages) -> None:
        tab.opened(pages["path"], 1280, "light")
        still = whole(tab), tab.ink("#curve")
        tab.click("#play")
        seen = {tab.text("#factor") for _ in range(8) if tab.settled() is None}
        assert len(seen) > 3
        tab.click("#play")
        assert (whole(tab), tab.ink("#curve")) == still
        assert tab.complaints == []
