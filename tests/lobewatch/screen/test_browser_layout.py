"""Layout of the screen in a real browser: sizes, contrast, curves and accessibility."""

from __future__ import annotations

from typing import Any

import pytest

from acquisition import HitFlags
from lobewatch.screen import ScreenServer
from lobewatch.tap.state import TapStep

SIZES = ((1280, 800), (1920, 1080), (820, 1180))
ESSENTIALS = ("text", "good", "reason", "undo", "mute", "stop", "frf", "coherence", "force", "change", "taken")
EXTENT = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
COLOURS = "['color', 'backgroundColor'].map((name) => getComputedStyle(document.querySelector('%s'))[name])"
"""Text color and background of a part of the page."""
Browser = Any
"""Chromium on one page: Browser of conftest.py."""
Session = Any
"""ScriptedSession of tests/conftest.py."""


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
    browser.wait(lambda: browser.part("plots").is_displayed() and browser.ask(EXTENT) == list(size))
    for name in ESSENTIALS:
        box = browser.part(name).rect
        assert box["x"] >= 0, name
        assert box["y"] >= 0, name
        assert box["x"] + box["width"] <= size[0], name
        assert box["y"] + box["height"] <= size[1], name
        assert box["height"] >= 16, name
    session.show(TapStep.TAP)
    browser.see("text", "TAP")
    browser.wait(lambda: browser.part("text").rect["height"] >= 0.09 * size[1])


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_a_contrast_of_seven_to_one(
    browser: Browser, session: Session, server: ScreenServer, scheme: str
) -> None:
    browser.open(server.url, scheme=scheme)
    for word in TapStep:
        session.show(word)
        browser.see("text", word.value)
        colours = browser.ask(COLOURS % "#now")
        assert contrast(*colours) >= 7, (word, colours)


def test_a_dark_screen_breaks_no_rule_of_accessibility_before_between_and_after_the_hits(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.url, scheme="dark")
    session.check()
    browser.see("checks", "noise floor")
    assert browser.broken_rules() == []
    session.hit()
    session.hit(HitFlags.DOUBLE_HIT, "Let the hammer bounce back.")
    browser.see("text", "DOUBLE HIT")
    assert browser.broken_rules() == []
    for _ in range(8):
        session.hit()
    session.undo()
    session.finish()
    browser.see("text", "DONE")
    assert browser.broken_rules() == []
    ink, paper = browser.ask(COLOURS % "body")
    assert contrast(ink, paper) >= 7
    assert contrast(paper, "rgb(0, 0, 0)") < 1.5  # it is dark


def test_no_caption_of_a_curve_is_cut_off_on_a_telephone(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
    browser.open(server.url, (390, 844))
    session.hit()
    browser.wait(lambda: browser.part("plots").is_displayed())
    wide = "[...document.querySelectorAll('#plots figcaption')].map((one) => [one.scrollWidth, one.clientWidth])"
    captions = browser.ask(wide)
    assert len(captions) == 5
    assert all(needed <= given for needed, given in captions)


def contrast(*colours: str) -> float:
    """Return the WCAG 2.2 contrast of two CSS colors rgb(r, g, b)."""
    lights = []
    for colour in colours:
        shares = [int(part) / 255 for part in colour.partition("(")[2].rstrip(")").split(",")[:3]]
        linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
        lights.append(0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2])
    return (max(lights) + 0.05) / (min(lights) + 0.05)


def test_the_verdict_is_reported_to_those_who_cannot_see_it(
    browser: Browser, session: Session, server: ScreenServer
) -> None:
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


def middle(browser: Browser, part: str) -> tuple[float, float]:
    """Return the center of a part of the drawing (pixels, y upwards)."""
    script = f"(({{ x, y, width, height }}) => [x + width / 2, -y - height / 2])({part}.getBoundingClientRect())"
    x, y = browser.ask(script.replace(part, f"document.querySelector('#guide {part}')"))
    return x, y


@pytest.mark.parametrize(("direction", "along"), [("x", (0, 0)), ("y", (1, 1)), ("xy", (1, 0))])
def test_until_the_first_hit_a_drawing_shows_where_sensor_and_hammer_go(
    browser: Browser, session: Session, server: ScreenServer, direction: str, along: tuple[int, int]
) -> None:
    """The sensor on the side of the negative axis, the hammer on that of the positive one; no empty curve."""
    browser.open(server.url, (1280, 657))
    session.show(TapStep.TAP, direction=direction)
    browser.see("text", "TAP")
    browser.wait(lambda: browser.part("guide").get_attribute("data-direction") == direction)
    assert not browser.part("plots").is_displayed()
    tool = middle(browser, ".flutes")
    for name, sign, axis in zip(("sensor", "hammer"), (-1, 1), along, strict=True):
        away = [place - at for place, at in zip(middle(browser, f".{name}-place .{name}"), tool, strict=True)]
        assert sign * away[axis] > 30, name
        assert abs(away[1 - axis]) < 0.6 * abs(away[axis]), name
    assert browser.part("sensor-along").text == direction[-1]
    browser.wait(lambda: browser.ask(EXTENT) == [1280, 657])
    assert browser.broken_rules() == []
    session.hit(HitFlags.DOUBLE_HIT)
    browser.see("text", "DOUBLE HIT")
    browser.wait(lambda: browser.part("plots").is_displayed() and not browser.part("guide").is_displayed())
    session.pause(TapStep.MOVE, ("y", "tap y"), reason="Turn both.")
    browser.wait(lambda: browser.part("guide").is_displayed() and not browser.part("plots").is_displayed())


def test_curves_are_legible_on_a_low_screen(browser: Browser, session: Session, server: ScreenServer) -> None:
    session.hit()
    browser.open(server.url, (1280, 657))
    browser.see("text", "GOOD")
    heights = "[...document.querySelectorAll('#plots .u-over')].map((one) => one.getBoundingClientRect().height)"
    browser.wait(lambda: len(browser.ask(heights)) == 5 and min(browser.ask(heights)) >= 110)
    browser.wait(lambda: browser.ask(EXTENT) == [1280, 657])
