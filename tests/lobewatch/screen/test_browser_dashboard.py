"""The dashboard in a real browser: twelve machines on one screen, filters, buttons and what goes wrong with them."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from selenium.webdriver.common.by import By

from acquisition import Circumstances, Hit, HitFlags, TapDirection, TapTest, from_accelerance, new_tap_id, write_hit
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.monitoring.status_rules import FREQUENCY_WARNING
from lobewatch.screen import DashboardServer
from lobewatch.screen import dashboard_table as board
from modal import Mode, synthesize_frf

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
BAR = """const { backgroundSize, backgroundPosition } = getComputedStyle(arguments[0], "::after");
return [backgroundSize, backgroundPosition];"""
"""Widths and places of what the bar below a light is made of: the line of the alarm, the fall, what is below them."""
EXTENT = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
LINES = [4.0 * line for line in range(1, 1000)]


def tap(path: Path, days_ago: float, frequency: float, direction: TapDirection = "x") -> None:
    """Make a tap test without noise."""
    about = Circumstances("m", datetime.now(UTC) - timedelta(days=days_ago), "reference", direction)
    frf = synthesize_frf([Mode(frequency, 0.029, 3.5e7)], LINES)
    MachineFolder(path).commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))


def machine(path: Path, daq: str = "") -> None:
    """Make the example machine without its programs."""
    toml = make_machine_folder(path, "surrogate_machine.toml")
    text = toml.read_text("utf-8")
    begin, end = text.index("[[program]]"), text.index("# The spindle of the example")
    toml.write_text((text[:begin] + text[end:]).replace("[daq]\n", f"[daq]\n{daq}\n"), "utf-8")


@pytest.fixture(scope="module")
def mills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten never tapped, one fallen by 7 %, one good and overdue; only the good one names a port."""
    path = tmp_path_factory.mktemp("plant")
    for number in range(10):
        machine(path / f"new-{number}")
    machine(path / "worn")
    machine(path / "well", 'port = "/dev/nothing-here"')
    for days_ago, share in ((60, 1.0), (30, 0.97), (1, 0.93)):
        tap(path / "worn", days_ago, 1713.0 * share)
    tap(path / "well", 40, 1713.0)
    tap(path / "well", 39, 1690.0, "y")
    return path


@pytest.fixture
def dashboard(mills: Path) -> Iterator[DashboardServer]:
    with DashboardServer(mills) as running:
        yield running


def keys(browser: Browser) -> list[str]:
    return list(browser.ask("[...document.querySelectorAll('#machines li')].map((line) => line.dataset.key)"))


def row(browser: Browser, key: str) -> Any:
    return browser.driver.find_element(By.CSS_SELECTOR, f"#machines li[data-key={key}]")


def test_twelve_machines_fit_one_desktop_screen(browser: Browser, dashboard: DashboardServer) -> None:
    browser.open(dashboard.url, (1280, 657))
    browser.wait(lambda: len(keys(browser)) == 12)
    assert keys(browser)[-1] in ("well", "worn")
    browser.wait(lambda: browser.ask(EXTENT) == [1280, 657])
    for key in keys(browser):
        for part in ("light", "about", "actions"):
            box = row(browser, key).find_element(By.CLASS_NAME, part).rect
            assert 0 < box["y"] < box["y"] + box["height"] <= 657, (key, part)
    assert "overdue by 10 days" in row(browser, "well").text
    assert "7.0 %" in row(browser, "worn").text
    assert "due in 28 days" in row(browser, "worn").text
    course = row(browser, "worn").find_element(By.CLASS_NAME, "course")
    assert re.findall(r"-[\d.]+", str(course.get_attribute("aria-label"))) == ["-7.0", "-10"]
    line, path = (course.find_element(By.TAG_NAME, name).rect for name in ("line", "path"))
    assert path["y"] < path["y"] + path["height"] < line["y"]


def test_a_bar_shows_how_far_each_has_fallen_on_the_way_to_its_alarm(
    browser: Browser, dashboard: DashboardServer
) -> None:
    """7 of 10 %, where the line of the alarm stands at 80 %; no bar where there is nothing to compare with."""
    browser.open(dashboard.url, (1280, 657))
    browser.wait(lambda: len(keys(browser)) == 12)
    sizes = {key: row(browser, key).find_element(By.CLASS_NAME, "size") for key in keys(browser)}
    assert {key: size.text for key, size in sizes.items() if size.is_displayed()} == {"worn": "-7.0 %"}
    wide, places = (layers.split(", ") for layers in browser.driver.execute_script(BAR, sizes["worn"]))
    assert wide[1] == "56% 100%"
    assert places[0] == "80% 0px"  # on top of the fall


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_dashboard_breaks_no_rule_of_accessibility(
    browser: Browser, dashboard: DashboardServer, scheme: str
) -> None:
    browser.open(dashboard.url, scheme=scheme)
    browser.wait(lambda: len(keys(browser)) == 12)
    row(browser, "worn").find_element(By.TAG_NAME, "summary").click()
    assert browser.broken_rules() == []


@pytest.mark.parametrize("size", [(768, 1024), (390, 800)])
def test_nothing_is_outside_a_narrower_screen(
    browser: Browser, dashboard: DashboardServer, size: tuple[int, int]
) -> None:
    browser.open(dashboard.url, size)
    browser.wait(lambda: len(keys(browser)) == 12)
    assert browser.ask("document.documentElement.scrollWidth") <= size[0]
    assert row(browser, "worn").find_element(By.CLASS_NAME, "report").rect["height"] >= 44


def test_a_click_shows_one_status_or_those_to_be_tapped(browser: Browser, dashboard: DashboardServer) -> None:
    browser.open(dashboard.url)
    browser.see("filter", "? UNKNOWN 10")
    browser.part("filter-warn").click()
    browser.wait(lambda: sorted(keys(browser)) == ["well", "worn"])
    browser.part("filter-due").click()
    browser.wait(lambda: len(keys(browser)) == 11)
    assert "worn" not in keys(browser)
    browser.part("filter-alarm").click()
    browser.wait(lambda: browser.part("none").is_displayed())
    browser.reload()
    browser.wait(lambda: browser.part("filter-alarm").get_attribute("aria-pressed") == "true")
    browser.part("filter-all").click()
    browser.wait(lambda: len(keys(browser)) == 12)


def test_start_is_there_where_a_port_is_and_its_error_in_its_line(
    opened: Browser, dashboard: DashboardServer, mills: Path
) -> None:
    opened.open(dashboard.url)
    opened.wait(lambda: len(keys(opened)) == 12)
    starts = opened.driver.find_elements(By.CSS_SELECTOR, ".start")
    assert sum(one.is_displayed() for one in starts) == 2
    toml = mills / "well" / "machine.toml"
    text = toml.read_text("utf-8")
    try:
        toml.write_text(text.replace('port = "/dev/nothing-here"', ""), "utf-8")
        row(opened, "well").find_element(By.CSS_SELECTOR, ".start[data-direction=x]").click()
        opened.wait(lambda: "no port in [daq]" in row(opened, "well").text)
        opened.wait(lambda: opened.ask("document.querySelectorAll('.start:not([hidden])').length") == 0)
        assert "no port in [daq]" in row(opened, "well").text
        assert not opened.part("error").is_displayed()
    finally:
        toml.write_text(text, "utf-8")
    opened.complaints()


def test_an_interrupted_test_across_is_resumed_or_restarted(browser: Browser, tmp_path: Path) -> None:
    machine(tmp_path / "mill", 'port = "/dev/nothing-here"')
    folder = MachineFolder(tmp_path / "mill")
    pulse = np.exp(-((np.arange(1000) / 30 - 5) ** 2))
    about = Circumstances("mill", datetime.now(UTC), "reference", "xy")
    (folder.spool / "earlier").mkdir(parents=True)
    write_hit(folder.spool / "earlier" / "0000.h5", Hit(500 * pulse, 100 * pulse, 25600.0), about, HitFlags.OK)
    with DashboardServer(folder.path) as server:
        browser.open(server.url, (1280, 657))
        browser.wait(lambda: keys(browser) == ["mill"])
        actions = row(browser, "mill").find_element(By.CLASS_NAME, "actions")
        assert actions.text.split("\n") == ["Report", "START x", "START y", "START xy", "Restart xy"]
    browser.complaints()


def test_a_line_opens_with_all_reasons_and_stays_open(browser: Browser, dashboard: DashboardServer) -> None:
    browser.open(dashboard.url)
    browser.wait(lambda: len(keys(browser)) == 12)
    row(browser, "worn").find_element(By.TAG_NAME, "summary").click()
    browser.wait(lambda: row(browser, "worn").find_element(By.CLASS_NAME, "next").text == FREQUENCY_WARNING.remedy)
    assert "[daq]" in row(browser, "worn").find_element(By.CLASS_NAME, "port").text
    browser.part("filter-warn").click()
    browser.wait(lambda: len(keys(browser)) == 2)
    assert row(browser, "worn").find_element(By.CLASS_NAME, "next").is_displayed()


def test_lines_change_go_and_come_and_the_others_stay_as_they_are(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(board, "MACHINE_POLL_INTERVAL", 0.0)
    for name in ("a", "b", "c"):
        machine(tmp_path / name)
    with DashboardServer(tmp_path) as server:
        browser.open(server.url, (1280, 657))
        browser.wait(lambda: keys(browser) == ["a", "b", "c"])
        row(browser, "b").find_element(By.TAG_NAME, "summary").click()
        before = row(browser, "b")
        browser.ask("document.querySelector('li[data-key=b] summary').focus()")
        tap(tmp_path / "a", 40, 1713.0)
        (tmp_path / "c").rename(tmp_path.with_name(f"{tmp_path.name}-gone"))
        machine(tmp_path / "d")
        browser.wait(lambda: keys(browser) == ["b", "d", "a"])
        assert "overdue by 11 days" in row(browser, "a").text
        assert row(browser, "b") == before
        assert browser.ask("document.activeElement.closest('li').dataset.key") == "b"
        assert browser.ask("document.querySelector('li[data-key=b] details').open")
        browser.see("filter", "All 3")


def test_a_page_that_outlives_its_server_takes_all_again(browser: Browser, tmp_path: Path) -> None:
    for name in ("a", "b"):
        machine(tmp_path / name)
    with DashboardServer(tmp_path, token="a-token-of-a-test") as server:
        browser.open(server.url, (1280, 657))
        browser.wait(lambda: keys(browser) == ["a", "b"])
        port = int(server.origin.rpartition(":")[2])
    shutil.rmtree(tmp_path / "a")
    machine(tmp_path / "c")
    with DashboardServer(tmp_path, port=port, token="a-token-of-a-test"):
        browser.wait(lambda: keys(browser) == ["b", "c"])
