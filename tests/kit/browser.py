"""A real browser for the interactive pages: Chromium without a window, driven by Selenium."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip

HEIGHTS = {390: 844, 1280: 800}
"""Of the windows that are tried, by width: a phone and a laptop."""

VIEWS = [(width, scheme) for width in HEIGHTS for scheme in ("light", "dark")]

RIGHT, UP = "\ue014", "\ue013"
"""Arrow keys, as WebDriver calls them."""

PATIENCE = 30.0
"""Seconds after which a page that does not do what it should has failed."""


OVERFLOW = """
const root = document.documentElement, found = [];
if (root.scrollWidth > root.clientWidth) found.push("the page scrolls sideways");
for (const e of document.body.querySelectorAll("*")) {
  const box = e.getBoundingClientRect(), name = e.tagName + "#" + e.id;
  const beyond = box.width && (box.right > root.clientWidth + 0.5 || box.left < -0.5);
  if (beyond) found.push(name + " reaches beyond the window");
  const holdsWords = ["H1", "H2", "P", "BUTTON", "LABEL"].includes(e.tagName);
  if (holdsWords && e.scrollWidth > e.clientWidth + 1) found.push(name + " is too narrow");
}
return found;"""

LETTERS = """
const sizes = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walk.nextNode()) {
  const e = walk.currentNode.parentElement, words = walk.currentNode.data.trim();
  if (!words || ["SCRIPT", "STYLE"].includes(e.tagName) || !e.getClientRects().length) continue;
  const svg = e.ownerSVGElement;  // whose letters shrink with it
  const share = svg ? svg.getBoundingClientRect().width / svg.viewBox.baseVal.width : 1;
  sizes.push(share * parseFloat(getComputedStyle(e).fontSize));
}
return sizes;"""


class Browser:
    """One tab. ``opened`` shows a page in a window and a colour scheme; what a page complains of
    is in ``complaints``."""

    def __init__(self, driver: Any, downloads: Path) -> None:
        self.driver, self.downloads = driver, downloads

    def opened(self, page: Path, width: int, scheme: str) -> Browser:
        command = self.driver.execute_cdp_cmd
        size = {"width": width, "height": HEIGHTS[width], "deviceScaleFactor": 1, "mobile": False}
        command("Emulation.setDeviceMetricsOverride", size)
        wanted = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        command("Emulation.setEmulatedMedia", wanted)
        command("Browser.setDownloadBehavior",
                {"behavior": "allow", "downloadPath": str(self.downloads)})  # fmt: skip
        self.driver.get_log("browser")
        self.driver.get(page.as_uri())
        self.settled()
        return self

    def settled(self) -> None:
        """Two frames later, and a quarter of a second: pages draw finely after a fifth."""
        self.driver.execute_async_script(
            "const done = arguments[0]; setTimeout(() => requestAnimationFrame(() => "
            "requestAnimationFrame(() => done())), 250);"
        )

    def run(self, script: str, *given: Any) -> Any:
        return self.driver.execute_script(script, *given)

    def until(self, holds: Callable[[], Any]) -> Any:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if found := holds():
                return found
            time.sleep(0.05)
        raise AssertionError(f"the page did not do so in {PATIENCE:g} s")

    @property
    def complaints(self) -> list[str]:
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def text(self, selector: str) -> str:
        return str(self.run("return document.querySelector(arguments[0]).innerText", selector))

    def press(self, *keys: str) -> None:
        """Keys as a keyboard sends them, wherever the focus is."""
        from selenium.webdriver import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()
        self.settled()

    def click(self, selector: str) -> None:
        self.driver.find_element("css selector", selector).click()
        self.settled()

    def point(self, selector: str, *places: tuple[float, float], press: bool = False) -> None:
        """Move the pointer over places in an element, in shares of its size; with a button held
        from the first to the last of them, where it is to press."""
        from selenium.webdriver import ActionChains

        x, y, w, h = self.run(
            "const b = document.querySelector(arguments[0]).getBoundingClientRect();"
            "return [b.left, b.top, b.width, b.height]", selector,
        )  # fmt: skip
        actions = ActionChains(self.driver, duration=0).w3c_actions
        for step, (right, down) in enumerate(places):
            actions.pointer_action.move_to_location(round(x + right * w), round(y + down * h))
            if press and step == 0:
                actions.pointer_action.pointer_down()
        if press:
            actions.pointer_action.pointer_up()
        actions.perform()
        self.settled()

    def ink(self, selector: str) -> str:
        """A canvas as it is, as a data URL: two that differ are two pictures."""
        script = "return document.querySelector(arguments[0]).toDataURL()"
        return str(self.run(script, selector))

    def overflow(self) -> list[str]:
        """Elements that reach beyond the window's width, or whose words do not fit into them."""
        found: list[str] = self.run(OVERFLOW)
        return found

    def letters(self) -> list[float]:
        """Sizes in pixels of all words that are shown."""
        found: list[float] = self.run(LETTERS)
        return found

    def saved(self) -> bytes:
        """The file that a page has just saved."""

        def whole() -> list[Path]:
            return [p for p in self.downloads.iterdir() if p.suffix == ".png"]

        (file,) = self.until(whole)
        content = file.read_bytes()
        file.unlink()
        return content


@contextmanager
def browser() -> Iterator[Browser]:
    """Skips where there is none: Debian has it as ``chromium`` and ``chromium-driver``."""
    webdriver = pytest.importorskip("selenium.webdriver")
    programs = shutil.which("chromium"), shutil.which("chromedriver")
    if None in programs:
        pytest.skip("needs chromium and chromedriver")
    with TemporaryDirectory(prefix="cvxlimit-browser-") as folder:
        options = webdriver.ChromeOptions()
        options.binary_location = programs[0]
        for option in (*OPTIONS, f"--user-data-dir={folder}/profile"):
            options.add_argument(option)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        downloads = Path(folder) / "downloads"
        downloads.mkdir()
        driver = webdriver.Chrome(options, webdriver.ChromeService(programs[1]))
        try:
            yield Browser(driver, downloads)
        finally:
            driver.quit()
