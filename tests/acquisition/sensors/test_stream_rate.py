"""Sample rate measured while a stream is read: closed forms, busy computers, rates that are or become wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Block
from acquisition.sensors.stream_rate import StreamRate

pytestmark = pytest.mark.quick
RATE, PER_BLOCK = 8000.0, 160


def stream(arrivals: Sequence[float] | NDArray[np.float64]) -> StreamRate:
    """Read blocks of 20 ms that arrive at these times."""
    ticks = iter(arrivals)
    read = StreamRate(RATE, clock=lambda: float(next(ticks)))
    for number in range(len(arrivals)):
        read.add(Block(number * PER_BLOCK, np.zeros((1, PER_BLOCK), dtype=np.int32)))
    return read


def due(seconds: float, rate: float) -> NDArray[np.float64]:
    return np.arange(1, int(seconds * rate / PER_BLOCK)) * PER_BLOCK / rate


def busy(arrivals: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Delay the blocks as a computer does that pauses for up to 0.5 s, every 0.5 s on average."""
    late, at = arrivals + random.uniform(0, 2e-3, arrivals.size), 0.0
    while at < arrivals[-1]:
        at += random.exponential(0.5)
        end = at + random.uniform(0, 0.5)
        waiting = (late >= at) & (late < end)
        late[waiting] = end + 1e-4 * np.arange(np.count_nonzero(waiting))
        at = end
    return np.maximum.accumulate(late)


def test_an_even_stream_has_its_rate() -> None:
    read = stream(due(10.0, 7600.0))
    measured = read.measure()
    assert measured is not None
    assert measured.rate == pytest.approx(7600.0, rel=1e-9)
    assert 0 < measured.std < 1.0  # 1 ms / sqrt(6) in 10 s is 0.3 Hz
    found = read.find_deviation()
    assert found is not None
    assert found.rate == pytest.approx(7600.0, rel=1e-9)


@pytest.mark.parametrize(("share", "is_off"), [(1.0025, True), (1.0015, False), (0.9985, False), (0.9975, True)])
def test_a_minute_shows_a_rate_more_than_0_2_percent_off(share: float, is_off: bool) -> None:
    read = stream(due(60.0, share * RATE))
    assert read.is_verified
    assert (read.find_deviation() is not None) is is_off


@pytest.mark.parametrize("seconds", [4.0, 7.0, 20.0])
def test_a_busy_computer_refuses_no_honest_rate_and_hides_no_wrong_one(seconds: float) -> None:
    random = np.random.default_rng(1)
    honest = [stream(busy(due(seconds, RATE * (1 + random.uniform(-1e-4, 1e-4))), random)) for _ in range(25)]
    assert not any(read.find_deviation() for read in honest)
    wrong = [stream(busy(due(seconds, 0.95 * RATE), random)) for _ in range(25)]
    assert all(read.find_deviation() or not read.is_verified for read in wrong)
    if seconds == 20.0:
        assert all(read.is_verified for read in honest)
        assert all(read.find_deviation() for read in wrong)


def test_a_rate_that_falls_during_the_stream_is_found() -> None:
    first = due(20.0, RATE)
    assert stream(np.concatenate([first, first[-1] + due(6.0, 0.95 * RATE)])).find_deviation() is not None


def test_a_short_stream_verifies_nothing() -> None:
    assert stream(due(0.5, RATE)).measure() is None
    short = stream(due(1.5, RATE))
    assert (short.find_deviation(), short.is_verified) == (None, False)


def test_a_stream_as_fast_as_it_is_read_verifies_nothing_and_is_not_refused() -> None:
    pauses = np.random.default_rng(2).exponential(3e-3, 3000)
    read = stream(np.cumsum(np.where(np.arange(3000) % 23, 1e-4, 20 * pauses)))
    assert (read.find_deviation(), read.is_verified) == (None, False)
