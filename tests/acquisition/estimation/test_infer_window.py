"""Unstated exponential windows, inferred from the noise of the hits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Hit, infer_window
from tests.modal.test_hit_scatter import tap


def under(hit: Hit, time_constant: float) -> Hit:
    """Return the hit with a response under a window from the start of the record."""
    fall = np.exp(-np.arange(hit.force.size) / hit.sample_rate / time_constant)
    return replace(hit, acceleration=hit.acceleration * fall)


@pytest.mark.parametrize("time_constant", [0.02, 0.05, 0.1, 0.2])
def test_time_constant_is_found_within_5_percent(time_constant: float) -> None:
    hits = [under(hit, time_constant) for hit in tap(0, 5)]
    assert infer_window(hits) == pytest.approx(time_constant, rel=0.05)


def test_hits_without_a_window_show_none() -> None:
    assert [infer_window(tap(seed, hits)) for seed in range(40) for hits in (1, 5)] == [None] * 80
    humming = [
        replace(hit, acceleration=hit.acceleration + 50 * np.sin(0.0123 * np.arange(hit.force.size) + phase))
        for phase in range(10)
        for hit in tap(phase, 1)
    ]
    assert [infer_window([hit]) for hit in humming] == [None] * 10


def test_what_cannot_be_classified_is_not() -> None:
    (hit,) = tap(0, 1)
    padded = np.append(hit.acceleration[:-2000], np.zeros(2000))
    assert infer_window([replace(hit, acceleration=padded)]) is None
    short = under(hit, 0.05)
    assert (
        infer_window([replace(short, force=short.force[500:], acceleration=short.acceleration[500:], pre_trigger=12)])
        is None
    )
    assert infer_window([]) is None
