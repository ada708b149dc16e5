"""Start of a series: below eight points the highest of its first three."""

from __future__ import annotations

from typing import Any

import pytest

from lobewatch.monitoring.series_history import build_series_history

Shop = Any
"""Machine of tests/lobewatch/conftest.py."""


def test_a_short_series_starts_at_the_highest_of_its_first_three_tests(shop: Shop) -> None:
    for days, frequency in enumerate((1700.0, 1709.0, 1690.0, 1650.0)):
        shop.tap(30 * days, frequency)
    rows = shop.logbook.history.series("reference", "x")
    history = build_series_history(rows)
    measured = [row.frequency.value for row in rows]
    assert history.frequency.start.value == pytest.approx(max(measured[:3]), rel=1e-9)
    assert history.frequency.change.value == pytest.approx(100 * (measured[-1] / max(measured[:3]) - 1), rel=1e-9)
