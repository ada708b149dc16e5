"""Fixtures of the screen tests: a page in a real browser."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.common.exceptions import JavascriptException, NoSuchElementException, StaleElementReferenceException
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import WebDriverWait

from lobewatch.screen import ScreenServer

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --autoplay-policy=user-gesture-required"
)
COUNT_TONES = """
window.tones = [];
const made = AudioContext.prototype.createOscillator;
AudioContext.prototype.createOscillator = function () {
  const tone = made.call(this);
  const start = tone.start;
  tone.start = function (at) { window.tones.push(tone.frequency.value); return start.call(tone, at); };
  return tone;
};
"""
KEEP_TEXTS = """
window.texts = {};
new MutationObserver(() => {
  for (const id of ["text", "reason", "stop-text", "toast", "unit"]) {
    const kept = (window.texts[id] ??= []), text = document.getElementById(id)?.textContent;
    if (text && text !== kept.at(-1)) kept.push(text);
  }
}).observe(document, { childList: true, characterData: true, subtree: true });
"""
"""Keeps every text of these parts: some are there for a moment, which a slow computer may miss."""
IS_READY = "document.readyState === 'complete' && location.href !== 'about:blank'"
AFTER_LAYOUT = "const ready = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => ready()))"
PATIENCE = 60.0
"""Time after which a page is given up (s): far more than it needs on any computer."""
AXE = Path(__file__).parents[2] / "data" / "axe_core" / "axe.min.js"
Session = Any
"""ScriptedSession of tests/conftest.py."""


class Browser:
    """Chromium on one page."""

    def __init__(self) -> None:
        options = webdriver.ChromeOptions()
        for flag in FLAGS.split():
            options.add_argument(flag)
        options.binary_location = CHROMIUM or ""
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=Service(DRIVER))
        self.driver.set_script_timeout(PATIENCE)
        for script in (COUNT_TONES, KEEP_TEXTS):
            self.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})

    def open(self, url: str, size: tuple[int, int] = (1280, 800), scheme: str = "light") -> None:
        """Open a page in a window of this size, with an empty profile, and wait until it is loaded and laid out."""
        self.prefer(scheme)
        self.driver.execute_cdp_cmd(
            "Storage.clearDataForOrigin", {"origin": url.partition("/#")[0], "storageTypes": "all"}
        )
        self.resize(size)
        self.driver.get("about:blank")
        self.log("browser")
        self.log("performance")
        self.driver.get(url)
        self.wait_until_ready(size)

    def reload(self) -> None:
        """Load the page again, and wait until it is laid out."""
        self.driver.refresh()
        self.wait_until_ready()

    def wait_until_ready(self, size: tuple[int, int] | None = None) -> None:
        """Wait until the page is loaded with its scripts, has this size, and is laid out."""
        self.wait(lambda: self.ask(IS_READY))
        self.wait(lambda: size is None or self.ask("[innerWidth, innerHeight]") == list(size))
        self.driver.execute_async_script(AFTER_LAYOUT)

    def resize(self, size: tuple[int, int]) -> None:
        """Give the window this size, and wait until the page is laid out in it."""
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.wait(lambda: self.ask("[innerWidth, innerHeight]") == list(size))
        self.driver.execute_async_script(AFTER_LAYOUT)

    def prefer(self, scheme: str, media: str = "") -> None:
        """Set the color scheme ("light" or "dark") and the medium ("print")."""
        wish = {"name": "prefers-color-scheme", "value": scheme}
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media, "features": [wish]})
        state = f"[matchMedia('(prefers-color-scheme: {scheme})').matches, matchMedia('print').matches]"
        self.wait(lambda: self.ask(state) == [True, media == "print"])
        self.driver.execute_async_script(AFTER_LAYOUT)

    def part(self, name: str) -> WebElement:
        return self.driver.find_element(By.ID, name)

    def wait(self, what: Callable[[], object]) -> None:
        """Wait until this is true; a part that is replaced meanwhile is looked at again."""
        changing = (JavascriptException, NoSuchElementException, StaleElementReferenceException)
        WebDriverWait(self.driver, PATIENCE, 0.02, changing).until(lambda _: what())

    def see(self, name: str, text: str) -> None:
        """Wait until a part of the page shows this text."""
        self.wait(lambda: text in self.part(name).text)

    def saw(self, name: str, text: str) -> None:
        """Wait until a part of the page has shown this text since it was loaded, if only for a moment."""
        self.wait(lambda: any(text in shown for shown in self.ask("window.texts")[name]))

    def press(self, *keys: str) -> None:
        ActionChains(self.driver).send_keys(*keys).perform()

    def ask(self, script: str) -> Any:
        return self.driver.execute_script(f"return {script}")

    def broken_rules(self) -> list[tuple[str, str]]:
        """Rules of accessibility that the page breaks, contrast among them, each with an element that does."""
        self.driver.execute_script(AXE.read_text("utf-8"))
        answer = self.driver.execute_async_script("axe.run().then(arguments[0])")
        assert "color-contrast" in [rule["id"] for rule in answer["passes"]]
        return [(rule["id"], rule["nodes"][0]["html"]) for rule in answer["violations"]]

    def log(self, kind: str) -> list[dict[str, Any]]:
        """Return new entries of a log of the browser."""
        return list(self.driver.execute("getLog", {"type": kind})["value"])

    def complaints(self) -> list[str]:
        """Errors of the page, but for the server that is gone at the end of a test."""
        errors = [entry["message"] for entry in self.log("browser") if entry["level"] == "SEVERE"]
        return [error for error in errors if "ERR_CONNECTION_REFUSED" not in error]

    def requested(self) -> set[str]:
        """Addresses of all requests."""
        messages = [json.loads(entry["message"])["message"] for entry in self.log("performance")]
        sent = [
            m["params"] for m in messages if m["method"] in ("Network.requestWillBeSent", "Network.webSocketCreated")
        ]
        urls = {one.get("url") or one["request"]["url"] for one in sent}
        return {"/".join(url.replace("ws:", "http:").split("/")[:3]) for url in urls}


@pytest.fixture(scope="module")
def opened() -> Iterator[Browser]:
    """Start a browser; skip without one, except in continuous integration."""
    if not (CHROMIUM and DRIVER) and "CI" not in os.environ:
        pytest.skip("chromium and chromedriver are not installed")
    browser = Browser()
    yield browser
    browser.driver.quit()


@pytest.fixture
def browser(opened: Browser) -> Iterator[Browser]:
    """Return a browser whose page must not log errors."""
    yield opened
    assert opened.complaints() == []


@pytest.fixture
def server(session: Session) -> Iterator[ScreenServer]:
    with ScreenServer(session) as running:
        yield running
