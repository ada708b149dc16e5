"""The report in a real browser, as the dashboard serves it: its scripts run, nothing is loaded, nothing is cut off."""

from __future__ import annotations

import http.client
import json
from typing import Any

from selenium.webdriver.common.keys import Keys

from lobewatch.screen import DashboardServer

Browser = Any
"""Chromium on one page: Browser of conftest.py."""
Shop = Any
"""Of tests/lobewatch/conftest.py."""


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
