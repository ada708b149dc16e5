"""The page with lobes of stated modes: the answer of the command, refused values, and the page in a browser."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import DashboardServer
from tests.lobewatch.commands.invoke import invoke

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
SIZES = ((1280, 657), (820, 1180), (390, 844))
"""Desktop, tablet and phone (px)."""
STATED = {
    "modes": ["600 Hz 3% 10 N/um"],
    "teeth": "4",
    "material": "6061",
    "diameter_mm": '1/2"',
    "speeds": "6000-9000",
}
SETTING = {"speed_rpm": "8000", "depth_mm": "0.3"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DashboardServer]:
    folder = tmp_path_factory.mktemp("fleet")
    make_machine_folder(folder / "mill", "surrogate_machine.toml")
    with DashboardServer(folder) as running:
        yield running


def send(server: DashboardServer, body: Any, token: str = "") -> tuple[int, dict[str, Any]]:
    """Send values as the page does."""
    headers = {"Origin": server.origin, "Authorization": f"Bearer {token or server.watch_token}"}
    connection = http.client.HTTPConnection(server.origin.removeprefix("http://"), timeout=60)
    connection.request("POST", "/lobes/chart", body if isinstance(body, bytes) else json.dumps(body), headers)
    response = connection.getresponse()
    answer = response.status, json.loads(response.read())
    connection.close()
    return answer


def test_the_page_answers_as_the_command(server: DashboardServer) -> None:
    more: dict[str, Any] = {"modes_y": ["650 Hz 4% 12 N/um"], "radial_depth_mm": "3", "direction": "up"}
    status, told = send(server, STATED | SETTING | more)
    assert status == 200
    assert told.pop("svg").lstrip().startswith("<")
    options = "--teeth", "4", "--material", "6061", "--diameter", '1/2"', "--speeds", "6000-9000"
    setting = "--mode-y", more["modes_y"][0], "--radial-depth", "3", "--direction", "up", "--speed", "8000"
    assert told == json.loads(
        invoke(["lobes", "--mode", STATED["modes"][0], *options, *setting, "--depth", "0.3", "--json"]).stdout
    )


@pytest.mark.parametrize(
    "change",
    [
        {"modes": []},
        {"modes": ["600 Hz -3% 10 N/um"]},
        {"modes": ["600 Hz 3% 10"]},
        {"modes": ["600 Hz 3% 10 N/um"] * 13},
        {"teeth": 0},
        {"teeth": "four"},
        {"diameter_mm": "0.5 im"},
        {"diameter_mm": -1},
        {"material": "cheese"},
        {"speeds": "1.000"},
        {"speed_rpm": 8000},
        {"speed_rpm": 1e999, "depth_mm": 1},
        {"file": "/etc/passwd"},
    ],
    ids=str,
)
def test_a_wrong_value_is_refused_in_a_sentence(server: DashboardServer, change: dict[str, Any]) -> None:
    status, told = send(server, STATED | change)
    assert status == 409
    assert told["error"]
    assert "Traceback" not in told["error"]


def test_what_is_no_json_is_refused_and_no_token_gets_nothing(server: DashboardServer) -> None:
    assert send(server, b"[" * 2000)[0] == 409
    assert send(server, b"[1]")[0] == 409
    assert send(server, STATED, "wrong")[0] == 401


def test_a_person_enters_three_numbers(browser: Browser, server: DashboardServer, tmp_path: Path) -> None:
    browser.open(f"{server.origin}/lobes/#token={server.watch_token}", SIZES[-1])
    assert browser.broken_rules() == []
    for name, value in (STATED | SETTING | {"modes": STATED["modes"][0], "depth_mm": "1 im"}).items():
        browser.part(name).send_keys(value)
    browser.part("send").click()
    browser.see("error", "1 im")
    assert len(browser.complaints()) == 1
    browser.part("depth_mm").clear()
    browser.part("depth_mm").send_keys("0.3")
    browser.part("send").click()
    browser.wait(lambda: browser.part("result").is_displayed())
    assert browser.part("verdict").text == "STABLE"
    browser.wait(lambda: browser.ask("document.getElementById('figure').naturalWidth > 300"))
    assert browser.driver.find_elements("css selector", "#pockets tbody tr")
    for size in SIZES:
        for scheme in ("light", "dark"):
            browser.prefer(scheme)
            browser.resize(size)
            assert browser.ask("document.documentElement.scrollWidth") <= size[0]
            assert browser.broken_rules() == [], (size, scheme)
    assert {url.removeprefix("blob:") for url in browser.requested()} == {server.origin}
