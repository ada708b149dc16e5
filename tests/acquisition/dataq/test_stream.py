"""Byte streams of a DATAQ device: they decode to the same scans wherever they are cut, and losses are detected."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition.dataq.stream import HELD_BACK_BYTES, CodeBlock, ScanDecoder

PULLED_UP = 0x7F00


def noise(n: int, seed: int, digital: int | None = PULLED_UP) -> NDArray[np.int16]:
    """Return scans of two noisy inputs and optionally the digital word, shape (n, 2 or 3)."""
    words = np.random.default_rng(seed).normal(scale=20.0, size=(n, 2)).astype("<i2")
    return words if digital is None else np.column_stack([words, np.full(n, digital, "<i2")])


def decoded(stream: bytes, digital: bool = True, cuts: list[int] | None = None) -> list[CodeBlock]:
    decoder = ScanDecoder(2, digital)
    edges = [0, *sorted(cuts or []), len(stream)]
    return [piece for start, end in itertools.pairwise(edges) for piece in decoder.feed(stream[start:end])]


def placed(pieces: list[CodeBlock]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return codes (2, n) and the index of each scan."""
    indices, at = [], 0
    for codes, lost in pieces:
        indices.append(at + lost + np.arange(codes.shape[1]))
        at += lost + codes.shape[1]
    return np.concatenate([codes for codes, _ in pieces], axis=1), np.concatenate(indices)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 99), digital=st.booleans(), cuts=st.lists(st.integers(0, 1800), max_size=40))
def test_a_stream_cut_anywhere_gives_the_same_scans(seed: int, digital: bool, cuts: list[int]) -> None:
    words = noise(300, seed, PULLED_UP if digital else None)
    codes, indices = placed(decoded(words.tobytes(), digital, [min(cut, words.nbytes) for cut in cuts]))
    assert codes.shape[1] == 300 - -(-HELD_BACK_BYTES // (2 * words.shape[1]))
    assert np.array_equal(codes, words[: codes.shape[1], :2].T)
    assert np.array_equal(indices, np.arange(codes.shape[1]))


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 99),
    at=st.integers(0, 2400),
    lost=st.sampled_from([1, 3, 5, 64, 128]),
    cuts=st.lists(st.integers(0, 3500), max_size=10),
)
def test_lost_bytes_are_found_and_the_scans_after_them_are_in_their_place(
    seed: int, at: int, lost: int, cuts: list[int]
) -> None:
    words = noise(600, seed)
    stream = words.tobytes()
    damaged = stream[:at] + stream[at + lost :]
    pieces = decoded(damaged, cuts=[min(cut, len(damaged)) for cut in cuts])
    codes, indices = placed(pieces)
    assert [bool(missing) for _, missing in pieces].count(True) == 1
    begun = at < 6  # a stream that is damaged in its first scan
    assert indices[-1] == 599 - 6 or begun
    assert np.array_equal(codes, words[indices, :2].T)


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 99),
    places=st.lists(st.tuples(st.integers(200, 9000), st.integers(1, 200).filter(lambda n: n % 6)), max_size=6),
)
@example(seed=0, places=[(200, 1), (307, 5)])
@example(seed=0, places=[(1200, 64), (1290, 128)])
def test_no_scan_is_ever_made_up(seed: int, places: list[tuple[int, int]]) -> None:
    """Check that each decoded scan was sent, in order, unless the bytes of whole scans are lost within one scan."""
    words = noise(1600, seed)
    stream = words.tobytes()
    before = 0
    for at, lost in sorted(places):
        if at >= before + 12:
            stream = stream[:at] + stream[at + lost :]
            before = at
    sent = [tuple(scan) for scan in words[:, :2].tolist()]
    at = -1
    for scan in placed(decoded(stream))[0].T.tolist():
        at = sent.index(tuple(scan), at + 1)


def test_three_packets_in_a_row_are_not_seen_by_the_digital_word() -> None:
    """Lose 192 bytes, 32 scans of 6 bytes: the limit of this detector, see docs/devices.md."""
    stream = noise(600, 1).tobytes()
    assert not any(lost for _, lost in decoded(stream[:600] + stream[600 + 192 :]))


def test_without_the_digital_word_nothing_is_seen() -> None:
    stream = noise(600, 1, None).tobytes()
    assert not any(lost for _, lost in decoded(stream[:600] + stream[664:], digital=False))


def test_a_digital_input_that_changes_is_no_loss() -> None:
    words = noise(600, 1)
    words[250:, 2] = 0x7E00
    codes, indices = placed(decoded(words.tobytes()))
    assert np.array_equal(codes, words[: codes.shape[1], :2].T)
    assert np.array_equal(indices, np.arange(codes.shape[1]))


def test_digital_inputs_at_zero_serve_too_where_the_others_are_noisy() -> None:
    words = noise(600, 1, digital=0)
    stream = words.tobytes()
    codes, indices = placed(decoded(stream[:601] + stream[665:]))
    assert indices[-1] == 593
    assert np.array_equal(codes, words[indices, :2].T)


def test_the_text_of_an_overflow_is_never_taken_for_samples() -> None:
    words = noise(500, 1)
    decoder = ScanDecoder(2, digital_word=True)
    pieces = decoder.feed(words.tobytes() + b"stop 01\r")
    assert decoder.has_overflowed()
    codes, _ = placed(pieces)
    assert np.array_equal(codes, words[: codes.shape[1], :2].T)
    decoder.begin(lost=77)
    assert not decoder.has_overflowed()
    ((codes, lost),) = decoder.feed(words.tobytes())
    assert lost == 77
    assert np.array_equal(codes, words[: codes.shape[1], :2].T)


@pytest.mark.parametrize("digital", [0x0001, -32768, 0x7F80])
def test_words_that_cannot_be_digital_inputs_are_not_taken_for_them(digital: int) -> None:
    assert decoded(noise(600, 1, digital).tobytes()) == []
