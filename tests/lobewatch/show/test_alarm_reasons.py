"""trend and status name the reason of an alarm, also in a series that is too short for a forecast."""

from __future__ import annotations

from typing import Any

import pytest
from typer.testing import CliRunner

from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.logbook.machine_forecast import forecast_machine
from lobewatch.show.trend import trend_remarks

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def dropped(shop: Shop) -> Shop:
    shop.tap(0, 1713.0)
    shop.tap(30, 1713.0 * 0.88)
    return shop


def test_trend_shows_status_and_reason_without_a_forecast(dropped: Shop) -> None:
    outlook = forecast_machine(Logbook.open(dropped.path))
    (reason,) = [remark for remark in trend_remarks(outlook) if remark.code == "frequency-alarm"]
    said = CliRunner().invoke(app, ["trend", str(dropped.path)])
    assert said.exit_code == 1
    assert "ALARM" in said.stdout
    assert reason.about in said.stdout + said.stderr


def test_status_names_the_series_on_alarm(dropped: Shop) -> None:
    said = CliRunner().invoke(app, ["status", str(dropped.path)]).stdout
    assert "reference, x" in said
    assert "10 %" in said
