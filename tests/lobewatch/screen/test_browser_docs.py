"""The documentation site: built without a warning, complete, and searched from its folder without a network."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from selenium.webdriver.common.keys import Keys

from tests.lobewatch.screen.conftest import Browser

ROOT = Path(__file__).parents[3]
MODULES = ("acquisition", "modal", "dsm", "lobes", "lobewatch.machine", "lobewatch.logbook", "lobewatch.verdicts")
LOADED = re.compile(
    r"""(?:src=|<link[^>]*rel="(?:stylesheet|preload|icon)"[^>]*href=|url\(|@import )["']?((?:https?:)?//[^"')]*)"""
)


@pytest.mark.timeout(600)
def test_the_site_builds_strictly_and_its_search_needs_no_server(browser: Browser, tmp_path: Path) -> None:
    made = subprocess.run([sys.executable, str(ROOT / "docs" / "make_site.py"), str(tmp_path)], cwd=ROOT, check=False)
    assert made.returncode == 0
    files = [path for path in tmp_path.rglob("*") if path.suffix in (".html", ".css")]
    assert [path.name for path in files if LOADED.search(path.read_text("utf-8"))] == []
    for module in MODULES:
        html = (tmp_path / "docs" / "api" / f"{module}.html").read_text("utf-8")
        assert [name for name in import_module(module).__all__ if f'id="{module}.{name}"' not in html] == []
    browser.open((tmp_path / "index.html").as_uri())
    browser.wait(lambda: browser.ask("document.querySelector('input[name=q]') !== null"))
    browser.driver.find_element("name", "q").send_keys("fit_modes", Keys.ENTER)
    browser.wait(lambda: "modal.fit_modes" in browser.ask("document.getElementById('search-results')?.innerText ?? ''"))
    assert [url for url in browser.requested() if not url.startswith(("file:", "data:"))] == []
