"""Agreement of all outputs on a machine: status, frequency drop, alarms and forecast dates."""

from __future__ import annotations

import html
import json
import math
import re
import urllib.request
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet, find_machines
from lobewatch.monitoring.threshold_dates import ALREADY_REACHED
from lobewatch.notify.publish_status import make_message_content
from lobewatch.screen.dashboard_server import DashboardServer
from lobewatch.show.report.sections import DATE_HEADS
from lobewatch.show.trend import reach_text

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
Rows = dict[str, dict[str, Any]]
"""Output of `status` by machine."""
ISO = r"\d{4}-\d{2}-\d{2}"
SLOTS = [("A", 12900, 1.5), ("B", 8700, 0.4), ("C", 6500, 1.0)]


def run(*arguments: object) -> str:
    """Stdout of a command, whatever it thinks of the machine."""
    told = CliRunner().invoke(app, [*map(str, arguments)])
    assert told.exception is None or isinstance(told.exception, SystemExit), told.exception
    return told.stdout


def furnish(shop: Shop, seed: int) -> None:
    """Tap tests of one to three series, of any length, falling or not, with gaps, another tool, a word on an alarm."""
    rng = np.random.default_rng(seed)
    shop.run(*[SLOTS[i] for i in rng.permutation(3)[: int(rng.integers(0, 2)) + 1]])
    count, step = int(rng.integers(1, 15)), float(rng.choice([2.0, 15.0, 30.0]))
    rate = float(rng.choice([0.0, -0.01, -0.05, -0.15, -0.6]))
    overdue = float(rng.choice([0.5, 20.0, 182.0, 900.0]))
    first = (datetime.now(UTC) - shop.start).total_seconds() / 86400 - overdue - step * count
    short = int(rng.integers(0, count + 1)) if rng.random() < 0.5 else 0
    for i in range(count):
        at, share = first + step * i, math.exp((rate * i + 0.1 * rng.normal()) / 100)
        shop.tap(at, 1713.0 * share)
        if i >= short and rng.random() < 0.9:
            shop.tap(at + 0.02, 1690.0 * math.exp((rate * i + 0.1 * rng.normal()) / 100), "y")
    if rng.random() < 0.4:
        shop.tap(first + step * count, 1500.0, tool="other")
    if rng.random() < 0.3:
        CliRunner().invoke(app, ["ack", str(shop.path), "--note", "known"])


def furnish_plant(new_shop: type[Any], folder: Path, machines: int) -> None:
    """Random machines, the same in each run but for the day they end on."""
    for seed in range(machines):
        shop = new_shop(folder / f"m{seed:02}")
        shop.edit("high_rpm = 24000", "high_rpm = 24000\nsteps = 60")
        furnish(shop, seed)


def get(server: DashboardServer, path: str) -> str:
    request = urllib.request.Request(server.origin + path, headers={"Authorization": f"Bearer {server.token}"})
    with urllib.request.urlopen(request, timeout=60) as answer:
        text: str = answer.read().decode()
    return text


def dates_of(forecast: dict[str, Any]) -> Iterator[tuple[tuple[str, str], str]]:
    """Probable dates by program and word, and by limit."""
    for name, words in forecast.items():
        for word, when in words.items():
            if when["p50"] is not None:
                yield (name, word), when["p50"]


def check_trend(plant: Path, rows: Rows) -> None:
    some = 0
    for key, row in rows.items():
        trend = json.loads(run("trend", plant / key, "--json"))
        assert {name: trend[name] for name in ("light", "alarms", "forecast")} == {
            name: row[name] for name in ("light", "alarms", "forecast")
        }, key
        assert trend["fall_percent"] == pytest.approx(row["fall"], nan_ok=True), key
        some += any(True for _ in dates_of(trend["forecast"]))
    assert some > len(rows) / 5


def check_already(rows: Rows) -> None:
    said = [0, 0]
    for row in rows.values():
        for percent in (5, 10):
            is_reached = row["fall"] is not None and row["fall"] >= percent
            assert (row["forecast"][f"{percent} %"]["reached"]["p50"] == "already") is is_reached
            said[is_reached] += 1
    assert min(said) > 0


def check_messages_and_dashboard(plant: Path, rows: Rows) -> None:
    messages = {m.key: make_message_content(m) for m in Fleet(find_machines(plant)).assess_machines()}
    with DashboardServer(plant) as server:
        shown = {row["key"]: row for row in json.loads(get(server, "/machines"))["machines"]}
    for key, row in rows.items():
        for name in ("light", "alarms", "forecast", "next_limit", "next_step"):
            assert messages[key][name] == shown[key][name] == row[name], (key, name)
        assert messages[key]["fall_percent"] == shown[key]["fall"] == row["fall"]


def check_metrics(plant: Path, rows: Rows) -> None:
    file = plant / "metrics.prom"
    run("status", plant, "--prometheus", file)
    text = file.read_text("utf-8")
    labels = r'folder="(.*?)",.*?(?:fall_percent|program)="(.*?)"(?:,becomes="(.*?)")?'
    pattern = rf"^lobewatch_(limit|program)_timestamp_seconds\{{{labels}\}} (.*)$"
    found = {
        (key, f"{name} %" if kind == "limit" else name, word or "reached"): float(value)
        for kind, key, name, word, value in re.findall(pattern, text, re.MULTILINE)
    }
    file.unlink()
    expected = {(key, *what): date for key, row in rows.items() for what, date in dates_of(row["forecast"])}
    assert found.keys() == expected.keys()
    for what, date in expected.items():
        if date == "already":
            assert found[what] == pytest.approx(datetime.fromisoformat(rows[what[0]]["last_tap"]).timestamp())
        else:
            assert f"{datetime.fromtimestamp(found[what], UTC):%Y-%m-%d}" == date
    lights = dict(re.findall(r'^lobewatch_light\{folder="(.*?)",.*?light="(.*?)"\} 1.0$', text, re.MULTILINE))
    assert lights == {key: row["light"] for key, row in rows.items()}
    alarms = {
        (key, name) for key, name in re.findall(r'raised_timestamp_seconds\{folder="(.*?)",.*?alarm="(.*?)"', text)
    }
    assert alarms == {(key, alarm["id"]) for key, row in rows.items() for alarm in row["alarms"]}


def report_page(machine: Path, *options: str) -> str:
    run("report", machine, *options)
    return (machine / "report.html").read_text("utf-8")


def dates_in_report(page: str) -> dict[str, list[str]]:
    """Return the texts with the dates of each program and limit; empty without dates."""
    series, programs = (page.partition(f'id="{name}"')[2].partition("</section>")[0] for name in ("series", "programs"))
    limits = re.findall(r"-([\d.]+) % (.*?)(?=, -|\.</p>)", series.partition("</table>")[2].replace("\u00a0", " "))
    texts = {f"{percent} %": [text] for percent, text in limits}
    heads = re.findall("<th scope=.col.>(.*?)</th>", programs)
    for line in re.findall("<tr><th scope=.row.>.*?</tr>", programs, re.DOTALL) if DATE_HEADS[0] in heads else ():
        cells = [html.unescape(re.sub("<.*?>", "", cell)) for cell in re.findall("<t[hd].*?</t[hd]>", line, re.DOTALL)]
        texts[cells[0]] = [cells[heads.index(head)].replace("\u00a0", " ") for head in DATE_HEADS]
    return texts


def check_report(plant: Path, row: dict[str, Any]) -> None:
    page = report_page(plant / row["key"])
    assert all(alarm["id"] in page for alarm in row["alarms"])
    texts = dates_in_report(page)
    if not texts:
        dates = {day for words in row["forecast"].values() for when in words.values() for day in when.values()}
        assert dates <= {None, "already"}
        return
    assert texts.keys() == row["forecast"].keys()
    for name, words in row["forecast"].items():
        for text, when in zip(texts[name], words.values(), strict=True):
            if when["p50"] == "already":
                assert text == reach_text(ALREADY_REACHED, datetime.now(UTC))
            elif when["p90"] is not None:
                assert set(re.findall(ISO, text)) <= set(when.values())
                assert when["p50"] in text or "now" in text
            else:
                assert set(re.findall(ISO, text)) <= {when["p10"]}


@pytest.mark.timeout(900)
@pytest.mark.parametrize(("machines", "reports"), [(16, 1), pytest.param(50, 50, marks=pytest.mark.long)])
def test_all_channels_of_random_machines_say_the_same(
    new_shop: type[Any], tmp_path: Path, machines: int, reports: int
) -> None:
    furnish_plant(new_shop, tmp_path, machines)
    rows = {row["key"]: row for row in json.loads(run("status", tmp_path, "--json"))["machines"]}
    check_trend(tmp_path, rows)
    check_already(rows)
    check_messages_and_dashboard(tmp_path, rows)
    check_metrics(tmp_path, rows)
    for key in sorted(rows)[:reports]:
        check_report(tmp_path, rows[key])
