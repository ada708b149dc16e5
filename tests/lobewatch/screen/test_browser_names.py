"""Machines with hostile names on the dashboard and the page of all machines, in a real browser: shown as they are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver.common.by import By
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import DashboardServer

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
NAMES = (
    '<img src=x onerror="window.ran=1">',
    "</script><script>window.ran=1</script>",
    "<svg/onload=window.ran=1>",
    "\"'><iframe srcdoc='<script>parent.ran=1</script>'>",
    "`${window.ran=1}`",
    "javascript:window.ran=1",
    "&lt;b&gt; &amp; <!-- -->",
    "{{7*7}} ]]> \\u003c",
    "\u202egnp.exe \u200b\ufeff🛠️ 主轴",
    "W" * 5000,
)


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten machines, each with one of the names for itself, its tool and its programs; and one with a hostile folder."""
    path = tmp_path_factory.mktemp("plant")
    for number, name in enumerate(NAMES):
        toml = make_machine_folder(path / f"mill-{number}", "surrogate_machine.toml")
        text = toml.read_text("utf-8")
        for old in (f'"mill-{number}"', '"A: slot at 12 600 rpm"'):
            assert old in text
            text = text.replace(old, json.dumps(name, ensure_ascii=False))
        toml.write_text(text, "utf-8")
    hostile = make_machine_folder(path / "hostile", "surrogate_machine.toml").parent
    hostile.rename(path / "<img src=x onerror=window.ran=1>'\"`")  # a name that Windows and lobewatch refuse
    return path


def check_page(browser: Browser) -> None:
    """No script ran, nothing overflows the page, and no element came from a name."""
    for width in (1280, 390):
        browser.resize((width, 844))
        browser.wait(lambda width=width: browser.ask("innerWidth") == width)
        assert browser.ask("document.documentElement.scrollWidth") <= width
    assert browser.ask("window.ran === undefined")
    assert browser.ask("document.querySelectorAll('img[src=x], iframe, svg[onload], [onerror]').length") == 0


def test_no_name_runs_on_the_dashboard_or_breaks_it(browser: Browser, plant: Path) -> None:
    with DashboardServer(plant) as server:
        browser.open(server.url, (1280, 844))
        browser.wait(lambda: browser.ask("document.querySelectorAll('#machines li').length") == len(NAMES) + 1)
        shown = browser.ask("[...document.querySelectorAll('#machines .name')].map((one) => one.textContent)")
        assert set(NAMES) <= set(shown)
        check_page(browser)
        for summary in browser.driver.find_elements(By.CSS_SELECTOR, "#machines summary"):
            browser.driver.execute_script("arguments[0].parentElement.open = true", summary)
        check_page(browser)


def test_no_name_runs_on_the_page_of_all_machines_or_breaks_it(browser: Browser, plant: Path, tmp_path: Path) -> None:
    page = tmp_path / "plant.html"
    said = CliRunner().invoke(app, ["report", str(plant), "--out", str(page)], catch_exceptions=False)
    assert said.exit_code == 0, said.output
    browser.open(page.as_uri(), (1280, 844))
    text = browser.ask("document.body.textContent")
    assert [name for name in NAMES if name not in text] == []
    check_page(browser)
