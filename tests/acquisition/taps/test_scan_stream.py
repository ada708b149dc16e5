"""Damaged TAPS/1 streams: rejected or unchanged, never wrong samples (except for collisions of CRC-32)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import Event, EventKind
from acquisition.taps.emulator import NOISE_BYTES
from acquisition.taps.protocol import (
    LOST_BEFORE_FLAG,
    MAX_ENCODED_FRAME,
    MAX_FRAME,
    EventLog,
    Frame,
    FrameDecoder,
    MessageType,
    decode_event,
    encode_data,
    encode_event,
    encode_frame,
)
from acquisition.taps.source import ScanStream

SCANS = 9
SESSION = 3


def scans(first: int, n: int = SCANS) -> NDArray[np.int32]:
    """Return scans that tell their index."""
    index = np.arange(first, first + n, dtype=np.int32)
    return np.stack([index, -7 * index])


def data(first: int, seq: int = 0, bits: int = 16, **header: int) -> Frame:
    return Frame(MessageType.DATA, seq, encode_data(first, scans(first), bits), **({"session": SESSION} | header))


damages = st.lists(
    st.tuples(
        st.sampled_from(["flip", "cut", "insert", "repeat"]),
        st.floats(0, 1, exclude_max=True),
        st.integers(1, 120),
        st.binary(min_size=1, max_size=30),
    ),
    max_size=8,
)


def damaged(stream: bytes, damage: list[tuple[str, float, int, bytes]]) -> bytes:
    for kind, place, length, noise in damage:
        at = int(place * len(stream))
        if kind == "flip":
            stream = stream[:at] + bytes([stream[at] ^ 1 << length % 8]) + stream[at + 1 :] if stream else stream
        elif kind == "cut":
            stream = stream[:at] + stream[at + length :]
        elif kind == "insert":
            stream = stream[:at] + noise + stream[at:]
        else:
            stream = stream[: at + length] + stream[at:]
    return stream


@given(damages, st.sampled_from([16, 24, 32]), st.integers(1, 400))
def test_whatever_happens_to_the_bytes_no_sample_is_wrong(
    damage: list[tuple[str, float, int, bytes]], bits: int, step: int
) -> None:
    sent = b"".join(encode_frame(data(SCANS * i, i, bits)) for i in range(12))
    arrived = damaged(sent, damage)
    decoder, stream = FrameDecoder(), ScanStream(SESSION, 2)
    frames = [frame for i in range(0, len(arrived), step) for frame in decoder.feed(arrived[i : i + step])]
    blocks = [block for frame in frames if (block := stream.accept(frame)) is not None]
    end = 0
    for block in blocks:
        assert np.array_equal(block.codes, scans(block.first_scan))
        assert block.first_scan == end + block.lost_before
        end = block.first_scan + SCANS
    assert stream.lost_scans + SCANS * len(blocks) == end
    assert len(blocks) + stream.refused == len(frames)
    if not damage:
        assert len(blocks) == 12
        assert decoder.dropped == 0


@given(st.binary(max_size=600), st.binary(max_size=600))
def test_noise_around_a_frame_gives_nothing_but_that_frame(before: bytes, after: bytes) -> None:
    frame = data(0)
    found = FrameDecoder().feed(before + b"\x00" + encode_frame(frame) + after + b"\x00")
    assert found == [frame]


def test_a_run_too_long_is_thrown_away_up_to_its_delimiter_and_no_further() -> None:
    longest = Frame(MessageType.DATA, body=bytes(range(1, 256)) * 32 + bytes(MAX_FRAME - 12 - 255 * 32))
    whole = encode_frame(longest)
    assert len(whole) <= MAX_ENCODED_FRAME + 1
    decoder = FrameDecoder()
    assert decoder.feed(whole) == [longest]
    good = encode_frame(data(0))
    for piece in (
        b"\x01" * MAX_ENCODED_FRAME,
        b"\x02" * 3 * MAX_ENCODED_FRAME,
        good,
    ):  # the end of the run looks like a frame
        assert decoder.feed(piece) == []
    assert decoder.dropped == 1
    assert decoder.feed(good) == [data(0)]


def test_duplicates_and_late_frames_are_rejected_and_counted() -> None:
    stream = ScanStream(SESSION, 2)
    blocks = [stream.accept(data(first)) for first in (0, 9, 9, 0, 4, 18)]
    assert [block and block.first_scan for block in blocks] == [0, 9, None, None, None, 18]
    assert (stream.refused, stream.lost_scans) == (3, 0)


def test_a_jump_of_the_index_is_what_was_lost_flagged_or_not() -> None:
    for flags in (0, LOST_BEFORE_FLAG):
        stream = ScanStream(SESSION, 2)
        stream.accept(data(0))
        block = stream.accept(data(100, flags=flags))
        assert block is not None
        assert block.lost_before == stream.lost_scans == 91


def test_a_loss_without_a_jump_still_spoils_the_hit_it_is_in() -> None:
    stream = ScanStream(SESSION, 2)
    stream.accept(data(0))
    block = stream.accept(data(9, flags=LOST_BEFORE_FLAG))
    assert block is not None
    assert block.lost_before == 1


@pytest.mark.parametrize(
    "frame",
    [
        Frame(MessageType.DATA, 0, encode_data(0, np.zeros((3, 4), np.int32)), SESSION),
        Frame(MessageType.DATA, 0, encode_data(0, scans(0))[:-1], SESSION),
        Frame(MessageType.DATA, 0, b"", SESSION),
    ],
    ids=["three channels", "short", "empty"],
)
def test_a_frame_that_contradicts_the_configuration_is_rejected(frame: Frame) -> None:
    stream = ScanStream(SESSION, 2)
    assert stream.accept(frame) is None
    assert (stream.refused, stream.foreign) == (1, 0)


def test_scans_of_another_session_are_none_of_this() -> None:
    stream = ScanStream(SESSION, 2)
    assert stream.accept(data(0, session=SESSION + 1)) is None
    assert (stream.refused, stream.foreign, stream.lost_scans) == (0, 1, 0)
    assert stream.accept(data(0)) is not None
    assert stream.foreign == 0


@pytest.mark.parametrize(
    ("event", "body"),
    [
        (Event(EventKind.BUTTON), "01 ff 01 00 00 00 00 00 00 00 00"),
        (Event(EventKind.CABLE, True, 1, 258), "02 01 01 02 01 00 00 00 00 00 00"),
        (Event(EventKind.SENSOR_BIAS, False, 0, 2**40), "03 00 00 00 00 00 00 00 01 00 00"),
    ],
)
def test_event_bodies_byte_by_byte(event: Event, body: str) -> None:
    assert encode_event(event) == bytes.fromhex(body)
    assert decode_event(bytes.fromhex(body)) == event


def test_an_event_that_comes_twice_happens_once_and_rubbish_is_none() -> None:
    log = EventLog()
    press = Event(EventKind.BUTTON)
    pressed = encode_event(press)
    for seq, body in [(1, pressed), (1, pressed), (2, pressed), (3, NOISE_BYTES), (4, b"")]:
        log.add(Frame(MessageType.EVENT, seq, body, SESSION))
    assert list(log.new) == [press, press]
    assert log.fault({}) == ""


def test_faults_stand_until_they_are_gone() -> None:
    log = EventLog()
    events = [
        Event(EventKind.CABLE, True, 5),
        Event(EventKind.SENSOR_BIAS),
        Event(0x77),
        Event(EventKind.CABLE, False, 5),
    ]
    said = []
    for seq, event in enumerate(events):
        log.add(Frame(MessageType.EVENT, seq, encode_event(event)))
        said.append(log.fault({}))
    assert "cable of the (channel 5) sensor" in said[0]
    assert said[1] == said[2] == f"{said[0]} {said[3]}"
    assert "voltage of the force or acceleration sensor" in said[3]
    assert len(log.new) == 4
