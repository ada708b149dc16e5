"""Test the report: its summary, its numbers, the page of a fleet, and one status everywhere."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from acquisition import Circumstances, Frf, TapTest, from_accelerance, new_tap_id
from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet
from lobewatch.show.report.page import GAUGE_WIDTH, make_gauge, render_page
from lobewatch.show.report.report import render_fleet, render_report, spark_points
from lobewatch.show.report.report_data import collect_report_data
from lobewatch.show.report.sections import DATE_HEADS
from lobewatch.show.terminal.option_names import with_option_names
from modal import Mode, UnexplainedPeak, synthesize_frf
from tests.lobewatch.conftest import START

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)])


def numbers(html: str, name: str) -> tuple[list[str], list[list[Any]]]:
    """Return the numbers of the figure with this button."""
    button = re.search(rf'data-numbers="([^"]+)" data-name="{name}"', html)
    assert button is not None, name
    block = re.search(rf'id="{button[1]}">(.*?)</script>', html, re.DOTALL)
    assert block is not None
    table = json.loads(block[1])
    assert all(len(line) == len(table["heads"]) for line in table["lines"])
    return table["heads"], table["lines"]


@pytest.fixture
def worn(shop: Shop) -> Shop:
    """Return a machine whose frequency drops in both directions by 0.3 % every 15 days, ten times."""
    shop.run(("A <1>", 12900, 1.5))
    for i in range(11):
        shop.tap_both(15 * i, 1 - 0.003 * i + 0.0003 * (-1) ** i)
    return shop


def test_a_report_says_first_what_matters_and_holds_its_numbers(worn: Shop) -> None:
    logbook = worn.logbook
    now = logbook.history.rows[-1].time + timedelta(days=1)
    html = render_report(logbook, "reference", "x", now)
    first = first_screen(html)
    standing = logbook.status(now)
    light = {"alarm": "✗ EARLY ALARM" if standing.is_early else "✗ ALARM", "warn": "! WARNING"}[standing.status]
    for fact in (light, "2026-01-", " % a month", "A &lt;1&gt;", "2026-06-15.", "2026-07-14"):
        assert fact in first, fact
    assert with_option_names(standing.next_step) in unescape(first)
    assert re.search(r"<td>[a-z ]+ 2026-\d\d.*?</td><td>", first)  # until when a program holds
    assert html.count("<figure") == 4  # frequency, lobes, bearing stiffness and response, each once
    heads, lines = numbers(html, "natural-frequency")
    assert heads[:3] == ["what", "date", "natural frequency (Hz)"]
    tests = [line for line in lines if line[0] == "test"]
    assert [line[2] for line in tests[:2]] == pytest.approx([1713.5, 1713.0 * 0.9967], abs=0.05)
    assert {line[0] for line in lines} == {"test", "fitted", "forecast"}
    heads, lines = numbers(html, "stability-lobes")
    assert [head.partition(":")[0] for head in heads[:5]] == [
        "speed (rpm)",
        "2026-01-15",
        "2026-06-14",
        "lowest",
        "highest",
    ]
    assert len(heads) == 5 + 11 + 1  # every test, and the forecast for six months ahead
    lobes = np.array([[np.nan if depth is None else depth for depth in line] for line in lines])
    pockets = [lobes[np.nanargmax(np.where(lobes[:, 0] < 15000, depth, 0)), 0] for depth in lobes.T[5:]]
    assert pockets[0] > pockets[10] > pockets[-1]  # the deepest pocket moves down with the frequency, and goes on to
    assert len(numbers(html, "tap-tests")[1]) == 22
    assert len(numbers(html, "frequency-response")[1]) > 100
    data = sum(map(len, re.findall(r'<script type="application/json".*?</script>', html, re.DOTALL)))
    assert len(html) - data < 500_000
    assert "http" not in re.sub(r"https?://(www\.w3|matplotlib|purl|creativecommons)\.org", "", html)


def first_screen(html: str) -> str:
    """Return status, series and programs, with plain spaces."""
    return html[html.index('<div class="first">') : html.index("<details")].replace("\N{NO-BREAK SPACE}", " ")


def test_the_first_screen_says_each_thing_once(shop: Shop) -> None:
    """Test that x and y share one reason, and that reasons do not repeat the tables."""
    shop.run(("A", 12900, 1.5), ("B", 8700, 0.4))
    for i in range(12):
        shop.tap_both(15 * i, math.exp(-0.01 * i + 0.0003 * (-1) ** i))
    shop.tap(170, 1713.0 * math.exp(-0.13))
    now = shop.logbook.history.rows[-1].time + timedelta(days=40)
    html = render_report(shop.logbook, "reference", "x", now)
    words = unescape(re.sub(r"<svg.*?</svg>|<[^>]+>", " ", first_screen(html), flags=re.DOTALL))
    reasons = [remark.finding for remark in shop.logbook.status(now).remarks]
    codes = [remark.code for remark in shop.logbook.status(now).remarks]
    assert sum(code in ("frequency-alarm", "frequency-warn", "decay") for code in codes) == 4
    assert sum(reason in words for reason in reasons) == 1
    assert words.count("overdue") == 1
    assert all(words.count(f" {name} ") == 1 for name in ("A", "B"))
    below = unescape(html[html.index("<details") :])
    assert [reason for reason in reasons if f"<li>{reason}</li>" in below] == []


def test_series_beyond_the_third_are_folded(shop: Shop) -> None:
    for i, tool in enumerate(("reference", "long", "short", "other")):
        shop.tap(i, 1713.0, tool=tool)
    html = render_report(shop.logbook, "reference", "x")
    names = re.findall(r'<th scope="row">(\w+, x)</th>', html)
    assert sorted(names) == ["long, x", "other, x", "reference, x", "short, x"]
    assert f'<th scope="row">{names[3]}</th>' in html[html.index('<details id="1-more-series">') :]


def test_an_acknowledged_alarm_says_so_on_the_first_screen(worn: Shop) -> None:
    assert run("ack", worn.path, "--operator", "Eva", "--note", "seen", "decay:reference:y").exit_code == 0
    now = worn.logbook.history.rows[-1].time + timedelta(days=1)
    first = first_screen(render_report(worn.logbook, "reference", "x", now))
    assert first.count("Eva") == 1


@pytest.mark.quick
def test_a_gauge_tells_a_small_fall_from_a_large_one() -> None:
    small, large = (make_gauge(fall, 5.0, 10.0) for fall in (0.15, 10.0))
    assert large.length == large.alarm == 2 * large.warn
    assert small.length == pytest.approx(large.length * 0.015)
    assert (make_gauge(-1.0, 5.0, 10.0).length, make_gauge(99.0, 5.0, 10.0).length) == (0.0, GAUGE_WIDTH)
    assert re.findall(r"-\S+ %", large.text) == ["-10.00 %", "-5 %", "-10 %"]


def test_a_report_of_one_tap_makes_sense(shop: Shop) -> None:
    """Test that a single test has no trend, no change and no date."""
    shop.tap(0, 1713.0)
    html = render_report(shop.logbook, "reference", "x")
    for words in (*DATE_HEADS, "-0 %", "0.00 %", 'id="natural-frequency"', "gauge("):
        assert words not in html, words
    data = shop.logbook.query(collect_report_data, "reference", "x", None)
    assert " 8 " in data.no_dates
    assert html.count(data.no_dates) == 1
    assert "1 tap test,\n2026-01-15." in html
    assert "<td>first test</td>" in first_screen(html)
    assert 'class="gauge"' not in html
    assert '<section id="frequency-response" class="half">' in html
    assert 'type="range"' not in html


def test_a_response_is_shown_from_below_its_lowest_mode_on(shop: Shop) -> None:
    """Test the lower end: below it, division by omega^2 hides the modes."""
    shop.edit("band_hz = [1200, 2200]", "")
    shop.tap(0, 1713.0)
    material = shop.logbook.query(collect_report_data, "reference", "x", None)
    low, high = material.response_band(Frf(np.arange(1.0, 6001.0), np.zeros(6000, complex)))
    lowest = min(frequency for frequency, *_ in material.last.modes)
    assert (low, high) == (pytest.approx(0.3 * lowest), 6000.0)
    assert lowest == pytest.approx(1713.0, rel=0.01)


def test_all_machines_of_a_folder_are_one_page(shop: Shop, tmp_path: Path) -> None:
    shop.put("")
    shop.tap(0, 1713.0)
    shop.tap(40, 1500.0)
    type(shop)(tmp_path / "fresh")
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn" / "machine.toml").write_text("x =")
    result = run("report", tmp_path)
    assert result.exit_code == 0, result.output
    html = (tmp_path / "report.html").read_text("utf-8")
    assert re.findall(r'<th scope="row"><div><strong>(.*?)</strong>', html)[:2] == ["torn", "m"]
    assert "3 machines" in html
    assert "✗ ALARM" in html
    assert html.count("? UNKNOWN") == 2
    assert "<polyline" in html
    refused = run("report", tmp_path, "--tool", "reference")
    assert "--tool" in str(refused.exception)
    (tmp_path / "empty").mkdir()
    assert run("report", tmp_path / "empty").exit_code != 0


@pytest.mark.quick
def test_a_trend_falls_on_paper_as_it_does() -> None:
    assert spark_points([(0.0, 0.0)]) == ""
    assert spark_points([(0.0, 0.0), (10.0, -2.0)]) == "0.0,0.0 140.0,32.0"
    assert spark_points([(5.0, 0.0), (5.0, 0.0)]) == "0.0,0.0 0.0,0.0"


@pytest.mark.quick
def test_a_name_cannot_end_the_style_sheet() -> None:
    html = render_fleet([], 'x"; } </style><script>alert(1)</script>', datetime(2026, 1, 1, tzinfo=UTC))
    assert "alert(1)</script>" not in html
    assert html.count("</style>") == 1
    assert callable(render_page)


def lights(shop: Shop, path: Path, seed: int) -> tuple[str, str, str]:
    """Return the status in dashboard, report and fleet report for a machine tapped at random."""
    random = np.random.default_rng(seed)
    machine = type(shop)(path / "m")
    machine.put("")
    frequency, days = 1713.0, float(random.uniform(-900, -600))
    for _ in range(int(random.integers(1, 6))):
        days += random.exponential(60)
        frequency *= 1 - float(random.choice([0.0, 0.002, 0.06]) * random.random())
        machine.tap(days, frequency, "xy"[random.integers(2)], stiffness=3.5e7 * float(random.choice([1.0, 1.0, 5.0])))
    plant = Fleet({"m": machine.path}).assess_machines()
    newest = machine.logbook.newest_tap()
    html = render_report(machine.logbook, newest.tool, newest.direction)
    assert run("report", path).exit_code == 0
    fleet = (path / "report.html").read_text("utf-8")
    words = {"✗ ALARM": "alarm", "? UNKNOWN": "unknown", "! WARNING": "warn", "✓ GOOD": "good"}
    shown = re.search(r'<span class="label">(.*?)</span>', html)
    listed = re.search(r'<td><div><span class="\w+">(.*?)</span>', fleet)
    assert shown is not None
    assert listed is not None
    return plant[0].current.status.value, words[shown[1]], words[listed[1]]


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 50))])
def test_dashboard_and_report_show_the_same_status(shop: Shop, tmp_path: Path, seed: int) -> None:
    dashboard, *reports = lights(shop, tmp_path / "folder", seed)
    assert reports == [dashboard, dashboard]


def test_the_response_is_the_fitted_frf_with_the_modes_for_lobes(shop: Shop) -> None:
    """Test that curve and fit belong to one FRF, without delay, for the first and for the newest test."""
    lines, modes = np.arange(1.0, 4000.0), [Mode(1400.0, 0.02, 3e7), Mode(1800.0, 0.02, 6e7)]
    exact = synthesize_frf(modes, lines)
    for days, delay in enumerate([0.0, 1e-4]):
        when = START + timedelta(days=days)
        about = Circumstances("m", when, "reference", "x", "", shop.folder.toml.read_text("utf-8"))
        measured = exact.accelerance * np.exp(-2j * np.pi * lines * delay)
        shop.folder.commit(TapTest(new_tap_id(about), about, from_accelerance(lines, measured)))
    data = shop.logbook.query(collect_report_data, "reference", "x", None)
    largest = np.max(np.abs(exact.receptance))
    for frf in data.frfs:
        assert np.max(np.abs(frf.receptance - synthesize_frf(modes, frf.frequency).receptance)) < 0.02 * largest
        fit = synthesize_frf(data.measurement.used, frf.frequency).receptance
        assert np.max(np.abs(frf.receptance - fit)) < 0.02 * largest


@pytest.mark.parametrize(("is_within", "count"), [(True, 0), (False, 1)])
def test_a_peak_within_the_errors_has_no_mark(shop: Shop, is_within: bool, count: int) -> None:
    shop.tap(0, 1713.0)
    data = shop.logbook.query(collect_report_data, "reference", "x", None)
    peak = UnexplainedPeak(900.0, -2e-7, -1e-7, is_within, Mode(900.0, 0.02, 2e7))
    data.__dict__["measurement"] = replace(data.measurement, unexplained=(peak,))
    assert len(data.unexplained_peaks) == count
