"""Columns of the history: limits and verdicts of programs, and values not computed yet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lobewatch.history.history import make_export_columns

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def test_limits_and_words_of_programs_are_in_the_row_they_were_asked_of(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    newest = shop.tap(30, 1650.0)
    logbook = shop.logbook
    rulings = logbook.stored_verdicts(newest)
    columns = make_export_columns(logbook.history, logbook.machine).columns
    expected = [rulings[name].limit for name in "ABC"]
    assert np.all(np.isfinite(expected))
    assert np.asarray(columns["program_limit"])[1] == pytest.approx(expected)
    assert np.all(np.isnan(np.asarray(columns["program_limit"])[0]))
    assert list(columns["program_verdict"]) == ["", "\n".join(rulings[name].stability for name in "ABC")]
