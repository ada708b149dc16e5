"""TAPS/1 frames against the published byte vectors of the protocol, and round trips."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.taps.protocol import (
    MAX_FRAME,
    DeviceStatus,
    Frame,
    FrameDecoder,
    MessageType,
    decode_data,
    decode_frame,
    encode_data,
    encode_frame,
)

pytestmark = pytest.mark.quick

SCANS = np.array([[0, -1, 256], [1, 32767, 32767]], np.int32)
VECTORS = {
    "HELLO seq 0": (Frame(MessageType.HELLO), "02 01 01 01 01 01 01 01 05 f7 df 88 a9 00"),
    "START seq 1": (
        Frame(MessageType.START, 1, bytes(8)),
        "02 06 01 01 02 01 01 01 01 01 01 01 01 01 01 01 05 de 6e 8f 24 00",
    ),
    "STOP seq 2": (Frame(MessageType.STOP, 2), "02 07 01 01 02 02 01 01 05 fb 1e ee c5 00"),
    "DATA seq 5": (
        Frame(MessageType.DATA, 5, encode_data(1024, SCANS, 16, overload=2), session=1),
        "02 10 02 01 02 05 01 01 01 02 04 01 01 01 01 01 02 03 02 02 02 02 01 01 01 01 02 01 05 ff ff ff 7f 08 01 ff "
        "7f 82 f6 1c f5 00",
    ),
}
frames = st.builds(
    Frame,
    type=st.sampled_from(MessageType),
    seq=st.integers(0, 2**32 - 1),
    body=st.binary(max_size=300),
    session=st.integers(0, 0xFFFF),
    flags=st.integers(0, 255),
)


@pytest.mark.parametrize("name", VECTORS)
def test_published_vectors_are_met_byte_by_byte(name: str) -> None:
    frame, hexadecimal = VECTORS[name]
    assert encode_frame(frame) == bytes.fromhex(hexadecimal)
    assert FrameDecoder().feed(bytes.fromhex(hexadecimal)) == [frame]


def test_data_vector_holds_the_published_scans() -> None:
    frame = decode_frame(bytes.fromhex(VECTORS["DATA seq 5"][1])[:-1])
    assert frame is not None
    block = decode_data(frame.body)
    assert block.first_scan == 1024
    assert block.overload == 0b10
    assert block.codes.T.tolist() == [[0, 1], [-1, 32767], [256, 32767]]


@given(st.lists(frames, max_size=5), st.integers(1, 50))
def test_a_stream_cut_anywhere_gives_the_same_frames(sent: list[Frame], step: int) -> None:
    stream = b"".join(encode_frame(frame) for frame in sent)
    decoder = FrameDecoder()
    received = [frame for i in range(0, len(stream), step) for frame in decoder.feed(stream[i : i + step])]
    assert received == sent
    assert decoder.dropped == 0


@given(frames, st.data())
def test_a_corrupted_byte_is_rejected_and_never_another_frame(frame: Frame, data: st.DataObject) -> None:
    encoded = bytearray(encode_frame(frame))
    place = data.draw(st.integers(0, len(encoded) - 2))
    encoded[place] ^= data.draw(st.integers(1, 255))
    assert FrameDecoder().feed(bytes(encoded)) == []


@given(
    st.sampled_from([16, 24, 32]).flatmap(
        lambda bits: st.tuples(
            st.just(bits),
            st.lists(st.tuples(*[st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)] * 2), min_size=1, max_size=40),
        )
    ),
    st.integers(0, 2**64 - 1),
    st.integers(0, 3),
)
def test_scans_survive_every_word_length(coded: tuple[int, list[tuple[int, int]]], first: int, overload: int) -> None:
    bits, scans = coded
    codes = np.array(scans, np.int32).T
    block = decode_data(encode_data(first, codes, bits, overload))
    assert np.array_equal(block.codes, codes)
    assert (block.first_scan, block.overload) == (first, overload)


def test_status_survives() -> None:
    status = DeviceStatus(123456, 123000, 40, 2, -12.34)
    assert DeviceStatus.decode(status.encode()) == status


def test_mid_stream_start_discards_up_to_the_first_delimiter() -> None:
    whole = encode_frame(Frame(MessageType.STOP, 2))
    decoder = FrameDecoder()
    assert decoder.feed(whole[5:] + whole) == [Frame(MessageType.STOP, 2)]
    assert decoder.dropped == 1


def test_endless_noise_without_a_delimiter_is_not_kept() -> None:
    decoder = FrameDecoder()
    for _ in range(50):
        decoder.feed(b"\x01" * MAX_FRAME)
    assert decoder.feed(b"\x00" + encode_frame(Frame(MessageType.HELLO))) == [Frame(MessageType.HELLO)]


def test_too_long_a_frame_is_rejected() -> None:
    with pytest.raises(ValueError, match="longer than 8192"):
        encode_frame(Frame(MessageType.DATA, body=bytes(MAX_FRAME)))


@pytest.mark.parametrize("body", [b"", encode_data(0, SCANS)[:-1], encode_data(0, SCANS) + b"\x00"])
def test_a_data_body_of_the_wrong_length_is_rejected(body: bytes) -> None:
    with pytest.raises(ValueError, match="DATA body"):
        decode_data(body)
