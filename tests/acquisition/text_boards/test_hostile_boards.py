"""Hostile bytes of a text board: bounded memory and time, broken rows, and good rows after them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.text_boards.decoders import (
    MAX_LINE_BYTES,
    MAX_UNFRAMED_BYTES,
    FrameFormat,
    LineDecoder,
    PrintedRows,
    ScanCounter,
    SimpleFrameDecoder,
)

GOOD = [b"7,0.25,-0.5", b"8,0.5,1"]


def decode(decoder: LineDecoder, lines: list[bytes]) -> list[PrintedRows]:
    return list(decoder.feed(b"\n" + b"\n".join(lines) + b"\n"))


@pytest.mark.parametrize(
    "line",
    [b"1e300,0,0", b"-1e19,0,0", b"4294967296,0,0", b"9,1e30,0", b"9,nan,0", b"9,0,inf", b"9,0,0" + b" " * 300 + b","],
)
def test_a_number_that_no_board_prints_is_a_broken_line(line: bytes) -> None:
    first, second = decode(LineDecoder(), [GOOD[0], line, GOOD[1]])
    assert first.rows.tolist() == [[7, 0.25, -0.5]]
    assert (second.rows.tolist(), second.broken_before) == ([[8, 0.5, 1]], 1)


def test_a_long_line_is_broken_and_no_part_of_it_is_kept() -> None:
    decoder = LineDecoder()
    rows = decode(decoder, [GOOD[0]])
    for _ in range(50):
        rows += list(decoder.feed(b"1," * MAX_LINE_BYTES))
    rows += list(decoder.feed(b"\n" + GOOD[1] + b"\n"))
    assert [part.broken_before for part in rows] == [0, 1]


@given(st.lists(st.binary(max_size=40), max_size=20), st.integers(1, 4))
def test_any_lines_give_finite_scans_and_a_bounded_loss(lines: list[bytes], values: int) -> None:
    decoder, counter = LineDecoder((values, values + 1)), ScanCounter(values)
    for printed in decode(decoder, lines):
        for scans, lost in counter.split_runs(printed):
            assert scans.shape[0] == values
            assert np.isfinite(scans).all()
            assert 0 <= lost < 2**32


@pytest.mark.parametrize("checksum", [True, False])
def test_bytes_without_frames_are_dropped_and_frames_after_them_are_read(checksum: bool) -> None:
    decoder = SimpleFrameDecoder(FrameFormat(b"\xaa\xbb", checksum=checksum))
    payload = np.array([300, -5], "<i2").tobytes()
    frame = b"\xaa\xbb" + payload + bytes([sum(payload) & 0xFF]) * checksum
    list(decoder.feed(frame * 40))
    for _ in range(4):
        assert not list(decoder.feed(b"\x00" * MAX_UNFRAMED_BYTES))
    (rows,) = decoder.feed(frame * 40)
    assert rows.broken_before >= 1
    assert set(map(tuple, rows.rows.tolist())) == {(300, -5)}
