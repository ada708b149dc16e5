"""Loss of whole scans, which moves no word, is detected by the periods of a square wave on digital input 0."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import DeviceError
from acquisition.dataq.stream import (
    CLOCK_BIT,
    CLOCK_PERIOD_TOLERANCE,
    CLOCK_TRAINING_PERIODS,
    HELD_BACK_BYTES,
    CodeBlock,
    ScanDecoder,
)

N = 4000


def scans(period: float, jitter: float = 0.0, start: float = 0.3) -> NDArray[np.int16]:
    """Return two noisy inputs and the digital word, shape (N, 3). Input 0 alternates with this period (scans)."""
    random = np.random.default_rng(1)
    phase = np.arange(N) + random.uniform(-jitter, jitter, N)
    high = (phase / period + start) % 1 < 0.5
    return np.column_stack([random.normal(scale=20.0, size=(N, 2)), 0x7E00 + 0x0100 * high]).astype("<i2")


def decoded(stream: bytes, cuts: list[int]) -> list[CodeBlock]:
    decoder = ScanDecoder(2, digital_word=True, clock=True)
    edges = [0, *sorted(cuts), len(stream)]
    return [piece for start, end in itertools.pairwise(edges) for piece in decoder.feed(stream[start:end])]


def gaps(pieces: list[CodeBlock]) -> list[tuple[int, int]]:
    """Return the scans before each gap and the scans missing in it."""
    came = np.cumsum([0] + [codes.shape[1] for codes, _ in pieces])
    return [(int(at), lost) for at, (_, lost) in zip(came[:-1], pieces, strict=True) if lost]


@settings(max_examples=60, deadline=None)
@given(period=st.floats(6.5, 99.0), start=st.floats(0, 1), cuts=st.lists(st.integers(0, 6 * N), max_size=30))
def test_an_even_wave_is_no_loss(period: float, start: float, cuts: list[int]) -> None:
    words = scans(period, 0.2, start)
    pieces = decoded(words.tobytes(), cuts)
    assert gaps(pieces) == []
    codes = np.concatenate([codes for codes, _ in pieces], axis=1)
    assert np.array_equal(codes, words[: N - -(-HELD_BACK_BYTES // 6), :2].T)


EDGE_ERROR = 1 + 2 / CLOCK_TRAINING_PERIODS
"""Error of an interval between two edges (scans): one scan for each edge and for the measured period."""


@settings(max_examples=150, deadline=None)
@given(
    period=st.floats(8.0, 99.0),
    packets=st.sampled_from([3, 6, 9]),
    at=st.integers((CLOCK_TRAINING_PERIODS + 3) * 99, N - 600),
    inside=st.integers(0, 5),
    cuts=st.lists(st.integers(0, 6 * (N - 96)), max_size=10),
)
@example(period=51.4296875, packets=6, at=2452, inside=0, cuts=[])  # jumps up at the cut, where an edge is due
@example(period=17.543, packets=9, at=2252, inside=2, cuts=[])  # so does the edge after it
@example(period=30.5, packets=6, at=2338, inside=4, cuts=[])  # three scans beyond whole periods, in two parts
@example(period=10.24, packets=6, at=2413, inside=2, cuts=[])
def test_whole_scans_that_are_lost_are_reported_with_their_number(
    period: float, packets: int, at: int, inside: int, cuts: list[int]
) -> None:
    """Lose three packets of 64 bytes, 32 scans of 6 bytes. A jump of the wave at the cut separates two parts."""
    lost = 32 * packets // 3
    beyond = min(lost % period, -lost % period)
    words = scans(period)
    stream, high = words.tobytes(), words[:, 2] & CLOCK_BIT != 0
    cut, jumps_up = 6 * at + inside, bool(high[at + lost] and not high[at - 1])
    found = gaps(decoded(stream[:cut] + stream[cut + 6 * lost :], cuts))
    if beyond < 1:  # as good as whole periods
        return
    if not found:
        assert beyond <= (1 + jumps_up) * CLOCK_PERIOD_TOLERANCE + EDGE_ERROR
        return
    assert all(at <= place <= at + 2 * period + 2 for place, _ in found)
    error = abs((sum(number for _, number in found) - lost + period / 2) % period - period / 2)
    assert error <= EDGE_ERROR + 0.5 * len(found) + jumps_up * CLOCK_PERIOD_TOLERANCE


def test_bytes_that_are_lost_are_reported_once() -> None:
    stream = scans(50.0).tobytes()
    ((place, number),) = gaps(decoded(stream[:12_000] + stream[12_064:], []))
    assert place == 2000
    assert number in (11, 12)


@pytest.mark.parametrize("period", [3.0, 150.0, np.inf])
def test_a_wave_that_cannot_be_followed_is_rejected(period: float) -> None:
    with pytest.raises(DeviceError, match=r"digital input 0.* 6 to 100 "):
        decoded(scans(period).tobytes(), [])


def test_a_generator_that_is_unplugged_is_reported() -> None:
    words = scans(50.0)
    words[2000:, 2] |= 0x0100
    with pytest.raises(DeviceError, match=r"digital input 0.* digital_clock"):
        decoded(words.tobytes(), [])


def test_an_uneven_wave_is_rejected() -> None:
    words = scans(50.0)
    high = np.repeat(np.random.default_rng(2).random(N // 10) < 0.5, 10)
    words[:, 2] = 0x7E00 + 0x0100 * high
    with pytest.raises(DeviceError, match="digital input 0"):
        decoded(words.tobytes(), [])
