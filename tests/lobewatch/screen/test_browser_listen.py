"""A cut that is listened to, in a real browser: from the first word to the last, through the port of a device."""

from __future__ import annotations

import contextlib
import re
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from acquisition import find_driver
from acquisition.emulation import Passage
from lobewatch.cli import main
from lobewatch.logbook import Logbook
from lobewatch.machine import MachineFolder, make_machine_folder
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.tap import cut_recording
from lobewatch.tap.cut_recording import CutStep
from lobewatch.tap.emulated_cut import emulate_cut

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
PROGRAM, SPEED = "A: slot at 12 600 rpm", 12600.0
PASSAGE = Passage(before=2.5, ramp=0.05, steady=1.2, after=3.0)
SIZES = ((1280, 657), (768, 1024), (390, 844))
LEAST = {1280: 110.0, 768: 70.0, 390: 46.0}
"""Height of the letters of a word (px), by the width of the page."""
EXTENT = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
CAPITALS = """(() => { const pen = document.createElement('canvas').getContext('2d');
const { fontWeight, fontSize, fontFamily } = getComputedStyle(document.getElementById('text'));
pen.font = `${fontWeight} ${fontSize} ${fontFamily}`;
return pen.measureText('H').actualBoundingBoxAscent; })()"""
LONG = 100.0
"""Time after which the page is not waited for any more (s)."""
WAITED_FOR = (CutStep.LISTENING, CutStep.CUTTING)
"""Words that stay until the page has shown them: it leaves out what it is too slow for."""
TOKEN = "a-token-of-the-test"


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    return MachineFolder(tmp_path / "mill")


def listen() -> None:
    """Run `lobewatch listen` as in a terminal."""
    with contextlib.suppress(SystemExit):
        main()


def collected(told: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return all output to stderr so far."""
    told.append(capsys.readouterr().err)
    return "".join(told)


def address(told: str) -> str:
    found = re.search(r"screen: (\S+)", told)
    return found[1] if found else ""


def check_page(browser: Browser) -> None:
    """Check that the verdict is readable from 3 m at all sizes and that axe finds no problem."""
    for size in SIZES:
        browser.resize(size)
        browser.wait(lambda size=size: letters(browser) >= LEAST[size[0]])
        browser.wait(lambda size=size: browser.ask(EXTENT) == list(size))
        for name in ("text", "figures", "reason", "mute"):
            box = browser.part(name).rect
            assert min(box["x"], box["y"]) >= 0, (name, size)
            assert box["x"] + box["width"] <= size[0], (name, size)
            assert box["y"] + box["height"] <= size[1], (name, size)
        assert browser.broken_rules() == [], size
    browser.prefer("dark")
    assert browser.broken_rules() == []


def letters(browser: Browser) -> float:
    """Height of the capitals of the word (px)."""
    return float(browser.ask(CAPITALS))


@pytest.mark.parametrize(
    ("depth_mm", "kind", "text"), [(2.0, "stable", "STABLE"), (7.0, "chatter", "CHATTER")], ids=["stable", "chatter"]
)
def test_the_page_goes_from_air_to_the_verdict_by_itself(
    browser: Browser,
    folder: MachineFolder,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    depth_mm: float,
    kind: str,
    text: str,
) -> None:
    setting = find_cut_setting(folder.machine, PROGRAM, SPEED, depth_mm)
    emulated = emulate_cut(folder, find_driver("taps"), setting, realtime=False, passage=PASSAGE)
    told: list[str] = []
    is_open, seen = threading.Event(), {word: threading.Event() for word in WAITED_FOR}
    acquire: Any = cut_recording.acquire_cut

    def acquire_at_the_pace_of_the_page(*given: Any) -> Any:
        *others, picture = given

        def show(**changes: Any) -> None:
            picture(**changes)
            if changes.get("word") in seen:
                seen[changes["word"]].wait(LONG)

        is_open.wait(LONG)
        return acquire(*others, show)

    monkeypatch.setattr(cut_recording, "acquire_cut", acquire_at_the_pace_of_the_page)
    with emulated.device as device:
        said = ["--program", PROGRAM, "--speed", SPEED, "--depth", depth_mm, "--port", device.port, "--screen"]
        command = ["lobewatch", "listen", folder.path, *said, "--token", TOKEN]
        monkeypatch.setattr(sys, "argv", [str(part) for part in command])
        listening = threading.Thread(target=listen)
        listening.start()
        try:
            browser.wait(lambda: address(collected(told, capsys)))
            browser.open(address("".join(told)), SIZES[0])
            browser.see("title", PROGRAM)
            is_open.set()
            browser.see("text", CutStep.LISTENING.replace(" ", "\n"))
            browser.see("reason", cut_recording.SENSOR_ON_HOUSING_TEXT)
            seen[CutStep.LISTENING].set()
            browser.see("text", "CUTTING")
            browser.see("unit", "recorded")
            browser.wait(lambda: browser.part("level-now").text not in ("", "-"))
            seen[CutStep.CUTTING].set()
            browser.see("text", text)
        finally:
            for event in (is_open, *seen.values()):
                event.set()
            listening.join()
    (cut,) = Logbook.open(folder.path).cuts
    assert cut.word == kind
    browser.see("device", "ended")
    browser.see("device", cut.id)
    browser.see("figures", f"{cut.speed_rpm:.0f} rpm")
    if cut.chatter_frequency_hz is not None:
        assert browser.part("figure").text == f"{cut.chatter_frequency_hz:.0f} Hz"
    assert browser.part("next").text.startswith("Next: ")
    assert browser.ask("document.body.dataset.kind") == kind
    check_page(browser)
