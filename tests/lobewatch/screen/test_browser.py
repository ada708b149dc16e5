"""The screen in a real browser, by real keys and clicks."""

from __future__ import annotations

import functools
import json
import os
import shutil
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import WebDriverWait

from acquisition import Circumstances, HammeredStructure, HitFlags, TapsEmulator, TapsSource
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.new_folder import make_machine_folder
from lobewatch.screen import DashboardServer, ScreenServer
from lobewatch.tap.emulated_spindle import CHANNELS, SAMPLE_RATE
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import Word

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --autoplay-policy=user-gesture-required"
)
SIZES = ((1280, 800), (1920, 1080), (820, 1180))
ESSENTIALS = ("text", "good", "reason", "undo", "mute", "stop", "frf", "coherence", "force", "change", "taken")
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
Session = Any
"""ScriptedSession of conftest.py."""

pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER) and "CI" not in os.environ, reason="chromium and chromedriver are not installed"
)


class Browser:
    """Chromium on one page."""

    def __init__(self) -> None:
        options = webdriver.ChromeOptions()
        for flag in FLAGS.split():
            options.add_argument(flag)
        options.binary_location = CHROMIUM or ""
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=Service(DRIVER))
        self.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": COUNT_TONES})

    def open(self, url: str, size: tuple[int, int] = SIZES[0]) -> None:
        """A page in a window of this size, with nothing remembered."""
        self.driver.execute_cdp_cmd(
            "Storage.clearDataForOrigin", {"origin": url.partition("/#")[0], "storageTypes": "all"}
        )
        self.resize(size)
        self.driver.get("about:blank")
        self.log("browser")
        self.log("performance")
        self.driver.get(url)

    def resize(self, size: tuple[int, int]) -> None:
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def part(self, name: str) -> WebElement:
        return self.driver.find_element(By.ID, name)

    def wait(self, what: Callable[[], object]) -> None:
        WebDriverWait(self.driver, 20, 0.02).until(lambda _: what())

    def see(self, name: str, text: str) -> None:
        """Wait until a part of the page shows this text."""
        self.wait(lambda: text in self.part(name).text)

    def press(self, *keys: str) -> None:
        ActionChains(self.driver).send_keys(*keys).perform()

    def ask(self, script: str) -> Any:
        return self.driver.execute_script(f"return {script}")

    def log(self, kind: str) -> list[dict[str, Any]]:
        """New entries of a log of the browser."""
        return list(self.driver.execute("getLog", {"type": kind})["value"])

    def complaints(self) -> list[str]:
        """Errors of the page, but for the server that is gone at the end of a test."""
        errors = [entry["message"] for entry in self.log("browser") if entry["level"] == "SEVERE"]
        return [error for error in errors if "ERR_CONNECTION_REFUSED" not in error]

    def requested(self) -> set[str]:
        """Where requests went to."""
        messages = [json.loads(entry["message"])["message"] for entry in self.log("performance")]
        sent = [
            m["params"] for m in messages if m["method"] in ("Network.requestWillBeSent", "Network.webSocketCreated")
        ]
        urls = {one.get("url") or one["request"]["url"] for one in sent}
        return {"/".join(url.replace("ws:", "http:").split("/")[:3]) for url in urls}


@pytest.fixture(scope="module")
def opened() -> Iterator[Browser]:
    browser = Browser()
    yield browser
    browser.driver.quit()


@pytest.fixture
def browser(opened: Browser) -> Iterator[Browser]:
    """A browser whose page must not complain."""
    yield opened
    assert opened.complaints() == []


@pytest.fixture
def server(session: Session) -> Iterator[ScreenServer]:
    with ScreenServer(session) as running:
        yield running


def test_the_word_counter_and_reason_follow_the_test(browser: Browser, session: Session, server: ScreenServer) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    session.check()
    browser.see("passed", "3 of 4 passed")
    browser.see("checks", "noise floor: 4.1 N rms")
    session.show(Word.TAP, reason="Hit now.")
    browser.see("text", "TAP")
    browser.see("reason", "Hit now.")
    session.hit()
    browser.see("text", "GOOD")
    browser.see("good", "1")
    browser.see("change", "One good hit")
    session.hit(HitFlags.DOUBLE_HIT, "Second peak 12 ms after the first (18 %): let the hammer bounce back.")
    browser.see("text", "DOUBLE HIT")
    browser.see("reason", "let the hammer bounce back")
    browser.see("hits", "double hit")
    for _ in range(8):
        session.hit()
    browser.see("change", "has settled")
    session.show(Word.NO_DEVICE, reason="Plug it in.")
    browser.see("text", "NO DEVICE")
    session.hit()
    session.finish()
    browser.see("text", "DONE")
    browser.see("light", "WARNING")
    assert [lamp.text for lamp in browser.driver.find_elements(By.CSS_SELECTOR, "#light .on")] == ["! WARNING"]
    browser.see("texts", "f_1 1688.20 ± 0.12 Hz")
    browser.see("next", "Tap again in 14 days")


def test_nothing_is_asked_of_another_server(browser: Browser, session: Session, server: ScreenServer) -> None:
    browser.open(server.url)
    session.hit()
    browser.see("text", "GOOD")
    assert browser.requested() == {server.origin}


def test_the_token_leaves_the_address_and_a_reload_keeps_it(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    assert browser.driver.current_url == f"{server.origin}/"
    browser.driver.refresh()
    browser.see("text", "CHECKING")


def test_without_the_token_the_page_says_which_address_to_open(opened: Browser, server: ScreenServer) -> None:
    opened.open(f"{server.origin}/")
    opened.see("reason", "address that lobewatch printed")
    assert opened.part("text").text == "NO CONNECTION"
    opened.complaints()


@pytest.mark.parametrize("key", ["u", "U", Keys.PAGE_UP])
def test_undo_by_key(browser: Browser, session: Session, server: ScreenServer, key: str) -> None:
    session.hit()
    session.hit()
    browser.open(server.url)
    browser.see("good", "2")
    browser.press(key)
    assert session.undone.wait(10)
    browser.see("good", "1")
    assert len(browser.driver.find_elements(By.CSS_SELECTOR, "#hits .undone")) == 1


def test_a_key_held_down_or_with_control_undoes_nothing_more(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    for _ in range(3):
        session.hit()
    browser.open(server.url)
    browser.see("good", "3")
    ActionChains(browser.driver).key_down(Keys.CONTROL).send_keys("u").key_up(Keys.CONTROL).perform()
    for repeated in (False, True, True):
        event = {"type": "keyDown", "key": "u", "code": "KeyU", "text": "u", "autoRepeat": repeated}
        browser.driver.execute_cdp_cmd("Input.dispatchKeyEvent", event)
    browser.see("good", "2")
    session.show(Word.TAP, reason="still two")
    browser.see("reason", "still two")
    assert session.state.good == 2


@pytest.mark.parametrize("size", [SIZES[0], SIZES[2]])
def test_undo_by_the_large_button(
    browser: Browser, session: Session, server: ScreenServer, size: tuple[int, int]
) -> None:
    session.hit()
    browser.open(server.url, size)
    browser.see("good", "1")
    assert browser.part("undo").size["height"] >= 60
    browser.part("undo").click()
    assert session.undone.wait(10)
    browser.see("good", "0")
    browser.wait(lambda: not browser.part("undo").is_enabled())


def test_what_cannot_be_undone_is_said(opened: Browser, session: Session, server: ScreenServer) -> None:
    session.hit()
    session.refusal = "this hit is too old to take back"
    opened.open(server.url)
    opened.see("good", "1")
    opened.press("u")
    opened.see("toast", "this hit is too old to take back")
    assert all("409" in complaint for complaint in opened.complaints())


def test_escape_stops_only_when_pressed_twice(browser: Browser, session: Session, server: ScreenServer) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    browser.press(Keys.ESCAPE)
    browser.see("stop-text", "Again to stop")
    assert not session.stopped.is_set()
    browser.press(Keys.ESCAPE)
    assert session.stopped.wait(10)


def sounded(browser: Browser, tones: list[float]) -> bool:
    """Whether these and no other tones (Hz) were played."""
    return bool(browser.ask("tones") == tones)


def test_every_verdict_has_its_sound_and_m_mutes_it_for_good(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    assert browser.part("sound").text == "Sound: press any key"
    browser.press("x")
    browser.see("sound", "Sound on")
    tones: list[float] = []
    for show, word, new in (
        (session.hit, "GOOD", [1320]),
        (lambda: session.hit(HitFlags.TOO_SOFT), "TOO SOFT", [220, 220]),
        (lambda: session.show(Word.NO_DEVICE), "NO DEVICE", [160]),
        (session.finish, "DONE", [660, 880, 1320]),
    ):
        show()
        tones += new
        browser.see("text", word)
        browser.wait(functools.partial(sounded, browser, [*tones]))
    browser.press("m")
    browser.see("sound", "Sound off")
    session.hit()
    browser.see("text", "GOOD")
    assert browser.ask("tones") == tones
    browser.driver.refresh()
    browser.see("text", "GOOD")
    assert browser.part("sound").text == "Sound off"
    browser.part("mute").click()
    browser.see("sound", "Sound on")


def test_a_verdict_in_two_pictures_sounds_once_and_one_after_another_twice(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    browser.press("x")
    session.show(Word.GOOD)
    browser.see("text", "GOOD")
    session.hit()
    browser.see("good", "1")
    assert browser.ask("tones") == [1320]
    session.hit()
    browser.see("good", "2")
    assert browser.ask("tones") == [1320, 1320]


def test_a_lost_server_is_said_and_found_again(opened: Browser, session: Session) -> None:
    session.show(Word.TAP)
    with ScreenServer(session) as server:
        opened.open(server.url)
        opened.see("text", "TAP")
    opened.see("text", "ENDED")
    assert not opened.part("undo").is_enabled()
    port = int(server.origin.rpartition(":")[2])
    with ScreenServer(session, port=port, token=server.token):
        opened.see("text", "TAP")
    opened.complaints()


def test_a_silent_server_is_no_connection(opened: Browser, session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lobewatch.screen.feed.SIGN_OF_LIFE", 1e9)
    session.show(Word.TAP)
    with ScreenServer(session) as server:
        opened.open(server.url)
        opened.see("text", "TAP")
        opened.see("text", "NO CONNECTION")
        opened.see("text", "TAP")
    opened.complaints()


def test_the_last_picture_stays_when_lobewatch_has_ended(opened: Browser, session: Session) -> None:
    with ScreenServer(session) as server:
        opened.open(server.url)
        opened.see("text", "CHECKING")
        session.finish()
    opened.see("device", "lobewatch has ended")
    assert opened.part("text").text == "DONE"
    opened.complaints()


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_everything_needed_is_in_sight_without_scrolling(
    browser: Browser, session: Session, server: ScreenServer, size: tuple[int, int]
) -> None:
    session.check()
    for _ in range(4):
        session.hit()
    session.hit(HitFlags.DOUBLE_HIT | HitFlags.OVERLOAD_RESPONSE, "Let the hammer bounce back. " * 4)
    browser.open(server.url, size)
    browser.see("text", "OVERLOAD (RESPONSE)")
    assert browser.ask("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]") == list(size)
    for name in ESSENTIALS:
        box = browser.part(name).rect
        assert box["x"] >= 0, name
        assert box["y"] >= 0, name
        assert box["x"] + box["width"] <= size[0], name
        assert box["y"] + box["height"] <= size[1], name
        assert box["height"] >= 16, name
    session.show(Word.TAP)
    browser.see("text", "TAP")
    assert browser.part("text").rect["height"] >= 0.09 * size[1]


def test_text_has_a_contrast_of_seven_to_one(browser: Browser, session: Session, server: ScreenServer) -> None:
    browser.open(server.url)
    for word in Word:
        session.show(word)
        browser.see("text", word.value)
        colours = browser.ask(
            "['color', 'backgroundColor'].map((name) => getComputedStyle(document.getElementById('now'))[name])"
        )
        assert contrast(*colours) >= 7, (word, colours)


def contrast(*colours: str) -> float:
    """Of WCAG 2.2, from two CSS colours rgb(r, g, b)."""
    lights = []
    for colour in colours:
        shares = [int(part) / 255 for part in colour.partition("(")[2].rstrip(")").split(",")[:3]]
        linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
        lights.append(0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2])
    return (max(lights) + 0.05) / (min(lights) + 0.05)


def test_the_word_is_told_to_those_who_cannot_see_it(browser: Browser, session: Session, server: ScreenServer) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    assert browser.part("word").get_attribute("aria-live") == "assertive"
    browser.driver.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-reduced-motion", "value": "reduce"}]}
    )
    session.hit()
    browser.see("text", "GOOD")
    assert browser.ask("getComputedStyle(document.getElementById('now')).animationName") == "none"
    browser.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_the_curves_are_drawn(browser: Browser, session: Session, server: ScreenServer) -> None:
    """Blue of the mean stands on its canvas after the first good hit, and not before."""
    blue = """(() => { const canvas = document.querySelector('#frf canvas');
    const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4)
      count += pixels[i] < 40 && pixels[i + 1] > 80 && pixels[i + 2] > 150 && pixels[i + 3] > 200;
    return count; })()"""
    browser.open(server.url)
    session.hit(HitFlags.TOO_SOFT)
    browser.see("text", "TOO SOFT")
    assert browser.ask(blue) == 0
    session.hit()
    browser.see("text", "GOOD")
    browser.wait(lambda: browser.ask(blue) > 200)


def test_a_test_is_started_and_watched_from_the_dashboard(
    browser: Browser, tmp_path: Path, tapper: Callable[..., HammeredStructure]
) -> None:
    with TapsEmulator(tapper(), CHANNELS, SAMPLE_RATE, realtime=True) as device:
        toml = make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
        text = toml.read_text("utf-8").replace("hits = 10", "hits = 1000")
        toml.write_text(text.replace("[daq]\n", f'[daq]\nport = "{device.port}"\n'), "utf-8")
        with DashboardServer(tmp_path) as server:
            browser.open(server.url)
            browser.see("machines", "no tap test yet")
            browser.driver.find_element(By.CSS_SELECTOR, ".start[data-direction=y]").click()
            browser.wait(lambda: "/tap/mill/" in browser.driver.current_url)
            browser.see("title", "direction y")
            browser.wait(lambda: browser.part("good").text not in ("-", "0"))
            browser.press(Keys.ESCAPE, Keys.ESCAPE)
            browser.see("text", "FAILED")
            browser.see("reason", "START goes on with them")
            browser.part("back").click()
            browser.see("machines", "START y")


def test_a_real_test_from_the_first_tap_to_the_light(
    browser: Browser, tmp_path: Path, tapper: Callable[..., HammeredStructure]
) -> None:
    make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    folder = MachineFolder(tmp_path / "mill")
    about = Circumstances("mill", datetime.now(UTC), "reference", "x")
    with TapsEmulator(tapper(), CHANNELS, SAMPLE_RATE, realtime=False) as device:
        session = TapSession(folder, lambda: TapsSource(device.port), about)
        with ScreenServer(session) as server:
            browser.open(server.url)
            browser.see("text", "CHECKING")
            session.run()
            browser.see("text", "DONE")
            browser.see("good", "10")
            browser.see("light", "GOOD")
            browser.see("texts", "first test")
