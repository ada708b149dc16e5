"""All machines as text: when each is due."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest

from lobewatch.plant.plant import Plant
from lobewatch.show.plant.describe_plant import plant_text
from lobewatch.show.plant.plant_rows import plant_rows

Shop = Any
"""Of tests/lobewatch/conftest.py."""


@pytest.mark.parametrize(
    ("days", "due"),
    [(28.0, "due in 2 d"), (29.5, "due in 0 d"), (30.5, "1 d overdue"), (33.0, "3 d overdue")],
)
def test_days_until_the_next_tap_test_are_whole_and_never_too_many(shop: Shop, days: float, due: str) -> None:
    shop.tap(0, 1713.0)
    shop.tap(0, 1690.0, "y")
    rows = plant_rows(Plant({"m": shop.path}).standings(shop.start + timedelta(days=days)))
    assert f"2026-01-15, {due}\n" in plant_text(rows)
