"""Test the reason for missing dates of a series whose tests have open questions."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lobewatch.show.trend import open_questions_text

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("asked", "has_forecast", "text"),
    [
        (0, False, ""),
        (1, False, "unknown, 1 test with open questions does not count"),
        (3, False, "unknown, 3 tests with open questions do not count"),
        (3, True, ""),
    ],
)
def test_tests_with_open_questions_are_counted_without_a_forecast(asked: int, has_forecast: bool, text: str) -> None:
    frequency = SimpleNamespace(has_questions=np.arange(9) < asked)
    trend = SimpleNamespace(forecast="forecast" if has_forecast else None)
    series = SimpleNamespace(history=SimpleNamespace(frequency=frequency), trend=trend)
    outlook: Any = SimpleNamespace(status=SimpleNamespace(series=(series,)))
    assert open_questions_text(outlook) == text
