"""The life of an alarm: what raises, quiets and closes it, and what does not."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from acquisition import Conditions
from lobewatch.logbook.operator_entries import acknowledge_alarms
from lobewatch.machine.folder_updates import add_event, exclude_entry, include_entry
from lobewatch.monitoring.status_rules import Alarm
from tests.lobewatch.commands.conftest import Run, refused, run
from tests.lobewatch.conftest import START

__all__ = ["run"]
Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
WIGGLE = (0.05, -0.05, 0.1, -0.1, 0.0)
MONTH = 30.0
LONG_AGO = -1500.0
"""Days from the first of the tests to the start of the shop, so that none lies in the future."""


def tap_months(shop: Shop, falls: list[float], begin: int = 0) -> list[str]:
    """Add one test a month in x with these frequency drops (%), and return their identities."""
    return [
        shop.tap(LONG_AGO + MONTH * (begin + i), 1713.0 * (1 - (fall + WIGGLE[(begin + i) % 5]) / 100))
        for i, fall in enumerate(falls)
    ]


def falling(count: int, healthy: int = 12, step: float = 0.4) -> list[float]:
    return [step * max(i - healthy + 1, 0) for i in range(count)]


def at(shop: Shop, months: float) -> datetime:
    return START + timedelta(days=LONG_AGO + MONTH * months)


def alarms(shop: Shop, months: float) -> list[Alarm]:
    return list(shop.logbook.status(at(shop, months)).alarms)


def codes(shop: Shop, months: float) -> set[str]:
    return {remark.code for remark in shop.logbook.status(at(shop, months)).remarks}


@pytest.fixture
def mill(shop: Shop) -> Shop:
    """Falling for half a year after a healthy one."""
    shop.put("")
    tap_months(shop, falling(18))
    return shop


def test_an_event_in_the_middle_of_a_fall_closes_nothing(mill: Shop, run: Run) -> None:
    (before,) = alarms(mill, 18)
    add_event(mill.folder, "coolant pump replaced", at(mill, 17.1))
    assert alarms(mill, 18) == [before]
    for month in range(18, 24):
        tap_months(mill, [0.4 * (month - 11)], month)
        assert "decay" in codes(mill, month + 1)
    said = run("status", mill.path, "--json")
    assert said.code == 1
    assert said.json["machines"][0]["light"] == "alarm"


def test_a_new_baseline_closes_it_and_one_withdrawn_opens_it_again(mill: Shop, run: Run) -> None:
    (before,) = alarms(mill, 18)
    event = add_event(mill.folder, "bearings replaced", at(mill, 17.2), new_baseline=True)
    tap_months(mill, [0.0, 0.0], 18)
    assert alarms(mill, 20) == []
    run("event", mill.path, "--withdraw", event.id)
    assert [alarm.id for alarm in alarms(mill, 20)] == [before.id]


def test_an_alarm_is_the_same_until_it_is_closed(mill: Shop) -> None:
    (first,) = alarms(mill, 18)
    raised = mill.logbook.taps[[tap.id for tap in mill.logbook.taps].index(first.triggered_by)]
    assert first.id == f"decay:reference:x:{raised.id}"
    assert first.triggered_at == datetime.fromisoformat(raised.time)
    tap_months(mill, falling(24)[18:], 18)
    assert [alarm.id for alarm in alarms(mill, 24)] == [first.id]


def test_the_data_close_it(shop: Shop) -> None:
    shop.put("")
    tap_months(shop, [0.0] * 20 + [3.0, 3.0])
    assert "decay" in codes(shop, 22)
    tap_months(shop, [0.0] * 14, 22)
    assert codes(shop, 36) <= {"one-direction", "overdue"}


def test_acknowledged_is_reported_everywhere_and_the_status_stays(mill: Shop, run: Run) -> None:
    until = (datetime.now(UTC) + timedelta(days=40)).date()
    said = run("ack", mill.path, "--until", until, "--note", "bearings ordered", "--operator", "Kim", "--json")
    assert said.code == 0
    (known,) = said.json["acknowledged"]
    assert (known["acknowledged"]["operator"], known["acknowledged"]["note"]) == ("Kim", "bearings ordered")
    status = run("status", mill.path, "--json")
    (row,) = status.json["machines"]
    assert (status.code, row["light"]) == (1, "alarm")
    assert row["alarms"] == said.json["acknowledged"]
    words = f"by Kim until {until}: bearings ordered)"
    assert words in row["note"]
    assert run("report", mill.path, "--out", "r.html").code == 0
    page = Path("r.html").read_text("utf-8")
    assert words in page
    assert row["alarms"][0]["id"] in page[page.index('id="sign-off"') :]
    assert words.strip("by )") in page[page.index('id="sign-off"') :]
    assert "Kim" in run("history", mill.path).out


def test_acknowledgement_ends_with_its_date_and_with_the_alarm(mill: Shop) -> None:
    soon = datetime.now(UTC) + timedelta(days=3)
    acknowledge_alarms(mill.logbook, until=soon)
    (known,) = alarms(mill, 18)
    assert known.is_acknowledged(soon - timedelta(hours=1))
    assert not known.is_acknowledged(soon + timedelta(hours=1))
    tap_months(mill, [0.0] * 16, 18)
    assert alarms(mill, 34) == []
    tap_months(mill, [3.0] * 8, 34)
    (again,) = alarms(mill, 42)
    assert (again.id != known.id, again.acknowledgement) == (True, None)


def test_acknowledgement_survives_exclusions(mill: Shop) -> None:
    acknowledge_alarms(mill.logbook, note="known")
    (known,) = alarms(mill, 18)
    exclude_entry(mill.folder, known.triggered_by, "hammer slipped")
    (other,) = alarms(mill, 18)
    assert other.triggered_by != known.triggered_by
    assert other.acknowledgement == known.acknowledgement
    include_entry(mill.folder, known.triggered_by)
    assert alarms(mill, 18) == [known]


def test_an_acknowledgement_of_before_a_new_baseline_counts_no_more(mill: Shop) -> None:
    acknowledge_alarms(mill.logbook)
    add_event(mill.folder, "spindle exchanged", at(mill, -0.5), new_baseline=True)
    assert [alarm.acknowledgement for alarm in alarms(mill, 18)] == [None]


def test_fixed_limits_and_programs_ring_too_each_with_the_test_that_raised_it(shop: Shop) -> None:
    shop.run_safe_slots()
    shop.tap_both(LONG_AGO)
    ids = [shop.tap(LONG_AGO + 30.0 * i, 1713.0 * (1 - 0.04 * i)) for i in range(1, 5)]
    ringing = alarms(shop, 5)
    assert {alarm.code for alarm in ringing} == {"frequency-alarm", "program-not-stable"}
    by_code = {alarm.code: alarm for alarm in ringing}
    assert by_code["frequency-alarm"].triggered_by == ids[2]
    (one,) = acknowledge_alarms(shop.logbook, "frequency-alarm")
    assert one.code == "frequency-alarm"
    assert {alarm.code for alarm in alarms(shop, 5) if alarm.acknowledgement} == {"frequency-alarm"}


def test_bad_acknowledgements_are_rejected(mill: Shop, run: Run) -> None:
    refused(run("ack", mill.path, "none-such"), "none-such", "decay:reference:x:")
    refused(run("ack", mill.path, "--until", "2020-01-01"), "--until 2020-01-01")
    assert run("ack", mill.path, "--note", "known").code == 0
    refused(run("ack", mill.path), "decay:reference:x:")
    assert "ordered" in run("ack", mill.path, "decay", "--note", "ordered").out
    refused(run("ack", mill.path, "--note", "a\x07b"), "note")
    exclude_all = [tap.id for tap in mill.logbook.taps[12:]]
    for tap_id in exclude_all:
        exclude_entry(mill.folder, tap_id, "wrong tool")
    refused(run("ack", mill.path))
    assert not alarms(mill, 18)


def test_journal_lines_of_acknowledgements_outlast_a_rebuild(mill: Shop, run: Run) -> None:
    acknowledge_alarms(mill.logbook, note="known")
    (mill.path / "journal.jsonl").unlink()
    assert run("rebuild", mill.path).code == 0
    (known,) = alarms(mill, 18)
    assert known.acknowledgement is not None
    assert json.loads(run("verify", mill.path, "--json").out)["damage"] == []


@pytest.mark.parametrize(("step", "is_early"), [(0.15, True), (0.9, False)])
def test_a_small_alarm_reads_unlike_one_past_a_limit(shop: Shop, run: Run, step: float, is_early: bool) -> None:
    shop.put("")
    tap_months(shop, falling(18, step=step))
    found = shop.logbook.status(at(shop, 18))
    assert (found.status, found.is_early) == ("alarm", is_early)
    (row,) = run("status", shop.path, "--json").json["machines"]
    assert row["is_early"] is is_early
    assert ("early alarm" in run("status", shop.path).out) is is_early
    assert run("report", shop.path, "--out", "r.html").code == 0
    assert ("✗ EARLY ALARM" in Path("r.html").read_text("utf-8")) is is_early


def test_two_alarms_at_once_are_named_and_acknowledged_apart(shop: Shop, run: Run) -> None:
    shop.put("")
    for i, fall in enumerate(falling(18, step=2.0)):
        shop.tap(LONG_AGO + MONTH * i, 1713.0 * (1 - (fall + WIGGLE[i % 5]) / 100))
        shop.tap(LONG_AGO + MONTH * i + 0.1, 1690.0 * (1 - (fall + WIGGLE[i % 5]) / 100), "y")
    names = {alarm.id for alarm in alarms(shop, 18)}
    assert {name.partition(":")[0] for name in names} == {"decay", "frequency-alarm"}
    assert len(names) == 4
    refused(run("ack", shop.path, "decay"), " 2 alarms")
    one = next(name for name in names if name.startswith("decay:"))
    assert run("ack", shop.path, one).code == 0
    assert [alarm.id for alarm in alarms(shop, 18) if alarm.acknowledgement] == [one]
    assert run("ack", shop.path).code == 0
    assert {alarm.id for alarm in alarms(shop, 18) if alarm.acknowledgement} == names


def test_two_clampings_of_one_day_are_two_points_where_that_is_reported(shop: Shop) -> None:
    shop.put("")
    tap_months(shop, [0.0] * 12)
    for hour, reclamped in ((0, False), (1, False), (2, True)):
        conditions = Conditions(reclamped=reclamped)
        shop.tap(LONG_AGO + MONTH * 12 + hour / 24, 1713.0 * 0.98, conditions=conditions)
    (series,) = shop.logbook.status(at(shop, 13)).series
    assert len(series.trend.points) == 14
    assert "decay" in codes(shop, 13)


def test_a_clock_set_back_between_raises_and_closes_nothing(mill: Shop) -> None:
    """A test that carries an older date stands where its date says; the alarm of the newest stays the same."""
    before = alarms(mill, 18)
    mill.tap(LONG_AGO + MONTH * 2.5, 1713.0)
    assert alarms(mill, 18) == before
