"""Pages in a real browser, headless Chromium, or why they are not tried.

A test file opens one session for all its tests:

    @pytest.fixture(scope="module")
    def browser() -> Iterator[Browser]:
        with browser_session() as session:
            yield session
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

PATIENCE = 60.0  # seconds that a busy machine may take to load or to draw something
HOW_TO_INSTALL = "on Debian, apt-get install chromium chromium-driver (make test does it)"
SETTLED = "return document.readyState === 'complete' && document.fonts.status === 'loaded'"
ALWAYS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--mute-audio",
    "--autoplay-policy=no-user-gesture-required",
    "--disable-background-networking",
)
SOFTWARE_3D = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_3D = ("--disable-gpu", "--disable-3d-apis")

# Elements that a reader sees only in part, as `main > div.wide > table`: what sticks out of the page to the
# left or right, and what holds more than it shows. What scrolls counts, unless it may (`scrollers`).
OVERFLOWING = """
const page = document.documentElement.clientWidth, may = arguments[0], found = [];
const name = e => e.tagName.toLowerCase() + [...e.classList].map(c => '.' + c).join('');
for (const e of document.body.querySelectorAll('*')) {
  const box = e.getBoundingClientRect(), kept = may && e.closest(may);
  if (!box.width || !box.height || e.closest('svg, [hidden]')) continue;
  const style = getComputedStyle(e), inline = style.display === 'inline';
  const cut = !inline && style.overflowX !== 'visible' && e.scrollWidth > e.clientWidth + 1;
  const out = !kept && (box.right > page + 1 || box.left < -1);
  if (out || (cut && !(may && e.matches(may)))) {
    found.push(`${name(e.parentElement)} > ${name(e)}: ${Math.round(box.left)} to ${Math.round(box.right)}, `
      + `holds ${e.scrollWidth} in ${e.clientWidth}`);
  }
}
return found;
"""


class Browser:
    """A session of Chromium, and what tests ask of a page in it."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def run(self, script: str, *arguments: Any) -> Any:
        """Run JavaScript in the page; its `return` is the result, elements among it."""
        return self.driver.execute_script(script, *arguments)

    def resize(self, width: int, height: int = 900) -> None:
        """Give the page this size in CSS pixels, smaller than a window can be too."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        self.wait_for(f"return innerWidth === {width} && innerHeight === {height}")

    def prefer(self, scheme: str) -> None:
        """Ask pages for their "dark" or "light" theme."""
        wish = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", wish)

    def open(self, page: Path) -> None:
        """Load a file, until its pictures are there; the log of the page before it is forgotten."""
        self.driver.get_log("browser")
        self.driver.get(page.resolve().as_uri())
        self.wait_for(SETTLED)

    def wait_for(self, condition: str | Callable[[], Any], *arguments: Any) -> Any:
        """Wait until a script (with its `return`) or a function gives something true, and return that."""
        ask = condition if callable(condition) else lambda: self.run(condition, *arguments)
        said = f"this did not become true within {PATIENCE:g} s: {condition}"
        return WebDriverWait(self.driver, PATIENCE, poll_frequency=0.05).until(lambda _: ask(), said)

    def errors(self) -> list[str]:
        """Return what the page complained of since the last time: errors, and what could not be loaded."""
        return [e["message"] for e in self.driver.get_log("browser") if e["level"] in ("SEVERE", "WARNING")]

    def overflowing(self, scrollers: str = "") -> list[str]:
        """Return the elements that are seen only in part; `scrollers` (CSS) may hold more than they show."""
        return list(self.run(OVERFLOWING, scrollers))


@contextmanager
def browser_session(*, webgl: bool = True, size: tuple[int, int] = (1100, 900)) -> Iterator[Browser]:
    """Open one headless Chromium, which ends whatever happens; skip the test where there is none.

    Parameters
    ----------
    webgl : bool
        Whether pages may draw with WebGL (on the processor, by SwiftShader).
    size : (int, int)
        Width and height of a page, in CSS pixels.
    """
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if browser is None or driver is None:
        pytest.skip(f"pages are not tried in a browser: {HOW_TO_INSTALL}")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for argument in (*ALWAYS, *(SOFTWARE_3D if webgl else NO_3D)):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    session = webdriver.Chrome(options=options, service=Service(driver))
    try:
        session.set_page_load_timeout(PATIENCE)
        session.set_script_timeout(PATIENCE)
        page = Browser(session)
        page.resize(*size)
        yield page
    finally:
        session.quit()
