"""Series without scatter: no tap test resolves less than the smallest scatter, and rounding is no finding."""

import math
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from lobewatch.arrays import Floats
from lobewatch.monitoring.level_model import MIN_SCATTER
from lobewatch.monitoring.trend import TapValue, Trend, fit_trend

FIRST = datetime(2026, 1, 1, tzinfo=UTC)


def fitted(percents: Floats) -> Trend:
    values = (1000 * np.exp(percents / 100)).tolist()
    taps = [TapValue(FIRST + timedelta(days=30 * i), value) for i, value in enumerate(values)]
    return fit_trend(taps, taps[-1].time)


def test_equal_values_have_the_smallest_scatter_and_no_change() -> None:
    trend = fitted(np.zeros(12))
    newest = trend.drop_model.drop_at(float(trend.drops[-1]), math.nan, "", math.nan)
    assert newest.value == pytest.approx(0, abs=1e-9)
    assert MIN_SCATTER < newest.half_width < 5 * MIN_SCATTER
    assert not newest.is_proven
    assert math.isfinite(trend.detection.scores[-1])
    assert trend.likeliest_shape is not None
    assert trend.likeliest_shape.kind == "none"


def test_rounding_is_no_drop() -> None:
    trend = fitted(np.linspace(0.0, -1.3e-4, 14))
    assert not trend.detection.drops
    assert not trend.drop_model.drop_at(float(trend.drops[-1]), math.nan, "", math.nan).is_proven


@pytest.mark.parametrize("begin", [5, 8, 11])
@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_a_step_without_scatter_is_a_step_at_its_date(begin: int, noise: float) -> None:
    drops = 2.0 * (np.arange(16) >= begin) + noise * np.random.default_rng(begin).normal(size=16)
    found = fitted(-drops).open_drop
    assert found is not None
    assert (found.change.kind, found.change.point) == ("step", begin)
    assert abs(found.change.size - 2) <= found.change.half_width < 5 * MIN_SCATTER
