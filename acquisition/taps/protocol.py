"""TAPS/1, the open frame for data acquisition boards: frames and their bodies, byte by byte.

Frame = COBS( type u8 | flags u8 | session u16 | seq u32 | body | crc32 u32 ) 0x00, little-endian. The CRC is
zlib.crc32 of all before it. seq counts all frames of one sender; session changes at each START.
"""

from __future__ import annotations

import enum
import struct
import zlib
from dataclasses import dataclass

import numpy as np
from cobs import cobs
from numpy.typing import NDArray

from acquisition.channel import Block

MAX_FRAME = 8192
"""Longest decoded frame (bytes)."""
LOST_BEFORE = 0x01
"""Flag of a DATA frame: the device lost samples before it."""
SAMPLE_BITS = (16, 24, 32)
"""ADC word of DATA formats 0 (i16), 1 (i24 packed) and 2 (i32)."""
FRAME_OVERHEAD = 28
"""Bytes of a DATA frame besides its samples."""
NO_TEMPERATURE = -327.68
"""In STATUS, of a device without a thermometer (degC)."""
STATUS_INTERVAL = 0.5
"""Time between STATUS frames (s)."""
MAX_ENCODED = MAX_FRAME + -(-MAX_FRAME // 254)
"""The same in COBS, without its delimiter (bytes)."""
_HEADER = struct.Struct("<BBHI")
_DATA = struct.Struct("<QHBBI")
_STATUS = struct.Struct("<QQIIh")


class MessageType(enum.IntEnum):
    """First byte of a frame."""

    HELLO = 0x01
    INFO = 0x02
    CONFIG = 0x03
    ACK = 0x04
    NACK = 0x05
    START = 0x06
    STOP = 0x07
    STATUS = 0x08
    EVENT = 0x09
    DATA = 0x10


@dataclass(frozen=True)
class Frame:
    """One TAPS/1 frame."""

    type: int
    """Number of a MessageType; unknown ones are passed on."""
    seq: int = 0
    """Count of the frames of one sender, modulo 2^32."""
    body: bytes = b""
    """Bytes behind the header."""
    session: int = 0
    """Number of the session, another one at each START."""
    flags: int = 0
    """Bit 0: samples were lost before this frame."""


@dataclass(frozen=True)
class Status:
    """Body of a STATUS frame."""

    samples_taken: int
    """Scans converted since START."""
    samples_sent: int
    """Scans sent since START."""
    buffer_peak_percent: int
    """Highest filling of the device's buffer (%)."""
    overruns: int
    """Number of times that buffer ran over."""
    temperature: float
    """Temperature of the board (degC)."""

    def encode(self) -> bytes:
        """The body."""
        numbers = (self.samples_taken, self.samples_sent, self.buffer_peak_percent, self.overruns)
        return _STATUS.pack(*numbers, round(self.temperature * 100))

    @classmethod
    def decode(cls, body: bytes) -> Status:
        """The status in a body; struct.error for one of the wrong length."""
        taken, sent, peak, overruns, centidegrees = _STATUS.unpack(body)
        return cls(taken, sent, peak, overruns, centidegrees / 100)


def encode_frame(frame: Frame) -> bytes:
    """The bytes of a frame, delimiter included; ValueError for one that is too long."""
    raw = _HEADER.pack(frame.type, frame.flags, frame.session, frame.seq) + frame.body
    if len(raw) + 4 > MAX_FRAME:
        raise ValueError(f"a frame of {len(raw) + 4} bytes is longer than {MAX_FRAME}; send fewer scans a frame")
    return bytes(cobs.encode(raw + struct.pack("<I", zlib.crc32(raw)))) + b"\x00"


def decode_frame(encoded: bytes) -> Frame | None:
    """The frame in COBS bytes without their delimiter; None where length, COBS or CRC do not fit."""
    if len(encoded) > MAX_ENCODED:
        return None
    try:
        raw = cobs.decode(encoded)
    except cobs.DecodeError:
        return None
    if not _HEADER.size + 4 <= len(raw) <= MAX_FRAME or zlib.crc32(raw[:-4]) != int.from_bytes(raw[-4:], "little"):
        return None
    kind, flags, session, seq = _HEADER.unpack_from(raw)
    return Frame(kind, seq, bytes(raw[_HEADER.size : -4]), session, flags)


class FrameDecoder:
    """Cuts a byte stream into frames; what is damaged is dropped and counted."""

    def __init__(self) -> None:
        """Start at an arbitrary point of the stream."""
        self._rest = b""
        self.dropped = 0
        """Pieces between two delimiters that were no frame."""

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that are complete with these bytes."""
        *pieces, unfinished = (self._rest + data).split(b"\x00")
        self._rest = unfinished[: MAX_ENCODED + 1]  # what is too long stays too long until its delimiter comes
        frames = [decode_frame(piece) for piece in pieces if piece]
        good = [frame for frame in frames if frame is not None]
        self.dropped += len(frames) - len(good)
        return good


def encode_data(first_scan: int, codes: NDArray[np.int32], bits: int = 16, overload: int = 0) -> bytes:
    """Body of a DATA frame: scans (n_channels, n_scans), interleaved, as words of 16, 24 or 32 bits."""
    n_channels, n_scans = codes.shape
    words = np.ascontiguousarray(codes.T)
    if bits == 16:
        samples = words.astype("<i2").tobytes()
    else:
        samples = words.astype("<i4").view(np.uint8).reshape(-1, 4)[:, : bits // 8].tobytes()
    return _DATA.pack(first_scan, n_scans, n_channels, SAMPLE_BITS.index(bits), overload) + samples


def decode_data(body: bytes) -> Block:
    """The block in the body of a DATA frame; ValueError where length and header disagree."""
    if len(body) < _DATA.size:
        raise ValueError(f"a DATA body of {len(body)} bytes is shorter than its header of {_DATA.size}")
    first, n_scans, n_channels, form, overload = _DATA.unpack_from(body)
    n_words = n_scans * n_channels
    if form >= len(SAMPLE_BITS) or len(body) - _DATA.size != n_words * SAMPLE_BITS[form] // 8:
        raise ValueError(f"a DATA body of {len(body)} bytes does not hold {n_words} samples of format {form}")
    codes = _decode_words(body[_DATA.size :], SAMPLE_BITS[form])
    return Block(first, codes.reshape(n_scans, n_channels).T, overload)


def _decode_words(samples: bytes, bits: int) -> NDArray[np.int32]:
    if bits == 16:
        return np.frombuffer(samples, "<i2").astype(np.int32)
    if bits == 32:
        return np.frombuffer(samples, "<i4").astype(np.int32)
    packed = np.frombuffer(samples, np.uint8).reshape(-1, 3)
    words = np.zeros((len(packed), 4), np.uint8)
    words[:, 1:] = packed
    return words.view("<i4").ravel().astype(np.int32) >> 8
