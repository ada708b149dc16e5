"""The report in a real browser, as the dashboard serves it: its scripts run, nothing is loaded, nothing is cut off."""

from __future__ import annotations

import csv
import http.client
import io
import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver.common.keys import Keys
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet, find_machines
from lobewatch.screen import DashboardServer
from lobewatch.show.fleet.fleet_status import fleet_rows
from lobewatch.show.report.report import render_fleet, render_report
from lobewatch.show.terminal.output import format_csv

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
DEMO = Path(__file__).parents[2] / "data" / "demo"
STYLE = files("lobewatch.show.report") / "static" / "report.css"
MARKS = ("0, 158, 115", "160, 0, 0")
"""Colours of rings and crosses."""
PIXELS = """(() => { const canvas = document.querySelector('#lobes-plot canvas');
const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data, [r, g, b] = [%s];
let count = 0;
for (let i = 0; i < pixels.length; i += 4) count += pixels[i] === r && pixels[i + 1] === g && pixels[i + 2] === b;
return count; })()"""
"""Number of pixels of this color in the slider's diagram."""
BREAKS = """(() => {
  const kept = (one, name) => getComputedStyle(one)[name].includes("avoid");
  const loose = [...document.querySelectorAll("h2")].filter((one) => !kept(one.parentElement, "breakInside"));
  const wrong = loose.filter((one) => {
    for (; one && !one.matches("figure, .wide, ul, p:not(.sub)"); one = one.nextElementSibling)
      if (!kept(one, "breakAfter")) return true;
    return one && one.matches("figure") && !kept(one, "breakInside");
  });
  return wrong.map((one) => one.textContent);
})()"""
"""Headings after which a page may end before anything of what they stand over."""
BOXES = "'.sides > div:first-child, .pictures svg'"
"""Words and pictures of the first screen."""
CUT_OFF = "[...document.querySelectorAll('.wide')].filter((one) => one.scrollWidth > one.clientWidth)"
"""Tables that are wider than their place."""
BROKEN_DATES = r"""(() => {
  const texts = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT), broken = [];
  const isSeen = (node) => node.parentElement.closest("thead")?.offsetWidth !== 1;
  while (texts.nextNode()) {
    const node = texts.currentNode, range = document.createRange();
    for (const { index, 0: day } of node.data.matchAll(/\d{4}-\W?\d\d-\W?\d\d/g)) {
      range.setStart(node, index);
      range.setEnd(node, index + day.length);
      const lines = new Set([...range.getClientRects()].map((box) => box.top));
      if (lines.size > 1 && isSeen(node)) broken.push(day);
    }
  }
  return broken;
})()"""
"""Dates that stand on two lines; headings of cards are not seen."""
PAPER = "getComputedStyle(document.body).backgroundColor"
CELLS = """[...document.querySelectorAll("tbody tr")].filter((row) => row.closest(".cards")).flatMap((row) => {
  const [first, ...others] = [...row.cells].filter((cell) => cell.textContent);
  const heads = [...row.closest("table").querySelectorAll("thead th")].map((head) => head.textContent);
  return others.map((cell) => {
    const { left, right, top } = cell.getBoundingClientRect(), above = first.getBoundingClientRect();
    const before = getComputedStyle(cell, "::before").content;
    return [heads[cell.cellIndex], cell.textContent, before, left, right, top >= above.bottom];
  });
})"""
"""Column heading, text, preceding text and position of each cell but the first of its row."""
HIDDEN = """[...document.querySelector("tbody tr").querySelectorAll("div")]
  .reduce((sum, one) => sum + one.scrollHeight - one.clientHeight, 0)"""
"""Height of what the first line does not show (px)."""
TURNED = """[...document.querySelectorAll("figure svg")]
  .map((one) => [getComputedStyle(one).filter, !!one.querySelector("image")])"""
"""Color filter of each picture, and whether it is a map."""
SAVED = """(() => {
  const saved = [], made = URL.createObjectURL;
  URL.createObjectURL = (blob) => { saved.push(blob.text()); return made.call(URL, blob); };
  HTMLAnchorElement.prototype.click = () => {};
  document.querySelectorAll("button[data-numbers]").forEach((button) => button.click());
  Promise.all(saved).then(arguments[0]);
})()"""
"""The texts of all files that the buttons of a page save."""
NAMES = [
    "=cmd|' /C calc'!A0",
    "@a",
    "-1-1",
    '=a,"b"',
    "\t=1",
    "\r=1",
    "-",
    "-5 mm",
    "-0.5",
    "+3",
    "-.5e-3",
    "1e-3",
    "a=b",
    "ä",
]
"""Machine names, some of which a spreadsheet would run as formulas."""


def test_the_slider_shows_the_lobes_of_each_test_and_no_side_is_cut_off(browser: Browser, shop: Shop) -> None:
    shop.put("")
    for days, frequency in ((0, 1713.0), (30, 1700.0), (60, 1690.0)):
        shop.tap(days, frequency)
    with DashboardServer(shop.path) as server:
        connection = http.client.HTTPConnection(server.origin.removeprefix("http://"), timeout=60)
        headers = {"Origin": server.origin, "Authorization": f"Bearer {server.token}"}
        connection.request("POST", "/machines/m/report", "null", headers)
        browser.open(server.origin + json.loads(connection.getresponse().read())["url"], (390, 844))
        connection.close()
        assert browser.ask("document.documentElement.scrollWidth <= innerWidth")
        browser.see("lobes-said", "2026-03-16")
        slider = browser.part("lobes-when")
        slider.send_keys(Keys.ARROW_LEFT, Keys.ARROW_LEFT)
        browser.see("lobes-said", "2026-01-15")
        assert browser.ask("document.querySelector('#lobes-plot canvas').width > 300")
        assert {one for one in browser.requested() if not one.startswith("data:")} == {server.origin}
        browser.resize((1280, 657))
        bottom = browser.ask("document.querySelector('.first').getBoundingClientRect().bottom")
        assert bottom < 657  # without a program all of it fits


def test_the_slider_marks_the_test_cuts_known_at_each_test(browser: Browser, shop: Shop, tmp_path: Path) -> None:
    """A ring from the second test on, and from the third a cross for a later cut."""
    shop.run(("A", 12900, 0.5))
    shop.tap(0, 1690.0, direction="y")
    for days, frequency in ((0, 1713.0), (30, 1700.0), (60, 1690.0)):
        shop.tap(days, frequency)
    for days, said in ((20, ["--stable"]), (70, ["--chatter"])):
        where = ["--program", "A", "--speed", "12900" if days == 20 else "11000", "--depth", "0.5"]
        when = ["--date", f"{shop.start + timedelta(days=days):%Y-%m-%d}"]
        assert CliRunner().invoke(app, ["observe", str(shop.path), *where, *when, *said]).exit_code == 0
    report = tmp_path / "report.html"
    report.write_text(render_report(shop.logbook, "reference", "x", shop.start + timedelta(days=80)), "utf-8")
    browser.open(report.as_uri())
    slider = browser.part("lobes-when")
    shown = {}
    for day in ("2026-03-16", "2026-02-14", "2026-01-15"):
        while day not in browser.part("lobes-said").text:
            slider.send_keys(Keys.ARROW_LEFT)
        shown[day] = browser.part("lobes-said").text, *(browser.ask(PIXELS % colour) > 20 for colour in MARKS)
    assert shown == {
        "2026-03-16": ("2026-03-16, 2 test cuts", True, True),
        "2026-02-14": ("2026-02-14, 1 test cut", True, False),
        "2026-01-15": ("2026-01-15", False, False),
    }


@pytest.fixture(scope="module")
def reports(new_shop: Callable[[Path], Shop], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return reports of a machine with a drop, program, forecast and lobe history, and of a folder of machines."""
    path = tmp_path_factory.mktemp("plant")
    shop = new_shop(path / "m")
    shop.edit("high_rpm = 24000", "high_rpm = 24000\nsteps = 200")
    shop.run(("A", 12900, 0.5))
    for number in range(10):
        shop.tap(15 * number, 1713.0 * (1 - 0.003 * number))
    new_shop(path / "fresh")
    now = shop.start + timedelta(days=150)
    one, fleet = path / "report.html", path / "fleet.html"
    one.write_text(render_report(shop.logbook, "reference", "x", now), "utf-8")
    rows = fleet_rows(Fleet(find_machines(path)).assess_machines(now))
    fleet.write_text(render_fleet(rows, "plant", now), "utf-8")
    return [one, fleet]


def test_the_first_screen_fits_with_its_words_and_pictures_next_to_each_other(
    browser: Browser, reports: list[Path]
) -> None:
    browser.open(reports[0].as_uri(), (1280, 657))
    boxes = browser.ask(f"[...document.querySelectorAll({BOXES})].map((one) => one.getBoundingClientRect().toJSON())")
    words, *pictures = boxes
    assert len(pictures) == 2
    assert all(box["bottom"] <= 657 and box["height"] > 180 for box in boxes)
    assert all(picture["left"] > words["right"] for picture in pictures)


def test_letters_of_pictures_can_be_read_on_a_phone(browser: Browser, reports: list[Path]) -> None:
    """Height in dots of the screen; large pictures scroll beneath it, the page does not."""
    browser.open(reports[0].as_uri(), (390, 844))
    for pictures, least in ((".pictures", 10), (".large", 8)):
        letters = f"[...document.querySelectorAll('{pictures} text')].map((one) => one.getBoundingClientRect().height)"
        assert min(browser.ask(letters)) >= least, pictures
    assert browser.ask("document.querySelector('.large').scrollWidth") > 390
    assert browser.ask("document.documentElement.scrollWidth <= innerWidth")


def test_the_words_of_the_demo_fit_the_first_screen(browser: Browser, tmp_path: Path) -> None:
    """Two directions, and three programs of long names with dates; its pictures are as high as those of any report."""
    words = (DEMO / "report.txt").read_text("utf-8")
    page = tmp_path / "report.html"
    page.write_text(words.replace("</head>", f"<style>{STYLE.read_text('utf-8')}</style></head>", 1), "utf-8")
    browser.open(page.as_uri(), (1280, 657))
    assert browser.ask("document.querySelectorAll('.first tbody tr').length") == 5
    assert browser.ask("document.querySelector('.first').getBoundingClientRect().bottom") < 657
    assert "overdue" not in browser.ask("document.querySelector('.first').textContent")


@pytest.mark.parametrize("size", [(390, 844), (768, 1024), (1280, 657)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_the_reports_break_no_rule_of_accessibility_and_have_no_side_scroll(
    browser: Browser, reports: list[Path], size: tuple[int, int]
) -> None:
    for report in reports:
        browser.open(report.as_uri(), size)
        assert browser.ask("document.documentElement.scrollWidth <= innerWidth"), report.name
        assert browser.ask(CUT_OFF) == [], report.name
        assert browser.ask(BROKEN_DATES) == [], report.name
        if size[0] == 768:  # the rules are the slow part, and see nothing there that they do not see beside it
            continue
        assert browser.broken_rules() == [], report.name


def test_dark_reports_break_no_rule_of_accessibility_and_are_light_on_paper(
    browser: Browser, reports: list[Path]
) -> None:
    for report in reports:
        browser.open(report.as_uri(), (1280, 657), "dark")
        assert browser.broken_rules() == [], report.name
        assert browser.ask(PAPER) == "rgb(22, 24, 26)"
        browser.prefer("dark", "print")
        assert browser.ask(PAPER) == "rgb(255, 255, 255)"
    browser.open(reports[0].as_uri(), scheme="dark")
    assert {*map(tuple, browser.ask(TURNED))} == {("invert(1) hue-rotate(180deg)", False), ("none", True)}


def test_on_a_phone_each_row_is_a_card_that_names_its_cells(browser: Browser, reports: list[Path]) -> None:
    for report in reports:
        browser.open(report.as_uri(), (390, 844))
        browser.wait(lambda: len(browser.ask(CELLS)) > 10)
        cells = browser.ask(CELLS)
        for name, text, shown, left, right, below in cells:
            assert shown == f'"{name}: "', (report.name, text)
            assert 0 <= left < right <= 390, (report.name, text)
            assert below, (report.name, text)


def test_ten_machines_stand_on_one_screen(browser: Browser, reports: list[Path], tmp_path: Path) -> None:
    """Ten that each have much to say, the path to a machine among it; all of it is there where a line has the focus."""
    worn, fresh = fleet_rows(Fleet(find_machines(reports[0].parent)).assess_machines())
    page = tmp_path / "fleet.html"
    rows = [{**worn, "key": f"mill-{number}", "name": f"DMG HSC 75 number {number}"} for number in range(9)]
    page.write_text(render_fleet([*rows, fresh], "plant", datetime.now(UTC)), "utf-8")
    browser.open(page.as_uri(), (1280, 657))
    bottoms = browser.ask("[...document.querySelectorAll('tbody tr')].map((one) => one.getBoundingClientRect().bottom)")
    assert len(bottoms) == 10
    assert max(bottoms) <= 657
    assert browser.ask(HIDDEN) > 0
    browser.driver.execute_script("document.querySelector('tbody tr').focus()")
    assert browser.ask(HIDDEN) == 0


def test_on_paper_no_heading_is_apart_from_its_figure_and_nothing_is_cut_off(
    browser: Browser, reports: list[Path]
) -> None:
    for report, page in zip(reports, ((680, 1000), (1030, 680)), strict=True):  # inside the margins of A4
        browser.open(report.as_uri(), page)
        browser.prefer("light", "print")
        try:
            assert browser.ask("document.documentElement.scrollWidth <= innerWidth"), report.name
            assert browser.ask(BREAKS) == []
            assert browser.ask("[...document.querySelectorAll('button, input')].every((one) => !one.offsetParent)")
            assert "counter(page)" in browser.ask("document.styleSheets[0].ownerNode.textContent.match(/@page.*/)[0]")
        finally:
            browser.prefer("light")


def test_what_the_buttons_save_does_not_run_in_a_spreadsheet(
    browser: Browser, reports: list[Path], tmp_path: Path
) -> None:
    """Cell by cell as the commands write it."""
    (row, _) = fleet_rows(Fleet(find_machines(reports[0].parent)).assess_machines())
    page = tmp_path / "fleet.html"
    page.write_text(render_fleet([{**row, "name": name} for name in NAMES], "plant", datetime.now(UTC)), "utf-8")
    browser.open(page.as_uri())
    (saved,) = browser.driver.execute_async_script(SAVED)
    shown = [line["name"] for line in csv.DictReader(io.StringIO(saved, newline=""))]
    assert shown == [cell for (cell,) in csv.reader(io.StringIO(format_csv([[name] for name in NAMES]), newline=""))]
    assert shown[0] == f"'{NAMES[0]}"
