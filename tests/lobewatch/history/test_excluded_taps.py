"""Rows of excluded tap tests, followed from the tests before them."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import numpy as np
import pytest

from acquisition import Circumstances, TapTest, from_accelerance, new_tap_id
from lobewatch.history.tap_measurements import measure_excluded_taps
from lobewatch.machine.folder_updates import exclude_entry
from modal import Mode, synthesize_frf

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
LINES = np.arange(4.0, 4000.0, 4.0)


def test_an_excluded_test_is_followed_from_the_one_before_it(shop: Shop) -> None:
    shop.tap(0, 1400.0)
    text = shop.folder.toml.read_text("utf-8")
    about = Circumstances("m", shop.start + timedelta(days=10), "reference", "x", "", text)
    frf = synthesize_frf([Mode(1410.0, 0.03, 3.5e7), Mode(2000.0, 0.03, 3.5e7)], LINES)
    tap = TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance))
    shop.folder.commit(tap)
    shop.tap(20, 2000.0)
    exclude_entry(shop.folder, tap.id, "two modes")
    logbook = shop.logbook
    (row,) = measure_excluded_taps(shop.folder, logbook.files.excluded, logbook.history.rows)
    assert row.tap_id == tap.id
    assert row.frequency.value == pytest.approx(1410.0, rel=1e-3)
