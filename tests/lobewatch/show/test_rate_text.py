"""Test the rate in words: within its interval, and no negative zero."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from lobewatch.monitoring.forecast import Rate
from lobewatch.show.trend import rate_text

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("rate", "text"),
    [
        (Rate(-0.1532, -0.1711, -0.1402), "-0.15 % a month now (95 % interval -0.17 to -0.14)"),
        (Rate(-0.0005, 0.0, 0.0), "+0.0000 % a month now (95 % interval +0.0000 to +0.0000)"),
        (Rate(-0.0001, -0.2, 0.3), "+0.00 % a month now (95 % interval -0.20 to +0.30)"),
    ],
)
def test_a_rate_is_within_its_interval(rate: Rate, text: str) -> None:
    trend: Any = SimpleNamespace(rate=rate)
    assert rate_text(trend) == text
