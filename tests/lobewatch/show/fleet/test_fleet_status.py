"""Test the fleet as text: due dates and frequency drops."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest

from lobewatch.fleet.fleet import Fleet
from lobewatch.show.fleet.fleet_status import fleet_rows, fleet_text
from lobewatch.show.report.report import render_fleet
from lobewatch.show.terminal.sentences import MAX_LINE_LENGTH

pytestmark = pytest.mark.quick

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.mark.parametrize(
    ("days", "due"),
    [(28.0, "due in 2 d"), (29.5, "due in 0 d"), (30.5, "1 d overdue"), (33.0, "3 d overdue")],
)
def test_days_until_the_next_tap_test_are_whole_and_never_too_many(shop: Shop, days: float, due: str) -> None:
    shop.tap(0, 1713.0)
    shop.tap(0, 1690.0, "y")
    rows = fleet_rows(Fleet({"m": shop.path}).assess_machines(shop.start + timedelta(days=days)))
    assert f"2026-01-15, {due}\n" in fleet_text(rows)


def test_the_next_step_comes_before_a_short_list_of_reasons(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    (row,) = fleet_rows(Fleet({"m": shop.path}).assess_machines(shop.start))
    row |= {"name": "m", "next_step": "Tap again. " * 12, "reasons": [f"reason {number}" for number in range(6)]}
    lines = fleet_text([row]).splitlines()[2:]
    assert max(map(len, lines)) <= MAX_LINE_LENGTH
    assert lines[0].split()[:3] == ["Next:", "Tap", "again."]
    assert [line.strip() for line in lines if line.strip().startswith("reason")] == [
        f"reason {number}" for number in range(4)
    ]
    assert lines[-1].strip().startswith("2 ")


def test_a_drop_without_limits_has_no_gauge(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    (row,) = fleet_rows(Fleet({"m": shop.path}).assess_machines(shop.start))
    drop = {**row, "fall": 2.0, "fall_interval": (1.0, 3.0)}
    assert 'class="gauge"' in render_fleet([drop], "plant", shop.start)
    page = render_fleet([{**drop, "limits": []}], "plant", shop.start)
    assert 'class="gauge"' not in page
    assert "nan" not in page


@pytest.mark.parametrize(
    ("fall", "half", "shown"), [(10.0642, 0.0803, "10.064 ± 0.080"), (0.0012, 0.00081, "0.00120 ± 0.00081")]
)
def test_a_change_has_the_digits_that_its_interval_leaves(shop: Shop, fall: float, half: float, shown: str) -> None:
    shop.tap(0, 1713.0)
    (row,) = fleet_rows(Fleet({"m": shop.path}).assess_machines(shop.start))
    rows = [{**row, "fall": fall, "fall_interval": (fall - half, fall + half)}]
    assert f" {shown} " in fleet_text(rows)
    page = render_fleet(rows, "plant", shop.start)
    assert f"-{shown} %" in page.replace("\u00a0", " ").replace("\u2060", "")
