"""TAPS/1 protocol: frames and their bodies, events, and the answers of a device.

Frame = COBS( type u8 | flags u8 | session u16 | seq u32 | body | crc32 u32 ) 0x00, little-endian. The CRC is
zlib.crc32 of all before it. seq counts all frames of one sender; session changes at each START.
"""

from __future__ import annotations

import enum
import json
import re
import struct
import zlib
from collections import deque
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from cobs import cobs

from acquisition.arrays import Codes
from acquisition.channel import Block, Channel
from acquisition.source import DeviceIdentity, Event, EventKind

MAX_FRAME = 8192
"""Longest decoded frame (bytes)."""
LOST_BEFORE_FLAG = 0x01
"""Flag of a DATA frame: the device lost samples before it."""
SAMPLE_BITS = (16, 24, 32)
"""ADC word of DATA formats 0 (i16), 1 (i24 packed) and 2 (i32)."""
FRAME_OVERHEAD = 28
"""Bytes of a DATA frame besides its samples."""
NO_TEMPERATURE = -327.68
"""Temperature in STATUS of a device without a thermometer (degC)."""
MAX_ENCODED_FRAME = MAX_FRAME + -(-MAX_FRAME // 254)
"""Longest frame in COBS, without its delimiter (bytes)."""
_FRAME_HEADER = struct.Struct("<BBHI")
_DATA_HEADER = struct.Struct("<QHBBI")
_STATUS_BODY = struct.Struct("<QQIIh")


MAX_JSON_DEPTH = 8
"""Deepest nesting of the JSON in CONFIG and INFO. TAPS/1 needs 3."""
MAX_REASON_LENGTH = 200
"""Longest text of a NACK, chosen."""
_JSON_STRING = re.compile(r'"(?:[^"\\]|\\.)*"?')


class HostileFrameError(ValueError):
    """Raised for input that no TAPS/1 program sends: its connection is closed."""


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


class Frame(NamedTuple):
    """TAPS/1 frame."""

    type: int
    """Number of a MessageType. Unknown ones are passed on."""
    seq: int = 0
    """Count of the frames of one sender, modulo 2^32."""
    body: bytes = b""
    """Bytes after the header."""
    session: int = 0
    """Session number, a new one at each START."""
    flags: int = 0
    """Bit 0: samples were lost before this frame."""


class DeviceStatus(NamedTuple):
    """Body of a STATUS frame."""

    samples_taken: int
    """Scans converted since START."""
    samples_sent: int
    """Scans sent since START."""
    buffer_peak_percent: int
    """Highest fill level of the device's buffer (%)."""
    overruns: int
    """Number of overruns of that buffer."""
    temperature: float
    """Temperature of the board (degC)."""

    def encode(self) -> bytes:
        """Encode the body."""
        *counts, temperature = self
        return _STATUS_BODY.pack(*counts, round(temperature * 100))

    @classmethod
    def decode(cls, body: bytes) -> DeviceStatus:
        """Decode a body. struct.error for a wrong length."""
        taken, sent, peak, overruns, centidegrees = _STATUS_BODY.unpack(body)
        return cls(taken, sent, peak, overruns, centidegrees / 100)


def encode_frame(frame: Frame) -> bytes:
    """Encode a frame, delimiter included.

    Parameters
    ----------
    frame
        Frame to encode.

    Returns
    -------
    bytes
        COBS bytes of header, body and CRC, and a zero byte.

    Raises
    ------
    ValueError
        The frame is longer than MAX_FRAME.
    """
    raw = _FRAME_HEADER.pack(frame.type, frame.flags, frame.session, frame.seq) + frame.body
    if len(raw) + 4 > MAX_FRAME:
        raise ValueError(f"a frame of {len(raw) + 4} bytes is longer than {MAX_FRAME}. Send fewer samples per frame.")
    return bytes(cobs.encode(raw + struct.pack("<I", zlib.crc32(raw)))) + b"\x00"


def decode_frame(encoded: bytes) -> Frame | None:
    """Decode COBS bytes without their delimiter. None if length, COBS or CRC is wrong."""
    if len(encoded) > MAX_ENCODED_FRAME:
        return None
    try:
        raw = cobs.decode(encoded)
    except cobs.DecodeError:
        return None
    crc = int.from_bytes(raw[-4:], "little")
    if not _FRAME_HEADER.size + 4 <= len(raw) <= MAX_FRAME or zlib.crc32(raw[:-4]) != crc:
        return None
    kind, flags, session, seq = _FRAME_HEADER.unpack_from(raw)
    return Frame(kind, seq, bytes(raw[_FRAME_HEADER.size : -4]), session, flags)


def parse_object(body: bytes) -> dict[str, Any]:
    """Parse the JSON object in a CONFIG or INFO body. HostileFrameError for anything else, or deep nesting."""
    try:
        text = body.decode()
        brackets = re.findall(r"[][{}]", _JSON_STRING.sub("", text))
        depth = max(accumulate(1 if bracket in "[{" else -1 for bracket in brackets), default=0)
        if depth > MAX_JSON_DEPTH:
            raise ValueError(f"nested {depth} deep, limit {MAX_JSON_DEPTH}")
        content = json.loads(text)
        if not isinstance(content, dict):
            raise ValueError("not an object")
    except ValueError as error:
        raise HostileFrameError(f"the JSON in a frame is invalid ({error})") from error
    return content


class FrameDecoder:
    """Decoder of a byte stream into frames. It drops and counts damaged ones."""

    def __init__(self) -> None:
        self._rest = b""
        self.dropped = 0
        """Number of pieces between two delimiters that were no frame."""
        self.accepted = 0
        """Number of frames."""
        self.is_overlong = False
        """True while the unfinished piece is longer than any frame."""

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that these bytes complete.

        Parameters
        ----------
        data
            Received bytes, cut anywhere.
        """
        *pieces, unfinished = (self._rest + data).split(b"\x00")
        self._rest = unfinished[: MAX_ENCODED_FRAME + 1]  # what is too long stays too long until its delimiter comes
        self.is_overlong = len(self._rest) > MAX_ENCODED_FRAME
        frames = [decode_frame(piece) for piece in pieces if piece]
        good = [frame for frame in frames if frame is not None]
        self.accepted += len(good)
        self.dropped += len(frames) - len(good)
        return good


def encode_data(first_scan: int, codes: Codes, bits: int = 16, overload: int = 0) -> bytes:
    """Encode scans (n_channels, n_scans) as the body of a DATA frame, with words of 16, 24 or 32 bits."""
    n_channels, n_scans = codes.shape
    words = codes.T.astype("<i4", order="C").view(np.uint8).reshape(-1, 4)
    header = _DATA_HEADER.pack(first_scan, n_scans, n_channels, SAMPLE_BITS.index(bits), overload)
    return header + words[:, : bits // 8].tobytes()


def max_scans_per_frame(n_channels: int, bits: int) -> int:
    """Return the most scans that fit into a DATA frame with words of so many bits."""
    return (MAX_FRAME - FRAME_OVERHEAD) * 8 // (n_channels * bits)


def decode_data(body: bytes) -> Block:
    """Decode the body of a DATA frame. ValueError if length and header disagree."""
    if len(body) < _DATA_HEADER.size:
        raise ValueError(f"a DATA body of {len(body)} bytes is shorter than its header of {_DATA_HEADER.size}")
    first, n_scans, n_channels, form, overload = _DATA_HEADER.unpack_from(body)
    n_words = n_scans * n_channels
    if form >= len(SAMPLE_BITS) or len(body) - _DATA_HEADER.size != n_words * SAMPLE_BITS[form] // 8:
        raise ValueError(f"a DATA body of {len(body)} bytes cannot contain {n_words} samples of format {form}")
    codes = _decode_words(body[_DATA_HEADER.size :], SAMPLE_BITS[form])
    return Block(first, codes.reshape(n_scans, n_channels).T, overload)


def _decode_words(samples: bytes, bits: int) -> Codes:
    if bits != 24:
        return np.frombuffer(samples, f"<i{bits // 8}").astype(np.int32)
    packed = np.frombuffer(samples, np.uint8).reshape(-1, 3)
    words = np.zeros((len(packed), 4), np.uint8)
    words[:, 1:] = packed
    return words.view("<i4").ravel().astype(np.int32) >> 8


MAX_PENDING_EVENTS = 256
"""Events kept until a consumer takes them."""
_EVENT_BODY = struct.Struct("<BBBQ")
_NO_CHANNEL = 0xFF

_FAULT_TEXTS = {
    EventKind.CABLE: "The cable of the {} sensor is broken or not plugged in. Check both ends of the cable.",
    EventKind.SENSOR_BIAS: "The bias voltage of the {} sensor is out of range. Check the sensor, its cable and the "
    "IEPE switch.",
}


def encode_event(event: Event) -> bytes:
    """Encode the body of an EVENT frame."""
    channel = _NO_CHANNEL if event.channel is None else event.channel
    return _EVENT_BODY.pack(event.kind, channel, event.begins, event.scan)


def decode_event(body: bytes) -> Event:
    """Decode the body of an EVENT frame. struct.error for a wrong length."""
    kind, channel, begins, scan = _EVENT_BODY.unpack(body)
    return Event(kind, bool(begins), None if channel == _NO_CHANNEL else channel, scan)


class EventLog:
    """Pending events and active faults. One thread adds, any other may read."""

    def __init__(self) -> None:
        self.new: deque[Event] = deque(maxlen=MAX_PENDING_EVENTS)
        self._standing: tuple[Event, ...] = ()
        self._last: tuple[int, int] | None = None

    def add(self, frame: Frame) -> None:
        """Add an EVENT frame. A repeated or invalid one changes nothing."""
        if self._last == (frame.session, frame.seq):
            return
        self._last = frame.session, frame.seq
        try:
            event = decode_event(frame.body)
        except struct.error:
            return
        self.new.append(event)
        remaining = (fault for fault in self._standing if (fault.kind, fault.channel) != (event.kind, event.channel))
        self._standing = (*remaining, event) if event.begins and event.kind in _FAULT_TEXTS else tuple(remaining)

    def fault(self, channels: Mapping[int, Channel]) -> str:
        """Describe the active faults and their remedies, empty if there are none. channels: by their i in INFO."""
        names: dict[int | None, str] = {number: channel.quantity for number, channel in channels.items()}
        names[None] = "force or acceleration"
        standing = [(event.kind, names.get(event.channel, f"(channel {event.channel})")) for event in self._standing]
        return " ".join(_FAULT_TEXTS[EventKind(kind)].format(name) for kind, name in standing)


KNOWS_SENSORS_KEY = "emulates_sensors"
"""Key of INFO that is true for an emulated device whose sensitivities are the true ones of its signals."""


def build_info(
    identity: DeviceIdentity, channels: Sequence[Channel], rate: float, *, follows_clock: bool
) -> dict[str, Any]:
    """Build the body of INFO for a device with one sample rate (Hz)."""
    emulated = {KNOWS_SENSORS_KEY: True} if identity.knows_sensors else {}
    return emulated | {
        "proto": 1,
        "model": identity.model,
        "serial": identity.serial,
        "fw": identity.firmware,
        "adc_bits": max(channel.adc_bits for channel in channels),
        "fs_choices": [rate],
        "simultaneous": True,
        "clock_ppm": 0 if follows_clock else None,
        "channels": [
            {
                "i": i,
                "name": channel.quantity,
                "quantity": channel.quantity,
                "sens_V_per_EU": channel.sensitivity,
                "sens_date": channel.calibration_date,
                "sensor_serial": channel.serial_number,
                "direction": channel.direction,
                "fs_V": channel.full_scale,
                "gain": 1.0,
                "coupling": "IEPE",
                "skew_s": channel.skew,
                "delay_s": 0.0,
            }
            for i, channel in enumerate(channels)
        ],
    }
