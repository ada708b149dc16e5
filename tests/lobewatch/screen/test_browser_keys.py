"""Keys, buttons and sounds of the screen in a real browser."""

from __future__ import annotations

import functools
from typing import Any

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from acquisition import HitFlags
from lobewatch.screen import ScreenServer
from lobewatch.tap.state import TapStep

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
Session = Any
"""ScriptedSession of tests/conftest.py."""


@pytest.mark.parametrize("key", ["u", "U", Keys.PAGE_UP])
def test_undo_by_key(browser: Browser, session: Session, server: ScreenServer, key: str) -> None:
    session.hit()
    session.hit()
    browser.open(server.url)
    browser.see("good", "2")
    browser.press(key)
    assert session.undone.wait(60)
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
    session.show(TapStep.TAP, reason="still two")
    browser.see("reason", "still two")
    assert session.state.good == 2


@pytest.mark.parametrize("size", [(1280, 800), (820, 1180)])
def test_undo_by_the_large_button(
    browser: Browser, session: Session, server: ScreenServer, size: tuple[int, int]
) -> None:
    session.hit()
    browser.open(server.url, size)
    browser.see("good", "1")
    assert browser.part("undo").size["height"] >= 60
    browser.part("undo").click()
    assert session.undone.wait(60)
    browser.see("good", "0")
    browser.wait(lambda: not browser.part("undo").is_enabled())


def test_what_cannot_be_undone_is_reported(opened: Browser, session: Session, server: ScreenServer) -> None:
    session.hit()
    session.refusal = "this hit is too old to take back"
    opened.open(server.url)
    opened.see("good", "1")
    opened.press("u")
    opened.saw("toast", "this hit is too old to take back")
    assert all("409" in complaint for complaint in opened.complaints())


def test_escape_stops_only_when_pressed_twice(browser: Browser, session: Session, server: ScreenServer) -> None:
    browser.open(server.url)
    browser.see("text", "CHECKING")
    browser.press(Keys.ESCAPE)
    browser.saw("stop-text", "again")
    assert not session.stopped.is_set()
    while not session.stopped.wait(1):  # the second has to come within three seconds
        browser.press(Keys.ESCAPE, Keys.ESCAPE)


def sounded(browser: Browser, tones: list[float]) -> bool:
    """Return whether exactly these tones (Hz) were played."""
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
        (lambda: session.show(TapStep.NO_DEVICE), "NO DEVICE", [160]),
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
    browser.reload()
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
    session.show(TapStep.GOOD)
    browser.see("text", "GOOD")
    session.hit()
    browser.see("good", "1")
    assert browser.ask("tones") == [1320]
    session.hit()
    browser.see("good", "2")
    assert browser.ask("tones") == [1320, 1320]


@pytest.mark.parametrize("size", [(1280, 657), (390, 844)])
def test_the_last_refused_hit_is_accepted_by_key_or_by_the_large_button(
    browser: Browser, session: Session, server: ScreenServer, size: tuple[int, int]
) -> None:
    session.hit()
    browser.open(server.url, size)
    browser.see("good", "1")
    assert not browser.part("accept").is_displayed()
    session.hit(HitFlags.DOUBLE_HIT, "Let the hammer bounce back.")
    browser.see("accept-text", "2")
    assert browser.part("accept").size["height"] >= 44
    browser.part("accept").click()
    browser.see("good", "2")
    session.hit(HitFlags.TOO_SOFT, "Hit harder.")
    browser.see("accept-text", "3")
    browser.press("a")
    browser.see("good", "3")
    assert session.decided == [(2, True), (3, True)]
    browser.wait(lambda: not browser.part("accept").is_displayed())
    browser.press("a")
    browser.press("u")
    browser.see("good", "2")
    assert len(session.decided) == 2


@pytest.mark.parametrize("size", [(1280, 657), (390, 844)])
def test_each_hit_of_the_list_can_be_rejected_and_accepted_by_its_button(
    browser: Browser, session: Session, server: ScreenServer, size: tuple[int, int]
) -> None:
    session.hit(HitFlags.DOUBLE_HIT, "Let the hammer bounce back.")
    session.hit()
    browser.open(server.url, size)
    browser.see("good", "1")
    for number, word in ((2, "Reject"), (1, "Accept")):
        button = browser.driver.find_element(By.CSS_SELECTOR, f'#hits [aria-label="{word} hit {number}"]')
        browser.driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
        button.click()
        browser.wait(lambda done=number: [hit for hit, _ in session.decided][-1:] == [done])
    assert session.decided == [(2, False), (1, True)]


def test_a_read_only_page_decides_nothing(browser: Browser, session: Session, server: ScreenServer) -> None:
    session.hit()
    session.hit(HitFlags.DOUBLE_HIT, "Let the hammer bounce back.")
    browser.open(server.watch_url)
    browser.see("text", "DOUBLE HIT")
    browser.press("a")
    session.show(TapStep.TAP, reason="still one")
    browser.see("reason", "still one")
    assert not browser.part("accept").is_displayed()
    assert not any(button.is_displayed() for button in browser.driver.find_elements(By.CSS_SELECTOR, "#hits button"))
    assert session.decided == []
