"""The clock of the computer at a live test, and the dates that recordings may have."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import Circumstances, TapTest, from_accelerance, new_tap_id
from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import exclude_entry
from lobewatch.measurement.recording_questions import find_clock_questions
from lobewatch.show.terminal.option_names import with_option_names
from modal import Mode, synthesize_frf

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
LINES = np.arange(4.0, 4000.0, 4.0)


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time; tapped in x and y."""
    shop.put("")
    shop.tap_both()
    return shop


def live(logbook: Logbook, created: datetime, now: datetime, frequency: float = 1713.0) -> str:
    """Commit a test as the session of a person does; its identity."""
    about = Circumstances("m", created, "reference", "x")
    frf = synthesize_frf([Mode(frequency, 0.029, 3.5e7)], LINES)
    tap = TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance))
    logbook.commit(tap, now)
    return tap.id


@pytest.mark.parametrize(
    ("created", "now", "asked"),
    [
        (timedelta(days=2), timedelta(days=2), ()),
        (timedelta(days=-1), timedelta(days=-1), ("clock-behind",)),
        (timedelta(minutes=-1), timedelta(minutes=-1), ("clock-behind",)),
        (timedelta(hours=-3), timedelta(hours=1), ()),
        (timedelta(days=-1), timedelta(days=2), ("clock-behind",)),
        (timedelta(days=-400), timedelta(days=-400), ("clock-behind", "clock-before-release")),
        (timedelta(days=4), timedelta(days=2), ("clock-ahead",)),
        (timedelta(days=2.9), timedelta(days=2), ()),
    ],
)
def test_a_time_that_cannot_be_is_asked_about(
    shop: Shop, created: timedelta, now: timedelta, asked: tuple[str, ...]
) -> None:
    taps = shop.folder.taps()
    newest = datetime.fromisoformat(taps[-1].time)
    assert find_clock_questions(newest + created, newest + now, taps) == asked


def test_a_clock_at_1970_makes_no_new_baseline_until_it_is_accepted(shop: Shop) -> None:
    began = datetime(1970, 1, 1, 0, 5, tzinfo=UTC)
    tap_id = live(shop.logbook, began, began, 1650.0)
    logbook = shop.logbook
    assert logbook.questions == {tap_id: ("clock-behind", "clock-before-release")}
    standing = logbook.status(shop.start + timedelta(days=1))
    assert standing.status == "warn"
    assert "lobewatch replay" in standing.next_step
    assert standing.series_of("reference", "x").first_time == shop.start
    assert logbook.accept([tap_id], ["clock-behind", "clock-before-release"]) == []
    standing = shop.logbook.status(shop.start + timedelta(days=1))
    assert (standing.status, standing.series_of("reference", "x").first_time) == ("good", began)


def test_the_question_is_in_the_journal_and_outlives_the_history(shop: Shop) -> None:
    began = shop.start - timedelta(days=3)
    tap_id = live(shop.logbook, began, began)
    shop.folder.history_path.unlink(missing_ok=True)
    assert shop.logbook.questions == {tap_id: ("clock-behind",)}
    exclude_entry(shop.folder, tap_id, "clock was wrong")
    assert shop.logbook.questions == {}


def test_a_test_of_2031_is_reported_once_the_clock_is_right(shop: Shop) -> None:
    then = datetime(2031, 1, 1, tzinfo=UTC)
    tap_id = live(shop.logbook, then, then)
    found = shop.logbook.status(shop.start + timedelta(days=30))
    assert found.status == "warn"
    assert "tap-in-future" in [remark.code for remark in found.remarks]
    assert f"lobewatch exclude {shop.path} {tap_id}" in with_option_names(found.next_step)


def test_replay_takes_any_past_date_and_none_of_the_future(shop: Shop, beam: Path) -> None:
    replay = ["replay", str(shop.path), str(beam), "--date"]
    with pytest.raises(ValueError, match=r"future.*Description\.date"):
        CliRunner().invoke(app, [*replay, "2999-01-01"], catch_exceptions=False)
    assert len(shop.folder.taps()) == 2
    said = CliRunner().invoke(app, [*replay, "1904-02-29"], catch_exceptions=False)
    assert said.exit_code == 0
    assert "clock" not in said.output
    assert shop.folder.taps()[0].time.startswith("1904-02-2")
