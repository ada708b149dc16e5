"""An hour of samples by the clock from the Cortex-M3 of QEMU: none wrong, none lost in silence."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition import TapsSource

RATE = 25_600.0
MINUTES = 60.0
PERIOD = 1 << 15
"""Period of the scans, each of which is its own number (16 bits with sign)."""
RING = 1024


@pytest.mark.long
@pytest.mark.timeout(0)
def test_an_hour_without_a_scan_lost_in_silence(switched_on: Callable[..., Any]) -> None:
    number = np.arange(PERIOD, dtype=np.int32)
    scans = received = 0
    with (
        switched_on("qemu", np.stack([number, -1 - number]), by_clock=True) as board,
        TapsSource(board.port) as source,
    ):
        source.start()
        begun = time.monotonic()
        for block in source.blocks():
            right = (block.first_scan + np.arange(block.codes.shape[1])) % PERIOD
            assert np.array_equal(block.codes, [right, -1 - right])
            assert block.first_scan == scans + block.lost_before
            scans = block.first_scan + block.codes.shape[1]
            received += block.codes.shape[1]
            if time.monotonic() - begun > 60 * MINUTES:
                break
        seconds = time.monotonic() - begun
        print(f"{received} scans, {source.lost_scans} lost and told, {scans / seconds:.2f} a second, {source.status}")  # noqa: T201
        assert received + source.lost_scans == scans
        assert source.dropped_frames == source.overruns == 0
        assert scans / seconds == pytest.approx(RATE, rel=2e-3)
        assert source.status is not None
        assert 0 <= source.status.samples_taken - source.status.samples_sent - source.lost_scans < RING
