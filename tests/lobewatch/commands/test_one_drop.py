"""Each series has one drop, with one interval, in all texts, tables, figures and messages."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet
from lobewatch.logbook import Logbook
from lobewatch.monitoring.drop_text import format_change
from lobewatch.notify.publish_status import make_message_content
from lobewatch.screen.dashboard_table import DashboardTable
from lobewatch.show.fleet.fleet_status import fleet_row
from lobewatch.show.report.report import render_fleet, write_report
from lobewatch.tap.session import _format_values

Shop = Any
"""Machine of tests/lobewatch/conftest.py."""
NUMBER = r"(\d+\.?\d*) ± (\d+\.?\d*) %"


def run(*arguments: object) -> str:
    told = CliRunner().invoke(app, [*map(str, arguments)])
    assert told.exception is None or isinstance(told.exception, SystemExit), told.exception
    return told.stdout


def tap_series(shop: Shop, fall: float) -> None:
    """Ten tests in both directions, scattering by 0.1 %, falling at once after six, in y by more."""
    rng = np.random.default_rng(7)
    for i in range(10):
        for direction, share, first in (("x", 1.0, 1713.0), ("y", 1.04, 1690.0)):
            level = 1 - fall * share * (i >= 6) / 100
            shop.tap(30 * i + 0.05, first * level * float(np.exp(rng.normal(0, 1e-3))), direction)


@pytest.fixture(scope="module", params=[11.0, pytest.param(0.0, marks=pytest.mark.long)])
def tapped(new_shop: type[Any], tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Shop:
    shop = new_shop(tmp_path_factory.mktemp("plant") / "m")
    shop.put("")
    tap_series(shop, request.param)
    return shop


def plain(page: str) -> str:
    """Return the text of a page without its numbers for CSV and figures' data."""
    shown = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    text = html.unescape(re.sub(r"<text.*?</text>|<title>(.*?)</title>", r" \1 ", shown, flags=re.DOTALL))
    return " ".join(re.sub("<[^>]*>", " ", text).replace("\u00a0", " ").replace("\u2060", "").split())


def numbers_of(text: str) -> Iterator[tuple[str, str]]:
    """Yield the numbers of drops in a text: each with its interval."""
    yield from re.findall(NUMBER, " ".join(text.split()))


def test_all_channels_show_one_drop_of_each_series(tapped: Shop) -> None:
    series = tapped.logbook.status().series
    shown = {one.name: format_change(one.drop.value, one.drop.half_width) for one in series}
    expected = {name: next(numbers_of(text)) for name, text in shown.items()}
    worst = series[0].drop
    for one in series:
        row = json.loads(run("trend", tapped.path, "--direction", one.direction, "--json"))
        assert (row["fall_percent"], row["fall_std_percent"]) == pytest.approx(one.drop[:2])
        assert row["fall_interval_percent"] == pytest.approx(one.drop.interval)
        assert row["is_change_proven"] is one.is_change_proven
        texts = run("trend", tapped.path, "--direction", one.direction).partition(f"{one.name}:")[2]
        assert set(numbers_of(texts)) == set(expected.values())
    (machine,) = Fleet({"m": tapped.path}).assess_machines()
    row = fleet_row(machine)
    (of_dashboard,) = DashboardTable(tapped.path.parent).updates_since("", ())["machines"]
    assert json.loads(bytes(of_dashboard))["fall"] == row["fall"] == pytest.approx(worst.value)
    message = make_message_content(machine)
    assert message["fall_percent"] == row["fall"]
    assert message["fall_percent_interval"] == [*row["fall_interval"]] == pytest.approx([*(worst.interval or ())])
    assert row["series"] == message["series"] == series[0].name
    assert -row["points"][-1][1] == pytest.approx(worst.value, abs=1e-3)
    for text in (row["finding"], row["change"], plain(render_fleet([row], "plant", tapped.start))):
        found = set(numbers_of(text))
        assert expected[series[0].name] in found <= set(expected.values())
    assert expected[series[0].name] == (row["change"].strip("+-").split()[0], row["change"].split()[2])
    assert " ".join(expected[series[0].name][::2]) in run("status", tapped.path.parent)


def test_headline_gauge_and_figure_of_the_report_are_of_one_series(tapped: Shop) -> None:
    worst, *_ = series = tapped.logbook.status().series
    page = write_report(tapped.logbook, sections=()).read_text("utf-8")
    text = plain(page)
    named = re.search(r"Tool (\S+), direction (\w):", text)
    assert named is not None
    assert f"{named[1]}, {named[2]}" == worst.name
    expected = {next(numbers_of(format_change(one.drop.value, one.drop.half_width))) for one in series}
    assert set(numbers_of(text)) == expected
    gauge = re.search(r'aria-label="f1 change ([^,]*),', page)
    assert gauge is not None
    assert gauge[1].replace("\u00a0", " ") == format_change(worst.drop.value, worst.drop.half_width)
    alarms = [remark for remark in tapped.logbook.status().remarks if remark.code == "frequency-alarm"]
    if alarms:
        assert alarms[0].about == worst.name
        assert text.index(alarms[0].finding) < text.index("Series")


def test_the_tap_screen_shows_the_same_drop(tapped: Shop) -> None:
    logbook = Logbook.open(tapped.path)
    newest = logbook.newest_tap()
    series = logbook.status().series_of(newest.tool, newest.direction)
    assert series is not None
    lines = _format_values(logbook.measurement(newest.id), series)
    shown = format_change(series.drop.value, series.drop.half_width)
    assert [*numbers_of(" ".join(lines))] == [*numbers_of(shown)]
    assert "±" not in lines[1]


def test_the_worst_reason_heads_the_status(tapped: Shop) -> None:
    (machine,) = Fleet({"m": tapped.path}).assess_machines()
    row = fleet_row(machine)
    worst = machine.current.remarks[0]
    if not row["is_change_proven"]:
        assert not {"frequency-alarm", "decay"} & {remark.code for remark in machine.current.remarks}
        return
    assert (worst.code, worst.about) == ("frequency-alarm", row["series"])
    assert row["reasons"][0] == worst.finding
    assert row["note"].startswith(worst.finding)
