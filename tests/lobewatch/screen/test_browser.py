"""The screen in a real browser: what it shows of a test, its server, the dashboard, a whole test."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from acquisition import Circumstances, HammeredStructure, HitFlags, TapsEmulator, TapsSource
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import DashboardServer, ScreenServer
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, EMULATED_SAMPLE_RATE
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapStep

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
Session = Any
"""ScriptedSession of tests/conftest.py."""


def test_the_verdict_counter_and_reason_follow_the_test(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    session.check()
    browser.see("passed", "3 of 4 passed")
    browser.see("checks", "noise floor: 4.1 N rms")
    session.show(TapStep.TAP, reason="Hit now.")
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
    rows = browser.driver.find_elements(By.CSS_SELECTOR, "#hits li")
    assert [row.get_attribute("class") for row in rows] == ["bad", ""]
    for _ in range(8):
        session.hit()
    browser.see("change", "✓")
    session.show(TapStep.NO_DEVICE, reason="Plug it in.")
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
    browser.reload()
    browser.see("text", "CHECKING")


def test_the_address_to_watch_has_no_buttons_that_alter_anything(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.watch_url)
    session.hit()
    browser.see("good", "1")
    browser.wait(lambda: not browser.part("undo").is_displayed() and not browser.part("stop").is_displayed())
    browser.press("u", Keys.ESCAPE, Keys.ESCAPE)
    session.hit()
    browser.see("good", "2")
    assert not session.undone.is_set()
    assert not session.stopped.is_set()


def test_without_the_token_the_page_says_which_address_to_open(opened: Browser, server: ScreenServer) -> None:
    opened.open(f"{server.origin}/")
    opened.see("reason", "token")
    opened.see("text", "NO CONNECTION")
    opened.complaints()


def test_a_lost_server_is_reported_and_found_again(opened: Browser, session: Session) -> None:
    session.show(TapStep.TAP)
    with ScreenServer(session) as server:
        opened.open(server.url)
        opened.see("text", "TAP")
    opened.see("text", "ENDED")
    opened.wait(lambda: not opened.part("undo").is_enabled())
    port = int(server.origin.rpartition(":")[2])
    with ScreenServer(session, port=port, token=server.token):
        opened.see("text", "TAP")
    opened.complaints()


def test_a_silent_server_is_no_connection(opened: Browser, session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lobewatch.screen.live_feed.HEARTBEAT_INTERVAL", 1e9)
    session.show(TapStep.TAP)
    with ScreenServer(session) as server:
        opened.open(server.url)
        opened.see("text", "TAP")
        opened.saw("text", "NO CONNECTION")
        opened.see("text", "TAP")
    opened.complaints()


def test_the_last_picture_stays_when_lobewatch_has_ended(opened: Browser, session: Session) -> None:
    with ScreenServer(session) as server:
        opened.open(server.url)
        opened.see("text", "CHECKING")
        session.finish()
    opened.see("device", "ended")
    opened.see("text", "DONE")
    opened.complaints()


def test_a_test_is_started_and_watched_from_the_dashboard(
    browser: Browser, tmp_path: Path, tapper: Callable[..., HammeredStructure]
) -> None:
    with TapsEmulator(tapper(), EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=True) as device:
        toml = make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
        text = toml.read_text("utf-8").replace("hits = 10", "hits = 1000")
        toml.write_text(text.replace("[daq]\n", f'[daq]\nport = "{device.port}"\n'), "utf-8")
        with DashboardServer(tmp_path) as server:
            browser.open(server.url)
            browser.see("machines", "mill")
            browser.driver.find_element(By.CSS_SELECTOR, ".start[data-direction=y]").click()
            browser.wait(lambda: "/tap/mill/" in browser.driver.current_url)
            browser.see("title", "direction y")
            browser.wait(lambda: browser.part("good").text not in ("-", "0"))
            browser.press(Keys.ESCAPE, Keys.ESCAPE)
            browser.see("text", "FAILED")
            browser.see("reason", "START")
            browser.part("back").click()
            browser.see("machines", "START y")


def test_a_real_test_from_the_first_tap_to_the_status(
    browser: Browser, tmp_path: Path, tapper: Callable[..., HammeredStructure]
) -> None:
    make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    folder = MachineFolder(tmp_path / "mill")
    about = Circumstances("mill", datetime.now(UTC), "reference", "x")
    with TapsEmulator(tapper(), EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=False) as device:
        session = TapSession(folder, lambda: TapsSource(device.port), about)
        with ScreenServer(session) as server:
            browser.open(server.url)
            browser.see("text", "CHECKING")
            session.run()
            browser.see("text", "DONE")
            browser.see("good", "10")
            browser.see("light", "GOOD")
            browser.see("texts", "Hz")


def test_between_two_tests_the_buttons_say_what_can_come_next(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.url)
    session.hit()
    session.pause(TapStep.MOVE, ("y", "tap y"), ("done", "done"), reason="x is saved. Turn to y.")
    browser.see("text", "MOVE SENSOR")
    browser.see("choices", "tap y")
    assert not browser.part("undo").is_displayed()
    browser.press(Keys.PAGE_UP)  # the foot switch goes on
    browser.wait(lambda: session.chosen == [("y", "")])
    session.finish()
    session.pause(TapStep.DONE, ("x", "tap x"), ("y", "tap y"), ("tool", "next tool"), ("done", "done"))
    browser.see("programs", "bracket, slot (8000 rpm, 2 mm): stable")
    browser.wait(lambda: browser.ask("document.querySelectorAll('#choices button').length") == 4)
    browser.ask("document.querySelectorAll('#choices button')[2].click()")
    browser.wait(lambda: browser.part("tool-form").is_displayed())
    browser.press(*"drill y", Keys.ENTER)
    browser.wait(lambda: session.chosen[1:] == [("tool", "drill y")])
    browser.ask("document.querySelectorAll('#choices button')[3].click()")
    browser.wait(lambda: session.chosen[2:] == [("done", "")])
    session.pause(TapStep.TAP)
    browser.wait(lambda: browser.part("undo").is_displayed() and not browser.part("choices").is_displayed())
